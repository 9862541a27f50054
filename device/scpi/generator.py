"""The driver of two-channel arbitrary-waveform generators over SCPI. Not tried on hardware."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, Final

from device.clock import Clock, MonotonicClock
from device.core.host import HostDriver
from device.errors import LinkError
from device.scpi.dialects import dialect_of
from device.scpi.line import ScpiLine
from device.scpi.link import GeneratorLink
from device.scpi.visa import open_instrument
from device.wire.channels import USUAL, Channel, LineSettings

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.limits import Limits

_GLANCE_S: Final = 1.0


class GeneratorDevice(HostDriver):
    """A `BurstDevice` that is a generator with an amplifier behind it.

    `connect` opens the channel or raises `LinkError`; the gain is volts at the actuator per volt of
    the generator.
    """

    def __init__(
        self,
        connect: Callable[[], Channel],
        *,
        limits: Limits,
        clock: Clock,
        amplifier_gain: float,
        sample_rate_hz: float,
    ) -> None:
        self._generator = GeneratorLink(
            connect,
            clock,
            limits=limits,
            amplifier_gain=amplifier_gain,
            sample_rate_hz=sample_rate_hz,
        )
        super().__init__(self._generator, limits=limits, clock=clock)

    @property
    def cannot(self) -> tuple[str, ...]:
        """What the generator cannot promise; complete once it is open."""
        return self._generator.cannot


def generator_device(
    port: str,
    *,
    limits: Limits,
    clock: Clock,
    amplifier_gain: float,
    sample_rate_hz: float,
    line: LineSettings = USUAL,
) -> GeneratorDevice:
    """Return the driver of the generator on a port; nothing is opened yet.

    >>> from device.clock import MonotonicClock
    >>> from device.limits import Limits
    >>> generator_device("/no/such/port", limits=Limits(ceiling_vpp=200.0), clock=MonotonicClock(),
    ...                  amplifier_gain=27.5, sample_rate_hz=48e3).open()
    Traceback (most recent call last):
    device.errors.LinkError: cannot open /no/such/port: ...
    """
    return GeneratorDevice(
        lambda: open_instrument(port, clock, line),
        limits=limits,
        clock=clock,
        amplifier_gain=amplifier_gain,
        sample_rate_hz=sample_rate_hz,
    )


def identify_generator(port: str, line: LineSettings = USUAL) -> str | None:
    """Return what a generator on a port answers to ``*IDN?``, or None where none known does.

    Nothing is set. A `LinkError` says that the port cannot be opened.
    """
    clock = MonotonicClock()
    with closing(open_instrument(port, clock, line)) as channel:
        try:
            words = ScpiLine(channel, clock, response_timeout_s=_GLANCE_S).identify()
        except LinkError:
            return None
    return words if dialect_of(words) is not None else None
