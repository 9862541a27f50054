"""The command ``levels``: levels for one participant, from a pilot session."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

import click

from device.printing import echo
from experiment.commands.options.common import PATH, write_option
from experiment.exits import CommandError, refusals
from experiment.record.files import DISK, LEVELS_SUFFIX, write_new
from experiment.templates import open_templates

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from analysis.planning.levels import LevelsError, Placement


@click.command(epilog="Example: tactstrip levels results --participant 01 --write levels-01.toml")
@click.argument("folder", metavar="DIR", type=PATH)
@click.option(
    "--participant", required=True, metavar="ID", help="Participant of the pilot session."
)
@click.option(
    "--study",
    "study_file",
    metavar="STUDY",
    type=PATH,
    show_default="that of the pilot session",
    help="Study to choose levels for. It determines the highest level and the number of trials.",
)
@write_option(
    metavar="FILE",
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
    from analysis.reading.trials import read_inputs, without_device
    from experiment.study.files import paper_study, read_study, study_from_canonical

    if target is not None and target.suffix != LEVELS_SUFFIX:  # a withdrawal would not find it
        raise CommandError(f"--write must be a file that ends in {LEVELS_SUFFIX}; got {target}")
    loaded = read_inputs([folder])
    trials = loaded.trials
    pilot_trials = trials[trials["participant"].eq(participant)]
    if pilot_trials.empty:
        participants = ", ".join(sorted(set(trials["participant"]))[:10])
        raise CommandError(f"--participant must be one of {participants}; got {participant}")
    if without_device(pilot_trials).any():
        raise CommandError(
            f"participant {participant} practised without a device, on a mock or an emulator: "
            "levels for a person come from a pilot session on the plate"
        )
    plans = [session.plan for session in loaded.progress]
    studies = [plan.study for plan in plans if plan.participant == participant]
    if study_file is not None:
        study = read_study(study_file)
    else:  # of the last pilot session; without a plan the paper's
        study = study_from_canonical(studies[-1]) if studies else paper_study()
    results = place_levels(pilot_trials, participant, study)
    errors = [result for result in results.values() if isinstance(result, LevelsError)]
    if len(errors) == len(results):
        raise errors[0]
    simulated = bool(pilot_trials["simulated"].any())
    if target is not None:
        _write_levels(_select_placements(results, condition), target, simulated=simulated)
    for result in results.values():
        echo(*format_result(result).split("\n"))
    if simulated:
        echo(f"{_SIMULATED}.")
    if target is not None:
        echo(f"Written to {target}; tactstrip run STUDY --levels {target} uses it")


def _select_placements(
    results: Mapping[str, Placement | LevelsError], condition: str | None
) -> dict[str, Placement]:
    """Return the placement of the condition, or without a condition all if none has failed."""
    placements = {name: p for name, p in results.items() if not isinstance(p, ValueError)}
    if condition is None and len(placements) == len(results):
        return placements
    if condition not in placements:
        errors = [str(result) for result in results.values() if isinstance(result, ValueError)]
        names = ", ".join(placements)
        raise CommandError(
            f"--condition must be one whose levels are placed, {names}; got {condition}", *errors
        )
    return {condition: placements[condition]}


def format_result(result: Placement | LevelsError, template: str = "levels.txt.jinja") -> str:
    """Format the levels of one condition as text, or why there are none."""
    if isinstance(result, ValueError):
        return str(result)
    filters = {
        "levels": lambda levels_vpp: " ".join(f"{level:g}" for level in levels_vpp),
        "error": lambda error: f"{error.median_db:.2f} dB (90 %: below {error.p90_db:.2f})",
    }
    text = open_templates(str(__package__), filters).get_template(template)
    return text.render(placement=result)


_SIMULATED: Final = "Participant and answers are simulated: these levels are for no person"


def _write_levels(placements: Mapping[str, Placement], target: Path, *, simulated: bool) -> None:
    """Write a participant's levels to a new file that `experiment.study.files.read_levels` reads.

    The levels of one condition are a list, those of several conditions a table.
    """
    first, *others = placements.values()
    keys = map(json.dumps, placements) if others else ["levels_vpp"]
    text = f"# {_SIMULATED}.\n" * simulated + f"participant = {json.dumps(first.participant)}\n"
    text += "\n[levels_vpp]\n" * bool(others)
    for key, placement in zip(keys, placements.values(), strict=True):
        text += f"{key} = {list(placement.levels_vpp)}\n"
    write_new(target, text.encode(), DISK)
