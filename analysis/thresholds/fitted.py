"""Psychometric functions of a data frame of counts: the call of a notebook."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.axis import Axis
from analysis.counts.intervals import checked_counts
from analysis.numbers import TOTAL
from analysis.thresholds.band import Draws, group_draws, person_draws
from analysis.thresholds.fit import WITH_THRESHOLD, check_function
from analysis.thresholds.group import group_posterior
from analysis.thresholds.guess import Guessing, GuessRate
from analysis.thresholds.likelihood import POINTS, checked_levels
from analysis.thresholds.people import PersonCounts, side_by_side, tables_and_likelihoods
from analysis.thresholds.table import group_table, thresholds_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from analysis.axis import XScale
    from analysis.thresholds.function import FunctionName

    Floats = NDArray[np.float64]

_KEY: Final = ["condition", "participant"]
_MAX_TICKS: Final = 9
"""Tested levels up to which each has a tick of its own on a logarithmic axis."""
_NAMES: Final = {
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
    counts : PersonCounts
        The counts to which the functions were fitted.
    axis : Axis
        The axis of the levels.

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
    counts: PersonCounts
    axis: Axis

    def __repr__(self) -> str:
        """Return the tables as text."""
        several = len({*self.people["condition"]}) > 1
        shown = [
            frame if several else frame.drop(columns="condition")
            for frame in (self.people, self.groups)
            if len(frame)
        ]
        return "\n\n".join(frame.map(_short).to_string(index=False) for frame in shown)

    def threshold_at(self, proportion: float) -> pd.DataFrame:
        """Return the levels at which a proportion of the stimuli is detected.

        Parameters
        ----------
        proportion : float
            Value of the psychometric function, guesses and lapses included, between 0 and 1.

        Returns
        -------
        pandas.DataFrame
            Columns condition, participant (``all`` for a group), level, low, high: posterior median
            and 95 % limits. Those outside the tested levels are NaN.

        Raises
        ------
        ValueError
            For a proportion that is not between 0 and 1.
        """
        if not 0 < proportion < 1:
            raise ValueError(f"proportion must lie between 0 and 1; got {proportion}")
        rows = []
        for name, row, drawn, x in self._functions():
            low, at, high = (math.nan,) * 3
            if row["status"] in ("ok", "lapse_at_bound"):
                places = np.quantile(drawn.places(proportion), POINTS, method="inverted_cdf")
                inside = (places >= x.min()) & (places <= x.max())
                low, at, high = (
                    self.axis.level(float(place)) if known else math.nan
                    for place, known in zip(places, inside, strict=True)
                )
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
        conditions, several = [*self.counts.conditions()], len(self.groups) > 0
        for name, row, drawn, x in self._functions():
            group, color = name[1] == TOTAL, f"C{conditions.index(name[0])}"
            if not group:
                i = self.counts.names.index(name)
                shown = self.counts.presented[i] > 0
                share = self.counts.detected[i, shown] / self.counts.presented[i, shown]
                alpha = 0.35 if several else 1.0
                axes.plot(self.counts.level_vpp[i, shown], share, "o", color=color, alpha=alpha)
            if row["status"] not in WITH_THRESHOLD or (several and not group):
                continue
            fine = np.linspace(x.min(), x.max(), 200)
            levels = np.array([self.axis.level(float(at)) for at in fine])
            label = name[0] if len(conditions) > 1 else None
            axes.fill_between(levels, *drawn.band(fine), color=color, alpha=0.2, lw=0)
            axes.plot(levels, np.median(drawn.values(fine), axis=1), color=color, label=label)
            at = self.axis.on_axis(np.array([row["threshold"]]))
            height = float(np.median(drawn.values(at)))
            low, high = row["low"], row["high"]
            ends = [levels[0] if np.isnan(low) else low, levels[-1] if np.isnan(high) else high]
            axes.plot(ends, [height] * 2, color=color, lw=2)
            axes.plot([row["threshold"]], [height], "D", color=color)
        if self.axis.x_scale == "log10":
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.xaxis.set_major_formatter(lambda level, _: f"{level:g}")
            tested = np.unique(self.counts.level_vpp[self.counts.presented > 0])
            if len(tested) <= _MAX_TICKS:
                axes.set_xticks(tested)
        axes.set(xlabel="level", ylabel="proportion detected", ylim=(-0.02, 1.02))
        if axes.get_legend_handles_labels()[1]:
            axes.legend()
        return axes

    def _functions(self) -> Iterator[tuple[tuple[str, str], pd.Series[Any], Draws, Floats]]:
        """Yield name, row, drawn functions and tested levels of all people and groups."""
        tables, likelihoods = tables_and_likelihoods(self.counts, self.axis)
        for _, row in self.people.iterrows():
            i = self.counts.names.index((row["condition"], row["participant"]))
            x = tables.x[i, tables.presented[i] > 0]
            yield self.counts.names[i], row, person_draws(tables, i), x
        for _, row in self.groups.iterrows():
            rows = self.counts.conditions()[row["condition"]]
            some, chosen = tables.at(rows), [likelihoods[i] for i in rows]
            drawn = group_draws(some, chosen, group_posterior(chosen, some.prior))
            yield (row["condition"], TOTAL), row, drawn, some.x[some.presented > 0]


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
        For a column that is missing, impossible counts or levels, another function or axis.

    Examples
    --------
    >>> counts = pd.DataFrame({"level": [50, 71, 100, 141], "k": [2, 9, 22, 29], "n": 30})
    >>> fits = fit(counts, level="level", detected="k", presented="n", guess_rate=0.05)
    >>> fits.threshold_at(0.75)["level"].round().tolist()
    [100.0]
    """
    named = {"level_vpp": level, "detected": detected, "presented": presented}
    missing = [
        name for name in (*named.values(), participant, condition) if name not in (None, *frame)
    ]
    if missing:
        raise ValueError(f"frame must have the columns that are named; {missing} are missing")
    check_function(function, x_scale)
    guess = guess_rate if isinstance(guess_rate, GuessRate) else GuessRate(mean=guess_rate)
    checked_levels(frame[level].to_numpy(), x_scale)
    k, n = checked_counts(frame[detected], frame[presented])
    table = pd.DataFrame(
        {
            "condition": frame[condition].astype(str) if condition else "main",
            "participant": frame[participant].astype(str) if participant else "1",
            "level_vpp": frame[level].astype(float),
            "detected": k,
            "presented": n,
        }
    )
    table = table[table["presented"] > 0].groupby([*_KEY, "level_vpp"], as_index=False).sum()
    if table.empty:
        raise ValueError("presented must hold at least one stimulus; got none")
    axis = Axis(x_scale=x_scale, unit="level")
    rate = Guessing(rate=guess, basis="given")
    people = side_by_side(table, lambda names: [rate] * len(names))
    people = replace(people, function=function)
    thresholds = thresholds_of(people, seed=0, axis=axis)
    groups = group_table(people, thresholds, axis)
    return PsychometricFits(
        people=_renamed(thresholds)[_PEOPLE],
        groups=_renamed(groups[groups["participants"] > 1])[_GROUPS],
        counts=people,
        axis=axis,
    )


def _renamed(table: pd.DataFrame) -> pd.DataFrame:
    return table.rename(columns=lambda name: _NAMES.get(name, name))


def _short(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
