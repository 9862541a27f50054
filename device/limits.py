"""What may be played: ceilings, waveform rules, rests; refused, never clipped.

The host checks with the limits of the study, the device with its own; both call these functions.
All ceilings hold for peak(waveform) x level x gain, compared without rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from device.checks import require_positive, require_real, require_whole
from device.driver import FloatArray, Refusal, rejection

if TYPE_CHECKING:
    from collections.abc import Iterable

_LARGEST_GAIN = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a study or of a device.

    Parameters
    ----------
    ceiling_vpp : float
        Largest peak(waveform) x level x gain, in peak-to-peak volts at the actuator.
    gain : float
        Volts at the actuator per volt of level: 1 where levels are stated at the actuator.
    least_interval_s : float
        Rest from the end of one burst to the onset of the next.
    max_duty : float
        Largest ratio of a burst's duration to the time from its onset to the next onset.
    longest_waveform : int
        In samples.
    dc_tolerance : float
        Largest |sum| / sum|.| of a waveform. A sine of whole cycles with 40 or more samples each
        stays below 0.001 at any sample rate; a unipolar click has 1.
    longest_time_to_live_s : float
        Largest time to live of an armed token.

    Raises
    ------
    ValueError
        A limit is not a positive finite number, or a ratio is above 1.

    Examples
    --------
    >>> Limits(ceiling_vpp=200.0).gain
    1.0
    >>> Limits(ceiling_vpp=0.0)
    Traceback (most recent call last):
    ValueError: ceiling_vpp must be a number above 0 and up to inf, got 0.0
    """

    ceiling_vpp: float
    gain: float = 1.0
    least_interval_s: float = 0.05
    max_duty: float = 0.5
    longest_waveform: int = 65536
    dc_tolerance: float = 0.01
    longest_time_to_live_s: float = 10.0

    def __post_init__(self) -> None:
        require_positive("ceiling_vpp", self.ceiling_vpp)
        require_positive("gain", self.gain, most=_LARGEST_GAIN)
        require_real("least_interval_s", self.least_interval_s, least=0.0)
        require_positive("max_duty", self.max_duty, most=1.0)
        require_whole("longest_waveform", self.longest_waveform, least=1, most=2**31)
        require_positive("dc_tolerance", self.dc_tolerance, most=1.0)
        require_positive("longest_time_to_live_s", self.longest_time_to_live_s)


def check_waveforms(left: FloatArray, right: FloatArray, limits: Limits) -> tuple[float, float]:
    """Check the waveforms of one slot and return the peak magnitude of each.

    Left and right, shape (n,) each: of one length, not too long, finite, in [-1, 1], 0 at both ends
    and without a DC part, which is |sum| above `dc_tolerance` x sum|.|. Otherwise `Rejected` or
    `LimitExceeded`.

    >>> sine = np.sin(2 * np.pi * np.arange(97) / 96)
    >>> sine[-1] = 0.0
    >>> limits = Limits(ceiling_vpp=200.0)
    >>> check_waveforms(sine, 0 * sine, limits)
    (1.0, 0.0)
    >>> check_waveforms(sine, abs(sine), limits)
    Traceback (most recent call last):
    device.driver.LimitExceeded: the waveform has a DC part (a unipolar click has one): right
    """
    _check_lengths(left.size, right.size, limits)
    return _check_waveform("left", left, limits), _check_waveform("right", right, limits)


def _check_lengths(n_left: int, n_right: int, limits: Limits) -> None:
    if n_left != n_right:
        raise rejection(Refusal.LENGTHS_DIFFER, f"{n_left} and {n_right} samples")
    if n_left == 0:
        raise rejection(Refusal.WAVEFORM_EMPTY)
    if n_left > limits.longest_waveform:
        detail = f"{n_left} samples, at most {limits.longest_waveform}"
        raise rejection(Refusal.WAVEFORM_TOO_LONG, detail)


def _check_waveform(channel: str, samples: FloatArray, limits: Limits) -> float:
    magnitudes = np.abs(samples)
    peak = float(magnitudes.max())
    if not math.isfinite(peak):
        raise rejection(Refusal.NOT_FINITE, channel)
    if peak > 1.0:
        raise rejection(Refusal.OUT_OF_RANGE, f"{channel} reaches {peak:g}")
    if samples[0] != 0.0 or samples[-1] != 0.0:
        raise rejection(Refusal.EDGES_NOT_ZERO, channel)
    if abs(samples.sum()) > limits.dc_tolerance * magnitudes.sum():
        raise rejection(Refusal.DC, channel)
    return peak


