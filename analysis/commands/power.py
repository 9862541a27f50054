"""The command ``power``: how many people and trials a study needs."""

from __future__ import annotations

import secrets
import signal
import sys
import time
from collections import deque
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from experiment.commands.options.hardware import working
from experiment.terms.exits import ANSWER_IS_NO, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from analysis.power.goals import Goal
    from analysis.power.population import People
    from analysis.power.promise import Promise
    from experiment.study.study import Study


_MOST_PEOPLE = 1000
_MOST_TRIALS = 10_000
_LONG_S = 120.0
_SPREAD = (
    "; --workers N shares them out, --participants A B limits the search, --keep FILE"
    " lets the same command go on"
)
_WORTH_TELLING_S = 10
_DRAWN_EVERY_S = 1.0
_TOLD_EVERY_S = 30.0
"""Off a terminal, where no bar is drawn."""
_LATELY_S = 20.0
_IN_SECONDS_S = 55.0


_GROUPS = {
    "Goal": ("goal_text", "participants", "assurance"),
    "Design": ("trials", "blanks", "levels"),
    "Population": ("pilot", "columns", "population"),
    "Computation": ("seed", "workers", "scheduler", "keep"),
}


class _Grouped(click.Command):
    """A command whose help has its options by what they are about."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        options = [one for one in self.get_params(ctx) if isinstance(one, click.Option)]
        records = {one.name: one.get_help_record(ctx) for one in options}
        told = {name: record for name, record in records.items() if record}
        for title, names in _GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([told.pop(name) for name in names])
        with formatter.section("Output"):
            formatter.write_dl([*told.values()])


class Progress:
    """How far a search is, and what it knows so far, told now and then.

    A terminal has both in the line that is drawn there, others have a line every half minute. The
    time that is left is told by how fast the work was done lately.
    """

    def __init__(
        self,
        show: Callable[[int, int, str], object],
        *,
        terminal: bool,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._show, self._terminal, self._clock = show, terminal, clock
        self._done, self._known, self._told_s = 0.0, "", clock()
        self._lately = deque([(self._told_s, 0.0)])

    def step(self, part: float, ahead: float, so_far: Callable[[], str]) -> None:
        """Take in that so much more is done; `so_far` says what is known."""
        self._done += part
        now_s = self._clock()
        if now_s - self._told_s > (_DRAWN_EVERY_S if self._terminal else _TOLD_EVERY_S):
            self._told_s = now_s
            known = [f"about {_duration(self._left_s(now_s, ahead))} left", so_far()]
            self._known = "; ".join(filter(None, known))
            if not self._terminal:
                click.echo(self._known, err=True)
        self._show(round(self._done), max(round(self._done + ahead), 1), self._known)

    def _left_s(self, now_s: float, ahead: float) -> float:
        """Return how long it takes to do what is ahead as fast as was worked lately."""
        self._lately.append((now_s, self._done))
        while len(self._lately) > 2 and now_s - self._lately[1][0] >= _LATELY_S:  # noqa: PLR2004
            self._lately.popleft()
        since_s, before = self._lately[0]
        return ahead * (now_s - since_s) / max(self._done - before, 1e-6)


def _duration(seconds: float) -> str:
    """Say about how long.

    >>> _duration(8.2), _duration(60.0), _duration(400.0), _duration(20000.0)
    ('10 s', '1 minute', '7 minutes', '6 hours')
    """
    if seconds < _IN_SECONDS_S:
        return f"{10 * max(1, round(seconds / 10))} s"
    number, unit = round(seconds / 60), "minute"
    if number > 2 * 60:
        number, unit = round(seconds / 3600), "hour"
    return f"{number} {unit}{'s' * (number > 1)}"


def _predicted(least_s: float, most_s: float) -> str:
    """Say about how much processor time a search takes, by where its answer lies.

    >>> _predicted(14.0, 58.0), _predicted(30.0, 290.0), _predicted(12.0, 13.0)
    ('About 10 s to 1 minute of one core, by where the answer lies',
     'About 30 s to 5 minutes of one core, by where the answer lies', 'About 10 s of one core')
    """
    low, high = _duration(least_s), _duration(most_s)
    if low == high:
        return f"About {high} of one core"
    return f"About {low} to {high} of one core, by where the answer lies"


@click.command(
    cls=_Grouped,
    epilog="""\b
    Goals (--goal):
      half-width=1dB     The interval of the group's threshold is at most +-1 dB.
      difference=1dB     A difference of 1 dB between two conditions is detected.
      detection=10%@95V  The detection probability at 95 V is known to +-10 %.
      false-alarms=5%    The false-alarm rate is shown to be below 5 %.

    Example: tactstrip power study.toml --people literature --participants 12 12""",
)
@click.argument("study_file", metavar="STUDY", type=click.Path(path_type=Path))
@click.option(
    "--goal",
    "goal_text",
    default="half-width=1dB",
    show_default=True,
    metavar="GOAL",
    help="Goal that a study must reach (see below).",
)
@click.option(
    "--participants",
    type=click.IntRange(1, _MOST_PEOPLE),
    nargs=2,
    default=(2, 40),
    show_default=True,
    metavar="MIN MAX",
    help="Range of the number of participants.",
)
@click.option(
    "--trials",
    type=click.IntRange(1, _MOST_TRIALS),
    nargs=2,
    metavar="MIN MAX",
    show_default="that of the study",
    help="Range of the number of trials per side.",
)
@click.option(
    "--blanks",
    type=click.IntRange(1, _MOST_TRIALS),
    nargs=2,
    metavar="MIN MAX",
    show_default="that of the study",
    help="Range of the number of blank trials.",
)
@click.option(
    "--levels",
    type=click.Choice(["fixed", "placed"]),
    default="fixed",
    show_default=True,
    help="Use the levels of the study (fixed), or levels chosen for each participant and condition "
    "from a simulated pilot of 40 stimuli (placed).",
)
@click.option(
    "--assurance",
    type=click.FloatRange(0.05, 0.99),
    default=0.8,
    show_default=True,
    metavar="SHARE",
    help="Proportion of simulated studies that must reach the goal.",
)
@click.option(
    "--pilot",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Estimate the population from the sessions of a pilot, or from an external table.",
)
@click.option(
    "--columns",
    type=click.Path(path_type=Path),
    metavar="MAP.toml",
    help="Column map of an external --pilot table, as for `tactstrip analyze`. Levels in volts are "
    "read as voltages of the study.",
)
@click.option(
    "--people",
    "population",
    type=click.Choice(["stated", "literature"]),
    default="stated",
    show_default=True,
    help="Require the population parameters in [simulation] (stated), or take missing ones from "
    "the literature (literature).",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    metavar="N",
    show_default="random, printed",
    help="Seed of the simulation.",
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
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
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Save intermediate results in this file. The same command continues from it.",
)
@click.option(
    "--figure",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.png",
    help="Also draw the power curve, as PNG or SVG.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of text.")
@refusals
def power(
    *,
    study_file: Path,
    goal_text: str,
    participants: tuple[int, int],
    trials: tuple[int, int] | None,
    blanks: tuple[int, int] | None,
    levels: str,
    assurance: float,
    pilot: Path | None,
    columns: Path | None,
    population: str,
    seed: int | None,
    workers: int,
    scheduler: str | None,
    keep: Path | None,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Estimate how many participants and trials a study needs.

    tactstrip simulates studies with the population in [simulation], analyzes them like `tactstrip
    analyze`, and searches for the smallest number of participants that reaches the goal (see
    docs/power.md). The exit code is 1 if no number in the range reaches it.
    """
    from analysis.power.goals import Goal
    from analysis.power.planning import plan_study
    from analysis.power.promise import as_json as told_as_json
    from analysis.power.promise import text
    from analysis.workers.kept import computed_in
    from experiment.study.read import read_study
    from experiment.study.study import told_by_file

    goal = Goal.parse(goal_text)
    _require_usage({"participants": participants, "trials": trials, "blanks": blanks}, figure)
    if seed is None:
        seed = int((computed_in(keep) if keep else {}).get("seed", secrets.randbits(32)))
    with told_by_file(study_file):
        people = _people(read_study(study_file), goal, pilot, columns, population)
    computed = {"study": people.study.sha256, "goal": goal_text, "seed": seed}
    tell = told_as_json if as_json else text
    spreading = _spreading(workers, scheduler, keep, computed)
    with (
        _stopped(tell) as stopped,
        spreading as spread,
        told_by_file(study_file),
        working("Simulating") as show,
    ):
        terminal = sys.stderr.isatty()

        def predicted(least_s: float, most_s: float) -> None:
            if most_s > _WORTH_TELLING_S or terminal:
                told = _predicted(least_s, most_s)
                click.echo(f"{told}{_SPREAD * (most_s > _LONG_S)}", err=True)

        promise = plan_study(
            people,
            goal,
            participants=participants,
            trials_per_side=trials or None,
            blanks=blanks or None,
            placed=levels == "placed",
            assurance=assurance,
            seed=seed,
            spread=spread,
            predicted=predicted,
            step=Progress(show, terminal=terminal).step,
            stopped=stopped,
        )
    click.echo(tell(promise))
    if figure is not None:
        from analysis.power.figure import write_figure

        write_figure(promise, figure)
    if promise.best is None:
        click.get_current_context().exit(ANSWER_IS_NO)


