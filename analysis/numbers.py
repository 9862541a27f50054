"""How a number and its limits are rounded and printed, and the order of participants."""

from __future__ import annotations

import math
import re
from decimal import ROUND_HALF_UP, Decimal
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

LIMITS: Final = (0.025, 0.975)
"""The points of a distribution between which a 95 % interval lies."""
METHODS = ("wilson", "jeffreys", "clopper-pearson")
TOTAL = "all"
_LAST: Final = chr(0x10FFFF)
_MOST_DECIMALS = 12


def rounded(value: float, spread: float) -> str:
    """Return a level with the decimals that its spread deserves, at least one.

    >>> rounded(81.07, 14.2), rounded(0.0151, 0.0025), rounded(1000126.98, 21.9)
    ('81.1', '0.0151', '1000127.0')
    >>> rounded(-0.04, 3.0)
    '0.0'
    """
    return f"{value:z.{_decimals(spread)}f}"


def half_up(value: float, decimals: int) -> str:
    """Return a number as every report prints it, rounded half up: 9 of 240 is 0.038.

    >>> half_up(9 / 240, 3), half_up(100 * (9 / 240), 1), half_up(1, 3), half_up(-0.0001, 3)
    ('0.038', '3.8', '1.000', '-0.000')
    """
    step = Decimal(1).scaleb(-decimals)
    # The shortest digits that are this number: its binary value may lie just below a half.
    return str(Decimal(repr(float(value))).quantize(step, ROUND_HALF_UP))


def _decimals(spread: float) -> int:
    decimals = 1 - math.floor(math.log10(spread)) if 0 < spread < math.inf else 1
    return min(max(decimals, 1), _MOST_DECIMALS)


def alike(spreads: Sequence[float]) -> list[float]:
    """Return spreads by which numbers of one list are rounded: to the decimals of the finest.

    None gets more than one decimal beyond its own.

    >>> [rounded(2.578, one) for one in (1.1, alike([0.61, 1.1])[1])]
    ['2.6', '2.58']
    >>> rounded(81.07, alike([0.004, 14.2])[1])
    '81.07'
    """
    each = [_decimals(spread) for spread in spreads]
    return [3 * 10.0 ** (1 - min(max(each), number + 1)) for number in each]


def shortest(level: float) -> str:
    """Return a level as it was given, up to rounding.

    >>> shortest(60.0), shortest(1000060.4), shortest(0.1 + 0.2)
    ('60', '1000060.4', '0.3')
    """
    return f"{level:.10g}"


def with_limits(
    at: float,
    low: float,
    high: float,
    unit: str,
    levels: Sequence[float],
    *,
    spread: float | None = None,
) -> str:
    """Return a level and its limits in words; an open limit is that of the tested levels.

    They are rounded by `spread_of` them, or by a spread that is given.

    >>> with_limits(81.07, 74.0, 88.21, "V", [60, 200])
    '81.1 V (74.0 to 88.2)'
    >>> with_limits(71.07, -math.inf, 88.21, "V", [60, 200])
    '71.1 V (< 60 to 88.2)'
    >>> with_limits(0.01505, 0.01389, 0.01639, "mm", [0.01, 0.02])
    '0.0150 mm (0.0139 to 0.0164)'
    """
    spread = spread_of(low, at, high, levels) if spread is None else spread
    return f"{rounded(at, spread)} {unit} ({between(low, high, levels, spread)})"


def spread_of(low: float, at: float, high: float, levels: Sequence[float]) -> float:
    """Return the spread by which a level and its limits are rounded.

    It is the distance between the smallest and the largest of them that are finite. For levels
    above 0 it is at most the smallest one, so that none is rounded to 0. If both limits are open,
    it is at most the tested range.

    >>> spread_of(74.0, 81.0, 88.0, [60, 200]), spread_of(0.125, 0.25, 8.0, [0.1, 9])
    (14.0, 0.125)
    >>> spread_of(-math.inf, 0.0625, math.inf, [0.02, 0.159])
    0.0625
    """
    ends = [end for end in (low, at, high) if math.isfinite(end)]
    spread = max(ends) - min(ends) or max(levels) - min(levels)
    return min(spread, *ends) if min(*levels, *ends) > 0 else spread


