"""Thresholds of participants and group with their intervals, and differences of conditions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.numbers import TOTAL
from analysis.results.figures.curves import ABOVE, BELOW, by_threshold, conditions_of
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    GREY,
    axes_em,
    em_mm,
    look,
    name_axes,
    new_region,
    round_ticks,
    set_ticks,
    short,
    text_em,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


_MAX_NAMED: Final = 60
_MAX_PAIRS: Final = 6
_ROW_EM: Final = 1.25
_UNNAMED_ROW_EM: Final = 0.3
_NEXT_CONDITION: Final = 0.6
"""Between rows of one participant, in parts of a row."""
_BEFORE_GROUP: Final = 0.4
_FAINT: Final = 0.35


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """A row of a panel: a value with its limits; an infinite limit is open, NaN is none."""

    label: str
    height: float  # of its row, from the top
    value: float
    low: float
    high: float
    index: int  # of its condition
    status: str = "ok"
    is_group: bool = False
    next_low: float = np.nan  # where another participant's is expected
    next_high: float = np.nan


def plot_thresholds(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw the threshold of each participant and of the group, and differences of conditions.

    Participants are sorted by threshold. Differences of two conditions stand beside the thresholds,
    those of more conditions below them, of the group only.

    Parameters
    ----------
    analysis : Analysis
        From `write_analysis` or `analyse`.
    ax : matplotlib.axes.Axes, optional
        Which the panels replace; a new figure by default.
    style : Style
        Width and style sheet of a new figure.

    Returns
    -------
    matplotlib.figure.Figure
        The figure that was drawn into.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from analysis import ColumnMap, analyse, plot_thresholds, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response,rt_s\n" + (
    ...         "1,left,60,none,0.6\n1,left,60,left,0.5\n1,left,90,left,0.4\n"
    ...         "1,left,40,none,0.7\n1,none,0,none,0.6\n") * 9)
    ...     result = analyse(read_inputs([table], ColumnMap()))
    >>> plot_thresholds(result).axes[0].get_xlabel()
    'Threshold (V peak-to-peak)'
    """
    rows = threshold_rows(analysis)
    pairs = analysis.differences[["condition_a", "condition_b"]].drop_duplicates()
    beside = len(pairs) == 1
    below = _pair_rows(analysis) if 1 < len(pairs) <= _MAX_PAIRS else []
    unit = "dB" if analysis.axis.is_logarithmic else analysis.axis.unit
    with style.applied(ax):
        named = analysis.thresholds["participant"].nunique() <= _MAX_NAMED
        shown = [row for row in rows if named or row.is_group]
        left_em = max(text_em(row.label) for row in [*shown, *below]) + (0.9 if named else 2.2)
        height_em = (_ROW_EM if named else _UNNAMED_ROW_EM) * (rows[-1].height + 1.2)
        below_em, gap_em = _ROW_EM * len(below), 3.6 if below else 0.0
        bottom_em = 4.6 if beside else 3.4
        region = new_region(
            style,
            (height_em + below_em + gap_em + bottom_em + 0.6) * em_mm(),
            (left_em, bottom_em, 0.9, 0.6),
            ax=ax,
            note=analysis.mark,
        )
        if beside:
            main, second = region.split(1, 2, (1.4, 0), width_ratios=(1.45, 1), sharey=True)
            a, b = (short(str(pairs.iloc[0][name])) for name in ("condition_a", "condition_b"))
            _draw_differences(second, _difference_rows(analysis, rows))
            label = f"{b}\n\N{MINUS SIGN} {a} ({unit})"
            # The caption has the names, too.
            has_room = text_em(label, 1.0) <= axes_em(second) + 1.0
            name_axes(second, label if has_room else f"\N{GREEK CAPITAL LETTER DELTA} ({unit})", "")
            second.tick_params(axis="y", length=0)
        elif below:
            ratios = (height_em, below_em)
            main, second = region.split(2, 1, (0, gap_em), height_ratios=ratios)
            _draw_differences(second, below)
            name_axes(second, f"Difference of the group ({unit})", "")
            _name_rows(second, below, below)
        else:
            main = region.axes()
        _draw_thresholds(main, rows, analysis)
        people = "" if named else f"{analysis.thresholds['participant'].nunique()} participants"
        name_axes(main, f"Threshold ({analysis.axis.label})", people, left_em - 2.2)
        _name_rows(main, rows, shown)
    return region.figure


