"""Axes with round ticks: of levels, and of other values; the widths of texts in em."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from analysis.axis import Axis

    Floats = NDArray[np.float64]

SMALL: Final = 0.833
"""Size of the letters of ticks and legends, in em."""
BLANK: Final = "blank"
_MAX_LEVEL_TICKS: Final = 9
_LEVEL_MARGIN: Final = 0.06
_VALUE_MARGIN: Final = 0.07
_MIN_TICKS, _MAX_TICKS = 3, 6
_LOG_TICKS_FROM_RATIO: Final = 8.0


def figure_of(axes: Axes) -> Figure:
    """Return the figure of axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    return figure


def em_inches() -> float:
    """Return the letter size of the style in use."""
    import matplotlib as mpl

    return float(mpl.rcParams["font.size"]) / 72


@cache
def text_em(text: str, size: float = SMALL) -> float:
    """Return the width of a text in em."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    measure: Any = text_to_path.get_text_width_height_descent
    font = FontProperties(size=100)
    widths = [float(measure(line, font, ismath=False)[0]) for line in text.split("\n")]
    return size * max(widths) / 100


def value_axis(axes: Axes, values: Any, *, log: bool) -> None:
    """Make an x axis that holds all finite values, with round ticks."""
    low, high, ticks = scale_of(values, log=log)
    axes.set(xscale="log" if log else "linear", xlim=(low, high))
    _set_ticks(axes, ticks, log=log)


def scale_of(values: Any, *, log: bool = False, intervals: int = 5) -> tuple[float, float, Floats]:
    """Return the ends of an axis that holds all finite values, and round ticks between them."""
    ends = np.asarray(values, dtype=np.float64)
    ends = np.log(ends[np.isfinite(ends)]) if log else ends[np.isfinite(ends)]
    margin = _VALUE_MARGIN * np.ptp(ends) or (0.1 if log else 1.0)
    limits = np.array([ends.min() - margin, ends.max() + margin])
    low, high = (float(end) for end in (np.exp(limits) if log else limits))
    return low, high, round_ticks(low, high, log=log, intervals=intervals)


def level_ticks(levels: Any, *, log: bool) -> Floats:
    """Return the levels if there are few of them, else round numbers between them."""
    # Rounding errors make no other level.
    values = np.unique([float(f"{level:.10g}") for level in np.asarray(levels, dtype=np.float64)])
    few = len(values) <= _MAX_LEVEL_TICKS
    return values if few else round_ticks(values[0], values[-1], log=log)


def level_axis(axes: Axes, levels: Any, axis: Axis, *, with_blank: bool = False) -> float:
    """Make the x axis one of levels and return where blank trials stand, left of all levels."""
    log = not axis.signed
    ticks, ends = level_ticks(levels, log=log), np.array([np.min(levels), np.max(levels)])
    first, last = np.log(ends) if log else ends
    span = (last - first) or (0.2 if log else 1.0)
    # The label below blank trials must not touch that of the lowest level.
    gap_em = (text_em(BLANK) + text_em(alike_labels(ticks)[0])) / 2 + 0.5
    room_em = max(axes_em(axes) - gap_em, gap_em)
    margin, gap = _LEVEL_MARGIN * span, (1 + 2 * _LEVEL_MARGIN) * span * gap_em / room_em
    places = first - margin - gap * with_blank, first - gap, first - margin, last + margin
    left, blank, lowest, right = (float(np.exp(each)) if log else each for each in places)
    axes.set(xscale="log" if log else "linear", xlim=(left, right))
    _set_ticks(axes, ticks, log=log, blank=blank if with_blank else None)
    if with_blank:
        axes.spines["bottom"].set_bounds(lowest, right)
    return blank


def level_label(axis: Axis) -> str:
    """Return the name of an axis of levels.

    >>> from analysis import Axis
    >>> level_label(Axis()), level_label(Axis(x_scale="linear", unit="cm/s"))
    ('Drive level (V peak-to-peak)', 'Level (cm/s)')
    """
    return f"{'Drive level' if axis.is_vpp else 'Level'} ({axis.label})"


def _set_ticks(axes: Axes, ticks: Floats, *, log: bool, blank: float | None = None) -> None:
    """Set ticks, all to the same decimals; those have labels whose labels have room."""
    labels = alike_labels(ticks)
    ends = np.array([*axes.get_xlim(), *ticks])
    ends = np.log(ends) if log else ends
    at = axes_em(axes) * (ends[2:] - ends[0]) / (ends[1] - ends[0])
    half = [text_em(label) / 2 + 0.25 for label in labels]
    # Zero and the highest level have a label even where others have no room.
    placed: list[int] = []
    for i in sorted(range(len(ticks)), key=lambda i: (ticks[i] != 0, -i)):
        if any(abs(at[i] - at[j]) < half[i] + half[j] for j in placed):
            labels[i] = ""
        else:
            placed.append(i)
    places = [*ticks] if blank is None else [blank, *ticks]
    axes.set_xticks(places, [BLANK, *labels][-len(places) :])
    axes.minorticks_off()


def axes_em(axes: Axes) -> float:
    """Return the width of axes in em."""
    figure = figure_of(axes)
    return float(axes.get_position().width * figure.get_figwidth() / em_inches())


def round_ticks(low: float, high: float, *, log: bool, intervals: int = 5) -> Floats:
    """Return round numbers from `low` to `high`, on a logarithmic axis of a wide range by ratios.

    There are at least three of them where the numbers allow it, else they show no scale.

    >>> round_ticks(0.9, 220.0, log=True).tolist(), round_ticks(44.0, 104.0, log=True).tolist()
    ([1.0, 3.0, 10.0, 30.0, 100.0], [60.0, 80.0, 100.0])
    """
    from matplotlib.ticker import LogLocator, MaxNLocator

    by_ratios = log and high / low > _LOG_TICKS_FROM_RATIO
    locators = (
        [LogLocator(subs=subs, numticks=_MAX_TICKS) for subs in ((1, 2, 5), (1, 3), (1,))]
        if by_ratios
        else [MaxNLocator(number, steps=[1, 2, 2.5, 5, 10]) for number in range(intervals, 10)]
    )
    margin = 1e-9 * (high - low)
    for locator in locators:
        ticks = np.asarray(locator.tick_values(low, high), dtype=np.float64)
        ticks = ticks[(ticks >= low - margin) & (ticks <= high + margin)]
        if _MIN_TICKS <= len(ticks) <= _MAX_TICKS:
            break
    return ticks


def alike_labels(values: Any) -> list[str]:
    """Write numbers with the same decimals, as few as keep each to a thousandth of itself.

    >>> alike_labels([0.0, 0.25, 1.0]), alike_labels([-0.5, 60]), alike_labels([42, 59, 83])
    (['0.00', '0.25', '1.00'], ['−0.5', '60.0'], ['42', '59', '83'])
    """
    numbers = np.asarray(values, dtype=np.float64)
    for decimals in range(7):
        if (np.abs(numbers.round(decimals) - numbers) <= 1e-3 * np.abs(numbers)).all():
            break
    form = f".{decimals}f" if decimals < 6 else ".3g"  # noqa: PLR2004 - longer labels touch
    return [f"{number:{form}}".replace("-", "−") for number in numbers]
