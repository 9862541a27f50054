"""A lab's own plate for `tactstrip init`: options, questions, and the study that they make."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from experiment.commands.options.hardware import on_terminal
from experiment.terms.checks import require_word
from experiment.terms.exits import CommandError

if TYPE_CHECKING:
    from experiment.study.study import Study


# Written out: where they are defined numpy is imported, and --help needs none.
_MATERIALS: Final = (
    "aluminium", "steel", "stainless", "brass", "copper", "titanium", "glass", "borosilicate",
    "pmma", "polycarbonate",
)  # fmt: skip
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
        "--width-mm", "MM", "Width between the two long edges, in mm.",
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
}  # fmt: skip
_ANY_PLATE: Final = {
    "width_mm": "25", "thickness_mm": "0.5", "length_mm": "200", "material": "steel",
    "edge": "clamped",
}  # fmt: skip
"""What an answer is tried with while the others are not known yet."""
CEILING: Final = "--ceiling-vpp"
_LAST: Final = ("edge", "measured_cutoff_hz", "actuator")
_ACTUATOR: Final = re.compile(
    r"(?P<shape>disc|rectangle|motor):(?P<size>[^x@]+)(x(?P<across>[^x@]+))?@(?P<place>[^x@]+)"
)


def plate_study(known: dict[str, Any], others: dict[str, Any]) -> Study:
    """Return the study of a plate as it was typed, by the keys of `QUESTIONS`.

    `others` are its other sections. ValueError names the options.
    """
    from experiment.study.study import Study

    strip = _strip(known)
    try:
        return Study(**others | {"strip": strip, "actuator": _pair(known["actuator"])})
    except ValueError as error:
        raise ValueError(_by_options(str(error))) from error


def _check(known: dict[str, Any]) -> None:
    """Refuse a plate, and its actuators once they are known."""
    from experiment.study.sections.plate import Plate

    if "actuator" in known:
        plate_study(known, {})
        return
    try:
        Plate(**_strip(known))
    except ValueError as error:
        raise ValueError(_by_options(str(error))) from error


def _strip(known: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of [strip] as they were typed."""
    require_word("--edge", known["edge"], _EDGES)
    return {
        key: text if key in {"material", "edge"} or text == "endless" else _number(option, text)
        for key, (option, *_) in QUESTIONS.items()
        if (text := known.get(key)) is not None and key != "actuator"
    }


def _by_options(refusal: str) -> str:
    """Name in a refusal the options, where it names the keys of a file."""
    for key, (option, *_) in QUESTIONS.items():
        refusal = re.sub(rf"write {key} = ", f"write {option} ", refusal)
        refusal = re.sub(rf"\b{key}\[[01]\]\.", f"{option}: ", refusal)
        if key != "actuator":
            refusal = re.sub(rf"\b(strip\.)?{key}\b", option, refusal)
    refusal = re.sub(r"write ceiling_vpp = ", f"write {CEILING} ", refusal)
    refusal = re.sub(r"\b(device\.)?ceiling_vpp\b", CEILING, refusal)
    refusal = re.sub(
        r"x_mm is in metres, write x_mm = -(\S+) and x_mm = \1",
        r"X is in metres, write @\1",
        refusal,
    )
    refusal = re.sub(r"^the (left|right|actuators) ", r"--actuator: the \1 ", refusal)
    return re.sub(r"^(.+); \1$", r"\1", refusal)  # the same of both


def _by_questions(refusal: str) -> str:
    """Say a refusal to somebody who was asked, and typed no option.

    >>> _by_questions("--width-mm must be >= 2; if these are metres, write --width-mm 25")
    'width must be >= 2; if these are metres, write 25'
    """
    refusal = re.sub(r"write --[\w-]+ ", "write ", refusal.removeprefix("--actuator: "))
    return re.sub(r"--(\w+)(-\w+)?\b", r"\1", refusal.replace("--cutoff-hz", "the cut-off"))


def told_paths(known: dict[str, Any]) -> tuple[str, ...]:
    """Return the keys of the study that were typed, each with its section."""
    actuators = dict.fromkeys(key for one in _pair(known["actuator"]) for key in one)
    strip = [f"strip.{key}" for key in QUESTIONS if key in known and key != "actuator"]
    return (*strip, *(f"actuator.{key}" for key in actuators))


