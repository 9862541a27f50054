"""The observer: answers follow the psychometric function, and the masking of section V."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

from experiment.perception.answers import answer_probabilities, draw_answers
from tests.test_experiment.people import finger_gains, population

FORCED = ("left", "right", "both")
WITH_NONE = ("left", "right", "both", "none")
OFFERED = (("left", "right"), FORCED, ("left", "right", "none"), WITH_NONE)
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
DRIVEN_FINGERS = finger_gains((1.0, 0.0), (0.0, 1.0), None)


def shares(
    observer: Any,
    levels_vpp: tuple[float, float],
    responses: tuple[str, ...],
    *,
    gains: Any = DRIVEN_FINGERS,
    window_s: float = math.inf,
) -> dict[str, float]:
    """Return the probability of every answer to one stimulus."""
    p = answer_probabilities([observer], [levels_vpp], responses, window_s, gains=gains)
    return dict(zip(responses, p.ravel().tolist(), strict=True))


def psychometric(level_vpp: float, guess_rate: float = 0.0, lapse_rate: float = 0.0) -> float:
    """Return gamma + (1 - gamma - lambda) Phi(log10(V / 60 V) / 0.1), docs/model.md."""
    felt = NormalDist().cdf(math.log10(level_vpp / 60.0) / 0.1)
    return guess_rate + (1.0 - guess_rate - lapse_rate) * felt


def test_a_finger_detects_by_the_normal_distribution_of_the_logarithm() -> None:
    # Phi(1) = 0.8413447460685429 (Abramowitz and Stegun, table 26.1)
    for strength, p in ((0.0, 0.0), (1e-300, 0.0), (1.0, 0.5), (10**0.1, 0.8413447460685429)):
        missed = shares(IDEAL, (60.0 * strength, 0.0), WITH_NONE)["none"]
        assert missed == pytest.approx(1 - p, abs=1e-14)


@pytest.mark.parametrize("level_vpp", [40.0, 55.0, 60.0, 70.0, 95.0, 200.0])
def test_a_forced_choice_follows_the_function_with_a_guess_rate_of_one_half(
    level_vpp: float,
) -> None:
    observer = replace(IDEAL, lapse_rate=0.06)
    # a lapse picks one of three answers: two of three are wrong; the rest guess or feel
    expected = psychometric(level_vpp, guess_rate=0.94 * 0.5 + 0.06 / 3, lapse_rate=0.06 * 2 / 3)
    assert shares(observer, (level_vpp, 0.0), FORCED)["left"] == pytest.approx(expected)
    lapsing = shares(replace(IDEAL, lapse_rate=1.0), (200.0, 0.0), WITH_NONE)
    assert lapsing == pytest.approx(dict.fromkeys(WITH_NONE, 0.25))


@pytest.mark.parametrize(("side_bias", "guess_both"), [(0.5, 0.0), (0.8, 0.25)])
def test_nothing_felt_in_a_forced_choice_is_a_guess_as_stated(
    side_bias: float, guess_both: float
) -> None:
    observer = replace(IDEAL, side_bias=side_bias, guess_both=guess_both)
    guesses = shares(observer, (0.0, 0.0), FORCED)
    assert guesses["both"] == pytest.approx(guess_both)
    assert guesses["left"] == pytest.approx((1 - guess_both) * side_bias)


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
        # confused keys change sides only
        ((1000.0, 0.0), {"reversed_mapping": True}, FORCED, "right"),
        ((1000.0, 1000.0), {"reversed_mapping": True}, FORCED, "both"),
    ],
)
def test_strong_and_absent_stimuli_have_a_sure_answer(
    levels_vpp: tuple[float, float],
    changed: dict[str, Any],
    responses: tuple[str, ...],
    answer: str,
) -> None:
    observer = replace(IDEAL, **changed)
    assert shares(observer, levels_vpp, responses)[answer] == pytest.approx(1.0)


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
        (TWICE, UM, (0.0, 30.0), "none", 1 - psychometric(30.0)),
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
    assert shares(observer, levels_vpp, WITH_NONE, gains=gains)[answer] == pytest.approx(share)


def test_micrometres_without_a_displacement_are_refused() -> None:
    with pytest.raises(ValueError, match="threshold_um"):
        shares(UM, (60.0, 0.0), FORCED)


@pytest.mark.parametrize("thresholds", [(None, None), (1.2, 60.0)])
def test_an_observer_has_one_threshold(thresholds: tuple[float | None, float | None]) -> None:
    with pytest.raises(ValueError, match="threshold_um or threshold_vpp"):
        replace(IDEAL, threshold_um=thresholds[0], threshold_vpp=thresholds[1])


@pytest.mark.parametrize("other_db", [0.0, 6.0, 12.0])
def test_graded_masking_raises_a_threshold_by_what_the_other_finger_feels(other_db: float) -> None:
    person = replace(IDEAL, masking_slope=0.5)
    left_vpp, right_vpp = 60.0 * 10 ** (3 / 20), 60.0 * 10 ** (other_db / 20)
    left, right = (3 - 0.5 * other_db) / 2, (other_db - 0.5 * 3) / 2  # in sigma, 2 dB
    both = NormalDist().cdf(left) * NormalDist().cdf(right)
    assert shares(person, (left_vpp, right_vpp), FORCED)["both"] == pytest.approx(both)


def test_reactions_are_slower_to_weak_stimuli_and_never_impossibly_fast() -> None:
    observer = replace(IDEAL, reaction_time_spread=1.5)
    levels_vpp = np.repeat([[40.0], [60.0], [200.0]], 2000, axis=1)
    _, times_s = draw_answers(
        [observer],
        [(levels_vpp, 0.0)],
        FORCED,
        math.inf,
        np.random.default_rng(3),
        gains=DRIVEN_FINGERS,
    )
    medians_s = np.median(times_s, axis=1)
    assert np.all(np.diff(medians_s) < 0)
    assert medians_s[2] == pytest.approx(0.5, rel=0.1)
    assert times_s.min() > FASTEST_S
    slow = replace(IDEAL, reaction_time_s=10.0, reaction_time_spread=0.0)
    late, early = (shares(slow, (200.0, 0.0), FORCED, window_s=s)["left"] for s in (9.9, 10.1))
    assert (late, early) == pytest.approx((0.0, 1.0))


def test_drawn_thresholds_have_the_stated_median_and_spread_in_db() -> None:
    rng = np.random.default_rng(4)
    for key, median in (("threshold_vpp", 60.0), ("threshold_um", 1.5)):
        people = population(**{key: median, "threshold_sd_db": 2.0})
        drawn = [getattr(people.draw(70.0, rng), key) for _ in range(4000)]
        level_db = 20 * np.log10(np.array(drawn) / median)
        assert abs(np.mean(level_db)) < 5 * 2.0 / math.sqrt(4000)
        assert np.std(level_db) == pytest.approx(2.0, rel=0.06)


@pytest.mark.parametrize("seed", range(20))
def test_draws_are_as_frequent_as_their_probabilities(seed: int) -> None:
    rng = np.random.default_rng((20, seed))
    person = replace(
        IDEAL,
        threshold_vpp=rng.uniform(40.0, 120.0),
        sigma=rng.uniform(0.03, 0.3),
        lapse_rate=rng.uniform(0.0, 0.1),
        false_alarm_rate=rng.uniform(0.0, 0.3),
        side_bias=rng.uniform(0.2, 0.8),
        guess_both=rng.uniform(0.0, 0.3),
        reaction_time_s=rng.uniform(0.3, 1.0),
        reaction_time_spread=rng.uniform(0.1, 0.8),
        crosstalk_db=rng.uniform(-40.0, -5.0),
        finger_difference_db=rng.normal(0.0, 3.0),
        masking_slope=(None, 0.2, 0.6)[seed % 3],
        reversed_mapping=seed % 2 == 1,
    )
    responses, window_s = OFFERED[seed % len(OFFERED)], rng.uniform(0.4, 2.0)
    stimuli_vpp = rng.choice([0.0, 60.0, 90.0, 200.0], (5, 2))
    shift_db: Any = tuple(rng.normal(0.0, 2.0, 2))
    trials = 20_000  # of each stimulus
    for left_vpp, right_vpp in stimuli_vpp:
        levels_vpp = [(np.full(trials, left_vpp), np.full(trials, right_vpp))]
        drawn, _ = draw_answers(
            [person], levels_vpp, responses, window_s, rng, gains=DRIVEN_FINGERS, shift_db=shift_db
        )
        p = answer_probabilities(
            [person],
            [([left_vpp], [right_vpp])],
            responses,
            window_s,
            gains=DRIVEN_FINGERS,
            shift_db=shift_db,
        ).ravel()
        p = np.append(p, max(0.0, 1 - p.sum()))
        share = np.bincount(drawn.ravel(), minlength=p.size) / trials
        # five standard deviations: one of the 100 stimuli fails in ten thousand seeds
        assert np.all(np.abs(share - p) <= 5 * np.sqrt(p * (1 - p) / trials) + 1e-9)
