"""The options and prompts of `tactstrip init` that describe a plate, and the study they define."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from experiment.commands.options.hardware import on_terminal
from experiment.exits import CommandError
from experiment.names import require_word

if TYPE_CHECKING:
    from experiment.study.study import Study


# Repeated here because the module that defines them imports numpy, which --help must not.
_MATERIALS: Final = (
    "aluminium",
    "steel",
    "stainless",
    "brass",
    "copper",
    "titanium",
    "glass",
    "borosilicate",
    "pmma",
    "polycarbonate",
)
_EDGES: Final = ("simply-supported", "clamped", "measured-cutoff")


class Question(NamedTuple):
    """A property of the plate: its option with metavar and help, and the prompt for it."""

    option: str
    metavar: str
    help: str
    prompt: str


# The properties of a plate by their keys in [strip], in the order of the prompts. The allowed range
# is defined by the section that reads the key; error messages name the option instead of the key.
QUESTIONS: Final = {
    "width_mm": Question(
        "--width-mm",
        "MM",
        "Width between the two long edges, in mm.",
        "Width between the held edges, in mm",
    ),
    "thickness_mm": Question(
        "--thickness-mm", "MM", "Thickness of the bare plate, in mm.", "Thickness, in mm"
    ),
    "length_mm": Question(
        "--length-mm", "MM", "Length, in mm, or `endless`.", "Length, in mm, or endless"
    ),
    "material": Question(
        "--material",
        "NAME",
        (
            f"Material: {', '.join(_MATERIALS)} (glass: soda-lime). Enter the constants of any "
            "other material in the file."
        ),
        f"Material: {', '.join(_MATERIALS)}",
    ),
    "edge": Question(
        "--edge",
        "NAME",
        f"Support of the long edges: {', '.join(_EDGES)}. Enter elastic edges in the file.",
        f"Edges: {', '.join(_EDGES)}",
    ),
    "measured_cutoff_hz": Question(
        "--cutoff-hz",
        "HZ",
        "Measured first cut-off frequency, in Hz. Without --edge, it implies measured-cutoff.",
        "First cut-off as measured, in Hz",
    ),
    "actuator": Question(
        "--actuator",
        "SHAPE@X",
        (
            "Pair of actuators at -X and X, in mm: disc:DIAMETER@X (diameter of the electrode), "
            "rectangle:ALONGxACROSS@X or motor:ALONGxACROSS@X. Repeat the option to place the left "
            "and the right actuator individually."
        ),
        (
            "Actuators, in mm: disc:DIAMETER@X (of the ceramic's electrode, not the metal) or "
            "rectangle:ALONGxACROSS@X, one at -X and one at X"
        ),
    ),
}
_EXAMPLE_PLATE: Final = {
    "width_mm": "25",
    "thickness_mm": "0.5",
    "length_mm": "200",
    "material": "steel",
    "edge": "clamped",
}
"""The values that stand in for properties not yet entered when an answer is checked."""
CEILING: Final = "--ceiling-vpp"
_WHOLE_PLATE_KEYS: Final = ("edge", "measured_cutoff_hz", "actuator")
_ACTUATOR: Final = re.compile(
    r"(?P<shape>disc|rectangle|motor):(?P<size>[^x@]+)(x(?P<across>[^x@]+))?@(?P<x_mm>[^x@]+)"
)


def plate_study(plate: dict[str, Any], sections: dict[str, Any]) -> Study:
    """Return the study of a plate, given as text by the keys of `QUESTIONS`, and other sections.

    Raises ValueError, which names the options.
    """
    from experiment.study.study import Study

    strip = _strip(plate)
    try:
        return Study(**sections | {"strip": strip, "actuator": _actuator_pair(plate["actuator"])})
    except ValueError as error:
        raise ValueError(_name_options(str(error))) from error


def _check(plate: dict[str, Any]) -> None:
    """Raise ValueError for an invalid plate or, if they are given, invalid actuators."""
    from experiment.study.plate import Plate

    if "actuator" in plate:
        plate_study(plate, {})
        return
    try:
        Plate(**_strip(plate))
    except ValueError as error:
        raise ValueError(_name_options(str(error))) from error


def _strip(plate: dict[str, Any]) -> dict[str, Any]:
    """Return the values of the section [strip]."""
    require_word("--edge", plate["edge"], _EDGES)
    return {
        key: text
        if key in {"material", "edge"} or text == "endless"
        else _number(question.option, text)
        for key, question in QUESTIONS.items()
        if (text := plate.get(key)) is not None and key != "actuator"
    }


def _name_options(message: str) -> str:
    """Replace the keys of a study file in an error message by the options of this command."""
    for key, question in QUESTIONS.items():
        option = question.option
        message = re.sub(rf"write {key} = ", f"write {option} ", message)
        message = re.sub(rf"\b{key}\[[01]\]\.", f"{option}: ", message)
        if key != "actuator":
            message = re.sub(rf"\b(strip\.)?{key}\b", option, message)
    message = re.sub(r"write ceiling_vpp = ", f"write {CEILING} ", message)
    message = re.sub(r"\b(device\.)?ceiling_vpp\b", CEILING, message)
    message = re.sub(
        r"x_mm is in metres, write x_mm = -(\S+) and x_mm = \1",
        r"X is in metres, write @\1",
        message,
    )
    message = re.sub(r"^the (left|right|actuators) ", r"--actuator: the \1 ", message)
    return re.sub(r"^(.+); \1$", r"\1", message)  # both actuators have the same fault


def _name_properties(message: str) -> str:
    """Replace the options in an error message by the properties that a prompt names.

    >>> _name_properties("--width-mm must be >= 2; if these are metres, write --width-mm 25")
    'width must be >= 2; if these are metres, write 25'
    """
    message = re.sub(r"write --[\w-]+ ", "write ", message.removeprefix("--actuator: "))
    return re.sub(r"--(\w+)(-\w+)?\b", r"\1", message.replace("--cutoff-hz", "the cut-off"))


def study_keys(plate: dict[str, Any]) -> tuple[str, ...]:
    """Return the keys of the study, with their sections, that the plate defines."""
    actuators = dict.fromkeys(key for table in _actuator_pair(plate["actuator"]) for key in table)
    strip = [f"strip.{key}" for key in QUESTIONS if key in plate and key != "actuator"]
    return (*strip, *(f"actuator.{key}" for key in actuators))


def parse_ceiling_vpp(text: str) -> float:
    """Return the ceiling of the device; ValueError names the option."""
    from experiment.study.equipment import DeviceSettings

    number = _number(CEILING, text)
    try:
        return DeviceSettings(ceiling_vpp=number).ceiling_vpp
    except ValueError as error:
        raise ValueError(_name_options(str(error))) from error


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        point = text.replace(",", ".", 1)
        hint = f"; write {point}, with a point" if re.fullmatch(r"-?\d+\.\d+", point) else ""
        if re.fullmatch(r"[-+]?[\d.]+ *[A-Za-z]+", text):
            unit = "Hz" if name.endswith("hz") else "V" if name == CEILING else "mm"
            hint = f"; write the number alone, in {unit}"
        kind = "a number or endless" if name == QUESTIONS["length_mm"].option else "a number"
        raise ValueError(f"{name} must be {kind}; got {text!r}{hint}") from error


def _actuator_pair(actuators: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the left and the right actuator: one text defines a pair, two define one each.

    >>> [(table["side"], table["x_mm"]) for table in _actuator_pair(("disc:12.8@35",))]
    [('left', -35.0), ('right', 35.0)]
    """
    tables = [_actuator(text) for text in actuators]
    if len(tables) == 1:
        (table,) = tables
        if not table["x_mm"] > 0:
            raise ValueError(
                "--actuator, given once, is a pair at -X and X: X must be above 0; got "
                f"{table['x_mm']:g}; give it twice for two places of their own"
            )
        tables = [table | {"x_mm": -table["x_mm"]}, table]
    if tables[2:]:
        raise ValueError(
            f"--actuator must be given once or twice; got {len(tables)}; those that no session "
            "drives go into the file, with side = other"
        )
    left, right = sorted(tables, key=lambda table: float(table["x_mm"]))
    return [left | {"side": "left"}, right | {"side": "right"}]


