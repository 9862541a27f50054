"""Serial ports and sockets as channels of the wire format, and what answers on them."""

from typing import Final

from device.channel import Channel
from device.clock import Clock, MonotonicClock
from device.driver import DeviceError, Identity, LinkError
from device.frame_link import FrameLink
from device.host import HostDriver
from device.limits import Limits
from device.plain_text import MAKER, QUESTION
from device.socket_channel import SCHEME, SocketChannel

BAUD: Final = 115_200
"""Rate of a port that has one; USB and sockets ignore it."""

_POLL_S: Final = 0.002
_WRITE_WITHIN_S: Final = 0.5
_AT_ONCE: Final = 4096
_IDENTIFY_WITHIN_S: Final = 0.3

_GONE: Final = (OSError, TypeError, ValueError, AttributeError)
"""What pyserial raises where the port is gone, or is closed by another thread meanwhile."""


class SerialChannel:
    """A `channel.Channel` over a serial port, or a URL that pyserial knows.

    Parameters
    ----------
    port : str
        Name of the port, or a URL.
    clock : Clock
        The machine's.

    Raises
    ------
    LinkError
        If it cannot be opened; another process may have it.

    Examples
    --------
    >>> SerialChannel("/no/such/port", MonotonicClock())
    Traceback (most recent call last):
    device.driver.LinkError: cannot open /no/such/port: ...
    """

    def __init__(self, port: str, clock: Clock) -> None:
        import serial

        self._port = port
        self._clock = clock
        try:
            self._line = serial.serial_for_url(port, do_not_open=True)
            self._line.baudrate = BAUD
            self._line.timeout, self._line.write_timeout = _POLL_S, _WRITE_WITHIN_S
            self._line.exclusive = True
            self._line.open()
        except (OSError, ValueError) as error:
            raise LinkError(f"cannot open {port}: {error}") from error

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._line.write(data)
        except _GONE as error:
            raise self._gone(error) from error

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, or wait for it; nothing after `timeout_s`."""
        until_s = self._clock.now_s() + timeout_s
        try:
            while True:
                arrived = bytes(self._line.read(1))
                while arrived and len(arrived) < _AT_ONCE and (more := self._line.in_waiting):
                    arrived += bytes(self._line.read(more))
                if arrived or self._clock.now_s() >= until_s:
                    return arrived
        except _GONE as error:
            raise self._gone(error) from error

    def close(self) -> None:
        """Close the port."""
        self._line.close()

    def _gone(self, error: Exception) -> LinkError:
        return LinkError(f"the line to {self._port} is gone: {error}")


def open_channel(port: str, clock: Clock) -> Channel:
    """Return the channel to a port: of this machine, or ``socket://host:port``.

    Raises
    ------
    LinkError
        If it cannot be opened.

    Examples
    --------
    >>> open_channel("socket://127.0.0.1:1", MonotonicClock())
    Traceback (most recent call last):
    device.driver.LinkError: cannot open socket://127.0.0.1:1: ...
    """
    return SocketChannel(port) if port.startswith(SCHEME) else SerialChannel(port, clock)


def serial_device(port: str, *, limits: Limits, clock: Clock) -> HostDriver:
    """Return the driver of the device on a port; nothing is opened yet.

    Parameters
    ----------
    port : str
        Name of the port, or a URL.
    limits : Limits
        Of the study.
    clock : Clock
        The machine's.

    Examples
    --------
    >>> device = serial_device("/no/such/port", limits=Limits(ceiling_vpp=200.0),
    ...                        clock=MonotonicClock())
    >>> device.open()
    Traceback (most recent call last):
    device.driver.LinkError: cannot open /no/such/port: ...
    """
    link = FrameLink(lambda: open_channel(port, clock), clock)
    return HostDriver(link, limits=limits, clock=clock)


def identify(port: str) -> Identity | None:
    """Return who answers on a port, or None where no device of this kind does.

    Asks in plain text first: an instrument of another kind is not sent frames that it cannot read.

    Examples
    --------
    >>> identify("/no/such/port") is None
    True
    """
    clock = MonotonicClock()
    try:
        channel = open_channel(port, clock)
    except LinkError:
        return None
    link = FrameLink(lambda: channel, clock)
    try:
        return link.hello() if _says_its_name(channel, clock) else None
    except DeviceError:
        return None
    finally:
        link.hang_up()
        channel.close()


def _says_its_name(channel: Channel, clock: Clock) -> bool:
    channel.write(b"\0" + QUESTION + b"\n")
    until_s, said = clock.now_s() + _IDENTIFY_WITHIN_S, b""
    while (left_s := until_s - clock.now_s()) > 0 and not said.endswith(b"\n"):
        said += channel.read(left_s)
    return MAKER.encode() in said