def threshold_rows(analysis: Analysis) -> list[Interval]:
    """Return the rows of the panel: participants by threshold, then the group, by condition."""
    conditions, rows, height = conditions_of(analysis), [], 0.0
    table: Any = analysis.thresholds.set_index(["participant", "condition"])
    for name in by_threshold(analysis):
        tested = [index for index, one in enumerate(conditions) if (name, one) in table.index]
        for order, index in enumerate(tested):
            label = short(name) if order == 0 else ""
            rows.append(_interval(table.loc[(name, conditions[index])], label, height, index))
            height += _NEXT_CONDITION if order < len(tested) - 1 else 1.0
    is_named = analysis.thresholds["participant"].nunique() <= _MAX_NAMED
    group_row = 1.0 if is_named else _ROW_EM / _UNNAMED_ROW_EM
    height += (_BEFORE_GROUP if is_named else 0.5) * group_row
    for index, condition in enumerate(conditions):
        row: Any = analysis.groups[analysis.groups["condition"].eq(condition)].iloc[0]
        if row["participants"] > 1 or len(conditions) > 1:
            label = short(condition) if len(conditions) > 1 else "group"
            rows.append(_interval(row, label, height, index, is_group=True))
            height += group_row
    return rows


def _interval(
    row: pd.Series[Any], label: str, height: float, index: int, *, is_group: bool = False
) -> Interval:
    value, low, high, next_low, next_high = (
        float(row.get(f"{name}_vpp", np.nan))
        for name in ("threshold", "threshold_low", "threshold_high", "new_low", "new_high")
    )
    if np.isfinite(value) or row["status"] in (*BELOW, *ABOVE):
        low, high = _opened(low, high)
    if "new_low_vpp" in row.index and row["participants"] > 1 and np.isfinite(value):
        next_low, next_high = _opened(next_low, next_high)
    return Interval(
        label=label,
        height=height,
        value=value,
        low=low,
        high=high,
        index=index,
        status=str(row["status"]),
        is_group=is_group,
        next_low=next_low,
        next_high=next_high,
    )


def _opened(low: float, high: float) -> tuple[float, float]:
    """Return limits of which those that a table calls n/a are open."""
    return (-np.inf if np.isnan(low) else low), (np.inf if np.isnan(high) else high)


def _difference(row: pd.Series[Any], label: str, height: float, *, is_group: bool) -> Interval:
    value, low, high = (float(row[f"{name}_db"]) for name in ("difference", "low", "high"))
    if np.isfinite([value, low, high]).any():
        low, high = _opened(low, high)
    return Interval(
        label=label, height=height, value=value, low=low, high=high, index=-1, is_group=is_group
    )


def _difference_rows(analysis: Analysis, rows: list[Interval]) -> list[Interval]:
    """Return the differences of two conditions at the heights of the thresholds beside them."""
    table: Any = analysis.differences.set_index("participant")
    labelled = [row for row in rows if row.label and not row.is_group]
    drawn = [
        _difference(table.loc[name], "", row.height + _NEXT_CONDITION / 2, is_group=False)
        for name, row in zip(by_threshold(analysis), labelled, strict=True)
        if name in table.index
    ]
    if len(drawn) != 1:
        height = float(np.mean([row.height for row in rows if row.is_group]))
        drawn.append(_difference(table.loc[TOTAL], "", height, is_group=True))
    return drawn


def _pair_rows(analysis: Analysis) -> list[Interval]:
    """Return the differences of the group, of every two conditions."""
    rows = analysis.differences[analysis.differences["participant"].eq(TOTAL)]
    pairs = zip(rows["condition_b"], rows["condition_a"], strict=True)
    labels = [f"{short(str(b))} \N{MINUS SIGN} {short(str(a))}" for b, a in pairs]
    return [
        _difference(row, label, height, is_group=True)
        for height, (label, (_, row)) in enumerate(zip(labels, rows.iterrows(), strict=True))
    ]


