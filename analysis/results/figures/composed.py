"""A panel of psychometric functions: data and functions, thresholds below, residuals at the foot.

All three share one axis of levels and one upright scale, on which thresholds and residuals have
their places below 0: one matplotlib axes each keeps forty people quick to draw.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.results.figures.drawing import COLOURS, GROUP, level_axis, plain

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.groups.functions import Function

    Floats = NDArray[np.float64]


LOOKS: Final = (
    (GROUP, "o", "-"),
    (COLOURS[3], "s", "--"),
    (COLOURS[2], "^", "-."),
    (COLOURS[4], "D", ":"),
    ("black", "v", (0, (6, 1, 1, 1, 1, 1))),
    (COLOURS[0], "P", (0, (3, 2))),
)
"""Colour, marker and line of each condition: no two are told apart by colour alone."""

BELOW: Final = ("threshold_below_levels", "median_below_levels")
ABOVE: Final = ("threshold_above_levels", "median_above_levels")
_FIRST_ROW, _ROW = 0.15, 0.11
_TO_RESIDUALS, _RESIDUALS = 0.34, 0.2
_TOP = 1.06
_FEW = 2
START: Final = 0.03
"""Where along the axes guess rates stand, which have no level."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A threshold as it is drawn: a value with limits, of which an end may be open, or words."""

    at: float  # NaN where there is none
    low: float  # -inf and inf are open ends; NaN where nothing is known
    high: float
    status: str
    new: tuple[float, float] | None = None  # where another person's is expected


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residuals:
    """What the data have more than the function; bars where they are known."""

    level_vpp: Floats
    value: Floats
    low: Floats | None = None
    high: Floats | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """One condition in a panel."""

    look: tuple[str, str, Any]
    level_vpp: Floats
    p: Floats
    low: Floats
    high: Floats
    size: Floats  # of each marker, 1 for the largest
    mark: Mark
    start: tuple[float, float, float] | None = None  # guess rate of blank trials, its limits or NaN
    function: Function | None = None
    residuals: Residuals | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """What a residual of so much is, and the ticks of residuals."""

    most: float
    ticks: tuple[float, ...]
    name: str


DEVIANCE: Final = Scale(most=3.5, ticks=(-2.0, 0.0, 2.0), name="Deviance\nresidual")
PROBABILITY: Final = Scale(most=0.2, ticks=(-0.1, 0.0, 0.1), name="Mean −\nfunction")
_COARSE: Final = Scale(most=0.5, ticks=(-0.4, 0.0, 0.4), name=PROBABILITY.name)


def of_means(curves: Iterable[Curve]) -> Scale:
    """Return the scale of residuals of means that holds their intervals."""
    found = [one.residuals for one in curves if one.residuals is not None]
    ends = [end for one in found for end in (one.low, one.high) if end is not None]
    widest = max((float(np.abs(end).max(initial=0)) for end in ends), default=0.0)
    return PROBABILITY if widest <= PROBABILITY.most else _COARSE


@dataclass(frozen=True, slots=True, kw_only=True)
class _Foot:
    """Where residuals stand: the height of 0, and of a unit."""

    zero: float
    per_unit: float
    most: float

    def at(self, value: Floats) -> Floats:
        """Return the heights of residuals; one beyond the strip is at its edge."""
        return self.zero + self.per_unit * np.clip(value, -self.most, self.most)


def draw_panel(
    axes: Axes,
    curves: Sequence[Curve | None],
    levels_vpp: Floats,
    axis: Axis,
    scale: Scale,
    *,
    small: bool = False,
) -> None:
    """Draw conditions over each other, `None` where one is absent; `small`: one of many panels."""
    zero = -_FIRST_ROW - _ROW * (len(curves) - 1) - _TO_RESIDUALS
    foot = _Foot(zero=zero, per_unit=_RESIDUALS / scale.most, most=scale.most)
    level_axis(axes, levels_vpp, axis, beyond=0.09, letter=1 / 15 if small else 1 / 32)
    axes.set_ylim(zero - _RESIDUALS * 1.15, _TOP)
    shown = (0.0, 0.5, 1.0) if small else (0.0, 0.25, 0.5, 0.75, 1.0)
    places = [*foot.at(np.array(scale.ticks)), *shown]
    axes.set_yticks(
        places, [plain(one) for one in (*scale.ticks, *shown)], fontsize=8 if small else 9
    )
    axes.axhline(zero, color="#808080", lw=0.8, zorder=1)
    axes.spines["left"].set_bounds(0, 1)
    wide = 1.0 if small else 1.4
    for place, curve in enumerate(curves):
        if curve is None:
            continue
        aside = beside(axes, place, len(curves), 2.5 if small else 4.0)
        _draw_function(axes, curve, wide, 0.2 if len(curves) <= _FEW else 0.1)
        _draw_data(axes, curve, aside, wide, largest=4.0 if small else 6.5)
        if curve.start is not None:
            edge = beside(axes, place, len(curves), 2.5 if small else 4.0, edge=True)
            _draw_start(axes, curve.start, curve.look, edge, wide)
        _draw_mark(axes, curve, -_FIRST_ROW - _ROW * place, wide)
        if curve.residuals is not None:
            _draw_residuals(axes, curve.residuals, curve.look, (aside, wide), foot)


def beside(axes: Axes, place: int, of: int, points: float = 4.0, *, edge: bool = False) -> Any:
    """Return where a condition is drawn beside the others, so that none covers another.

    At the left `edge` places along are fractions of the axes, not levels.
    """
    from matplotlib.transforms import ScaledTranslation

    figure = axes.get_figure(root=True)
    assert figure is not None
    shift_in = (place - (of - 1) / 2) * points / 72
    along = axes.get_yaxis_transform() if edge else axes.transData
    return along + ScaledTranslation(shift_in, 0, figure.dpi_scale_trans)


