"""What all figures share: style, layout in units of the letter size, axes of levels, files.

Every place is computed from the size of the letters and the widths of labels, so that no layout
engine has to draw a figure before it is drawn.
"""

from __future__ import annotations

import io
import itertools
import re
import warnings
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform
    from numpy.typing import NDArray

    from analysis.axis import Axis

    Floats = NDArray[np.float64]

# Okabe and Ito's colours for all kinds of colour vision; yellow is too light for a thin line.
COLOURS: Final = ("#E69F00", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#999999")
MARKERS: Final = ("o", "s", "^", "D", "v", "P")
GROUP: Final = "#0072B2"
GREY: Final = "#595959"
LOOKS: Final = (
    (GROUP, "o", "-"),
    (COLOURS[3], "s", "--"),
    (COLOURS[2], "^", "-."),
    (COLOURS[4], "D", ":"),
    ("black", "v", (0, (6, 1, 1, 1, 1, 1))),
    (COLOURS[0], "P", (0, (3, 2))),
)
"""Colour, marker and line of the first conditions: no two differ by colour alone."""
SMALL: Final = 0.833
"""Size of the letters of ticks and legends, in parts of the letter size."""
MAX_LEGEND_ENTRIES: Final = 3
_MIN_WIDTH_MM, _MAX_WIDTH_MM = 60.0, 400.0
_SHEET: Final = Path(__file__).with_name("tactstrip.mplstyle")
_MAX_NAME_LETTERS: Final = 14
_NOTE_EM: Final = 1.3
_LEGEND_HANDLE_EM: Final = 3.3
_MAX_LEVEL_TICKS: Final = 9
_LEVEL_MARGIN: Final = 0.06
_LOG_TICKS_FROM_RATIO: Final = 8.0
_NAME_PARTS: Final = re.compile(r"<U\+[0-9A-F]+>|.", re.DOTALL)
# The font lacks a letter of a name: a box stands in its place, and the tables have the name.
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
        import matplotlib as mpl

        if ax is not None:
            yield
            return

        with mpl.rc_context(), warnings.catch_warnings():
            for message in _MISSING_LETTER:
                warnings.filterwarnings("ignore", message, UserWarning)
            mpl.rcdefaults()
            for sheet in (_SHEET, self.style) if self.style else (_SHEET,):
                assert sheet is not None
                mpl.rcParams.update(mpl.rc_params_from_file(sheet, use_default_template=False))
            yield


DEFAULT_STYLE: Final = Style()


def render(draw: Callable[[], Figure], style: Style = DEFAULT_STYLE) -> tuple[bytes, ...]:
    """Draw a figure in a style; return it as PNG, as SVG and, if the style says so, as PDF.

    >>> png, svg = render(lambda: new_region(DEFAULT_STYLE, 40, (3, 3, 1, 1)).figure)
    >>> png[1:4], svg[:5]
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
        if not style.pdf:
            return png.getvalue(), svg.getvalue()
        from matplotlib.backends.backend_pdf import FigureCanvasPdf

        vector = FigureCanvasPdf(figure)
        vector.print_pdf(pdf, metadata={"CreationDate": None})
    return png.getvalue(), svg.getvalue(), pdf.getvalue()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """A rectangle of a figure, in parts of it, for one panel or a grid of panels."""

    figure: Figure
    left: float
    bottom: float
    right: float
    top: float
    given: Axes | None = None  # axes of the caller that fill the rectangle

    def axes(self) -> Axes:
        """Return one panel that fills the region."""
        return self.given if self.given is not None else self.split(1, 1)[0]

    def split(
        self, rows: int, columns: int, gap_em: tuple[float, float] = (0.0, 0.0), **options: Any
    ) -> list[Axes]:
        """Return a grid of panels, row by row, with a gap between columns and between rows.

        Options are those of `matplotlib.figure.Figure.add_gridspec`, and `sharex` and `sharey`.
        """
        if self.given is not None:
            self.given.set_axis_off()
        shared = {name: options.pop(name) for name in ("sharex", "sharey") if name in options}
        em_x, em_y = (gap / size for gap, size in zip(gap_em, size_em(self.figure), strict=True))
        wide = (self.right - self.left - em_x * (columns - 1)) / columns
        tall = (self.top - self.bottom - em_y * (rows - 1)) / rows
        grid = self.figure.add_gridspec(
            rows,
            columns,
            left=self.left,
            right=self.right,
            bottom=self.bottom,
            top=self.top,
            wspace=em_x / wide,
            hspace=em_y / tall,
            **options,
        )
        return [*grid.subplots(squeeze=False, **shared).ravel()]


def new_region(
    style: Style,
    height_mm: float,
    margins_em: tuple[float, float, float, float],
    *,
    ax: Axes | None = None,
    note: str = "",
) -> Region:
    """Return the region of `ax`, or of a new figure without its margins: left, bottom, right, top.

    A note stands in grey below the region, in a line of its own.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    if ax is not None:
        whole = ax.get_figure(root=True)
        assert whole is not None
        at = ax.get_position()
        return Region(figure=whole, left=at.x0, bottom=at.y0, right=at.x1, top=at.y1, given=ax)
    left, bottom, right, top = margins_em
    note_em = _NOTE_EM if note else 0.0
    figure = Figure(figsize=(style.width_mm / 25.4, (height_mm + note_em * em_mm()) / 25.4))
    FigureCanvasAgg(figure)
    wide, tall = size_em(figure)
    if note:
        figure.text(
            1 - 0.4 / wide, 0.4 / tall, note, ha="right", va="bottom", color=GREY, fontsize="small"
        )
    return Region(
        figure=figure,
        left=left / wide,
        bottom=(bottom + note_em) / tall,
        right=1 - right / wide,
        top=1 - top / tall,
    )


def em_mm() -> float:
    """Return the letter size of the style in use."""
    import matplotlib as mpl

    return float(mpl.rcParams["font.size"]) * 25.4 / 72


def size_em(figure: Figure) -> tuple[float, float]:
    """Return width and height of a figure in units of the letter size."""
    wide, tall = figure.get_size_inches()
    return wide * 25.4 / em_mm(), tall * 25.4 / em_mm()


def axes_em(axes: Axes) -> float:
    """Return the width of axes in units of the letter size."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    return float(axes.get_position().width) * size_em(figure)[0]


def text_em(text: str, size: float = SMALL) -> float:
    """Return the width of a text in units of the letter size."""
    return size * max(map(_line_em, text.split("\n")))


@cache
def _line_em(line: str) -> float:
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    measure: Any = text_to_path.get_text_width_height_descent
    return float(measure(line, FontProperties(size=100), ismath=False)[0]) / 100


def short(name: str) -> str:
    """Cut the middle out of a name that is too long for a label.

    >>> short("S01"), short("S" * 64)
    ('S01', 'SSSSSSS…SSSSSS')
    >>> short("S1<U+200F>S2<U+200F>")  # an escape stands as a whole, or not at all
    'S1…S2<U+200F>'
    """
    if len(name) <= _MAX_NAME_LETTERS:
        return name
    letters = _NAME_PARTS.findall(name)
    first = "".join(_taken(letters, _MAX_NAME_LETTERS // 2))
    last = _taken(letters[::-1], _MAX_NAME_LETTERS - 1 - len(first))
    return f"{first}…{''.join(last[::-1])}"


def _taken(letters: Sequence[str], number: int) -> list[str]:
    lengths = itertools.accumulate(map(len, letters))
    return [letter for letter, length in zip(letters, lengths, strict=True) if length <= number]


def look(index: int) -> tuple[str, str, Any]:
    """Return colour, marker and line of the condition at a place of `conditions_of`."""
    return LOOKS[index % len(LOOKS)]


def aside(axes: Axes, index: int, number: int, step_pt: float = 3.0) -> Transform:
    """Return a transform that moves symbols of one of several conditions beside their level."""
    from matplotlib.transforms import ScaledTranslation

    figure = axes.get_figure(root=True)
    assert figure is not None
    shift = step_pt * (index - (number - 1) / 2) / 72
    return axes.transData + ScaledTranslation(shift, 0, figure.dpi_scale_trans)


def condition_handle(index: int, condition: str) -> Artist:
    """Return the entry of a condition in a legend."""
    from matplotlib.lines import Line2D

    colour, marker, line = look(index)
    return Line2D([], [], color=colour, marker=marker, ls=line, mfc="white", label=short(condition))


def legend_rows(labels: Sequence[str], width_em: float) -> int:
    """Return how many rows a legend of these labels takes above a panel."""
    return (
        1 if sum(text_em(label) + _LEGEND_HANDLE_EM for label in labels) < width_em else len(labels)
    )


def add_legend(axes: Axes, handles: Sequence[Artist]) -> None:
    """Explain symbols above a panel, where no data lie."""
    if not handles:
        return
    labels = [str(handle.get_label()) for handle in handles]
    rows = legend_rows(labels, axes_em(axes))
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0, 1.02),
        ncols=len(labels) if rows == 1 else 1,
    )


def add_shared_legend(region: Region, handles: Sequence[Artist]) -> None:
    """Explain symbols of all panels of a region in a row at the top of the figure."""
    if handles:
        wide, tall = size_em(region.figure)
        labels = [str(handle.get_label()) for handle in handles]
        rows = legend_rows(labels, wide * (region.right - region.left))
        region.figure.legend(
            handles=handles,
            loc="upper left",
            bbox_to_anchor=(region.left, 1 - 0.4 / tall),
            ncols=len(labels) if rows == 1 else 1,
        )


def name_axes(axes: Axes, x: str, y: str, tick_em: float = 1.4) -> None:
    """Name the axes at known distances, so that no tick label is measured to place the names."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    wide, tall = size_em(figure)
    box = axes.get_position()
    axes.set(xlabel=x, ylabel=y)
    axes.xaxis.set_label_coords(0.5, -1.7 / (tall * box.height))
    axes.yaxis.set_label_coords(-(tick_em + 1.0) / (wide * box.width), 0.5)


def label_outer(panels: Sequence[Axes], number: int, columns: int, labels: tuple[str, str]) -> None:
    """Keep tick labels at the outer panels of a grid, name each axis once, hide unused panels.

    The first `number` panels are used; the labels are those of the x and of the y axis.
    """
    figure = panels[0].get_figure(root=True)
    assert figure is not None
    em_x, em_y = (1 / size for size in size_em(figure))
    for index, panel in enumerate(panels):
        panel.tick_params(axis="x", labelbottom=index + columns >= number)
        panel.tick_params(axis="y", labelleft=index % columns == 0)
        panel.set_visible(index < number)
    boxes = [panel.get_position() for panel in panels]
    left, right = min(box.x0 for box in boxes), max(box.x1 for box in boxes)
    bottom, top = min(box.y0 for box in boxes), max(box.y1 for box in boxes)
    figure.text((left + right) / 2, bottom - 1.7 * em_y, labels[0], ha="center", va="top")
    left -= 2.5 * em_x
    figure.text(left, (bottom + top) / 2, labels[1], rotation=90, ha="right", va="center")


def probability_axis(axes: Axes, bottom: float, *, small: bool = False) -> None:
    """Make the y axis one of probabilities from 0, or from a multiple of 0.1 near `bottom`."""
    bottom = max(0.0, np.floor(10 * bottom) / 10)
    step = 0.5 if small else 0.2 if bottom <= 0 else 0.1
    ticks = np.arange(1.0, bottom - 1e-9, -step)
    axes.set_ylim(bottom - 0.03 * (1 - bottom), 1 + 0.03 * (1 - bottom))
    axes.set_yticks(ticks, [f"{max(tick, 0.0):.1f}" for tick in ticks])


def level_axis(axes: Axes, levels: Any, axis: Axis, *, with_blank: bool = False) -> float:
    """Make the x axis one of levels and return where blank trials stand, left of all levels.

    Levels have their own ticks if there are few of them.
    """
    values = np.unique([float(f"{level:.10g}") for level in np.asarray(levels, dtype=np.float64)])
    log = not axis.signed
    if log:
        axes.set_xscale("log")
    at = np.log(values) if log else values
    span = float(at[-1] - at[0]) or (0.2 if log else 1.0)
    first, last = alike_labels(values)[0], at[-1] + _LEVEL_MARGIN * span
    # The label below blank trials must not touch that of the lowest level.
    gap_em = (text_em("blank") + text_em(first)) / 2 + 0.5
    share = min(gap_em / axes_em(axes), 0.5)
    gap = max(0.12, (1 + 2 * _LEVEL_MARGIN) * share / (1 - share)) if with_blank else 0.0
    limits = np.array([at[0] - _LEVEL_MARGIN * span, last, at[0] - gap * span])
    low, right, blank = (float(one) for one in (np.exp(limits) if log else limits))
    left = at[0] - (gap + _LEVEL_MARGIN) * span
    axes.set_xlim(float(np.exp(left)) if log else left, right)
    has_own_ticks = len(values) <= _MAX_LEVEL_TICKS
    ticks = values if has_own_ticks else round_ticks(values[0], values[-1], log=log)
    set_ticks(axes, ticks, log=log, blank=blank if with_blank else None)
    if with_blank:
        axes.spines["bottom"].set_bounds(low, right)
    return blank


def level_label(axis: Axis) -> str:
    """Return the name of an axis of levels.

    >>> from analysis import Axis
    >>> level_label(Axis()), level_label(Axis(x_scale="linear", unit="cm/s"))
    ('Drive level (V peak-to-peak)', 'Level (cm/s)')
    """
    return f"{'Drive level' if axis.is_vpp else 'Level'} ({axis.label})"


def set_ticks(axes: Axes, ticks: Floats, *, log: bool, blank: float | None = None) -> None:
    """Set those ticks whose labels have room, the last of them always, all to the same decimals."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    labels = alike_labels(ticks)
    ends = np.array([*axes.get_xlim(), *ticks])
    ends = np.log(ends) if log else ends
    at = axes_em(axes) * (ends[2:] - ends[0]) / (ends[1] - ends[0])
    half = np.array([text_em(label) / 2 + 0.25 for label in labels])
    # From the last to the first: the highest level has a label even where others have no room.
    chosen: list[int] = []
    for i in reversed(range(len(ticks))):
        if not chosen or at[i] + half[i] <= at[chosen[-1]] - half[chosen[-1]]:
            chosen.append(i)
    places, texts = [float(ticks[i]) for i in chosen], [labels[i] for i in chosen]
    if blank is not None:
        places, texts = [blank, *places], ["blank", *texts]
    axes.xaxis.set_major_locator(FixedLocator(places))
    axes.xaxis.set_major_formatter(FixedFormatter(texts))
    axes.xaxis.set_minor_locator(NullLocator())


MIN_TICKS: Final = 3
"""Fewer do not show the scale of an axis."""


def round_ticks(low: float, high: float, *, log: bool, number: int = 5) -> Floats:
    """Return round numbers from `low` to `high`, on a logarithmic axis of a wide range by ratios.

    >>> round_ticks(0.9, 220.0, log=True).tolist(), round_ticks(44.0, 104.0, log=True).tolist()
    ([1.0, 3.0, 10.0, 30.0, 100.0], [60.0, 80.0, 100.0])
    """
    from matplotlib.ticker import MaxNLocator

    if log and high / low > _LOG_TICKS_FROM_RATIO:
        decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
        for steps in ([1.0, 2.0, 5.0], [1.0, 3.0], [1.0]):
            ticks = np.round(np.multiply.outer(decades, steps).ravel(), 12)
            ticks = ticks[(ticks >= low) & (ticks <= high)]
            if len(ticks) <= number + 1:
                return ticks
        return ticks[:: -(-len(ticks) // number)]
    steps = [1, 2, 2.5, 5, 10]
    margin = 1e-9 * (high - low)
    for intervals in range(number, 2 * number):
        locator = MaxNLocator(intervals, steps=steps)
        even = np.asarray(locator.tick_values(low, high), dtype=np.float64)
        even = even[(even >= low - margin) & (even <= high + margin)]
        if len(even) >= MIN_TICKS:
            break
    return even


def alike_labels(values: Any) -> list[str]:
    """Write numbers with the same decimals, as few as keep each to a thousandth of itself.

    >>> alike_labels([0.0, 0.25, 1.0]), alike_labels([-0.5, 60]), alike_labels([42, 59, 83])
    (['0.00', '0.25', '1.00'], ['−0.5', '60.0'], ['42', '59', '83'])
    """
    numbers = np.asarray(values, dtype=np.float64)
    for decimals in range(7):
        if (np.abs(np.round(numbers, decimals) - numbers) <= 1e-3 * np.abs(numbers)).all():
            return [f"{number:.{decimals}f}".replace("-", "−") for number in numbers]
    return [f"{number:.3g}".replace("-", "−") for number in numbers]
