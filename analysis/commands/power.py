"""The command ``power``: how many people and trials a study needs."""

from __future__ import annotations

import secrets
from pathlib import Path

import click

from experiment.terms.exits import ANSWER_IS_NO, CommandError, refusals

_MOST_PEOPLE = 1000


@click.command()
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option(
    "--goal",
    "goal_text",
    default="half-width=1dB",
    show_default=True,
    metavar="GOAL",
    help="half-width=1dB, difference=1dB, detection=10%@95V or false-alarms=5%.",
)
@click.option(
    "--participants",
    type=click.IntRange(1, _MOST_PEOPLE),
    nargs=2,
    default=(2, 40),
    show_default=True,
    metavar="LEAST MOST",
    help="Numbers of people to try.",
)
@click.option(
    "--assurance",
    type=click.FloatRange(0.05, 0.99),
    default=0.8,
    show_default=True,
    metavar="SHARE",
    help="How often the goal is to be reached.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Random by default, printed.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
@refusals
def power(
    *,
    study_file: Path,
    goal_text: str,
    participants: tuple[int, int],
    assurance: float,
    seed: int | None,
    as_json: bool,
) -> None:
    """Tell how many people a study needs, before the first one comes.

    Studies of the people that [simulation] states are simulated and analyzed as `analyze` does it.
    The exit code is 1 if no number within the bounds reaches the goal.
    """
    from analysis.power.goals import Goal
    from analysis.power.planning import plan_study
    from analysis.power.promise import as_json as told_as_json
    from analysis.power.promise import text
    from experiment.study.read import read_study
    from experiment.study.study import told_by_file

    goal = Goal.parse(goal_text)
    if participants[0] > participants[1]:
        raise CommandError(
            f"--participants must be the least and the most; got {participants[0]} and "
            f"{participants[1]}"
        )
    seed = secrets.randbits(32) if seed is None else seed
    with told_by_file(study_file):
        study = read_study(study_file)
        promise = plan_study(study, goal, participants=participants, assurance=assurance, seed=seed)
    click.echo(told_as_json(promise) if as_json else text(promise))
    if not promise.reachable:
        raise CommandError(promise.why_not, exit_code=ANSWER_IS_NO)
