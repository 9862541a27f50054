"""Reading study files, presets and files of levels.

Reading a study file also determines what it leaves open: the samples of files and the windows to
choose. A plan holds the result, so that every session plays the same.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from device.printing import escaped
from experiment import bounded
from experiment.study.base import Fault, StudyError
from experiment.study.design import Design
from experiment.study.study import Study

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.stimulus import Condition


PRESETS: Final = Path(__file__).parent / "presets"
"""The study files of the presets."""
_MAX_REASON: Final = 200
"""Longest part of tomllib's message that is repeated."""


def paper_study() -> Study:
    """Return the paper's protocol.

    Returns
    -------
    Study
        Plate, actuators, burst, levels and trials of the paper's experiment (sections II-B, III
        and IV).

    Examples
    --------
    >>> study = paper_study()
    >>> study.design.levels_vpp, study.design.trials_per_side
    ((60.0, 95.0, 130.0, 165.0, 200.0), 75)
    """
    return read_study(PRESETS / "paper.toml")


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
    return read_study(PRESETS / "first-study.toml")


def read_study(path: Path | str) -> Study:
    r"""Read a study file.

    Parameters
    ----------
    path : Path or str
        A TOML file in UTF-8, as `tactstrip init` writes it, of at most 1 MB.

    Returns
    -------
    Study
        The study with its defaults and the samples of the files that it names.

    Raises
    ------
    StudyError
        If there is no such file, or it is not a study. The error lists every fault with its key,
        the rule and the value.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "study.toml"
    ...     _ = path.write_text((PRESETS / "paper.toml").read_text())
    ...     study = read_study(path)
    >>> study == paper_study()
    True
    """
    return study_from_text(read_text(Path(path)), str(path))


def study_from_text(text: str, file_name: str) -> Study:
    r"""Read a study from TOML text.

    Parameters
    ----------
    text : str
        The contents of a study file.
    file_name : str
        Name of the study file for messages. The files that the text names are read from the folder
        of this file.

    Returns
    -------
    Study
        The study with its defaults and the samples of the files that it names.

    Raises
    ------
    StudyError
        If the text is not a study. The error lists every fault with its key, the rule and the
        value.

    Examples
    --------
    >>> study_from_text("[strip]\nwidth_mm = 25,4", "study.toml")
    Traceback (most recent call last):
    experiment.study.base.StudyError: study.toml: must be valid TOML: Expected newline or end of
    document after a statement (at line 2, column 14)
    """
    # A window is chosen with the physics of the whole study, so that this is validated before.
    study = Study.from_tables(parse_toml(text, file_name), file_name)
    for index, condition in enumerate(study.conditions):
        if condition.levels_vpp is not None:
            rule = "is for levels in a file of their own; write design.levels_vpp"
            raise StudyError(file_name, Fault(f"condition[{index}].levels_vpp", rule))
    with naming(file_name):
        conditions = tuple(
            _with_samples(each, study, Path(file_name).parent) for each in study.conditions
        )
        study = study.changed(condition=conditions)
        conditions = tuple(_with_window(each, study) for each in study.conditions)
        return study.changed(condition=conditions)


