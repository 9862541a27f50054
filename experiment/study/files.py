"""study.toml <-> `Study`: reading, faults in words, the paper's protocol, levels for one person.

What a file leaves to be found (samples of files, chosen windows) is found once, when it is read: a
plan holds what was found, so that what is played is never found anew.
"""

from __future__ import annotations

import base64
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from experiment.names import unknown_key
from experiment.study.base import stated_of, with_stated
from experiment.study.design import Design
from experiment.study.slips import meant_line
from experiment.study.stated import as_stated, not_recorded, without_init
from experiment.study.stimulus import levels_words
from experiment.study.study import Study, StudyError, UnusableStudyError

if TYPE_CHECKING:
    from experiment.study.stimulus import Condition


_FIRST_STUDY: Final = Path(__file__).parent / "presets" / "first-study.toml"
"""The file of `first_study`, also shown as docs/examples/first-study.toml."""

_TOML_PLACE = re.compile(r" \(at line (?P<line>\d+), column (?P<column>\d+)\)$")


def paper_study() -> Study:
    """Return the paper's protocol, which is what an empty study file says.

    Returns
    -------
    Study
        Plate, actuators, burst, levels and trials of the paper's experiment (sections II-B, III
        and IV).

    Examples
    --------
    >>> study = paper_study()
    >>> study.design.levels_vpp, study.design.trials
    ((60.0, 95.0, 130.0, 165.0, 200.0), 155)
    """
    return _study({}, "the built-in study")


def first_study() -> Study:
    """Return the example study: levels on both sides of the simulated participants' threshold.

    Returns
    -------
    Study
        The study that a dry run uses if it gets no other.

    Examples
    --------
    >>> first_study().design.levels_vpp
    (30.0, 42.0, 59.0, 83.0, 117.0)
    """
    return read_study(_FIRST_STUDY)


def read_study(path: Path | str) -> Study:
    r"""Read a study file.

    Parameters
    ----------
    path : Path or str
        A TOML file in UTF-8, as `tactstrip init` writes it. What it leaves out is as in the paper's
        protocol.

    Returns
    -------
    Study
        What it states, with defaults and the clicks that it names.

    Raises
    ------
    StudyError
        If there is no such file or it is not a study; one line that names file, key, what is
        allowed and what it got.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "study.toml"
    ...     _ = path.write_text("[design]\nlevels_vpp = [40, 50, 60]")
    ...     study = read_study(path)
    >>> study.design.levels_vpp, study.burst == paper_study().burst
    ((40.0, 50.0, 60.0), True)
    """
    return study_from_text(read_text(Path(path)), str(path))


def study_from_text(text: str, file_name: str) -> Study:
    r"""Read a study from TOML text.

    Parameters
    ----------
    text : str
        The contents of a study file. Keys that it omits have the values of the paper's protocol.
    file_name : str
        Name of the study file for messages. The files that the text names are read from the folder
        of this file.

    Returns
    -------
    Study
        The study with all its defaults and the samples of the files that it names.

    Raises
    ------
    StudyError
        If the text is not a study; one line that names the file, the key, the allowed values and
        the actual value.

    Examples
    --------
    Comments, the order of keys and repeated defaults do not change the study:

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
    study = _study(not_recorded(tables), where)
    if study.canonical != text:
        raise StudyError(f"{where} must be complete, in its canonical form; got another one")
    return study


Levels = Sequence[float] | Mapping[str, Sequence[float]]
"""Levels of all conditions, or of each by its name."""


def with_levels(study: Study, levels_vpp: Levels) -> Study:
    """Return the study with other levels, checked and with its own checksum.

    Parameters
    ----------
    study : Study
        The study.
    levels_vpp : sequence of float, or mapping of them
        The new levels, increasing, above 0 and at most the device's ceiling; of several conditions
        those of each by its name, or of all if their bursts are the same.

    Raises
    ------
    StudyError
        If the study cannot be run with them, or they are not those of its conditions.

    Examples
    --------
    >>> with_levels(paper_study(), (40.0, 50.0, 60.0)).design.levels_vpp
    (40.0, 50.0, 60.0)
    """
    tables = json.loads(study.canonical)
    own = _levels_of_each(study, levels_vpp)
    if len(own) == 1:
        (levels_vpp,), own = own.values(), {}
    for condition in tables["condition"]:
        condition["levels_vpp"] = list(own[condition["name"]]) if own else None
    if not own:
        tables["design"]["levels_vpp"] = list(levels_vpp)
    placed = _study(tables, f"study {study.name} with other levels")
    if own:
        return as_stated(placed, study)
    return as_stated(placed, study, design={"levels_vpp": placed.design.levels_vpp})


def _levels_of_each(study: Study, levels_vpp: Levels) -> Mapping[str, Sequence[float]]:
    """Return the levels of each condition; empty where all have the same list.

    UnusableStudyError where they are not those of its conditions, or one list is to serve several
    whose bursts differ, and so do a person's thresholds.
    """
    names = [one.name for one in study.conditions]
    if not isinstance(levels_vpp, Mapping):
        if len({one.samples_base64 or one.drive for one in study.conditions}) > 1:
            raise UnusableStudyError(
                study.name,
                f"levels_vpp must be a table with a list for each condition, {', '.join(names)}, "
                "whose bursts differ; got one list",
            )
        return {}
    for name in levels_vpp:
        if name not in names:
            raise UnusableStudyError(
                study.name,
                f"levels_vpp must be of its conditions, {', '.join(names)}; got {name}",
            )
    if missing := [name for name in names if name not in levels_vpp]:
        raise UnusableStudyError(
            study.name,
            f"levels_vpp must have a list for each condition, {', '.join(names)}; got none for "
            f"{', '.join(missing)}",
        )
    return levels_vpp


def other_levels(study: Study, levels_vpp: Levels) -> str:
    """Say a study's levels in words if others are given; else an empty text."""
    own_vpp = {one.name: one.own(study.design).levels_vpp for one in study.conditions}
    each_vpp = levels_vpp if isinstance(levels_vpp, Mapping) else dict.fromkeys(own_vpp, levels_vpp)
    return "" if each_vpp == own_vpp else f"{levels_words(study.design, study.conditions)} V"


