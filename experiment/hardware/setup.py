"""The hardware of a session: device, clock and monitor of a study, and whether they may be used.

Software is not the safety device: what keeps a person safe is wired, and only a person can confirm
that it is.
"""

from __future__ import annotations

import getpass
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final

import numpy as np

from device.clock import MonotonicClock, VirtualClock
from device.core.host import HostDriver
from device.drivers import (
    MOCK,
    MOCK_MODEL,
    NEEDS,
    DriverSettings,
    is_emulated,
    make_device,
    make_mock,
    own_driver,
    require_port_of,
)
from device.errors import PortError, Rejected
from device.limits import Limits, check_waveforms
from device.wire.channels import LineSettings
from experiment.hardware.monitor import make_monitor
from experiment.names import is_line
from experiment.study.base import Fault
from experiment.study.stimulus import drive_samples
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.clock import Clock
    from device.core.reports import DeviceLimits, Health
    from device.driver import BurstDevice, Identity
    from device.emulate.mock import MockDevice
    from device.monitor.measured import Monitor
    from experiment.rows import DeviceKind
    from experiment.study.equipment import DeviceSettings
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study

LONGEST_ARMED_S: Final = 1.0
"""A token is armed for at most this time, in a session as in a check."""
SLOTS: Final = {p.name: slot for slot, p in enumerate(LEFT_RIGHT_BOTH.presentations)}
"""The slot of each presentation. A silent channel plays zeros: no side shows in the commands."""
_MARGIN_S: Final = 1e-3
"""Covers what host and device round, and how far their clocks drift apart in one rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """A device that is not yet opened, with its clock and its monitor.

    Attributes
    ----------
    device : BurstDevice
        The device.
    clock : Clock
        The machine's, or a virtual one for a session in which nothing and nobody is real.
    settings : DeviceSettings
        The study's device settings, with the driver and the port that were chosen.
    monitor : Monitor or None
        What measures the bursts, not yet opened; none for a device that moves nothing.
    """

    device: BurstDevice
    clock: Clock
    settings: DeviceSettings
    monitor: Monitor | None

    @property
    def driver_from(self) -> str | None:
        """The distribution of an installed driver."""
        name = self.settings.driver
        return None if name in NEEDS else own_driver(name).distribution

    def is_emulated(self) -> bool:
        """Ask the device whether it is an emulator; nothing is set, loaded or switched on.

        LinkError if nothing answers that this driver can drive.
        """
        return is_emulated(self.settings.driver, self.settings.port, line_settings(self.settings))


def assemble(
    study: Study,
    *,
    driver: str | None,
    port: str | None,
    simulated: bool,
    practice: bool = False,
) -> Hardware:
    """Return the device, clock and monitor of a session; nothing is opened.

    Parameters
    ----------
    study : Study
        The study.
    driver, port : str or None
        Used instead of the study's.
    simulated : bool
        Whether the participant is.
    practice : bool
        Whether a person practices without a device, and so without noise.

    Raises
    ------
    StudyError
        If a key of [device] that the driver needs is missing, or keys contradict each other.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> assemble(paper_study(), driver="serial", port=None, simulated=True)
    Traceback (most recent call last):
    experiment.study.base.StudyError: study paper: device.port: is required by the driver serial
    (or give --port)
    """
    settings = chosen_settings(study, driver=driver, port=port)
    faults = device_faults(settings)
    if not simulated and not practice:
        faults += noise_faults(study, settings)
    if faults:
        raise study.refused(*faults)
    is_mock = settings.driver == MOCK
    clock = VirtualClock() if is_mock and simulated else MonotonicClock()
    recorder = None  # of the inputs of the sound card that drives
    if study.monitor.source == "duplex" and not is_mock:
        from device.sound.recorder import Recorder

        recorder = Recorder(clock, settings.sample_rate_hz, channels=study.monitor.inputs)
    shared = {"port", "sample_rate_hz", "amplifier_gain", "volts_full_scale", "channels"}
    driver_settings = DriverSettings(
        **settings.model_dump(include=shared),
        limits=host_limits(settings),
        line=line_settings(settings),
        recorder=recorder,
    )
    try:
        device = make_device(settings.driver, driver_settings, clock)
    except ValueError as error:
        raise study.refused(Fault("device", str(error))) from error
    monitor = None if is_mock else make_monitor(study.monitor, device, clock, recorder)
    return Hardware(device=device, clock=clock, settings=settings, monitor=monitor)


def line_settings(settings: DeviceSettings) -> LineSettings:
    """Return the study's settings of the line to its device."""
    return LineSettings(**settings.model_dump(include={each.name for each in fields(LineSettings)}))


