"""What the levels of a table are: their axis and their unit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_HALF_UP, Decimal
from typing import TYPE_CHECKING, Any, Literal, get_args, overload

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


XScale = Literal["log10", "linear"]
LevelScale = Literal["log10", "dB", "linear"]
_DB = 20.0
_MOST_UNIT = 16
_MOST_DECIMALS = 12
LARGEST = 1e300
"""The largest number of a table."""


def rounded(value: float, spread: float) -> str:
    """Return a level with the decimals that its spread deserves, at least one.

    >>> rounded(81.07, 14.2), rounded(0.0151, 0.0025), rounded(1000126.98, 21.9)
    ('81.1', '0.0151', '1000127.0')
    """
    return f"{value:.{_decimals(spread)}f}"


def half_up(value: float, decimals: int) -> str:
    """Return a number as it is read, rounded half up, wherever it is told: 9 of 240 is 0.038.

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
    own = [_decimals(one) for one in spreads]
    return [3 * 10.0 ** (1 - min(max(own), one + 1)) for one in own]


def shortest(level: float) -> str:
    """Return a level as it was given, up to rounding.

    >>> shortest(60.0), shortest(1000060.4), shortest(0.1 + 0.2)
    ('60', '1000060.4', '0.3')
    """
    return f"{level:.10g}"


_PLAIN_DB = 20.0
"""Of a ratio with two decimals."""


