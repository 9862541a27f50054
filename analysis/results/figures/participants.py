"""The figure of every participant: data, function, threshold and residuals, in small panels."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.answers.doubts import DRIFTING, GUESSING, SWAPPED
from analysis.definitions import counted_up, in_order
from analysis.results.figures.composed import DEVIANCE, draw_panel, name_parts
from analysis.results.figures.curves import (
    blanks_tell,
    conditions_of,
    look_of,
    person_curves,
    start_label,
    start_words,
)
from analysis.results.figures.drawing import WIDTH_IN, Sheet, short, wrapped

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

    from analysis.results.tables import Analysis


COLUMNS, ROWS = 2, 4
MOST_SHEETS: Final = 6
"""Of eight people each; of more people one sheet has those to look at first."""
_CHOSEN: Final = (
    " The first {} of {} are shown: whom a warning names (swapped sides, then a drift, then "
    "guesses), then who has no threshold, then who has the least misfit p. The numbers of all "
    "stand in the table of their thresholds, and in thresholds.csv and participants.csv."
)
_KINDS: Final = (SWAPPED, DRIFTING, GUESSING)
"""Of doubts, in the order of `_CHOSEN`: a high threshold alone may look like guesses."""
_PANEL_IN, _ROW_IN = 1.75, 0.12
_LEFT_IN, _BETWEEN_IN, _BELOW_IN = 0.66, 0.2, 0.28
_NAME_IN, _LINE_IN = 0.19, 0.13
_LETTERS = 28
_LETTER_PT = 8.0
"""Less is not read where a page of the report is printed."""
_SHORT: Final = {
    "one_level": "one level only",
    "flat": "does not rise with level",
    "decreasing": "falls with level",
}


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return pages of eight people; none of a single person, whom the first figure shows."""
    names = sorted({*analysis.participants["participant"]}, key=counted_up)
    if len(names) == 1:
        return []
    each = COLUMNS * ROWS
    every = len(names) <= each * MOST_SHEETS
    shown = names if every else _first_to_see(analysis)[:each]
    title = "Each participant" if every else "Participants to look at first"
    more = "" if every else _CHOSEN.format(each, len(names))
    pages = [shown[i : i + each] for i in range(0, len(shown), each)]
    return [
        Sheet(
            title=title + (f" ({number} of {len(pages)})" if len(pages) > 1 else ""),
            caption=f"Proportions with 95 % intervals ({analysis.ci.title()}), the fitted function "
            "with the 95 % band of its posterior, the threshold with its 95 % interval, and "
            f"deviance residuals; without a threshold only the data.{start_words(analysis)}{more}",
            alt=f"Detection probability against level in {analysis.axis.label} of each of "
            f"{len(page)} participants, "
            f"{f'{page[0]} to {page[-1]}' if every else ', '.join(page)}, in panels of their own; "
            "the numbers are in the tables of participants and of thresholds.",
            draw=partial(draw, analysis, tuple(page)),
        )
        for number, page in enumerate(pages, start=1)
    ]


def _first_to_see(analysis: Analysis) -> list[str]:
    """Return the participants, in the order of `_CHOSEN`."""
    table = analysis.thresholds
    of_kind = [{one.participant for one in analysis.doubts if one.kind == kind} for kind in _KINDS]
    order = table.assign(
        **{kind: ~table["participant"].isin(of) for kind, of in zip(_KINDS, of_kind, strict=True)},
        told=~table["status"].isin(_SHORT),
    )
    order = order.sort_values([*_KINDS, "told", "deviance_p", "participant"], key=in_order)
    return list(order["participant"].unique())


