"""Bursts measured: every fault above its tolerance is caught, and there is no false alarm."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from device import LinkError, VirtualClock
from device.monitor.measured import Fault, Tap, void
from tests.test_device.bursts import BURST
from tests.test_device.in_process import recorder_on
from tests.test_device.loops import (
    DELAY,
    FAULTS,
    FULL_SCALE_V,
    LEVEL_VPP,
    SIDES,
    again,
    scaled,
)
from tests.test_device.monitors import MonitorRig, check_bursts

if TYPE_CHECKING:
    from numpy.typing import NDArray


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_above_its_tolerance_is_caught(name: str) -> None:
    rig = MonitorRig()
    rig.card.line.path, faults = FAULTS[name]
    for side in ("left", "right"):
        measured = rig.measure(side)
        assert measured.verified == "false"
        assert set(measured.faults) & faults


@pytest.mark.slow
def test_what_is_just_above_silence_is_reported_in_noise_and_what_is_half_of_it_is_not() -> None:
    rig = MonitorRig(noise_db=20)
    for part, faults in ((0.205, (Fault.STRAY,)), (0.1, ())):
        rig.card.line.path = lambda past, part=part: past + part * past[:, ::-1]  # type: ignore[misc]
        assert [rig.measure().faults for _ in range(6)] == [faults] * 6
    for part, faults in ((0.205, (Fault.DOUBLED,)), (0.1, ())):
        rig.card.line.path = again(2000, part)
        assert [rig.measure().faults for _ in range(6)] == [faults] * 6


@pytest.mark.parametrize("sign", [1, -1])
def test_a_burst_clipped_on_one_side_alone_is_reported_and_a_slow_drift_is_not(sign: int) -> None:
    rig, most = MonitorRig(), LEVEL_VPP / 2 / FULL_SCALE_V
    rig.card.line.path = lambda past: sign * np.minimum(sign * past, 0.78 * most)
    assert Fault.CLIPPED in rig.measure().faults
    drift = most * 0.04 * sign  # what an input coupled at 20 Hz makes of one cycle of 500 Hz
    rig.card.line.path = lambda past: past + drift * (past != 0)
    assert rig.measure().verified == "line"


@pytest.mark.parametrize("part", [-0.25, -0.35, 0.25])
@pytest.mark.parametrize("side", ["left", "right"])
def test_what_a_silent_channel_hears_is_reported_whatever_its_sign(side: str, part: float) -> None:
    rig = MonitorRig(noise_db=30)
    rig.card.line.path = lambda past: past + part * past[:, ::-1]
    measured = rig.measure(side)
    assert measured.faults == (Fault.STRAY,)
    assert measured.peaks is not None
    heard = measured.peaks[1 if side == "left" else 0]
    assert heard == pytest.approx(abs(part) * LEVEL_VPP / 2, rel=0.05)


@pytest.mark.parametrize("side", SIDES)
def test_a_good_burst_is_verified(side: str) -> None:
    rig = MonitorRig()
    rig.card.line.delays = [DELAY + 3.3, DELAY + 17.25]
    measured = rig.measure(side)
    assert measured.faults == measured.noted == ()
    assert measured.verified == (None if side == "none" else "line")
    if side != "none":
        delay = min(d for d, on in zip(rig.card.line.delays, SIDES[side][1:], strict=True) if on)
        assert measured.late_s is not None
        assert measured.late_s * 48e3 == pytest.approx(delay - DELAY, abs=0.6)


def test_a_blank_on_a_dead_line_is_not_verified_and_one_with_a_burst_is_false() -> None:
    rig = MonitorRig()
    rig.card.line.path = scaled(0.0)
    assert (rig.measure("none").verified, rig.measure("left").verified) == (None, "false")
    rig = MonitorRig()
    rig.device.load(3, np.stack([BURST, 0 * BURST]))
    assert rig.measure("none").verified == "false"


@pytest.mark.parametrize("drift", [0.0, 50e-6, -200e-6])
def test_when_a_frame_was_heard_is_known_as_well_as_is_reported_on_a_drifting_clock(
    drift: float,
) -> None:
    clock, rng = VirtualClock(), np.random.default_rng(5)
    recorder = recorder_on(clock)
    fine = SimpleNamespace(input_overflow=False, input_underflow=False)
    covered = tries = 0
    for i in range(4000):
        clock.wait(256 / 48e3 * (1 + drift))
        stated_s = 5e-3 + 128 / 48e3 * (i // 40 % 2) + abs(rng.normal(0, 2e-4))
        timing = SimpleNamespace(currentTime=stated_s, inputBufferAdcTime=0.0)
        recorder.take(np.zeros((256, 2), dtype=np.int16), timing, fine)
        if i >= 800 and i % 10 == 0:
            heard_s, known_s = recorder.time_of(recorder.frames - 256)
            covered += abs(heard_s - (clock.now_s() - 5e-3 - 64 / 48e3)) <= known_s
            tries += 1
            assert known_s < 4e-3
    assert covered >= 0.95 * tries


@pytest.mark.parametrize("frames", [0.0, 2052.0, 3800.0])
def test_without_a_stated_delay_no_burst_is_early_or_late_and_its_delay_is_reported(
    frames: float,
) -> None:
    rig = MonitorRig(stated=False)
    rig.card.line.delays = [DELAY + frames, DELAY + frames]
    verified = [rig.measure(side).verified for side in ("left", "none", "both")]
    assert verified == ["line", None, "line"]
    late_s = rig.measure().late_s
    assert late_s is not None
    assert late_s * 48e3 == pytest.approx(DELAY + frames, abs=0.6)
    rig.card.line.path = scaled(0.0)
    assert rig.measure().faults == (Fault.SILENT,)
    assert "monitor.delay_ms" in rig.monitor.unseen
    assert "monitor.delay_ms" not in MonitorRig().monitor.unseen


def test_frames_that_were_put_in_make_a_burst_unmeasured() -> None:
    rig = MonitorRig()

    def torn(past: NDArray[np.float64]) -> NDArray[np.float64]:
        rig.card.put_in = True
        return past

    rig.card.line.path = torn
    measured = rig.measure()
    assert (measured.verified, measured.faults) == ("false", ())
    assert measured.unmeasured
    rig.card.line.path = lambda past: past
    assert rig.measure().verified == "line"


def test_a_monitor_opens_when_its_inputs_run_steadily() -> None:
    rig = MonitorRig()
    rig.card.recorder.restart()
    before_s = rig.card.now_s()
    rig.card.put_in = True
    rig.monitor.open()
    assert 1.0 <= rig.card.now_s() - before_s < 1.1
    rig.card.recorder.restart()
    rig.card.word_s = 0.6
    with pytest.raises(LinkError, match=r"10 s: .* 0\.6 s.* 0\.1 s"):
        rig.monitor.open()


@pytest.mark.parametrize("fault", ["silence", "too weak", "swap", "again later"])
@pytest.mark.parametrize("noise_db", [9.0, 3.0, 0.0])
def test_below_10_db_nothing_is_verified(fault: str, noise_db: float) -> None:
    rig = MonitorRig(noise_db=noise_db)
    measured = rig.measure()
    assert (measured.verified, measured.faults, measured.onset_s) == ("false", (), None)
    assert measured.unmeasured
    rig.card.line.path = FAULTS[fault][0]
    assert rig.measure().verified != "line"


def test_a_dead_input_is_not_measured() -> None:
    rig = MonitorRig()
    rig.card.recorder.take = lambda *_: None  # type: ignore[method-assign]
    measured = rig.measure()
    assert (measured.verified, measured.faults, measured.onset_s) == ("false", (), None)
    assert measured.unmeasured


def test_motion_voids_silence_swap_and_doubling_only() -> None:
    rig = MonitorRig(tap=Tap.MOTION)
    for name, (path, _) in FAULTS.items():
        rig.card.line.path = path
        measured = rig.measure()
        wrong = name in {"silence", "swap"}
        assert measured.verified == ("false" if wrong else "motion"), name
        assert measured.faults or measured.noted or name.startswith("again"), name
    for frames in (len(BURST) - 1, 2000):
        rig.card.line.path = again(frames, gain=0.9)
        assert rig.measure().faults == (Fault.DOUBLED,), frames
    assert void(tuple(Fault), Tap.MOTION) == (
        Fault.SILENT,
        Fault.SWAPPED,
        Fault.DOUBLED,
        Fault.AMPLIFIER_OFF,
    )


@pytest.mark.slow
@pytest.mark.parametrize("noise_db", [20.0, 40.0])
def test_among_many_bursts_every_fault_is_caught_and_no_good_one_is_blamed(noise_db: float) -> None:
    check_bursts(60, noise_db=noise_db, seed=round(noise_db))