def times(difference_db: float, *limits_db: float) -> str:
    """Return the ratio of two levels that lie so many dB apart, 10^(dB/20), and its limits.

    >>> times(5.3), times(-2.7, -3.8, -1.5), times(50.0)
    ('1.84 times', '0.73 times (0.65 to 0.84)', '316 times')
    """
    form = ".2f" if abs(difference_db) < _PLAIN_DB else ".3g"
    at, *ends = (f"{10 ** (one / 20):{form}}" for one in (difference_db, *limits_db))
    return f"{at} times ({' to '.join(ends)})" if ends else f"{at} times"


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

    It is the distance of those that are told. Of levels above 0 it is at most the least of them,
    so that none is rounded to 0; with both limits open it is at most the tested range.

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """The axis on which levels lie.

    Attributes
    ----------
    x_scale : {"log10", "dB", "linear"}
        ``log10`` for levels above 0, ``dB`` for 20 log10 of such levels, ``linear`` for any.
    unit : str
        Of the levels: printable, of 1 to 16 characters.
    peak_to_peak : bool
        Whether volts are known to be peak-to-peak.

    Raises
    ------
    ValueError
        For another scale, and for a unit that is no such text.

    Examples
    --------
    >>> Axis(x_scale="linear", unit="cm/s").signed, Axis().signed
    (True, False)
    >>> Axis(x_scale="dB", unit="dB SL").on_axis(20.0), Axis(x_scale="dB", unit="dB SL").level(1.0)
    (1.0, 20.0)
    """

    x_scale: LevelScale = "log10"
    unit: str = "V"
    peak_to_peak: bool = True

    def __post_init__(self) -> None:
        if self.x_scale not in get_args(LevelScale):
            raise ValueError(f"[axis] x_scale: allowed log10, dB, linear, got {self.x_scale!r}")
        unit: object = self.unit
        if not (isinstance(unit, str) and 0 < len(unit) <= _MOST_UNIT and unit.isprintable()):
            raise ValueError(f"[axis] unit: printable text of 1 to {_MOST_UNIT}, got {unit!r}")
        if unit.lower().startswith("db") != (self.x_scale == "dB"):
            raise ValueError(
                '[axis] x_scale = "dB" needs a unit such as "dB" or "dB SL", and such a unit '
                f'needs x_scale = "dB"; got unit = "{unit}" and x_scale = "{self.x_scale}"'
            )

    @overload
    def on_axis(self, levels: float) -> float: ...
    @overload
    def on_axis(self, levels: Floats) -> Floats: ...
    def on_axis(self, levels: float | Floats) -> float | Floats:
        """Return where levels lie on the axis.

        Parameters
        ----------
        levels : float or numpy.ndarray
            In their unit.

        Returns
        -------
        float or numpy.ndarray
            Their places.

        Examples
        --------
        >>> import numpy as np
        >>> Axis().on_axis(np.array([10.0, 100.0])).tolist()
        [1.0, 2.0]
        """
        import numpy as np

        if self.x_scale == "dB":
            return levels / _DB
        return np.log10(levels) if self.x_scale == "log10" else levels

    def level(self, x: float) -> float:
        """Return the level at a place on the axis.

        Parameters
        ----------
        x : float
            The place.

        Returns
        -------
        float
            In the unit of the levels.

        Examples
        --------
        >>> Axis().level(2.0)
        100.0
        """
        if self.x_scale == "dB":
            return _DB * x
        return float(10.0**x) if self.x_scale == "log10" else x

    def width(self, sigma: float) -> float:
        """Return a width on the axis in log10 units, or in the unit of the levels.

        Parameters
        ----------
        sigma : float
            The width on the axis.

        Returns
        -------
        float
            In `width_unit`.

        Examples
        --------
        >>> Axis().width(0.1), Axis(x_scale="dB", unit="dB").width(0.1)
        (0.1, 2.0)
        """
        return _DB * sigma if self.x_scale == "dB" else sigma

    @property
    def width_unit(self) -> str:
        """What a width is told in."""
        return {"log10": "log10 units", "dB": "dB"}.get(self.x_scale, self.unit)

    def half_width(self, low: float, high: float) -> str:
        """Return half of how far limits lie apart in dB; nothing of an open one, or without dB.

        Parameters
        ----------
        low, high : float
            The limits, in the unit of the levels.

        Returns
        -------
        str
            With the unit; empty where there is none.

        Examples
        --------
        >>> Axis().half_width(51.7, 73.7), Axis(x_scale="dB", unit="dB").half_width(-4.0, -1.0)
        ('1.5 dB', '1.5 dB')
        >>> Axis().half_width(0.99, 1.01), Axis().half_width(-math.inf, 88.2)
        ('0.09 dB', '')
        """
        if not self.is_logarithmic or not math.isfinite(low + high):
            return ""
        width = _DB * float(self.on_axis(high) - self.on_axis(low))
        return f"{rounded(width / 2, width)} dB"

    @property
    def is_logarithmic(self) -> bool:
        """Whether levels are compared by their ratio, in dB."""
        return self.x_scale != "linear"

    @property
    def fitted(self) -> XScale:
        """The scale on which functions are fitted: one of dB is one of log10, in other units."""
        return "log10" if self.is_logarithmic else "linear"

    @property
    def label(self) -> str:
        """What stands at the axis of a figure behind the level.

        >>> Axis().label, Axis(x_scale="linear", unit="cm/s").label, axis_of({"unit": "V"}).label
        ('V peak-to-peak', 'cm/s', 'V')
        """
        return "V peak-to-peak" if self.is_vpp else self.unit

    @property
    def is_vpp(self) -> bool:
        """Whether levels are volts peak-to-peak."""
        return self.unit == VOLTS.unit and self.peak_to_peak

    @property
    def signed(self) -> bool:
        """Whether levels may have any sign."""
        return self.x_scale != "log10"


def axis_of(section: Mapping[str, Any]) -> Axis:
    """Return the axis that a map's section ``[axis]`` describes.

    Raises ValueError for another key, and as `Axis`.

    >>> axis_of({"x_scale": "linear"}).x_scale
    'linear'
    """
    for key in section:
        if key not in ("x_scale", "unit"):
            raise ValueError(f"[axis] {key}: allowed x_scale, unit")
    return Axis(**section, peak_to_peak="unit" not in section)


VOLTS = Axis()
"""Drive levels, volts peak-to-peak."""