def read_levels(
    path: Path | str, participant: str
) -> tuple[float, ...] | dict[str, tuple[float, ...]]:
    """Read the levels placed for one participant.

    Parameters
    ----------
    path : Path or str
        A TOML file with ``levels_vpp``, a list or a table of lists by the conditions' names, and,
        if it is one person's, ``participant``.
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
    if isinstance(levels_vpp, dict) and levels_vpp:
        return {name: _levels(f"{path}: {name}: ", one) for name, one in levels_vpp.items()}
    return _levels(f"{path}: ", levels_vpp)


def _levels(where: str, levels_vpp: Any) -> tuple[float, ...]:
    if not isinstance(levels_vpp, list):
        raise StudyError(f"{where}levels_vpp must be a list of numbers; got {levels_vpp!r}")
    try:
        return Design(levels_vpp=tuple(levels_vpp)).levels_vpp
    except ValueError as error:
        raise StudyError(f"{where}{error}") from error


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
        slip = meant_line(text.splitlines()[line - 1 : line], what)
        raise StudyError(f"{file_name}:{line}: {slip or what + column}") from error


def _place(message: str, text: str) -> tuple[str, int, str]:
    """Take the place out of a parser's message: what is wrong, the line, the column in words."""
    found = _TOML_PLACE.search(message)
    if found is None:
        return message.removesuffix(" (at end of document)"), text.count("\n") + 1, ""
    return message[: found.start()], int(found["line"]), f" (column {found['column']})"


def is_recorded(path: Path, recorded: str, sha256: str) -> bool:
    """Tell whether a study file says what a recorded study said.

    A window that the program chose is the one that was recorded, and is not chosen again.

    Parameters
    ----------
    path : Path
        The study file.
    recorded : str
        The recorded study's canonical text, perhaps with other levels.
    sha256 : str
        Checksum of the recorded study as its file stated it.

    Raises
    ------
    StudyError
        If there is no such file or it is not a study.
    """
    tables = parsed(read_text(path), str(path))
    before = study_from_canonical(recorded).conditions
    return _study(tables, str(path), path.parent, before).sha256 == sha256


def _study(
    tables: dict[str, Any],
    where: str,
    folder: Path | None = None,
    recorded: tuple[Condition, ...] = (),
) -> Study:
    try:
        return _completed(Study(**without_init(tables)), folder, recorded)
    except ValueError as error:
        raise StudyError(f"{where}: {error}") from error


def _completed(study: Study, folder: Path | None, recorded: tuple[Condition, ...]) -> Study:
    """Read the files that the conditions name, then choose the windows that are to be chosen.

    In this order, and with the study checked in between: what a window must keep is worked out
    from the whole study, which must be fit to be computed with.
    """
    for place, condition in enumerate(study.conditions):
        if folder is not None and condition.levels_vpp is not None:
            raise ValueError(
                f"condition[{place}].levels_vpp is for levels that were placed for a person, in a "
                "file of their own; write design.levels_vpp, which all conditions have"
            )
    read = tuple(_with_samples(condition, study, folder) for condition in study.conditions)
    if read != study.conditions:
        study = study.changed(condition=read)
    chosen = tuple(_with_window(condition, study, recorded) for condition in study.conditions)
    return study if chosen == study.conditions else study.changed(condition=chosen)


def _with_samples(condition: Condition, study: Study, folder: Path | None) -> Condition:
    if condition.file is None or condition.is_found:
        return condition
    if folder is None:
        raise ValueError(f"condition {condition.name}: file was not read; got {condition.file!r}")
    from experiment.study.click import read_click

    rate_hz = study.device.sample_rate_hz
    data = read_click(folder / condition.file, rate_hz).astype("<f8").tobytes()
    return _found(condition, samples_base64=base64.b64encode(data).decode(), sample_rate_hz=rate_hz)


def _with_window(condition: Condition, study: Study, recorded: tuple[Condition, ...]) -> Condition:
    if condition.is_found:
        return condition
    for before in recorded:
        if replace(before, auto_cycles=None, auto_window=None, levels_vpp=None) == condition:
            found = {"auto_cycles": before.auto_cycles, "auto_window": before.auto_window}
            return _found(condition, **found)
    from experiment.study.window import chosen_window

    burst = chosen_window(study, condition).burst
    return _found(condition, auto_cycles=burst.cycles, auto_window=burst.window)


def _found(condition: Condition, **keys: Any) -> Condition:
    return with_stated(replace(condition, **keys), stated_of(condition))
