"""study.toml <-> `Study`: reading, faults in words, the paper's protocol, levels for one person.

What a file leaves to be found (samples of files, chosen windows) is found once, when it is read: a
plan holds what was found, so that what is played is never found anew.
"""

from __future__ import annotations

import base64
import json
import re
import reprlib
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from experiment.study.build import built_study
from experiment.study.sections.design import Design, check_levels
from experiment.study.sections.equipment import DeviceSettings, Masking
from experiment.study.sections.plate import Actuator
from experiment.study.sections.simulation import Simulation
from experiment.study.sections.stimulus import Condition
from experiment.study.study import Study, StudyError
from experiment.study.tables import StudyTables, section_table
from experiment.terms.checks import unknown_key

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pydantic_core import ErrorDetails

    from experiment.study.sections.stimulus import ConditionTable


__all__ = [
    "Actuator",
    "Condition",
    "Design",
    "DeviceSettings",
    "Masking",
    "Simulation",
    "Study",
    "StudyError",
    "paper_study",
    "read_levels",
    "read_study",
    "study_from_canonical",
    "study_from_text",
    "with_levels",
]

_TOML_PLACE = re.compile(r" \(at line (?P<line>\d+), column (?P<column>\d+)\)$")


def paper_study() -> Study:
    """Return the paper's protocol, which is what an empty study file says.

    Examples
    --------
    >>> study = paper_study()
    >>> study.design.levels_vpp, study.design.trials
    ((60.0, 95.0, 130.0, 165.0, 200.0), 155)
    """
    return _study({}, "the built-in study")


def read_study(path: Path | str) -> Study:
    """Read a study file.

    Parameters
    ----------
    path : Path or str
        A TOML file in UTF-8.

    Raises
    ------
    StudyError
        If there is no such file or it is not a study; one line that names file, key, what is
        allowed and what it got.
    """
    return study_from_text(read_text(Path(path)), str(path))


def study_from_text(text: str, file_name: str) -> Study:
    r"""Read a study from TOML text.

    Parameters
    ----------
    text : str
        The text of a study file.
    file_name : str
        What an error calls it; files that the study names lie in the same folder.

    Raises
    ------
    StudyError
        As `read_study`.

    Examples
    --------
    Comments, order and repeated defaults do not make another study:

    >>> text = "[burst]\ncycles = 1  # the paper's"
    >>> study_from_text(text, "study.toml") == paper_study()
    True
    """
    return _study(parsed(text, file_name), file_name, folder=Path(file_name).parent)


def study_from_canonical(text: str) -> Study:
    """Rebuild a study from its canonical text, as a plan holds it.

    Parameters
    ----------
    text : str
        `Study.canonical`.

    Raises
    ------
    StudyError
        If the text is not the canonical text of a study.

    Examples
    --------
    >>> study_from_canonical(paper_study().canonical) == paper_study()
    True
    """
    where = "the recorded study"
    try:
        tables = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{where} must be JSON text; got {error}") from error
    if not isinstance(tables, dict):
        raise StudyError(f"{where} must be a JSON object; got {type(tables).__name__}")
    study = _study(tables, where)
    if study.canonical != text:
        raise StudyError(f"{where} must be complete, in its canonical form; got another one")
    return study


def with_levels(study: Study, levels_vpp: Sequence[float]) -> Study:
    """Return the study with other levels, checked and with its own checksum.

    Parameters
    ----------
    study : Study
        The study.
    levels_vpp : sequence of float
        The new levels, increasing, above 0 and at most the device's ceiling.

    Raises
    ------
    StudyError
        If the study cannot be run with them.

    Examples
    --------
    >>> with_levels(paper_study(), (40.0, 50.0, 60.0)).design.levels_vpp
    (40.0, 50.0, 60.0)
    """
    tables = json.loads(study.canonical)
    tables["design"]["levels_vpp"] = list(levels_vpp)
    return _study(tables, f"study {study.name} with other levels")


