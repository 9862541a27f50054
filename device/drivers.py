"""The drivers by name: what each needs, how it is made, and whether an emulator answers it.

A lab can add drivers to the built-in ones, see `device.installed`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, TypeVar, cast

from device.clock import MonotonicClock
from device.core.host import HostDriver
from device.core.output import OutputStage
from device.driver import BurstDevice, Delivery, Identity
from device.emulate.mock import DEVICE_LIMITS, MODEL, MockDevice
from device.errors import DeviceError, LinkError, error_line
from device.installed import DRIVERS, Installed, lookup, require_instance
from device.scpi.dialects import DIALECTS
from device.wire.channels import USUAL, LineSettings, require_port

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from device.clock import Clock
    from device.limits import Limits
    from device.sound.recorder import Recorder

MOCK: Final = "mock"
MOCK_MODEL: Final = MODEL
NEEDS: Final[Mapping[str, tuple[str, ...]]] = {
    MOCK: (),
    "serial": ("port",),
    "generator": ("port", "amplifier_gain"),
    "audio": ("port", "volts_full_scale"),
}
"""Every built-in driver by name, with the settings that it cannot do without."""
GENERATOR_OUTPUTS: Final = tuple(range(1, 1 + max(dialect.channels for dialect in DIALECTS)))
"""The outputs of the largest generator that is known."""

_Value = TypeVar("_Value")


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSettings:
    """What a driver is made from.

    Attributes
    ----------
    limits : Limits
        Of the study: what the host refuses to send.
    port : str or None
        Of the serial line, a URL such as ``socket://host:5025``, a VISA resource such as
        ``visa:TCPIP::host::INSTR``, or the name of the sound card.
    sample_rate_hz : float
        At which waveforms are played, where the host sets it; a serial device has its own.
    amplifier_gain : float or None
        Volts at the actuator per volt of the generator.
    volts_full_scale : float or None
        Volts at the actuator, to both sides, for the sound card's largest sample: a measured
        calibration.
    channels : tuple of int
        The output that plays each channel, counted from 1.
    line : LineSettings
        Rate and timeouts of a serial line.
    recorder : Recorder or None
        What is to hear the inputs of the sound card that drives, on one clock with its outputs.

    Examples
    --------
    >>> from device.limits import Limits
    >>> settings = DriverSettings(limits=Limits(ceiling_vpp=200.0), port="/dev/ttyACM0")
    >>> settings.sample_rate_hz, settings.channels
    (48000.0, (1, 2))
    """

    limits: Limits
    port: str | None = None
    sample_rate_hz: float = 48_000.0
    amplifier_gain: float | None = None
    volts_full_scale: float | None = None
    channels: tuple[int, ...] = (1, 2)
    line: LineSettings = USUAL
    recorder: Recorder | None = None


def make_device(name: str, settings: DriverSettings, clock: Clock) -> BurstDevice:
    """Return a device by the name of its driver; nothing is sent before `open` is called.

    Parameters
    ----------
    name : str
        mock, serial, generator, audio, or that of an installed driver of a lab's own.
    settings : DriverSettings
        What it is made from.
    clock : Clock
        The host's; the machine's for anything but the mock.

    Returns
    -------
    BurstDevice
        Not yet open.

    Raises
    ------
    ValueError
        There is no such driver, it cannot be loaded, or one of its settings is missing or out of
        range.

    Examples
    --------
    >>> from device.clock import VirtualClock
    >>> from device.limits import Limits
    >>> settings = DriverSettings(limits=Limits(ceiling_vpp=200.0))
    >>> make_device("mock", settings, VirtualClock()).open().emulated
    True
    >>> make_device("serial", settings, MonotonicClock())
    Traceback (most recent call last):
    ValueError: port must be given for the driver serial, got None
    """
    if name not in NEEDS:
        return guarded_device(installed_driver(name).make(settings, clock, BurstDevice))
    if refused := channel_fault(name, settings.channels):
        raise ValueError(refused)
    limits, rate_hz = settings.limits, settings.sample_rate_hz
    channels = len(settings.channels)
    if name == MOCK:
        return make_mock(limits, clock, OutputStage(channels=channels, sample_rate_hz=rate_hz))
    port = _given(settings.port, "port", name)
    require_port_of(name, port)
    shared: dict[str, Any] = {"limits": limits, "clock": clock}
    if name == "serial":
        from device.wire.serial import serial_device

        return serial_device(port, channels=channels, line=settings.line, **shared)
    if name == "generator":
        from device.scpi.generator import generator_device

        return generator_device(
            port,
            amplifier_gain=_given(settings.amplifier_gain, "amplifier_gain", name),
            sample_rate_hz=rate_hz,
            outputs=settings.channels,
            line=settings.line,
            **shared,
        )
    from device.sound.audio import audio_device

    return audio_device(
        port,
        volts_full_scale=_given(settings.volts_full_scale, "volts_full_scale", name),
        sample_rate_hz=rate_hz,
        channels=channels,
        recorder=settings.recorder,
        **shared,
    )


def guarded_device(device: BurstDevice) -> BurstDevice:
    """Return a device of another distribution as one that fails by `DeviceError` only, in one line.

    ValueError if it is no `BurstDevice`.
    """
    require_instance(device, BurstDevice)
    return device if isinstance(device, HostDriver) else cast("BurstDevice", _GuardedDevice(device))


_RESULTS: Final[Mapping[str, type]] = {"open": Identity, "fire": Delivery, "query": Delivery}


class _GuardedDevice:
    """A device of another distribution; whatever it fails with is a failure of this device."""

    def __init__(self, device: BurstDevice) -> None:
        self._device = device

    @property
    def cannot(self) -> tuple[str, ...]:
        return tuple(self._device.cannot)

    def __getattr__(self, step: str) -> Callable[..., Any]:
        method = getattr(self._device, step)

        def call(*args: Any, **named: Any) -> Any:
            name = f"{type(self._device).__name__}.{step}"
            try:
                result = method(*args, **named)
            except DeviceError:
                raise
            except Exception as error:
                raise LinkError(f"{name} failed: {error_line(error)}") from error
            expected = _RESULTS.get(step)
            if expected is not None and not isinstance(result, expected):
                raise LinkError(f"{name} must return a device.{expected.__name__}; got {result!r}")
            return result

        return call


def require_port_of(name: str, port: str) -> None:
    """Raise PortError if a built-in driver opens no port of this form; nothing is opened.

    >>> require_port_of("audio", "alt://a card may have any name")
    >>> require_port_of("serial", "/dev/ttyACM0")
    """
    from device.scpi.visa import is_resource

    # a resource without its scheme is refused with a hint when it is opened
    is_visa = name == "generator" and (is_resource(port) or "::" in port)
    if name in {"serial", "generator"} and not is_visa:
        require_port(port)


def installed_driver(name: str) -> Installed:
    """Return an installed driver by its name; ValueError with the names of those that there are."""
    return lookup(DRIVERS, name, tuple(NEEDS))


def channel_fault(name: str, channels: tuple[int, ...]) -> str | None:
    """Return why a built-in driver refuses channels; None if it takes them.

    >>> channel_fault("mock", (1, 2, 3)), channel_fault("mock", (3, 4))
    (None, 'channels must be [1, 2] for the driver mock, got [3, 4]: the example ...')
    >>> channel_fault("generator", (2, 1)), channel_fault("generator", (1, 2, 3))
    (None, 'channels must be [1, 2] for the driver generator, got [1, 2, 3]: the example ...')
    """
    is_generator = name == "generator"
    outputs = GENERATOR_OUTPUTS if is_generator else tuple(range(1, len(channels) + 1))
    if name not in NEEDS or channels == outputs or (is_generator and {*channels} <= {*outputs}):
        return None
    return (
        f"channels must be {list(outputs)} for the driver {name}, got {list(channels)}: the "
        "example sound_card_channels is a driver that takes others"
    )


def make_mock(limits: Limits, clock: Clock, output: OutputStage) -> MockDevice:
    """Return a mock whose own rest between bursts is the study's."""
    return MockDevice(
        clock,
        limits=limits,
        device_limits=replace(
            DEVICE_LIMITS,
            ceiling_vpp=max(DEVICE_LIMITS.ceiling_vpp, limits.ceiling_vpp),
            min_interval_s=limits.min_interval_s,
        ),
        output=output,
    )


