"""MAP.toml: how an external table names and codes what trials.csv names and codes."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StrictFloat,
    StrictInt,
    StrictStr,
    ValidationError,
    model_validator,
)

from analysis.axis import Axis, axis_of
from analysis.reading.cells import (
    BLANK_LEVEL,
    DETECTED,
    NOTHING,
    UNANSWERED,
    CellFault,
    CellReader,
    units_of,
)
from analysis.reading.text import TextFormat, one_line, shown
from experiment.bounded import FileRefusedError, parse_toml, read_bounded
from experiment.names import NOT_AVAILABLE
from experiment.record.rows import COLUMNS, Column, format_value

if TYPE_CHECKING:
    from collections.abc import Iterator


YES_NO, FORCED = "yes/no", "forced choice"
REQUIRED: Final = ("participant", "side", "level_vpp", "response")
COUNTED_REQUIRED: Final = ("participant", "level_vpp")
"""Of our columns, those that each table of trials or of counts needs."""
SECTIONS: Final = (
    *("file", "rows", "columns", "values", "constant", "units", "scale", "axis", "table"),
)
KEYS: Final = ("task", "alternatives")
"""They stand before any section."""
COUNTED_COLUMNS: Final = ("participant", "session", "condition", "kind", "side", "level_vpp")
"""What a row of counts may say besides its counts."""
ANSWERS: Final = ("response", "detected")
TASK_MISSING: Final = (
    'counts, and answers of 0 and 1, need task = "yes/no" (people who felt nothing could say so) '
    'or task = "forced choice" (they had to guess) at the top of the map'
)
COUNT: Final = Column(name="", type="int", optional=False, choices=(), description="")
FILL_IN: Final = "FILL IN"
# An external table may lack these values; a trials.csv has them in every row.
_OPTIONAL_ELSEWHERE: Final = {"foreperiod_s", "study_sha256"}
OURS: Final[dict[str, Column]] = {
    c.name: replace(c, optional=c.optional or c.name in _OPTIONAL_ELSEWHERE)
    for c in (*COLUMNS, DETECTED, UNANSWERED)
}
_GAP: Final = re.compile(rf"""\s*("[^"]*"|'[^']*'|[\w-]+)\s*=\s*(?:""|'')\s*#\s*{FILL_IN}""")
_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")


def _check_encoding(name: str) -> str:
    try:
        "".encode(name)
    except (LookupError, ValueError):
        raise ValueError('must name an encoding, such as "cp1252" or "utf-16"') from None
    return name


def _as_text(value: object) -> object:
    """Write a constant of TOML as it would stand in a cell."""
    return format_value(value) if type(value) in {bool, int, float} else value


Texts = Annotated[
    tuple[StrictStr, ...],
    BeforeValidator(lambda texts: (texts,) if isinstance(texts, str) else texts),
]


class Section(BaseModel):
    """A section of a map: no key but its own."""

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)


class File(Section):
    """How the text of a table is written; what is empty text is seen in the file."""

    delimiter: Literal["", ",", ";", "\t", "|", " "] = ""
    decimal: Literal[".", ","] = "."
    encoding: Annotated[StrictStr, AfterValidator(_check_encoding)] | None = None

    @model_validator(mode="after")
    def _differ(self) -> Self:
        if self.delimiter == self.decimal:
            raise ValueError("delimiter must be another sign than decimal")
        return self


class Rows(Section):
    """Which rows are read: by the words in columns of theirs."""

    keep: dict[str, Texts] = {}
    skip: dict[str, Texts] = {}

    def filters(self) -> dict[str, tuple[str, tuple[str, ...], bool]]:
        """Return by key a column of theirs, its words, and whether these are kept."""
        kept = {f"[rows.keep] {name}": (name, words, True) for name, words in self.keep.items()}
        skipped = {f"[rows.skip] {name}": (name, words, False) for name, words in self.skip.items()}
        return kept | skipped


