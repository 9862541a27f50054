"""The command `init`: a commented study file, written from a preset and the study sections."""

from __future__ import annotations

import json
import shlex
import textwrap
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, Final, Literal, Union, get_args, get_origin

import click

from experiment.commands.options.hardware import working
from experiment.commands.options.plate import (
    CEILING,
    QUESTIONS,
    complete_plate,
    parse_ceiling_vpp,
    plate_options,
    plate_study,
    study_keys,
)
from experiment.exits import CommandError, refusals
from experiment.names import require_word

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiment.check.burst_choice import ChosenBurst
    from experiment.study.study import Study

_RECOMMENDED: Final = {
    "blank_trials": 60,
    "practice_trials": 10,
    "order": "balanced",
    "responses": ["left", "right", "both", "none"],
    "break_every": 43,
}
REALISTIC: Final = {
    "false_alarm_rate": 0.06,
    "reaction_time_s": 0.58,
    "reaction_time_spread": 0.45,
    "reaction_time_least_s": 0.0,
    "reaction_time_doubt": 1.0,
    "threshold_at_hz": 500.0,
    "threshold_at_s": 0.002,
    "threshold_at_cm2": 0.785,
    "finger_difference_sd_db": 1.0,
    "masking_slope": 0.2,
    "drift_db": 1.0,
    "block_drift_db": 1.1,
    "wander_db": 1.4,
    "wander_trials": 11.0,
    "last_answer_db": 0.35,
    "swapped_keys": 0.05,
}
"""Realistic simulated participants; docs/model.md, section 4, has the sources.

The threshold is that of the paper's burst, which no published measurement covers. The published
curves give only the difference to the threshold of another burst.
"""
_OVERRIDES: Final[dict[str, dict[str, Any]]] = {
    "paper": {},
    "recommended": {
        "study": {"name": "recommended"},
        "burst": {"window": "hann"},
        "design": _RECOMMENDED,
    },
    "realistic": {
        "study": {"name": "realistic"},
        "burst": {"window": "hann"},
        "design": _RECOMMENDED,
        "simulation": REALISTIC,
    },
}
PLATE: Final = "plate"
_N_LEVELS: Final = 5
"""The number of levels, in equal steps up to the ceiling."""
_CHOSEN_KEYS: Final = ("burst.frequency_hz", "burst.cycles")
"""The keys that `init` chooses for a plate, even if they equal those of the paper."""
PRESETS: Final = (*_OVERRIDES, PLATE)
_INTRODUCTIONS: Final = {
    "paper": (
        "The protocol of A. Ben Dhiab and C. Hudin, 'Confinement of Vibrotactile Stimuli in Narrow "
        "Plates'. What the paper does not state (waits, breaks, the device) is ours. Every key may "
        "be left out: the paper preset's value is its default; but a plate of other width, "
        "thickness or material needs its own material, edge or measured_cutoff_hz, and actuators, "
        "and one of other length or cut-off what was measured of its actuators."
    ),
    "recommended": (
        "The paper's plate with the design we recommend: each level equally often in every block, "
        "'none' as an answer and 60 blank trials to measure guesses, a Hann window to confine the "
        "burst, practice before the first block."
    ),
    "realistic": (
        "The recommended design for simulated people who are less simple: their fingers and their "
        "thresholds differ, drift and wander, the last answer counts, some swap the keys. It is "
        "for trying out an analysis before there are participants."
    ),
    PLATE: (
        "A plate of your own, with the design that we recommend. Without a measured displacement "
        "or the layers of an actuator no micrometres are known."
    ),
}
_PLACED: Final = (
    "Place each participant's own afterwards, in a file with levels_vpp = [...], and give it with "
    "`tactstrip run --levels FILE`."
)
_LEVELS: Final = {
    "paper": "",
    "recommended": f"The levels below are for a pilot session. {_PLACED}",
    "realistic": f"The levels below are for a pilot session. {_PLACED}",
    PLATE: (
        "The levels are assumed: they and ceiling_vpp must suit your actuators. They rise in equal "
        "steps of volts; 'Which levels for a new plate', docs/plate.md, tells how to write equal "
        f"steps of dB for a pilot. {_PLACED}"
    ),
}
_CONDITIONS: Final = """\
# To compare stimuli, list conditions; each runs the whole design. What one leaves out is taken from
# [burst]. Without any there is one condition, main.
# [[condition]]
# name = "two-cycles"
# cycles = 2
"""
_UNSET: Final = "# measured_as =\n"
_AS_LEFT: Final = """\
# measured_as = "as-left"              # or this alone: assumed equal to the left one
"""
_SIZES: Final = ("shape", "diameter_mm", "length_x_mm", "length_y_mm")
_INIT: Final = (
    "What `tactstrip init` was told, what it left out or commented out although the paper's study "
    "has it, and what it chose by itself, for the sources that the check tells. What it was told "
    "and what you change or add is yours, whatever its value; what is still as init wrote it is "
    "not, until you add its key to told. Without this section all that the file states is yours."
)
_COLUMN: Final = 37
"""The column in which the comment of a key begins, unless the value is longer."""
_WIDTH: Final = 100