def chosen_settings(study: Study, *, driver: str | None, port: str | None) -> DeviceSettings:
    """Return a study's device settings with another driver or port, if one is given.

    StudyError if there is no such driver, a port has a form that is not opened, a level of the
    study is above what the device reaches, or the monitor does not suit the driver.
    """
    settings = study.device
    name = settings.driver if driver is None else driver
    if port is not None and not is_line(port):
        raise study.refused(Fault("--port", "must be one line of text", port))
    chosen = settings.changed(driver=name, port=settings.port if port is None else port)
    try:
        if name not in NEEDS:
            own_driver(name)
        if chosen.port is not None:
            require_port_of(name, chosen.port)
    except PortError as error:
        key = "device.port" if port is None else "--port"
        raise study.refused(Fault(key, error.rule, chosen.port)) from error
    except ValueError as error:
        key = "device.driver" if driver is None else "--driver"
        raise study.refused(Fault(key, str(error))) from error
    study.check_device(chosen)
    return chosen


def device_faults(settings: DeviceSettings) -> tuple[Fault, ...]:
    """Return a fault for each key of [device] that the driver needs and the study does not set.

    >>> from experiment.study.files import paper_study
    >>> audio = paper_study().device.changed(driver="audio")
    >>> [fault.key for fault in device_faults(audio)]
    ['device.port', 'device.volts_full_scale']
    """
    missing = (key for key in NEEDS.get(settings.driver, ()) if getattr(settings, key) is None)
    option = {"port": " (or give --port)"}
    rule = f"is required by the driver {settings.driver}"
    return tuple(Fault(f"device.{key}", rule + option.get(key, "")) for key in missing)


def noise_faults(study: Study, settings: DeviceSettings) -> tuple[Fault, ...]:
    """Return a fault if the masking noise would be played to the actuators.

    `settings` are those of the device in use. The card that the study names drives the actuators
    also if the mock replaces it.
    """
    masking = study.masking
    cards = {device.port for device in (settings, study.device) if device.driver == "audio"}
    if not cards or masking.noise == "none" or masking.sound_card not in {"", *cards}:
        return ()
    rule = 'must name another sound card than that of the actuators (noise = "none" plays none)'
    return (Fault("masking.sound_card", rule, masking.sound_card),)


def mock_device(study: Study, clock: Clock) -> MockDevice:
    """Return a mock device with the study's ceiling, rest between bursts and sample rate."""
    return make_mock(host_limits(study.device), clock, study.device.sample_rate_hz)


def device_kind(identity: Identity) -> DeviceKind:
    """Return ``real``, ``mock`` or ``emulated``, as the opened device identifies itself.

    >>> from device.clock import VirtualClock
    >>> from experiment.study.files import paper_study
    >>> device_kind(mock_device(paper_study(), VirtualClock()).open())
    'mock'
    """
    if not identity.emulated:
        return "real"
    return "mock" if identity.model == MOCK_MODEL else "emulated"


class NoDeviceError(ValueError):
    """A person in front of a device that moves nothing."""


def require_device(kind: str, *, simulated: bool, practice: bool) -> None:
    """Raise NoDeviceError for a person on a device that moves nothing, except for practice.

    Examples
    --------
    >>> require_device("mock", simulated=False, practice=False)
    Traceback (most recent call last):
    experiment.hardware.setup.NoDeviceError: the device is a mock, which moves nothing: ...
    """
    if kind == "real" or simulated or practice:
        return
    article = {"mock": "a mock", "emulated": "an emulator"}[kind]
    raise NoDeviceError(
        f"the device is {article}, which moves nothing: give --driver and --port of a real device, "
        "or --practice-without-device to try the session out (no analysis counts it by default)"
    )


SAFETY_CONDITIONS: Final = (
    "the amplifier's enable has a switch within the participant's and the operator's reach",
    "a current limit stands between the amplifier and the actuators",
    "the plate is bonded to protective earth, or insulated with its leakage measured",
)
"""What the operator confirms; docs/hardware.md says more."""


