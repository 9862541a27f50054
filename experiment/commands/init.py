"""The command `init`: a study file from a preset, from your own plate, or from another study."""

from __future__ import annotations

import math
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import click

from device.printing import echo
from experiment.commands.options.hardware import on_terminal, working
from experiment.exits import CommandError, refusals

if TYPE_CHECKING:
    from collections.abc import Mapping

    from experiment.study.study import Study

PRESETS: Final = ("paper", "recommended", "realistic", "plate")
_PLATE: Final = "plate"
_N_LEVELS: Final = 5
_PILOT: Final[dict[str, Any]] = {
    "trials_per_side": 20,
    "repeats_per_level": None,
    "both_trials": 0,
    "both_fraction": None,
    "blank_trials": 12,
    "order": "balanced",
}
_N_PILOT_LEVELS: Final = 10
_PILOT_RANGE: Final = 4.0
"""A pilot's levels lie this factor below and above an expected threshold."""
_ACTUATOR: Final = re.compile(
    r"(?:(?P<shape>disc|rectangle|motor)(?::(?P<size>[\d.]+)(?:x(?P<across>[\d.]+))?)?)?"
    r"@(?P<x_mm>[-+]?[\d.]+)"
)
"""An actuator on the command line: shape, size and centre."""


def _length(text: str) -> float | str:
    """Return a number of millimetres, or endless."""
    try:
        return text if text == "endless" else float(text)
    except ValueError as error:
        raise click.BadParameter(f"{text!r} is neither a number nor endless") from error


def _actuator(text: str) -> dict[str, Any]:
    """Return shape, size and centre of an actuator, as keys of [[actuator]]."""
    match = _ACTUATOR.fullmatch(text.replace(" ", ""))
    if match is None or (match["across"] is not None) == (match["shape"] == "disc"):
        raise click.BadParameter(
            f"{text!r} is not disc:DIAMETER@X, rectangle:ALONGxACROSS@X or motor:ALONGxACROSS@X "
            "in mm, such as disc:12.8@35"
        )
    table: dict[str, Any] = {"shape": match["shape"] or "disc", "x_mm": float(match["x_mm"])}
    sizes = [float(match[group]) for group in ("size", "across") if match[group]]
    keys = ("diameter_mm",) if table["shape"] == "disc" else ("length_x_mm", "length_y_mm")
    return table | dict(zip(keys, sizes, strict=False))


class Question(NamedTuple):
    """A property of the plate: its key, its type, the prompt, a hint above it, and a default."""

    key: str
    type: Any
    metavar: str
    prompt: str
    hint: str = ""
    default: str | None = None

    @property
    def name(self) -> str:
        """The parameter of the command."""
        return self.key.rpartition(".")[2].removeprefix("measured_")

    @property
    def option(self) -> str:
        """The option on the command line."""
        return f"--{self.name.replace('_', '-')}"


_MEASURED: Final = "measured-cutoff"
_TYPES: Final[dict[str, Any]] = {
    "number": float,
    "text": str,
    "length": _length,
    "actuator": _actuator,
    "edge": click.Choice(("simply-supported", "clamped", _MEASURED)),
}
QUESTIONS: Final = tuple(
    Question(**question | {"type": _TYPES[question["type"]]})
    for question in tomllib.loads(
        Path(__file__).with_name("init_questions.toml").read_text(encoding="utf-8")
    )["question"]
)


def _sections(values: Mapping[str, Any], disc: str | None) -> dict[str, Any]:
    """Return the keys that options set, by section; of an option that is omitted, none."""
    from experiment.study.writing import discs, preset_text

    sections: dict[str, Any] = {"strip": {}, "device": {}}
    for question in QUESTIONS:
        section, _, key = question.key.partition(".")
        if key and (value := values.get(question.name)) is not None:
            sections[section][key] = value
    if "measured_cutoff_hz" in sections["strip"]:
        sections["strip"].setdefault("edge", _MEASURED)
    actuators = values.get("actuator") or ()
    tables = tomllib.loads(preset_text(_PLATE))["actuator"] if not actuators else _pair(actuators)
    layers = {} if disc is None else discs()[disc]
    sections["actuator"] = [layers | table for table in tables]
    if ceiling_vpp := sections["device"].get("ceiling_vpp"):
        steps = (ceiling_vpp * step / _N_LEVELS for step in range(1, _N_LEVELS))
        levels_vpp = [float(f"{level_vpp:.4g}") for level_vpp in steps]
        sections["design"] = {"levels_vpp": [*levels_vpp, ceiling_vpp]}
    return sections


def _pair(actuators: tuple[dict[str, Any], ...]) -> list[dict[str, Any]]:
    """Return the actuator of each site; one on the command line means a pair at -X and X."""
    from experiment.tasks import SITES

    tables = list(actuators)
    if len(tables) == 1:
        tables = [tables[0] | {"x_mm": -tables[0]["x_mm"]}, tables[0]]
    if len(tables) != len(SITES):
        rule = "must be given once or twice; further actuators are written in the file"
        raise CommandError(f"--actuator: {rule} (got {len(tables)})")
    tables.sort(key=lambda table: float(table["x_mm"]))
    return [{"site": site} | table for site, table in zip(SITES, tables, strict=True)]


