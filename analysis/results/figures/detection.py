"""Detection probability against level, with fitted functions: of the group, and of participants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.numbers import rounded, spread_of
from analysis.results.figures.curves import (
    DRAWN,
    blank_rates,
    by_threshold,
    conditions_of,
    group_curves,
    person_curves,
    residual_table,
)
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    GREY,
    MAX_LEGEND_ENTRIES,
    add_legend,
    add_shared_legend,
    alike_labels,
    aside,
    condition_handle,
    em_mm,
    label_outer,
    legend_rows,
    level_axis,
    level_label,
    look,
    name_axes,
    new_region,
    probability_axis,
    short,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.curves import Curve
    from analysis.results.figures.drawing import Style


PEOPLE_PER_PAGE: Final = 12
MAX_PAGES: Final = 4
_MIN_TICK_RESIDUAL: Final = 2.0
_BAND_ALPHA: Final = 0.18
_Y_LABEL: Final = "Proportion detected"
_FAR_RIGHT: Final = 0.7
_NEAR_GUESSING: Final = 0.1


def plot_detection(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw detection probability against level, with the fitted function of each condition.

    Parameters
    ----------
    analysis : Analysis
        From `write_analysis` or `analyse`.
    ax : matplotlib.axes.Axes, optional
        Where to draw, in the style of its figure and without residuals; a new figure by default.
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
    >>> from analysis import ColumnMap, analyse, plot_detection, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response,rt_s\n" + (
    ...         "1,left,60,none,0.6\n1,left,60,left,0.5\n1,left,90,left,0.4\n"
    ...         "1,left,40,none,0.7\n1,none,0,none,0.6\n") * 9)
    ...     result = analyse(read_inputs([table], ColumnMap()))
    >>> plot_detection(result).axes[0].get_ylabel()
    'Proportion detected'
    """
    with style.applied(ax):
        conditions, curves = conditions_of(analysis), group_curves(analysis)
        several = len(conditions) > MAX_LEGEND_ENTRIES and ax is None
        strip = ax is None and has_residuals(analysis)
        handles = [] if several else _legend(analysis, curves)
        margins = (4.6, 3.4, 0.8, 0.8)
        width_em = style.width_mm / em_mm() - margins[0] - margins[2]
        rows_em = 1.2 * legend_rows([str(one.get_label()) for one in handles], width_em)
        height_mm = style.width_mm * (0.92 if strip else 0.74) + em_mm() * rows_em
        columns, rows = (2, -(-len(conditions) // 2)) if several else (1, 1)
        if several:
            height_mm = 0.1 * style.width_mm + rows * 0.44 * style.width_mm
        region = new_region(
            style,
            height_mm,
            (*margins[:3], margins[3] + (1.0 if several else rows_em + 0.2)),
            ax=ax,
            note=analysis.mark,
        )
        if several:
            panels = region.split(rows, columns, (1.2, 2.6), sharex=True, sharey=True)
            for panel, condition in zip(panels, conditions, strict=False):
                _draw_group(panel, analysis, {condition: curves[condition]})
                panel.set_title(short(condition), fontsize="small")
            label_outer(panels, len(conditions), columns, (level_label(analysis.axis), _Y_LABEL))
        elif strip:
            main, foot = region.split(2, 1, (0, 0.8), sharex=True, height_ratios=(4.2, 1))
            _draw_group(main, analysis, curves)
            main.tick_params(axis="x", labelbottom=False, length=0)
            main.spines["bottom"].set_visible(False)
            name_axes(main, "", _Y_LABEL)
            _draw_residuals(foot, analysis)
            name_axes(foot, level_label(analysis.axis), "Residual")
        else:
            main = region.axes()
            _draw_group(main, analysis, curves)
            name_axes(main, level_label(analysis.axis), _Y_LABEL)
        if not several:
            add_legend(main, handles)
    return region.figure


def plot_participants(
    analysis: Analysis,
    ax: Axes | None = None,
    *,
    names: Sequence[str] = (),
    style: Style = DEFAULT_STYLE,
) -> Figure:
    r"""Draw the data and the fitted functions of each participant in a panel, by threshold.

    Parameters
    ----------
    analysis : Analysis
        From `write_analysis` or `analyse`.
    ax : matplotlib.axes.Axes, optional
        Which the panels replace; a new figure by default.
    names : sequence of str
        The participants; by default the first page of them.
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
    >>> from analysis import ColumnMap, analyse, plot_participants, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response,rt_s\n" + (
    ...         "1,left,60,none,0.6\n1,left,60,left,0.5\n1,left,90,left,0.4\n"
    ...         "1,left,40,none,0.7\n1,none,0,none,0.6\n") * 9)
    ...     result = analyse(read_inputs([table], ColumnMap()))
    >>> len(plot_participants(result).axes)
    1
    """
    names = names or pages_of(analysis)[0]
    with style.applied(ax):
        columns = min(len(names), max(2, round(style.width_mm / 29)))
        if len(names) == 4:  # noqa: PLR2004 (two rows of two)
            columns = 2
        rows = -(-len(names) // columns)
        conditions = conditions_of(analysis)
        handles: list[Artist] = []
        if 1 < len(conditions) <= MAX_LEGEND_ENTRIES:
            handles = [condition_handle(index, name) for index, name in enumerate(conditions)]
        labels = [str(handle.get_label()) for handle in handles]
        top_em = 1.9 + 1.2 * legend_rows(labels, style.width_mm / em_mm() - 4.5)
        panel_mm = 0.8 * style.width_mm / columns if columns < 3 else 24  # noqa: PLR2004
        height_mm = rows * (panel_mm + 1.6 * em_mm()) + em_mm() * (3.6 + top_em)
        region = new_region(style, height_mm, (3.9, 3.4, 0.6, top_em), ax=ax, note=analysis.mark)
        panels = region.split(rows, columns, (0.9, 1.9), sharex=True, sharey=True)
        for panel, name in zip(panels, names, strict=False):
            curves = person_curves(analysis, name)
            _draw_functions(panel, analysis, curves, threshold_labels=False)
            panel.set_title(short(name), fontsize="small")
            for condition, curve in curves.items():
                _draw_proportions(panel, curve, conditions.index(condition), len(conditions))
        _finish(panels[0], analysis, small=True)
        label_outer(panels, len(names), columns, (level_label(analysis.axis), _Y_LABEL))
        add_shared_legend(region, handles)
    return region.figure


def has_residuals(analysis: Analysis) -> bool:
    """Return whether the figure of detection has a panel of residuals: with few conditions."""
    fitted = analysis.thresholds["status"].isin(DRAWN).any()
    return bool(fitted) and len(conditions_of(analysis)) <= MAX_LEGEND_ENTRIES


def pages_of(analysis: Analysis) -> list[list[str]]:
    """Return the participants of each page, by threshold.

    Of very many there is one page, of those to look at first: whom a warning names, who has no
    threshold, and whose function fits least.
    """
    names = by_threshold(analysis)
    if len(names) > PEOPLE_PER_PAGE * MAX_PAGES:
        doubtful = {check.participant for check in analysis.checks}
        table = analysis.thresholds.assign(
            clean=~analysis.thresholds["participant"].isin(doubtful),
            fitted=analysis.thresholds["status"].isin((*DRAWN, "separated")),
        )
        table = table.sort_values(["clean", "fitted", "deviance_p"], kind="stable")
        first = {*table["participant"].unique()[:PEOPLE_PER_PAGE]}
        names = [name for name in names if name in first]
    size = PEOPLE_PER_PAGE
    return [names[i : i + size] for i in range(0, len(names), size)]


def _draw_group(axes: Axes, analysis: Analysis, curves: Mapping[str, Curve]) -> None:
    """Draw participants faintly, means and functions of all conditions."""
    conditions = conditions_of(analysis)
    alone = analysis.participants["participant"].nunique() == 1
    blank = _finish(axes, analysis)
    rates = blank_rates(analysis)
    for condition, curve in curves.items():
        index = conditions.index(condition)
        number = len(curves)
        colour, marker, _ = look(index)
        beside = aside(axes, index if number > 1 else 0, number)
        people = analysis.participants[analysis.participants["condition"].eq(condition)]
        starts = rates[rates["condition"].eq(condition)]
        if not alone:
            x = [*people["level_vpp"], *([blank] * len(starts))]
            axes.scatter(
                x,
                [*people["p"], *starts["guess_rate"]],
                s=7,
                marker=marker,
                color=colour,
                alpha=0.4,
                linewidths=0,
                transform=beside,
                zorder=2,
            )
        axes.plot(
            [*curve.level_vpp, blank],
            [*curve.p, curve.guess_rate],
            color=colour,
            marker=marker,
            mfc="white",
            ms=5,
            ls="",
            transform=beside,
            zorder=4,
        )
    _draw_functions(axes, analysis, curves, threshold_labels=True)


def _finish(axes: Axes, analysis: Analysis, *, small: bool = False) -> float:
    """Make the axes; return where blank trials stand."""
    chance = _chance(analysis)
    low = analysis.participants["p"].min()
    bottom = chance - _NEAR_GUESSING if chance and low >= chance - _NEAR_GUESSING else 0.0
    with_blank = len(blank_rates(analysis)) > 0 and not small
    blank = level_axis(axes, analysis.levels["level_vpp"], analysis.axis, with_blank=with_blank)
    probability_axis(axes, bottom, small=small)
    if chance:
        axes.axhline(chance, color=GREY, lw=0.6, ls=(0, (4, 3)), zorder=1)
        if not small:
            axes.annotate(
                f"guessing 1/{1 / chance:.0f}",
                (1, chance),
                xycoords=("axes fraction", "data"),
                xytext=(-2, 2),
                textcoords="offset points",
                ha="right",
                fontsize="small",
                color=GREY,
            )
    return blank


def _chance(analysis: Analysis) -> float:
    """Return the rate of guessing in forced choice if it is the same for all, else 0."""
    table = analysis.thresholds
    rates = table["guess_rate"].unique()
    forced = len(rates) == 1 and table["guess_basis"].eq("forced choice").all()
    return float(rates[0]) if forced else 0.0


def _draw_functions(
    axes: Axes, analysis: Analysis, curves: Mapping[str, Curve], *, threshold_labels: bool
) -> None:
    """Draw functions with their bands, and dotted lines down from the thresholds."""
    conditions = conditions_of(analysis)
    for row, (condition, curve) in enumerate(curves.items()):
        if curve.function is None:
            continue
        colour, _, line = look(conditions.index(condition))
        function = curve.function
        axes.fill_between(
            function.level_vpp,
            function.low,
            function.high,
            color=colour,
            alpha=_BAND_ALPHA,
            lw=0,
            zorder=1,
        )
        p = function.at(function.level_vpp)
        axes.plot(function.level_vpp, p, color=colour, ls=line, zorder=3)
        at = curve.threshold_vpp
        if np.isfinite(at):
            height = float(function.at(np.array(at)))
            bottom = axes.get_ylim()[0] if threshold_labels else 0.0
            axes.plot([at, at], [bottom, height], color=colour, ls=":", lw=0.9, zorder=2)
            if threshold_labels:
                _label_threshold(axes, analysis, (condition, at), colour, row)


def _label_threshold(
    axes: Axes, analysis: Analysis, threshold: tuple[str, float], colour: str, row: int
) -> None:
    """Write a threshold beside its line, where the function leaves room."""
    condition, at = threshold
    x = axes.transData.transform((at, 0.0))[0]
    right = axes.transAxes.inverted().transform((x, 0.0))[0] > _FAR_RIGHT
    table = analysis.groups[analysis.groups["condition"].eq(condition)].iloc[0]
    ends = (float(table[f"threshold_{end}_vpp"]) for end in ("low", "high"))
    low, high = (end if np.isfinite(end) else at for end in ends)
    levels = analysis.levels["level_vpp"]
    value = rounded(at, spread_of(low, at, high, [*levels])).replace("-", "\N{MINUS SIGN}")
    axes.annotate(
        f"{value} {analysis.axis.unit}",
        (at, 0.03 + 0.075 * row),
        xycoords=("data", "axes fraction"),
        xytext=(-3 if right else 3, 0),
        textcoords="offset points",
        ha="right" if right else "left",
        fontsize="small",
        color=colour,
        zorder=5,
        bbox={"facecolor": "white", "alpha": 0.7, "linewidth": 0, "pad": 0.5},
    )


def _draw_proportions(axes: Axes, curve: Curve, index: int, number: int) -> None:
    """Draw a participant's proportions, with binomial intervals where no function has a band."""
    colour, marker, _ = look(index)
    beside = aside(axes, index, number, 2.0)
    if curve.function is None and curve.low is not None and curve.high is not None:
        axes.vlines(
            curve.level_vpp, curve.low, curve.high, color=colour, lw=0.8, transform=beside, zorder=2
        )
    axes.plot(
        curve.level_vpp,
        curve.p,
        color=colour,
        marker=marker,
        mfc="white",
        ms=3.2,
        mew=0.8,
        ls="",
        transform=beside,
        zorder=4,
    )


def _draw_residuals(axes: Axes, analysis: Analysis) -> None:
    """Draw how far each participant's proportions lie from their own function."""
    table, conditions = residual_table(analysis), conditions_of(analysis)
    axes.axhline(0, color=GREY, lw=0.6, zorder=1)
    for condition, rows in table.groupby("condition", sort=False):
        index = conditions.index(str(condition))
        colour, marker, _ = look(index)
        axes.scatter(
            rows["level_vpp"],
            rows["residual"],
            s=7,
            marker=marker,
            color=colour,
            alpha=0.6,
            linewidths=0,
            transform=aside(axes, index, len(conditions)),
            zorder=2,
        )
    most = max(float(table["residual"].abs().max()), _MIN_TICK_RESIDUAL) * 1.12
    axes.set_ylim(-most, most)
    tick = _MIN_TICK_RESIDUAL * max(1, int(most / _MIN_TICK_RESIDUAL))
    axes.set_yticks([-tick, 0.0, tick], alike_labels([-tick, 0.0, tick]))


def _legend(analysis: Analysis, curves: Mapping[str, Curve]) -> list[Artist]:
    """Return what a legend explains: conditions, or of one condition its symbols."""
    if len(curves) > 1:
        return [condition_handle(index, name) for index, name in enumerate(curves)]
    from matplotlib.lines import Line2D

    colour, marker, line = look(0)
    same: dict[str, Any] = {"color": colour, "marker": marker}
    if analysis.participants["participant"].nunique() == 1:
        return []
    handles: list[Artist] = [
        Line2D([], [], ms=2.6, alpha=0.5, ls="", mew=0, label="participant", **same),
        Line2D([], [], ms=5, mfc="white", ls="", label="mean", **same),
    ]
    if any(curve.function is not None for curve in curves.values()):
        handles.append(Line2D([], [], color=colour, ls=line, label="fitted function"))
    return handles