class NotConfirmedError(ValueError):
    """A real device that nobody has confirmed to be safe."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """The operator's confirmation of the `SAFETY_CONDITIONS`.

    Attributes
    ----------
    by : str
        The user of the machine who gave it.
    at : str
        When, in UTC.
    how : str
        ``asked`` on a terminal, or ``--confirm-hardware``.
    confirmed : tuple of str
        What was confirmed.
    """

    by: str
    at: str
    how: str
    confirmed: tuple[str, ...] = SAFETY_CONDITIONS


def confirmed_now(how: str) -> Confirmation:
    """Return the confirmation that is given at this moment.

    Examples
    --------
    >>> confirmed_now("asked").how
    'asked'
    """
    try:
        user = getpass.getuser()
    except (OSError, KeyError, ImportError):  # a user without a name
        user = "unknown"
    return Confirmation(by=user, at=datetime.now(UTC).isoformat(timespec="seconds"), how=how)


def require_confirmed(identity: Identity, confirmation: Confirmation | None) -> None:
    """Raise NotConfirmedError for an opened real device without a confirmation."""
    if confirmation is None and not identity.emulated:
        raise NotConfirmedError(
            f"{identity.model} {identity.serial_number} drives real actuators: read "
            "docs/hardware.md, then give --confirm-hardware"
        )


# A condition's burst in the device


def load_condition(device: BurstDevice, condition: Condition, settings: DeviceSettings) -> None:
    """Load a condition's burst into the opened device, one slot for each side.

    Rejected if the device refuses the waveform.
    """
    burst = drive_samples(condition, settings)
    silence = np.zeros_like(burst)
    for slot, presentation in enumerate(LEFT_RIGHT_BOTH.presentations):
        left, right = (
            burst if site in presentation.sites else silence for site in LEFT_RIGHT_BOTH.sites
        )
        device.load(slot, left, right)


def host_limits(settings: DeviceSettings) -> Limits:
    """Return the limits that the host keeps, by the study's device settings."""
    return Limits(ceiling_vpp=settings.ceiling_vpp, min_interval_s=settings.min_interval_s)


def onset_interval_s(condition: Condition, settings: DeviceSettings) -> float:
    """Return the shortest time from one onset to the next that keeps rest and duty limits."""
    limits = host_limits(settings)
    duration_s = _sampled_s(condition, settings)
    return max(duration_s + limits.min_interval_s, duration_s / limits.max_duty) + _MARGIN_S


def playing_s(condition: Condition, settings: DeviceSettings) -> float:
    """Return for how long after an onset a device may still be playing."""
    return _sampled_s(condition, settings) + _MARGIN_S


def _sampled_s(condition: Condition, settings: DeviceSettings) -> float:
    return condition.drive.duration_s + 2 / settings.sample_rate_hz


def read_limits(device: BurstDevice) -> DeviceLimits | None:
    """Return the limits of an opened device; None if it reports none."""
    return device.limits() if isinstance(device, HostDriver) else None


def read_health(device: BurstDevice) -> Health | None:
    """Return the state of an opened device's amplifier; None if it reports none."""
    health = device.health() if isinstance(device, HostDriver) else None
    return health if health is not None and health.reported_bits else None


# Whether the device can run the study


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
    rule = f"the device must have {len(SLOTS)} slots, one for each side; it has {limits.slots}"
    yield limits.slots < len(SLOTS), rule
    for condition in study.conditions:
        duration_s = _sampled_s(condition, settings)
        min_rest_s = max(limits.min_interval_s, duration_s / limits.max_duty - duration_s)
        rule = (
            f"device.min_interval_s: must be at least {min_rest_s:.6g} for the burst of condition "
            f"{condition.name}: the device rests {limits.min_interval_s:g} s or more, and plays "
            f"at most {100 * limits.max_duty:g} % of the time (got {settings.min_interval_s:g})"
        )
        yield onset_interval_s(condition, settings) < duration_s + min_rest_s, rule
        n_samples = len(SLOTS) * drive_samples(condition, settings).size
        rule = (
            f"condition {condition.name}: the burst must be shorter; for {len(SLOTS)} sides it "
            f"has {n_samples} samples, and the device keeps {limits.memory_samples}"
        )
        yield n_samples > limits.memory_samples, rule


def require_playable(study: Study, limits: Limits | None = None) -> None:
    """Raise SuitabilityError for a burst that no device, or not one of these limits, can play."""
    settings = study.device
    limits = host_limits(settings) if limits is None else limits
    for condition in study.conditions:
        burst = drive_samples(condition, settings)
        try:
            check_waveforms(burst, burst, limits)
        except Rejected as error:
            raise SuitabilityError(
                f"condition {condition.name}: the burst cannot be played at "
                f"device.sample_rate_hz = {settings.sample_rate_hz:g}: {error}"
            ) from error
