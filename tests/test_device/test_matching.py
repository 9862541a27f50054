"""Bursts matched in a record: onset, amplitude and sign, and how well they are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from device.monitor.matching import Template

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from device.monitor.matching import TemplateMatch

QUIET, AFTER, PEAK = 4800, 2400, 0.4


def sine(rate_hz: float, frequency_hz: float, cycles: int) -> NDArray[np.float64]:
    frames = np.arange(round(rate_hz * cycles / frequency_hz) + 1)
    wave: NDArray[np.float64] = np.sin(2 * np.pi * frequency_hz * frames / rate_hz)
    return wave


SHAPES = {
    "one cycle": sine(48_000, 500, 1),
    "3 kHz at 44.1 kHz": sine(44_100, 3000, 1),
    "five cycles under a Hann window": sine(48_000, 500, 5) * np.hanning(481),
    "click": np.array([0, 0.5, 1, 0.5, 0, -0.5, -1, -0.5, 0]),
}


def delayed(
    shape: NDArray[np.float64], delay: float, rng: np.random.Generator, *, noise_db: float
) -> TemplateMatch:
    """Return what is matched of a burst that is so many frames late, in noise."""
    template = Template(shape)
    record = np.zeros(QUIET + AFTER + template.length)
    whole = int(delay)
    burst = PEAK * template.shifted(delay - whole)
    start = QUIET + whole - (len(template.shape) - template.length) // 2
    record[start : start + len(burst)] = burst
    noise_rms = PEAK * template.rms * 10 ** (-noise_db / 20)
    noise = noise_rms * rng.normal(size=len(record))
    return template.find(record + noise, quiet=QUIET, limit=1.0)


@pytest.mark.parametrize("name", SHAPES)
def test_a_burst_is_matched_by_a_thousandth_of_a_frame_without_noise(name: str) -> None:
    rng = np.random.default_rng(1)
    for delay in np.linspace(50, 400, 29):
        match = delayed(SHAPES[name], delay, rng, noise_db=90)
        assert match.onset == pytest.approx(delay, abs=2e-3)
        assert match.amplitude == pytest.approx(PEAK, rel=1e-3)
        assert match.correlation == pytest.approx(1.0, abs=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("noise_db", [10, 20])
def test_the_stated_uncertainty_covers_95_percent(name: str, noise_db: int) -> None:
    rng = np.random.default_rng(2)
    covered = worst = 0.0
    for _ in range(200):
        delay = rng.uniform(50, 400)
        match = delayed(SHAPES[name], delay, rng, noise_db=noise_db)
        covered += abs(match.onset - delay) <= match.onset_uncertainty
        worst = max(worst, abs(match.onset - delay))
    assert covered >= 183  # 5 % of 200 less or more than 190 happens in one of 25
    if noise_db == 20:
        assert worst < 1


def heard(
    shape: NDArray[np.float64],
    record: NDArray[np.float64],
    rng: np.random.Generator,
    *,
    noise_db: float = 20.0,
) -> TemplateMatch:
    noise_rms = 10 ** (-noise_db / 20) * float(np.sqrt(np.mean(shape**2)))
    noise = noise_rms * rng.normal(size=len(record))
    return Template(shape).find(record + noise, quiet=20_000, limit=10.0)


@pytest.mark.parametrize("cycles", [5, 10, 20])
def test_another_shape_is_heard_by_its_energy(cycles: int) -> None:
    rng, frames = np.random.default_rng(8), 96 * cycles + 1
    shape, other = sine(48_000, 500, cycles), sine(48_000, 1000, 2 * cycles)
    record = np.zeros(60_000)
    record[22_000 : 22_000 + frames] = shape
    alone = heard(shape, record, rng)
    assert alone.beside == 0.0
    assert alone.loudest == pytest.approx(1.0, abs=0.1)
    record[40_000 : 40_000 + frames] = 0.9 * other
    both = heard(shape, record, rng)
    assert both.second < 0.1
    assert both.beside == pytest.approx(0.9, abs=0.1)


@pytest.mark.parametrize(("cycles", "noise_db"), [(1, 20.0), (5, 20.0), (10, 30.0), (20, 40.0)])
def test_a_burst_upside_down_is_not_one_half_a_period_later(cycles: int, noise_db: float) -> None:
    rng, frames = np.random.default_rng(9), 96 * cycles + 1
    shape = sine(48_000, 500, cycles) * np.hanning(frames)
    record = np.zeros(60_000)
    for sign in (1, -1):
        record[22_000 : 22_000 + frames] = sign * shape
        inverted = {heard(shape, record, rng, noise_db=noise_db).inverted for _ in range(4)}
        assert inverted == {sign < 0}
