"""What all figures share: style, panels, axes of levels, words; the same bytes on every run."""

from __future__ import annotations

import io
import itertools
import math
import re
import textwrap
import warnings
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from analysis.axis import shortest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.axis import Axis
    from analysis.results.tables import Analysis


# Okabe & Ito's colours for all kinds of colour vision; yellow is too light for a thin line.
COLOURS: Final = ("#E69F00", "#56B4E9", "#009E73", "#D55E00", "#CC79A7", "#999999")
MARKERS: Final = ("o", "s", "^", "D", "v", "P")
GROUP: Final = "#0072B2"
MANY: Final = "#8A8A8A"
WIDTH_IN: Final = 4.2
"""One panel stands below the other, so that a telephone shows the letters large enough."""

_LONGEST_NAME = 14
_PARTS = re.compile(r"<U\+[0-9A-F]+>|.", re.DOTALL)
_INTERVAL = re.compile(r"\([^ ()]+(?: [^ ()]+)? to [^ ()]+(?: [^ ()]+)?\)")
_BELOW_IN = 0.5
_LEAST_MARGIN = 1.001
_DPI = 200.0
# The font lacks a letter of a name: a box stands there, and the tables have the name.
_NO_SUCH_LETTER = (
    "Glyph .* missing from font",
    "Matplotlib currently does not support .* natively",
)
_STYLE: Any = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "tactstrip",
    "pdf.fonttype": 42,  # letters stay letters, as journals ask
    "text.parse_math": False,
    "figure.dpi": 100.0,
}


class Sheet(NamedTuple):
    """A figure to be drawn, or a page of it: its title, a sentence on its signs, words for it."""

    title: str
    caption: str
    alt: str
    draw: Callable[[], Figure]


def in_words(analysis: Analysis, shown: str, where: str) -> str:
    """Return what a figure shows, in how many panels, and where its numbers stand."""
    number = analysis.levels["condition"].nunique()
    each = f", one panel for each of {number} conditions" if number > 1 else ""
    return f"{shown}{each}; the {where}."


def of_people(people: pd.Series[Any]) -> str:
    """Return whose numbers a figure shows.

    >>> import pandas as pd
    >>> of_people(pd.Series(["1", "1"])), of_people(pd.Series(["1", "2"]))
    ('of one participant', 'of 2 participants')
    """
    number = people.nunique()
    return "of one participant" if number == 1 else f"of {number} participants"