def _actuator(text: str) -> dict[str, Any]:
    match = _ACTUATOR.fullmatch(text.replace(" ", ""))
    if match is None or (match["across"] is None) != (match["shape"] == "disc"):
        raise ValueError(
            "--actuator must be disc:DIAMETER@X, rectangle:ALONGxACROSS@X or motor:ALONGxACROSS@X, "
            f"all in mm, such as disc:12.8@35; got {text!r}"
        )
    sizes = [_number("--actuator", match[group]) for group in ("size", "across") if match[group]]
    keys = ("diameter_mm",) if len(sizes) == 1 else ("length_x_mm", "length_y_mm")
    table = {"shape": match["shape"], "x_mm": _number("--actuator", match["x_mm"])}
    return table | dict(zip(keys, sizes, strict=True))


def complete_plate(options: dict[str, Any]) -> dict[str, Any]:
    """Prompt for the properties that the options omit; without a terminal, raise CommandError."""
    plate, missing = {key: value for key, value in options.items() if value}, []
    if "measured_cutoff_hz" in plate:
        plate.setdefault("edge", "measured-cutoff")
    for key, question in QUESTIONS.items():
        is_needed = key != "measured_cutoff_hz" or plate.get("edge") == "measured-cutoff"
        if key in plate or not is_needed:
            continue
        if on_terminal():
            plate[key] = _prompt(key, plate)
        else:
            missing.append(question.option)
    if missing:
        raise CommandError(
            f"--preset plate needs {', '.join(missing)}; on a terminal they are asked for"
        )
    return plate


def _prompt(key: str, plate: dict[str, Any]) -> Any:
    """Prompt for a property until its value is compatible with those before it."""
    # Edges and actuators can be checked only together with the whole plate.
    omitted = () if key in _WHOLE_PLATE_KEYS else _WHOLE_PLATE_KEYS
    trial_plate = _EXAMPLE_PLATE | {
        name: value for name, value in plate.items() if name not in omitted
    }
    if key != "measured_cutoff_hz":
        _check(trial_plate)  # an invalid option is an error; only answers are prompted for again

    def parse(text: str) -> str | tuple[str, ...]:
        value = (text,) if key == "actuator" else text
        if text != "measured-cutoff":
            try:
                _check(trial_plate | {key: value})
            except ValueError as error:
                raise click.UsageError(_name_properties(str(error))) from error
        return value

    try:
        return click.prompt(QUESTIONS[key].prompt, value_proc=parse, err=True)
    except click.Abort as error:
        raise CommandError("not all was answered; nothing was written") from error


def plate_options(command: Any) -> Any:
    """Add the options that describe a plate to a command."""
    ceiling = "Ceiling of the device, in V peak-to-peak. No level exceeds it.  [default: 200]"
    command = click.option(CEILING, metavar="V", help=ceiling)(command)
    for key, question in reversed(QUESTIONS.items()):
        command = click.option(
            question.option,
            key,
            metavar=question.metavar,
            multiple=key == "actuator",
            help=question.help,
        )(command)
    return command