def _sections_for_plate(ceiling_vpp: float) -> dict[str, Any]:
    """Return the sections that do not describe the plate."""
    levels_vpp = [float(f"{ceiling_vpp * step / _N_LEVELS:.4g}") for step in range(1, _N_LEVELS)]
    return {
        "study": {"name": PLATE},
        "design": _RECOMMENDED | {"levels_vpp": [*levels_vpp, ceiling_vpp]},
        "device": {"ceiling_vpp": ceiling_vpp},
    }


def write_study_text(preset: str) -> str:
    r"""Write a commented study file of a preset, ``paper`` or ``recommended``.

    The first reads back as `paper_study`; comments, keys and values come from
    the sections that read it.

    >>> lines = write_study_text("paper").splitlines()
    >>> print(*lines[lines.index("[masking]"):][:3], sep="\n")
    [masking]
    noise = "pink"                         # pink | none; what is played
    max_level_dba = 75                     # at the ear; 80 at most
    """
    from experiment.study.study import Study

    require_word("preset", preset, _OVERRIDES)
    return _text(Study(**_OVERRIDES[preset]), preset, ())


def _text(
    study: Study, preset: str, entered_keys: tuple[str, ...], chosen: ChosenBurst | None = None
) -> str:
    sections = [_comment(_INTRODUCTIONS[preset])]
    remarks = {"design": _LEVELS[preset], "burst": _burst_remark(chosen)}
    for name, table in study.sections().items():
        if name == "condition":
            sections.append(_CONDITIONS)
        elif isinstance(table, tuple):
            left, *rest = table
            sections.append(_section(f"[[{name}]]", left))
            sections += [f"[[{name}]]\n{_right_actuator(preset, left, right)}" for right in rest]
        else:
            sections.append(_section(f"[{name}]", table, remarks.get(name, "")))
    sections.append(_init(study, entered_keys, _CHOSEN_KEYS if preset == PLATE else ()))
    return "\n".join(sections)


def _burst_remark(chosen: ChosenBurst | None) -> str:
    """Return the remark of the file on how the burst was chosen."""
    if chosen is None:
        return ""
    if chosen.found.verdict == "unfit":
        return f"It is unfit for this plate; {chosen.words}. `tactstrip bursts` compares others."
    return f"Chosen as {chosen.words}. Longer ones are felt more easily: `tactstrip bursts`."


def _right_actuator(preset: str, left: object, right: object) -> str:
    """Write the keys of the right actuator; on a plate, offer to equate it to the left one."""
    keys = _keys(right, commented=False)
    same_size = all(getattr(left, key, None) == getattr(right, key, None) for key in _SIZES)
    return keys.replace(_UNSET, _AS_LEFT) if same_size and preset == PLATE else keys


def _init(study: Study, entered_keys: tuple[str, ...], chosen_keys: tuple[str, ...]) -> str:
    """Write the section [init]: the values that are not the choice of the lab."""
    from experiment.study.stated import chosen_values, left_out

    chosen = chosen_values(study, entered_keys, chosen_keys)
    lines = [f"{_comment(_INIT)}[init]", *_listed("told", entered_keys)]
    if missing := left_out(study):
        lines += _listed("left_out", missing)
    if chosen:
        values = (f'"{path}" = {_toml(value)}' for path, value in chosen.items())
        lines += ["[init.chosen]", *values]
    return "\n".join(lines) + "\n"


def _listed(key: str, paths: Sequence[str]) -> list[str]:
    return [f"{key} = [", *(f'    "{path}",' for path in paths), "]"]


def _section(heading: str, table: object, remark: str = "") -> str:
    comments = _comment(type(table).__doc__ or "") + _comment(remark)
    return f"{comments}{heading}\n{_keys(table, commented=True)}"


def _keys(table: object, *, commented: bool) -> str:
    """Write the keys of a table; a key without a value is written as a comment.

    `commented` adds the description of each key, once for several actuators.
    """
    from experiment.study.base import file_keys

    lines = []
    for key, field in file_keys(type(table)).items():
        value = getattr(table, key)
        line = f"# {key} =" if value is None else f"{key} = {_toml(value)}"
        comment = "; ".join(filter(None, (_allowed_values(field.annotation), field.description)))
        if len(line) > _WIDTH and isinstance(value, str):
            line = _wrapped(key, value)
        if commented and comment:
            lines.append(_beside(line, comment))
        else:
            lines.append(line)
    return "".join(f"{line}\n" for line in lines)