def between(low: float, high: float, levels: Sequence[float], spread: float) -> str:
    """Return limits in words, rounded by a spread; an open one is that of the tested levels.

    >>> between(74.0, 88.21, [60, 200], 14.2), between(-math.inf, math.inf, [60, 200], 140)
    ('74.0 to 88.2', '< 60 to > 200')
    >>> between(-math.inf, 0.0449, [0.02, 0.1589], 0.016)
    '< 0.02 to 0.045'
    """
    least = f"< {shortest(min(levels))}" if low == -math.inf else rounded(low, spread)
    most = f"> {shortest(max(levels))}" if high == math.inf else rounded(high, spread)
    return f"{least} to {most}"


def bounded(low: float, high: float, unit: str, levels: Sequence[float]) -> str:
    """Return what two limits say of a level that lies outside the tested ones.

    >>> bounded(-math.inf, 60.0, "V", [60, 200]), bounded(-math.inf, 68.18, "V", [60, 200])
    ('< 60 V', 'at most 68.2 V (95 %)')
    >>> bounded(200.0, math.inf, "V", [60, 200]), bounded(-math.inf, math.inf, "V", [60, 200])
    ('> 200 V', 'not bounded by these levels')
    """
    if math.isfinite(high):
        lowest = min(levels)
        sure = high < lowest or math.isclose(high, lowest)
        return f"< {shortest(lowest)} {unit}" if sure else f"at most {alone(high, unit)} (95 %)"
    if math.isfinite(low):
        highest = max(levels)
        sure = low > highest or math.isclose(low, highest)
        return f"> {shortest(highest)} {unit}" if sure else f"at least {alone(low, unit)} (95 %)"
    return "not bounded by these levels"


def alone(level: float, unit: str) -> str:
    """Return a level without limits in words, to three digits at least.

    >>> alone(90.2, "V"), alone(0.01505, "mm"), alone(0.0, "V")
    ('90.2 V', '0.0150 mm', '0.0 V')
    """
    return f"{rounded(level, abs(level) / 10)} {unit}"


def counted_up(participant: str) -> str:
    """Return what participants are sorted by: numbers in their names by size, not by digits.

    >>> sorted(["10", "9", "P2", "P11"], key=counted_up)
    ['9', '10', 'P2', 'P11']
    """
    padded = re.sub(r"[0-9]+", lambda number: number[0].lstrip("0").zfill(20), participant)
    return f"{padded}\0{participant}"  # 2 and 02 are two people, always in the same order


def in_order(column: pd.Series) -> pd.Series:
    """Return by what `sort_values` sorts a column: participants by `counted_up`, `TOTAL` last."""
    if column.name != "participant":
        return column
    return column.astype(str).map(lambda name: _LAST if name == TOTAL else counted_up(name))


def percent(share: float) -> str:
    """Return a share in per cent with one decimal, rounded half up.

    >>> percent(0.0375), percent(1.0)
    ('3.8', '100.0')
    """
    return half_up(round(100 * float(share), 9), 1)  # 100 * 0.0375 need not be 3.75


def p_value(p: float) -> str:
    """Return the probability of a test as papers print it.

    >>> p_value(0.0004), p_value(0.0384), p_value(0.4), p_value(math.nan)
    ('p < 0.001', 'p = 0.038', 'p = 0.40', 'n/a')
    """
    if math.isnan(p):
        return "n/a"
    if p < 0.001:  # noqa: PLR2004 (the usual last step)
        return "p < 0.001"
    return f"p = {p:.2f}" if p >= 0.1 else f"p = {p:.3f}"  # noqa: PLR2004


def decimals(value: float | None, number: int) -> str:
    """Return a number with so many decimals, or n/a.

    >>> decimals(0.25, 3), decimals(math.nan, 3), decimals(None, 0)
    ('0.250', 'n/a', 'n/a')
    """
    return "n/a" if value is None or math.isnan(value) else half_up(value, number)


def signed(value: float, number: int = 1) -> str:
    """Return a number with its sign and so many decimals, none before 0.

    >>> signed(2.04), signed(-0.04), signed(-3.15)
    ('+2.0', '0.0', '-3.2')
    """
    shown = half_up(abs(value), number)
    return shown if float(shown) == 0 else f"{'+' if value > 0 else '-'}{shown}"
