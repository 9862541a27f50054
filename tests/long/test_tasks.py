"""Of simulated studies of each task the analysis finds what was put in, as often as it says."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from analysis.counts.information import information_transfer
from analysis.planning.sessions import Session, draw_counts
from analysis.thresholds.discrimination import DB_PER_SIGMA
from analysis.thresholds.fit import fit_many
from analysis.thresholds.group import group_fit
from experiment import first_study
from experiment.perception.answers import answer_probabilities
from experiment.perception.gains import without_crosstalk
from experiment.tasks import make_task
from tests.test_analysis.test_information import information_bits

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

TASKS = ("left-right-both", "yes-no", "2ifc", "3ifc", "amplitude-discrimination")
STUDIES, PEOPLE = 200, 5
MEDIAN_VPP, BETWEEN_DB, SIGMA = 90.0, 2.0, 0.1
LEVELS_VPP = (45.0, 58.0, 75.0, 90.0, 108.0, 140.0, 180.0)


@dataclass(frozen=True)
class Recovered:
    """What 200 studies of five people show, and the truth: each in log10 units."""

    people: Floats  # (limit, median and limit of each person's threshold)
    groups: Floats  # the limits of each group's
    sigmas: Floats  # as of people
    truths: Floats  # of people
    group_truth: float
    sigma_truth: float


def _log10(*levels: float) -> list[float]:
    """Return logarithms of levels; an open lower limit is -inf."""
    return [-math.inf if level == -math.inf else math.log10(level) for level in levels]


@cache
def recovered(kind: str) -> Recovered:
    """Simulate studies of a task, and fit them."""
    is_comparison = kind == "amplitude-discrimination"
    task: dict[str, Any] = {"kind": kind} | ({"reference_vpp": MEDIAN_VPP} if is_comparison else {})
    design: dict[str, Any] = {"levels_vpp": LEVELS_VPP, "trials_per_side": 84, "break_every": 0}
    design |= {"blank_trials": 40} if kind == "yes-no" else {}
    study = first_study().changed(task=task, design=design)
    same = replace(
        study.simulation.median,
        threshold_um=None,
        threshold_vpp=MEDIAN_VPP,
        sigma=SIGMA,
        lapse_rate=0.02,
    )
    people, groups, sigmas = [], [], []
    truths: list[float] = []
    for number in range(STUDIES):
        rng = np.random.default_rng([7, TASKS.index(kind), number])
        each_vpp = MEDIAN_VPP * 10 ** (BETWEEN_DB / 20 * rng.standard_normal(PEOPLE))
        sessions = [
            Session(person=replace(same, threshold_vpp=vpp), designs=(study.design,), rng=rng)
            for vpp in each_vpp.tolist()
        ]
        (counts,) = draw_counts(sessions, without_crosstalk(2), study.task)
        tables = counts.tables
        step = tables.prior.step
        fits, group = fit_many(tables), group_fit(tables)
        people += [(*_log10(*fit.threshold_limits), *_log10(fit.threshold)) for fit in fits]
        groups.append(_log10(*group.threshold_limits))
        sigmas += [np.exp(each.log_sigma_points) * step for each in tables.likelihoods]
        truths += [np.log10(MEDIAN_VPP)] * PEOPLE if is_comparison else np.log10(each_vpp).tolist()
    return Recovered(
        people=np.array(people),
        groups=np.array(groups),
        sigmas=np.array(sigmas),
        truths=np.array(truths),
        group_truth=float(np.log10(MEDIAN_VPP)),
        # Two sensations are compared, each as wide as the function of detection.
        sigma_truth=SIGMA * (2**0.5 if is_comparison else 1.0),
    )


def test_information_transfer_is_recovered() -> None:
    task = make_task("identification", sites=("a", "b", "c", "d", "e"))
    gains, window_s = without_crosstalk(5).with_crosstalk(-15.0), 9.0
    median = first_study().simulation.median
    same = replace(median, threshold_um=None, threshold_vpp=MEDIAN_VPP, lapse_rate=0.02)
    levels_vpp = np.eye(5)[:, :, np.newaxis] * 100.0  # one trial after another, in one interval
    errors, covered = [], []
    for number in range(STUDIES):
        rng = np.random.default_rng([11, number])
        of_study = []
        for _ in range(PEOPLE):
            threshold_vpp = MEDIAN_VPP * 10 ** (BETWEEN_DB / 20 * rng.standard_normal())
            person = replace(same, threshold_vpp=threshold_vpp)
            (shares,) = np.stack(
                [
                    answer_probabilities(
                        [person], [levels], task.answer_names, window_s, gains=gains, task=task
                    )[:, 0]
                    for levels in levels_vpp
                ],
                axis=1,
            )
            shares = shares / shares.sum(axis=1, keepdims=True)
            truth = information_bits(shares)
            transfer = information_transfer(np.array([rng.multinomial(40, row) for row in shares]))
            covered.append(transfer.low <= truth <= transfer.high)
            of_study.append(transfer.bits - truth)
        errors.append(np.mean(of_study))
    assert abs(np.mean(errors)) < 0.05
    assert np.std(errors) < 0.1
    assert 0.93 <= np.mean(covered) <= 0.98


@pytest.mark.parametrize("kind", TASKS)
def test_thresholds_of_each_task_are_recovered(kind: str) -> None:
    results = recovered(kind)
    low, high, median = results.people.T
    covered = (low <= results.truths) & (results.truths <= high)
    assert 0.93 <= covered.mean() <= 0.98
    assert abs(20 * np.nanmean(median - results.truths)) < 0.3
    low, high = results.groups.T
    assert ((low <= results.group_truth) & (results.group_truth <= high)).mean() >= 0.93


def test_difference_thresholds_are_recovered() -> None:
    results = recovered("amplitude-discrimination")
    low, median, high = results.sigmas.T
    covered = (low <= results.sigma_truth) & (results.sigma_truth <= high)
    assert 0.93 <= covered.mean() <= 0.98
    assert abs(DB_PER_SIGMA * (median.mean() - results.sigma_truth)) < 0.2
