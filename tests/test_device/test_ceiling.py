"""A million waveforms, levels, gains and ceilings: nothing above a ceiling ever leaves a device."""

import io
from fractions import Fraction

import numpy as np
import pytest

from device.clock import VirtualClock
from device.core.core import DeviceCore
from device.core.messages import Arm, Enable, Fire, Levels, LoadSlot, Stop, to_codes
from device.core.output import Emission, OutputStage
from device.driver import FloatArray
from device.emulate.emulator import Nature
from device.emulate.faults import Faults, FaultScript
from device.errors import LimitExceeded, Refusal
from device.limits import Limits, check_ceiling
from tests.test_device.bursts import sine
from tests.test_device.in_process import InProcess

FULL = 32767
STAGE = OutputStage(rail_v=1000.0, slew_v_s=1e9)
N_SETTINGS = 1000
N_WAVEFORMS = 1000


def a_setting(rng: np.random.Generator) -> tuple[Limits, int]:
    """Draw a ceiling, a gain and a level whose product with some peak comes near the ceiling."""
    ceiling_vpp = float(rng.integers(1, 400_001)) / 1000
    gain = float(rng.choice([1.0, 0.1, 27.5, 1 / 3, rng.uniform(0.01, 100.0)]))
    peak = float(rng.choice([1.0, 0.5, rng.uniform(0.001, 1.0)]))
    level_mvpp = round(ceiling_vpp / gain / peak * 1000) + int(rng.integers(-1, 2))
    return Limits(ceiling_vpp=ceiling_vpp, gain=gain, least_interval_s=0.0), max(0, level_mvpp)


def is_above(peak: float, level_vpp: float, limits: Limits) -> bool:
    """Compare exactly."""
    product = Fraction(peak) * Fraction(level_vpp) * Fraction(limits.gain)
    return product > Fraction(limits.ceiling_vpp)


def reason_against(peak: float, level_vpp: float, limits: Limits) -> str:
    try:
        check_ceiling(peak, level_vpp, limits)
    except LimitExceeded as refused:
        return str(refused)
    return ""


def allowed(peaks: FloatArray, levels: Levels, limits: Limits) -> list[bool]:
    """Have every peak checked; each refusal names the values."""
    level_vpp = levels.vpp[0]
    end = f" x {level_vpp:g} x {limits.gain:g} > {limits.ceiling_vpp:g} Vpp"
    reasons = [(peak, reason_against(peak, level_vpp, limits)) for peak in peaks.tolist()]
    assert all(not reason or reason.endswith(f"{peak:g}{end}") for peak, reason in reasons)
    return [not reason for _, reason in reasons]


@pytest.mark.slow
def test_of_a_million_combinations_none_above_the_ceiling_is_emitted() -> None:
    rng = np.random.default_rng(20)
    n_played = n_exact = 0
    for _ in range(N_SETTINGS):
        limits, level_mvpp = a_setting(rng)
        levels = Levels(left_mvpp=level_mvpp, right_mvpp=level_mvpp)
        codes = rng.integers(1, FULL + 1, size=N_WAVEFORMS, dtype=np.int32)
        critical = FULL * limits.ceiling_vpp / max(1e-9, levels.vpp[0] * limits.gain)
        codes[:5] = np.clip(int(min(critical, FULL)) + np.arange(-2, 3), 1, FULL)
        codes[5:8] = 1, FULL // 2, FULL
        peaks = codes / FULL
        passed = np.array(allowed(peaks, levels, limits))
        products = peaks * levels.vpp[0] * limits.gain
        close = np.abs(products - limits.ceiling_vpp) <= 1e-4 * limits.ceiling_vpp
        clear = ~close
        assert np.array_equal(passed[clear], (products <= limits.ceiling_vpp)[clear])
        for index in np.flatnonzero(close):
            assert passed[index] != is_above(float(peaks[index]), levels.vpp[0], limits)
        played = codes[passed]
        volts = STAGE.render(np.stack((played, -played)), levels=levels, limits=limits)
        assert np.all(2 * np.abs(volts) <= limits.ceiling_vpp)
        assert np.all(2 * np.abs(volts) <= products[passed] * (1 + 1e-12))
        n_played, n_exact = n_played + played.size, n_exact + int(close.sum())
    n_all = N_SETTINGS * N_WAVEFORMS
    print(f"{n_all} combinations: {n_played} played, {n_all - n_played} refused, {n_exact} close")
    assert n_all == 1_000_000
    assert 0.2 * n_all < n_played < 0.9 * n_all


@pytest.mark.slow
def test_a_whole_device_plays_or_refuses_each_of_thousands() -> None:
    rng = np.random.default_rng(21)
    n_played = 0
    for _ in range(5000):
        limits, level_mvpp = a_setting(rng)
        over: list[Emission] = []
        core = DeviceCore(boot_id=1, limits=limits, output=STAGE, sink=over.append)
        left, right = (
            to_codes(sine(5, peak=float(peak)), 16) for peak in rng.uniform(0.01, 1.0, 2)
        )
        core.take(0, LoadSlot(slot=0, left=left, right=right))
        core.take(0, Enable())
        peak = float(max(left.max(), right.max())) / FULL
        levels = Levels(left_mvpp=level_mvpp, right_mvpp=level_mvpp)
        above = is_above(peak, levels.vpp[0], limits)
        reason = ""
        try:
            core.take(1, levels)
            core.take(1, Arm(token=1, slot=0, time_to_live_us=1000))
            core.take(2, Fire(token=1))
        except LimitExceeded as refused:
            reason = str(refused)
        assert bool(reason) == above
        values = f"{levels.vpp[0]:g} x {limits.gain:g} > {limits.ceiling_vpp:g}"
        assert not reason or values in reason
        core.take(2_000_000, Stop())
        assert len(over) == (not above)
        for emission in over:
            n_played += 1
            for volts in (emission.left_v, emission.right_v):
                assert np.ptp(volts) <= limits.ceiling_vpp
    print(f"5000 devices: {n_played} bursts")
    assert 500 < n_played < 4500


@pytest.mark.parametrize("seed", range(5))
def test_without_the_hosts_check_the_device_refuses_alone(seed: int) -> None:
    rng, truth = np.random.default_rng(seed), io.StringIO()
    limits = Limits(ceiling_vpp=150.0, least_interval_s=0.0)
    rig = InProcess(
        VirtualClock(),
        nature=Nature(limits=limits, output=OutputStage()),
        faults=Faults(FaultScript(), rng),
        truth=truth,
    )
    rig.link.hello()
    codes = to_codes(sine(5), 16)
    rig.link.exchange(LoadSlot(slot=0, left=codes, right=codes))
    rig.link.exchange(Enable())
    for level_mvpp in rng.integers(150_001, 2**32, size=100):
        levels = [int(level_mvpp), 1]
        rng.shuffle(levels)
        with pytest.raises(LimitExceeded) as refused:
            rig.link.exchange(Levels(left_mvpp=levels[0], right_mvpp=levels[1]))
        assert refused.value.code is Refusal.CEILING
        assert f"{max(levels) / 1000:g}" in str(refused.value)
        assert "its ceiling 150 Vpp" in str(refused.value)
    rig.link.exchange(LoadSlot(slot=1, left=codes // 4, right=codes // 4))
    rig.link.exchange(Levels(left_mvpp=300_000, right_mvpp=0))
    with pytest.raises(LimitExceeded, match="300 and 0 Vpp, its ceiling 150 Vpp"):
        rig.link.exchange(Arm(token=1, slot=0, time_to_live_us=1_000_000))
    assert '"burst"' not in truth.getvalue()
