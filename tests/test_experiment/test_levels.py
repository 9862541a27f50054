"""Rules that choose levels: what they converge to, how well thresholds are known, how fast."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.special import ndtr

from experiment.levels import Bayesian, Staircase
from experiment.tasks import LEFT_RIGHT_BOTH as TASK

if TYPE_CHECKING:
    from experiment.levels import LevelRule, Track

CANDIDATES = tuple(np.geomspace(30.0, 300.0, 15).round(1).tolist())
ANSWERS = ("left", "right", "both", "none")
SHARED: dict[str, Any] = {"candidates_vpp": CANDIDATES, "seed": 5}


class Person:
    """An observer, written here once more: detects, or guesses, or lapses."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.threshold_vpp = np.exp(rng.uniform(np.log(50), np.log(180)))
        self.sigma = np.exp(rng.uniform(np.log(0.03), np.log(0.25)))
        self.lapse, self.false_alarm = rng.uniform(0, 0.06), rng.uniform(0, 0.2)

    def answer(self, side: str, level_vpp: float | None) -> str:
        if self.rng.random() < self.lapse:
            return str(self.rng.choice(ANSWERS))
        if level_vpp is not None:
            over = np.log10(level_vpp / self.threshold_vpp) / self.sigma
            if self.rng.random() < ndtr(over):
                return side
        if self.rng.random() < self.false_alarm:
            return str(self.rng.choice(["left", "right"]))
        return "none"


def run(rule: LevelRule, person: Person, singles: int, blanks: int) -> tuple[Track, list[float]]:
    track, levels_vpp = rule.start(ANSWERS, TASK), []
    kinds = person.rng.permutation(["single"] * singles + ["blank"] * blanks)
    for trial, kind in enumerate(kinds, start=1):
        if kind == "blank":
            track.update(TASK.presentation("none"), None, person.answer("none", None))
            continue
        side = TASK.sites[trial % 2]
        level_vpp = track.choose(trial, 1).level_vpp
        levels_vpp.append(level_vpp)
        track.update(TASK.presentation(side), level_vpp, person.answer(side, level_vpp))
    return track, levels_vpp


def errors_db(
    rule: LevelRule, participants: int, singles: int, blanks: int = 12
) -> tuple[np.ndarray[Any, Any], float]:
    """Return errors of the estimates, and the share of intervals that have the threshold."""
    rng = np.random.default_rng(11)
    errors, covered = [], 0
    for _ in range(participants):
        person = Person(rng)
        estimate = run(rule, person, singles, blanks)[0].estimate()
        assert estimate is not None
        errors.append(20 * np.log10(estimate.threshold_vpp / person.threshold_vpp))
        covered += estimate.low_vpp <= person.threshold_vpp <= estimate.high_vpp
    return np.array(errors), covered / participants


@pytest.mark.parametrize(
    ("participants", "singles"),
    [
        (100, 48),
        pytest.param(1000, 48, marks=pytest.mark.slow),
        pytest.param(1000, 96, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("rule", [Bayesian(**SHARED), Staircase(**SHARED, start_vpp=300.0)])
def test_thresholds_are_known_without_bias_and_as_well_as_they_say(
    rule: LevelRule, participants: int, singles: int
) -> None:
    errors, covered = errors_db(rule, participants, singles)
    print(type(rule).__name__, participants, singles, errors.mean(), errors.std(), covered)
    assert abs(errors.mean()) < 0.15 + 2 * errors.std() / participants**0.5
    assert errors.std() < {48: 1.3, 96: 1.0}[singles]
    assert 0.93 - 1 / participants**0.5 < covered < 0.99


@pytest.mark.parametrize(
    ("steps", "detected"),
    [({}, 0.75), ({"down_after": 2, "up_steps": 1}, 0.5**0.5), ({"up_steps": 1}, 0.5)],
)
def test_a_staircase_stays_where_its_share_is_detected(
    steps: dict[str, Any], detected: float
) -> None:
    fine = tuple(np.geomspace(30.0, 300.0, 60).tolist())
    rule = Staircase(candidates_vpp=fine, seed=1, start_vpp=fine[-1], **steps)
    person = Person(np.random.default_rng(2))
    person.threshold_vpp, person.sigma = 90.0, 0.1
    person.lapse = person.false_alarm = 0.0
    _, levels_vpp = run(rule, person, 4000, 0)
    shares = ndtr(np.log10(np.array(levels_vpp[100:]) / 90.0) / 0.1)
    assert shares.mean() == pytest.approx(detected, abs=0.03)


def test_the_same_answers_give_the_same_choices_in_any_order_of_asking() -> None:
    for rule in (Bayesian(**SHARED), Staircase(**SHARED, start_vpp=300.0)):
        answers = [("left", "left"), ("right", "none"), ("left", "right"), ("right", "timeout")]
        one, other = rule.start(ANSWERS, TASK), rule.start(ANSWERS, TASK)
        for trial, (side, answer) in enumerate(answers, start=1):
            choice = one.choose(trial, 1)
            for attempt in (3, 2, 1):
                again = other.choose(trial, attempt)
            assert again == choice
            for track in (one, other):
                track.update(TASK.presentation(side), choice.level_vpp, answer)
        assert one.estimate() == other.estimate()


def test_a_choice_takes_two_milliseconds() -> None:
    track = Bayesian(**SHARED).start(ANSWERS, TASK)
    track.choose(1, 1)
    taken_s = []
    for trial in range(20):
        begun_s = time.process_time()
        level_vpp = track.choose(trial, 1).level_vpp
        taken_s.append(time.process_time() - begun_s)
        track.update(TASK.presentation("left"), level_vpp, "left")
    assert np.median(taken_s) < 2e-3


@pytest.mark.parametrize(
    "values",
    [
        {"candidates_vpp": (60.0,)},
        {"candidates_vpp": (90.0, 60.0)},
        {"seed": -1},
        {"lapse_rates": (0.0,)},
        {"kind": "staircase"},
    ],
)
def test_a_rule_that_cannot_choose_is_refused(values: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Bayesian(**SHARED | values)
    with pytest.raises(ValidationError):
        Staircase(**SHARED, start_vpp=31.0)