def _option_names(disc: str | None) -> dict[str, str]:
    """Return the options by the keys that they set, those of both actuators included."""
    from experiment.study.writing import discs

    options = dict.fromkeys(
        ("x_mm", "y_mm", "diameter_mm", "length_x_mm", "length_y_mm"), "--actuator"
    )
    options |= dict.fromkeys(discs()[disc] if disc else (), "--disc")
    names = {question.key: question.option for question in QUESTIONS}
    return names | {
        f"actuator[{index}].{key}": f"{option}, {key}"
        for key, option in options.items()
        for index in range(2)
    }


def _plate_text(values: Mapping[str, Any], disc: str | None, burst: Mapping[str, Any]) -> str:
    from experiment.study.writing import aligned, changed_text, preset_text

    return aligned(changed_text(preset_text(_PLATE), _sections(values, disc) | {"burst": burst}))


def _plate_study(values: Mapping[str, Any], disc: str | None, burst: Mapping[str, Any]) -> Study:
    """Return the study of a plate; CommandError names the options."""
    from experiment.study.base import StudyError
    from experiment.study.files import study_from_text

    try:
        return study_from_text(_plate_text(values, disc, burst), "study.toml")
    except StudyError as error:
        faults = [str(fault) for fault in error.renamed(_option_names(disc)).faults]
        # what follows from an option is a fault of the option alone
        lines = [fault for fault in faults if fault.startswith("--")]
        raise CommandError(*(lines or faults)) from error


def _ask(values: dict[str, Any], disc: str | None) -> dict[str, Any]:
    """Prompt for the options that are omitted; without a terminal, CommandError lists them."""
    answers = {name: value for name, value in values.items() if value not in (None, ())}
    if "cutoff_hz" in answers:
        answers.setdefault("edge", _MEASURED)
    missing = []
    for question in QUESTIONS:
        is_needed = question.name != "cutoff_hz" or answers.get("edge") == _MEASURED
        if question.name in answers or not is_needed:
            continue
        if on_terminal():
            answers[question.name] = _prompt(question, answers, disc)
        else:
            missing.append(question.option)
    if missing:
        raise CommandError(f"{', '.join(missing)}: required with --preset plate")
    return answers


def _prompt(question: Question, answers: dict[str, Any], disc: str | None) -> Any:
    """Prompt until the value violates no rule of its own key."""

    def parse(text: str) -> Any:
        value = click.types.convert_type(question.type).convert(text, None, None)
        value = (value,) if question.name == "actuator" else value
        trial = answers | {question.name: value}
        if trial.get("edge") == _MEASURED and "cutoff_hz" not in trial:
            trial["edge"] = "clamped"
        try:
            _plate_study(trial, disc, {})
        except CommandError as error:
            for line in error.message.splitlines():
                if line.startswith(question.option):
                    raise click.UsageError(line) from error
        return value

    try:
        if question.hint:
            echo(*question.hint.splitlines(), err=True)
        return click.prompt(question.prompt, default=question.default, value_proc=parse, err=True)
    except click.Abort as error:
        raise CommandError("not every question was answered; nothing was written") from error


def _choose_burst(values: dict[str, Any], disc: str | None) -> tuple[str, dict[str, Any]]:
    """Return the file of a plate with the shortest burst that suits it, and its report."""
    from experiment.check.bursts import chosen_burst
    from experiment.check.report import burst_text

    with working("Trying bursts") as step:
        study, verdicts = chosen_burst(lambda burst: _plate_study(values, disc, burst), step)
    burst = study.burst
    keys = {key: getattr(burst, key) for key in ("frequency_hz", "cycles", "window")}
    report = {"burst": burst_text(study.conditions[0]), "verdicts": verdicts}
    return _plate_text(values, disc, keys), report


def pilot_levels_vpp(study: Study) -> list[float]:
    """Return a pilot's levels, in equal steps of dB.

    They lie around the threshold that simulated participants have, if it is known in volts on this
    plate and low enough, and else below the ceiling.
    """
    import numpy as np

    from experiment.study.physics import study_gains
    from experiment.study.threshold import median_threshold

    high_vpp, _ = study.device.highest
    low_vpp = high_vpp / 10
    has_displacements = study.simulation.threshold_um is not None
    if has_displacements or "threshold_vpp" in study.simulation.model_fields_set:
        gains = study_gains(study)[0].at_fingers(study.task.sites)
        level_vpp = median_threshold(study, gains).threshold_vpp
        if level_vpp * _PILOT_RANGE < high_vpp:
            low_vpp, high_vpp = level_vpp / _PILOT_RANGE, level_vpp * _PILOT_RANGE
    digits = max(0, 2 - math.floor(math.log10(low_vpp)))
    levels_vpp = np.geomspace(low_vpp, high_vpp, _N_PILOT_LEVELS)
    return [round(level_vpp, digits) for level_vpp in levels_vpp.tolist()]