class Table(Section):
    """Which columns of theirs are counts, and which distinguish functions."""

    detected: StrictStr
    presented: StrictStr = ""
    missed: StrictStr = ""
    group: tuple[StrictStr, ...] = ()

    def counts(self) -> dict[str, str]:
        """Return the columns of theirs by what they count."""
        counts = {name: getattr(self, name) for name in ("detected", "presented", "missed")}
        return {name: theirs for name, theirs in counts.items() if theirs}

    @model_validator(mode="after")
    def _name_each_column_once(self) -> Self:
        if bool(self.presented) == bool(self.missed):
            raise ValueError("needs detected, and either presented or missed")
        names = [*self.counts().values(), *self.group]
        if len({*names}) < len(names) or not all(names):
            raise ValueError(f"each column may be named once, got {', '.join(names)}")
        return self


class ColumnMap(Section):
    """Where the columns of trials.csv come from in an external table: `read_trials` takes it.

    docs/howto/external-table.md goes through one, docs/statistics.md, section 5, has all words.

    Parameters
    ----------
    columns : mapping of str to str
        Our column to theirs. A column of theirs may serve several of ours. A column that has our
        name already needs no entry, and empty text leaves it out. Other columns are ignored.
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
    file : File
        ``delimiter``, ``decimal``, ``encoding``.
    rows : Rows
        ``keep`` and ``skip``: their column to a word or to words; which rows are read.
    axis : Axis
        ``x_scale``, ``log10``, ``dB`` or ``linear``, and ``unit``.
    table : Table or None
        For counts instead of trials: ``detected``, ``presented`` or ``missed``, ``group``.
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
        constant with a source or a unit, ``detected`` next to ``response``, or counts without task.

    Examples
    --------
    >>> ColumnMap(columns={"response": "key"}, values={"response": {"r": "right"}}).task
    ''
    >>> ColumnMap(values={"response": {"r": "rechts"}})
    Traceback (most recent call last):
    pydantic_core._pydantic_core.ValidationError: 1 validation error for ColumnMap
      Value error, [values.response] 'r': allowed left, right, both, none, ..., got 'rechts' ...
    """

    task: Literal["", "yes/no", "forced choice"] = ""
    alternatives: Annotated[StrictInt, Field(ge=2, le=100)] = 2
    file: File = File()
    rows: Rows = Rows()
    columns: dict[str, StrictStr] = {}
    values: dict[str, dict[str, StrictStr]] = {}
    constant: dict[str, Annotated[StrictStr, BeforeValidator(_as_text)]] = {}
    units: dict[str, StrictStr] = {}
    scale: dict[str, Annotated[StrictFloat | StrictInt, Field(gt=0, allow_inf_nan=False)]] = {}
    axis: Annotated[
        Axis, BeforeValidator(lambda axis: axis_of(axis) if isinstance(axis, Mapping) else axis)
    ] = Field(default_factory=lambda: axis_of({}))
    table: Table | None = None
    name: str = ""
    sha256: str = ""

    if TYPE_CHECKING:  # sections may be given as mappings, too

        def __init__(self, **sections: Any) -> None: ...

    @model_validator(mode="after")
    def _refuse_contradictions(self) -> Self:
        faults = [*self._unknown_columns()] or [
            *self._contradictions(),
            *self._wrong_units(),
            *self._wrong_words(),
        ]
        if faults:
            raise ValueError("; ".join(faults))
        return self

    def _unknown_columns(self) -> Iterator[str]:
        for section in ("columns", "values", "constant", "units", "scale"):
            for ours in getattr(self, section):
                if ours not in OURS:
                    yield f"[{section}] {one_line(ours)}: not a column of trials.csv"
                elif self.table and ours not in COUNTED_COLUMNS:
                    allowed = ", ".join(COUNTED_COLUMNS)
                    yield f"[{section}] {ours}: with [table] allowed {allowed}"

    def _contradictions(self) -> Iterator[str]:
        named, constant = self.named(), self.constant
        for ours in constant:
            if ours in named:
                yield f"[constant] {ours}: [columns] already says where it comes from"
            if ours in {**self.units, **self.scale}:
                yield f"[units] {ours}: a constant is in our unit, so it has no other"
        if {*ANSWERS} <= {*named, *constant}:
            yield "[columns] detected: allowed only without response, got both"
        if "alternatives" in self.model_fields_set and self.task != FORCED:
            yield f'alternatives: allowed with task = "{FORCED}" only'
        if self.conditions() and "condition" in {*named, *constant}:
            yield "[table] group: it is the condition already, so condition has no other"
        if not self.task and (self.table or "detected" in {*named, *constant}):
            yield TASK_MISSING

    def _wrong_units(self) -> Iterator[str]:
        for ours in self.scale:
            if OURS[ours].type != "float":
                yield f"[scale] {ours}: not a column of numbers with a unit"
            if ours in self.units:
                yield f"[scale] {ours}: [units] already says what its numbers are"
        for ours, unit in self.units.items():
            if unit not in units_of(ours):
                choices = ", ".join(units_of(ours)) or "no unit but its own"
                yield f"[units] {ours}: allowed {choices}, got {shown(unit)}"

    def _wrong_words(self) -> Iterator[str]:
        entries = [(f"[constant] {ours}", ours, word) for ours, word in self.constant.items()]
        entries += [
            (f"[values.{ours}] {shown(theirs)}", ours, word)
            for ours, meanings in self.values.items()
            for theirs, word in meanings.items()
        ]
        for entry, ours, word in entries:
            reader = CellReader(column=OURS[ours], label=ours, minimum=self.minimum(ours))
            if isinstance(reader.read([word]), CellFault):
                yield f"{entry}: allowed {reader.allowed}, got {shown(word)}"
        for theirs, word in self.values.get("level_vpp", {}).items():
            if self.axis.signed and theirs.lower() in NOTHING and word == "0":
                scale = f'0 is a level where x_scale = "{self.axis.x_scale}"'
                yield f'[values.level_vpp] {scale}; "{theirs}" = "-inf" makes blanks of these rows'

    def named(self) -> dict[str, str]:
        """Return our columns that the map takes from a column of theirs.

        Returns
        -------
        dict of str to str
            Our column to theirs.
        """
        return {ours: theirs for ours, theirs in self.columns.items() if theirs}

    def conditions(self) -> list[str]:
        """Return the columns of theirs that together are the condition of a table of counts.

        Returns
        -------
        list of str
            Empty for a table of trials.
        """
        participant = self.named().get("participant", "participant")
        return [name for name in self.table.group if name != participant] if self.table else []

    def counts(self) -> dict[str, str]:
        """Return the columns of theirs that are counts, by what they count.

        Returns
        -------
        dict of str to str
            Empty for a table of trials.
        """
        return self.table.counts() if self.table else {}

    def minimum(self, ours: str) -> float | None:
        """Return the smallest value of a column where it is another one than in trials.csv.

        Parameters
        ----------
        ours : str
            A column of trials.csv.

        Returns
        -------
        float or None
            In our unit; None where the limit of trials.csv holds.
        """
        if ours == "level_vpp" and self.axis.signed:
            return BLANK_LEVEL
        return 0 if ours == "trial" else None  # some count from 0

    def label(self, ours: str) -> str:
        """Return the name of a column in messages.

        Parameters
        ----------
        ours : str
            A column of trials.csv.

        Returns
        -------
        str
            Their name, with ours in brackets where it differs.
        """
        if ours in self.counts():
            return self.counts()[ours]
        theirs = self.columns.get(ours) or ours
        return ours if ours == theirs else f"{theirs} ({ours})"

    def reader(self, ours: str) -> CellReader:
        """Return how cells of the table become a column of ours; an empty cell is ``n/a``.

        Parameters
        ----------
        ours : str
            A column of trials.csv.

        Returns
        -------
        CellReader

        Examples
        --------
        >>> ColumnMap(units={"rt_s": "ms"}).reader("rt_s").read(["612"])[0]
        np.float64(0.612)
        """
        scale = units_of(ours)[self.units[ours]] if ours in self.units else 1.0
        return CellReader(
            column=replace(COUNT, name=ours) if ours in self.counts() else OURS[ours],
            label=self.label(ours),
            translations={"": NOT_AVAILABLE} | self.values.get(ours, {}),
            scale=self.scale.get(ours, scale),
            minimum=self.minimum(ours),
            decimal=self.file.decimal,
        )

    def text_format(self, suffix: str) -> TextFormat:
        r"""Return how a file with this ending is written; one that ends in .tsv has tabs.

        Parameters
        ----------
        suffix : str
            The ending, with its point.

        Returns
        -------
        TextFormat

        Examples
        --------
        >>> ColumnMap().text_format(".tsv").delimiter
        '\t'
        """
        delimiter = self.file.delimiter or ("\t" if suffix.lower() == ".tsv" else "")
        return TextFormat(delimiter=delimiter, encoding=self.file.encoding or "")


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
        Naming the file, for anything but a regular file, text that is not TOML, lines that are
        still to be filled in, an unknown section, a value of another type than text, and for
        everything that `ColumnMap` refuses.
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
        raw = read_bounded(path)
        text = raw.decode("utf-8-sig")
        document = parse_toml(text)
        for name, section in document.items():
            if name not in KEYS and (name not in SECTIONS or type(section) is not dict):
                allowed = ", ".join(f"[{key}]" for key in SECTIONS)
                message = f"[{one_line(name)}] is not a section of a map, allowed {allowed}"
                raise ValueError(message)
        if gaps := find_gaps(text):
            raise ValueError(f"fill in {', '.join(gaps)}")
        return ColumnMap(**document, name=path.name, sha256=hashlib.sha256(raw).hexdigest())
    except ValidationError as error:
        fault = "; ".join(map(_format_fault, error.errors()))
    except tomllib.TOMLDecodeError as error:
        fault = f"{error}; text needs quotation marks, a [section] on its own line"
    except FileRefusedError as error:
        fault = str(error.strerror)
    except (ValueError, RecursionError) as error:
        fault = str(error)
    raise ValueError(f"{path}: {fault}")


