"""MAP.toml: how a table made elsewhere names and codes what trials.csv names and codes."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.axis import axis_of
from analysis.reading.cells import ANY, DETECTED, UNANSWERED, CellReader, allowed, parse, units_of
from analysis.reading.foreign.files import STANDS_FOR
from analysis.reading.foreign.form import (
    check_file,
    refuse_doubled,
    row_filter,
    text_format,
    toml_document,
)
from analysis.reading.foreign.table import COUNTED_COLUMNS, count_columns
from analysis.reading.sources import read_regular
from analysis.reading.text import ResultFileError, shown
from experiment.rows import COLUMNS, NOT_AVAILABLE, Column, format_value

if TYPE_CHECKING:
    from collections.abc import Iterable

    from analysis.reading.foreign.form import RowFilter
    from analysis.reading.text import TextFormat


LEVEL = "level_vpp"
COUNTED_REQUIRED = ("participant", "level_vpp")
REQUIRED = ("participant", "side", "level_vpp", "response")
_BY_COLUMN = ("columns", "values", "constant", "units", "scale")
SECTIONS = ("file", "rows", *_BY_COLUMN, "axis", "table")
KEYS = ("task", "alternatives")
"""They stand before any section."""
YES_NO, FORCED = "yes/no", "forced choice"
_ALTERNATIVES = (2, 100)
_FORCED_ONLY = f'alternatives: allowed beside task = "{FORCED}" only'
_TASKLESS = (
    'counts, and answers of 0 and 1, need task = "yes/no" (people who felt nothing could say so) '
    'or task = "forced choice" (they had to guess) at the top of the map'
)
# A table made elsewhere may lack these values; a trials.csv has them in every row.
_OPTIONAL_ELSEWHERE = {"foreperiod_s", "study_sha256"}
_OURS: Mapping[str, Column] = MappingProxyType(
    {
        c.name: replace(c, optional=c.optional or c.name in _OPTIONAL_ELSEWHERE)
        for c in (*COLUMNS, DETECTED, UNANSWERED)
    }
)
_MAX_MAP_BYTES = 1_000_000
_ANSWERED = ("response", "detected")
_TWO_ANSWERS = "response and detected both tell the answer; [columns] must name one as the source"


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnMap:
    """Where the columns of trials.csv come from in a table made elsewhere: `read_trials` takes it.

    docs/howto/foreign-table.md goes through one, docs/statistics.md, section 5, has all words.

    Parameters
    ----------
    columns : mapping of str to str
        Our column to theirs. A column of theirs may serve several of ours. A column that has our
        name already needs no entry, and empty text leaves it out; theirs that nobody names are
        ignored.
    values : mapping of str to mapping of str to str
        For a column of ours, their word to our word; other words stay as they are.
    constant : mapping of str to str
        Our column to the one value that it has in every row, in our unit; a level only where there
        is a stimulus.
    units : mapping of str to str
        Our column to their unit: ``s``, ``ms``, ``us`` of times, and of levels ``V`` and ``mV``,
        which are peak-to-peak, or ``V-peak`` and ``mV-peak``, amplitudes, so that they count twice.
    scale : mapping of str to float
        Our column to the factor from their unit to ours, where they differ.
    file : mapping of str to str
        ``delimiter``, ``decimal``, ``encoding``.
    rows : mapping
        ``keep`` and ``skip``: their column to a word or to words; which rows are read.
    axis : mapping of str to str
        ``x_scale``, ``log10``, ``dB`` or ``linear``, and ``unit``.
    table : mapping
        For counts instead of trials: ``detected``, ``presented``, ``group``, their columns.
    task : str
        ``yes/no`` or ``forced choice``; needed for counts, and where the answer is ``detected``.
    alternatives : int
        Of a forced choice: who feels nothing is right once in so many times.
    name, sha256 : str
        File name and checksum of the map, where it was read from a file.

    Raises
    ------
    ValueError
        For a column that trials.csv does not have, a word it does not allow, an unknown unit, a
        constant with a source or a unit, ``detected`` beside ``response``, or counts without task.

    Examples
    --------
    >>> ColumnMap(columns={"response": "key"}, values={"response": {"l": "left"}}).task
    ''
    >>> ColumnMap(values={"response": {"l": "links"}})
    Traceback (most recent call last):
    ValueError: [values.response] 'l': allowed left, right, both, none, ..., got 'links'
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    constant: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    scale: Mapping[str, float] = field(default_factory=dict)
    file: Mapping[str, str] = field(default_factory=dict)
    rows: Mapping[str, Any] = field(default_factory=dict)
    axis: Mapping[str, str] = field(default_factory=dict)
    table: Mapping[str, Any] = field(default_factory=dict)
    task: str = ""
    alternatives: int = 2
    name: str = ""
    sha256: str = ""

    def __post_init__(self) -> None:
        axis_of(self.axis)
        check_file(self.file)
        row_filter(self.rows)
        _check_entries(self)
        _check_scale(self)
        _check_task(self)
        _check_counts(self)
        for ours, word in self.constant.items():
            _check_word(f"[constant] {ours}", ours, word, self._least(ours))
        for ours, words in self.values.items():
            for theirs, word in words.items():
                _check_word(f"[values.{ours}] {shown(theirs)}", ours, word, self._least(ours))
        for ours, unit in self.units.items():
            if unit not in units_of(ours):
                choices = ", ".join(units_of(ours)) or "no unit but its own"
                raise ValueError(f"[units] {ours}: allowed {choices}, got {shown(unit)}")

    def reader(self, ours: str) -> CellReader:
        """Say how cells of this table become a column of ours; an empty cell is ``n/a``.

        >>> ColumnMap(units={"rt_s": "ms"}).reader("rt_s").read(pd.Series(["612"]))[0]
        np.float64(0.612)
        """
        theirs = self.columns.get(ours) or ours
        unit = units_of(ours)[self.units[ours]] if ours in self.units else (1.0, 1.0)
        return CellReader(
            column=_OURS[ours],
            label=ours if ours == theirs else f"{theirs} ({ours})",
            words={"": NOT_AVAILABLE} | dict(self.values.get(ours, {})),
            scale=(self.scale[ours], 1.0) if ours in self.scale else unit,
            least=self._least(ours),
            decimal=self.file.get("decimal", "."),
        )

    def _least(self, ours: str) -> float | None:
        """Return the least value of a column where it is another one than in trials.csv."""
        if ours == LEVEL and axis_of(self.axis).signed:
            return ANY
        return 0 if ours == "trial" else None  # some count from 0

    def form(self, suffix: str) -> TextFormat:
        """Say how a file with this ending is written.

        >>> ColumnMap(file={"delimiter": ";"}).form(".csv").delimiter
        ';'
        """
        return text_format(self.file, suffix)

    @property
    def filter(self) -> RowFilter:
        """Which rows are read."""
        return row_filter(self.rows)

    def ours(self, table: pd.DataFrame, file: str) -> pd.DataFrame:
        """Give a table of text our column names; leave the columns that nobody names out.

        Parameters
        ----------
        table : pandas.DataFrame
            Text cells under their names.
        file : str
            The table's name for messages.

        Returns
        -------
        pandas.DataFrame
            Text cells under our names, for those columns that the table or the map has.

        Raises
        ------
        ResultFileError
            Where a column named by the map is missing, a constant contradicts a column of the
            table, a required column has no source, or ``response`` and ``detected`` have one.
        """
        sources = self.sources(list(table.columns), file)
        cells = {ours: table[theirs] for ours, theirs in sources}
        return pd.DataFrame(cells | dict(self.constant), index=table.index, dtype=object)

    def sources(self, header: list[str], file: str) -> list[tuple[str, str]]:
        """Return our columns that a table has, each with the table's; raises as `ours` does."""
        named = _named(self)
        for ours, theirs in named.items():
            if theirs not in header:
                has = ", ".join(header)
                message = f"no column {shown(theirs)}, named by the map for {ours}; it has {has}"
                raise ResultFileError(file, 1, message)
        known = self._known()
        own = {name: name for name in known if name in header and name not in self.columns}
        refuse_doubled(header, [name for name in known if name not in self.columns], file)
        if named.get("detected") == "correct":
            own.pop("correct", None)  # its 0 and 1 are what was answered
        told = {*own, *self.columns, *self.constant}
        named |= {o: t for o, t in STANDS_FOR.items() if t in header and o in {*known} - told}
        for ours in self.constant:
            if ours in own:
                message = (
                    f"column {shown(ours)} stands in the table, but the map has a constant; "
                    f'[columns] {ours} = "" leaves the column out'
                )
                raise ResultFileError(file, 1, message)
        sources = own | named
        if {*_ANSWERED} <= {*sources, *self.constant}:
            if not named.keys() & {*_ANSWERED}:
                raise ResultFileError(file, 1, _TWO_ANSWERS)
            sources = {o: t for o, t in sources.items() if o not in _ANSWERED or o in named}
        if "detected" in {*sources, *self.constant} and not (self.task or self.table):
            raise ResultFileError(file, 1, _TASKLESS)
        required = COUNTED_REQUIRED if self.table else REQUIRED
        _check_required({*sources, *self.constant}, required, file)
        return list(sources.items())

    def _known(self) -> list[str]:
        """List our columns that need no entry where the table has them under our name."""
        counts = count_columns(self.table)
        if counts is None:
            return [name for name in _OURS if name != UNANSWERED.name]
        return [name for name in COUNTED_COLUMNS if name not in self.conditions()]

    def conditions(self) -> list[str]:
        """List their columns that together are the condition, for a table of counts.

        >>> counts = {"detected": "k", "presented": "n", "group": ["speed"]}
        >>> ColumnMap(table=counts, task="yes/no").conditions()
        ['speed']
        """
        counts = count_columns(self.table)
        return counts.conditions(_named(self).get("participant", "participant")) if counts else []