def is_emulated(name: str, port: str | None, line: LineSettings = USUAL) -> bool:
    """Ask what answers on a port whether it is an emulator; nothing is set or switched on.

    A `LinkError` says that nothing answers which this driver can drive. A sound card is never
    emulated: what hangs behind it cannot be asked. Nor can a driver of a lab's own before it is
    opened.
    """
    if name not in {"serial", "generator"}:
        return name == MOCK
    port = _given(port, "port", name)
    if name == "generator":
        return _is_emulated_generator(port, line)
    return _is_emulated_device(port, line)


def _is_emulated_device(port: str, line: LineSettings) -> bool:
    from device.wire.channels import open_channel
    from device.wire.link import FrameLink

    clock = MonotonicClock()
    link = FrameLink(lambda: open_channel(port, clock, line), clock, line=line)
    try:
        return link.hello().emulated
    finally:
        link.hang_up()


def _is_emulated_generator(port: str, line: LineSettings) -> bool:
    from device.scpi.dialects import EMULATED
    from device.scpi.generator import identify_generator

    identity = identify_generator(port, line)
    if identity is None:
        raise LinkError(f"no generator that is known here answers on {port}")
    return EMULATED in identity.split(",")


def _given(value: _Value | None, key: str, name: str) -> _Value:
    if value is None:
        raise ValueError(f"{key} must be given for the driver {name}, got None")
    return value
