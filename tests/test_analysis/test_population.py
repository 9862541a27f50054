"""The population model: recovery of what is known, and where it is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.groups.population import PopulationThreshold, population_thresholds
from benchmarks.calibration import psychometric
from tests.test_analysis.shared import felt
from tests.test_analysis.tables import fit_people, people_with

LEVELS = [60.0, 80.0, 100.0, 125.0, 160.0]


def study(
    *, people: int = 10, between_db: float = 2.0, seed: int = 1, n: int = 30, **same: Any
) -> pd.DataFrame:
    """Return the trials of people whose thresholds scatter about 100 V."""
    rng = np.random.default_rng(seed)
    each = []
    for number in range(people):
        truth = 100.0 * 10 ** (between_db * rng.standard_normal() / 20)
        p = psychometric(LEVELS, threshold_vpp=truth, sigma=0.1, guess_rate=0, lapse_rate=0)
        each.append(felt(rng.binomial(n, p), LEVELS, n=n, **({"participant": str(number)} | same)))
    return pd.concat(each, ignore_index=True)


def only(trials: pd.DataFrame) -> PopulationThreshold:
    (found,) = population_thresholds(fit_people(trials).people)
    return found


def test_the_threshold_and_spread_of_a_population_are_found() -> None:
    found = only(study(people=40, between_db=2.0, seed=3))
    assert found.reason == ""
    error_db = 20 * math.log10(found.threshold_vpp / 100)
    assert error_db == pytest.approx(0, abs=3 * 2.1 / math.sqrt(40))
    assert 20 * found.between_sd == pytest.approx(2.0, abs=3 * 2.0 / math.sqrt(80))
    low, high = found.threshold_limits_vpp
    assert low < found.threshold_vpp < high


def test_each_condition_has_its_own_whatever_the_order() -> None:
    two = pd.concat([study(seed=1), study(seed=2, condition="plate B")])
    found = population_thresholds(fit_people(two.sample(frac=1, random_state=1)).people)
    assert [one.condition for one in found] == ["main", "plate B"]
    assert found[0] == only(study(seed=1))


def test_people_who_are_alike_are_no_failure_to_converge() -> None:
    found = only(study(people=9, between_db=0.0, n=40, seed=2))
    assert found.reason == ""
    assert found.between_sd < 0.01
    assert found.threshold_limits_vpp[0] < 100 < found.threshold_limits_vpp[1]


@pytest.mark.parametrize(
    "trials",
    [
        study(people=1),
        study(none_offered=False),
        study(level_vpp=60.0),
        study(response="left"),
        study(response="none"),
    ],
)
def test_where_the_model_does_not_hold_there_is_only_a_reason(trials: pd.DataFrame) -> None:
    found = only(trials)
    assert found.reason
    assert all(map(math.isnan, (found.threshold_vpp, *found.threshold_limits_vpp)))


def test_more_trials_than_the_model_can_hold_are_refused() -> None:
    cells = [(person, v, k) for person in "12" for v, k in ((60.0, 10**8), (95.0, 9 * 10**8))]
    table = pd.DataFrame(cells, columns=["participant", "level_vpp", "detected"])
    table = table.assign(condition="main", presented=10**9, none_offered=True)
    (found,) = population_thresholds(people_with(table))
    assert found.reason
