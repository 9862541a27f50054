"""The command ``power``: how many people and trials a study needs."""

from __future__ import annotations

import math
import secrets
import signal
import sys
import time
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from experiment.commands.options import working
from experiment.terms.exits import ANSWER_IS_NO, STOPPED_EARLY, CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from analysis.power.goals import Goal
    from analysis.power.population import People
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


_GROUPS = {
    "What is asked": ("goal_text", "participants", "assurance"),
    "The design": ("trials", "blanks", "levels"),
    "The people": ("pilot", "whose"),
    "Where it is computed": ("seed", "workers", "scheduler", "keep"),
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
        with formatter.section("What is told"):
            formatter.write_dl([*told.values()])


class Progress:
    """How far a search is, and what it knows so far, told now and then.

    A terminal has both in the line that is drawn there, others have a line every half minute.
    """

    def __init__(
        self,
        show: Callable[[int, int, str], object],
        *,
        terminal: bool,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.most = 0.0
        """Amount of work that it can need."""
        self._show, self._terminal, self._clock = show, terminal, clock
        self._done, self._known, self._told_s = 0.0, "", clock()

    def step(self, part: float, so_far: Callable[[], str]) -> None:
        """Take in that so much more is done; `so_far` says what is known."""
        self._done += part
        if self._clock() - self._told_s > (_DRAWN_EVERY_S if self._terminal else _TOLD_EVERY_S):
            self._told_s, self._known = self._clock(), so_far()
            if not self._terminal:
                share = self._done / max(self.most, 1)
                known = f"; {self._known}" * bool(self._known)
                click.echo(f"{share:.0%} of the most it can need is done{known}", err=True)
        self._show(round(self._done), max(round(self.most), 1), self._known)


@click.command(
    cls=_Grouped,
    epilog="Example: tactstrip power study.toml --people literature --participants 12 12",
)
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
    "--trials",
    type=click.IntRange(1, _MOST_TRIALS),
    nargs=2,
    metavar="LEAST MOST",
    help="Trials of each side to try.  [default: the study's]",
)
@click.option(
    "--blanks",
    type=click.IntRange(1, _MOST_TRIALS),
    nargs=2,
    metavar="LEAST MOST",
    help="Blank trials to try.  [default: the study's]",
)
@click.option(
    "--levels",
    type=click.Choice(["fixed", "placed"]),
    default="fixed",
    show_default=True,
    help="The study's, or placed for each person after a pilot of 40 stimuli.",
)
@click.option(
    "--assurance",
    type=click.FloatRange(0.05, 0.99),
    default=0.8,
    show_default=True,
    metavar="SHARE",
    help="How often the goal is to be reached.",
)
@click.option(
    "--pilot",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Take the people from the sessions of a pilot.",
)
@click.option(
    "--people",
    "whose",
    type=click.Choice(["stated", "literature"]),
    default="stated",
    show_default=True,
    help="What [simulation] leaves out: refuse, or assume it.",
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
@click.option(
    "--figure",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE.png",
    help="Draw the curve, too; or FILE.svg.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead.")
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
    whose: str,
    seed: int | None,
    workers: int,
    scheduler: str | None,
    keep: Path | None,
    figure: Path | None,
    as_json: bool,
) -> None:
    """Tell how many people a study needs, before the first one comes.

    Studies of the people that [simulation] states are simulated and analyzed as `analyze` does it,
    docs/power.md. The exit code is 1 if no number within the bounds reaches the goal.
    """
    from analysis.power.goals import Goal
    from analysis.power.planning import plan_study
    from analysis.power.promise import as_json as told_as_json
    from analysis.power.promise import text
    from analysis.workers.kept import computed_in
    from experiment.study.read import read_study
    from experiment.study.study import told_by_file

    goal = Goal.parse(goal_text)
    for name, pair in (("participants", participants), ("trials", trials), ("blanks", blanks)):
        if pair is not None and pair[0] > pair[1]:
            raise CommandError(
                f"--{name} must be the least and the most; got {pair[0]} and {pair[1]}"
            )
    if figure is not None and figure.suffix not in {".png", ".svg"}:
        raise CommandError(f"--figure must end in .png or .svg; got {figure}")
    if seed is None:
        seed = int((computed_in(keep) if keep else {}).get("seed", secrets.randbits(32)))
    with told_by_file(study_file):
        people = _people(read_study(study_file), goal, pilot, whose)
    computed = {"study": people.study.sha256, "goal": goal_text, "seed": seed}
    spreading = _spreading(workers, scheduler, keep, computed)
    with spreading as spread, told_by_file(study_file), working("Simulating") as show:
        terminal = sys.stderr.isatty()
        progress = Progress(show, terminal=terminal)

        def predicted(core_s: float, all_of_it: float) -> None:
            progress.most = all_of_it
            if core_s > _WORTH_TELLING_S or terminal:
                told = f"At most about {math.ceil(core_s)} core-seconds"
                click.echo(f"{told}{_SPREAD * (core_s > _LONG_S)}", err=True)

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
            step=progress.step,
        )
    click.echo(told_as_json(promise) if as_json else text(promise))
    if figure is not None:
        from analysis.power.figure import write_figure

        write_figure(promise, figure)
    if promise.best is None:
        click.get_current_context().exit(ANSWER_IS_NO)


def _people(study: Study, goal: Goal, pilot: Path | None, whose: str) -> People:
    """Return the people of a pilot, of the study, or of the literature."""
    from analysis.power.population import literature_people, pilot_people, stated_people
    from analysis.reading.load import read_trials

    if pilot is not None and whose != "stated":
        raise CommandError("--pilot and --people literature exclude each other; got both")
    if pilot is not None:
        return pilot_people(study, goal, read_trials([pilot]), str(pilot))
    return literature_people(study, goal) if whose == "literature" else stated_people(study, goal)


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
    from analysis.workers.memory import keep_freed_memory

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
