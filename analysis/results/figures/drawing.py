"""What all figures share: style, the layout of panels, points with bars, files.

The layout counts in em, the letter size. Every place is computed from the widths of texts, so that
a figure is drawn once: a layout engine draws it to measure it, and takes up to half more time.
"""

from __future__ import annotations

import io
import warnings
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from analysis.results.figures.axes import (
    BLANK,
    alike_labels,
    em_inches,
    figure_of,
    level_axis,
    level_label,
    level_ticks,
    scale_of,
    text_em,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis


class Look(NamedTuple):
    """How a condition is drawn."""

    colour: str
    marker: str
    line: Any = "-"


# Okabe and Ito's colours for all kinds of colour vision; yellow is too light for a thin line.
LOOKS: Final = (
    Look("#0072B2", "o", "-"),
    Look("#D55E00", "s", "--"),
    Look("#009E73", "^", "-."),
    Look("#CC79A7", "D", ":"),
    Look("black", "v", (0, (6, 1, 1, 1, 1, 1))),
    Look("#E69F00", "P", (0, (3, 2))),
)
"""Looks of the first conditions: no two differ by colour alone."""
GREY: Final = "#595959"
MAX_LEGEND_ENTRIES: Final = 3
_MIN_WIDTH_MM, _MAX_WIDTH_MM = 60.0, 400.0
_SHEET: Final = Path(__file__).with_name("tactstrip.mplstyle")
_LINE_EM: Final = 1.3
_X_LABEL_EM, _Y_LABEL_EM = 1.7, 1.0  # from an axis, and from its tick labels, to its name
_BOTTOM_EM, _RIGHT_EM, _EDGE_EM = 3.4, 0.8, 0.4
_LEGEND_HANDLE_EM: Final = 3.3
# If the font lacks a letter of a name, the figure shows a box, and the tables have the name.
_MISSING_LETTER: Final = (
    "Glyph .* missing from font",
    "Matplotlib currently does not support .* natively",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """How figures look.

    Attributes
    ----------
    width_mm : float
        The width of every figure, 60 to 400.
    style : Path or str, optional
        A matplotlib style sheet whose settings replace those of tactstrip.
    pdf : bool
        Whether each figure is also written as PDF.

    Raises
    ------
    ValueError
        For a width outside its limits.

    Examples
    --------
    >>> Style(width_mm=20)
    Traceback (most recent call last):
    ValueError: width_mm must be from 60 to 400, got 20
    """

    width_mm: float = 85.0
    style: Path | str | None = None
    pdf: bool = False

    def __post_init__(self) -> None:
        if not _MIN_WIDTH_MM <= self.width_mm <= _MAX_WIDTH_MM:
            limits = f"{_MIN_WIDTH_MM:g} to {_MAX_WIDTH_MM:g}"
            raise ValueError(f"width_mm must be from {limits}, got {self.width_mm:g}")

    @property
    def width_em(self) -> float:
        """The width in em, while the style is applied."""
        return self.width_mm / 25.4 / em_inches()

    @contextmanager
    def applied(self, ax: Axes | None = None) -> Iterator[None]:
        """Set matplotlib to this style, whatever the user's settings are, and set them back.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes of the caller, which keep the caller's settings.

        Yields
        ------
        None
        """
        from matplotlib.style import context

        sheets: list[Any] = [_SHEET, *([Path(self.style)] if self.style else [])]
        applied = context(sheets, after_reset=True) if ax is None else nullcontext()
        with applied, warnings.catch_warnings():
            for message in _MISSING_LETTER:
                warnings.filterwarnings("ignore", message, UserWarning)
            yield


DEFAULT_STYLE: Final = Style()


def render(draw: Callable[[], Figure], style: Style = DEFAULT_STYLE) -> dict[str, bytes]:
    """Draw a figure in a style; return it as PNG, as SVG and, if the style says so, as PDF.

    >>> files = render(lambda: figure_of(lay_out(DEFAULT_STYLE, rows_em=[9])[0]))
    >>> files["png"][1:4], files["svg"][:5]
    (b'PNG', b'<?xml')
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    with style.applied():
        figure = draw()
        png, svg, pdf = io.BytesIO(), io.BytesIO(), io.BytesIO()
        canvas: Any = figure.canvas
        # `savefig` would lay the figure out and draw it twice for each file.
        canvas.print_png(png, pil_kwargs={"compress_level": 3})
        vector: Any = FigureCanvasSVG(figure)
        vector.print_svg(svg, metadata={"Date": None})
        if style.pdf:
            from matplotlib.backends.backend_pdf import FigureCanvasPdf

            vector = FigureCanvasPdf(figure)
            vector.print_pdf(pdf, metadata={"CreationDate": None})
    files = {"png": png, "svg": svg, "pdf": pdf}
    return {ending: file.getvalue() for ending, file in files.items() if file.tell()}


def lay_out(
    style: Style,
    ax: Axes | None = None,
    *,
    rows_em: Sequence[float],
    columns: Sequence[float] = (1.0,),
    titles: Sequence[str] = ("",),
    labels: tuple[str, str] = ("", ""),
    handles: Sequence[Artist] = (),
    shared: str = "",
    tick_em: float = 1.4,
    gap_em: tuple[float, float] = (0.0, 0.0),
    right_em: float = _RIGHT_EM,
    note: str = "",
) -> list[Axes]:
    """Return the panels of a new figure, or panels in the place of `ax`, row by row.

    Parameters
    ----------
    style : Style
        The style, which sets the width.
    ax : matplotlib.axes.Axes, optional
        Axes of the caller; a single panel is these axes.
    rows_em : sequence of float
        The heights of the rows.
    columns : sequence of float
        The relative widths of the columns.
    titles : sequence of str
        One for each panel; the last row may have fewer panels.
    labels : (str, str)
        The names of the x and the y axis of all panels.
    handles : sequence of matplotlib.artist.Artist
        The entries of the legend above the panels.
    shared : str
        Which axes the panels share, "x", "y" or "xy"; only the outer panels have tick labels.
    tick_em : float
        The width of the tick labels at the left.
    gap_em : (float, float)
        Between columns, and between rows.
    right_em : float
        The margin at the right.
    note : str
        A line in grey below the figure.

    Returns
    -------
    list of matplotlib.axes.Axes
        As many as there are titles.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    entries_em = [text_em(str(handle.get_label())) + _LEGEND_HANDLE_EM for handle in handles]
    is_row = sum(entries_em) <= style.width_em - _EDGE_EM
    title_em = 1.1 * max(title.count("\n") + bool(title) for title in titles)
    if ax is None:
        content_em = sum(rows_em) + gap_em[1] * (len(rows_em) - 1)
        top_em = 0.7 + title_em + 1.2 * (bool(handles) if is_row else len(handles))
        # The name of a low panel's axis is higher than the panel.
        top_em = max(top_em, (text_em(labels[1], 1.0) - content_em) / 2 + _EDGE_EM)
        below_em = _BOTTOM_EM + _LINE_EM * bool(note)
        size_em = np.array([style.width_em, top_em + content_em + below_em])
        figure = Figure(figsize=tuple(size_em * em_inches()))
        FigureCanvasAgg(figure)
        beside_em = _Y_LABEL_EM + 1.4 if labels[1] else _EDGE_EM
        left, right = tick_em + beside_em, style.width_em - right_em
        bottom, top = below_em, size_em[1] - top_em
    else:
        figure = figure_of(ax)
        size_em = figure.get_size_inches() / em_inches()
        (left, bottom), (right, top) = ax.get_position().get_points() * size_em
    heights = np.array(rows_em) * (top - bottom - gap_em[1] * (len(rows_em) - 1)) / sum(rows_em)
    widths = np.array(columns) * (right - left - gap_em[0] * (len(columns) - 1)) / sum(columns)
    panels: list[Axes] = []
    same: dict[str, Any] = {}
    for i in range(len(titles)):
        row, column = divmod(i, len(columns))
        x = left + widths[:column].sum() + column * gap_em[0]
        y = top - heights[: row + 1].sum() - row * gap_em[1]
        box = np.array([x, y, widths[column], heights[row]]) / np.tile(size_em, 2)
        panel = ax if ax and len(titles) == 1 else figure.add_axes(tuple(box.tolist()), **same)
        panel.tick_params(
            axis="x", labelbottom="x" not in shared or i + len(columns) >= len(titles)
        )
        panel.tick_params(axis="y", labelleft="y" not in shared or column == 0)
        is_wide = text_em(titles[i]) > widths[column]
        panel.set_title(titles[i], loc="right" if is_wide else None, fontsize="small")
        panels.append(panel)
        same = {f"share{name}": panels[0] for name in shared}
    if ax is not None and len(titles) > 1:
        ax.set_axis_off()
    name_axes(panels, *labels, tick_em=tick_em)
    if handles:
        at = max(min(left, right - sum(entries_em)), _EDGE_EM) if is_row else left
        panels[0].legend(
            handles=handles,
            loc="lower left",
            bbox_to_anchor=_within(panels[0], at / size_em[0], (top + title_em + 0.3) / size_em[1]),
            ncols=len(handles) if is_row else 1,
        )
    if note and ax is None:
        at_x, at_y = 1 - _EDGE_EM / size_em[0], _EDGE_EM / size_em[1]
        figure.text(at_x, at_y, note, ha="right", va="bottom", color=GREY, fontsize="small")
    return panels


def name_axes(panels: Sequence[Axes], x: str, y: str, tick_em: float = 1.4) -> None:
    """Label the axes that panels share, centered below the panels and to their left.

    A label that is wider than the panels ends where they end, clear of panels to the right.
    """
    width_em, height_em = figure_of(panels[0]).get_size_inches() / em_inches()
    corners = np.array([panel.get_position().extents for panel in panels])
    (left, bottom), (right, top) = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
    middle, half = (left + right) / 2, text_em(x, 1.0) / 2 / width_em
    at_x = max(min(middle, right - half), half + _EDGE_EM / width_em)
    below, beside = bottom - _X_LABEL_EM / height_em, left - (tick_em + _Y_LABEL_EM) / width_em
    panels[0].set(xlabel=x, ylabel=y)
    panels[0].xaxis.set_label_coords(*_within(panels[0], at_x, below))
    panels[0].yaxis.set_label_coords(*_within(panels[0], beside, (bottom + top) / 2))


def _within(axes: Axes, x: float, y: float) -> tuple[float, float]:
    """Return a place of the figure in the coordinates of axes, with which it moves."""
    box = axes.get_position()
    return (x - box.x0) / box.width, (y - box.y0) / box.height


def handle(look: Look, label: str, **changed: Any) -> Artist:
    """Return the entry of a look in a legend."""
    from matplotlib.lines import Line2D

    options = {"color": look.colour, "marker": look.marker, "ls": look.line}
    return Line2D([], [], label=label, **{**options, "mfc": "white", **changed})


def by_condition(looks: Mapping[str, Look], labels: Mapping[str, str]) -> dict[str, Any]:
    """Return the options of `level_panels` for conditions: one panel with a legend, or many."""
    if len(looks) > MAX_LEGEND_ENTRIES:
        return {"titles": [labels[name] for name in looks], "columns": 2}
    entries = looks.items() if len(looks) > 1 else ()
    return {"handles": [handle(look, labels[name]) for name, look in entries]}


def each_condition(
    panels: Sequence[Axes], looks: Mapping[str, Look], step_pt: float
) -> Iterator[tuple[str, Axes, dict[str, Any]]]:
    """Yield each condition with its panel, and how points are drawn: side by side in one panel."""
    in_panels = len(looks) > MAX_LEGEND_ENTRIES
    for index, (condition, look) in enumerate(looks.items()):
        shift_pt = 0.0 if in_panels else step_pt * (index - (len(looks) - 1) / 2)
        symbols = {"look": look, "shift_pt": shift_pt}
        yield condition, panels[index if in_panels else 0], symbols


def draw_points(
    axes: Axes,
    x: Any,
    y: Any,
    look: Look,
    *,
    bars: tuple[Any, Any] | None = None,
    shift_pt: float = 0.0,
    size: float = 5.0,
    filled: bool = False,
    faint: bool = False,
) -> None:
    """Draw points, moved to the right by `shift_pt`, with vertical bars from low to high.

    Faint points are the small ones of participants behind a mean.
    """
    from matplotlib.transforms import ScaledTranslation

    colour, moved = look.colour, axes.transData
    if shift_pt:
        moved += ScaledTranslation(shift_pt / 72, 0, figure_of(axes).dpi_scale_trans)
    if bars:
        draw_bars(axes, x, *bars, colour=colour, transform=moved)
    axes.plot(
        x,
        y,
        ls="",
        marker=look.marker,
        color=colour,
        mfc=colour if filled or faint else "white",
        ms=2.7 if faint else size,
        mew=0 if faint else size / 5,
        alpha=0.4 if faint else 1.0,
        transform=moved,
        clip_on=False,
        zorder=2.5 if faint else 4,
    )


def draw_bars(
    axes: Axes, at: Any, low: Any, high: Any, *, along: str = "y", lw: float = 1.0, **options: Any
) -> None:
    """Draw bars along an axis; an arrow marks an end that is open or outside the panel."""
    from matplotlib.markers import CARETDOWN, CARETLEFT, CARETRIGHT, CARETUP

    is_x, colour = along == "x", options.pop("colour")
    at, low, high = (np.asarray(each, dtype=float) for each in (at, low, high))
    first, last = axes.get_xlim() if is_x else axes.get_ylim()
    lines = axes.hlines if is_x else axes.vlines
    lines(at, low.clip(first, last), high.clip(first, last), color=colour, lw=lw, **options)
    # The tip of these markers is at the point, so that no arrow leaves the axes.
    arrows = (CARETLEFT, CARETRIGHT) if is_x else (CARETDOWN, CARETUP)
    for arrow, end, is_cut in zip(arrows, (first, last), (low < first, high > last), strict=True):
        if is_cut.any():
            tips = np.full(is_cut.sum(), end), at[is_cut]
            same: dict[str, Any] = {"color": colour, "ms": 4, "mew": 0, "ls": "", **options}
            axes.plot(*(tips if is_x else tips[::-1]), marker=arrow, clip_on=False, **same)


class YAxis(NamedTuple):
    """The name of a y axis, values that it holds, and about how many intervals its ticks make."""

    name: str
    values: Any
    intervals: int = 5


def level_panels(
    analysis: Analysis,
    style: Style,
    ax: Axes | None,
    levels: Any,
    *y: YAxis,
    titles: Sequence[str] = ("",),
    columns: int = 1,
    with_blank: bool = False,
    **options: Any,
) -> tuple[list[Axes], float]:
    """Return a panel for each title above one axis of levels, and where blank trials stand on it.

    A second y axis is that of a low panel below a single one. Options are those of `lay_out`.
    """
    axis, has_foot = analysis.axis, len(y) > 1
    scales = [scale_of(each.values, intervals=each.intervals) for each in y]
    tick_em = max(text_em(label) for *_, ticks in scales for label in alike_labels(ticks))
    x_ticks = alike_labels(level_ticks(levels, log=not axis.signed))
    beyond_em = max(map(text_em, [*x_ticks, BLANK * with_blank])) / 2 - 0.4
    panel_em = style.width_em * min(0.58, 0.8 / columns)
    panels = lay_out(
        style,
        ax,
        rows_em=[panel_em] * -(-len(titles) // columns) + [0.25 * panel_em] * has_foot,
        columns=(1,) * columns,
        titles=[*titles, *[""] * has_foot],
        labels=(level_label(axis), y[0].name),
        shared="x" if has_foot else "xy",
        tick_em=tick_em,
        gap_em=(2 * beyond_em + 0.3, 0.8 if has_foot else 2.1),
        right_em=max(_RIGHT_EM, _EDGE_EM + beyond_em),
        note=analysis.mark,
        **options,
    )
    for panel, each, (low, high, ticks) in zip(panels, y, scales, strict=False):
        panel.set_ylim(low, high)
        panel.set_yticks(ticks, alike_labels(ticks))
        if has_foot:
            name_axes([panel], level_label(axis) * (panel is panels[-1]), each.name, tick_em)
    with_gap = panels if with_blank else panels[:1]  # the others share the axis of the first
    blank, *_ = (level_axis(panel, levels, axis, with_blank=with_blank) for panel in with_gap)
    return panels, blank