def _draw_thresholds(axes: Axes, rows: list[Interval], analysis: Analysis) -> None:
    """Draw the rows on an axis that holds the thresholds and their limits."""
    log = not analysis.axis.signed
    if log:
        axes.set_xscale("log")
    levels = analysis.levels["level_vpp"].to_numpy(dtype=np.float64)
    ends = [end for row in rows for end in (row.value, row.low, row.high) if np.isfinite(end)]
    # Of a further participant's interval only what lies within the tested levels is shown.
    further = [end for row in rows for end in (row.next_low, row.next_high) if not np.isnan(end)]
    ends += [*np.clip(further, levels.min(), levels.max())]
    ends += [levels.min()] if any(row.status in BELOW for row in rows) else []
    ends += [levels.max()] if any(row.status in ABOVE for row in rows) else []
    _set_limits(axes, ends or [*levels], log=log)
    _draw_rows(axes, rows)


def _draw_differences(axes: Axes, rows: list[Interval]) -> None:
    """Draw differences on an axis that holds them and 0."""
    ends = [end for row in rows for end in (row.value, row.low, row.high) if np.isfinite(end)]
    _set_limits(axes, [*ends, 0.0], log=False)
    axes.axvline(0, color=GREY, lw=0.6, zorder=1)
    _draw_rows(axes, rows)


def _set_limits(axes: Axes, ends: list[float], *, log: bool) -> None:
    at = np.log(ends) if log else np.array(ends)
    margin = 0.07 * float(np.ptp(at)) or (0.1 if log else 1.0)
    limits = np.array([at.min() - margin, at.max() + margin])
    axes.set_xlim(*(np.exp(limits) if log else limits))
    set_ticks(axes, round_ticks(*axes.get_xlim(), log=log), log=log)


def _draw_rows(axes: Axes, rows: list[Interval]) -> None:
    """Draw values with their limits; an arrow stands at an end that is open or outside the axis.

    What looks alike is drawn in one call: a call for each of a thousand people takes seconds.
    """
    from matplotlib.markers import CARETLEFT, CARETRIGHT

    left, right = axes.get_xlim()
    alike: dict[tuple[int, bool], list[Interval]] = {}
    for row in rows:
        alike.setdefault((row.index, row.is_group), []).append(row)
    for (index, is_group), members in alike.items():
        colour, marker, _ = look(index) if index >= 0 else ("black", "o", "-")
        heights, values, lows, highs, next_lows, next_highs = np.transpose(
            [(m.height, m.value, m.low, m.high, m.next_low, m.next_high) for m in members]
        )
        for first, last, width, alpha in (
            (next_lows, next_highs, 0.9, _FAINT),
            (lows, highs, 2.0 if is_group else 1.0, 1.0),
        ):
            ends = np.clip(first, left, right), np.clip(last, left, right)
            axes.hlines(heights, *ends, color=colour, lw=width, alpha=alpha, zorder=2)
            # The tip of these markers is at the point, so that no arrow leaves the axes.
            arrows = (CARETLEFT, left, first < left), (CARETRIGHT, right, last > right)
            for sign, end, is_open in arrows:
                if is_open.any():
                    axes.plot(
                        np.full(is_open.sum(), end),
                        heights[is_open],
                        color=colour,
                        marker=sign,
                        ms=4,
                        mew=0,
                        ls="",
                        alpha=alpha,
                        clip_on=False,
                    )
        separated = np.array([row.status == "separated" for row in members])
        for chosen, filled in ((~separated, colour), (separated, "white")):
            if chosen.any():
                axes.plot(
                    values[chosen],
                    heights[chosen],
                    color=colour,
                    marker=marker,
                    mfc=filled,
                    ms=5 if is_group else 3.4,
                    mew=0.8,
                    ls="",
                    zorder=3,
                )
        for row in members:
            if np.isnan([row.value, row.low, row.high]).all() and len(rows) <= _MAX_NAMED:
                axes.annotate(
                    f"none: {row.status.replace('_', ' ')}" if row.status != "ok" else "none",
                    (0.02, row.height),
                    xycoords=("axes fraction", "data"),
                    va="center",
                    fontsize="small",
                    color=GREY,
                )


def _name_rows(axes: Axes, rows: list[Interval], shown: list[Interval]) -> None:
    """Name the shown rows at the left, those of conditions in their colour; the first is on top."""
    axes.set_ylim(rows[-1].height + 0.6, -0.6)
    named = [row for row in shown if row.label]
    axes.set_yticks([row.height for row in named], [row.label for row in named])
    axes.tick_params(axis="y", length=0)
    for row, label in zip(named, axes.get_yticklabels(), strict=True):
        if row.is_group and row.index >= 0:
            label.set_color(look(row.index)[0])
