"""The observer: answers follow the psychometric function, and the masking of section V."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from experiment.perception.answers import answer_probabilities
from tests.test_experiment.people import finger_gains, population

FORCED = ("left", "right", "both")
WITH_NONE = ("left", "right", "both", "none")
FASTEST_S = 0.15
IDEAL = replace(
    population(threshold_vpp=60.0).median,
    sigma=0.1,
    lapse_rate=0.0,
    false_alarm_rate=0.0,
    side_bias=0.5,
    guess_both=0.0,
    crosstalk_db=-200.0,
    reaction_time_s=0.5,
    reaction_time_spread=0.2,
)


OWN_FINGERS = finger_gains((1.0, 0.0), (0.0, 1.0), None)


def shares(
    observer: Any,
    levels_vpp: tuple[float, float],
    responses: tuple[str, ...],
    *,
    trials: int = 4000,
    seed: int = 1,
    gains: Any = OWN_FINGERS,
) -> dict[str | None, float]:
    rng = np.random.default_rng(seed)
    answers = [
        observer.answer(*levels_vpp, responses, rng, 60.0, gains=gains).response
        for _ in range(trials)
    ]
    return {word: answers.count(word) / trials for word in (*responses, None)}


def assert_binomial(share: float, probability: float, trials: int = 4000) -> None:
    # five standard deviations: one test in a million fails by chance
    assert abs(share - probability) <= 5 * math.sqrt(probability * (1 - probability) / trials)


def psychometric(level_vpp: float, guess_rate: float = 0.0, lapse_rate: float = 0.0) -> float:
    """Return gamma + (1 - gamma - lambda) Phi(log10(V / 60 V) / 0.1), docs/model.md."""
    felt = NormalDist().cdf(math.log10(level_vpp / 60.0) / 0.1)
    return guess_rate + (1.0 - guess_rate - lapse_rate) * felt


def test_a_finger_feels_never_without_a_vibration_and_always_with_a_strong_one() -> None:
    strengths = [0.0, 1e-300, 1.0, 1e6, 1e300]
    assert [IDEAL.felt_probability(one) for one in strengths] == [0.0, 0.0, 0.5, 1.0, 1.0]


def test_it_feels_by_the_normal_distribution_of_the_logarithm() -> None:
    # Phi(1) = 0.8413447460685429 (Abramowitz and Stegun, table 26.1)
    assert IDEAL.felt_probability(10**0.1) == pytest.approx(0.8413447460685429, abs=1e-14)
    levels_vpp = np.geomspace(20, 200, 50)
    felt = [IDEAL.felt_probability(float(v) / 60.0) for v in levels_vpp]
    assert felt == pytest.approx([psychometric(float(v)) for v in levels_vpp], abs=1e-14)
    assert np.all(np.diff(felt) > 0)


@pytest.mark.parametrize("level_vpp", [40.0, 55.0, 60.0, 70.0, 95.0, 200.0])
def test_a_forced_choice_follows_the_function_with_a_guess_rate_of_one_half(
    level_vpp: float,
) -> None:
    observer = replace(IDEAL, lapse_rate=0.06)
    # a lapse picks one of three answers: two of three are wrong; the rest guess or feel
    expected = psychometric(level_vpp, guess_rate=0.94 * 0.5 + 0.06 / 3, lapse_rate=0.06 * 2 / 3)
    assert_binomial(shares(observer, (level_vpp, 0.0), FORCED)["left"], expected)
    lapsing = shares(replace(IDEAL, lapse_rate=1.0), (200.0, 0.0), WITH_NONE)
    assert_binomial(lapsing["none"], 0.25)


@pytest.mark.parametrize(("side_bias", "guess_both"), [(0.5, 0.0), (0.8, 0.25)])
def test_nothing_felt_in_a_forced_choice_is_a_guess_as_stated(
    side_bias: float, guess_both: float
) -> None:
    observer = replace(IDEAL, side_bias=side_bias, guess_both=guess_both)
    found = shares(observer, (0.0, 0.0), FORCED)
    assert_binomial(found["both"], guess_both)
    assert_binomial(found["left"], (1 - guess_both) * side_bias)
    assert found[None] == 0.0


@pytest.mark.parametrize(
    ("levels_vpp", "changed", "responses", "answer"),
    [
        ((0.0, 0.0), {}, WITH_NONE, "none"),
        # both where it is offered, the stronger one where not
        ((900.0, 1000.0), {}, FORCED, "both"),
        ((900.0, 1000.0), {}, ("left", "right"), "right"),
        ((1000.0, 900.0), {}, ("left", "right"), "left"),
        # a finger 20 dB below the other feels nothing
        ((1e6, 0.0), {"crosstalk_db": -19.9}, FORCED, "both"),
        ((1e6, 0.0), {"crosstalk_db": -20.0}, FORCED, "left"),
        ((0.0, 3e3), {"crosstalk_db": -20.0}, FORCED, "right"),
        ((1e6, 0.0), {"crosstalk_db": -20.1}, FORCED, "left"),
        ((1e6, 0.99e5), {}, FORCED, "left"),
        ((1e6, 1.01e5), {}, FORCED, "both"),
        # crosstalk makes one strong side both
        ((1000.0, 0.0), {"crosstalk_db": -10.0}, FORCED, "both"),
        # below threshold on its own, above it with what comes from the other side
        ((50.0, 0.0), {"crosstalk_db": -6.0, "sigma": 0.001}, WITH_NONE, "none"),
        ((50.0, 50.0), {"crosstalk_db": -6.0, "sigma": 0.001}, FORCED, "both"),
    ],
)
def test_strong_and_absent_stimuli_have_a_sure_answer(
    levels_vpp: tuple[float, float],
    changed: dict[str, Any],
    responses: tuple[str, ...],
    answer: str,
) -> None:
    observer = replace(IDEAL, **changed)
    assert shares(observer, levels_vpp, responses, trials=300)[answer] == 1.0


PLATE = finger_gains((0.02, 0.001), (0.001, 0.02), "measured")
TWICE = finger_gains((0.04, 0.0), (0.0, 0.02), "predicted")
UNEVEN = finger_gains((0.04, 0.0), (0.0, 0.01), "measured")
WEAK_LEFT = finger_gains((0.002, 0.0), (0.0, 0.02), "measured")
LOUD = finger_gains((0.02, 0.01), (0.01, 0.02), "measured")
VOLTS = replace(IDEAL, crosstalk_db=None)
UM = replace(VOLTS, threshold_vpp=None, threshold_um=1.2)


@pytest.mark.parametrize(
    ("gains", "observer", "levels_vpp", "answer", "share"),
    [
        # in micrometres it is met by the displacement: 60 Vpp at 0.02 um per Vpp are 1.2 um
        (PLATE, UM, (60.0, 0.0), "left", 0.5),
        (TWICE, UM, (30.0, 0.0), "left", 0.5),
        (TWICE, UM, (0.0, 30.0), "none", 1 - UM.felt_probability(0.5)),
        # in volts it is that of the own finger
        (UNEVEN, VOLTS, (60.0, 0.0), "left", 0.5),
        (UNEVEN, VOLTS, (0.0, 60.0), "right", 0.5),
        # masking compares displacements: 20 dB at equal levels, and the left finger feels nothing
        (WEAK_LEFT, UM, (1e4, 1e4), "right", 1.0),
        (WEAK_LEFT, UM, (1.1e4, 1e4), "both", 1.0),
        # a stated crosstalk overrides that of the plate
        (LOUD, UM, (1e4, 0.0), "both", 1.0),
        (LOUD, replace(UM, crosstalk_db=-40.0), (1e4, 0.0), "left", 1.0),
    ],
)
def test_a_threshold_is_met_by_what_the_plate_does_at_the_finger(
    gains: Any,
    observer: Any,
    levels_vpp: tuple[float, float],
    answer: str,
    share: float,
) -> None:
    assert_binomial(shares(observer, levels_vpp, WITH_NONE, gains=gains)[answer], share)


def test_micrometres_without_a_displacement_are_refused() -> None:
    with pytest.raises(ValueError, match="threshold_um"):
        UM.answer(60.0, 0.0, FORCED, np.random.default_rng(0), 3.0)


@pytest.mark.parametrize("thresholds", [(None, None), (1.2, 60.0)])
def test_an_observer_has_one_threshold(thresholds: tuple[float | None, float | None]) -> None:
    with pytest.raises(ValueError, match="threshold_um or threshold_vpp"):
        replace(IDEAL, threshold_um=thresholds[0], threshold_vpp=thresholds[1])


def test_reactions_are_slower_to_weak_stimuli_and_never_impossibly_fast() -> None:
    rng = np.random.default_rng(3)
    observer = replace(IDEAL, reaction_time_spread=1.5)
    times = {
        level_vpp: [observer.answer(level_vpp, 0.0, FORCED, rng, 1e9).rt_s for _ in range(2000)]
        for level_vpp in (40.0, 60.0, 200.0)
    }
    medians = [float(np.median(np.array(found, dtype=float))) for found in times.values()]
    assert medians[0] > medians[1] > medians[2]
    assert medians[2] == pytest.approx(0.5, rel=0.1)
    assert min(t for found in times.values() for t in found if t is not None) > FASTEST_S
    slow = replace(IDEAL, reaction_time_s=10.0, reaction_time_spread=0.0)
    late, early = (slow.answer(200.0, 0.0, FORCED, rng, window_s) for window_s in (9.9, 10.1))
    assert (late.response, late.rt_s, early.response) == (None, None, "left")


def test_an_impossible_trial_is_refused() -> None:
    for levels_vpp in ((-1.0, 0.0), (math.nan, 0.0), (0.0, math.inf)):
        with pytest.raises(ValueError, match=" must "):
            IDEAL.answer(*levels_vpp, FORCED, np.random.default_rng(0), 3.0)
    for responses in (("left",), ("left", "right", "up")):
        with pytest.raises(ValueError, match=" must "):
            IDEAL.answer(60.0, 0.0, responses, np.random.default_rng(0), 3.0)


def test_drawn_thresholds_have_the_stated_median_and_spread_in_db() -> None:
    rng = np.random.default_rng(4)
    for key, median in (("threshold_vpp", 60.0), ("threshold_um", 1.5)):
        people = population(**{key: median, "threshold_sd_db": 2.0})
        drawn = [getattr(people.draw(70.0, rng), key) for _ in range(4000)]
        level_db = 20 * np.log10(np.array(drawn) / median)
        assert abs(np.mean(level_db)) < 5 * 2.0 / math.sqrt(4000)
        assert np.std(level_db) == pytest.approx(2.0, rel=0.06)


@pytest.mark.parametrize("responses", [("left", "right", "both"), ("left", "right", "none")])
@pytest.mark.parametrize("masking_slope", [None, 0.2])
def test_answers_are_as_frequent_as_their_probabilities(
    responses: tuple[str, ...], masking_slope: float | None
) -> None:
    person = replace(
        IDEAL,
        threshold_vpp=80.0,
        sigma=0.15,
        lapse_rate=0.1,
        false_alarm_rate=0.3,
        side_bias=0.6,
        guess_both=0.2,
        reaction_time_s=0.6,
        reaction_time_spread=0.5,
        crosstalk_db=-8.0,
        finger_difference_db=2.0,
        masking_slope=masking_slope,
        swapped=True,
    )  # keys of one person
    rng = np.random.default_rng(3)
    statistic, free = 0.0, 0
    for levels_vpp in ((80.0, 0.0), (0.0, 110.0), (90.0, 90.0), (200.0, 70.0), (0.0, 0.0)):
        p = answer_probabilities(
            [person], levels_vpp, responses, 1.0, gains=OWN_FINGERS, shift_db=(1.0, -1.0)
        ).ravel()
        expected = 1500 * np.array([*p, 1 - sum(p)])
        drawn = [
            person.answer(*levels_vpp, responses, rng, 1.0, shift_db=(1.0, -1.0)).response
            for _ in range(1500)
        ]
        found = np.array([drawn.count(one) for one in (*responses, None)])
        assert not found[expected < 1e-9].any()
        seen = expected > 1e-9
        statistic += float(((found - expected)[seen] ** 2 / expected[seen]).sum())
        free += int(seen.sum()) - 1
    assert chi2.sf(statistic, free) > 0.001