def read_levels(path: Path | str, participant: str) -> tuple[float, ...]:
    """Read the levels placed for one participant.

    Parameters
    ----------
    path : Path or str
        A TOML file with ``levels_vpp`` and, if it is one person's, ``participant``.
    participant : str
        Who is about to be tested.

    Raises
    ------
    StudyError
        If there is no such file, it is no list of levels, or it is somebody else's.
    """
    table = parsed(read_text(Path(path)), str(path))
    known = ("levels_vpp", "participant")
    for key in table:
        if key not in known:
            raise StudyError(f"{path}: {unknown_key(key, known)}")
    owner = table.get("participant", participant)
    if owner != participant:
        raise StudyError(f"{path}: participant must be {participant!r}; got {owner!r}")
    levels_vpp = table.get("levels_vpp")
    if not isinstance(levels_vpp, list):
        raise StudyError(f"{path}: levels_vpp must be a list of numbers; got {levels_vpp!r}")
    try:
        check_levels(tuple(levels_vpp))
    except ValueError as error:
        raise StudyError(f"{path}: {error}") from error
    return tuple(float(level_vpp) for level_vpp in levels_vpp)


def read_text(path: Path) -> str:
    """Return the text of a file in UTF-8, or refuse it in one line."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StudyError(f"{path}: {error.strerror or error}") from error
    if data.startswith(b"\xef\xbb\xbf"):
        raise StudyError(f"{path}: must be UTF-8 without a byte order mark; got one")
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise StudyError(
            f"{path}:{line}: must be UTF-8; got byte {data[error.start]:#x}"
        ) from error


def parsed(text: str, file_name: str) -> dict[str, Any]:
    """Return the tables of a TOML text, or refuse it with its line."""
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise StudyError(f"{file_name}: nested too deeply") from error
    except ValueError as error:
        what, line, column = _place(str(error), text)
        raise StudyError(f"{file_name}:{line}: {what}{column}") from error


def _place(message: str, text: str) -> tuple[str, int, str]:
    """Take the place out of a parser's message: what is wrong, the line, the column in words."""
    found = _TOML_PLACE.search(message)
    if found is None:
        return message.removesuffix(" (at end of document)"), text.count("\n") + 1, ""
    return message[: found.start()], int(found["line"]), f" (column {found['column']})"


def _study(tables: Mapping[str, Any], where: str, folder: Path | None = None) -> Study:
    try:
        return complete_study(checked_tables(tables), folder, recorded=None)
    except ValueError as error:
        raise StudyError(f"{where}: {error}") from error


MOST_FAULTS = 3
"""How many faults a message names; it counts the others."""

_EXPECTED = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "tuple_type": "a list",
    "too_long": "a list of {max_length}",
    "greater_than": "a number > {gt:g}",
    "literal_error": "{expected}",
    "model_type": "a table",
}
_ARRAYS = ("actuator", "condition")
"""The sections that are written [[section]], once for each of several tables."""


def checked_tables(tables: Mapping[str, Any]) -> StudyTables:
    """Check the tables of a study file for types, words and unknown keys.

    Parameters
    ----------
    tables : mapping
        As parsed from TOML or JSON.

    Returns
    -------
    StudyTables
        With every default filled in.

    Raises
    ------
    ValueError
        If something is wrong; one line with the path of each key, what is allowed and what it got.

    Examples
    --------
    >>> checked_tables({"design": {"trails_per_side": 60}})
    Traceback (most recent call last):
    ValueError: unknown key design.trails_per_side; did you mean trials_per_side?
    """
    try:
        return StudyTables.model_validate(tables)
    except ValidationError as error:
        faults = _merged(error.errors(include_url=False), tables)
    more = len(faults) - MOST_FAULTS
    named = faults[:MOST_FAULTS] + ([f"and {more} more"] if more > 0 else [])
    raise ValueError("; ".join(named))


