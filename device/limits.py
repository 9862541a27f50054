"""What may be played: ceilings, waveform rules, rests; refused, never clipped.

The host checks with the limits of the study, the device with its own; both call these functions.
They compare whole numbers (converter codes, millivolts, microseconds), so that firmware, which has
no floats, comes to the same verdict to the last bit. All ceilings hold for
peak(waveform) x level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from device.checks import require_positive, require_real, require_whole
from device.errors import Refusal, rejection

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

MAX_CHANNELS: Final = 64
"""Most output channels of a device; messages count them from 1."""
_MIN_RATIO = 1e-6
_GRID_TOLERANCE = 1e-6

CodeArray: TypeAlias = NDArray[np.signedinteger[Any]]
"""Codes of a converter, one for each sample; of a waveform a row for each channel."""
_CODE_RULES: Final = (Refusal.OUT_OF_RANGE, Refusal.EDGES_NOT_ZERO, Refusal.DC)
"""What the codes of each channel must obey, in the order in which a device checks them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a study or of a device.

    Parameters
    ----------
    ceiling_vpp : float
        Largest peak(waveform) x level, in peak-to-peak volts at the actuator.
    min_interval_s : float
        Rest from the end of one burst to the onset of the next.
    max_duty : float
        Largest ratio of a burst's duration to the time from its onset to the next onset.
    longest_waveform : int
        In samples.
    slots : int
        Number of waveforms that are kept at once, 255 at most, as they are counted in a byte.
    memory_samples : int
        Samples of one channel that all slots together hold.
    dc_tolerance : float
        Largest ``|sum| / sum|.|`` of a waveform. A sine of whole cycles with 40 or more samples
        each stays below 0.001 at any sample rate; a unipolar click has 1.
    longest_time_to_live_s : float
        Largest time to live of an armed token.

    Raises
    ------
    ValueError
        A limit is not a positive finite number, or a ratio is above 1.

    Examples
    --------
    >>> Limits(ceiling_vpp=200.0).slots
    64
    >>> Limits(ceiling_vpp=0.0)
    Traceback (most recent call last):
    ValueError: ceiling_vpp must be a number above 0 and up to inf, got 0.0
    """

    ceiling_vpp: float
    min_interval_s: float = 0.05
    max_duty: float = 0.5
    longest_waveform: int = 65536
    slots: int = 64
    memory_samples: int = 8 * 65536
    dc_tolerance: float = 0.01
    longest_time_to_live_s: float = 10.0

    def __post_init__(self) -> None:
        require_positive("ceiling_vpp", self.ceiling_vpp)
        require_real("min_interval_s", self.min_interval_s, minimum=0.0)
        require_real("max_duty", self.max_duty, minimum=_MIN_RATIO, maximum=1.0)
        require_whole("longest_waveform", self.longest_waveform, minimum=1, maximum=2**31)
        require_whole("slots", self.slots, minimum=1, maximum=255)
        require_whole("memory_samples", self.memory_samples, minimum=1, maximum=2**32 - 1)
        require_positive("dc_tolerance", self.dc_tolerance, maximum=1.0)
        require_positive("longest_time_to_live_s", self.longest_time_to_live_s)

    @property
    def ceiling_mvpp(self) -> int:
        """The ceiling in whole millivolts."""
        return _whole(self.ceiling_vpp * 1e3)

    @property
    def least_interval_us(self) -> int:
        """The least interval in microseconds."""
        return round(self.min_interval_s * 1e6)

    @property
    def max_duty_ppm(self) -> int:
        """The largest duty in parts per million."""
        return _whole(self.max_duty * 1e6)

    @property
    def dc_tolerance_ppm(self) -> int:
        """The tolerance of DC in parts per million."""
        return _whole(self.dc_tolerance * 1e6)

    @property
    def longest_time_to_live_us(self) -> int:
        """The longest time to live in microseconds."""
        return round(self.longest_time_to_live_s * 1e6)


def _whole(limit: float) -> int:
    """Return a limit as a whole number that is not above it, but for how floats are written."""
    return math.floor(limit + _GRID_TOLERANCE)


def check_channels(n_values: int, channels: int) -> None:
    """Refuse another number of rows or levels than a device has channels."""
    if n_values != channels:
        raise rejection(Refusal.WRONG_CHANNELS, f"{channels} channels, got {n_values}")


def check_codes(codes: CodeArray, *, full_scale: int, limits: Limits) -> tuple[int, ...]:
    """Check the codes of a slot, shape (n_channels, n_samples), and return each channel's peak.

    The codes must not be too long, be within full scale, 0 at both ends and without a DC part,
    which is ``|sum|`` above `dc_tolerance` times ``sum|.|``. Otherwise `Rejected` or
    `LimitExceeded`, which names the first channel that is at fault.

    >>> sine = np.array([0, 32767, 0, -32767, 0])
    >>> limits = Limits(ceiling_vpp=200.0)
    >>> check_codes(np.stack([sine, 0 * sine]), full_scale=32767, limits=limits)
    (32767, 0)
    >>> check_codes(np.stack([sine, abs(sine)]), full_scale=32767, limits=limits)
    Traceback (most recent call last):
    device.errors.LimitExceeded: the waveform has a DC part (a unipolar click has one): channel 2
    """
    n_samples = codes.shape[1]
    if n_samples == 0:
        raise rejection(Refusal.WAVEFORM_EMPTY)
    if n_samples > limits.longest_waveform:
        detail = f"{n_samples} samples, at most {limits.longest_waveform}"
        raise rejection(Refusal.WAVEFORM_TOO_LONG, detail)
    codes = codes.astype(np.int64)
    magnitudes = np.abs(codes)
    peaks = magnitudes.max(axis=1)
    dc = np.abs(codes.sum(axis=1)) * 1_000_000 > limits.dc_tolerance_ppm * magnitudes.sum(axis=1)
    edges = (codes[:, 0] != 0) | (codes[:, -1] != 0)
    violations = np.argwhere(np.stack([peaks > full_scale, edges, dc], axis=1))
    if violations.size:
        channel, rule = violations[0]
        raise rejection(_CODE_RULES[rule], f"channel {channel + 1}")
    return tuple(peaks.tolist())


def check_ceiling(
    peaks: Sequence[int], levels_mvpp: Sequence[int], *, full_scale: int, limits: Limits
) -> None:
    """Refuse a burst of which a channel's peak x level is above the ceiling.

    Exactly at the ceiling is allowed. `peaks` are codes. The product is formed in whole numbers, so
    that no rounding lets a larger one pass.

    >>> limits = Limits(ceiling_vpp=64.1)
    >>> check_ceiling((32767, 0), (64_100, 10**6), full_scale=32767, limits=limits)
    >>> check_ceiling((32767, 0), (64_101, 0), full_scale=32767, limits=limits)
    Traceback (most recent call last):
    device.errors.LimitExceeded: peak x level is above the ceiling: 1 x 64.101 > 64.1 Vpp
    """
    for peak, level_mvpp in zip(peaks, levels_mvpp, strict=True):
        if peak * level_mvpp > limits.ceiling_mvpp * full_scale:
            product = f"{peak / full_scale:g} x {level_mvpp / 1000:g}"
            raise rejection(Refusal.CEILING, f"{product} > {limits.ceiling_mvpp / 1000:g} Vpp")


def lowest_peaks(loaded: Iterable[Sequence[int]], channels: int) -> list[int]:
    """Return the smallest peak of each channel among the loaded slots, silent ones left out.

    A level that is too high even for these cannot be used by any slot, and is refused when it is
    set. Which slot will be played is known only when it is armed, and then checked exactly.

    >>> lowest_peaks([(100, 0), (50, 0)], channels=2)
    [50, 0]
    """
    of_channels = zip(*loaded, [0] * channels, strict=True)
    return [min(filter(None, peaks), default=0) for peaks in of_channels]


def check_rest(*, since_onset_us: int, duration_us: int, limits: Limits) -> None:
    """Refuse an onset that comes too early after the burst before.

    Each burst pays for its own rest, so that the duty stays within its limit over any long time.

    >>> limits = Limits(ceiling_vpp=200.0, min_interval_s=0.05)
    >>> check_rest(since_onset_us=52_000, duration_us=2_000, limits=limits)
    >>> check_rest(since_onset_us=51_999, duration_us=2_000, limits=limits)
    Traceback (most recent call last):
    device.errors.LimitExceeded: the last burst ended too short a time ago: 49.999 of 50 ms
    """
    rest_us = since_onset_us - duration_us
    min_us = limits.least_interval_us
    if rest_us < min_us:
        detail = f"{rest_us / 1e3:g} of {min_us / 1e3:g} ms"
        raise rejection(Refusal.LEAST_INTERVAL, detail)
    if duration_us * 1_000_000 > limits.max_duty_ppm * since_onset_us:
        detail = f"{duration_us / 1e3:g} ms in {since_onset_us / 1e3:g} ms"
        raise rejection(Refusal.DUTY, f"{detail}, at most {limits.max_duty:g}")


def check_slot(slot: int, limits: Limits) -> None:
    """Refuse a slot that there is not."""
    if slot >= limits.slots:
        raise rejection(Refusal.BAD_SLOT, f"0 to {limits.slots - 1}, got {slot}")


def check_memory(held: int, n_samples: int, limits: Limits) -> None:
    """Refuse a waveform for which those in all other slots, `held` samples, leave no room.

    >>> check_memory(100, 28, Limits(ceiling_vpp=200.0, memory_samples=128))
    >>> check_memory(100, 29, Limits(ceiling_vpp=200.0, memory_samples=128))
    Traceback (most recent call last):
    device.errors.LimitExceeded: the waveforms in all slots together are too long: 129 of 128 ...
    """
    total = held + n_samples
    if total > limits.memory_samples:
        detail = f"{total} of {limits.memory_samples} samples"
        raise rejection(Refusal.MEMORY_FULL, detail)


def check_time_to_live(time_to_live_us: int, limits: Limits) -> None:
    """Refuse a time to live of less than a microsecond or above the limits' longest."""
    longest_us = limits.longest_time_to_live_us
    if not 1 <= time_to_live_us <= longest_us:
        detail = f"1 to {longest_us} us, got {time_to_live_us}"
        raise rejection(Refusal.BAD_TIME_TO_LIVE, detail)
