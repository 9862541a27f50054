"""The command ``dry-run``: simulated participants on the mock device, then the analysis.

The command belongs to the analysis package because imports point one way: the analysis may use the
experiment, but not vice versa.
"""

from __future__ import annotations

import secrets
import sys
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

import click

from analysis.commands.analyze import output_options, show_analysis, write_analysis
from device.printing import echo
from experiment.commands.options.common import PATH, make_new_folder, seed_option
from experiment.commands.options.hardware import working
from experiment.exits import DEVICE_FAILED, CommandError, refusals, room_hint
from experiment.record.files import FOLDER_MODE

if TYPE_CHECKING:
    import pandas as pd

    from experiment.check.check import StudyCheck
    from experiment.study.study import Study


MAX_PARTICIPANTS = 10_000


@click.command("dry-run", epilog="Example: tactstrip dry-run study.toml --seed 7")
@click.argument("study_file", metavar="[STUDY]", required=False, type=PATH)
@click.option(
    "--participants",
    type=click.IntRange(1, MAX_PARTICIPANTS),
    default=5,
    show_default=True,
    metavar="N",
    help="Number of simulated participants.",
)
@seed_option(
    show_default="random, printed",
    help="Seed of the trial plans and of the simulated participants.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    metavar="DIR",
    show_default="the next free dry-run-N",
    help="New or empty folder for the sessions and the analysis.",
)
@click.option(
    "--levels",
    "with_levels",
    is_flag=True,
    help="Also choose stimulus levels from each session, as `tactstrip levels` does from a pilot "
    "session, and print their expected error.",
)
@click.option(
    "--compare",
    is_flag=True,
    help="In place of the analysis, compare constant levels with the rules that choose levels: "
    "the error of thresholds after so many trials.",
)
@output_options
@refusals
def dry_run(
    *,
    study_file: Path | None,
    participants: int,
    seed: int | None,
    out: Path | None,
    with_levels: bool,
    compare: bool,
    no_figures: bool,
    **shown: bool,
) -> None:
    """Simulate participants on the mock device and analyze their sessions.

    Without STUDY, tactstrip runs an example study, whose levels lie on both sides of the simulated
    threshold. The same seed reproduces every trials.csv.
    """
    from experiment.check.check import require_fit
    from experiment.check.study_report import simulated_participants
    from experiment.study.files import first_study, naming, read_study

    with working("Checking"), naming(study_file):
        study = first_study() if study_file is None else read_study(study_file)
        check = require_fit(study)
    folder = new_folder(out)
    seed = secrets.randbits(32) if seed is None else seed
    people = f"{participants} simulated participant{'s' * (participants > 1)}"
    echo(f"{people}, seed {seed}, in {folder}")
    if compare:
        _compare(check, folder, participants, seed)
        return
    _simulate(check, folder, participants, seed)
    target = folder / "analysis"
    analysis = write_analysis([folder], target, seed=seed, figures=not no_figures, bar=True)
    from analysis.results.answer import simulated_row

    simulated = simulated_participants(study, check.gains)
    row = simulated_row(simulated["thresholds"], simulated["threshold_sd_db"], study)
    remarks = [warning.message for warning in simulated["warnings"]]
    if with_levels:
        _print_levels(study, analysis.trials)
    show_analysis(analysis, target, more=[row], remarks=remarks, **shown)


def _print_levels(study: Study, trials: pd.DataFrame) -> None:
    from analysis.commands.levels import format_result
    from analysis.numbers import counted_up
    from analysis.planning.levels import place_levels

    echo("Levels by these sessions:")
    for participant in sorted(trials["participant"].unique(), key=counted_up):
        for result in place_levels(trials, participant, study).values():
            echo(f"  {format_result(result, 'levels_line.txt.jinja')}")


def new_folder(out: Path | None) -> Path:
    """Make the folder `out`, or the next free dry-run-N; reject a folder with files."""
    if out is None:
        numbered = (Path(f"dry-run-{number}") for number in count(1))
        return next(folder for folder in numbered if _is_made(folder))
    make_new_folder(out)
    return out


def _is_made(folder: Path) -> bool:
    """Make a folder; return False if it exists, as that of another dry run at the same time."""
    try:
        folder.mkdir(FOLDER_MODE)
    except FileExistsError:
        return False
    return True


def _compare(check: StudyCheck, folder: Path, participants: int, seed: int) -> None:
    from analysis.planning.figure import write_rules
    from analysis.planning.rules import compare_rules, format_rules

    with working("Simulating"):
        table = compare_rules(
            check.study, folder, participants=participants, seed=seed, gains=check.gains
        )
    first, *others = check.study.conditions
    where = f" in condition {first.name}" if others else ""
    echo(f"Error of a threshold, dB rms, {table['thresholds'].max()} thresholds{where}:")
    echo(*format_rules(table))
    csv, png = (folder / f"comparison.{ending}" for ending in ("csv", "png"))
    table.to_csv(csv, index=False)
    write_rules(table, png)
    echo(f"{'Table and figure':<22}{csv}, {png}")


def _simulate(check: StudyCheck, folder: Path, participants: int, seed: int) -> None:
    from experiment.record.journal import JournalWriteError
    from experiment.session.simulate import SimulationError, simulate_study

    sessions = simulate_study(
        check.study, folder, participants=participants, seed=seed, gains=check.gains
    )
    hidden = not sys.stderr.isatty()
    try:
        with click.progressbar(sessions, participants, file=sys.stderr, hidden=hidden) as bar:
            for _ in bar:
                pass
    except SimulationError as error:
        raise CommandError(str(error), exit_code=DEVICE_FAILED) from error
    except JournalWriteError as error:
        raise CommandError(f"{error}; {room_hint(error.errno)}run it again") from error
