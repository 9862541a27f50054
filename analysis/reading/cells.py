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
from experiment.rows import NOT_AVAILABLE, RESPONSES, SCHEMA, Column
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
    description="whether the stimulus was felt, in tables that do not tell the side answered",
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

# What one unit of theirs is in ours, as numerator and denominator (each exact in binary).
UNITS: Final[Mapping[str, Mapping[str, tuple[float, float]]]] = MappingProxyType(
    {
        "_s": {"s": (1.0, 1.0), "ms": (1.0, 1e3), "us": (1.0, 1e6)},
        "_vpp": {"V": (1.0, 1.0), "mV": (1.0, 1e3), "V-peak": (2.0, 1.0), "mV-peak": (2.0, 1e3)},
    }
)
_MIN: Final[Mapping[str, int]] = MappingProxyType(
    {"schema": SCHEMA, "block": HANDS_OFF_BLOCK, "trial": 1, "attempt": 1}
    | dict.fromkeys(("detected", "presented", "missed", "rt_s", "level_vpp", "foreperiod_s"), 0)
    | dict.fromkeys(("level_left_vpp", "level_right_vpp", "peak_left_um", "peak_right_um"), 0)
)
_LARGEST_WHOLE: Final = 2**53
_MAX_TEXT: Final = 64
_NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WHOLE: Final = re.compile(r"-?\d+(\.0*)?", re.ASCII)
_COMMA: Final = re.compile(r"[+-]?\d*,\d+", re.ASCII)
_FLAGS: Final[Mapping[str, bool]] = MappingProxyType({"true": True, "false": False})


def units_of(ours: str) -> Mapping[str, tuple[float, float]]:
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


def format_allowed(column: Column, *, minimum: float | None = None) -> str:
    """Return which cells a column may have; numbers from `minimum` on, if not by itself.

    >>> from experiment.rows import COLUMNS
    >>> [format_allowed(c) for c in COLUMNS if c.name in {"trial", "noise_ok"}]
    ['a whole number of at least 1', 'true, false or n/a']
    """
    bound = _MIN.get(column.name, -math.inf) if minimum is None else minimum
    at_least = "" if bound == -math.inf else f" of at least {bound}"
    if column.name == "level_vpp" and minimum is None:
        allowed = ["a number above 0", "in a blank trial 0"]
    elif minimum == BLANK_LEVEL:
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


def parse(column: Column, text: str, *, minimum: float | None = None) -> object:
    """Read one cell; ``None`` for ``n/a`` where the column may have it.

    Raises ValueError for text that is not allowed in this column.

    >>> parse(DETECTED, "1"), parse(DETECTED, "n/a")
    ('1', None)
    """
    if text == NOT_AVAILABLE:
        if column.optional:
            return None
    elif column.choices:
        if text in column.choices:
            return text
    elif column.type == "bool":
        if text in _FLAGS:
            return _FLAGS[text]
    elif column.type != "str":
        number = _parse_number(column, text, minimum)
        if number is not None:
            return number
    elif 0 < len(spelled := _spell_marks(text)) <= _MAX_TEXT and spelled.isprintable():
        return spelled
    raise ValueError(f"{column.name} must be {format_allowed(column, minimum=minimum)}")


def _spell_marks(text: str) -> str:
    """Spell out signs without a form, as marks of direction: unseen, they would mix up names."""
    if text.isprintable():
        return text
    return "".join(f"<U+{ord(c):04X}>" if category(c) == "Cf" else c for c in text)


def _parse_number(column: Column, text: str, minimum: float | None) -> float | int | None:
    whole = column.type == "int"
    if minimum == BLANK_LEVEL and text.lower() in SILENT:
        return BLANK_LEVEL
    if not (_WHOLE if whole else _NUMBER).fullmatch(text):
        return None
    number = float(text)
    largest = SCHEMA if column.name == "schema" else _LARGEST_WHOLE if whole else LARGEST
    if not _smallest(column, minimum) <= number <= largest:
        return None
    return int(number) if whole else number


