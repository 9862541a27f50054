"""The hardware of a session: device, clock and monitor of a study, set up but not opened."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from device.clock import MonotonicClock, VirtualClock
from device.core.host import HostDriver
from device.core.output import OutputStage
from device.drivers import (
    MOCK,
    NEEDS,
    DriverSettings,
    installed_driver,
    is_emulated,
    make_device,
    make_mock,
    require_port_of,
)
from device.errors import PortError
from device.limits import Limits
from device.wire.channels import LineSettings
from experiment.hardware.monitor import make_monitor
from experiment.hardware.safety import Purpose
from experiment.names import is_line
from experiment.study.base import Fault
from experiment.study.stimulus import channel_samples

if TYPE_CHECKING:
    from device.clock import Clock
    from device.core.reports import DeviceLimits, Health
    from device.driver import BurstDevice
    from device.emulate.mock import MockDevice
    from device.monitor.measured import Monitor
    from experiment.study.equipment import DeviceSettings
    from experiment.study.stimulus import Condition
    from experiment.study.study import Study


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardware:
    """A device that is not yet opened, with its clock and its monitor.

    Attributes
    ----------
    device : BurstDevice
        The device.
    clock : Clock
        The machine's clock, or a virtual one if device and participant are simulated.
    settings : DeviceSettings
        The study's device settings, with the driver and the port that were chosen.
    monitor : Monitor or None
        The monitor that measures the bursts, not yet opened; None for a device that moves nothing.
    """

    device: BurstDevice
    clock: Clock
    settings: DeviceSettings
    monitor: Monitor | None

    @property
    def driver_from(self) -> str | None:
        """The distribution of an installed driver."""
        name = self.settings.driver
        return None if name in NEEDS else installed_driver(name).distribution

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
    purpose: Purpose = Purpose.DATA,
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
    purpose : Purpose
        What the session is held for. In practice no noise plays; in a rehearsal everything does.

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
    if purpose.plays_noise(simulated=simulated):
        faults += noise_faults(study, settings)
    if faults:
        raise study.refused(*faults)
    is_mock = settings.driver == MOCK
    is_virtual = is_mock and simulated and purpose is not Purpose.REHEARSAL
    clock = VirtualClock() if is_virtual else MonotonicClock()
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
            installed_driver(name)
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
    rate_hz = study.device.sample_rate_hz
    output = OutputStage(channels=len(study.task.sites), sample_rate_hz=rate_hz)
    return make_mock(host_limits(study.device), clock, output)


def load_condition(device: BurstDevice, condition: Condition, study: Study) -> None:
    """Load a condition's burst into the opened device, in a slot for each of the task's bursts.

    The channels are the sites in their order. A silent channel plays zeros, so that no site shows
    in the commands. Rejected if the device refuses the waveform.
    """
    task = study.task
    for slot, sites in enumerate(task.slots):
        driven = [site in sites for site in task.sites]
        device.load(slot, channel_samples(condition, study.device, driven))


def host_limits(settings: DeviceSettings) -> Limits:
    """Return the limits that the host keeps, by the study's device settings."""
    return Limits(ceiling_vpp=settings.ceiling_vpp, min_interval_s=settings.min_interval_s)


def read_limits(device: BurstDevice) -> DeviceLimits | None:
    """Return the limits of an opened device; None if it reports none."""
    return device.limits() if isinstance(device, HostDriver) else None


def read_health(device: BurstDevice) -> Health | None:
    """Return the state of an opened device's amplifier; None if it reports none."""
    health = device.health() if isinstance(device, HostDriver) else None
    return health if health is not None and health.reported_bits else None
