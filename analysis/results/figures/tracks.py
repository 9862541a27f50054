"""Levels that a rule chose, trial by trial, with the answers and the threshold."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.results.figures.axes import (
    alike_labels,
    figure_of,
    level_label,
    level_ticks,
    round_ticks,
    text_em,
)
from analysis.results.figures.curves import looks_of
from analysis.results.figures.detection import MIN_PANEL_MM, pages_of
from analysis.results.figures.drawing import DEFAULT_STYLE, Look, handle, lay_out
from analysis.results.rendering import short

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.results.analysis import Analysis
    from analysis.results.figures.drawing import Style

_BLACK: Final = Look("black", "o")
_MARGIN: Final = 0.06
_BAND_ALPHA: Final = 0.18


def tracks_of(analysis: Analysis) -> pd.DataFrame:
    """Return the trials whose levels a rule chose: ``participant condition trial level_vpp hit``.

    ``trial`` counts the presentations of a session in their order; ``hit`` is whether the trial
    counts as detected.
    """
    trials = analysis.trials
    order = trials.groupby(["participant", "session"]).cumcount() + 1
    trials = trials.assign(trial=order)
    plans = [session.plan for session in analysis.loaded.progress]
    chosen = {
        (plan.participant, plan.session, condition)
        for plan in plans
        for condition in plan.level_rules
    }
    keys = zip(trials["participant"], trials["session"], trials["condition"], strict=True)
    is_chosen = np.fromiter((key in chosen for key in keys), bool, len(trials))
    rows = trials[is_chosen & trials["reason"].eq("") & trials["kind"].eq("single")]
    answers = zip(rows["side"], rows["response"], strict=True)
    hits = [analysis.task.is_detected(side, str(response)) for side, response in answers]
    names = ["participant", "condition", "trial", "level_vpp"]
    return rows[names].astype({"condition": object}).assign(hit=hits)


def plot_tracks(
    analysis: Analysis,
    ax: Axes | None = None,
    *,
    names: Sequence[str] = (),
    style: Style = DEFAULT_STYLE,
) -> Figure:
    """Draw the levels of each participant against the trial, in a panel each.

    Filled symbols are trials that count as detected; the band is the 95 % interval of the
    threshold. Conditions have the colours of the other figures. Without `names`, the first page.
    """
    rows, names = tracks_of(analysis), names or pages_of(analysis)[0]
    looks, thresholds = looks_of(analysis), analysis.thresholds
    columns = min(len(names), max(2, round(style.width_mm / MIN_PANEL_MM)))
    log = not analysis.axis.signed
    ticks = level_ticks(rows["level_vpp"], log=log)
    trials = round_ticks(0.0, float(rows["trial"].max()), log=False, intervals=3)
    look = next(iter(looks.values())) if len(looks) == 1 else _BLACK
    with style.applied(ax):
        tick_em = max(map(text_em, alike_labels(ticks)))
        panel_em = style.width_em * min(0.58, 0.8 / columns)
        threshold = f"{analysis.words['threshold']}, 95 %"
        panels = lay_out(
            style,
            ax,
            rows_em=[panel_em] * -(-len(names) // columns),
            columns=(1,) * columns,
            titles=[*map(short, names)],
            labels=("Trial", level_label(analysis.axis)),
            handles=[
                handle(look, analysis.words["detected"], ls="", ms=3, mfc=look.colour),
                handle(look, f"not {analysis.words['detected']}", ls="", ms=3),
                handle(look, threshold, marker="", ls="-", lw=0.9),
            ],
            shared="xy",
            tick_em=tick_em,
            gap_em=(1.8, 2.1),
            note=analysis.mark,
        )
        low, high = rows["level_vpp"].min(), rows["level_vpp"].max()
        room = (high / low) ** _MARGIN if log else _MARGIN * (high - low)
        ends = (low / room, high * room) if log else (low - room, high + room)
        right = max(trials[-1], (1 + _MARGIN) * float(rows["trial"].max()))
        panels[0].set(yscale="log" if log else "linear", ylim=ends, xlim=(0, right))
        panels[0].minorticks_off()
        panels[0].set_yticks(ticks, alike_labels(ticks))
        panels[0].set_xticks(trials, alike_labels(trials))
        for panel, name in zip(panels, names, strict=True):
            for condition, look in looks.items():
                is_here = rows["participant"].eq(name) & rows["condition"].eq(condition)
                _draw_track(panel, rows[is_here], look)
                fitted = thresholds["participant"].eq(name) & thresholds["condition"].eq(condition)
                for row in thresholds[fitted].to_dict("records") if is_here.any() else ():
                    _draw_threshold(panel, row, look)
    return figure_of(panels[0])


def _draw_track(axes: Axes, rows: pd.DataFrame, look: Look) -> None:
    axes.plot(rows["trial"], rows["level_vpp"], color=look.colour, lw=0.5, alpha=0.5, zorder=2)
    symbols: dict[str, Any] = {"ls": "", "marker": look.marker, "color": look.colour, "ms": 3}
    for hit, fill in ((True, look.colour), (False, "white")):
        shown = rows[rows["hit"].eq(hit)]
        axes.plot(shown["trial"], shown["level_vpp"], **symbols, mfc=fill, mew=0.6, zorder=3)


def _draw_threshold(axes: Axes, row: dict[Any, Any], look: Look) -> None:
    """Draw a threshold with its band; an open end reaches to the edge of the panel."""
    bottom, top = axes.get_ylim()
    at, low, high = (row[f"threshold{part}_vpp"] for part in ("", "_low", "_high"))
    if not np.isfinite(at):
        return
    low, high = (end if np.isfinite(end) else edge for end, edge in ((low, bottom), (high, top)))
    axes.axhspan(max(low, bottom), min(high, top), color=look.colour, alpha=_BAND_ALPHA, lw=0)
    if bottom < at < top:
        axes.axhline(at, color=look.colour, lw=0.9, zorder=1)
