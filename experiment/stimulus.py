"""A condition's burst as the device holds it: one slot for every side, silence included."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from device.limits import Limits

if TYPE_CHECKING:
    from device.driver import BurstDevice
    from experiment.study import Condition, DeviceSettings

SLOTS = {"left": 0, "right": 1, "both": 2, "none": 3}
"""The slot of each side. A silent channel plays zeros: no side shows in the commands."""


def load_condition(device: BurstDevice, condition: Condition, settings: DeviceSettings) -> None:
    """Load a condition's burst into the device's slots.

    The samples are scaled to a peak of exactly 1, so that a level is the peak-to-peak voltage that
    is really emitted, whatever the window and the sample rate.

    Parameters
    ----------
    device : BurstDevice
        The opened device.
    condition : Condition
        The condition, with its burst.
    settings : DeviceSettings
        The study's device settings, with the sample rate.

    Raises
    ------
    Rejected
        If the device refuses the waveform.
    """
    samples = condition.burst.samples(settings.sample_rate_hz)
    burst = samples / np.max(np.abs(samples))
    silence = np.zeros_like(burst)
    for side, slot in SLOTS.items():
        left = burst if side in {"left", "both"} else silence
        right = burst if side in {"right", "both"} else silence
        device.load(slot, left, right)


def host_limits(settings: DeviceSettings) -> Limits:
    """Return what the host refuses to send, by the study's device settings."""
    return Limits(ceiling_vpp=settings.ceiling_vpp, least_interval_s=settings.least_interval_s)


def onset_interval_s(condition: Condition, settings: DeviceSettings) -> float:
    """Return the least time from one onset to the next that no limit on rest or duty refuses.

    Parameters
    ----------
    condition : Condition
        The condition, with its burst.
    settings : DeviceSettings
        The study's device settings.
    """
    limits = host_limits(settings)
    duration_s = condition.burst.duration_s + 2 / settings.sample_rate_hz
    rest_s = max(duration_s + limits.least_interval_s, duration_s / limits.max_duty)
    return rest_s + _MARGIN_S


_MARGIN_S = 1e-3
"""Covers what host and device round, and how far their clocks drift apart in one rest."""