def find_gaps(text: str) -> list[str]:
    r"""Return the keys of a map that are still to be filled in, each with its line.

    These are empty texts with the comment `FILL_IN`.

    >>> find_gaps('task = ""  # FILL IN: which\n[columns]\nsession = ""\nside = ""  # FILL IN')
    ['task (line 1)', 'side (line 4)']
    """
    lines = enumerate(text.split("\n"), 1)
    gaps = [(number, gap[1]) for number, line in lines if (gap := _GAP.match(line))]
    return [f"{one_line(key)} (line {number})" for number, key in gaps]


def _format_fault(error: Any) -> str:
    """Return a fault that pydantic has found with the section and key of the map."""
    keys = [str(key) for key in error["loc"] if key != "str" and not isinstance(key, int)]
    message = error["msg"].removeprefix("Value error, ")
    if not keys or message.startswith("["):
        return one_line(message)
    if keys[0] in SECTIONS:
        number = 2 if keys[0] == "rows" else 1
        keys = [f"[{'.'.join(keys[:number])}]", *keys[number:]]
    if error["type"] == "literal_error":
        message = "allowed " + error["ctx"]["expected"].replace("'", '"').removeprefix('"", ')
    elif error["type"] == "extra_forbidden":
        models: dict[str, type[Section]] = {"[file]": File, "[rows]": Rows, "[table]": Table}
        allowed = models.get(keys[0], ColumnMap).model_fields
        message = f"not a key of it, allowed {', '.join(allowed)}"
    given = error["input"]
    got = "" if isinstance(given, dict) and len(given) > 1 else f", got {shown(str(given))}"
    return one_line(f"{' '.join(keys)}: {message}{got}")


def toml_entry(key: str, value: str | float | list[str], comment: str = "") -> str:
    """Write a key of TOML with its value and a comment, if there is one.

    >>> print(toml_entry("resp.keys", "None", "guess"))
    "resp.keys" = "None"  # guess
    """
    return f"{format_key(key)} = {_quote(value)}" + (f"  # {comment}" if comment else "")


def format_key(key: str) -> str:
    """Write a key of TOML, in quotation marks if it needs them."""
    return key if _BARE_KEY.fullmatch(key) else _quote(key)


def _quote(value: str | float | list[str]) -> str:
    quoted = json.dumps(value, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in quoted)
