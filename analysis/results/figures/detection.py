"""Detection probability against level, with fitted functions: of the group, and of participants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.results.figures.axes import figure_of
from analysis.results.figures.curves import (
    blank_rates,
    by_threshold,
    group_curves,
    looks_of,
    person_curves,
    residual_table,
)
from analysis.results.figures.drawing import (
    DEFAULT_STYLE,
    GREY,
    MAX_LEGEND_ENTRIES,
    YAxis,
    by_condition,
    draw_points,
    each_condition,
    handle,
    level_panels,
)
from analysis.results.findings import estimates
from analysis.results.rendering import short
from analysis.thresholds.fit import WITH_FUNCTION, WITH_THRESHOLD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.curves import Curve
    from analysis.results.figures.drawing import Look, Style


PEOPLE_PER_PAGE: Final = 12
MAX_PAGES: Final = 4
_STEP_PT: Final = 3.0
MIN_PANEL_MM: Final = 29.0
_MIN_RESIDUAL: Final = 2.0
_BAND_ALPHA: Final = 0.18


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
    looks, curves, rates = looks_of(analysis), group_curves(analysis), blank_rates(analysis)
    thresholds = {row["condition"]: row["short"] for row in estimates(analysis)}
    texts = {name: thresholds[name] if curves[name].function else "" for name in looks}
    labels = {name: ": ".join(filter(None, (short(name), texts[name]))) for name in looks}
    options = by_condition(looks, labels)
    if len(looks) == 1:
        options["handles"] = _legend(analysis, *texts.values())
    y_axes, levels = [_proportions(analysis, 6)], analysis.levels["level_vpp"]
    residuals = residual_table(analysis) if ax is None and has_residuals(analysis) else None
    if residuals is not None:
        most = max(residuals["residual"].abs().max(), _MIN_RESIDUAL)
        y_axes += [YAxis("Residual", [-most, most], 2)]
    with style.applied(ax):
        options |= {"with_blank": len(rates) > 0}
        panels, blank = level_panels(analysis, style, ax, levels, *y_axes, **options)
        _draw_guessing(panels if residuals is None else panels[:1], analysis)
        for condition, axes, symbols in each_condition(panels, looks, _STEP_PT):
            curve = curves[condition]
            people = analysis.participants[analysis.participants["condition"].eq(condition)]
            if people["participant"].nunique() > 1:
                guesses = rates.loc[rates["condition"].eq(condition), "rate"]
                level = [*people["level_vpp"], *[blank] * len(guesses)]
                draw_points(axes, level, [*people["p"], *guesses], **symbols, faint=True)
            level, p = [*curve.level_vpp, blank], [*curve.p, curve.guess_rate]
            draw_points(axes, level, p, **symbols)
            _draw_function(axes, curve, looks[condition])
            if residuals is not None:
                rows = residuals[residuals["condition"].eq(condition)]
                draw_points(panels[1], rows["level_vpp"], rows["residual"], **symbols, faint=True)
        if residuals is not None:
            panels[1].axhline(0, color=GREY, lw=0.6, zorder=1)
            panels[0].tick_params(axis="x", length=0)
            panels[0].spines["bottom"].set_visible(False)
    return figure_of(panels[0])


def _legend(analysis: Analysis, threshold: str) -> list[Artist]:
    """Return the entries of the symbols of a single condition."""
    (look,), handles = looks_of(analysis).values(), list["Artist"]()
    if analysis.participants["participant"].nunique() > 1:
        handles += [handle(look, "participant", ls="", ms=2.7, mew=0, mfc=look.colour, alpha=0.5)]
        handles += [handle(look, "mean", ls="", ms=5)]
    if threshold:
        handles += [
            handle(look, f"{analysis.words['threshold']} {threshold}", marker="", ls=":", lw=0.9)
        ]
    return handles


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
    looks, names = looks_of(analysis), names or pages_of(analysis)[0]
    number = analysis.participants["participant"].nunique()
    columns = min(number, max(2, round(style.width_mm / MIN_PANEL_MM)))
    with style.applied(ax):
        options = by_condition(looks, {name: short(name) for name in looks})
        # All pages have the same number of columns, so that panels have the same size.
        options |= {"titles": [*map(short, names)], "columns": 2 if number == 4 else columns}  # noqa: PLR2004 - 2 x 2
        y_axis, levels = _proportions(analysis, 2, "panel_axis"), analysis.levels["level_vpp"]
        panels, _ = level_panels(analysis, style, ax, levels, y_axis, **options)
        _draw_guessing(panels, analysis)
        for axes, name in zip(panels, names, strict=True):
            curves = person_curves(analysis, name)
            for index, (condition, look) in enumerate(looks.items()):
                if condition not in curves:
                    continue
                curve, shift_pt = curves[condition], 2.0 * (index - (len(looks) - 1) / 2)
                bars = None if curve.function else curve.limits
                same: dict[str, Any] = {"bars": bars, "shift_pt": shift_pt, "size": 3.2}
                draw_points(axes, curve.level_vpp, curve.p, look, **same)
                _draw_function(axes, curve, look)
    return figure_of(panels[0])


def has_residuals(analysis: Analysis) -> bool:
    """Return whether the figure of detection has a panel of residuals: with few conditions."""
    fitted = analysis.thresholds["status"].isin(WITH_FUNCTION).any()
    return bool(fitted) and len(looks_of(analysis)) <= MAX_LEGEND_ENTRIES


def pages_of(analysis: Analysis) -> list[list[str]]:
    """Return the participants of each page, by threshold.

    Of very many there is one page, of those to look at first: whom a warning names, who has no
    threshold, and whose function fits least.
    """
    names = by_threshold(analysis)
    if len(names) > PEOPLE_PER_PAGE * MAX_PAGES:
        doubtful = {check.data["participant"] for check in analysis.checks}
        table = analysis.thresholds.assign(
            clean=~analysis.thresholds["participant"].isin(doubtful),
            fitted=analysis.thresholds["status"].isin(WITH_THRESHOLD),
        )
        table = table.sort_values(["clean", "fitted", "deviance_p"], kind="stable")
        first = {*table["participant"].unique()[:PEOPLE_PER_PAGE]}
        names = [name for name in names if name in first]
    size = PEOPLE_PER_PAGE
    return [names[i : i + size] for i in range(0, len(names), size)]


def _guess_rate(analysis: Analysis) -> float:
    """Return the rate of guessing in a forced choice if it is the same for all, else 0."""
    table = analysis.thresholds
    rates, forced = table["guess_rate"].unique(), table["guess_basis"].eq("forced choice").all()
    return float(rates[0]) if len(rates) == 1 and forced else 0.0


def _proportions(analysis: Analysis, intervals: int, name: str = "axis") -> YAxis:
    """Return the axis of proportions: from 0, in a forced choice from the rate of guessing."""
    least = min(_guess_rate(analysis), analysis.participants["p"].min())
    return YAxis(analysis.words[name], [least, 1.0], intervals)


def _draw_guessing(panels: Sequence[Axes], analysis: Analysis) -> None:
    """Draw a line at the rate of guessing in a forced choice."""
    rate = _guess_rate(analysis)
    for axes in panels if rate else ():
        axes.axhline(rate, color=GREY, lw=0.6, ls=(0, (4, 3)), zorder=1)


def _draw_function(axes: Axes, curve: Curve, look: Look) -> None:
    """Draw a function with its band, and a dotted line down from the threshold."""
    if curve.function is None:
        return
    x, p, at = curve.function.level_vpp, curve.function.at, np.array(curve.threshold_vpp)
    band: dict[str, Any] = {"color": look.colour, "alpha": _BAND_ALPHA, "lw": 0, "zorder": 1}
    axes.fill_between(x, curve.function.low, curve.function.high, **band)
    axes.plot(x, p(x), color=look.colour, ls=look.line, zorder=3)
    ends = axes.get_ylim()[0], float(p(at))
    axes.plot([at, at], ends, color=look.colour, ls=":", lw=0.9, zorder=2)