def written(draw: Callable[[], Figure], *, pdf: bool = False) -> tuple[bytes, ...]:
    """Draw a figure in our style, whatever the user's is; return it as PNG, as SVG and as `pdf`.

    >>> png, svg = written(lambda: panels(["main"], [2.0])[0])
    >>> png[1:4], svg[:5]
    (b'PNG', b'<?xml')
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_pdf import FigureCanvasPdf
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    with mpl.rc_context(), warnings.catch_warnings():
        for message in _NO_SUCH_LETTER:
            warnings.filterwarnings("ignore", message, UserWarning)
        mpl.rcdefaults()
        mpl.rcParams.update(_STYLE)
        figure = draw()
        png, svg = io.BytesIO(), io.BytesIO()
        # savefig would lay everything out for each file and draw it twice.
        layout = figure.get_layout_engine()
        if layout is not None:
            layout.execute(figure)
        figure.set_layout_engine("none")
        figure.dpi = _DPI
        pixels, lines = FigureCanvasAgg(figure), FigureCanvasSVG(figure)
        pixels.print_png(png, pil_kwargs={"compress_level": 3})  # type: ignore[no-untyped-call]
        lines.print_svg(svg, metadata={"Date": None})  # type: ignore[no-untyped-call]
        told = [png.getvalue(), svg.getvalue()]
        if pdf:
            page = io.BytesIO()
            canvas = FigureCanvasPdf(figure)
            canvas.print_pdf(page, metadata={"CreationDate": None})  # type: ignore[no-untyped-call]
            told.append(page.getvalue())
    return tuple(told)


def panels(
    conditions: Iterable[str], heights_in: list[float], note: str = ""
) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel below the other, each named where there are several.

    >>> figure, axes = panels(["bare", "covered"], [2.0, 3.0])
    >>> [one.get_title() for one in axes]
    ['condition bare', 'condition covered']
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = list(conditions)
    figure = Figure(figsize=(WIDTH_IN, sum(heights_in)), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(names), 1, squeeze=False, height_ratios=heights_in)
    axes = list(grid[:, 0])
    if len(names) > 1:
        for one, name in zip(axes, names, strict=True):
            one.set_title(f"condition {short(name)}", fontsize=11)
    if note:
        figure.suptitle(note)
    return figure, axes


def short(name: str) -> str:
    """Cut the middle out of a name that is too long for a label.

    >>> short("S01"), short("S" * 64)
    ('S01', 'SSSSSSS…SSSSSS')
    >>> short("S1<U+200F>S2<U+200F>")  # an escape stands as a whole, or not at all
    'S1…S2<U+200F>'
    """
    if len(name) <= _LONGEST_NAME:
        return name
    parts = _PARTS.findall(name)
    first = "".join(_taken(parts, _LONGEST_NAME // 2))
    last = _taken(parts[::-1], _LONGEST_NAME - 1 - len(first))
    return f"{first}…{''.join(last[::-1])}"


def wrapped(words: str, letters: int, indent: str) -> list[str]:
    """Return lines of at most so many letters, none of which ends within an interval.

    >>> wrapped("light: 1.51 um (1.32 to 1.72), as said", 26, "  ")
    ['light: 1.51 um', '  (1.32 to 1.72), as said']
    """
    kept = _INTERVAL.sub(lambda one: one[0].replace(" ", "\N{NO-BREAK SPACE}"), words)
    lines = textwrap.wrap(kept, letters, subsequent_indent=indent)
    return [line.replace("\N{NO-BREAK SPACE}", " ") for line in lines]


def _taken(parts: Sequence[str], letters: int) -> list[str]:
    """Return as many of the first parts as have together at most so many letters."""
    lengths = itertools.accumulate(map(len, parts))
    return [part for part, length in zip(parts, lengths, strict=True) if length <= letters]


_TICK_PT: Final = 10.0


def level_axis(
    axes: Axes, levels_vpp: Any, axis: Axis, *, beyond: float = 0.06, letter: float = 1 / 32
) -> None:
    """Make the x axis one of levels, each with its tick where there is room, and both ends.

    The axis goes on at either end by `beyond`, in parts of the levels' range; a letter of a tick is
    as wide as `letter`, in parts of the axis.
    """
    from matplotlib.ticker import FixedLocator, NullLocator

    levels = np.unique(np.asarray(levels_vpp, dtype=np.float64))
    if not axis.signed:
        axes.set_xscale("log")
        margin = max((levels[-1] / levels[0]) ** beyond, _LEAST_MARGIN)
        axes.set_xlim(levels[0] / margin, levels[-1] * margin)
        width = math.log(levels[-1] / levels[0] * margin**2)
        ticks, size = _ticks(levels, np.log(levels), letter * width)
        axes.set_xlabel(f"Level, logarithmic ({axis.label})")
    else:
        margin = beyond * float(levels[-1] - levels[0]) or 1.0
        axes.set_xlim(levels[0] - margin, levels[-1] + margin)
        width = float(levels[-1] - levels[0]) + 2 * margin
        ticks, size = _ticks(levels, levels, letter * width)
        axes.set_xlabel(f"Level ({axis.label})")
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    if size < 1:
        axes.tick_params(axis="x", labelsize=size * _TICK_PT)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(lambda value, _: plain(value))
    axes.grid(color="#E5E5E5", lw=0.6)
    axes.set_axisbelow(True)


def plain(value: float) -> str:
    """Return a number as a figure writes it: no power of ten up to ten digits, a minus sign.

    >>> plain(1e6), plain(-0.5), plain(60.0)
    ('1000000', '−0.5', '60')
    """
    return shortest(value).replace("-", "−")


def _ticks(levels_vpp: Any, places: Any, letter: float) -> tuple[list[float], float]:
    """Return the levels that get a label, and its size against the usual: all if they have room.

    Where they have none in smaller letters either, some get one, and both ends.

    >>> _ticks([1.0, 2.0, 3.0], [0.0, 1.0, 2.0], 1.0), _ticks([1.0, 2.0], [0.0, 0.8], 1.0)
    (([1.0, 2.0, 3.0], 1.0), ([1.0, 2.0], 0.8))
    >>> _ticks([1.0, 2.0, 3.0, 4.0], [0.0, 0.2, 1.0, 1.3], 1.0)
    ([1.0, 4.0], 1.0)
    """
    for closer, size in ((1.0, 1.0), (0.85, 1.0), (0.72, 0.8)):
        ticks = _spaced(levels_vpp, places, closer * letter)
        if len(ticks) == len(levels_vpp):
            return ticks, size
    end = places[-1] - letter * len(plain(levels_vpp[-1])) / 2
    before = [
        place + letter * len(plain(level)) / 2 <= end
        for level, place in zip(levels_vpp, places, strict=True)
    ]
    chosen = [*itertools.compress(zip(levels_vpp, places, strict=True), before)]
    ticks = _spaced([level for level, _ in chosen], [place for _, place in chosen], letter)
    return [*ticks, float(levels_vpp[-1 if ticks else 0])], 1.0


def _spaced(levels_vpp: Any, places: Any, letter: float) -> list[float]:
    """Choose levels so that no label covers its neighbour."""
    ticks: list[float] = []
    last = -math.inf
    for level, place in zip(levels_vpp, places, strict=True):
        half = letter * len(plain(level)) / 2
        if place - half >= last:
            ticks.append(float(level))
            last = place + half
    return ticks


def key(axes: Axes, *, columns: int) -> None:
    """Explain the signs below the panel, where no line runs, in `columns` columns."""
    from matplotlib.transforms import ScaledTranslation

    figure = axes.get_figure(root=True)
    if figure is None or not axes.get_legend_handles_labels()[0]:
        return
    below = axes.transAxes + ScaledTranslation(0, -_BELOW_IN, figure.dpi_scale_trans)
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, 0),
        bbox_transform=below,
        ncols=columns,
        fontsize=8,
        frameon=False,
        handlelength=2.8,
    )
