"""The cells of trials.csv: text to numbers, words and flags, or refused with what is allowed."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any
from unicodedata import category

import numpy as np
import pandas as pd

from analysis.axis import LARGEST
from analysis.reading.text import ResultFileError, shown
from experiment.rows import NOT_AVAILABLE, RESPONSES, SCHEMA, Column
from experiment.trial.plan import HANDS_OFF_BLOCK

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray


DETECTED = Column(
    name="detected",
    type="str",
    optional=True,
    choices=("0", "1", *(word for word in RESPONSES if word in {"timeout", "invalid"})),
    description="whether the stimulus was felt, in tables that do not tell the side answered",
)
TRUTHS: Mapping[str, str] = MappingProxyType(
    dict.fromkeys(("true", "True", "TRUE"), "1") | dict.fromkeys(("false", "False", "FALSE"), "0")
)
"""How jsPsych, Python and R write whether something was detected."""
SILENT = ("-inf", "-infinity")
"""Levels, in small letters, of no stimulus where 0 is a level, as in dB: of an amplitude of 0."""
NOTHING = ("", "none", "null", "n/a", "na", "nan", *SILENT)
"""How others write that there is no value, small letters."""
UNANSWERED = Column(
    name="unanswered",
    type="bool",
    optional=False,
    choices=(),
    description="whether a time-out is coded in another column than the answer",
)

# What one unit of theirs is in ours, as numerator and denominator (each exact in binary).
UNITS: Mapping[str, Mapping[str, tuple[float, float]]] = MappingProxyType(
    {
        "_s": {"s": (1.0, 1.0), "ms": (1.0, 1e3), "us": (1.0, 1e6)},
        "_vpp": {"V": (1.0, 1.0), "mV": (1.0, 1e3), "V-peak": (2.0, 1.0), "mV-peak": (2.0, 1e3)},
    }
)
_LEAST: Mapping[str, int] = MappingProxyType(
    {
        "schema": SCHEMA,
        "block": HANDS_OFF_BLOCK,
        "trial": 1,
        "attempt": 1,
        "detected": 0,
        "presented": 0,
        "rt_s": 0,
        "level_vpp": 0,
        "foreperiod_s": 0,
        "level_left_vpp": 0,
        "level_right_vpp": 0,
        "peak_left_um": 0,
        "peak_right_um": 0,
    }
)
_MOST: Mapping[str, int] = MappingProxyType({"schema": SCHEMA})
_WORDING: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "schema": (str(SCHEMA),),
        "level_vpp": ("a number above 0", "in a blank trial 0"),
    }
)
_LARGEST_WHOLE = 2**53
_LONGEST_TEXT = 64
_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_WHOLE = re.compile(r"-?\d+(\.0*)?", re.ASCII)
_COMMA = re.compile(r"[+-]?\d*,\d+", re.ASCII)
_FLAGS: Mapping[str, bool] = MappingProxyType({"true": True, "false": False})


def units_of(ours: str) -> Mapping[str, tuple[float, float]]:
    """Return the units that a column of ours may have elsewhere.

    >>> [*units_of("rt_s")]
    ['s', 'ms', 'us']
    """
    return next((units for suffix, units in UNITS.items() if ours.endswith(suffix)), {})


@dataclass(frozen=True, slots=True, kw_only=True)
class CellFault:
    """The first cell of a column that cannot be read."""

    line: int  # in the file
    message: str  # column, value and what is allowed


ANY = -math.inf
"""The least value of a level that may have any sign, and that of a trial without a stimulus."""


_WORDING_OF: Mapping[float, tuple[str, ...]] = MappingProxyType(
    {ANY: ("a finite number", "in a blank trial -inf")}
)


def allowed(column: Column, *, least: float | None = None) -> str:
    """Say in words which cells a column may have, of numbers from `least` on if not by itself.

    >>> from experiment.rows import COLUMNS
    >>> [allowed(c) for c in COLUMNS if c.name in {"trial", "noise_ok"}]
    ['a whole number of at least 1', 'true, false or n/a']
    """
    wording = _WORDING.get(column.name, ()) if least is None else _WORDING_OF.get(least, ())
    least = _LEAST.get(column.name, ANY) if least is None else least
    bound = "" if least == ANY else f" of at least {least}"
    kinds = {
        "int": [f"a whole number{bound}"],
        "float": [f"a finite number{bound}"],
        "bool": [*_FLAGS],
        "str": [f"printable text of 1 to {_LONGEST_TEXT} characters"],
    }
    words = list(wording or column.choices or kinds[column.type])
    if column.optional:
        words.append(NOT_AVAILABLE)
    return " or ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


def parse(column: Column, text: str, *, least: float | None = None) -> object:
    """Read one cell; ``None`` for ``n/a`` where the column may have it.

    A number is of at least `least` or, without one, of what the column has by itself. Where it may
    have any sign, -inf is the level of a blank trial.

    Of texts, marks of direction and other signs without a form are spelled out.

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
        return _number(column, text, least)
    elif 0 < len(told := _told(text)) <= _LONGEST_TEXT and told.isprintable():
        return told
    raise ValueError(f"{column.name} must be {allowed(column, least=least)}, got {text!r}")