def ceiling_vpp(text: str) -> float:
    """Return the device's ceiling as it was typed, or refuse it by its option."""
    from experiment.study.sections.equipment import DeviceSettings

    number = _number(CEILING, text)
    try:
        return DeviceSettings(ceiling_vpp=number).ceiling_vpp
    except ValueError as error:
        raise ValueError(_by_options(str(error))) from error


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        point = text.replace(",", ".", 1)
        hint = f"; write {point}, with a point" if re.fullmatch(r"-?\d+\.\d+", point) else ""
        if re.fullmatch(r"[-+]?[\d.]+ *[A-Za-z]+", text):
            unit = "Hz" if name.endswith("hz") else "V" if name == CEILING else "mm"
            hint = f"; write the number alone, in {unit}"
        kind = "a number or endless" if name == QUESTIONS["length_mm"][0] else "a number"
        raise ValueError(f"{name} must be {kind}; got {text!r}{hint}") from error


def _pair(actuators: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the left and the right actuator: one text is a pair, two are one each.

    >>> [(one["side"], one["x_mm"]) for one in _pair(("disc:12.8@35",))]
    [('left', -35.0), ('right', 35.0)]
    """
    tables = [_actuator(text) for text in actuators]
    if len(tables) == 1:
        (one,) = tables
        if not one["x_mm"] > 0:
            raise ValueError(
                "--actuator, given once, is a pair at -X and X: X must be above 0; got "
                f"{one['x_mm']:g}; give it twice for two places of their own"
            )
        tables = [one | {"x_mm": -one["x_mm"]}, one]
    if tables[2:]:
        raise ValueError(
            f"--actuator must be given once or twice; got {len(tables)}; those that no session "
            "drives go into the file, with side = other"
        )
    left, right = sorted(tables, key=lambda one: float(one["x_mm"]))
    return [left | {"side": "left"}, right | {"side": "right"}]


def _actuator(text: str) -> dict[str, Any]:
    found = _ACTUATOR.fullmatch(text.replace(" ", ""))
    if found is None or (found["across"] is None) != (found["shape"] == "disc"):
        raise ValueError(
            "--actuator must be disc:DIAMETER@X, rectangle:ALONGxACROSS@X or motor:ALONGxACROSS@X, "
            f"all in mm, such as disc:12.8@35; got {text!r}"
        )
    sizes = [_number("--actuator", found[part]) for part in ("size", "across") if found[part]]
    keys = ("diameter_mm",) if len(sizes) == 1 else ("length_x_mm", "length_y_mm")
    table = {"shape": found["shape"], "x_mm": _number("--actuator", found["place"])}
    return table | dict(zip(keys, sizes, strict=True))


def completed(given: dict[str, Any]) -> dict[str, Any]:
    """Ask for what the options do not say of a plate; off a terminal name what is missing."""
    known, missing = {key: value for key, value in given.items() if value}, []
    if "measured_cutoff_hz" in known:
        known.setdefault("edge", "measured-cutoff")
    for key, (option, *_) in QUESTIONS.items():
        needless = key == "measured_cutoff_hz" and known.get("edge") != "measured-cutoff"
        if key in known or needless:
            continue
        if on_terminal():
            known[key] = _asked(key, known)
        else:
            missing.append(option)
    if missing:
        raise CommandError(
            f"--preset plate needs {', '.join(missing)}; on a terminal they are asked for"
        )
    return known


def _asked(key: str, known: dict[str, Any]) -> Any:
    """Ask for a value until there is one that goes with those before it."""
    # how the edges are and where the actuators lie goes only with the whole plate
    later = () if key in _LAST else _LAST
    stated = _ANY_PLATE | {name: value for name, value in known.items() if name not in later}
    if key != "measured_cutoff_hz":
        _check(stated)  # what the command line gave is refused, not asked for again

    def checked(text: str) -> str | tuple[str, ...]:
        value = (text,) if key == "actuator" else text
        if text != "measured-cutoff":
            try:
                _check(stated | {key: value})
            except ValueError as error:
                raise click.UsageError(_by_questions(str(error))) from error
        return value

    try:
        return click.prompt(QUESTIONS[key].prompt, value_proc=checked, err=True)
    except click.Abort as error:
        raise CommandError("not all was answered; nothing was written") from error


def plate_options(command: Any) -> Any:
    """Give a command the options that describe a plate, by the keys of `QUESTIONS`."""
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