def load_column_map(path: str | Path) -> ColumnMap:
    r"""Read a MAP.toml.

    Parameters
    ----------
    path : str or Path
        The file; keys ``task`` and ``alternatives``, then sections ``[file]``, ``[rows.keep]``,
        ``[rows.skip]``, ``[columns]``, ``[values.COLUMN]``, ``[constant]``, ``[units]``,
        ``[scale]``, ``[axis]``, ``[table]``.

    Returns
    -------
    ColumnMap

    Raises
    ------
    ValueError
        Naming the file, for anything but a regular file, text that is not TOML, an unknown section,
        a value of another type than text, and for everything that `ColumnMap` refuses.
    OSError
        Where the file cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "MAP.toml"
    ...     _ = path.write_text('[values.kind]\nnull = "blank"')
    ...     load_column_map(path).values["kind"]["null"]
    'blank'
    """
    path = Path(path)
    try:
        raw = read_regular(path, _MAX_MAP_BYTES)
        sections = _sections(toml_document(raw.decode()))
        return ColumnMap(**sections, name=path.name, sha256=hashlib.sha256(raw).hexdigest())
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path}: {error}") from None


def _sections(document: dict[str, Any]) -> dict[str, Any]:
    for name, section in document.items():
        if name in KEYS:
            continue
        if name not in SECTIONS or type(section) is not dict:
            known = ", ".join(f"[{section}]" for section in SECTIONS)
            raise ValueError(f"[{name}] is not a section of a map, allowed {known}")
    if "alternatives" in document and document.get("task") != FORCED:
        raise ValueError(_FORCED_ONLY)  # also of 2, which is the default
    plain = document.get("constant", {})
    numbers = {o: format_value(v) for o, v in plain.items() if type(v) in {bool, int, float}}
    return document | ({"constant": plain | numbers} if numbers else {})