def _smallest(column: Column, minimum: float | None) -> float:
    return max(_MIN.get(column.name, -LARGEST) if minimum is None else minimum, -LARGEST)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellReader:
    """How one column of a table becomes one of ours."""

    column: Column  # ours
    label: str  # the column's name for messages
    # theirs to ours; other words stay as they are
    translations: Mapping[str, str] = field(default_factory=dict)
    # numerator and denominator that bring a number of theirs to our unit
    scale: tuple[float, float] = (1.0, 1.0)
    minimum: float | None = None  # of a number, where it is not that of the column
    decimal: str = "."

    def read(self, texts: Sequence[str] | NDArray[Any]) -> Any:
        """Read text cells, each different text only once.

        As int64, float64 (NaN for none), bool, nullable boolean where the column is optional, a
        categorical of the column's words, or text; or a `CellFault`.

        >>> CellReader(column=DETECTED, label="felt").read(["1", "2"]).row
        1
        """
        codes, distinct = pd.factorize(np.asarray(texts, dtype=object))
        numbers = self._read_numbers(distinct)
        if numbers is not None:
            return numbers[codes]
        values: list[Any] = []
        for code, text in enumerate(distinct):
            try:
                values.append(self._read_cell(text))
            except ValueError:
                held = f"holds {shown(text)}" if text else "is empty"
                allowed = format_allowed(self.column, minimum=self.minimum)
                message = f"column {shown(self.label)} {held}; allowed: {allowed}"
                return CellFault(int(np.argmax(codes == code)), message + self._remedy(text))
        return _array(self.column, values)[codes]

    def _read_numbers(self, texts: NDArray[Any]) -> NDArray[np.float64] | None:
        """Read numbers at once, as `_read_cell` does; None where one needs a look by itself."""
        column = self.column
        if column.type != "float" or self.decimal != ".":
            return None
        missing = texts == NOT_AVAILABLE if column.optional else np.zeros(len(texts), np.bool_)
        if self.translations and any(text in self.translations for text in texts[~missing]):
            return None
        if not all(map(_NUMBER.fullmatch, texts[~missing])):
            return None
        values = texts[~missing].astype(np.float64)
        if not np.all((_smallest(column, self.minimum) <= values) & (values <= LARGEST)):
            return None
        numbers = np.full(len(texts), math.nan)
        numbers[~missing] = [self._rescale(value) for value in values.tolist()]
        return numbers

    def _read_cell(self, text: str) -> object:
        """Read one cell; a word of theirs stands for a value in our unit already."""
        if text in self.translations:
            return parse(self.column, self.translations[text], minimum=self.minimum)
        if self.column == DETECTED:
            text = TRUTHS.get(text, text)
        if self.decimal != "." and self.column.type in {"int", "float"}:
            if "." in text:
                raise ValueError(text)
            text = text.replace(self.decimal, ".")
        value = parse(self.column, text, minimum=self.minimum)
        return self._rescale(value) if isinstance(value, float) else value

    def _rescale(self, value: float) -> float:
        """Bring a number to our unit, without the last binary digits: 5e-8 m are 0.05 um."""
        if self.scale == (1.0, 1.0) or not math.isfinite(value):
            return value
        return float(f"{value * self.scale[0] / self.scale[1]:.15g}")

    def _remedy(self, text: str) -> str:
        """Return the line of a map that reads a cell, where it is certain which."""
        key = json.dumps(text[:_MAX_TEXT], ensure_ascii=False)
        if self.column == DETECTED and text:
            ours = "timeout" if text.lower() in NOTHING else YES
            return f'; a map says what it stands for, as [values.detected] {key} = "{ours}"'
        if self.column.type != "float":
            return ""
        if self.decimal == "," and "." in text:
            return '; with [file] decimal = ",", a point is no part of a number'
        if self.decimal == "." and _COMMA.fullmatch(text):
            return '; where commas are decimal, a map says [file] decimal = ","'
        if self.column.name == "level_vpp" and text.isalpha() and text.lower() not in NOTHING:
            silent = "0" if self.minimum is None else "-inf"
            return f'; if these are blank trials, a map says [values.level_vpp] {key} = "{silent}"'
        return ""


def _array(column: Column, values: list[Any]) -> Any:
    if column.choices:
        return pd.Categorical(values, categories=list(column.choices))
    if column.type == "float":
        return np.array([math.nan if v is None else v for v in values], dtype=np.float64)
    if column.type == "bool" and column.optional:
        return pd.array(values, dtype="boolean")
    if column.type == "str":
        return np.array([NOT_AVAILABLE if v is None else v for v in values], dtype=object)
    return np.array(values, dtype=np.int64 if column.type == "int" else np.bool_)


def read_columns(
    texts: Mapping[str, Sequence[str]],
    readers: Sequence[CellReader],
    files: Sequence[str],
    lines: Sequence[int],
) -> pd.DataFrame:
    """Read columns of text cells, one by each reader; ``file`` and ``line`` say where a row is.

    Raises ResultFileError for the first row with a cell that cannot be read.
    """
    values = {reader.column.name: reader.read(texts[reader.column.name]) for reader in readers}
    faults = [fault for fault in values.values() if isinstance(fault, CellFault)]
    if faults:
        fault = min(faults, key=lambda fault: fault.row)
        raise ResultFileError(files[fault.row], lines[fault.row], fault.message)
    # Names as objects: a file's name need not be text that can be encoded.
    values |= {"file": np.array(files, dtype=object), "line": np.array(lines, dtype=np.int64)}
    return pd.DataFrame(values)