def _draw_function(axes: Axes, curve: Curve, wide: float, shade: float) -> None:
    if curve.function is None:
        return
    one = curve.function
    colour, _, line = curve.look
    axes.fill_between(one.level_vpp, one.low, one.high, color=colour, alpha=shade, lw=0, zorder=1)
    axes.plot(one.level_vpp, one.at(one.level_vpp), color=colour, ls=line, lw=wide, zorder=3)


def _draw_data(axes: Axes, curve: Curve, aside: Any, wide: float, *, largest: float) -> None:
    colour, marker, _ = curve.look
    told = np.isfinite(curve.low)
    axes.vlines(
        curve.level_vpp[told],
        curve.low[told],
        curve.high[told],
        color=colour,
        lw=0.8 * wide,
        transform=aside,
        zorder=4,
    )
    axes.scatter(
        curve.level_vpp,
        curve.p,
        s=(largest * curve.size) ** 2,
        marker=marker,
        facecolors="white",
        edgecolors=colour,
        linewidths=wide,
        transform=aside,
        zorder=5,
    )


def _draw_start(
    axes: Axes,
    start: tuple[float, float, float],
    look: tuple[str, str, Any],
    edge: Any,
    wide: float,
) -> None:
    """Draw the guess rate filled, left of all levels: no level is 0 on a logarithmic axis."""
    (colour, marker, _), (rate, low, high) = look, start
    axes.vlines(START, low, high, color=colour, lw=0.8 * wide, transform=edge, zorder=4)
    axes.plot(START, rate, color=colour, marker=marker, ms=3 * wide, transform=edge, zorder=5)


def _draw_mark(axes: Axes, curve: Curve, place: float, wide: float) -> None:
    """Draw a threshold; an arrow stands where a limit is open or the threshold lies outside."""
    colour, marker, _ = curve.look
    one = curve.mark
    if one.new is not None:
        _draw_limits(axes, one.new, place, colour, wide / 2)
    if np.isfinite(one.at) or one.status in (*BELOW, *ABOVE):
        _draw_limits(axes, (one.low, one.high), place, colour, wide)
    elif not np.isfinite(one.at):
        axes.annotate(
            "no threshold",
            (0.5, place),
            xycoords=("axes fraction", "data"),
            ha="center",
            va="center",
            fontsize=8,
            color=colour,
        )
    if np.isfinite(one.at):
        axes.plot(
            one.at, place, color=colour, marker=marker, mfc="white", mew=wide, ms=4 * wide, zorder=5
        )
        if curve.function is not None:
            felt = float(curve.function.at(np.array(one.at)))
            axes.plot([one.at] * 2, [place, felt], color=colour, lw=0.7 * wide, ls=":", zorder=2)


def _draw_limits(
    axes: Axes, limits: tuple[float, float], place: float, colour: str, wide: float
) -> None:
    """Draw an interval; at an open end it runs to the edge, with an arrow."""
    at = np.clip(limits, *axes.get_xlim())
    axes.hlines(place, *at, color=colour, lw=2.6 * wide, zorder=3)
    for end, limit, tip in zip(at, limits, "<>", strict=True):
        closed = np.isfinite(limit)
        axes.plot(
            end,
            place,
            color=colour,
            marker="|" if closed else tip,
            zorder=4,
            ms=(5.5 if closed else 4.5) * wide,
            mew=wide,
            clip_on=False,
        )


def _draw_residuals(
    axes: Axes, one: Residuals, look: tuple[str, str, Any], drawn: tuple[Any, float], foot: _Foot
) -> None:
    """Draw residuals; one that is too large for its strip is an arrow at its edge."""
    (colour, marker, _), (aside, wide) = look, drawn
    if one.low is not None and one.high is not None:
        axes.vlines(
            one.level_vpp,
            foot.at(one.low),
            foot.at(one.high),
            color=colour,
            lw=0.8 * wide,
            transform=aside,
            zorder=3,
        )
    for chosen, sign in (
        (np.abs(one.value) <= foot.most, marker),
        (one.value > foot.most, "^"),
        (one.value < -foot.most, "v"),
    ):
        if chosen.any():
            axes.plot(
                one.level_vpp[chosen],
                foot.at(one.value[chosen]),
                color=colour,
                marker=sign,
                ms=2.6 * wide,
                ls="",
                mfc="white",
                mew=0.8 * wide,
                transform=aside,
                zorder=4,
            )


def name_parts(axes: Axes, conditions: int, scale: Scale, *, small: bool = False) -> None:
    """Name the parts of a panel beside its left edge."""
    zero = -_FIRST_ROW - _ROW * (conditions - 1) - _TO_RESIDUALS
    thresholds = -_FIRST_ROW - _ROW * (conditions - 1) / 2
    size, aside_pt = (8, -30) if small else (9, -42)
    detection = (
        "Detection\nprobability" if small else "Detection probability\n(detected / presented)"
    )
    for place, words, turned in (
        (0.5, detection, True),
        (zero, scale.name, True),
        (thresholds, "Threshold", False),
    ):
        axes.annotate(
            words,
            (0, place),
            xycoords=("axes fraction", "data"),
            xytext=(aside_pt if turned else -5, 0),
            textcoords="offset points",
            rotation=90 if turned else 0,
            ha="center" if turned else "right",
            va="center",
            fontsize=size if turned else 8,
            linespacing=1.1,
        )
