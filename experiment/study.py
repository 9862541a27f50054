"""study.toml <-> `Study`: reading, the paper's protocol, and levels placed for one person.

What everybody else takes are the frozen SI values of `experiment.study_values`, named here too.
pydantic checks the file; it is imported by the first function that reads one.
"""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from experiment.actuator import Actuator
from experiment.checks import unknown_key
from experiment.design import Design, check_levels
from experiment.study_values import (
    Condition,
    DeviceSettings,
    Masking,
    Simulation,
    Study,
    StudyError,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

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
    from experiment.study_faults import checked_tables
    from experiment.study_settle import settle

    try:
        return settle(checked_tables(tables), folder, recorded=None)
    except ValueError as error:
        raise StudyError(f"{where}: {error}") from error