def _require_usage(bounds: Mapping[str, tuple[int, int] | None], figure: Path | None) -> None:
    for name, pair in bounds.items():
        if pair is not None and pair[0] > pair[1]:
            raise CommandError(
                f"--{name} must be the least and the most; got {pair[0]} and {pair[1]}"
            )
    if figure is not None and figure.suffix not in {".png", ".svg"}:
        raise CommandError(f"--figure must end in .png or .svg; got {figure}")


@contextmanager
def _stopped(tell: Callable[[Promise], str]) -> Iterator[Callable[[Promise], object]]:
    """Tell what is known where a search was stopped, once its line is taken from the terminal."""
    partial: list[Promise] = []
    try:
        yield partial.append
    except (KeyboardInterrupt, CommandError):
        for one in partial:
            if one.tried:
                click.echo(tell(one))
        raise


def _people(
    study: Study, goal: Goal, pilot: Path | None, columns: Path | None, whose: str
) -> People:
    """Return the people of a pilot, of the study, or of the literature."""
    from analysis.power.population import literature_people, pilot_people, stated_people
    from analysis.reading.foreign.columns import load_column_map
    from analysis.reading.load import read_inputs

    if pilot is not None and whose != "stated":
        raise CommandError("--pilot and --people literature exclude each other; got both")
    if columns is not None and pilot is None:
        raise CommandError("--columns needs --pilot, the tables that it maps; got none")
    if pilot is None:
        return (literature_people if whose == "literature" else stated_people)(study, goal)
    loaded = read_inputs([pilot], load_column_map(columns) if columns else None)
    return pilot_people(study, goal, loaded, str(pilot))


@contextmanager
def _spreading(
    workers: int, scheduler: str | None, keep: Path | None, computed: Mapping[str, object]
) -> Iterator[Callable[..., Any]]:
    """Have the work spread as the options say; a stop tells what is kept.

    SIGTERM, as of a queue's time limit, stops it like Ctrl-C: no process is left, nor a message of
    theirs.
    """
    from analysis.workers.chunks import spread
    from analysis.workers.crew import StoppedError
    from analysis.workers.kept import Kept
    from stimuli.tuned import keep_freed_memory

    keep_freed_memory()
    if scheduler and workers > 1:
        raise CommandError(
            f"--workers is of this computer, beside --scheduler it must be left out; got {workers}"
        )
    goes_on = f"the same command goes on from {keep}"
    with ExitStack() as stack:
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        stack.callback(signal.signal, signal.SIGTERM, before)
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
