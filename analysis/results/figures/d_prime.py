"""Sensitivity d' against level."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.numbers import TOTAL
from analysis.results.figures.axes import figure_of
from analysis.results.figures.curves import looks_of
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    GREY,
    YAxis,
    by_condition,
    draw_points,
    each_condition,
    level_panels,
)
from analysis.results.rendering import short

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

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
    tested = {*table["condition"]}
    looks = {name: look for name, look in looks_of(analysis).items() if name in tested}
    is_mean = table["participant"].eq(TOTAL)
    people, means = table[~is_mean], table[is_mean]
    if people["participant"].nunique() == 1:
        people, means = people[:0], people
    values = table["d_prime"]
    low = means["d_prime_low"].clip(lower=values.min() - _MAX_BEYOND)
    high = means["d_prime_high"].clip(upper=values.max() + _MAX_BEYOND)
    y = YAxis("Sensitivity d'", np.concatenate([values, low, high, [0.0]]))
    with style.applied(ax):
        options = by_condition(looks, {name: short(name) for name in looks})
        panels, _ = level_panels(analysis, style, ax, table["level_vpp"], y, **options)
        for condition, panel, symbols in each_condition(panels, looks, 4.0):
            panel.axhline(0, color=GREY, lw=0.6, zorder=1)
            each, mean = (rows[rows["condition"].eq(condition)] for rows in (people, means))
            draw_points(panel, each["level_vpp"], each["d_prime"], **symbols, faint=True)
            bars = mean["d_prime_low"], mean["d_prime_high"]
            draw_points(panel, mean["level_vpp"], mean["d_prime"], **symbols, bars=bars)
    return figure_of(panels[0])