def _told(text: str) -> str:
    """Spell out signs without a form, as marks of direction: unseen, they would mix up names."""
    if text.isprintable():
        return text
    return "".join(f"<U+{ord(c):04X}>" if category(c) == "Cf" else c for c in text)


def _number(column: Column, text: str, least: float | None) -> float | int:
    whole = column.type == "int"
    if least == ANY and text.lower() in SILENT:
        return ANY
    if (_WHOLE if whole else _NUMBER).fullmatch(text):
        number = float(text)
        most = _MOST.get(column.name, _LARGEST_WHOLE) if whole else LARGEST
        if _least(column, least) <= number <= most:
            return int(number) if whole else number
    raise ValueError(f"{column.name} must be {allowed(column, least=least)}, got {text!r}")


def _least(column: Column, least: float | None) -> float:
    return _LEAST.get(column.name, -LARGEST) if least is None else max(least, -LARGEST)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellReader:
    """How one column of a table becomes one of ours."""

    column: Column  # ours
    label: str  # the column's name for messages
    # theirs to ours; other words stay as they are
    words: Mapping[str, str] = field(default_factory=dict)
    # numerator and denominator that bring a number of theirs to our unit
    scale: tuple[float, float] = (1.0, 1.0)
    least: float | None = None  # of a number, where it is not that of the column
    decimal: str = "."

    def read(self, texts: pd.Series[Any]) -> pd.Series[Any] | CellFault:
        """Read text cells, whose index holds their lines, each different text only once.

        As int64, float64 (NaN for none), bool, nullable boolean where the column is optional, a
        categorical of the column's words, or text; or the first cell that cannot be read.

        >>> CellReader(column=DETECTED, label="felt").read(pd.Series(["1", "2"], index=[2, 3])).line
        3
        """
        codes, distinct = pd.factorize(texts.to_numpy(dtype=object))
        numbers = self._numbers(distinct)
        if numbers is not None:
            return pd.Series(numbers[codes], index=texts.index)
        values: list[Any] = []
        for code, text in enumerate(distinct):
            try:
                values.append(self._value(text))
            except ValueError:
                held = f"holds {shown(text)}" if text else "is empty"
                words = allowed(self.column, least=self.least)
                message = f"column {shown(self.label)} {held}; allowed: {words}{self._hint(text)}"
                return CellFault(
                    line=int(texts.index[int(np.argmax(codes == code))]), message=message
                )
        return pd.Series(_array(self.column, values)[codes], index=texts.index)

    def _numbers(self, texts: NDArray[Any]) -> NDArray[np.float64] | None:
        """Read numbers at once, as `_value` does; None where one is to be looked at by itself."""
        column = self.column
        if column.type != "float" or self.words or self.decimal != ".":
            return None
        missing = texts == NOT_AVAILABLE if column.optional else np.zeros(len(texts), np.bool_)
        told = texts[~missing]
        if not all(map(_NUMBER.fullmatch, told)):
            return None
        read = told.astype(np.float64)
        if not np.all((_least(column, self.least) <= read) & (read <= LARGEST)):
            return None
        numbers = np.full(len(texts), math.nan)
        numbers[~missing] = read * self.scale[0] / self.scale[1]
        return numbers

    def _value(self, text: str) -> object:
        """Read one cell; a word of theirs stands for a value in our unit already."""
        if text in self.words:
            return parse(self.column, self.words[text], least=self.least)
        if self.column == DETECTED:
            text = TRUTHS.get(text, text)
        if self.decimal != "." and self.column.type in {"int", "float"}:
            if "." in text:
                raise ValueError("a point where commas are decimal")
            text = text.replace(self.decimal, ".")
        value = parse(self.column, text, least=self.least)
        return value * self.scale[0] / self.scale[1] if isinstance(value, float) else value

    def _hint(self, text: str) -> str:
        """Say what a map could say of a number with a comma, or of another word for 0 and 1."""
        if self.column == DETECTED and text:
            key = json.dumps(text[:_LONGEST_TEXT], ensure_ascii=False)
            ours = "timeout" if text.lower() in NOTHING else "1"
            return f'; a map says what it stands for, as [values.detected] {key} = "{ours}"'
        if self.column.type != "float" or not _COMMA.fullmatch(text) or self.decimal != ".":
            return ""
        return '; where commas are decimal, a map says [file] decimal = ","'


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


def first_fault(file: str, faults: list[CellFault]) -> None:
    """Raise the fault that stands highest in the file, if there is one.

    >>> first_fault("t.csv", [])
    """
    if faults:
        fault = min(faults, key=lambda f: f.line)
        raise ResultFileError(file, fault.line, fault.message)
