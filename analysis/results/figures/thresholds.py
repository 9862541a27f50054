"""The figure of thresholds: each participant's with its interval, and the group's."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.definitions import TOTAL
from analysis.results.figures.drawing import (
    GROUP,
    Sheet,
    in_words,
    key,
    level_axis,
    of_people,
    panels,
    short,
)

if TYPE_CHECKING:
    from typing import TypeAlias

    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from analysis.axis import Axis
    from analysis.results.tables import Analysis

    _Span: TypeAlias = tuple[float, float, float]  # its place, then its limits

_BELOW: Final = ("threshold_below_levels", "median_below_levels")
_ABOVE: Final = ("threshold_above_levels", "median_above_levels")

_PERSON = "black"
_WORDS_COLOUR = "#595959"
_NAMED = 60
_OF_PAIRS = (
    " Below, by how much the threshold of each participant differs between two conditions, with "
    "its 95 % interval and that of the mean of people like them. Each is of that participant's own "
    "answers, drawn towards the others in the slope only, and may lie on either side of the ratio "
    "of both thresholds, which have priors."
)
_ROW_IN = 0.21
_TALLEST_IN = 9.0
_AROUND_IN = 2.0
_BEYOND = 0.35
_MOST_PAIRS = 3
_POINTED = dict.fromkeys(_BELOW, "<") | dict.fromkeys(_ABOVE, ">")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Mark:
    """A line of the figure: a value with its limits, an arrow at an end, or words."""

    name: str
    at: float
    low: float
    high: float
    status: str
    words: str
    colour: str
    new: tuple[float, float] = (np.nan, np.nan)  # where another person's is expected


def sheets(analysis: Analysis) -> list[Sheet]:
    """Return the figure; none where there are no thresholds."""
    if analysis.thresholds.empty:
        return []
    people = of_people(analysis.thresholds["participant"])
    shown = f"Thresholds in {analysis.axis.label} with 95 % intervals, {people}"
    return [
        Sheet(
            title="Thresholds of participants and group",
            caption="Each line is a threshold with its 95 % interval; an arrow stands where it "
            "lies outside the tested levels, and where a limit is open."
            + (_OF_PAIRS if _pairs(analysis) else ""),
            alt=in_words(analysis, shown, "numbers are in the tables of thresholds"),
            draw=partial(draw, analysis),
        )
    ]


def draw(analysis: Analysis) -> Figure:
    """Draw one line for each participant, and the group's below.

    A threshold outside the tested levels is an arrow at their end, with the limit that is known;
    an open limit runs to the end of the axis; where there is none the reason stands in words. Above
    60 participants the lines are ordered by threshold and not named.
    """
    conditions, pairs = list(analysis.groups["condition"]), _pairs(analysis)
    rows = [_rows(analysis, condition) for condition in conditions]
    apart = [_differences(analysis, *pair) for pair in pairs]
    heights = [_AROUND_IN + min(_ROW_IN * len(each), _TALLEST_IN) for each in (*rows, *apart)]
    titles = [f"{short(b)} against {short(a)}" for a, b in pairs]
    unit = "dB" if analysis.axis.is_logarithmic else analysis.axis.label
    figure, axes = panels([*conditions, *titles], heights, analysis.mark)
    for panel, each in zip(axes, rows, strict=False):
        levels_vpp = analysis.participants["level_vpp"].to_numpy(dtype=float)
        _draw(panel, each, levels_vpp, analysis.axis)
        key(panel, columns=1)
    of_pairs = zip(axes[len(rows) :], apart, titles, pairs, strict=True)
    for panel, each, title, (_, b) in of_pairs:
        panel.set_title(title, fontsize=11)
        _compare(panel, each, unit, short(b))
    return figure


def _pairs(analysis: Analysis) -> list[tuple[str, str]]:
    """Return the pairs of conditions in which the same people took part; none where too many."""
    people = analysis.differences[analysis.differences["participant"].ne(TOTAL)]
    pairs = people[["condition_a", "condition_b"]].drop_duplicates()
    found = [(str(a), str(b)) for a, b in pairs.itertuples(index=False)]
    return found if len(found) <= _MOST_PAIRS else []


def _differences(analysis: Analysis, a: str, b: str) -> list[_Mark]:
    table = analysis.differences
    table = table[table["condition_a"].eq(a) & table["condition_b"].eq(b)]
    people, group = (table[table["participant"].eq(TOTAL) == total] for total in (False, True))
    if len(people) > _NAMED:
        people = people.sort_values("difference_db", kind="stable")
    rows = [_difference(str(one["participant"]), one, _PERSON) for _, one in people.iterrows()]
    if len(rows) > 1:
        rows.append(_difference(f"group of {len(rows)}", group.iloc[0], GROUP))
    return rows


def _difference(name: str, one: pd.Series[Any], colour: str) -> _Mark:
    at, low, high = (float(one[f"{column}_db"]) for column in ("difference", "low", "high"))
    if np.isfinite([at, low, high]).any():  # what a table calls n/a is an open limit
        low, high = (-np.inf if np.isnan(low) else low), (np.inf if np.isnan(high) else high)
    status = str(one["status"])
    return _Mark(
        name=name,
        at=at,
        low=low,
        high=high,
        status=status,
        words=status.replace("_", " "),
        colour=colour,
    )


def _rows(analysis: Analysis, condition: str) -> list[_Mark]:
    people = analysis.thresholds[analysis.thresholds["condition"].eq(condition)]
    group = analysis.groups[analysis.groups["condition"].eq(condition)].iloc[0]
    if len(people) > _NAMED:
        rank = people["threshold_vpp"].astype(float)
        rank = rank.mask(people["status"].isin(_BELOW), -np.inf).mask(
            people["status"].isin(_ABOVE), np.inf
        )
        people = people.iloc[np.argsort(rank.to_numpy(), kind="stable")]
    rows = [_row(str(one["participant"]), one) for _, one in people.iterrows()]
    if group["participants"] > 1:
        row = _row(f"group of {group['participants']}", group, GROUP)
        if not np.isnan(row.at):  # what a table calls n/a is an open limit
            low, high = float(group["new_low_vpp"]), float(group["new_high_vpp"])
            row = replace(
                row, new=(-np.inf if np.isnan(low) else low, np.inf if np.isnan(high) else high)
            )
        rows.append(row)
    return rows


def _row(name: str, one: pd.Series[Any], colour: str = _PERSON) -> _Mark:
    at, low, high = (
        float(one[column])
        for column in ("threshold_vpp", "threshold_low_vpp", "threshold_high_vpp")
    )
    status = str(one["status"])
    if status in _POINTED or not np.isnan(at):  # what a table calls n/a is an open limit
        low, high = (-np.inf if np.isnan(low) else low), (np.inf if np.isnan(high) else high)
    return _Mark(
        name=name,
        at=at,
        low=low,
        high=high,
        status=status,
        words=f"none: {status.replace('_', ' ')}",
        colour=colour,
    )


def _draw(axes: Axes, rows: list[_Mark], levels_vpp: Any, axis: Axis) -> None:
    level_axis(axes, levels_vpp, axis, beyond=_BEYOND)
    _draw_rows(axes, rows, _just_outside(axes, levels_vpp))
    log = "" if axis.signed else ", log."
    axes.set_xlabel(f"Threshold ({axis.label}{log})")
    _explain(axes, rows)


def _compare(axes: Axes, rows: list[_Mark], unit: str, higher: str) -> None:
    """Draw a line for each participant's difference of thresholds, and the group's below.

    Above 0 the threshold is higher in the condition `higher`.
    """
    ends = [end for row in rows for end in (row.at, row.low, row.high) if np.isfinite(end)]
    most = max(map(abs, ends), default=1.0) or 1.0
    left, right = (
        min(-most / 5, 1.1 * min(ends, default=0)),
        max(most / 5, 1.1 * max(ends, default=0)),
    )
    axes.set_xlim(left, right)
    axes.grid(color="#E5E5E5", lw=0.6)
    axes.set_axisbelow(True)
    axes.axvline(0.0, color="black", lw=0.8)
    _draw_rows(axes, rows, (left, right))
    axes.set_xlabel(f"Difference of thresholds ({unit})\nabove 0: higher in {higher}")


def _draw_rows(axes: Axes, rows: list[_Mark], outside: tuple[float, float]) -> None:
    """Draw a line for each; what lies outside the levels is an arrow at these places."""
    named = len(rows) <= _NAMED + 1
    # What looks alike is drawn at once: a call for each of a thousand people would take seconds.
    spans: dict[tuple[bool, str], list[_Span]] = defaultdict(list)
    points: dict[tuple[str, str, str, float], list[tuple[float, float]]] = defaultdict(list)
    for place, row in enumerate(rows):
        if row.status in _POINTED:
            where = outside[row.status in _ABOVE]
            look = (_POINTED[row.status], row.colour, row.colour, 6.0)
            points[look].append((where, place))
        elif not np.isnan(row.at):
            filled = "white" if row.status == "separated" else row.colour
            marker = "D" if row.colour == GROUP else "o"
            points[marker, row.colour, filled, 4.0 if named else 2.0].append((row.at, place))
            if not np.isnan(row.new[0]):
                spans[False, row.colour].append((place, *row.new))
        elif named and np.isnan(row.low):
            told = axes.annotate(
                row.words,
                (0.02, place),
                xycoords=("axes fraction", "data"),
                va="center",
                fontsize=7,
                color=_WORDS_COLOUR,
            )
            told.set_in_layout(False)
        if not np.isnan(row.low):
            spans[True, row.colour].append((place, row.low, row.high))
    for (strong, colour), each in sorted(spans.items()):  # faint ones are below
        _draw_limits(axes, each, colour, faint=not strong)
    for (marker, colour, filled, size), at in points.items():
        axes.plot(
            *np.transpose(at), color=colour, marker=marker, mfc=filled, ms=size, ls="", zorder=3
        )
    axes.set_ylim(len(rows) - 0.4, -0.6)
    shown = range(len(rows)) if named else [i for i, r in enumerate(rows) if r.colour == GROUP]
    axes.set_yticks([*shown], [short(rows[i].name) for i in shown], fontsize=7)
    axes.set_ylabel("Participant" if named else f"{len(rows) - len([*shown])} participants")
    axes.grid(visible=False, axis="y")


def _draw_limits(axes: Axes, spans: list[_Span], colour: str, *, faint: bool) -> None:
    """Draw lines from limit to limit; one beyond the axis ends in an arrow there."""
    left, right = axes.get_xlim()
    alpha = 0.4 if faint else 1.0
    places, lows, highs = np.transpose(spans)
    axes.hlines(
        places,
        np.maximum(lows, left),
        np.minimum(highs, right),
        color=colour,
        lw=1.0 if faint else 1.4,
        alpha=alpha,
    )
    for limits, arrow, beyond in ((lows, "<", lows < left), (highs, ">", highs > right)):
        at = np.clip(limits, left, right)
        for marker, these in ((arrow, beyond), ("|", ~beyond)):
            if these.any():
                axes.plot(
                    at[these],
                    places[these],
                    color=colour,
                    marker=marker,
                    ms=4,
                    ls="",
                    clip_on=False,
                    alpha=alpha,
                )


def _just_outside(axes: Axes, levels_vpp: Any) -> tuple[float, float]:
    """Return the places a quarter of the way from the outermost levels to the axis's ends."""
    left, right = axes.get_xlim()
    low, high = float(np.min(levels_vpp)), float(np.max(levels_vpp))
    if axes.get_xscale() == "log":
        return low * (left / low) ** 0.25, high * (right / high) ** 0.25
    return low + (left - low) / 4, high + (right - high) / 4