def _merged(errors: list[ErrorDetails], tables: Mapping[str, Any]) -> list[str]:
    """Word the faults; a key that may be of either of two types has one fault, not two."""
    words: dict[str, list[ErrorDetails]] = {}
    for error in errors:
        words.setdefault(_path(error["loc"], tables), []).append(error)
    return [_fault(path, found) for path, found in words.items()]


def _path(steps: tuple[int | str, ...], tables: Mapping[str, Any]) -> str:
    """Write the place of a value as the file's reader finds it: ``design.levels_vpp[2]``."""
    path = ""
    value: Any = tables
    for step in steps:
        try:
            value = value[step]
        except (KeyError, IndexError):
            value = None
        except TypeError:  # not a step into the file, but one type of several that a key may have
            break
        path += f"[{step}]" if isinstance(step, int) else f".{step}"
    return path.removeprefix(".")


def _fault(path: str, errors: list[ErrorDetails]) -> str:
    first = errors[0]
    if first["type"] == "extra_forbidden":
        return unknown_key(path, _known_keys(first["loc"][:-1]))
    if first["type"] == "missing":
        return f"{path} is missing"
    if first["type"] == "value_error":
        return f"{path}.{first['ctx']['error']}".removeprefix(".")
    allowed = " or ".join(_allowed(error) for error in errors)
    if path in _ARRAYS:
        allowed = f"given as [[{path}]]"
    return f"{path} must be {allowed}; got {_shown(first['input'])}"


def _allowed(error: ErrorDetails) -> str:
    text = _EXPECTED.get(error["type"])
    return error["msg"] if text is None else text.format(**error.get("ctx", {}))


def _known_keys(steps: tuple[int | str, ...]) -> list[str]:
    """List the keys of the table that the steps lead to."""
    sections = [step for step in steps if isinstance(step, str)]
    return list(section_table(*sections).model_fields)


def _shown(value: object) -> str:
    shown = reprlib.Repr()
    shown.maxstring = shown.maxother = shown.maxlong = 60
    try:
        return shown.repr(value)
    except ValueError:  # Python refuses to write a whole number of so many digits
        return "a number of thousands of digits"


def complete_study(tables: StudyTables, folder: Path | None, recorded: StudyTables | None) -> Study:
    """Find what is missing in checked tables, write it into them, and build the study.

    Parameters
    ----------
    tables : StudyTables
        Tables of a study; the conditions are filled in.
    folder : Path or None
        Where the study file lies; none where the tables are no file's.
    recorded : StudyTables or None
        Tables of the same study as a plan holds it: a window that was chosen then is the one.

    Raises
    ------
    ValueError
        If a value is out of its range, a file cannot be used, or no window does what is wanted.
    """
    for condition in tables.condition:
        if condition.file is not None and condition.samples_base64 is None and folder is not None:
            condition.samples_base64 = _samples_base64(
                folder / condition.file, tables.device.sample_rate_hz
            )
    study = built_study(tables)
    waiting = [
        (place, condition)
        for place, condition in enumerate(tables.condition)
        if condition.window == "auto" and condition.auto_window is None
    ]
    if not waiting:
        return study
    for place, condition in waiting:
        _choose_window(condition, study, place, recorded)
    return built_study(tables)


def _samples_base64(path: Path, sample_rate_hz: float) -> str:
    from experiment.study.click import read_click

    return base64.b64encode(read_click(path, sample_rate_hz).astype("<f8").tobytes()).decode()


def _choose_window(
    condition: ConditionTable, study: Study, place: int, recorded: StudyTables | None
) -> None:
    for before in recorded.condition if recorded is not None else ():
        stated = before.model_copy(update={"auto_cycles": None, "auto_window": None})
        if stated.model_dump() == condition.model_dump() and before.auto_window is not None:
            condition.auto_cycles, condition.auto_window = before.auto_cycles, before.auto_window
            return
    from experiment.study.physics import chosen_burst

    burst = chosen_burst(study, study.conditions[place])
    condition.auto_cycles, condition.auto_window = burst.cycles, burst.window
