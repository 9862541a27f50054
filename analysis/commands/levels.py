"""The command ``levels``: levels for one participant, from a pilot session."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from experiment.archive.disk import DISK, write_new
from experiment.archive.manifest import LEVELS_SUFFIX
from experiment.terms.exits import CommandError, refusals

if TYPE_CHECKING:
    from analysis.thresholds.levels import Placement
    from experiment.study.study import Study


@click.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--participant", required=True, metavar="ID", help="Whose pilot session.")
@click.option(
    "--study",
    "study_file",
    metavar="STUDY",
    type=click.Path(path_type=Path),
    help="The study to be run: its ceiling, trials and levels.  [default: the pilot's]",
)
@click.option(
    "--write",
    "target",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help=f"A new file for run --levels FILE; its name ends in {LEVELS_SUFFIX}.",
)
@refusals
def levels(*, folder: Path, participant: str, study_file: Path | None, target: Path | None) -> None:
    """Place five levels on a participant's own psychometric function.

    DIR holds a pilot session: about 40 single stimuli over a wide range of levels.
    """
    from analysis.reading.load import read_trials
    from analysis.thresholds.levels import place_levels
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
    if target is not None:
        write_levels(found, target)
    click.echo(report(found))
    if target is not None:
        click.echo(f"Written to {target}; tactstrip run STUDY --levels {target} uses it")


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
    return (
        f"Participant {found.participant}: threshold {function.threshold_vpp:.1f} V "
        f"({low:.1f} to {high:.1f}), sigma {function.sigma:.3f}, guess rate "
        f"{function.guess_rate:.2g}\nLevels:\n{rows}\n"
        f"Expected error of the threshold after {found.trials} stimuli (RMSE):\n"
        f"  {found.error_db:.2f} dB with these levels\n"
        f"  {found.fixed_error_db:.2f} dB with {fixed} V"
    )


def write_levels(found: Placement, target: Path) -> None:
    """Write the levels as `experiment.study.read.read_levels` reads them; never over a file."""
    numbers = ", ".join(f"{level!r}" for level in found.levels_vpp)
    text = f"participant = {json.dumps(found.participant)}\nlevels_vpp = [{numbers}]\n"
    write_new(target, text.encode(), DISK)
