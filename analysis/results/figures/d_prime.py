"""Sensitivity d' against level."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from analysis.numbers import TOTAL
from analysis.results.figures.curves import conditions_of
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    GREY,
    MAX_LEGEND_ENTRIES,
    add_legend,
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
    round_ticks,
    short,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style


_MAX_BEYOND: Final = 2.0
"""How far limits widen the axis beyond the values: of two people they may be at 20."""


def plot_d_prime(
    analysis: Analysis, ax: Axes | None = None, *, style: Style = DEFAULT_STYLE
) -> Figure:
    r"""Draw the mean d' of the participants at each level with its 95 % interval.

    Parameters
    ----------
    analysis : Analysis
        From `write_analysis` or `analyse`, of trials with blanks.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure by default.
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
    >>> from analysis import ColumnMap, analyse, plot_d_prime, read_inputs
    >>> with TemporaryDirectory() as folder:
    ...     table = Path(folder) / "table.csv"
    ...     _ = table.write_text("participant,side,level_vpp,response,rt_s\n" + (
    ...         "1,left,60,none,0.6\n1,left,60,left,0.5\n1,left,90,left,0.4\n"
    ...         "1,left,40,none,0.7\n1,none,0,none,0.6\n") * 9)
    ...     result = analyse(read_inputs([table], ColumnMap()))
    >>> plot_d_prime(result).axes[0].get_xlabel()
    'Drive level (V peak-to-peak)'
    """
    table = analysis.sensitivity[analysis.sensitivity["level_vpp"].notna()]
    conditions = [one for one in conditions_of(analysis) if table["condition"].eq(one).any()]
    several = len(conditions) > MAX_LEGEND_ENTRIES and ax is None
    with style.applied(ax):
        handles = []
        if len(conditions) > 1 and not several:
            handles = [condition_handle(index, one) for index, one in enumerate(conditions)]
        rows, columns = (-(-len(conditions) // 2), 2) if several else (1, 1)
        labels = [str(handle.get_label()) for handle in handles]
        top_em = 0.8 + 1.2 * legend_rows(labels, style.width_mm / em_mm() - 4.8) + several
        height_mm = rows * (0.44 if several else 0.66) * style.width_mm + top_em * em_mm()
        region = new_region(style, height_mm, (4.0, 3.4, 0.8, top_em), ax=ax, note=analysis.mark)
        panels = region.split(rows, columns, (1.2, 2.6), sharex=True, sharey=True)
        low, high = _limits(table)
        for panel in panels:
            level_axis(panel, table["level_vpp"], analysis.axis)
            panel.axhline(0, color=GREY, lw=0.6, zorder=1)
            panel.set_ylim(low, high)
        ticks = round_ticks(low, high, log=False)
        panels[0].set_yticks(ticks, alike_labels(ticks))
        for index, condition in enumerate(conditions):
            panel = panels[index if several else 0]
            beside = aside(panel, 0, 1) if several else aside(panel, index, len(conditions), 4.0)
            _draw(panel, table[table["condition"].eq(condition)], look(index), beside)
            if several:
                panel.set_title(short(condition), fontsize="small")
        names = level_label(analysis.axis), "Sensitivity d'"
        if several:
            label_outer(panels, len(conditions), columns, names)
        else:
            name_axes(panels[0], *names)
            add_legend(panels[0], handles)
    return region.figure


def _summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with intervals: of the mean, or of the only participant."""
    people = table.loc[table["participant"].ne(TOTAL), "participant"].nunique()
    return table[table["participant"].eq(TOTAL) == (people > 1)]


def _limits(table: pd.DataFrame) -> tuple[float, float]:
    """Return limits that hold all values, and intervals unless they are very wide."""
    low, high = (float(getattr(table["d_prime"], name)()) for name in ("min", "max"))
    rows = _summary(table)
    low = min(low, max(float(rows["d_prime_low"].fillna(low).min()), low - _MAX_BEYOND), 0.0)
    high = max(high, min(float(rows["d_prime_high"].fillna(high).max()), high + _MAX_BEYOND))
    margin = 0.05 * (high - low) or 0.5
    return low - margin, high + margin


def _draw(axes: Axes, rows: pd.DataFrame, symbols: tuple[str, str, Any], beside: Transform) -> None:
    colour, marker, _ = symbols
    mean = _summary(rows)
    people = rows[rows["participant"].ne(TOTAL)]
    if len(people) > len(mean):
        axes.scatter(
            people["level_vpp"],
            people["d_prime"],
            s=7,
            marker=marker,
            color=colour,
            alpha=0.4,
            linewidths=0,
            transform=beside,
            zorder=2,
        )
    axes.vlines(
        mean["level_vpp"],
        mean["d_prime_low"],
        mean["d_prime_high"],
        color=colour,
        lw=1.0,
        transform=beside,
        zorder=3,
    )
    axes.plot(
        mean["level_vpp"],
        mean["d_prime"],
        color=colour,
        marker=marker,
        mfc="white",
        ms=5,
        ls="",
        transform=beside,
        zorder=4,
    )
    bottom, top = axes.get_ylim()
    for sign, end, is_cut in (
        ("v", bottom, mean["d_prime_low"] < bottom),
        ("^", top, mean["d_prime_high"] > top),
    ):
        cut = mean.loc[is_cut, "level_vpp"]
        axes.plot(
            cut,
            [end] * len(cut),
            color=colour,
            marker=sign,
            ms=3,
            mew=0,
            ls="",
            transform=beside,
            clip_on=False,
        )