def _explain(axes: Axes, rows: list[_Mark]) -> None:
    """Put into the key what the panel has."""
    held = {row.status for row in rows}
    if any(not np.isnan(row.at) and row.colour == _PERSON for row in rows):
        told = "threshold, 95 % interval"
        axes.plot([], [], color=_PERSON, marker="o", ms=4, lw=1.4, label=told)
    if "separated" in held:
        axes.plot(
            [],
            [],
            color=_PERSON,
            marker="o",
            mfc="white",
            ms=4,
            lw=1.4,
            label="rises in one step: slope unknown",
        )
    for statuses, words in (
        (_BELOW, "(probably) below the lowest tested level"),
        (_ABOVE, "(probably) above the highest tested level"),
    ):
        if held.intersection(statuses):
            pointed = _POINTED[statuses[0]]
            axes.plot([], [], color=_PERSON, marker=pointed, ls="", ms=6, label=words)
    if any(row.colour == GROUP for row in rows):
        told = "group, everybody taking part, 95 % interval"
        axes.plot([], [], color=GROUP, marker="D", ms=4, lw=1.4, label=told)
        if any(not np.isnan(row.new[0]) for row in rows):
            axes.plot(
                [],
                [],
                color=GROUP,
                marker="|",
                ms=4,
                lw=1.0,
                alpha=0.4,
                label="another person's threshold, 95 %",
            )
