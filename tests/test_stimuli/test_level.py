"""Levels at the other finger, and the shortest window that keeps a wanted one."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from stimuli import Burst, Fingertip, felt, level_db, shortest_window
from stimuli.fingers import level
from tests.test_stimuli.plates import CYCLE, DISCS, HANN, SUPPORTED, TIPS, W, disc

HELD = SUPPORTED.with_cutoff(2900.0)
MATRIX_M = [[2e-6, 1e-7, 5e-7], [2e-7, 3e-6, 6e-7]]


def burst_of(cycles: int, window: Any) -> Burst:
    return Burst(frequency_hz=500.0, cycles=cycles, window=window)


def test_a_tenth_of_the_own_peak_is_minus_twenty_decibels() -> None:
    assert level_db(MATRIX_M, own=0, other=1) == pytest.approx(-20.0, abs=1e-12)


def test_exchanging_the_fingers_changes_the_sign() -> None:
    there = level_db(MATRIX_M, own=0, other=1, load=2)
    assert there == pytest.approx(-level_db(MATRIX_M, own=1, other=0, load=2), abs=1e-12)
    assert there == pytest.approx(20 * math.log10(6 / 5), abs=1e-12)


def test_the_own_level_is_zero_and_nothing_felt_is_minus_infinity() -> None:
    assert level_db(MATRIX_M, own=1, other=1) == 0
    assert level_db([[1e-6], [0.0]], own=0, other=1) == -math.inf


@pytest.mark.slow
def test_the_papers_burst_is_some_thirty_decibels_quieter_at_the_other_finger() -> None:
    # one cycle of 500 Hz on the paper's plate (first cut-off 2900 Hz), 70 mm, over 1 cm diameter
    found_db = level_db(felt(HELD, DISCS, TIPS, CYCLE), own=0, other=1)
    assert found_db == pytest.approx(-29.0, abs=0.3)


@pytest.mark.slow
def test_the_edge_and_the_window_decide_the_level() -> None:
    levels = [
        level_db(felt(strip, DISCS, TIPS, burst), own=0, other=1)
        for strip in (SUPPORTED, HELD)
        for burst in (CYCLE, HANN)
    ]
    assert levels[1] < levels[0] - 20
    assert levels[3] < levels[2] - 20
    assert levels[2] < levels[0]
    assert levels[3] < levels[1]


LEVELS = {(1, "none"): -20.0, (1, "tukey"): -29.8, (1, "gaussian"): -28.0, (1, "hann"): -25.0}


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, str]]:
    """Give each burst a level of its own, -30 dB with two cycles; return what is asked for."""
    asked: list[tuple[int, str]] = []

    def felt(_strip: Any, _loads: Any, _tips: Any, burst: Burst) -> Any:
        asked.append((burst.cycles, burst.window))
        worst = 10 ** (LEVELS.get(asked[-1], -30.0) / 20)
        return np.array([[1.0, 1e-9], [worst, 1.0]])

    monkeypatch.setattr(level, "felt", felt)
    return asked


def test_windows_are_tried_from_the_shortest_until_one_is_quiet_enough(
    asked: list[tuple[int, str]],
) -> None:
    choice = shortest_window(HELD, DISCS, TIPS, CYCLE, wanted_db=-30.0)
    assert choice.burst == burst_of(2, "none")
    assert choice.level_db == pytest.approx(-30.0, abs=1e-12)
    assert choice.extra_s == pytest.approx(0.002, rel=1e-12)
    assert asked == [*LEVELS, (2, "none")]
    assert [(burst.cycles, burst.window) for burst, _ in choice.louder] == [*LEVELS]
    assert all(level > -30.0 for _, level in choice.louder)


def test_a_burst_quiet_enough_is_kept(asked: list[tuple[int, str]]) -> None:
    choice = shortest_window(HELD, DISCS, TIPS, CYCLE, wanted_db=-20.0)
    assert (choice.burst, choice.extra_s, len(asked)) == (CYCLE, 0, 1)
    assert choice.level_db == pytest.approx(-20.0, abs=1e-12)


def test_a_burst_has_to_be_quiet_on_all_plates_that_it_may_be(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    other = dataclasses.replace(HELD, thickness_m=2 * HELD.thickness_m)
    levels_db = {
        (HELD, "none"): -9.0, (HELD, "tukey"): -12.0, (HELD, "gaussian"): -13.0,
        (other, "tukey"): -9.0, (other, "gaussian"): -11.0,
    }  # fmt: skip

    def felt(strip: Any, _loads: Any, _tips: Any, burst: Burst) -> Any:
        worst = 10 ** (levels_db[strip, burst.window] / 20)
        return np.array([[1.0, 1e-9], [worst, 1.0]])

    monkeypatch.setattr(level, "felt", felt)
    choice = shortest_window(HELD, DISCS, TIPS, CYCLE, wanted_db=-10.0, also=[other])
    assert choice.burst == burst_of(1, "gaussian")
    assert choice.level_db == pytest.approx(-11.0)


@pytest.mark.slow
def test_the_first_window_that_is_quiet_enough_is_taken() -> None:
    choice = shortest_window(HELD, DISCS, TIPS, CYCLE, wanted_db=-65.0)
    tried = [
        level_db(felt(HELD, DISCS, TIPS, burst_of(n, w)), 0, 1)
        for n, w in [
            (1, "none"),
            (1, "tukey"),
            (1, "gaussian"),
            (1, "hann"),
            (2, "none"),
            (2, "tukey"),
        ]
    ]
    assert choice.burst == burst_of(2, "gaussian")
    assert choice.level_db <= -65.0 < min(tried)
    assert choice.extra_s == pytest.approx(0.002, rel=1e-12)


@pytest.mark.slow
def test_the_worst_of_all_fingers_counts() -> None:
    tips = (*TIPS, Fingertip(x_m=0.055, y_m=W / 2))
    near = tuple(dataclasses.replace(tip, radius_m=0.0) for tip in tips)
    discs = (*DISCS, disc(x_m=0.055))
    choice = shortest_window(HELD, discs, near, CYCLE, wanted_db=-10.0)
    peaks_m = felt(HELD, discs, near, choice.burst)
    levels = [level_db(peaks_m, i, j) for i in range(3) for j in range(3) if i != j]
    assert choice.level_db == max(levels)
    assert choice.level_db > level_db(peaks_m, 0, 1)


@pytest.mark.slow
def test_a_level_that_no_burst_reaches_is_refused_with_the_best_one() -> None:
    longest = Burst(frequency_hz=2000.0, cycles=20)
    with pytest.raises(
        ValueError, match=r"wanted_db must be reached .*20 cycles, got -300.*lowest"
    ):
        shortest_window(HELD, DISCS, TIPS, longest, wanted_db=-300.0)