def draw(analysis: Analysis, names: Sequence[str]) -> Figure:
    """Draw the panels of some participants on one page, all on the same axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    conditions = conditions_of(analysis)
    rows = -(-len(names) // COLUMNS)
    panel_in = _PANEL_IN + _ROW_IN * len(conditions)
    notes = {name: _notes(analysis, name) for name in names}
    above_in = _NAME_IN + _LINE_IN * max(map(len, notes.values()))
    step_in = panel_in + above_in + _BELOW_IN
    head_in = 0.26 if analysis.mark else 0.05
    foot_in = 0.36 + 0.16 * (len(conditions) + 3 + 2 * blanks_tell(analysis))
    height_in = head_in + rows * step_in + foot_in
    figure = Figure(figsize=(WIDTH_IN, height_in))
    FigureCanvasAgg(figure)
    wide_in = (WIDTH_IN - _LEFT_IN - _BETWEEN_IN * (COLUMNS - 1) - 0.1) / COLUMNS
    levels_vpp = analysis.levels["level_vpp"].to_numpy(dtype=np.float64)
    # Every place is known in inches: nothing has to be laid out, which would take the longest.
    for number, name in enumerate(names):
        row, column = divmod(number, COLUMNS)
        left = _LEFT_IN + column * (wide_in + _BETWEEN_IN)
        top = height_in - head_in - row * step_in - above_in
        axes = figure.add_axes(
            (
                left / WIDTH_IN,
                (top - panel_in) / height_in,
                wide_in / WIDTH_IN,
                panel_in / height_in,
            )
        )
        curves = person_curves(analysis, name)
        shown = [curves.get(condition) for condition in conditions]
        draw_panel(axes, shown, levels_vpp, analysis.axis, DEVIANCE, small=True)
        axes.set_xlabel("")
        axes.tick_params(axis="x", labelsize=_LETTER_PT)
        # At places that are given, nothing is measured to find them.
        axes.xaxis.set_label_coords(0.5, 0.0)
        axes.yaxis.set_label_coords(0.0, 0.5)
        axes.set_title(
            "\n".join(notes[name]), fontsize=_LETTER_PT, loc="left", y=1.0, pad=2, linespacing=1.15
        )
        figure.text(
            left / WIDTH_IN,
            (top + above_in) / height_in,
            short(name),
            fontsize=9,
            weight="bold",
            va="top",
        )
        if column:
            axes.set_yticklabels([])
        else:
            name_parts(axes, len(conditions), DEVIANCE, small=True)
    below_in = height_in - head_in - rows * step_in
    log = "" if analysis.axis.signed else ", logarithmic"
    figure.text(
        0.5,
        (below_in - 0.02) / height_in,
        f"Level{log} ({analysis.axis.label})",
        fontsize=9,
        ha="center",
        va="top",
    )
    if analysis.mark:
        figure.text(0.5, 1 - 0.06 / height_in, analysis.mark, fontsize=9, ha="center", va="top")
    _explain(figure, analysis, (below_in - 0.18) / height_in)
    return figure


def _notes(analysis: Analysis, name: str) -> list[str]:
    """Return what is told of a person's thresholds, in lines as long as a panel is wide."""
    told = analysis.thresholds[analysis.thresholds["participant"].eq(name)]
    lines = []
    for condition, status, printed in zip(
        told["condition"], told["status"], told["printed"], strict=True
    ):
        words = f"no threshold: {_SHORT[status]}" if status in _SHORT else printed
        where = f"{short(condition)}: " if analysis.counts.conditions > 1 else ""
        lines += wrapped(where + words, _LETTERS, "  ")
    return lines


def _explain(figure: Figure, analysis: Analysis, top: float) -> None:
    """Put the signs into a key at the foot of the page."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    conditions = conditions_of(analysis)
    grey = "#404040"
    handles: list[Artist] = []
    for condition in conditions:
        colour, marker, line = look_of(analysis, condition)
        words = short(condition) if len(conditions) > 1 else "proportion and fitted function"
        handles.append(
            Line2D(
                [], [], color=colour, marker=marker, ls=line, mfc="white", ms=4, lw=1, label=words
            )
        )
    handles += [
        Line2D(
            [],
            [],
            color=grey,
            marker="|",
            ls="",
            ms=8,
            label=f"95 % interval ({analysis.ci.title()})",
        ),
        *(
            [Line2D([], [], color=grey, marker="o", ls="", ms=3, label=start_label(analysis))]
            if blanks_tell(analysis)
            else []
        ),
        Patch(color=grey, alpha=0.25, lw=0, label="95 % band of the function"),
        Line2D([], [], color=grey, marker="|", lw=2.6, ms=5.5, label="threshold, 95 % interval"),
    ]
    figure.legend(
        handles=handles,
        loc="upper center",
        bbox_to_anchor=(0.5, top),
        fontsize=_LETTER_PT,
        frameon=False,
        handlelength=2.8,
    )
