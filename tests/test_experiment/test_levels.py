"""Rules of levels: refusals, replay, the law of the staircase, and the error of the estimates."""

from __future__ import annotations

import json
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pytest
from pydantic import ValidationError

from experiment.levels import RULES, Bayesian, Staircase
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from experiment.levels import LevelRule, Track

CANDIDATES_VPP = tuple(float(level) for level in np.geomspace(30.0, 300.0, 15))
RESPONSES = ("left", "right", "none")
BLANK = LEFT_RIGHT_BOTH.presentation("none")
BOTH = LEFT_RIGHT_BOTH.presentation("both")
LEFT = LEFT_RIGHT_BOTH.presentation("left")
BAYESIAN = Bayesian(candidates_vpp=CANDIDATES_VPP, seed=3)
STAIRCASE = Staircase(candidates_vpp=CANDIDATES_VPP, seed=3, start_vpp=CANDIDATES_VPP[9])
EITHER = pytest.mark.parametrize("rule", [BAYESIAN, STAIRCASE], ids=lambda rule: rule.kind)


class Person(NamedTuple):
    """The observer model, written independently of the rules and of the task."""

    threshold_vpp: float
    sigma: float
    lapse_rate: float
    false_alarm_rate: float

    def detects(self, level_vpp: float) -> float:
        return NormalDist(np.log10(self.threshold_vpp), self.sigma).cdf(np.log10(level_vpp))

    def answer(self, site: str | None, level_vpp: float, rng: np.random.Generator) -> str:
        if rng.random() < self.lapse_rate:
            return str(rng.choice(RESPONSES))
        if site is not None and rng.random() < self.detects(level_vpp):
            return site
        return str(rng.choice(RESPONSES[:2])) if rng.random() < self.false_alarm_rate else "none"


def draw_person(rng: np.random.Generator) -> Person:
    threshold_vpp = float(np.exp(rng.uniform(np.log(50.0), np.log(180.0))))
    return Person(threshold_vpp, *rng.uniform((0.03, 0.0, 0.0), (0.25, 0.06, 0.2)))


def run_session(
    person: Person, track: Track, trials: int, rng: np.random.Generator, sites: int = 2
) -> list[tuple[float, str]]:
    """Run single trials, with a blank trial after every fourth of 2 sites or second of one."""
    record = []
    for trial in range(1, trials + 1):
        site = RESPONSES[trial % sites]
        level_vpp = track.choose(trial, 1).level_vpp
        answer = person.answer(site, level_vpp, rng)
        track.update(LEFT_RIGHT_BOTH.presentation(site), level_vpp, answer)
        record.append((level_vpp, answer))
        if trial % (2 * sites) == 0:
            track.update(BLANK, None, person.answer(None, 0.0, rng))
    return record


def bound_db(person: Person, trials: int) -> float:
    """The Cramer-Rao bound at the best single candidate, sigma, lapses and guesses being known."""
    information = []
    for level_vpp in CANDIDATES_VPP:
        x_db = 20 * np.log10(level_vpp / person.threshold_vpp)
        steps_db = x_db + np.array([-1e-3, 0.0, 1e-3])
        p = np.array([NormalDist(0, 20 * person.sigma).cdf(step) for step in steps_db])
        false_alarm, lapse = person.false_alarm_rate, person.lapse_rate
        answers = [p + (1 - p) * false_alarm / 2, (1 - p) * false_alarm / 2]
        answers.append((1 - p) * (1 - false_alarm))
        shares = lapse / 3 + (1 - lapse) * np.array(answers)
        slopes = (shares[:, 2] - shares[:, 0]) / 2e-3
        information.append(np.sum(slopes**2 / shares[:, 1]))
    return float(1 / np.sqrt(trials * max(information)))


@EITHER
def test_a_rule_is_restored_from_json(rule: LevelRule) -> None:
    text = rule.model_dump_json()
    restored = RULES[json.loads(text)["kind"]]
    assert restored.model_validate_json(text) == rule
    assert restored.model_validate(json.loads(text)) == rule


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("bayesian", {"candidates_vpp": (100.0,)}, "must have at least two levels"),
        ("bayesian", {"candidates_vpp": (100.0, 90.0)}, "must be in increasing order"),
        ("bayesian", {"candidates_vpp": (0.0, 90.0)}, "greater than 0"),
        ("bayesian", {"candidates_vpp": (90.0, "100")}, "valid number"),
        ("bayesian", {"candidates_vpp": (90.0, np.inf)}, "finite number"),
        ("bayesian", {"seed": -1}, "greater than or equal to 0"),
        ("bayesian", {"version": 2}, "Input should be 1"),
        ("bayesian", {"sigmas": ()}, "at least 1 item"),
        ("bayesian", {"lapse_rates": (0.0,)}, "must have at least one rate above 0"),
        ("bayesian", {"start_vpp": 100.0}, "Extra inputs"),
        ("staircase", {"start_vpp": 31.0}, "must be one of the candidate levels"),
        ("staircase", {"up_steps": 0}, "greater than or equal to 1"),
        ("staircase", {"down_steps": 0}, "greater than or equal to 1"),
        ("staircase", {"down_after": 0}, "greater than or equal to 1"),
    ],
)
def test_a_bad_rule_is_refused_for_one_reason(
    kind: str, values: dict[str, Any], message: str
) -> None:
    rule = {"bayesian": BAYESIAN, "staircase": STAIRCASE}[kind]
    with pytest.raises(ValidationError, match=message) as error:
        RULES[kind].model_validate(rule.model_dump() | values)
    assert error.value.error_count() == 1


