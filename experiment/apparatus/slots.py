"""A condition's burst as the device holds it: one slot for every side, silence included."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from device.driver import Rejected
from device.limits import Limits, check_waveforms
from experiment.study.sections.stimulus import drive_samples

if TYPE_CHECKING:
    from device.driver import BurstDevice, Identity
    from experiment.study.sections.equipment import DeviceSettings
    from experiment.study.sections.stimulus import Condition
    from experiment.study.study import Study


class SuitabilityError(ValueError):
    """A device that cannot do what a study asks."""


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


def require_suitable(study: Study, identity: Identity) -> None:
    """Refuse a device that cannot do what a study asks, before anything is felt.

    Parameters
    ----------
    study : Study
        The study.
    identity : Identity
        What the device said of itself.

    Raises
    ------
    SuitabilityError
        If sample rate, ceiling or a condition's waveform do not go together.
    """
    settings = study.device
    if identity.sample_rate_hz != settings.sample_rate_hz:
        raise SuitabilityError(
            f"device.sample_rate_hz must be that of the device, {identity.sample_rate_hz:g}; "
            f"got {settings.sample_rate_hz:g}"
        )
    highest_vpp = study.design.highest_vpp
    if highest_vpp > identity.ceiling_vpp:
        raise SuitabilityError(
            "design.levels_vpp must be at most the device's own ceiling, "
            f"{identity.ceiling_vpp:g} Vpp; got {highest_vpp:g}"
        )
    require_playable(study, longest_waveform=identity.longest_waveform)


def require_playable(study: Study, *, longest_waveform: int | None = None) -> None:
    """Refuse a study whose bursts no device could play at its sample rate.

    Parameters
    ----------
    study : Study
        The study.
    longest_waveform : int, optional
        Of the device, where one is known.

    Raises
    ------
    SuitabilityError
        If a condition's waveform is too long, or breaks a rule that every device keeps.
    """
    settings = study.device
    limits = host_limits(settings)
    if longest_waveform is not None:
        limits = replace(limits, longest_waveform=longest_waveform)
    for condition in study.conditions:
        burst = drive_samples(condition, settings)
        try:
            check_waveforms(burst, burst, limits)
        except Rejected as refusal:
            raise SuitabilityError(
                f"condition {condition.name}: the burst cannot be played at "
                f"device.sample_rate_hz = {settings.sample_rate_hz:g}: {refusal}"
            ) from refusal
