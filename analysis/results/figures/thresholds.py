"""Thresholds of participants and group with their intervals, and differences of conditions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.numbers import TOTAL
from analysis.results.figures.axes import axes_em, figure_of, text_em, value_axis
from analysis.results.figures.curves import by_threshold, looks_of
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    GREY,
    Look,
    draw_bars,
    draw_points,
    lay_out,
    name_axes,
)
from analysis.results.rendering import short
from analysis.thresholds.fit import ABOVE, BELOW, BOUNDED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


_MAX_NAMED: Final = 60
_MAX_PAIRS: Final = 6
_ROW_EM, _UNNAMED_ROW_EM, _EDGE_EM = 1.25, 0.3, 0.75
_NEXT_CONDITION, _BEFORE_GROUP = 0.6, 1.4
"""From row to row of one participant, and from the last participant to the group, in rows."""
_FAINT: Final = 0.35
_MAX_TITLE_EM: Final = 7.0
_NO_CONDITION: Final = Look("black", "o")
_MINUS: Final = "\N{MINUS SIGN}"
_VALUES: Final = ["value", "low", "high"]
_PAIR: Final = ["condition_a", "condition_b"]
_NAMES: Final = {
    "threshold_vpp": "value",
    "threshold_low_vpp": "low",
    "threshold_high_vpp": "high",
    "new_low_vpp": "next_low",
    "new_high_vpp": "next_high",
    "difference_db": "value",
    "low_db": "low",
    "high_db": "high",
}
"""The columns of thresholds and of differences, as the rows of a panel name them."""


def plot_thresholds(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw the threshold of each participant and of the group, and differences of conditions.

    Participants are sorted by threshold. Differences between two conditions are drawn to the right
    of the thresholds. With more conditions, only those of the group are drawn, below them.

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
    rows, axis, levels = threshold_rows(analysis), analysis.axis, analysis.levels["level_vpp"]
    differences = _difference_rows(analysis, rows)
    pairs = [*differences.drop_duplicates(_PAIR)["label"]]
    is_beside, below = len(pairs) == 1, pairs if len(pairs) > 1 else []
    is_named = analysis.thresholds["participant"].nunique() <= _MAX_NAMED
    shown = rows if is_named else rows[rows["is_group"]]
    with style.applied(ax):
        tick_em = max(map(text_em, [*shown["label"], *below])) + 0.3
        title = "".join(pairs[:1] * is_beside)
        if text_em(title) > _MAX_TITLE_EM:
            title = title.replace(f" {_MINUS}", f"\n{_MINUS}")
        panels = lay_out(
            style,
            ax,
            rows_em=[rows["height"].max() + 2 * _EDGE_EM, *[_ROW_EM * len(below)] * bool(below)],
            columns=(1.45, 1.0) if is_beside else (1.0,),
            titles=["", title][: 1 + bool(pairs)],
            shared="y" if is_beside else "",
            tick_em=tick_em,
            gap_em=(1.4, 3.6),
            note=analysis.mark,
        )
        # Of a further participant's interval only what lies within the tested levels is shown.
        ends = [*rows[["next_low", "next_high"]].clip(levels.min(), levels.max()).to_numpy().flat]
        ends += [levels.min()] * bool(rows["status"].isin(BELOW).any())
        ends += [levels.max()] * bool(rows["status"].isin(ABOVE).any())
        ends = ends if np.isfinite([*ends, *rows["value"]]).any() else [*levels]
        _draw_rows(panels[0], rows, analysis, ends, log=not axis.signed)
        name_axes(panels[:1], f"{analysis.words['name']} ({axis.label})", "")
        _name_rows(panels[0], shown, analysis)
        for panel in panels[1:]:
            panel.axvline(0, color=GREY, lw=0.6, zorder=1)
            _draw_rows(panel, differences, analysis, [0.0])
            has_room = text_em("Difference (dB)", 1.0) < axes_em(panel) + 1.0
            name_axes([panel], "Difference (dB)" if has_room else "Δ (dB)", "")
            if below:
                _name_rows(panel, differences, analysis)
            panel.tick_params(axis="y", length=0)
    return figure_of(panels[0])


def threshold_rows(analysis: Analysis) -> pd.DataFrame:
    """Return the rows of the panel: participants by threshold, then the group, by condition.

    A row has a label, a height in em below the first, a value with its limits, those of a further
    participant's threshold, and a status. An infinite limit is open; NaN is none.
    """
    several = len(looks_of(analysis)) > 1
    groups = analysis.groups[analysis.groups["participants"].gt(1) | several]
    groups = groups.assign(is_group=True, participant=TOTAL)
    ranks = {name: rank for rank, name in enumerate(by_threshold(analysis))}
    rows = pd.concat([analysis.thresholds.assign(is_group=False), groups], ignore_index=True)
    rows = rows.rename(columns=_NAMES).astype({"is_group": bool})
    rows["rank"] = rows["participant"].map(ranks).mask(rows["is_group"], len(ranks))
    rows = rows.sort_values(["rank", "condition"], kind="stable", ignore_index=True)
    is_first, is_group = rows["rank"].diff().ne(0), rows["is_group"]
    row_em = _ROW_EM if len(ranks) <= _MAX_NAMED else _UNNAMED_ROW_EM
    steps = np.where(is_first, 1.0, _NEXT_CONDITION) * row_em
    steps[is_group] = np.where(is_first, _BEFORE_GROUP, 1.0)[is_group] * _ROW_EM
    labels = rows["participant"].astype(object).where(is_first, "")
    labels = labels.mask(is_group, rows["condition"].astype(object) if several else "group")
    rows = rows.assign(height=steps.cumsum() - steps[0], label=labels.map(short))
    is_known = rows["value"].notna()
    rows = _with_open_ends(rows, "", is_known | rows["status"].isin(BOUNDED))
    return _with_open_ends(rows, "next_", is_known & rows["participants"].gt(1))


def _difference_rows(analysis: Analysis, rows: pd.DataFrame) -> pd.DataFrame:
    """Return differences of two conditions at the heights of the thresholds that they compare.

    Of more conditions there are those of the group, by themselves; of very many, none.
    """
    table = analysis.differences.rename(columns=_NAMES)
    first, second = (table[name].map(short) for name in _PAIR)
    table = table.assign(label=second.str.cat(first, f" {_MINUS} "), condition="", status="ok")
    table = table.assign(is_group=table["participant"].eq(TOTAL), next_low=np.nan, next_high=np.nan)
    table = _with_open_ends(table, "", table[_VALUES].notna().any(axis=1))
    pairs = table[_PAIR].drop_duplicates()
    if len(pairs) > 1:
        table = table[table["is_group"] & (len(pairs) <= _MAX_PAIRS)]
        return table.assign(height=_ROW_EM * np.arange(len(table)))
    if (~table["is_group"]).sum() == 1:  # the difference of one participant is the group's
        table = table[~table["is_group"]]
    heights = rows.groupby("participant")["height"].mean()
    return table.assign(height=table["participant"].map(heights))


def _with_open_ends(rows: pd.DataFrame, prefix: str, has_limits: pd.Series[bool]) -> pd.DataFrame:
    """Return rows whose missing limits are infinite where they have limits, else NaN."""
    ends = {f"{prefix}low": -np.inf, f"{prefix}high": np.inf}
    limits = {name: rows[name].astype(float).fillna(end) for name, end in ends.items()}
    return rows.assign(**{name: limit.where(has_limits) for name, limit in limits.items()})


def _draw_rows(
    axes: Axes, rows: pd.DataFrame, analysis: Analysis, more: list[float], *, log: bool = False
) -> None:
    """Draw values with their limits on an axis that holds them, and more.

    What looks alike is drawn in one call: a call for each of a thousand people takes seconds.
    """
    value_axis(axes, [*rows[_VALUES].to_numpy(float).flat, *more], log=log)
    for (condition, _), alike in rows.groupby(["condition", "is_group"]):
        look, heights = looks_of(analysis).get(str(condition), _NO_CONDITION), alike["height"]
        bars: dict[str, Any] = {"along": "x", "colour": look.colour}
        further = alike["next_low"], alike["next_high"]
        draw_bars(axes, heights, *further, lw=0.9, alpha=_FAINT, **bars)
        lw, size = (2.0, 5.0) if alike["is_group"].all() else (1.0, 3.4)
        draw_bars(axes, heights, alike["low"], alike["high"], lw=lw, **bars)
        for is_open, some in alike.groupby(alike["status"].eq("separated")):
            draw_points(axes, some["value"], some["height"], look, size=size, filled=not is_open)
    missing: Any = rows[rows[_VALUES].isna().all(axis=1)]
    for row in missing.itertuples() if len(rows) <= _MAX_NAMED else ():
        reason = "" if row.status == "ok" else f": {row.status.replace('_', ' ')}"
        across, box = axes.get_yaxis_transform(), {"facecolor": "white", "linewidth": 0, "pad": 0.5}
        style: dict[str, Any] = {"va": "center", "fontsize": "small", "color": GREY, "bbox": box}
        axes.text(0.02, row.height, f"none{reason}", transform=across, **style)


def _name_rows(axes: Axes, rows: pd.DataFrame, analysis: Analysis) -> None:
    """Name rows at the left, those of conditions in their colour; the first is on top."""
    axes.set_ylim(rows["height"].max() + _EDGE_EM, -_EDGE_EM)
    named: Any = rows[rows["label"].ne("")]
    looks = looks_of(analysis)
    axes.set_yticks(named["height"], named["label"])
    axes.tick_params(axis="y", length=0)
    for row, label in zip(named.itertuples(), axes.get_yticklabels(), strict=True):
        if row.is_group and row.condition in looks:
            label.set_color(looks[row.condition].colour)
