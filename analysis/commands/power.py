"""The command ``power``: how many people and trials a study needs."""

from __future__ import annotations

import secrets
import signal
import time
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import click

from device.printing import echo
from experiment.commands.options.common import PATH, json_option, seed_option
from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from analysis.planning.goals import Goal
    from analysis.planning.people import People
    from experiment.study.study import Study

_TEXT_WIDTH = 100
_FILE = click.Path(path_type=Path, dir_okay=False)


def _check_range(
    _context: object, option: click.Parameter, ends: tuple[int, int] | None
) -> tuple[int, int] | None:
    if ends and ends[0] > ends[1]:
        message = "must be MIN and MAX, with MIN <= MAX; got {} and {}".format(*ends)
        raise CommandError(f"{option.opts[0]} {message}")
    return ends or None


_range_option = partial(
    click.option, type=click.IntRange(1, 1000), nargs=2, metavar="MIN MAX", callback=_check_range
)


def _check_figure(_context: object, _option: object, path: Path | None) -> Path | None:
    if path is not None and path.suffix not in {".png", ".svg"}:
        raise CommandError(f"--figure must end in .png or .svg; got {path}")
    return path


@click.command(
    context_settings={"show_default": True},
    epilog="""\b
    Goals (--goal):
      half-width=2dB     The interval of the group's threshold is at most +-2 dB.
      difference=1dB     A difference of 1 dB between two conditions is detected.
      detection=10%@95V  The detection probability at 95 V is known to +-10 %.
      false-alarms=5%    The false-alarm rate is shown to be below 5 %.

    Example: tactstrip power study.toml --goal half-width=2dB --assurance 0.9""",
)
@click.argument("study_file", metavar="STUDY", type=PATH)
@click.option(
    *("--goal", "goal_text"),
    default="half-width=2dB",
    metavar="GOAL",
    help="Goal that a study must reach (see below).",
)
@_range_option("--participants", default=(2, 40), help="Range of the number of participants.")
@_range_option(
    "--trials",
    "trials_per_side",
    help="Range of the number of trials per side; by default the study's.",
)
@_range_option("--blanks", help="Range of the number of blank trials; by default the study's.")
@click.option(
    "--levels",
    type=click.Choice(["fixed", "placed"]),
    default="fixed",
    help="Use the levels of the study (fixed), or levels chosen for each participant and condition "
    "from a simulated pilot of 20 stimuli at each site (placed).",
)
@click.option(
    "--assurance",
    type=click.FloatRange(0.05, 0.99),
    default=0.8,
    metavar="SHARE",
    help="Proportion of simulated studies that must reach the goal.",
)
@click.option(
    "--pilot",
    type=PATH,
    metavar="DIR",
    help="Estimate the population from the sessions of a pilot, or from an external table.",
)
@click.option(
    "--columns",
    type=PATH,
    metavar="MAP.toml",
    help="Column map of an external --pilot table, as for `tactstrip analyze`. Levels in volts are "
    "read as voltages of the study.",
)
@click.option(
    *("--people", "population"),
    type=click.Choice(["literature", "stated"]),
    help="Take population parameters that [simulation] leaves out from the literature "
    "(literature, the default), or require them there (stated).",
)
@seed_option(help="Seed of the simulation; by default a random one, which is printed.")
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    metavar="N",
    help="Number of processes on this computer.",
)
@click.option(
    "--scheduler",
    metavar="tcp://HOST:PORT",
    help="Compute on the Dask cluster with this scheduler.",
)
@click.option(
    "--keep",
    type=_FILE,
    help="Save intermediate results in this file. The same command continues from it.",
)
@click.option(
    "--figure",
    type=_FILE,
    callback=_check_figure,
    help="Also draw the power curve, as PNG or SVG.",
)
@json_option
@refusals
def power(
    *,
    study_file: Path,
    goal_text: str,
    levels: str,
    pilot: Path | None,
    columns: Path | None,
    population: str | None,
    seed: int | None,
    workers: int,
    scheduler: str | None,
    keep: Path | None,
    figure: Path | None,
    as_json: bool,
    **ranges: Any,
) -> None:
    """Estimate how many participants and trials a study needs.

    tactstrip simulates studies with the population in [simulation], analyzes them like `tactstrip
    analyze`, and estimates the smallest number of participants that reaches the goal (see
    docs/power.md). The exit code is 1 if no number in the range reaches it.
    """
    from analysis.planning.curve import plan_study
    from analysis.planning.goals import Goal
    from analysis.planning.spread import Kept, StoppedError, computing_on, seed_in, spread
    from experiment.study.files import naming, read_study

    # The time limit of a batch queue stops the command as Ctrl-C does.
    previous_handler = signal.signal(signal.SIGTERM, signal.default_int_handler)
    restore = partial(signal.signal, signal.SIGTERM, previous_handler)
    click.get_current_context().call_on_close(restore)
    goal = Goal.parse(goal_text)
    if scheduler and workers > 1:
        raise CommandError(f"--workers and --scheduler exclude each other; got {workers}")
    seed = seed_in(keep) if seed is None else seed
    seed = secrets.randbits(32) if seed is None else seed
    with naming(study_file):
        study = read_study(study_file)
        people = _people(study, goal, pilot, columns, population)
    computed = {"study": people.study.sha256, "goal": goal_text, "seed": seed}
    kept = Kept(keep, computed) if keep else None
    hint = f"the same command continues from {keep}" if keep else "--keep FILE saves the work"
    start_s = time.monotonic()
    try:
        with computing_on(workers, scheduler), naming(study_file), working("Simulating") as show:

            def step(done: float, total: float) -> None:
                left_s = (time.monotonic() - start_s) * (total - done) / done
                show(round(100 * done / total), 100, f"about {left_s:.0f} s left")

            result = plan_study(
                people,
                goal,
                placed=levels == "placed",
                seed=seed,
                spread=partial(spread, kept=kept),
                step=step,
                **ranges,
            )
    except StoppedError as error:
        raise CommandError(f"{error}; {hint}", exit_code=STOPPED_EARLY) from error
    except KeyboardInterrupt:
        if kept is None:
            raise
        raise CommandError(f"stopped; {hint}", exit_code=STOPPED_EARLY) from None
    if as_json:
        echo(*result.json().split("\n"))
    else:
        echo(*_wrap(result.text()))
    if figure is not None:
        from analysis.planning.figure import write_figure

        write_figure(result, figure)
    if result.best is None:
        click.get_current_context().exit(ANSWER_IS_NO)


def _wrap(text: str) -> Iterator[str]:
    """Wrap the lines of a text, and indent what continues an indented line."""
    for line in text.split("\n"):
        indent = "    " if line.startswith("  ") else ""
        yield from wrap(line, _TEXT_WIDTH, subsequent_indent=indent) or [""]


def _people(
    study: Study, goal: Goal, pilot: Path | None, columns: Path | None, population: str | None
) -> People:
    """Return the population of a pilot, of the study, or of the literature."""
    from analysis.planning.people import literature_people, pilot_people, stated_people
    from analysis.reading.columns import load_column_map
    from analysis.reading.trials import read_inputs

    if pilot is not None and population is not None:
        raise CommandError("--pilot and --people exclude each other; got both")
    if columns is not None and pilot is None:
        raise CommandError("--columns needs --pilot, the tables that it maps; got none")
    if pilot is None:
        return (stated_people if population == "stated" else literature_people)(study, goal)
    loaded = read_inputs([pilot], load_column_map(columns) if columns else None)
    return pilot_people(study, goal, loaded, str(pilot))
