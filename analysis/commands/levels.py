"""The command ``levels``: levels for one participant, from a pilot session."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from experiment.archive.disk import DISK, write_new
from experiment.archive.manifest import LEVELS_SUFFIX
from experiment.terms.exits import CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.thresholds.levels import ExpectedError, LevelsError, Placement
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
    from analysis.reading.load import read_trials
    from analysis.thresholds.levels import LevelsError, place_levels
    from experiment.study.read import read_study

    if target is not None and target.suffix != LEVELS_SUFFIX:  # a withdrawal would not find it
        raise CommandError(f"--write must be a file that ends in {LEVELS_SUFFIX}; got {target}")
    if target is not None and target.exists():
        raise CommandError(f"--write must be a new file; got {target}, which exists")
    trials = read_trials([folder])
    own = trials[trials["participant"].eq(participant)]
    if own.empty:
        known = ", ".join(sorted(set(trials["participant"]))[:10])
        raise CommandError(f"--participant must be one of {known}; got {participant}")
    practised = ~own["simulated"].astype(bool) & own["device_kind"].isin(["mock", "emulated"])
    if practised.any():
        raise CommandError(
            f"participant {participant} practised without a device, on a mock or an emulator: "
            "levels for a person come from a pilot session on the plate"
        )
    study = (
        _study_of(own["file"].unique().tolist()) if study_file is None else read_study(study_file)
    )
    found = place_levels(own, participant, study)
    placements = [one for one in found if not isinstance(one, LevelsError)]
    refused = [one for one in found if isinstance(one, LevelsError)]
    if not placements:
        raise refused[0]
    simulated = bool(own["simulated"].astype(bool).any())
    if target is not None:
        write_levels(_chosen(placements, refused, condition), target, simulated=simulated)
    for one in found:
        click.echo(str(one) if isinstance(one, LevelsError) else report(one))
    if simulated:
        click.echo(f"{_SIMULATED}.")
    if target is not None:
        click.echo(f"Written to {target}; tactstrip run STUDY --levels {target} uses it")


def _chosen(
    placements: Sequence[Placement], refused: Sequence[LevelsError], condition: str | None
) -> Sequence[Placement]:
    """Return the placements to write: all, none of which was refused, or that of the condition."""
    names = [one.condition for one in placements]
    if condition is None and refused:
        raise CommandError(
            f"{refused[0]}; --condition NAME writes the levels of one, {' or '.join(names)}, alone"
        )
    if condition is not None and condition not in names:
        raise CommandError(
            f"--condition must be one whose levels are placed, {', '.join(names)}; got {condition}"
        )
    return [one for one in placements if condition in {None, one.condition}]


def _study_of(files: list[str]) -> Study:
    """Return the study by the plan beside the last pilot's table; without one the paper's."""
    from analysis.reading.plans import read_plan
    from experiment.study.read import paper_study, study_from_canonical

    sealed = [found for file in files if (found := read_plan(Path(file))) is not None]
    return study_from_canonical(sealed[-1][0].study) if sealed else paper_study()


def report(found: Placement) -> str:
    """Return what was placed, as lines for a reader."""
    low, high = found.threshold_limits_vpp
    function = found.function
    rows = "\n".join(
        f"  {level:7.1f} V  felt {share:.0%}"
        for level, share in zip(found.levels_vpp, found.felt, strict=True)
    )
    fixed = " ".join(f"{level:g}" for level in found.fixed_levels_vpp)
    highest_vpp, key = found.highest
    limited = f" (the device reaches {highest_vpp:g} V = {key})"
    limited *= found.levels_vpp[-1] > highest_vpp - 0.1
    return (
        f"Participant {found.participant}, condition {found.condition}: threshold "
        f"{function.threshold_vpp:.1f} V ({low:.1f} to {high:.1f}), sigma {function.sigma:.3f}, "
        f"guess rate {function.guess_rate:.2g}\nLevels{limited}:\n{rows}\n"
        f"Expected error of the threshold after {found.trials} stimuli (RMSE), by what the pilot "
        f"tells:\n"
        f"  {_error(found.error)} with these levels\n"
        f"  {_error(found.fixed_error)} with {fixed} V"
    )


def line(found: Placement) -> str:
    """Return what was placed as one line."""
    levels = " ".join(f"{level:g}" for level in found.levels_vpp)
    return (
        f"{found.participant} {found.condition}: {levels} V, expected error after {found.trials} "
        f"stimuli {_error(found.error)}; with the levels of the study that was run "
        f"{_error(found.fixed_error)}"
    )


def _error(error: ExpectedError) -> str:
    return f"{error.median_db:.2f} dB (90 %: below {error.most_db:.2f})"


_SIMULATED: Final = "Participant and answers are simulated: these levels are for no person"


def write_levels(found: Sequence[Placement], target: Path, *, simulated: bool) -> None:
    """Write a person's levels as `experiment.study.read.read_levels` reads them, into a new file.

    Those of one condition are a list, those of several a table.
    """
    text = f"# {_SIMULATED}.\n" * simulated
    text += f"participant = {json.dumps(found[0].participant)}\n"
    text += "\n[levels_vpp]\n" * (len(found) > 1)
    for one in found:
        key = json.dumps(one.condition) if len(found) > 1 else "levels_vpp"
        text += f"{key} = [{', '.join(f'{level!r}' for level in one.levels_vpp)}]\n"
    write_new(target, text.encode(), DISK)