def study_from_canonical(text: str) -> Study:
    """Return the study of a plan.

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
    source = "the recorded study"
    study = Study.from_json(text, source)
    if study.canonical != text:
        raise StudyError(source, Fault("", "must be complete, in its canonical form"))
    return study


Levels = Sequence[float] | Mapping[str, Sequence[float]]
"""Levels of all conditions, or of each by its name."""


def with_levels(study: Study, levels_vpp: Levels) -> Study:
    """Return the study with other levels, validated and with its own checksum.

    Parameters
    ----------
    study : Study
        The study.
    levels_vpp : sequence of float, or mapping of them
        The new levels; of several conditions those of each by its name, or of all if their bursts
        are the same.

    Raises
    ------
    StudyError
        If the study cannot be run with them, or they are not those of its conditions.

    Examples
    --------
    >>> with_levels(paper_study(), (40.0, 50.0, 60.0)).design.levels_vpp
    (40.0, 50.0, 60.0)
    """
    names = [condition.name for condition in study.conditions]
    is_table = isinstance(levels_vpp, Mapping)
    levels = levels_vpp if isinstance(levels_vpp, Mapping) else dict.fromkeys(names, levels_vpp)
    drives = {condition.samples_base64 or condition.drive for condition in study.conditions}
    if sorted(levels) != sorted(names) or (len(drives) > 1 and not is_table):
        rule = f"must be a table with a list for each condition: {', '.join(names)}"
        raise study.refused(Fault("levels_vpp", rule, list(levels_vpp)))
    source, conditions = f"study {study.name}", study.conditions
    valid = {name: _levels(source, "levels_vpp", list(levels[name])) for name in names}
    if is_table and len(names) > 1:
        chosen = (each.completed(levels_vpp=valid[each.name]) for each in conditions)
        return study.changed(condition=tuple(chosen))
    design = study.design.changed(levels_vpp=valid[names[0]])
    shared = (each.completed(levels_vpp=None) for each in conditions)
    return study.changed(condition=tuple(shared), design=design)


def read_levels(
    path: Path | str, participant: str
) -> tuple[float, ...] | dict[str, tuple[float, ...]]:
    """Read the levels chosen for a participant.

    Parameters
    ----------
    path : Path or str
        A TOML file with ``levels_vpp``, a list or a table of lists by the conditions' names, and
        optionally ``participant``.
    participant : str
        The participant who is about to be tested.

    Raises
    ------
    StudyError
        If there is no such file, it has no valid levels, or they are another participant's.
    """
    table = parse_toml(read_text(Path(path)), str(path))
    if unknown := sorted(set(table) - {"levels_vpp", "participant"}):
        raise StudyError(path, Fault(unknown[0], "must be levels_vpp or participant"))
    if table.get("participant", participant) != participant:
        rule = f'must be "{participant}"'
        raise StudyError(path, Fault("participant", rule, table["participant"]))
    levels_vpp = table.get("levels_vpp")
    if isinstance(levels_vpp, dict) and levels_vpp:
        return {
            name: _levels(path, f"levels_vpp.{name}", levels) for name, levels in levels_vpp.items()
        }
    return _levels(path, "levels_vpp", levels_vpp)


def _levels(path: Path | str, key: str, levels_vpp: object) -> tuple[float, ...]:
    text = json.dumps({"levels_vpp": levels_vpp}, default=str)
    try:
        return Design.from_json(text, path).levels_vpp
    except StudyError as error:
        faults = (Fault(f.key.replace("levels_vpp", key, 1), f.rule, f.got) for f in error.faults)
        raise StudyError(path, *faults) from error


def read_text(path: Path) -> str:
    """Return the text of a file in UTF-8, or refuse it."""
    try:
        data = bounded.read_bounded(path)
    except OSError as error:
        raise StudyError(path, Fault("", error.strerror or str(error))) from error
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = f"byte {data[error.start]:#x}"
        raise StudyError(path, Fault(f"line {line}", "must be UTF-8", byte)) from error


def parse_toml(text: str, file_name: str) -> dict[str, Any]:
    """Return the tables of a TOML text, or refuse it; tomllib says in which line."""
    try:
        return bounded.parse_toml(text)
    except RecursionError as error:
        raise StudyError(file_name, Fault("", "is nested too deeply")) from error
    except ValueError as error:
        reason = escaped(str(error)[-_MAX_REASON:])  # its end has the line; a key may be long
        raise StudyError(file_name, Fault("", f"must be valid TOML: {reason}")) from error


def is_recorded(path: Path, sha256: str) -> bool:
    """Return whether a study file says what a recorded study said.

    Parameters
    ----------
    path : Path
        The study file.
    sha256 : str
        Checksum of the recorded study as its file stated it.

    Raises
    ------
    StudyError
        If there is no such file or it is not a study.
    """
    return read_study(path).sha256 == sha256


@contextmanager
def naming(path: Path | str | None) -> Iterator[None]:
    """Name the file of a study in its errors, if it is from one."""
    try:
        yield
    except StudyError as error:
        if path is None:
            raise
        raise StudyError(path, *error.faults) from error


def _with_samples(condition: Condition, study: Study, folder: Path) -> Condition:
    if condition.file is None or condition.is_complete:
        return condition
    from experiment.study.click import read_click

    rate_hz = study.device.sample_rate_hz
    try:
        data = read_click(folder / condition.file, rate_hz).astype("<f8").tobytes()
    except ValueError as error:
        key = study.stimulus_key(condition, "file")
        raise study.refused(Fault(key, str(error))) from error
    samples = base64.b64encode(data).decode()
    return condition.completed(samples_base64=samples, sample_rate_hz=rate_hz)


def _with_window(condition: Condition, study: Study) -> Condition:
    if condition.is_complete:
        return condition
    from experiment.study.physics import chosen_window

    burst = chosen_window(study, condition).burst
    return condition.completed(auto_cycles=burst.cycles, auto_window=burst.window)
