"""Whether a device can run a study: its limits, the study's bursts, and the rests between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from device.core.messages import full_scale, to_codes
from device.errors import Rejected
from device.limits import check_codes
from experiment.hardware.setup import host_limits
from experiment.study.stimulus import channel_samples

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.core.reports import DeviceLimits
    from device.driver import Identity
    from device.limits import Limits
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study

LONGEST_ARMED_S: Final = 1.0
"""A token is armed for at most this time, in a session as in a check."""
_BITS: Final = 16
"""Resolution of the usual converters, in which a burst is checked before any device is opened."""
_MARGIN_S: Final = 1e-3
"""Covers what host and device round, and how far their clocks drift apart in one rest."""


def onset_interval_s(condition: Condition, study: Study) -> float:
    """Return the shortest time from one onset to the next that keeps rest and duty limits."""
    limits = host_limits(study.device)
    duration_s = _sampled_s(condition, study)
    return max(duration_s + limits.min_interval_s, duration_s / limits.max_duty) + _MARGIN_S


def playing_s(condition: Condition, study: Study) -> float:
    """Return for how long after an onset a device may still be playing."""
    return _sampled_s(condition, study) + _MARGIN_S


def _sampled_s(condition: Condition, study: Study) -> float:
    """Return how long the longest burst of a condition plays, its last samples included."""
    return condition.duration_s(study.task.n_sites_at_once) + 2 / study.device.sample_rate_hz


class SuitabilityError(ValueError):
    """A device that cannot do what a study asks."""


def require_suitable(
    study: Study, identity: Identity, device_limits: DeviceLimits | None = None
) -> None:
    """Raise SuitabilityError unless sample rate, ceiling, rests and waveforms suit the device.

    Parameters
    ----------
    study : Study
        The study.
    identity : Identity
        Of the opened device.
    device_limits : DeviceLimits, optional
        As `read_limits` returns them.
    """
    limits = replace(host_limits(study.device), longest_waveform=identity.longest_waveform)
    limits = limits if device_limits is None else device_limits.applied(limits)
    for is_violated, rule in _rules(study, identity, limits, is_reported=device_limits is not None):
        if is_violated:
            raise SuitabilityError(rule)
    require_playable(study, limits)


def _rules(
    study: Study, identity: Identity, limits: Limits, *, is_reported: bool
) -> Iterator[tuple[bool, str]]:
    """Yield whether each rule is violated, and the rule; some need limits that a device reports."""
    settings, rate_hz, high_vpp = study.device, identity.sample_rate_hz, study.highest_vpp
    rule = (
        f"device.sample_rate_hz: must be that of the device, {rate_hz:g} "
        f"(got {settings.sample_rate_hz:g})"
    )
    yield rate_hz != settings.sample_rate_hz, rule
    n_sites = len(study.task.sites)
    rule = f"the device must drive one channel for each of {n_sites} sites; it drives {{}}"
    yield identity.channels != n_sites, rule.format(identity.channels)
    rule = (
        f"design.levels_vpp: must be at most the ceiling of the device itself, "
        f"{identity.ceiling_vpp:g} Vpp (got {high_vpp:g})"
    )
    yield high_vpp > identity.ceiling_vpp, rule
    if not is_reported:
        return
    # The device would refuse shorter rests than its own in mid-session.
    rule = (
        f"the device must keep a token armed for {LONGEST_ARMED_S:g} s; its longest time to live "
        f"is {limits.longest_time_to_live_s:g} s"
    )
    yield limits.longest_time_to_live_s < LONGEST_ARMED_S, rule
    n_slots = len(study.task.slots)
    rule = f"the device must have {n_slots} slots, one for each burst; it has {limits.slots}"
    yield limits.slots < n_slots, rule
    for condition in study.conditions:
        duration_s = _sampled_s(condition, study)
        min_rest_s = max(limits.min_interval_s, duration_s / limits.max_duty - duration_s)
        rule = (
            f"device.min_interval_s: must be at least {min_rest_s:.6g} for the burst of condition "
            f"{condition.name}: the device rests {limits.min_interval_s:g} s or more, and plays "
            f"at most {100 * limits.max_duty:g} % of the time (got {settings.min_interval_s:g})"
        )
        yield onset_interval_s(condition, study) < duration_s + min_rest_s, rule
        n_samples = sum(
            channel_samples(condition, settings, [True] * max(len(sites), 1)).shape[1]
            for sites in study.task.slots
        )
        rule = (
            f"condition {condition.name}: the burst must be shorter; in {n_slots} slots it "
            f"has {n_samples} samples, and the device keeps {limits.memory_samples}"
        )
        yield n_samples > limits.memory_samples, rule


def require_playable(study: Study, limits: Limits | None = None) -> None:
    """Raise SuitabilityError for a burst that no device, or not one of these limits, can play."""
    settings = study.device
    limits = host_limits(settings) if limits is None else limits
    for condition in study.conditions:
        try:
            driven = [True] * study.task.n_sites_at_once
            codes = to_codes(channel_samples(condition, settings, driven), _BITS)
            check_codes(codes, full_scale=full_scale(_BITS), limits=limits)
        except Rejected as error:
            raise SuitabilityError(
                f"condition {condition.name}: the burst cannot be played at "
                f"device.sample_rate_hz = {settings.sample_rate_hz:g}: {error}"
            ) from error
