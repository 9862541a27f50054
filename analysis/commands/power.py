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

from device.printing import echo
from experiment.commands.options.hardware import working
from experiment.exits import ANSWER_IS_NO, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from analysis.power.goals import Goal
    from analysis.power.population import People
    from analysis.power.promise import Promise
    from experiment.study.study import Study


_MAX_PARTICIPANTS = 1000
_MAX_TRIALS = 10_000
_LONG_SEARCH_S = 120.0
_LONG_SEARCH_HINT = (
    "; --workers N shares them out, --participants A B limits the search, --keep FILE"
    " lets the same command go on"
)
_MIN_PREDICTION_S = 10
"""In a pipe, shorter predictions are not printed."""
_TERMINAL_INTERVAL_S = 1.0
_PIPE_INTERVAL_S = 30.0
_SPEED_WINDOW_S = 20.0
"""The remaining time follows from the speed of the work in this last time."""
_MAX_SECONDS_S = 55.0
"""Longer durations are given in minutes."""


_OPTION_GROUPS = {
    "Goal": ("goal_text", "participants", "assurance"),
    "Design": ("trials", "blanks", "levels"),
    "Population": ("pilot", "columns", "population"),
    "Computation": ("seed", "workers", "scheduler", "keep"),
}


class _GroupedOptionsCommand(click.Command):
    """A command whose help lists the options in groups."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        options = {
            param.name: record
            for param in self.get_params(ctx)
            if isinstance(param, click.Option) and (record := param.get_help_record(ctx))
        }
        for title, names in _OPTION_GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([options.pop(name) for name in names])
        with formatter.section("Output"):
            formatter.write_dl([*options.values()])


class Progress:
    """The progress of a search: remaining time and intermediate result.

    On a terminal they stand beside the progress bar; in a pipe they are printed as a line every
    half minute. The remaining time follows from the speed of the last `_SPEED_WINDOW_S` seconds.
    """

    def __init__(
        self,
        show: Callable[[int, int, str], object],
        *,
        terminal: bool,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._show, self._terminal, self._clock = show, terminal, clock
        self._done, self._message, self._message_s = 0.0, "", clock()
        self._history = deque([(self._message_s, 0.0)])

    def step(self, done: float, remaining: float, result: Callable[[], str]) -> None:
        """Add the work just `done`; `result` formats the intermediate result."""
        self._done += done
        now_s = self._clock()
        interval_s = _TERMINAL_INTERVAL_S if self._terminal else _PIPE_INTERVAL_S
        if now_s - self._message_s > interval_s:
            self._message_s = now_s
            time_left = f"about {_duration(self._remaining_s(now_s, remaining))} left"
            self._message = "; ".join(filter(None, [time_left, result()]))
            if not self._terminal:
                echo(self._message, err=True)
        self._show(round(self._done), max(round(self._done + remaining), 1), self._message)

    def _remaining_s(self, now_s: float, remaining: float) -> float:
        """Return the time that the remaining work takes at the recent speed."""
        history = self._history
        history.append((now_s, self._done))
        while len(history) > 2 and now_s - history[1][0] >= _SPEED_WINDOW_S:  # noqa: PLR2004
            history.popleft()
        start_s, start_done = history[0]
        return remaining * (now_s - start_s) / max(self._done - start_done, 1e-6)


def _duration(seconds: float) -> str:
    """Format a duration, rounded to one number and unit.

    >>> _duration(8.2), _duration(60.0), _duration(400.0), _duration(20000.0)
    ('10 s', '1 minute', '7 minutes', '6 hours')
    """
    if seconds < _MAX_SECONDS_S:
        return f"{10 * max(1, round(seconds / 10))} s"
    number, unit = round(seconds / 60), "minute"
    if number > 2 * 60:
        number, unit = round(seconds / 3600), "hour"
    return f"{number} {unit}{'s' * (number > 1)}"


def _format_prediction(min_s: float, max_s: float) -> str:
    """Format the range of processor time that a search may take.

    >>> _format_prediction(14.0, 58.0), _format_prediction(30.0, 290.0)
    ('About 10 s to 1 minute of one core, by where the answer lies',
     'About 30 s to 5 minutes of one core, by where the answer lies')
    >>> _format_prediction(12.0, 13.0)
    'About 10 s of one core'
    """
    low, high = _duration(min_s), _duration(max_s)
    if low == high:
        return f"About {high} of one core"
    return f"About {low} to {high} of one core, by where the answer lies"


@click.command(
    cls=_GroupedOptionsCommand,
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
    type=click.IntRange(1, _MAX_PARTICIPANTS),
    nargs=2,
    default=(2, 40),
    show_default=True,
    metavar="MIN MAX",
    help="Range of the number of participants.",
)
@click.option(
    "--trials",
    type=click.IntRange(1, _MAX_TRIALS),
    nargs=2,
    metavar="MIN MAX",
    show_default="that of the study",
    help="Range of the number of trials per side.",
)
@click.option(
    "--blanks",
    type=click.IntRange(1, _MAX_TRIALS),
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
    from analysis.power.promise import as_json as format_json
    from analysis.power.promise import text as format_text
    from analysis.workers.kept import computed_in
    from experiment.study.files import naming, read_study

    goal = Goal.parse(goal_text)
    _require_usage({"participants": participants, "trials": trials, "blanks": blanks}, figure)
    if seed is None:
        seed = int((computed_in(keep) if keep else {}).get("seed", secrets.randbits(32)))
    with naming(study_file):
        people = _people(read_study(study_file), goal, pilot, columns, population)
    computed = {"study": people.study.sha256, "goal": goal_text, "seed": seed}
    format_promise = format_json if as_json else format_text
    distribution = _distributed_work(workers, scheduler, keep, computed)
    with (
        _partial_result(format_promise) as stopped,
        distribution as spread,
        naming(study_file),
        working("Simulating") as show,
    ):
        terminal = sys.stderr.isatty()

        def print_prediction(min_s: float, max_s: float) -> None:
            if max_s > _MIN_PREDICTION_S or terminal:
                hint = _LONG_SEARCH_HINT if max_s > _LONG_SEARCH_S else ""
                echo(f"{_format_prediction(min_s, max_s)}{hint}", err=True)

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
            predicted=print_prediction,
            step=Progress(show, terminal=terminal).step,
            stopped=stopped,
        )
    echo(*format_promise(promise).split("\n"))
    if figure is not None:
        from analysis.power.figure import write_figure

        write_figure(promise, figure)
    if promise.best is None:
        click.get_current_context().exit(ANSWER_IS_NO)


def _require_usage(bounds: Mapping[str, tuple[int, int] | None], figure: Path | None) -> None:
    for name, pair in bounds.items():
        if pair is not None and pair[0] > pair[1]:
            raise CommandError(
                f"--{name} must be MIN and MAX, with MIN <= MAX; got {pair[0]} and {pair[1]}"
            )
    if figure is not None and figure.suffix not in {".png", ".svg"}:
        raise CommandError(f"--figure must end in .png or .svg; got {figure}")


@contextmanager
def _partial_result(
    format_promise: Callable[[Promise], str],
) -> Iterator[Callable[[Promise], object]]:
    """Print the result so far of a search that was stopped, after its progress bar is removed."""
    promises: list[Promise] = []
    try:
        yield promises.append
    except (KeyboardInterrupt, CommandError):
        for promise in promises:
            if promise.tried:
                echo(*format_promise(promise).split("\n"))
        raise


def _people(
    study: Study, goal: Goal, pilot: Path | None, columns: Path | None, population: str
) -> People:
    """Return the population of a pilot, of the study, or of the literature."""
    from analysis.power.population import literature_people, pilot_people, stated_people
    from analysis.reading.foreign.columns import load_column_map
    from analysis.reading.load import read_inputs

    if pilot is not None and population != "stated":
        raise CommandError("--pilot and --people literature exclude each other; got both")
    if columns is not None and pilot is None:
        raise CommandError("--columns needs --pilot, the tables that it maps; got none")
    if pilot is None:
        return (literature_people if population == "literature" else stated_people)(study, goal)
    loaded = read_inputs([pilot], load_column_map(columns) if columns else None)
    return pilot_people(study, goal, loaded, str(pilot))


@contextmanager
def _distributed_work(
    workers: int, scheduler: str | None, keep: Path | None, computed: Mapping[str, object]
) -> Iterator[Callable[..., Any]]:
    """Distribute the work as the options say; the message of a stop says how to continue.

    SIGTERM, such as at the time limit of a batch queue, acts like Ctrl-C, so that no worker process
    survives and none prints a traceback.
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
    continues = f"the same command goes on from {keep}"
    with ExitStack() as stack:
        previous_handler = signal.signal(signal.SIGTERM, signal.default_int_handler)
        stack.callback(signal.signal, signal.SIGTERM, previous_handler)
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
                tell=partial(echo, err=True),
            )
        except StoppedError as error:
            hint = continues if keep else "--keep FILE keeps what is finished"
            raise CommandError(f"{error}; {hint}", exit_code=STOPPED_EARLY) from error
        except KeyboardInterrupt as error:
            if keep is None:
                raise
            raise CommandError(f"interrupted; {continues}", exit_code=STOPPED_EARLY) from error
