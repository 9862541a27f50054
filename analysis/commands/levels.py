"""The command ``levels``: levels for one participant, from a pilot session."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from device.printing import echo
from experiment.archive.disk import DISK, write_new
from experiment.archive.manifest import LEVELS_SUFFIX
from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.planning.levels import ExpectedError, LevelsError, Placement
    from experiment.study.study import Study


@click.command(epilog="Example: tactstrip levels results --participant 01 --write levels-01.toml")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--participant", required=True, metavar="ID", help="Participant of the pilot session."
)
@click.option(
    "--study",
    "study_file",
    metavar="STUDY",
    type=click.Path(path_type=Path),
    show_default="that of the pilot session",
    help="Study to choose levels for. It determines the highest level and the number of trials.",
)
@click.option(
    "--write",
    "target",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help=f"New {LEVELS_SUFFIX} file for the levels, for use with `tactstrip run --levels`.",
)
@click.option(
    "--condition",
    metavar="NAME",
    show_default="all conditions",
    help="Condition whose levels --write saves.",
)
@refusals
def levels(
    *,
    folder: Path,
    participant: str,
    study_file: Path | None,
    target: Path | None,
    condition: str | None,
) -> None:
    """Choose stimulus levels from a participant's pilot session.

    DIR holds a pilot session with about 40 single stimuli over a wide range of levels. For each
    condition, tactstrip fits the psychometric function and chooses five levels. Levels from a
    simulated session are marked as such.
    """
    from analysis.planning.levels import LevelsError, place_levels
    from analysis.reading.trials import read_inputs
    from experiment.study.files import read_study

    if target is not None and target.suffix != LEVELS_SUFFIX:  # a withdrawal would not find it
        raise CommandError(f"--write must be a file that ends in {LEVELS_SUFFIX}; got {target}")
    if target is not None and target.exists():
        raise CommandError(f"--write must be a new file; got {target}, which exists")
    loaded = read_inputs([folder])
    trials = loaded.trials
    pilot_trials = trials[trials["participant"].eq(participant)]
    if pilot_trials.empty:
        participants = ", ".join(sorted(set(trials["participant"]))[:10])
        raise CommandError(f"--participant must be one of {participants}; got {participant}")
    is_real_person = ~pilot_trials["simulated"].astype(bool)
    if (is_real_person & pilot_trials["device_kind"].isin(["mock", "emulated"])).any():
        raise CommandError(
            f"participant {participant} practised without a device, on a mock or an emulator: "
            "levels for a person come from a pilot session on the plate"
        )
    studies = [plan.study for plan in loaded.progress if plan.participant == participant]
    study = _pilot_study(studies) if study_file is None else read_study(study_file)
    results = place_levels(pilot_trials, participant, study)
    placements = [result for result in results if not isinstance(result, LevelsError)]
    errors = [result for result in results if isinstance(result, LevelsError)]
    if not placements:
        raise errors[0]
    simulated = not is_real_person.all()
    if target is not None:
        selected = _select_placements(placements, errors, condition)
        write_levels(selected, target, simulated=simulated)
    for result in results:
        text = str(result) if isinstance(result, LevelsError) else format_placement(result)
        echo(*text.split("\n"))
    if simulated:
        echo(f"{_SIMULATED}.")
    if target is not None:
        echo(f"Written to {target}; tactstrip run STUDY --levels {target} uses it")


def _select_placements(
    placements: Sequence[Placement], errors: Sequence[LevelsError], condition: str | None
) -> Sequence[Placement]:
    """Return the placement of the condition, or without a condition all if none has failed."""
    names = [placement.condition for placement in placements]
    if condition is None and errors:
        raise CommandError(
            f"{errors[0]}; --condition NAME writes the levels of one, {' or '.join(names)}, alone"
        )
    if condition is not None and condition not in names:
        raise CommandError(
            f"--condition must be one whose levels are placed, {', '.join(names)}; got {condition}"
        )
    return [placement for placement in placements if condition in {None, placement.condition}]


def _pilot_study(studies: Sequence[str]) -> Study:
    """Return the study in the plan of the last pilot session, or without a plan the paper's."""
    from experiment.study.files import paper_study, study_from_canonical

    return study_from_canonical(studies[-1]) if studies else paper_study()


def format_placement(placement: Placement) -> str:
    """Format the levels of one condition as lines of text."""
    low, high = placement.threshold_limits_vpp
    function = placement.function
    rows = "\n".join(
        f"  {level:7.1f} V  detected {share:.0%}"
        for level, share in zip(
            placement.levels_vpp, function.shares(placement.levels_vpp), strict=True
        )
    )
    study_levels = " ".join(f"{level:g}" for level in placement.study_levels_vpp)
    highest_vpp, key = placement.highest
    limited = f" (the device reaches {highest_vpp:g} V = {key})"
    limited *= placement.levels_vpp[-1] > highest_vpp - 0.1
    return (
        f"Participant {placement.participant}, condition {placement.condition}: threshold "
        f"{function.threshold_vpp:.1f} V ({low:.1f} to {high:.1f}), sigma {function.sigma:.3f}, "
        f"guess rate {function.guess_rate:.2g}\nLevels{limited}:\n{rows}\n"
        f"Expected error of the threshold after {placement.trials} stimuli (RMSE), by what the "
        f"pilot tells:\n"
        f"  {_error(placement.error)} with these levels\n"
        f"  {_error(placement.study_error)} with {study_levels} V"
    )


def format_line(placement: Placement) -> str:
    """Format the levels of one condition as one line."""
    levels = " ".join(f"{level:g}" for level in placement.levels_vpp)
    return (
        f"{placement.participant} {placement.condition}: {levels} V, expected error after "
        f"{placement.trials} stimuli {_error(placement.error)}; with the levels of the study that "
        f"was run {_error(placement.study_error)}"
    )


def _error(error: ExpectedError) -> str:
    return f"{error.median_db:.2f} dB (90 %: below {error.p90_db:.2f})"


_SIMULATED: Final = "Participant and answers are simulated: these levels are for no person"


def write_levels(placements: Sequence[Placement], target: Path, *, simulated: bool) -> None:
    """Write a participant's levels to a new file that `experiment.study.files.read_levels` reads.

    The levels of one condition are a list, those of several conditions a table.
    """
    text = f"# {_SIMULATED}.\n" * simulated
    text += f"participant = {json.dumps(placements[0].participant)}\n"
    text += "\n[levels_vpp]\n" * (len(placements) > 1)
    for placement in placements:
        key = json.dumps(placement.condition) if len(placements) > 1 else "levels_vpp"
        text += f"{key} = [{', '.join(f'{level!r}' for level in placement.levels_vpp)}]\n"
    write_new(target, text.encode(), DISK)