def _from_study(source: Path, disc: str | None, *, pilot: bool) -> str:
    """Return another study's file, with a disc's layers or as a pilot study."""
    from experiment.study.base import StudyError
    from experiment.study.files import read_study, read_text, study_from_text
    from experiment.study.writing import changed_text, discs

    study, text = read_study(source), read_text(source)
    if disc is not None:
        tables = [
            {key: getattr(actuator, key) for key in actuator.model_fields_set}
            | (discs()[disc] if actuator in study.driven else {})
            for actuator in study.actuators
        ]
        text = changed_text(text, {"actuator": tables})
        try:
            study = study_from_text(text, str(source))
        except StudyError as error:
            raise error.renamed(_option_names(disc)) from error
    if pilot:
        design = _PILOT | {"levels_vpp": pilot_levels_vpp(study)}
        text = changed_text(text, {"study": {"name": "pilot"}, "design": design})
    return text


def _options(command: Any) -> Any:
    """Add the options that describe a plate."""
    for question in reversed(QUESTIONS):
        command = click.option(
            question.option,
            type=question.type,
            metavar=question.metavar,
            multiple=question.name == "actuator",
            help=f"{question.prompt}.",
        )(command)
    return command


@click.command(epilog="Example: tactstrip init study.toml")
@click.argument("file", metavar="[FILE]", type=click.Path(path_type=Path), required=False)
@click.option(
    "--preset",
    type=click.Choice(PRESETS),
    default="paper",
    show_default=True,
    help="Study to start from: the paper's protocol, the recommended design, the recommended "
    "design with realistic simulated participants, or the recommended design on your own plate.",
)
@_options
@click.option(
    "--disc",
    metavar="NAME",
    help="Buzzer disc by name, such as 7BB-20-3: its layers predict the displacement.",
)
@click.option(
    "--from",
    "source",
    type=click.Path(path_type=Path),
    help="Study file to start from, in place of a preset; with --pilot or --disc.",
)
@click.option("--pilot", is_flag=True, help="Write a pilot study: few trials at ten levels.")
@click.option("--all", "every_key", is_flag=True, help="Add every other key as a comment.")
@refusals
def init(
    *,
    file: Path | None,
    preset: str,
    disc: str | None,
    source: Path | None,
    pilot: bool,
    every_key: bool,
    **values: Any,
) -> None:
    """Write a study file.

    FILE is study.toml, or pilot.toml with --pilot; an existing file is never overwritten. With
    --preset plate, the options from --width-mm to --ceiling-vpp describe your plate, and tactstrip
    prompts for those that you omit. The file study.schema.json, which is written to the same
    folder, lets editors complete keys.
    """
    from experiment.check.report import report_text
    from experiment.study.files import study_from_text
    from experiment.study.writing import discs, preset_text, with_directive, with_every_key

    file = file or Path("pilot.toml" if pilot else "study.toml")
    _check_options(values, preset=preset, disc=disc, source=source, pilot=pilot)
    if disc is not None and disc not in discs():
        raise CommandError(f"--disc: must be one of {', '.join(discs())} (got {disc!r})")
    if file.exists() or file.is_symlink():
        raise CommandError(f"{file}: exists; name another file")
    if not file.parent.is_dir():
        raise CommandError(f"{file}: No such file or directory")
    burst = None
    if source is not None:
        text = _from_study(source, disc, pilot=pilot)
    elif preset == _PLATE:
        text, burst = _choose_burst(_ask(values, disc), disc)
    else:
        text = preset_text(preset)
    text = with_directive(with_every_key(text) if every_key else text)
    study_from_text(text, str(file))
    _write(file, text)
    echo(*report_text("init", {"file": str(file), "chosen": burst}).splitlines())


def _check_options(
    values: Mapping[str, Any], *, preset: str, disc: str | None, source: Path | None, pilot: bool
) -> None:
    """Refuse options without what they need."""
    given = [one.option for one in QUESTIONS if values[one.name] not in (None, ())]
    if given and (preset != _PLATE or source is not None):
        raise CommandError(f"{given[0]}: requires --preset plate and excludes --from")
    if disc is not None and preset != _PLATE and source is None:
        raise CommandError("--disc: requires --preset plate or --from")
    if pilot and source is None:
        raise CommandError("--pilot: requires --from")
    if source is not None and not pilot and disc is None:
        raise CommandError("--from: requires --pilot or --disc")


def _write(file: Path, text: str) -> None:
    """Write a study file and its JSON Schema."""
    from experiment.record.files import write_atomically
    from experiment.study.writing import SCHEMA_FILE, schema_text

    schema_file = file.with_name(SCHEMA_FILE)
    if schema_file.exists() and '"$id": "tactstrip-study"' not in schema_file.read_text("utf-8"):
        raise CommandError(f"{schema_file}: is not a schema of tactstrip; rename it")
    file.open("x").close()
    try:
        write_atomically(file, text)
        write_atomically(schema_file, schema_text())
    except OSError:
        file.unlink(missing_ok=True)
        raise
