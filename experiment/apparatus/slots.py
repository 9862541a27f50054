"""A condition's burst as the device holds it: one slot for every side, silence included."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from device.core.host import HostDriver
from device.errors import Rejected
from device.limits import Limits, check_waveforms
from experiment.study.stimulus import drive_samples

if TYPE_CHECKING:
    from device.core.reports import DeviceLimits, Health
    from device.driver import BurstDevice, Identity
    from experiment.study.equipment import DeviceSettings
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


class SuitabilityError(ValueError):
    """A device that cannot do what a study asks."""


LONGEST_ARMED_S = 1.0
"""A token is armed for so long at most, in a session as in a check."""

SLOTS = {"left": 0, "right": 1, "both": 2, "none": 3}
"""The slot of each side. A silent channel plays zeros: no side shows in the commands."""


def load_condition(device: BurstDevice, condition: Condition, settings: DeviceSettings) -> None:
    """Load a condition's burst into the device's slots.

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
    burst = drive_samples(condition, settings)
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
    duration_s = _sampled_s(condition, settings)
    rest_s = max(duration_s + limits.least_interval_s, duration_s / limits.max_duty)
    return rest_s + _MARGIN_S


def playing_s(condition: Condition, settings: DeviceSettings) -> float:
    """Return for how long after an onset a device may still be playing."""
    return _sampled_s(condition, settings) + _MARGIN_S


def _sampled_s(condition: Condition, settings: DeviceSettings) -> float:
    return condition.drive.duration_s + 2 / settings.sample_rate_hz


_MARGIN_S = 1e-3
"""Covers what host and device round, and how far their clocks drift apart in one rest."""


def told_limits(device: BurstDevice) -> DeviceLimits | None:
    """Return what an opened device says it is ready to do; None of one that tells nothing."""
    return device.limits() if isinstance(device, HostDriver) else None


def told_health(device: BurstDevice) -> Health | None:
    """Return what an opened device knows of its amplifier; None of one that tells nothing."""
    health = device.health() if isinstance(device, HostDriver) else None
    return health if health is not None and health.known else None


def require_suitable(study: Study, identity: Identity, told: DeviceLimits | None = None) -> None:
    """Refuse a device that cannot do what a study asks, before anything is felt.

    Parameters
    ----------
    study : Study
        The study.
    identity : Identity
        What the device said of itself.
    told : DeviceLimits, optional
        What it said that it is ready to do.

    Raises
    ------
    SuitabilityError
        If sample rate, ceiling, rests or a condition's waveform do not go together.
    """
    settings = study.device
    if identity.sample_rate_hz != settings.sample_rate_hz:
        raise SuitabilityError(
            f"device.sample_rate_hz must be that of the device, {identity.sample_rate_hz:g}; "
            f"got {settings.sample_rate_hz:g}"
        )
    highest_vpp = study.highest_vpp
    if highest_vpp > identity.ceiling_vpp:
        raise SuitabilityError(
            "design.levels_vpp must be at most the device's own ceiling, "
            f"{identity.ceiling_vpp:g} Vpp; got {highest_vpp:g}"
        )
    limits = replace(host_limits(settings), longest_waveform=identity.longest_waveform)
    if told is not None:
        limits = told.applied(limits)
        _require_rests(study, limits)
        _require_room(study, limits)
    require_playable(study, limits)


def _require_rests(study: Study, limits: Limits) -> None:
    """Refuse rests that are shorter than the device's, which it would refuse in mid-session."""
    settings = study.device
    if limits.longest_time_to_live_s < LONGEST_ARMED_S:
        raise SuitabilityError(
            f"the device must keep a token armed for {LONGEST_ARMED_S:g} s; its longest time to "
            f"live is {limits.longest_time_to_live_s:g} s"
        )
    for condition in study.conditions:
        duration_s = _sampled_s(condition, settings)
        least_s = max(limits.least_interval_s, duration_s / limits.max_duty - duration_s)
        if onset_interval_s(condition, settings) < duration_s + least_s:
            raise SuitabilityError(
                f"device.least_interval_s must be at least {least_s:.6g} for the burst of "
                f"condition {condition.name}: the device rests {limits.least_interval_s:g} s or "
                f"more, and plays at most {100 * limits.max_duty:g} % of the time; got "
                f"{settings.least_interval_s:g}"
            )


def _require_room(study: Study, limits: Limits) -> None:
    """Refuse bursts that the device cannot keep for all sides at once."""
    if limits.slots < len(SLOTS):
        raise SuitabilityError(
            f"the device must have {len(SLOTS)} slots, one for each side; it has {limits.slots}"
        )
    for condition in study.conditions:
        n_samples = len(SLOTS) * drive_samples(condition, study.device).size
        if n_samples > limits.memory_samples:
            raise SuitabilityError(
                f"condition {condition.name}: the burst must be shorter; for {len(SLOTS)} sides it "
                f"has {n_samples} samples, and the device keeps {limits.memory_samples}"
            )


def require_playable(study: Study, limits: Limits | None = None) -> None:
    """Refuse a study whose bursts no device could play at its sample rate.

    Parameters
    ----------
    study : Study
        The study.
    limits : Limits, optional
        With those of the device, where one is known.

    Raises
    ------
    SuitabilityError
        If a condition's waveform is too long, or breaks a rule that every device keeps.
    """
    settings = study.device
    limits = host_limits(settings) if limits is None else limits
    for condition in study.conditions:
        burst = drive_samples(condition, settings)
        try:
            check_waveforms(burst, burst, limits)
        except Rejected as refusal:
            raise SuitabilityError(
                f"condition {condition.name}: the burst cannot be played at "
                f"device.sample_rate_hz = {settings.sample_rate_hz:g}: {refusal}"
            ) from refusal
