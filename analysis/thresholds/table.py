"""Thresholds of participants and of their group, from checked trials."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd

from analysis.answers.counting import NEEDED, require_columns
from analysis.axis import VOLTS, alike, between, bounded, spread_of, with_limits
from analysis.definitions import in_order
from analysis.thresholds.density import Ruler
from analysis.thresholds.fit import (
    BOUNDED,
    WITH_THRESHOLD,
    PsychometricFit,
    fit_many,
)
from analysis.thresholds.goodness import deviance_p
from analysis.thresholds.grid import surfaces
from analysis.thresholds.people import FORCED_CHOICE, GuessRate, people_of
from analysis.thresholds.posterior import posterior, within_levels
from experiment.names import require_whole

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.thresholds.fit import FitStatus
    from analysis.thresholds.people import PersonCounts

    Floats = NDArray[np.float64]


THRESHOLD_COLUMNS: Final = (
    "participant",
    "condition",
    "status",
    "threshold_vpp",
    "threshold_low_vpp",
    "threshold_high_vpp",
    "threshold_db",
    "threshold_low_db",
    "threshold_high_db",
    "printed",
    "sigma",
    "lapse_rate",
    "mle_threshold_vpp",
    "mle_sigma",
    "mle_lapse_rate",
    "deviance",
    "deviance_p",
    "guess_rate",
    "guess_basis",
    "guess_posterior",
    "threshold_guess_0_vpp",
    "threshold_guess_third_vpp",
    "varied_low_vpp",
    "varied_high_vpp",
    "varied_printed",
    "levels",
    "trials",
)

WORDS: Final[Mapping[FitStatus, str]] = MappingProxyType(
    {
        "ok": "threshold found",
        "lapse_at_bound": "threshold found; misses at high levels are more than lapses allow",
        "one_level": "no threshold: one level only",
        "threshold_below_levels": "below the lowest level",
        "threshold_above_levels": "above the highest level",
        "decreasing": "no threshold: detection falls with level",
        "flat": "no threshold: detection does not rise with level",
        "separated": "threshold found, slope unknown: detection rises in one step",
        "median_below_levels": "probably below the lowest level",
        "median_above_levels": "probably above the highest level",
    }
)
"""What a status means to a reader."""

_THIRD: Final = 1 / 3

_VARIED_COLUMNS: Final = ("varied_low_vpp", "varied_high_vpp", "varied_printed")
VARIED: Final = 2.8
"""Variance of real answers over the binomial one, near threshold, where "none" is offered.

