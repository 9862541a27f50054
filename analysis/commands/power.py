"""The command ``power``: how many people and trials a study needs."""

from __future__ import annotations

import secrets
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from experiment.terms.exits import ANSWER_IS_NO, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping


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
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Processes of this computer.",
)
@click.option("--scheduler", metavar="tcp://HOST:PORT", help="Of a Dask cluster to compute on.")
@click.option(
    "--keep",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Keep what is computed in a file, and go on from it.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
@refusals
def power(
    *,
    study_file: Path,
    goal_text: str,
    participants: tuple[int, int],
    assurance: float,
    seed: int | None,
    workers: int,
    scheduler: str | None,
    keep: Path | None,
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
    from analysis.workers.kept import computed_in
    from experiment.study.read import read_study
    from experiment.study.study import told_by_file

    goal = Goal.parse(goal_text)
    if participants[0] > participants[1]:
        raise CommandError(
            f"--participants must be the least and the most; got {participants[0]} and "
            f"{participants[1]}"
        )
    if seed is None:
        kept = computed_in(keep) if keep else {}
        seed = int(kept.get("seed", secrets.randbits(32)))
    with told_by_file(study_file):
        study = read_study(study_file)
    computed = {"study": study.sha256, "goal": goal_text, "seed": seed}
    with _spreading(workers, scheduler, keep, computed) as spread, told_by_file(study_file):
        promise = plan_study(
            study, goal, participants=participants, assurance=assurance, seed=seed, spread=spread
        )
    click.echo(told_as_json(promise) if as_json else text(promise))
    if not promise.reachable:
        raise CommandError(promise.why_not, exit_code=ANSWER_IS_NO)


@contextmanager
def _spreading(
    workers: int, scheduler: str | None, keep: Path | None, computed: Mapping[str, object]
) -> Iterator[Callable[..., Any]]:
    """Have the work spread as the options say; a stop tells what is kept."""
    from analysis.workers.chunks import spread
    from analysis.workers.crew import StoppedError
    from analysis.workers.kept import Kept

    if scheduler and workers > 1:
        raise CommandError(
            f"--workers is of this computer, beside --scheduler it must be left out; got {workers}"
        )
    goes_on = f"the same command goes on from {keep}"
    with ExitStack() as stack:
        kept = stack.enter_context(Kept(keep, computed)) if keep else None
        client: object = None
        if scheduler:
            from analysis.workers.cluster import connected

            client = stack.enter_context(connected(scheduler))
        try:
            yield partial(
                spread,
                workers=workers,
                scheduler=client,
                kept=kept,
                tell=partial(click.echo, err=True),
            )
        except StoppedError as error:
            hint = goes_on if keep else "--keep FILE keeps what is finished"
            raise CommandError(f"{error}; {hint}", STOPPED_EARLY) from error
        except KeyboardInterrupt as error:
            if keep is None:
                raise
            raise CommandError(f"interrupted; {goes_on}", STOPPED_EARLY) from error
