"""Psychometric functions of a data frame of counts: the call of a notebook."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.numbers import TOTAL
from analysis.thresholds.band import drawn_functions
from analysis.thresholds.fit import WITH_FUNCTION, WITH_THRESHOLD
from analysis.thresholds.likelihood import POINTS
from analysis.thresholds.table import group_table, thresholds_of
from analysis.thresholds.tables import checked_tables, tables_of_counts

if TYPE_CHECKING:
    from collections.abc import Hashable, Iterator

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from analysis.axis import Axis, XScale
    from analysis.thresholds.function import FunctionName
    from analysis.thresholds.guess import GuessRate
    from analysis.thresholds.likelihood import Tables

    Floats = NDArray[np.float64]

_KEY: Final = ["condition", "participant"]
_MAX_TICKS: Final = 9
"""Tested levels up to which each has a tick of its own on a logarithmic axis."""
_NAMES: Final[dict[Hashable, str]] = {
    "threshold_vpp": "threshold",
    "threshold_low_vpp": "low",
    "threshold_high_vpp": "high",
    "guess_posterior": "guess",
    "spread_db": "spread",
    "new_low_vpp": "next_low",
    "new_high_vpp": "next_high",
}
_THRESHOLD: Final = ["status", "threshold", "low", "high", "sigma"]
_PEOPLE: Final = [*_KEY, *_THRESHOLD, "lapse_rate", "guess", "deviance", "deviance_p"]
_GROUPS: Final = ["condition", "participants", *_THRESHOLD, "spread", "next_low", "next_high"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PsychometricFits:
    """The psychometric functions of all participants and conditions of a table.

    Attributes
    ----------
    people : pandas.DataFrame
        A row for each participant in each condition: ``status``, ``threshold`` with 95 % limits
        ``low`` and ``high``, ``sigma``, ``lapse_rate``, ``guess`` (posterior means), the
        ``deviance`` of the likeliest function and its bootstrap p. Thresholds are in the unit of
        the levels; sigma is in log10 units, or in the unit of the levels on a linear axis. An open
        limit is NaN.
    groups : pandas.DataFrame
        The same of the group in each condition with several participants. ``spread`` is the
        standard deviation of thresholds between people, in dB or in the unit of the levels;
        ``next_low`` and ``next_high`` are the 95 % prediction interval of the next participant.
    counts : Tables
        The counts to which the functions were fitted.

    Examples
    --------
    `fit` returns one, which prints itself as a table:

    >>> counts = pd.DataFrame({"level": [50, 71, 100, 141], "k": [2, 9, 22, 29], "n": 30})
    >>> fit(counts, level="level", detected="k", presented="n", guess_rate=0.05)
    participant status threshold  low high sigma lapse_rate guess deviance deviance_p
              1     ok      83.3 75.2 91.8  0.11     0.0368  0.05   0.0389       0.96
    """

    people: pd.DataFrame
    groups: pd.DataFrame
    counts: Tables

    @property
    def axis(self) -> Axis:
        """The axis of the levels."""
        return self.counts.axis

    def __repr__(self) -> str:
        """Return the tables as text."""
        several = len({*self.people["condition"]}) > 1
        shown = [
            frame if several else frame.drop(columns="condition")
            for frame in (self.people, self.groups)
            if len(frame)
        ]
        texts = [frame.to_string(index=False, float_format="{:.3g}".format) for frame in shown]
        return "\n\n".join(texts)

    def threshold_at(self, proportion: float) -> pd.DataFrame:
        """Return the levels at which a proportion of the stimuli is detected.

        Parameters
        ----------
        proportion : float
            Value of the psychometric function, guesses and lapses included, between 0 and 1.

        Returns
        -------
        pandas.DataFrame
            Columns condition, participant (``all`` for the typical participant of a group, whose
            threshold is the group's), level, low, high: posterior median and 95 % limits. Those
            outside the tested levels are NaN.

        Raises
        ------
        ValueError
            For a proportion that is not between 0 and 1.
        """
        if not 0 < proportion < 1:
            raise ValueError(f"proportion must lie between 0 and 1; got {proportion}")
        rows = []
        for name, row, people in self._functions():
            low, at, high = (math.nan,) * 3
            if row["status"] in WITH_FUNCTION:
                drawn = drawn_functions(people, typical=True).places(proportion)
                places = np.asarray(np.quantile(drawn, POINTS, method="inverted_cdf"), float)
                x = self.axis.on_axis(people.tested)
                inside = (places >= x[0]) & (places <= x[-1])
                low, at, high = np.where(inside, self.axis.level(places), math.nan).tolist()
            rows.append((*name, at, low, high))
        return pd.DataFrame(rows, columns=[*_KEY, "level", "low", "high"])

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the counts, the functions with their 95 % bands, and the thresholds.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; a new figure by default.

        Returns
        -------
        matplotlib.axes.Axes
        """
        import matplotlib.pyplot as plt

        axes = axes or plt.figure(layout="constrained").add_subplot()
        conditions, several = [*self.counts.conditions], len(self.groups) > 0
        for name, row, people in self._functions():
            group, color = name[1] == TOTAL, f"C{conditions.index(name[0])}"
            if not group:
                shown = people.presented > 0
                share = people.detected[shown] / people.presented[shown]
                alpha = 0.35 if several else 1.0
                axes.plot(people.levels[shown], share, "o", color=color, alpha=alpha)
            if row["status"] not in WITH_THRESHOLD or (several and not group):
                continue
            drawn = drawn_functions(people)
            low, high = self.axis.on_axis(people.tested[[0, -1]]).tolist()
            fine = np.linspace(low, high, 200)
            levels = self.axis.level(fine)
            label = name[0] if len(conditions) > 1 else None
            axes.fill_between(levels, *drawn.band(fine), color=color, alpha=0.2, lw=0)
            axes.plot(levels, np.median(drawn.at(fine[:, None]), axis=1), color=color, label=label)
            at = self.axis.on_axis(np.array(row["threshold"]))
            height = float(np.median(drawn.at(at)))
            low, high = row["low"], row["high"]
            ends = [levels[0] if np.isnan(low) else low, levels[-1] if np.isnan(high) else high]
            axes.plot(ends, [height] * 2, color=color, lw=2)
            axes.plot([row["threshold"]], [height], "D", color=color)
        if self.axis.x_scale == "log10":
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.xaxis.set_major_formatter(lambda level, _: f"{level:g}")
            if len(self.counts.tested) <= _MAX_TICKS:
                axes.set_xticks(self.counts.tested)
        axes.set(xlabel="level", ylabel="proportion detected", ylim=(-0.02, 1.02))
        if axes.get_legend_handles_labels()[1]:
            axes.legend()
        return axes

    def _functions(self) -> Iterator[tuple[tuple[str, str], pd.Series[Any], Tables]]:
        """Yield the name, the row and the counts of all people, then of all groups."""
        for _, row in self.people.iterrows():
            name = row["condition"], row["participant"]
            yield name, row, self.counts.at([self.counts.names.index(name)])
        for _, row in self.groups.iterrows():
            yield (row["condition"], TOTAL), row, self.counts.conditions[row["condition"]]


def fit(
    frame: pd.DataFrame,
    *,
    level: str,
    detected: str,
    presented: str,
    guess_rate: float | GuessRate,
    participant: str | None = None,
    condition: str | None = None,
    function: FunctionName = "normal",
    x_scale: XScale = "log10",
) -> PsychometricFits:
    """Fit psychometric functions to a table of counts.

    Priors, method and coverage: docs/statistics.md, section 8.

    Parameters
    ----------
    frame : pandas.DataFrame
        A row for each level of each participant and condition; equal levels are pooled.
    level, detected, presented : str
        Columns of the level, of the number of stimuli detected, and of the number presented.
    guess_rate : float or GuessRate
        As for `fit_psychometric`; `GuessRate.after_blanks` for one that blank trials estimate.
    participant, condition : str, optional
        Columns of the participant and of the condition; by default there is one of each.
    function, x_scale : str
        As for `fit_psychometric`.

    Returns
    -------
    PsychometricFits

    Raises
    ------
    ValueError
        For a column or a name that is missing, impossible counts or levels, another function or
        axis.

    Examples
    --------
    >>> counts = pd.DataFrame({"level": [50, 71, 100, 141], "k": [2, 9, 22, 29], "n": 30})
    >>> fits = fit(counts, level="level", detected="k", presented="n", guess_rate=0.05)
    >>> fits.threshold_at(0.75)["level"].round().tolist()
    [100.0]
    """
    named = {"level_vpp": level, "detected": detected, "presented": presented}
    names = [name for name in (participant, condition) if name is not None]
    wrong = [name for name in (*named.values(), *names) if [*frame].count(name) != 1]
    if wrong:
        raise ValueError(f"frame must have the columns that are named, each once; got {wrong}")
    for name in names:
        if frame[name].isna().any():
            raise ValueError(f"column {name!r} must hold a name in each row")
    if participant is not None and frame[participant].astype(str).eq(TOTAL).any():
        raise ValueError(f'column {participant!r} must not hold "{TOTAL}", which names a group')
    counts = frame[level], [frame[detected]], [frame[presented]]
    tables = checked_tables(*counts, guess_rate, x_scale=x_scale, function=function)
    table = pd.DataFrame(
        {
            "condition": frame[condition].astype(str) if condition is not None else "main",
            "participant": frame[participant].astype(str) if participant is not None else "1",
            "level_vpp": frame[level].astype(float),
            "detected": tables.detected[0],
            "presented": tables.presented[0],
        }
    )
    table = table[table["presented"] > 0].groupby([*_KEY, "level_vpp"], as_index=False).sum()
    people = tables_of_counts(table.assign(none_offered=True), axis=tables.axis)
    people = replace(people, guesses=[tables.guesses[0]] * len(people), function=function)
    thresholds = thresholds_of(people, seed=0)
    groups = group_table(people, thresholds)
    return PsychometricFits(
        people=thresholds.rename(columns=_NAMES)[_PEOPLE],
        groups=groups[groups["participants"] > 1].rename(columns=_NAMES)[_GROUPS],
        counts=people,
    )