def _check_type(section: str, ours: str, value: object) -> None:
    match section, value:
        case "values", Mapping() if all(isinstance(word, str) for word in value.values()):
            return
        case "columns" | "constant" | "units", str():
            return
        case "scale", float() | int() if not isinstance(value, bool) and 0 < value < math.inf:
            return
    wanted = {
        "values": 'a table of "theirs" = "ours", both in quotation marks',
        "scale": "a number above 0",
    }.get(section, "text in quotation marks")
    raise ValueError(f"[{section}] {ours}: must be {wanted}, got {value!r}")


def _check_scale(columns: ColumnMap) -> None:
    for ours in columns.scale:
        if _OURS[ours].type != "float":
            raise ValueError(f"[scale] {ours}: not a column of numbers with a unit")
        if ours in columns.units:
            raise ValueError(f"[scale] {ours}: [units] already says what its numbers are")


_RENAMED: Final = {"anticipated": "premature"}


def _check_entries(columns: ColumnMap) -> None:
    for section in _BY_COLUMN:
        for ours, value in getattr(columns, section).items():
            if ours in _RENAMED:
                raise ValueError(f"[{section}] {ours}: the column is named {_RENAMED[ours]}")
            if ours not in _OURS:
                raise ValueError(f"[{section}] {ours}: not a column of trials.csv")
            _check_type(section, ours, value)
    for ours in columns.constant:
        if ours in _named(columns):
            raise ValueError(f"[constant] {ours}: [columns] already says where it comes from")
        if ours in {**columns.units, **columns.scale}:
            raise ValueError(f"[units] {ours}: a constant is in our unit, so it has no other")
    if {*_ANSWERED} <= {*_named(columns), *columns.constant}:
        raise ValueError("[columns] detected: allowed only without response, got both")


