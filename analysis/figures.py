"""Detection probability against level, as PNG and SVG with the same bytes on every run."""

from __future__ import annotations

import io
import math
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = ("detection.png", "detection.svg")

# Okabe & Ito's colours for all kinds of colour vision; yellow is too light for a thin line.
_COLOURS = ("#E69F00", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#999999")
_MARKERS = ("o", "s", "^", "D", "v", "P")
_GROUP, _MANY = "#0072B2", "#8A8A8A"
_PANEL_IN = (5.6, 4.2)
_PER_ROW = 3
_CLOSEST_TICKS = 0.08
_LEAST_MARGIN = 1.001
_STYLE: Any = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "tactstrip",
    "text.parse_math": False,
    "figure.dpi": 100.0,
    "savefig.dpi": 150.0,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DetectionData:
    """What the figure shows.

    Attributes
    ----------
    levels : pandas.DataFrame
        From `analysis.level_table`, at least one row.
    participants : pandas.DataFrame
        From `analysis.detection.participant_table`.
    forced_choice : bool
        Whether "none" could not be answered, so that who feels nothing guesses a side.
    ci : str
        Name of the cells' interval.
    note : str
        A remark for the title, such as that participants are simulated; may be empty.
    """

    levels: pd.DataFrame
    participants: pd.DataFrame
    forced_choice: bool
    ci: str
    note: str = ""


def render(data: DetectionData) -> tuple[bytes, bytes]:
    """Draw the figure; return it as PNG and as SVG, the contents of `NAMES`.

    Each participant is a thin line. Where everybody was tested at a level, the unweighted mean
    stands on a thick line with the group interval; a single participant has the interval of each
    cell. One panel per condition.

    Parameters
    ----------
    data : DetectionData
        What to show.

    Returns
    -------
    png, svg : bytes
        The same on every run.
    """
    import matplotlib as mpl

    with mpl.rc_context(), warnings.catch_warnings():
        # A letter that the font lacks, or names too long for the panel, are no reason to stop.
        warnings.simplefilter("ignore", UserWarning)
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        figure = _figure(data)
        png, svg = io.BytesIO(), io.BytesIO()
        figure.savefig(png, format="png")
        figure.savefig(svg, format="svg", metadata={"Date": None})
    return png.getvalue(), svg.getvalue()


def _figure(data: DetectionData) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    conditions = list(data.levels["condition"].unique())
    across = min(len(conditions), _PER_ROW)
    down = math.ceil(len(conditions) / across)
    figure = Figure(figsize=(_PANEL_IN[0] * across, _PANEL_IN[1] * down), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(down, across, squeeze=False, sharey=True).ravel()
    for panel, condition in zip(panels, conditions, strict=False):
        _draw(panel, data, condition)
        if len(conditions) > 1:
            panel.set_title(f"condition {condition}")
    for panel in panels[len(conditions) :]:
        panel.set_axis_off()
    for panel in panels[::across]:
        panel.set_ylabel("Detection probability (detected / presented)")
    if data.note:
        figure.suptitle(data.note)
    return figure


def _draw(axes: Axes, data: DetectionData, condition: str) -> None:
    levels = data.levels[data.levels["condition"].eq(condition)]
    people = data.participants[data.participants["condition"].eq(condition)]
    everybody = sorted(data.participants["participant"].unique())
    few = len(everybody) <= len(_COLOURS)
    if few:
        _draw_few(axes, people, everybody)
    else:
        _draw_many(axes, people)
    if len(people["participant"].unique()) == 1:
        limits = people[["level_vpp", "low", "high"]]
        _draw_interval(axes, limits, f"95 % interval ({data.ci.title()})", colour="black", zorder=2)
    else:
        _draw_group(axes, _shared(levels, people), few=few)
    if data.forced_choice:
        axes.axhline(0.5, color="black", lw=0.8, ls=(0, (4, 3)), zorder=1)
        axes.annotate(
            "guessing left or right: 1/2", (1, 0.5), xycoords=("axes fraction", "data"),
            xytext=(-4, -3), textcoords="offset points", ha="right", va="top", fontsize=8,
        )  # fmt: skip
    _dress(axes, levels["level_vpp"].to_numpy())
    axes.legend(loc="best", fontsize=8, frameon=True, framealpha=0.9, edgecolor="none")


def _draw_few(axes: Axes, people: pd.DataFrame, everybody: list[str]) -> None:
    """Draw each participant in a colour and a marker that are the same in every panel."""
    for name, colour, marker in zip(everybody, _COLOURS, _MARKERS, strict=False):
        one = people[people["participant"].eq(name)]
        if len(one):
            axes.plot(
                one["level_vpp"], one["p"], color=colour, marker=marker, lw=1.0, ms=4, zorder=3,
                label=f"participant {name}",
            )  # fmt: skip


def _draw_many(axes: Axes, people: pd.DataFrame) -> None:
    label: str | None = f"each of {people['participant'].nunique()} participants"
    for _, one in people.groupby("participant"):
        axes.plot(
            one["level_vpp"], one["p"], color=_MANY, marker="o", lw=0.8, ms=2, alpha=0.6, zorder=2,
            label=label,
        )  # fmt: skip
        label = None


def _shared(levels: pd.DataFrame, people: pd.DataFrame) -> pd.DataFrame:
    """Keep the levels that everybody was tested at: only these means are of the same people."""
    tested = people.groupby("level_vpp")["participant"].nunique()
    everywhere = tested.index[tested.eq(people["participant"].nunique())]
    return levels[levels["level_vpp"].isin(everywhere)]


def _draw_group(axes: Axes, levels: pd.DataFrame, *, few: bool) -> None:
    if levels.empty:
        axes.plot([], [], ls="", label="no level was given to everybody:\nno mean of participants")
        return
    zorder = 2 if few else 4
    limits = levels[["level_vpp", "group_low", "group_high"]]
    _draw_interval(axes, limits, "", colour=_GROUP, zorder=zorder)
    axes.plot(
        levels["level_vpp"], levels["p_mean"], color=_GROUP, lw=2.6, marker="o",
        ms=9 if few else 5, mfc="white", mew=2, zorder=zorder,
        label="mean of participants,\n95 % interval of the group",
    )  # fmt: skip


def _draw_interval(
    axes: Axes, limits: pd.DataFrame, label: str, *, colour: str, zorder: int
) -> None:
    """Draw bars with end strokes; the columns are level, lower and upper limit."""
    x, low, high = (limits[name] for name in limits.columns)
    axes.vlines(x, low, high, color=colour, lw=1.6, zorder=zorder, label=label)
    for limit in (low, high):
        axes.plot(x, limit, color=colour, marker="_", ms=9, mew=1.6, ls="", zorder=zorder)


def _dress(axes: Axes, levels_vpp: Any) -> None:
    from matplotlib.ticker import FixedLocator, NullLocator

    axes.set_xscale("log")
    low, high = float(levels_vpp.min()), float(levels_vpp.max())
    margin = max((high / low) ** 0.06, _LEAST_MARGIN)
    axes.set_xlim(low / margin, high * margin)
    ticks = _spaced(np.unique(levels_vpp), high / low * margin**2)
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_ylim(-0.03, 1.03)
    axes.set_yticks([0, 0.25, 0.5, 0.75, 1])
    axes.grid(color="#E5E5E5", lw=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("Level, logarithmic (V peak-to-peak)")


def _spaced(levels_vpp: Any, ratio: float) -> list[float]:
    """Choose the levels that get a tick, so that no label covers its neighbour.

    `ratio` is that of the axis's ends.
    """
    closest = _CLOSEST_TICKS * math.log(ratio)
    ticks: list[float] = []
    for level in levels_vpp:
        if not ticks or math.log(level / ticks[-1]) >= closest:
            ticks.append(float(level))
    return ticks
