"""Thresholds of participants and of their group, from checked trials."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.axis import VOLTS, alone, rounded, shortest, with_limits
from analysis.thresholds.fit import WITH_THRESHOLD, PsychometricFit, fit_many
from analysis.thresholds.goodness import deviance_p
from analysis.thresholds.people import GuessRate, people_of
from analysis.thresholds.posterior import STANDARD

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.fit import FitStatus
    from analysis.thresholds.people import PersonCounts

    Floats = NDArray[np.float64]


THRESHOLD_COLUMNS: Final = (
    "participant", "condition", "status", "threshold_vpp", "threshold_low_vpp",
    "threshold_high_vpp", "threshold_db", "threshold_low_db", "threshold_high_db", "printed",
    "sigma", "lapse_rate", "mle_threshold_vpp", "mle_sigma", "mle_lapse_rate", "deviance",
    "deviance_p", "guess_rate", "guess_basis", "threshold_guess_0_vpp",
    "threshold_guess_third_vpp", "levels", "trials",
)  # fmt: skip
GROUP_COLUMNS: Final = (
    "condition", "participants", "status", "median_vpp", "mean_vpp", "mean_low_vpp",
    "mean_high_vpp", "printed", "below", "above", "without",
)  # fmt: skip

WORDS: Final[Mapping[FitStatus, str]] = MappingProxyType(
    {
        "ok": "threshold found",
        "lapse_at_bound": "threshold found; misses at high levels are more than lapses allow",
        "one_level": "no threshold: one level only",
        "threshold_below_levels": "below the lowest level",
        "threshold_above_levels": "above the highest level",
        "decreasing": "no threshold: detection falls with level",
        "flat": "no threshold: detection does not rise with level",
        "separated": "no threshold: detection rises in one step",
    }
)
"""What a status means to a reader."""

_THIRD: Final = 1 / 3


def threshold_table(trials: pd.DataFrame, *, seed: int, axis: Axis = VOLTS) -> pd.DataFrame:
    """Return the threshold of every participant in every condition.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    seed : int
        Of the bootstrap behind ``deviance_p``.
    axis : Axis
        Of the psychometric function.

    Returns
    -------
    pandas.DataFrame
        Columns `THRESHOLD_COLUMNS`, defined in docs/statistics.md, section 8. dB are re 1 Vpp.

    Examples
    --------
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": np.repeat([60.0, 90.0, 120.0], 30), "reason": "",
    ...     "response": ["left"] * 4 + ["none"] * 40 + ["left"] * 46, "none_offered": True})
    >>> threshold_table(trials, seed=1)[["participant", "status", "printed"]].to_numpy().tolist()
    [['1', 'ok', '81.1 V (74.0 to 88.2)']]
    """
    return thresholds_of(people_of(trials), seed=seed, axis=axis)


def thresholds_of(people: PersonCounts, *, seed: int, axis: Axis) -> pd.DataFrame:
    """Return `threshold_table` of participants whose counts are known, from trials or not."""
    if not people.names:
        return pd.DataFrame(columns=list(THRESHOLD_COLUMNS))
    people = people.by_content()
    x = axis.on_axis(people.level_vpp)
    counts = (people.detected, people.presented)
    rates = [one.rate for one in people.guesses]
    fits = fit_many(x, *counts, guesses=rates)
    others = [
        fit_many(x, *counts, guesses=[GuessRate(mean=rate)] * len(rates), nodes=STANDARD)
        for rate in (0.0, _THIRD)
    ]
    misfits = deviance_p(x, *counts, fits=fits, guesses=rates, seed=seed)
    rows = [
        {
            "participant": participant,
            "condition": condition,
            **_numbers(fits[i], axis),
            "printed": printed(fits[i], people.level_vpp[i, people.presented[i] > 0], axis),
            "deviance_p": misfits[i],
            "guess_rate": people.guesses[i].rate.mean,
            "guess_basis": people.guesses[i].basis,
            "threshold_guess_0_vpp": axis.level(others[0][i].threshold),
            "threshold_guess_third_vpp": axis.level(others[1][i].threshold),
            "levels": int((people.presented[i] > 0).sum()),
            "trials": int(people.presented[i].sum()),
        }
        for i, (condition, participant) in enumerate(people.names)
    ]
    table = pd.DataFrame(rows, columns=list(THRESHOLD_COLUMNS))
    return table.sort_values(["condition", "participant"], ignore_index=True)


def _numbers(fit: PsychometricFit, axis: Axis) -> dict[str, object]:
    low, high = fit.threshold_limits
    at = [axis.level(value) for value in (fit.threshold, low, high)]
    decibel = [
        20 * value if axis.x_scale == "log10" else math.nan for value in (fit.threshold, low, high)
    ]
    return {
        "status": fit.status,
        **dict(zip(("threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"), at, strict=True)),
        **dict(
            zip(("threshold_db", "threshold_low_db", "threshold_high_db"), decibel, strict=True)
        ),
        "sigma": fit.sigma,
        "lapse_rate": fit.lapse_rate,
        "mle_threshold_vpp": axis.level(fit.mle_threshold),
        "mle_sigma": fit.mle_sigma,
        "mle_lapse_rate": fit.mle_lapse_rate,
        "deviance": fit.deviance,
    }


def printed(fit: PsychometricFit, levels_vpp: Floats, axis: Axis) -> str:
    """Return a threshold as a reader is told it, or why there is none.

    >>> printed(PsychometricFit(status="threshold_below_levels"), np.array([60.0, 200.0]), VOLTS)
    '< 60 V'
    """
    if fit.status == "threshold_below_levels":
        return f"< {shortest(levels_vpp.min())} {axis.unit}"
    if fit.status == "threshold_above_levels":
        return f"> {shortest(levels_vpp.max())} {axis.unit}"
    if fit.status not in WITH_THRESHOLD:
        return WORDS[fit.status]
    at, low, high = (axis.level(x) for x in (fit.threshold, *fit.threshold_limits))
    return with_limits(at, low, high, axis.unit)


def group_table(thresholds: pd.DataFrame, axis: Axis = VOLTS) -> pd.DataFrame:
    """Return the threshold of the group of each condition: its median and, if all have one, mean.

    Thresholds below and above the levels are censored, not missing: they take part in the median.
    Leaving them out would bias a mean; so mean and Student's t interval, on the axis of the
    function, are given only where everybody has a threshold.

    Parameters
    ----------
    thresholds : pandas.DataFrame
        From `threshold_table`.
    axis : Axis
        Its axis.

    Returns
    -------
    pandas.DataFrame
        Columns `GROUP_COLUMNS`; ``without`` lists who has none for another reason.

    Examples
    --------
    >>> person = {"condition": "main", "participant": "1", "status": "ok", "threshold_vpp": 100.0,
    ...           "printed": ""}
    >>> censored = person | {"participant": "2", "status": "threshold_below_levels",
    ...                      "threshold_vpp": math.nan, "printed": "< 60 V"}
    >>> third = censored | {"participant": "3"}
    >>> group_table(pd.DataFrame([person, censored, third]))["printed"].tolist()
    ['median < 60 V']
    """
    rows = [
        [condition, *_group(people, axis)]
        for condition, people in thresholds.groupby("condition", sort=True)
    ]
    return pd.DataFrame(rows, columns=list(GROUP_COLUMNS))


def _group(people: pd.DataFrame, axis: Axis) -> list[object]:
    """Return the values of a group, from ``participants`` on, of `GROUP_COLUMNS`."""
    statuses = people["status"].astype(object)
    volts = np.sort(people.loc[statuses.isin(WITH_THRESHOLD), "threshold_vpp"].to_numpy(float))
    below = _bounds(people.loc[statuses.eq("threshold_below_levels"), "printed"])
    above = _bounds(people.loc[statuses.eq("threshold_above_levels"), "printed"])
    without = sorted(people.loc[~statuses.isin([*WITH_THRESHOLD, *_CENSORED]), "participant"])
    x, least, most = (axis.on_axis(values) for values in (volts, above, below))
    status, median, words = _median(
        np.concatenate([np.full(len(below), -np.inf), x, least]),
        np.concatenate([most, x, np.full(len(above), np.inf)]),
        axis,
    )
    mean = [math.nan] * 3
    if len(volts) == len(people) and len(volts) > 1:
        mean = [axis.level(value) for value in _t_interval(x)]
        words += f"; mean {with_limits(mean[0], mean[1], mean[2], axis.unit)}"
    if without:
        words += f"; without one: {', '.join(without)}"
    return [len(people), status, median, *mean, words, len(below), len(above), ", ".join(without)]


_CENSORED: Final = ("threshold_below_levels", "threshold_above_levels")


def _bounds(words: pd.Series[str]) -> Floats:
    """Return the levels in statements like "< 60 V"."""
    return np.array([float(word.split()[1]) for word in words], dtype=np.float64)


def _median(lower: Floats, upper: Floats, axis: Axis) -> tuple[str, float, str]:
    """Return status, value and words of the median of thresholds between bounds on the axis.

    A median grows with each of its values, so it lies between those of the bounds.
    """
    if not len(lower):
        return "none", math.nan, "no threshold"
    ends = [_middle(np.sort(bound)) for bound in (lower, upper)]
    low, high = (axis.level(end) for end in ends)
    if low == high:
        return "ok", low, f"median {alone(low, axis.unit)}"
    known = (math.isfinite(ends[0]), math.isfinite(ends[1]))
    if known == (False, True):
        return _CENSORED[0], math.nan, f"median < {_short(high)} {axis.unit}"
    if known == (True, False):
        return _CENSORED[1], math.nan, f"median > {_short(low)} {axis.unit}"
    least, most = (rounded(end, high - low) for end in (low, high))
    between = f"median between {least} and {most} {axis.unit}"
    return "none", math.nan, between if all(known) else "no median: it may lie anywhere"


def _middle(ranked: Floats) -> float:
    """Return the middle, or the mean of the two in the middle, without adding infinities."""
    low, high = float(ranked[(len(ranked) - 1) // 2]), float(ranked[len(ranked) // 2])
    return low if low == high else (low + high) / 2


def _short(level_vpp: float) -> str:
    return shortest(float(rounded(level_vpp, abs(level_vpp) / 10)))


def _t_interval(x: Floats) -> tuple[float, float, float]:
    """Return mean and 95 % limits by Student's t."""
    from scipy.special import stdtrit

    mean = math.fsum(x) / len(x)
    half = float(stdtrit(len(x) - 1, 0.975)) * float(x.std(ddof=1)) / math.sqrt(len(x))
    return mean, mean - half, mean + half
