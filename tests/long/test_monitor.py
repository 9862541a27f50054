"""Thousands of bursts through a monitor: every fault is caught, and no good burst is blamed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.test_device.loops import DELAY, FAULTS, SHARE, SIDES, clean_gain, scaled
from tests.test_device.monitors import MonitorRig as Rig


@pytest.mark.parametrize("noise_db", [20.0, 40.0])
def test_ten_thousand_bursts_every_fault_is_caught_and_no_good_one_is_blamed(
    noise_db: float,
) -> None:
    rig = Rig(noise_db=noise_db, seed=round(noise_db))
    rng = np.random.default_rng(7)
    names, gain = [*FAULTS, "late", "early"], clean_gain(noise_db)
    faults = bursts = blanks = 0
    for i in range(math.ceil(5000 * SHARE)):
        side = ("left", "right", "both", "none")[i % 4]
        drift, skew = 20 * math.sin(i / 300), rng.uniform(-5, 5)
        rig.card.line.delays = [DELAY + drift, DELAY + drift + skew]
        rig.card.line.path = scaled(1 + rng.uniform(-gain, gain))
        good = rig.measure(side, answer_s=0.12)
        wanted = None if side == "none" else "line"
        assert (good.verified, good.faults, good.noted) == (wanted, (), ()), (i, good)
        if side == "none":
            blanks += 1
        else:
            bursts += 1
            on = [d for d, on in zip(rig.card.line.delays, SIDES[side][1:], strict=True) if on]
            assert good.late_s is not None
            assert good.onset_uncertainty_s is not None
            assert abs(good.late_s * 48e3 - (min(on) - DELAY)) < 1
        name = names[rng.integers(len(names))]
        side = ("left", "right")[rng.integers(2)]
        if name in {"late", "early"}:
            rig.card.line.delays = [DELAY + (54 if name == "late" else -54)] * 2
        else:
            rig.card.line.path = FAULTS[name][0]
        bad = rig.measure(side, answer_s=0.12)
        assert bad.verified == "false", (i, name, bad)
        faults += 1
    print(f"{noise_db:g} dB: all of {faults} faults caught, all of {bursts} good bursts verified,")
    print(f"none of {blanks} blanks blamed")


@pytest.mark.parametrize("noise_db", [10.5, 15.0])
def test_down_to_10_db_the_stated_uncertainty_covers_95_percent(noise_db: float) -> None:
    rig = Rig(noise_db=noise_db, peak=0.5, silence=0.5, correlation=0.5)
    rng = np.random.default_rng(8)
    tries, covered, n_measured = math.ceil(3000 * SHARE), 0, 0
    for _ in range(tries):
        delay = DELAY + rng.uniform(-20, 20)
        rig.card.line.delays = [delay, delay]
        measured = rig.measure(answer_s=0.2)
        if measured.late_s is not None and measured.onset_uncertainty_s is not None:
            n_measured += 1
            known_s = measured.onset_uncertainty_s
            covered += abs(measured.late_s - (delay - DELAY) / 48e3) <= known_s
    print(f"{noise_db} dB: {covered} of {n_measured} covered, {n_measured} of {tries} measured")
    assert n_measured > 0.9 * tries
    assert covered >= 0.95 * n_measured - 2 * math.sqrt(n_measured * 0.05 * 0.95)
