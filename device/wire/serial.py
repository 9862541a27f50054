"""Serial ports and sockets as channels of the wire format, and what answers on them."""

from __future__ import annotations

from contextlib import closing
from typing import TYPE_CHECKING, Final

from device.clock import Clock, MonotonicClock
from device.core.host import HostDriver
from device.driver import DeviceError, Identity
from device.wire.channels import USUAL, LineSettings, open_channel
from device.wire.frames import MAKER
from device.wire.link import FrameLink
from device.wire.silence import plain_answer

if TYPE_CHECKING:
    from device.limits import Limits

_IDENTIFY_WITHIN_S: Final = 0.3


def serial_device(
    port: str, *, limits: Limits, clock: Clock, line: LineSettings = USUAL
) -> HostDriver:
    """Return the driver of the device on a port; nothing is opened yet.

    >>> from device.clock import MonotonicClock
    >>> from device.limits import Limits
    >>> device = serial_device("/no/such/port", limits=Limits(ceiling_vpp=200.0),
    ...                        clock=MonotonicClock())
    >>> device.open()
    Traceback (most recent call last):
    device.driver.LinkError: cannot open /no/such/port: ...
    """
    link = FrameLink(lambda: open_channel(port, clock, line), clock, line=line)
    return HostDriver(link, limits=limits, clock=clock)


def identify(port: str) -> Identity | None:
    """Return who answers on a port, or None where no device of this kind does.

    Asks in plain text first: an instrument of another kind is not sent frames that it cannot read.
    """
    clock = MonotonicClock()
    try:
        with closing(open_channel(port, clock)) as channel:
            if not plain_answer(channel, clock, _IDENTIFY_WITHIN_S).startswith(MAKER):
                return None
            link = FrameLink(lambda: channel, clock)
            try:
                return link.hello()
            finally:
                link.hang_up()
    except DeviceError:
        return None