def check_ceiling(peak: float, level_vpp: float, limits: Limits) -> None:
    """Refuse a burst whose peak x level x gain is above the ceiling; exactly at it is allowed.

    The product is formed in whole numbers from the exact values of the four floats, so that no
    rounding lets a larger one pass.

    >>> limits = Limits(ceiling_vpp=200.0)
    >>> check_ceiling(1.0, 200.0, limits)
    >>> check_ceiling(0.5, 400.0, limits)
    >>> check_ceiling(1.0, 200.00000000000003, limits)
    Traceback (most recent call last):
    device.driver.LimitExceeded: peak x level x gain is above the ceiling: 1 x 200 x 1 > 200 Vpp
    """
    numerator, denominator = 1, 1
    for factor in (peak, level_vpp, limits.gain):
        above, below = float(factor).as_integer_ratio()
        numerator, denominator = numerator * above, denominator * below
    ceiling, unit = float(limits.ceiling_vpp).as_integer_ratio()
    if numerator * unit > ceiling * denominator:
        detail = f"{peak:g} x {level_vpp:g} x {limits.gain:g} > {limits.ceiling_vpp:g} Vpp"
        raise rejection(Refusal.CEILING, detail)


def check_burst(
    peaks: tuple[float, float], levels_vpp: tuple[float, float], limits: Limits
) -> None:
    """Check left and right of a burst against the ceiling.

    >>> check_burst((1.0, 0.0), (200.0, 1e6), Limits(ceiling_vpp=200.0))   # right is silent
    """
    for peak, level_vpp in zip(peaks, levels_vpp, strict=True):
        check_ceiling(peak, level_vpp, limits)


def least_peaks(loaded: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """Return the smallest peak of each channel among the loaded slots, silent ones left out.

    A level that is too high even for these cannot be used by any slot, and is refused when it is
    set; which slot will be played is known only when it is armed, and then checked exactly.

    >>> least_peaks([(1.0, 0.0), (0.5, 0.0)])
    (0.5, 0.0)
    """
    left, right = math.inf, math.inf
    for peak_left, peak_right in loaded:
        left = min(left, peak_left or math.inf)
        right = min(right, peak_right or math.inf)
    return (0.0 if left == math.inf else left, 0.0 if right == math.inf else right)


def check_rest(*, since_onset_us: int, duration_us: int, limits: Limits) -> None:
    """Refuse an onset that comes too early after the burst before.

    Each burst pays for its own rest, so that the duty stays within its limit over any long time.

    >>> limits = Limits(ceiling_vpp=200.0, least_interval_s=0.05)
    >>> check_rest(since_onset_us=52_000, duration_us=2_000, limits=limits)
    >>> check_rest(since_onset_us=51_999, duration_us=2_000, limits=limits)
    Traceback (most recent call last):
    device.driver.LimitExceeded: the last burst ended too short a time ago: 49.999 of 50 ms
    """
    rest_us = since_onset_us - duration_us
    least_us = round(limits.least_interval_s * 1e6)
    if rest_us < least_us:
        detail = f"{rest_us / 1e3:g} of {least_us / 1e3:g} ms"
        raise rejection(Refusal.LEAST_INTERVAL, detail)
    if duration_us > limits.max_duty * since_onset_us:
        detail = f"{duration_us / 1e3:g} ms in {since_onset_us / 1e3:g} ms"
        raise rejection(Refusal.DUTY, f"{detail}, at most {limits.max_duty:g}")


def check_time_to_live(time_to_live_us: int, limits: Limits) -> None:
    """Refuse a time to live of less than a microsecond or above the limits' longest."""
    longest_us = round(limits.longest_time_to_live_s * 1e6)
    if not 1 <= time_to_live_us <= longest_us:
        detail = f"1 to {longest_us} us, got {time_to_live_us}"
        raise rejection(Refusal.BAD_TIME_TO_LIVE, detail)
