"""What an analysis computes from trials or counts: one table, fit or posterior at a time."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from analysis import Axis, GuessRate, PsychometricFit, level_table
from analysis.counts import sensitivity, table
from analysis.counts.checks import sides_differ
from analysis.counts.table import count_answers
from analysis.reading.trials import with_reasons
from analysis.results.figures.curves import group_curves, person_curves
from analysis.thresholds.difference import paired_difference
from analysis.thresholds.fit import fit_many
from analysis.thresholds.function import Prior, class_prior
from analysis.thresholds.group import group_posterior
from analysis.thresholds.likelihood import Likelihood, Tables
from analysis.thresholds.table import difference_table, group_table, thresholds_of
from analysis.thresholds.tables import tables_of, tables_of_counts

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from analysis import Analysis

COUNTED: dict[str, Callable[..., Any]] = {
    "participants": lambda counts, ci="wilson": table.summarize_participants(
        table.count_levels(counts), ci
    ),
    "both": table.count_both,
    "blank": table.count_blanks,
    "confusion": table.count_confusions,
    "detected_any": lambda counts: table.count_detected_any(table.count_levels(counts)),
    "sensitivity": sensitivity.sensitivity_table,
    "sides": table.summarize_sides,
    "sides_differ": sides_differ,
    "d_prime_differences": lambda counts: sensitivity.d_prime_differences(
        sensitivity.sensitivity_table(counts)
    ),
}
TABLES: dict[str, Callable[..., Any]] = {
    "levels": level_table,
    "excluded": table.excluded_table,
    "hands_off": table.hands_off_table,
    "reaction_times": table.reaction_table,
}
"""By the attribute of `Analysis` that holds the table."""


def table_of(name: str, trials: pd.DataFrame, **options: Any) -> Any:
    """Compute one table of an analysis from trials, by its name in `Analysis`."""
    if name in COUNTED:
        return COUNTED[name](count_answers(trials), **options)
    return TABLES[name](trials, **options)


def reasoned(*rows: dict[str, Any], **same: Any) -> pd.DataFrame:
    """Return trials, each with the reason that leaves it out."""
    unasked = {"status": "ok", "premature": False, "noise_ok": None, "burst_verified": None}
    return with_reasons(
        pd.DataFrame([unasked | same | row for row in rows]).astype({"noise_ok": "boolean"})
    )


def people_with(counts: pd.DataFrame, guesses: Sequence[GuessRate] = ()) -> Tables:
    """Return the people of a table of counts, with guess rates known from blank trials."""
    people = tables_of_counts(counts)
    return replace(people, guesses=guesses) if guesses else people


def fit_people(trials: pd.DataFrame | Tables, axis: Axis | None = None) -> SimpleNamespace:
    """Fit the thresholds of people, their groups, and the differences of these."""
    people = trials if isinstance(trials, Tables) else tables_of(trials)
    people = replace(people, axis=axis or people.axis)
    thresholds = thresholds_of(people, seed=0)
    groups = group_table(people, thresholds)
    return SimpleNamespace(
        people=people,
        thresholds=thresholds,
        groups=groups,
        differences=difference_table(people, thresholds, groups),
    )


STEP = 1 / 20


def tables_at(
    x: Any, detected: Any, presented: Any, guess: float | GuessRate, **options: Any
) -> Tables:
    """Return tables of counts at the same levels on the axis log10, with one guess rate."""
    k = np.atleast_2d(np.asarray(detected, float))
    rate = guess if isinstance(guess, GuessRate) else GuessRate(mean=guess)
    levels, n = (np.array(np.broadcast_to(one, k.shape), float) for one in (x, presented))
    return Tables(levels=10**levels, detected=k, presented=n, guesses=[rate] * len(k), **options)


def fit_counts(x: Any, k: Any, n: Any, guess: float) -> list[PsychometricFit]:
    """Fit many tables of counts at once, on the axis log10."""
    return list(fit_many(tables_at(x, k, n, guess)))


def posterior_of(tables: Tables) -> np.ndarray[Any, Any]:
    """Return limits and median of mu in steps of the prior, of the first table."""
    return tables.likelihoods[0].mu_points


def group_of_normals(at: Sequence[float], width: Sequence[float]) -> Any:
    """Return the group of people whose thresholds are known like normal values."""
    people = [_normal(*one) for one in zip(at, width, strict=True)]
    return group_posterior(people, Prior(low=0.0, high=10.0, step=STEP, tail=3.0))


def difference_of_normals(a: Sequence[float], b: Sequence[float], width: float) -> Any:
    """Return the paired difference of such people in two conditions, of the group and of each."""
    of_a, of_b = ([_normal(float(at), width) for at in each] for each in (a, b))
    return paired_difference(of_a, of_b, Prior(low=0.0, high=10.0, step=STEP, tail=3.0))


def _normal(at: float, width: float) -> Likelihood:
    mu, log_sigma = np.linspace(-30, 40, 1401), np.linspace(-1, 2, 9)
    values = np.exp(-0.5 * ((mu - at) / width) ** 2)[:, None] * np.ones(9)
    return Likelihood(
        mu=mu,
        log_sigma=log_sigma,
        by_class=class_prior()[:, None, None] * values,
        mu_points=at + width * np.array([-1.96, 0.0, 1.96]),
        log_sigma_points=np.array([-1.0, 0.5, 2.0]),
        gamma=(0.0, 0.0),
        lapse=(0.0, 0.0),
        node=np.array([at, 0.7, 0.0]),
    )


def numbers(text: str) -> list[float]:
    """Return the numbers in a text in their order, those within names left out."""
    text = re.sub("\u2068.*?\u2069", "", text)
    return [float(one) for one in re.findall(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?!\w)", text)]


def curves_of(analysis: Analysis, participant: str = "") -> dict[str, Any]:
    """Return what a figure shows of the group, or of a participant, in each condition."""
    curves = person_curves(analysis, participant) if participant else group_curves(analysis)
    return {**curves}
