"""Tables as CSV that a spreadsheet shows and does not carry out."""

from __future__ import annotations

import csv
import io
import re
from typing import TYPE_CHECKING, Any

import pandas as pd

from experiment.record import NOT_AVAILABLE, format_value

if TYPE_CHECKING:
    from collections.abc import Iterable

# At the beginning, or behind what some spreadsheet takes for the end of a cell; = + - @ also wide.
_FORMULA = re.compile(r"""(^|[,;|\t"])([' ]*[=+\-@＝＋－＠])""")
_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", re.ASCII)


def csv_text(table: pd.DataFrame) -> str:
    r"""Write a table as CSV with LF line ends; NaN is ``n/a``, numbers keep their shortest form.

    Texts are written as `harmless` makes them.

    >>> table = pd.DataFrame({"level_vpp": [60.0], "group_low": [float("nan")], "name": ["=1+1"]})
    >>> csv_text(table)
    "level_vpp,group_low,name\n60,n/a,'=1+1\n"
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(zip(*(_cells(table[name]) for name in table.columns), strict=True))
    return text.getvalue()


def _cells(column: pd.Series[Any]) -> Iterable[str]:
    """Write each different value once."""
    codes, distinct = pd.factorize(column.astype(object), use_na_sentinel=True)
    # The last stands for missing values, whose code is -1.
    texts = [*(_cell(value) for value in distinct), NOT_AVAILABLE]
    return [texts[code] for code in codes]


def _cell(value: object) -> str:
    return harmless(value) if isinstance(value, str) else format_value(value)


def harmless(text: str) -> str:
    """Return a text that a spreadsheet does not take for a formula.

    Parts that a spreadsheet might calculate, because they begin with ``=``, ``+``, ``-`` or ``@``
    or with apostrophes before one of them, get an apostrophe in front. Different texts stay
    different. Texts that are numbers stay as they are.

    >>> [harmless(text) for text in ("S01", "=1+1", "'=1+1", "-3", "-3 dB", "a;@b")]
    ['S01', "'=1+1", "''=1+1", '-3', "'-3 dB", "a;'@b"]
    """
    return text if _NUMBER.fullmatch(text) else _FORMULA.sub(r"\1'\2", text)