Quarters of a block in M. Grund et al., J. Neurosci. 42 (2022) 643-656; docs/statistics.md, 8.
"""


def threshold_table(trials: pd.DataFrame, *, seed: int, axis: Axis = VOLTS) -> pd.DataFrame:
    """Return the threshold of every participant in every condition.

    Parameters
    ----------
    trials : pandas.DataFrame
        From `analysis.read_trials`.
    seed : int
        Of the bootstrap behind ``deviance_p``, 0 or more.
    axis : Axis
        What the levels are, see `analysis.axis.Axis`: by default peak-to-peak volts, the function
        normal in their logarithm.

    Returns
    -------
    pandas.DataFrame
        A row for each participant in each condition, with the columns of thresholds.csv but those
        in micrometres: docs/statistics.md, section 8, defines them. dB are re 1 Vpp.

    Raises
    ------
    ValueError
        For a table without a column that is needed, as `analysis.read_trials` gives them, and a
        seed that is no whole number of at least 0.

    Examples
    --------
    >>> import numpy as np
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": np.repeat([60.0, 90.0, 120.0], 30), "reason": "",
    ...     "response": ["left"] * 4 + ["none"] * 40 + ["left"] * 46, "none_offered": True})
    >>> threshold_table(trials, seed=1)[["participant", "status", "printed"]].to_numpy().tolist()
    [['1', 'ok', '89.5 V (79.6 to 95.4)']]
    """
    require_columns(trials, (*NEEDED, "none_offered"))
    require_whole("seed", seed, 0)
    return thresholds_of(people_of(trials), seed=seed, axis=axis)


def thresholds_of(people: PersonCounts, *, seed: int, axis: Axis) -> pd.DataFrame:
    """Return `threshold_table` of participants whose counts are known, from trials or not."""
    if not people.names:
        return pd.DataFrame(columns=list(THRESHOLD_COLUMNS))
    people = people.by_content()
    x = axis.on_axis(people.level_vpp)
    counts = (people.detected, people.presented)
    rates = [one.rate for one in people.guesses]
    scale = axis.fitted
    fits = fit_many(x, *counts, guesses=rates, x_scale=scale)
    others = [
        fit_many(x, *counts, guesses=[GuessRate(mean=rate)] * len(rates), x_scale=scale)
        for rate in (0.0, _THIRD)
    ]
    misfits = deviance_p(x, *counts, fits=fits, guesses=rates, x_scale=scale, seed=seed)
    spreads = _spreads(people, fits, axis)
    varied = _varied(people, fits, axis, spreads)
    rows = [
        {
            "participant": participant,
            "condition": condition,
            **_numbers(fits[i], axis),
            "printed": printed(fits[i], _shown(people, i), axis, spreads.get(i)),
            "deviance_p": misfits[i],
            "guess_rate": people.guesses[i].rate.mean,
            "guess_basis": people.guesses[i].basis,
            "guess_posterior": fits[i].guess_rate,
            "threshold_guess_0_vpp": axis.level(others[0][i].threshold),
            "threshold_guess_third_vpp": axis.level(others[1][i].threshold),
            **varied[i],
            "levels": int((people.presented[i] > 0).sum()),
            "trials": int(people.presented[i].sum()),
        }
        for i, (condition, participant) in enumerate(people.names)
    ]
    table = pd.DataFrame(rows, columns=list(THRESHOLD_COLUMNS))
    return table.sort_values(["condition", "participant"], key=in_order, ignore_index=True)


def _shown(people: PersonCounts, i: int) -> Floats:
    return np.asarray(people.level_vpp[i, people.presented[i] > 0])


def _spreads(people: PersonCounts, fits: Sequence[PsychometricFit], axis: Axis) -> dict[int, float]:
    """Return by what the thresholds are rounded, `alike`, of those who have one."""
    told = [i for i, fit in enumerate(fits) if fit.status in WITH_THRESHOLD]
    own = []
    for i in told:
        low, high = levels_of(fits[i].threshold_limits, axis)
        at = axis.level(fits[i].threshold)
        own.append(spread_of(low, at, high, _shown(people, i).tolist()))
    return dict(zip(told, alike(own), strict=True))


def _varied(
    people: PersonCounts,
    fits: Sequence[PsychometricFit],
    axis: Axis,
    spreads: Mapping[int, float],
) -> list[dict[str, object]]:
    """Return the limits of each threshold if answers vary `VARIED` times the binomial.

    The likelihood of a table to the power of 1 / `VARIED`, on the same grid. None where there is no
    threshold, and none in a forced choice, of which no such factor is known.
    """
    found: list[dict[str, object]] = [dict.fromkeys(_VARIED_COLUMNS, math.nan) for _ in fits]
    rows = [
        i
        for i, fit in enumerate(fits)
        if fit.status in WITH_THRESHOLD and people.guesses[i].basis != FORCED_CHOICE
    ]
    if not rows:
        return found
    x, shown = axis.on_axis(people.level_vpp[rows]), people.presented[rows]
    rulers = [Ruler.of(one[of > 0], axis.fitted) for one, of in zip(x, shown, strict=True)]
    tables = surfaces(
        x / np.array([[ruler.step] for ruler in rulers]),
        people.detected[rows] / VARIED,
        shown / VARIED,
        rulers=rulers,
        guesses=[people.guesses[i].rate for i in rows],
    )
    for i, ruler, mu in zip(rows, rulers, posterior(tables, rulers).mu, strict=True):
        low, high = levels_of(within_levels(float(mu[0]), float(mu[2]), ruler), axis)
        # To the decimals of `printed`, beside which it stands.
        words = f"{between(low, high, _shown(people, i).tolist(), spreads[i])} {axis.unit}"
        values = (low if low > -math.inf else math.nan, high if high < math.inf else math.nan)
        found[i] = dict(zip(_VARIED_COLUMNS, (*values, words), strict=True))
    return found


def _numbers(fit: PsychometricFit, axis: Axis) -> dict[str, object]:
    # An open limit is n/a in a table, which has no word for infinity.
    low, high = (end if math.isfinite(end) else math.nan for end in fit.threshold_limits)
    at = [axis.level(value) for value in (fit.threshold, low, high)]
    decibel = [
        20 * value if axis.is_logarithmic else math.nan for value in (fit.threshold, low, high)
    ]
    return {
        "status": fit.status,
        **dict(zip(("threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"), at, strict=True)),
        **dict(
            zip(("threshold_db", "threshold_low_db", "threshold_high_db"), decibel, strict=True)
        ),
        "sigma": axis.width(fit.sigma),
        "lapse_rate": fit.lapse_rate,
        "mle_threshold_vpp": axis.level(fit.mle_threshold),
        "mle_sigma": axis.width(fit.mle_sigma),
        "mle_lapse_rate": fit.mle_lapse_rate,
        "deviance": fit.deviance,
    }


def printed(
    fit: PsychometricFit, levels_vpp: Floats, axis: Axis, spread: float | None = None
) -> str:
    """Return a threshold as a reader is told it, rounded by a spread, or why there is none.

    >>> import numpy as np
    >>> printed(
    ...     PsychometricFit(status="median_below_levels", threshold_limits=(-math.inf, 1.9)),
    ...     np.array([60.0, 200.0]), VOLTS)
    'at most 79.4 V (95 %)'
    """
    low, high = levels_of(fit.threshold_limits, axis)
    told = levels_vpp.tolist()
    if fit.status in BOUNDED:
        return bounded(low, high, axis.unit, told)
    if fit.status not in WITH_THRESHOLD:
        return WORDS[fit.status]
    words = with_limits(axis.level(fit.threshold), low, high, axis.unit, told, spread=spread)
    return f"{words}, slope unknown" if fit.status == "separated" else words


def levels_of(limits: tuple[float, float], axis: Axis) -> tuple[float, float]:
    """Return limits on the axis as levels; an open one stays open."""
    low, high = limits
    return low if low == -math.inf else axis.level(low), axis.level(high)