def _beside(line: str, comment: str) -> str:
    """Put a comment behind a key, or above it if the line is too short."""
    together = f"{line:{_COLUMN}}  # {comment}"
    fits = max(map(len, together.split("\n"))) <= _WIDTH
    return together if fits else f"{_comment(comment)}{line}"


def _wrapped(key: str, text: str) -> str:
    """Write a long text over several lines; a line's last backslash joins it to the next."""
    lines = textwrap.wrap(_toml(text)[1:-1], width=_WIDTH - 6, break_on_hyphens=False)
    return f'{key} = """\\\n    ' + " \\\n    ".join(lines) + '"""'


def _allowed_values(annotation: object) -> str:
    """List the values of a key that allows two or more literals."""
    if get_origin(annotation) in {Union, UnionType}:
        return "".join(_allowed_values(member) for member in get_args(annotation))
    values = get_args(annotation) if get_origin(annotation) is Literal else ()
    return " | ".join(values) if len(values) > 1 else ""


def _comment(text: str) -> str:
    return "".join(
        f"# {line}\n"
        for line in textwrap.wrap(" ".join(text.split()), width=98, break_on_hyphens=False)
    )


def _toml(value: object) -> str:
    """Write a value in TOML; JSON's texts are TOML's, and a whole number needs no point."""
    if isinstance(value, tuple | list):
        return f"[{', '.join(_toml(item) for item in value)}]"
    if isinstance(value, float) and value.is_integer():
        return str(int(value))
    return json.dumps(value)


def _print_summary(study: Study, chosen: ChosenBurst | None, file: Path) -> None:
    from experiment.study.sources import measured_beside
    from experiment.trial.draw import block_words

    _, cutoff_lines = measured_beside(study.plate) or (0.0, [])
    for heading, line in zip(("cut-off", ""), cutoff_lines, strict=False):
        click.echo(f"{heading:8}{line}")
    if chosen is not None:
        cycles = "1 cycle" if study.burst.cycles == 1 else f"{study.burst.cycles} cycles"
        burst = f"{cycles} of {study.burst.frequency_hz:g} Hz, hann window"
        check = chosen.found
        click.echo(f"burst   {'; '.join((f'{burst}: {check.verdict}', *check.reasons))}")
        click.echo(f"        {chosen.words}")
        label = "longer ones are felt more easily" if check.verdict == "fit" else "others"
        click.echo(f"        {label}: tactstrip bursts {shlex.quote(str(file))}")
    for heading, line in zip(("blocks", ""), block_words(study.design), strict=False):
        click.echo(f"{heading:8}{line}")


@click.command(epilog="Example: tactstrip init study.toml")
@click.argument(
    "file", metavar="[FILE]", type=click.Path(path_type=Path), default=Path("study.toml")
)
@click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="paper",
    show_default=True,
    help="Protocol to start from: that of the paper, the recommended design, the recommended "
    "design with realistic simulated participants, or the recommended design on your own plate.",
)
@plate_options
@refusals
def init(*, file: Path, preset: str, **plate: Any) -> None:
    """Write a commented study file.

    FILE is study.toml by default; an existing file is never overwritten. With --preset plate, the
    options from --width-mm to --ceiling-vpp describe your plate, and tactstrip prompts for those
    that you omit. Enter measured displacements and other materials in the file afterwards.
    """
    from experiment.archive.files import write_atomically
    from experiment.check.burst_choice import chosen_burst
    from experiment.study.study import Study

    ceiling = plate.pop("ceiling_vpp")
    options = [question.option for key, question in QUESTIONS.items() if plate[key]]
    options += [CEILING] * (ceiling is not None)
    if options and preset != PLATE:
        raise CommandError(f"{options[0]} needs --preset plate")
    if file.exists() or file.is_symlink():
        raise CommandError(f"{file} exists and is left as it is; name another file")
    if not file.parent.is_dir():
        raise CommandError(f"{file}: No such file or directory")
    chosen, entered_keys = None, tuple[str, ...]()
    if preset == PLATE:
        sections = _sections_for_plate(200.0 if ceiling is None else parse_ceiling_vpp(ceiling))
        plate = complete_plate(plate)
        entered_keys = study_keys(plate) + ("device.ceiling_vpp",) * (ceiling is not None)
        with working("Trying bursts") as step:
            chosen = chosen_burst(
                lambda burst: plate_study(plate, sections | {"burst": burst}), step
            )
        study = chosen.study
    else:
        study = Study(**_OVERRIDES[preset])
    file.open("x").close()
    try:
        write_atomically(file, _text(study, preset, entered_keys, chosen))
    except OSError:
        file.unlink(missing_ok=True)
        raise
    click.echo(f"{file} holds the {preset} preset; next: tactstrip check {file}")
    _print_summary(study, chosen, file)
