"""Cells of text to numbers, words and flags, or the first cell that cannot be read."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final
from unicodedata import category

import numpy as np
import pandas as pd

from analysis.axis import LARGEST
from analysis.reading.text import ResultFileError, shown
from experiment.names import NOT_AVAILABLE
from experiment.record.rows import RESPONSES, SCHEMA, Column
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.trial.plan import HANDS_OFF_BLOCK

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray


YES, NO = "1", "0"
DETECTED: Final = Column(
    name="detected",
    type="str",
    optional=True,
    choices=(NO, YES, *(word for word in RESPONSES if word not in LEFT_RIGHT_BOTH.answer_names)),
    description="whether the stimulus was felt, in tables that do not state the side answered",
)
UNANSWERED: Final = Column(
    name="unanswered",
    type="bool",
    optional=False,
    choices=(),
    description="whether a time-out is coded in another column than the answer",
)
TRUTHS: Final[Mapping[str, str]] = MappingProxyType(
    dict.fromkeys(("true", "True", "TRUE"), YES) | dict.fromkeys(("false", "False", "FALSE"), NO)
)
"""How jsPsych, Python and R write whether something was detected."""
SILENT: Final = ("-inf", "-infinity")
"""Levels, in small letters, of no stimulus where 0 is a level, as in dB: of an amplitude of 0."""
NOTHING: Final = ("", "none", "null", "n/a", "na", "nan", *SILENT)
"""How others write that there is no value, small letters."""
BLANK_LEVEL: Final = -math.inf
"""The level of a trial without a stimulus on an axis that has levels of any sign."""

UNITS: Final[Mapping[str, Mapping[str, float]]] = MappingProxyType(
    {
        "_s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
        "_vpp": {"V": 1.0, "mV": 1e-3, "V-peak": 2.0, "mV-peak": 2e-3},
    }
)
"""What one unit of theirs is in ours, by the ending of our column."""
_MIN: Final[Mapping[str, int]] = MappingProxyType(
    {"schema": SCHEMA, "block": HANDS_OFF_BLOCK, "trial": 1, "attempt": 1}
    | dict.fromkeys(("detected", "presented", "missed", "rt_s", "foreperiod_s"), 0)
)
_SIZES: Final = ("_vpp", "_um")
"""Endings of the names of levels and displacements, which are at least 0."""
_LARGEST_WHOLE: Final = 2**53
_MAX_TEXT: Final = 64
_NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WHOLE: Final = re.compile(r"-?\d+(\.0*)?", re.ASCII)
_COMMA: Final = re.compile(r"[+-]?\d*,\d+", re.ASCII)
_SWAPPED: Final = str.maketrans(".,", ",.")
_FLAGS: Final[Mapping[str, bool]] = MappingProxyType({"true": True, "false": False})


def units_of(ours: str) -> Mapping[str, float]:
    """Return the units that a column of ours may have elsewhere.

    >>> [*units_of("rt_s")]
    ['s', 'ms', 'us']
    """
    return next((units for suffix, units in UNITS.items() if ours.endswith(suffix)), {})


@dataclass(frozen=True, slots=True)
class CellFault:
    """The first cell of a column that cannot be read."""

    row: int  # counted from 0
    message: str  # column, value and what is allowed


@dataclass(frozen=True, slots=True, kw_only=True)
class CellReader:
    """How one column of a table becomes one of ours."""

    column: Column  # ours
    label: str  # the column's name for messages
    # theirs to ours, in our unit; other words stay as they are
    translations: Mapping[str, str] = field(default_factory=dict)
    scale: float = 1.0  # from their unit to ours
    minimum: float | None = None  # of a number, where it is not that of the column
    decimal: str = "."

    def read(self, texts: Sequence[str] | pd.Series[str] | NDArray[Any]) -> Any:
        """Read text cells, each different text only once.

        As int64, float64 (NaN for none), bool, nullable boolean where the column is optional, a
        categorical of the column's words, or text; or a `CellFault`.

        >>> CellReader(column=DETECTED, label="felt").read(["1", "2"]).row
        1
        """
        column, texts = self.column, pd.Series(texts, dtype=object).to_numpy()
        codes, distinct = pd.factorize(texts)
        translations = {**(TRUTHS if column == DETECTED else {}), **self.translations}
        cells = [translations.get(text, text) for text in distinct]
        values: Any
        if column.choices:
            codes_of = {choice: code for code, choice in enumerate(column.choices)}
            values = pd.Categorical.from_codes(
                [codes_of.get(cell, -1) for cell in cells], categories=pd.Index(column.choices)
            )
            is_valid = values.codes >= 0
        elif column.type == "bool":
            is_valid = np.fromiter((cell in _FLAGS for cell in cells), np.bool_)
            values = pd.array([_FLAGS.get(cell) for cell in cells], dtype="boolean")
            values = values if column.optional else values.to_numpy(np.bool_, na_value=False)
        elif column.type == "str":
            values = np.array([_spell_marks(cell) for cell in cells], dtype=object)
            are_texts = (0 < len(value) <= _MAX_TEXT and value.isprintable() for value in values)
            is_valid = np.fromiter(are_texts, np.bool_)
        else:
            values = self._parse_numbers(cells, [text in translations for text in distinct])
            is_valid = ~np.isnan(values)
        is_missing = np.fromiter((cell == NOT_AVAILABLE for cell in cells), np.bool_)
        is_fault = np.where(is_missing, not column.optional, ~is_valid)
        if is_fault.any():
            row = int(np.argmax(is_fault[codes]))
            held = f"holds {shown(texts[row])}" if texts[row] else "is empty"
            message = f"column {shown(self.label)} {held}; allowed: {self.allowed}"
            return CellFault(row, message + self._remedy(texts[row]))
        return values[codes].astype(np.int64) if column.type == "int" else values[codes]

    def _parse_numbers(self, cells: list[str], translated: list[bool]) -> NDArray[np.float64]:
        """Return numbers in our unit, NaN for what is none or out of bounds."""
        if self.decimal == ",":
            pairs = zip(cells, translated, strict=True)
            cells = [cell if is_ours else cell.translate(_SWAPPED) for cell, is_ours in pairs]
        matches = (_WHOLE if self.column.type == "int" else _NUMBER).fullmatch
        numbers = np.array([float(cell) if matches(cell) else math.nan for cell in cells], float)
        largest = _LARGEST_WHOLE if self.column.type == "int" else LARGEST
        if self.column.name == "schema":
            largest = SCHEMA
        numbers[~((max(self._smallest, -LARGEST) <= numbers) & (numbers <= largest))] = math.nan
        if self.minimum == BLANK_LEVEL:
            numbers[[cell.lower() in SILENT for cell in cells]] = BLANK_LEVEL
        if self.scale != 1:
            # Without the last binary digits: 5e-8 m are 0.05 um.
            rounded = [float(f"{value:.15g}") for value in (numbers * self.scale).tolist()]
            numbers = np.where(translated, numbers, rounded)
        return numbers

    @property
    def _smallest(self) -> float:
        if self.minimum is not None:
            return self.minimum
        is_size = self.column.name.endswith(_SIZES)
        return _MIN.get(self.column.name, 0 if is_size else -math.inf)

    @property
    def allowed(self) -> str:
        """Which cells the column may have.

        >>> from experiment.record.rows import COLUMNS
        >>> readers = (CellReader(column=column, label="") for column in COLUMNS)
        >>> [each.allowed for each in readers if each.column.name in {"trial", "noise_ok"}]
        ['a whole number of at least 1', 'true, false or n/a']
        """
        column = self.column
        at_least = "" if self._smallest == -math.inf else f" of at least {self._smallest}"
        if column.name == "level_vpp" and self.minimum is None:
            allowed = ["a number above 0", "in a blank trial 0"]
        elif self.minimum == BLANK_LEVEL:
            allowed = ["a finite number", "in a blank trial -inf"]
        elif column.name == "schema":
            allowed = [str(SCHEMA)]
        else:
            allowed = [*column.choices] or {
                "int": [f"a whole number{at_least}"],
                "float": [f"a finite number{at_least}"],
                "bool": [*_FLAGS],
                "str": [f"printable text of 1 to {_MAX_TEXT} characters"],
            }[column.type]
        allowed += [NOT_AVAILABLE] * column.optional
        return " or ".join(filter(None, [", ".join(allowed[:-1]), allowed[-1]]))

    def _remedy(self, text: str) -> str:
        """Return the line of a map that reads a cell, where it is certain which."""
        key = json.dumps(text[:_MAX_TEXT], ensure_ascii=False)
        is_number, is_nothing = self.column.type == "float", text.lower() in NOTHING
        is_word = self.column.name == "level_vpp" and text.isalpha() and not is_nothing
        detected = "timeout" if is_nothing else "..."
        silent = "0" if self.minimum is None else "-inf"
        remedies = {
            f'translate it in the column map: [values.detected] {key} = "{detected}"': (
                self.column == DETECTED and text
            ),
            'with [file] decimal = ",", a number has no decimal point': (
                is_number and self.decimal == "," and "." in text
            ),
            'if commas are decimal, set [file] decimal = "," in the column map': (
                is_number and self.decimal == "." and _COMMA.fullmatch(text)
            ),
            f'if these are blank trials, set [values.level_vpp] {key} = "{silent}"': is_word,
        }
        return next((f"; {remedy}" for remedy, holds in remedies.items() if holds), "")


def _spell_marks(text: str) -> str:
    """Spell out signs without a form, as marks of direction: unseen, they would mix up names."""
    if text.isprintable():
        return text
    return "".join(f"<U+{ord(c):04X}>" if category(c) == "Cf" else c for c in text)


def text_frame(header: Sequence[str], lines: list[int], rows: list[list[str]]) -> pd.DataFrame:
    """Return rows of text by their lines.

    >>> text_frame(["side"], [2], [["both"]]).loc[2, "side"]
    'both'
    """
    # As objects: with text of its own type, pandas takes twice the time for small tables.
    cells = np.array(rows, dtype=object).reshape(len(rows), len(header))
    names = pd.Series(header, dtype=object)
    return pd.DataFrame(cells, index=lines, columns=names, dtype=object)


def read_columns(texts: pd.DataFrame, readers: Sequence[CellReader]) -> pd.DataFrame:
    """Read columns of text cells, one by each reader; ``file`` and ``line`` say where a row is.

    Raises ResultFileError for the first row with a cell that cannot be read.
    """
    values = {reader.column.name: reader.read(texts[reader.column.name]) for reader in readers}
    faults = [fault for fault in values.values() if isinstance(fault, CellFault)]
    if faults:
        fault = min(faults, key=lambda fault: fault.row)
        row = texts.iloc[fault.row]
        raise ResultFileError(row["file"], int(row["line"]), fault.message)
    return pd.DataFrame(values | {name: texts[name].to_numpy() for name in ("file", "line")})


def refuse_first(rows: pd.DataFrame, is_refused: pd.Series[bool], message: str) -> None:
    """Refuse the first of these rows, if there is one, with its file and line."""
    if is_refused.any():
        row = rows[is_refused].iloc[0]
        raise ResultFileError(row["file"], int(row["line"]), message)