@EITHER
def test_a_replay_of_the_answers_gives_the_same_choices_and_estimate(rule: LevelRule) -> None:
    rng = np.random.default_rng(1)
    track, person = rule.start(RESPONSES), draw_person(rng)
    record = run_session(person, track, 40, rng, sites=1)
    first, second = rule.start(RESPONSES), rule.start(RESPONSES)
    for trial, (level_vpp, answer) in enumerate(record, 1):
        choice = first.choose(trial, 1)
        assert choice == first.choose(trial, 1)  # choosing changes nothing
        for replayed in (first, second):
            replayed.update(LEFT, level_vpp, answer)
    assert first.choose(41, 1) == second.choose(41, 1)
    assert first.estimate() == second.estimate() is not None


@EITHER
def test_other_stimuli_and_answers_that_are_not_offered_change_nothing(rule: LevelRule) -> None:
    track = rule.start(RESPONSES)
    for answer in ("none", "left", "none", "left"):
        track.update(LEFT, CANDIDATES_VPP[7], answer)
    before = track.choose(5, 1), track.estimate()
    track.update(BOTH, CANDIDATES_VPP[7], "none")
    track.update(LEFT, CANDIDATES_VPP[7], "timeout")
    assert (track.choose(5, 1), track.estimate()) == before


def test_the_first_two_levels_of_the_bayesian_rule_are_fixed() -> None:
    track = BAYESIAN.start(RESPONSES)
    track.update(BLANK, None, "left")
    assert track.choose(1, 1).level_vpp == CANDIDATES_VPP[9]
    assert track.choose(1, 2).level_vpp == CANDIDATES_VPP[9]
    assert track.estimate() is None
    track.update(LEFT, CANDIDATES_VPP[9], "left")
    assert track.choose(2, 1).level_vpp == CANDIDATES_VPP[5]


def test_false_alarms_make_an_answer_tell_less_about_the_threshold() -> None:
    often, never = BAYESIAN.start(RESPONSES), BAYESIAN.start(RESPONSES)
    for _ in range(20):
        often.update(BLANK, None, "left")
        never.update(BLANK, None, "none")
    entropies = [track.choose(1, 1).entropy_bits or 0.0 for track in (often, never)]
    assert entropies[0] > entropies[1] > 0


def test_a_staircase_needs_two_reversals_and_blank_trials_do_not_move_it() -> None:
    track = STAIRCASE.start(RESPONSES)
    for answer, index in (("left", 8), ("none", 11), ("left", 10), ("right", 13), ("none", 14)):
        level_vpp = track.choose(1, 1).level_vpp
        track.update(LEFT, level_vpp, answer)
        track.update(BLANK, None, "left")
        assert track.choose(1, 1).level_vpp == CANDIDATES_VPP[index]
        assert (track.estimate() is None) == (index in {8, 11})


@pytest.mark.parametrize(("down_after", "up_steps", "target"), [(1, 3, 0.75), (2, 1, 0.5**0.5)])
def test_a_staircase_converges_to_its_law(down_after: int, up_steps: int, target: float) -> None:
    levels_vpp = tuple(float(level) for level in np.geomspace(20.0, 400.0, 131))
    rule = Staircase(
        candidates_vpp=levels_vpp,
        seed=1,
        start_vpp=levels_vpp[80],
        down_after=down_after,
        up_steps=up_steps,
    )
    rng = np.random.default_rng(2)
    person = Person(90.0, 0.1, 0.0, 0.0)
    runs = [run_session(person, rule.start(RESPONSES), 220, rng, sites=1) for _ in range(100)]
    late_vpp = [level_vpp for run in runs for level_vpp, _ in run[60:]]
    # Neighbouring trials are correlated: the standard errors are about 0.004 and 0.03 dB.
    assert abs(np.mean([person.detects(level_vpp) for level_vpp in late_vpp]) - target) < 0.02
    expected = NormalDist(np.log10(90.0), 0.1).inv_cdf(target)
    assert abs(20 * (np.mean(np.log10(late_vpp)) - expected)) < 0.2


def errors_of(participants: int, trials: int, sites: int) -> dict[str, float]:
    """Return bias, rms, coverage and the rms bound, of simulated participants."""
    rows = []
    for number in range(participants):
        rng = np.random.default_rng([11, number])
        person, track = draw_person(rng), BAYESIAN.start(RESPONSES)
        run_session(person, track, trials, rng, sites)
        estimate = track.estimate()
        assert estimate is not None
        error_db = 20 * np.log10(estimate.threshold_vpp / person.threshold_vpp)
        is_covered = estimate.low_vpp <= person.threshold_vpp <= estimate.high_vpp
        rows.append((error_db, is_covered, bound_db(person, trials)))
    error_db, is_covered, bounds_db = np.array(rows, dtype=float).T
    return {
        "bias": float(error_db.mean()),
        "rms": float(np.sqrt(np.mean(error_db**2))),
        "coverage": float(is_covered.mean()),
        "bound": float(np.sqrt(np.mean(bounds_db**2))),
    }


def test_the_bayesian_threshold_is_unbiased_and_its_interval_covers() -> None:
    errors = errors_of(150, 48, 2)
    assert abs(errors["bias"]) <= 0.15, errors
    assert 0.93 <= errors["coverage"] <= 0.985, errors


# After 24 trials the error of one threshold is about 1 dB: the mean of 150 would not show a bias.
@pytest.mark.slow
@pytest.mark.parametrize(("trials", "sites"), [(24, 1), (48, 2), (96, 2)])
def test_the_error_of_1000_participants_is_close_to_the_cramer_rao_bound(
    trials: int, sites: int
) -> None:
    errors = errors_of(1000, trials, sites)
    assert abs(errors["bias"]) <= 0.15, errors
    assert 0.93 <= errors["coverage"] <= 0.985, errors
    assert errors["rms"] <= 1.3 * errors["bound"], errors
