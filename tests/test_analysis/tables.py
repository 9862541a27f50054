"""What an analysis computes from trials or counts: one table, fit or posterior at a time."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis import Axis, GuessRate, PsychometricFit, level_table
from analysis.answers import choice, counting, detection, dprime
from analysis.groups.difference import paired_difference
from analysis.groups.hierarchy import hierarchy
from analysis.groups.sensitivity import d_prime_differences
from analysis.groups.tables import difference_table, group_table
from analysis.reading.reasons import with_reasons
from analysis.results.figures.curves import group_curves, person_curves
from analysis.thresholds.density import Ruler, kind_prior
from analysis.thresholds.fit import fit_many
from analysis.thresholds.grid import Surface, surfaces
from analysis.thresholds.people import Guessing, PersonCounts, people_of, people_of_counts
from analysis.thresholds.posterior import posterior
from analysis.thresholds.table import thresholds_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analysis import Analysis
    from analysis.thresholds.mle import Tables

TABLES: dict[str, Callable[..., Any]] = {
    "levels": level_table,
    "participants": lambda trials, ci="wilson": detection.participants_of(
        detection.cells(trials), ci
    ),
    "both": detection.both_table,
    "blank": detection.blank_table,
    "excluded": counting.excluded_table,
    "detected_any": detection.detected_any,
    "hands_off": counting.hands_off_table,
    "reaction_times": counting.reaction_table,
    "confusion": choice.confusion_table,
    "choice": choice.choices,
    "sensitivity": dprime.sensitivity_table,
    "d_prime_differences": lambda trials: d_prime_differences(dprime.sensitivity_table(trials)),
}
"""By the attribute of `Analysis` that holds the table."""


def table_of(name: str, trials: pd.DataFrame, **options: Any) -> Any:
    """Compute one table of an analysis from trials, by its name in `Analysis`."""
    return TABLES[name](trials, **options)


def reasoned(*rows: dict[str, Any], **same: Any) -> pd.DataFrame:
    """Return trials, each with the reason that leaves it out."""
    unasked = {"status": "ok", "premature": False, "noise_ok": None, "burst_verified": None}
    return with_reasons(
        pd.DataFrame([unasked | same | row for row in rows]).astype({"noise_ok": "boolean"})
    )


def people_with(counts: pd.DataFrame, guesses: Sequence[GuessRate] = ()) -> PersonCounts:
    """Return the people of a table of counts, with guess rates known from blank trials."""
    people = people_of_counts(counts)
    if not guesses:
        return people
    return replace(people, guesses=tuple(Guessing(rate=one, basis="blanks") for one in guesses))


def fit_people(trials: pd.DataFrame | PersonCounts, axis: Axis | None = None) -> SimpleNamespace:
    """Fit the thresholds of people, their groups, and the differences of these."""
    axis = axis or Axis()
    people = trials if isinstance(trials, PersonCounts) else people_of(trials)
    thresholds = thresholds_of(people, seed=0, axis=axis)
    return SimpleNamespace(
        people=people,
        thresholds=thresholds,
        groups=group_table(people, thresholds, axis),
        differences=difference_table(people, axis),
    )


def fit_counts(x: Any, k: Any, n: Any, guess: float | Sequence[GuessRate]) -> list[PsychometricFit]:
    """Fit many tables of counts at once, on the axis log10."""
    k = np.asarray(k, float)
    rates = [GuessRate(mean=guess)] * len(k) if isinstance(guess, float) else guess
    levels, presented = (np.array(np.broadcast_to(one, k.shape), float) for one in (x, n))
    return list(fit_many(levels, k, presented, guesses=rates))


def posterior_of(table: Tables, guess: GuessRate | None = None, *, x: Any = None) -> Any:
    """Return the posterior of tables of counts: levels from 0 to 10 steps of a dB, or `x`."""
    ruler = Ruler(low=0.0, high=10.0, step=0.05, tail=3.0)
    if x is not None:
        ruler = Ruler.of(np.array(x), "log10")
    rulers = [ruler] * len(table)
    guesses = [guess or GuessRate(mean=0.0)] * len(table)
    found = surfaces(table.u, table.detected, table.presented, rulers=rulers, guesses=guesses)
    return posterior(found, rulers)


def group_of_normals(at: Sequence[float], width: Sequence[float]) -> Any:
    """Return the group of people whose thresholds are known like normal values."""
    people = [_normal(*one) for one in zip(at, width, strict=True)]
    return hierarchy(people, Ruler(low=0.0, high=10.0, step=0.05, tail=3.0))


def difference_of_normals(a: Sequence[float], b: Sequence[float], width: float) -> Any:
    """Return the paired difference of such people in two conditions, of the group and of each."""
    of_a, of_b = ([_normal(float(at), width) for at in each] for each in (a, b))
    return paired_difference(of_a, of_b, Ruler(low=0.0, high=10.0, step=0.05, tail=3.0))


def _normal(at: float, width: float) -> Surface:
    mu, log_sigma = np.linspace(-30, 40, 1401), np.linspace(-1, 2, 9)
    values = np.exp(-0.5 * ((mu - at) / width) ** 2)[:, None] * np.ones(9)
    return Surface(
        mu=mu,
        log_sigma=log_sigma,
        by_kind=kind_prior()[:, None, None] * values,
        lapse_rate=0.0,
        guess_rate=0.0,
        guess_variance=0.0,
        lapse_by_kind=np.zeros((2, 3)),
        starts=np.array([[at, 0.7, 0.0]]),
    )


def numbers(text: str) -> list[float]:
    """Return the numbers in a text in their order, those within names left out."""
    text = re.sub("\u2068.*?\u2069", "", text)
    return [float(one) for one in re.findall(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?!\w)", text)]


def curves_of(analysis: Analysis, participant: str = "") -> dict[str, Any]:
    """Return what a figure shows of the group, or of a participant, in each condition."""
    curves = person_curves(analysis, participant) if participant else group_curves(analysis)
    return {**curves}
