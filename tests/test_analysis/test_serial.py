"""Serial effects: none is found where the order of stimuli is not random, and true ones are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

from analysis.answers import serial
from benchmarks.people import HONEST
from benchmarks.serial import LAST, NO_EFFECT, found, levels_follow, session
from tests.test_analysis.shared import SINGLE
from tests.test_analysis.tables import table_of


def trials(side: list[str], level_vpp: list[float], response: list[str]) -> pd.DataFrame:
    """Trials of one person in their order."""
    table = pd.DataFrame({"side": side, "level_vpp": level_vpp, "response": response})
    fixed = SINGLE | {"session": "01", "block": 1, "attempt": 1, "none_offered": True}
    more = {name: value for name, value in fixed.items() if name not in table}
    return table.assign(**more, trial=np.arange(len(table)))


def effect(table: pd.DataFrame, name: str = "felt") -> Any:
    (one,) = (one for one in table_of("choice", table) if one.participant == "all")
    return getattr(one.serial, name)


def test_a_run_has_one_stimulus_and_as_many_trials_as_a_drift_allows() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        stimuli = rng.integers(0, rng.integers(1, 9), rng.integers(1, 200))
        blocks = np.sort(rng.integers(0, rng.integers(1, 9), len(stimuli)))
        number = serial.runs(stimuli, blocks)
        assert set(number) == set(range(number.max() + 1))
        for one in range(number.max() + 1):
            (name,) = set(stimuli[number == one])
            assert (number == one).sum() >= min(5, (stimuli == name).sum())


def test_blocks_with_enough_of_a_stimulus_share_no_run() -> None:
    stimuli, blocks = np.tile([0, 0, 0, 1], 8), np.repeat([1, 2], 16)
    number = serial.runs(stimuli, blocks)
    assert not set(number[stimuli == 0][:12]) & set(number[stimuli == 0][12:])
    assert len(set(number[stimuli == 1])) == 1  # four in a block are too few


def test_strong_and_weak_stimuli_in_turn_are_no_effect_of_answers() -> None:
    level = [90.0, 30.0] * 40
    answer = ["left" if one == 90 else "none" for one in level]
    found = effect(trials(["left"] * 80, level, answer))
    assert (found.again.p, found.p, found.difference) == (0.0, None, None)
    assert found.reason
    rng = np.random.default_rng(1)
    unsure = [a if rng.random() < 0.8 else "none" for a in answer]
    found = effect(trials(["left"] * 80, level, unsure))
    assert found.again.p == 0
    assert found.p is None or found.p > 0.05


@pytest.mark.slow
def test_the_difference_is_that_of_proportions_beyond_the_stimuli() -> None:
    rng = np.random.default_rng(2)
    level = rng.choice([40.0, 60.0, 80.0], 6000)
    felt = [True]
    for one in level[1:]:
        felt.append(rng.random() < {40: 0.2, 60: 0.5, 80: 0.8}[one] + (0.1 if felt[-1] else -0.1))
    found = effect(trials(["left"] * 6000, level.tolist(), ["left" if y else "none" for y in felt]))
    assert found.difference == pytest.approx(0.2, abs=0.04)
    assert found.p == 0.002
    beyond = found.again.p - found.otherwise.p - (found.expected - found.expected_otherwise)
    assert beyond == pytest.approx(0.2, abs=0.04)


def test_pairs_are_counted_within_a_block_and_an_attempt() -> None:
    pairs = [("left", "left"), ("right", "right"), ("left", "none"), ("right", "right")]
    pairs += [("left", "timeout"), ("both", "both"), ("left", "left")]
    table = trials([side for side, _ in pairs], [60.0] * 7, [said for _, said in pairs])
    table = table.assign(kind=["both" if side == "both" else "single" for side, _ in pairs])
    correct, felt, side = (effect(table, name) for name in ("correct", "felt", "side"))
    assert (correct.again.count, correct.again.of) == (2, 4)
    assert (correct.otherwise.count, correct.otherwise.of) == (1, 1)
    assert (felt.again.count, felt.again.of) == (2, 3)
    assert (side.again.count, side.again.of) == (0, 1)
    same = trials(["left"] * 6, [60.0] * 6, ["left"] * 6)
    changes: tuple[tuple[slice, str, Any, int], ...] = (
        (slice(3, None), "block", 2, 4),
        (slice(1, 1), "reason", "voided", 2),
        (slice(4, 4), "attempt", 2, 0),
    )
    for rows, column, value, of in changes:
        same.loc[rows, column] = value
        assert effect(same, "side").again.of == of


@pytest.mark.parametrize("answers", [["left", "none"] * 5, ["left"] * 10])
def test_one_side_answered_always_has_no_p(answers: list[str]) -> None:
    side = effect(trials(["left"] * 10, [60.0] * 10, answers), "side")
    assert side.p is None
    assert side.reason


def test_runs_of_misses_are_found_and_a_drift_between_blocks_is_no_effect() -> None:
    rng = np.random.default_rng(3)
    sides = rng.choice(["left", "right"], 120).tolist()
    answers = [side if n // 20 % 2 else "none" for n, side in enumerate(sides)]
    table = trials(sides, [60.0] * 120, answers)
    assert effect(table, "correct").p == effect(table).p == 0.002
    mixed = table.sample(frac=1, random_state=1).assign(trial=range(120))
    found = effect(mixed, "correct")
    assert found.p > 0.05
    assert found.expected == pytest.approx(found.again.p, abs=0.1)
    felt = np.random.default_rng(4).random(180) < np.repeat([0.95, 0.5, 0.05], 60)
    drift = trials(["left"] * 180, [60.0] * 180, np.where(felt, "left", "none").tolist())
    found = effect(drift.assign(block=np.repeat([1, 2, 3], 60)), "correct")
    assert found.again.p - found.otherwise.p > 0.3
    assert found.p > 0.05


def test_levels_of_a_staircase_tell_nothing() -> None:
    order = NO_EFFECT["staircase, one"][0]
    told = [levels_follow([session(order, HONEST, np.random.default_rng(s))]) for s in range(20)]
    assert max(told) < serial.FOLLOWING_Z
    level, answers, rng = [60.0], [], np.random.default_rng(1)
    for _ in range(80):
        answers.append(str(rng.choice(["left", "none"], p=[level[-1] / 120, 1 - level[-1] / 120])))
        level.append(level[-1] + (-10.0 if answers[-1] == "left" else 10.0))
    one = effect(trials(["left"] * 80, level[:-1], answers))
    assert (one.p, one.difference, one.reason) == (None, None, serial.ADAPTIVE)


@pytest.mark.slow
def test_one_in_twenty_tables_without_an_effect_has_a_small_p() -> None:
    order, median = NO_EFFECT[""]
    told = found(order, median, 400, compared=False)
    assert told["felt"].of > 380
    for what in ("felt", "correct"):
        assert told[what].small <= 0.085 * told[what].of
        assert abs(told[what].difference) < 0.015
    assert told["side"].small <= max(0.085 * told["side"].of, 4)


@pytest.mark.slow
def test_an_effect_of_the_last_answer_is_found() -> None:
    told = found(*LAST[", 2.0"], 60, compared=False)
    assert told["felt"].small >= 45
    assert 0.12 < told["felt"].difference < 0.25
