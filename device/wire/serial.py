"""Serial ports and sockets as channels of the wire format, and what answers on them."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, Final

from device.clock import Clock, MonotonicClock
from device.core.host import HostDriver
from device.core.messages import AskHealth, AskLimits
from device.errors import LinkError, PortError
from device.limits import MAX_CHANNELS
from device.wire.channels import USUAL, Channel, LineSettings, open_channel
from device.wire.frames import MAKER
from device.wire.link import FrameLink
from device.wire.requests import plain_answer

if TYPE_CHECKING:
    from device.core.reports import DeviceLimits, Health
    from device.driver import Identity
    from device.limits import Limits

_IDENTIFY_WITHIN_S: Final = 0.3


def serial_device(
    port: str,
    *,
    limits: Limits,
    clock: Clock,
    channels: int = MAX_CHANNELS,
    line: LineSettings = USUAL,
) -> HostDriver:
    """Return the driver of the device on a port, of so many of its channels; nothing is opened yet.

    >>> from device.clock import MonotonicClock
    >>> from device.limits import Limits
    >>> device = serial_device("/no/such/port", limits=Limits(ceiling_vpp=200.0),
    ...                        clock=MonotonicClock())
    >>> device.open()
    Traceback (most recent call last):
    device.errors.LinkError: cannot open /no/such/port: ...
    """
    link = FrameLink(lambda: open_channel(port, clock, line), clock, line=line)
    return HostDriver(link, limits=limits, clock=clock, channels=channels)


def identify(port: str, line: LineSettings = USUAL) -> tuple[Identity, DeviceLimits, Health] | None:
    """Return who answers on a port and what it reports, or None where no device of this kind does.

    A `LinkError` says of one of this kind why it cannot be driven.

    Asks in plain text first: an instrument of another kind is not sent frames that it cannot read.
    """
    clock = MonotonicClock()
    try:
        channel = open_channel(port, clock, line)
    except (LinkError, PortError):
        return None
    with closing(channel):
        if not _says_its_name(channel, clock):
            return None
        link = FrameLink(lambda: channel, clock, line=line)
        try:
            identity = link.hello()
            limits, health = link.exchange(AskLimits()), link.exchange(AskHealth())
            return identity, limits.record, health.record
        finally:
            link.hang_up()


def _says_its_name(channel: Channel, clock: Clock) -> bool:
    try:
        return plain_answer(channel, clock, _IDENTIFY_WITHIN_S).startswith(MAKER)
    except LinkError:
        return False