def _check_task(columns: ColumnMap) -> None:
    task, number = columns.task, columns.alternatives
    if task not in ("", YES_NO, FORCED):
        raise ValueError(f'task: allowed "{YES_NO}", "{FORCED}", got {task!r}')
    least, most = _ALTERNATIVES
    if type(number) is not int or not least <= number <= most:
        raise ValueError(
            f"alternatives: must be a whole number from {least} to {most}, got {number!r}"
        )
    if number > least and task != FORCED:
        raise ValueError(_FORCED_ONLY)


def _check_counts(columns: ColumnMap) -> None:
    """Refuse what a table of counts cannot have."""
    if count_columns(columns.table) is None:
        return
    for section in _BY_COLUMN:
        for ours in getattr(columns, section):
            if ours not in COUNTED_COLUMNS:
                allowed_here = ", ".join(COUNTED_COLUMNS)
                raise ValueError(f"[{section}] {ours}: with [table] allowed {allowed_here}")
    if columns.conditions() and {"condition"} & {*_named(columns), *columns.constant}:
        raise ValueError("[table] group: it is the condition already, so condition has no other")
    if not columns.task:
        raise ValueError(_TASKLESS)


def _named(columns: ColumnMap) -> dict[str, str]:
    return {ours: theirs for ours, theirs in columns.columns.items() if theirs}


def _check_word(place: str, ours: str, word: str, least: float | None) -> None:
    column = _OURS[ours]
    try:
        parse(column, word, least=least)
    except ValueError:
        words = allowed(column, least=least)
        raise ValueError(f"{place}: allowed {words}, got {shown(word)}") from None


def _check_required(have: set[str], required: Iterable[str], file: str) -> None:
    missing = [name for name in required if name not in have]
    if "response" in missing and "detected" in have:
        missing.remove("response")
    if missing:
        message = f"no column {', '.join(missing)}; the map must say where it comes from"
        raise ResultFileError(file, 1, message)
