"""Lines of bytes as the host sees them, and the heart that keeps a device on one awake."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import select
import socket
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from typing import TYPE_CHECKING, Final, Protocol
from urllib.parse import urlsplit

from device.checks import require_real, require_whole
from device.driver import Lack
from device.errors import LinkError, PortError

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock

BEAT_EVERY_S: Final = 0.1
"""Interval of the heartbeat."""

_LEAST_WAIT_S: Final = 0.025
_MARGIN_S: Final = 0.005
_LONGEST_EXCHANGE_BITS: Final = 10 * (104 + 2 * 19)
"""HELLO, its answer, and the beats between them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LineSettings:
    """Settings of a line and its timeouts.

    Parameters
    ----------
    baud : int
        Rate of the port, or of the slowest line behind it; USB and sockets have none.
    dtr : bool
        Whether the line DTR is raised when a port is opened, which restarts some boards.
    open_timeout_s : float
        How long a device may take to give its first answer after its port is open.
    response_timeout_s : float
        How long any other question is repeated before the device counts as silent.

    Raises
    ------
    ValueError
        A field is out of range.

    Examples
    --------
    >>> LineSettings().answer_within_s, round(LineSettings(baud=9600).answer_within_s, 3)
    (0.025, 0.153)
    """

    baud: int = 115_200
    dtr: bool = True
    open_timeout_s: float = 2.0
    response_timeout_s: float = 2.0

    def __post_init__(self) -> None:
        require_whole("baud", self.baud, minimum=1200, maximum=10_000_000)
        require_real("open_timeout_s", self.open_timeout_s, minimum=0.01, maximum=60.0)
        require_real("response_timeout_s", self.response_timeout_s, minimum=0.01, maximum=60.0)

    @property
    def answer_within_s(self) -> float:
        """A question is sent again when its answer took longer than this."""
        return max(_LEAST_WAIT_S, _LONGEST_EXCHANGE_BITS / self.baud + _MARGIN_S)


class Channel(Protocol):
    """A line that carries bytes both ways.

    Every method raises `LinkError` once the line is gone.
    """

    def write(self, data: bytes) -> None:
        """Send bytes; from several threads."""

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, or wait for it; nothing after `timeout_s`."""

    def close(self) -> None:
        """Close the line."""


USUAL: Final = LineSettings()


class Heart:
    """A thread that beats until `end` is called, whatever the line is like.

    A `LinkError` of `beat` is passed over.

    >>> beaten = Event()
    >>> heart = Heart(beaten.set)
    >>> beaten.wait(60.0)
    True
    >>> heart.end()
    """

    def __init__(self, beat: Callable[[], None]) -> None:
        self._beat = beat
        self._over = Event()
        self._thread = Thread(target=self._run, name="tactstrip heartbeat", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Stop beating; return when the thread is over."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(BEAT_EVERY_S):
            with contextlib.suppress(LinkError):
                self._beat()


SCHEME: Final = "socket://"

_CHUNK: Final = 4096
_CONNECT_WITHIN_S: Final = 5.0


class SocketChannel:
    """A `Channel` over TCP.

    pyserial opens such URLs too, but waits 0.3 s whenever it closes one and keeps the socket open
    if the other side was faster.

    >>> SocketChannel("socket://nowhere")
    Traceback (most recent call last):
    device.errors.LinkError: cannot open socket://nowhere: it must be socket://host:port
    """

    def __init__(self, url: str) -> None:
        self._url = url
        try:
            parts = urlsplit(url)
            address = parts.hostname, parts.port
        except ValueError:
            address = None, None
        if address[0] is None or address[1] is None:
            raise LinkError(f"cannot open {url}: it must be {SCHEME}host:port")
        try:
            self._socket = socket.create_connection((address[0], address[1]), _CONNECT_WITHIN_S)
        except OSError as error:
            raise LinkError(f"cannot open {url}: {error}") from error
        self._socket.settimeout(_WRITE_WITHIN_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise LinkError(f"the line to {self._url} is gone: {error}") from error

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, or wait for it; nothing after `timeout_s`."""
        try:
            readable, _, _ = select.select([self._socket], [], [], timeout_s)
            data = self._socket.recv(_CHUNK) if readable else None
        except (OSError, ValueError) as error:
            raise LinkError(f"the line to {self._url} is gone: {error}") from error
        if data == b"":
            raise LinkError(f"the line to {self._url} is gone: closed from there")
        return data or b""

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


_POLL_S: Final = 0.002
_WRITE_WITHIN_S: Final = 0.5
_AT_ONCE: Final = 4096

_IN_USE: Final = (errno.EAGAIN, errno.EBUSY)
"""Another process has locked the port."""

_GONE: Final = (OSError, TypeError, ValueError, AttributeError)
"""What pyserial raises where the port is gone, or is closed by another thread meanwhile."""


class SerialChannel:
    """A `Channel` over a serial port, or a URL that pyserial knows.

    A `LinkError` says that it cannot be opened; another process may have it.

    >>> from device.clock import MonotonicClock
    >>> SerialChannel("/no/such/port", MonotonicClock())
    Traceback (most recent call last):
    device.errors.LinkError: cannot open /no/such/port: ...
    """

    def __init__(self, port: str, clock: Clock, line: LineSettings = USUAL) -> None:
        import serial

        self._port = port
        self._clock = clock
        try:
            self._line = serial.serial_for_url(port, do_not_open=True)
            self._line.baudrate = line.baud
            if not line.dtr:
                self._line.dtr = False
            self._line.timeout, self._line.write_timeout = _POLL_S, _WRITE_WITHIN_S
            self._line.exclusive = True
            self._line.open()
        except (OSError, ValueError) as error:
            if getattr(error, "errno", None) in _IN_USE:
                raise LinkError(f"{port} is in use by another program") from error
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


def require_port(port: str) -> None:
    """Raise PortError unless a port has a form that is opened here.

    pyserial knows further schemes: ``spy://`` writes a file that the port names.

    >>> require_port("socket://127.0.0.1:5025")
    >>> require_port("spy://x?file=results.csv")
    Traceback (most recent call last):
    device.errors.PortError: port must be a device path, COMn, socket://HOST:PORT, ...
    """
    scheme, colon, _ = port.lower().partition("://")
    is_path = ("/" in port or "\\" in port or _COM_PORT.fullmatch(port)) and not colon
    if not (is_path or (colon and scheme in _SCHEMES)):
        raise PortError(port)


_COM_PORT: Final = re.compile(r"COM[0-9]{1,3}", re.IGNORECASE)
_SCHEMES: Final = ("socket", "rfc2217")


def open_channel(port: str, clock: Clock, line: LineSettings = USUAL) -> Channel:
    """Return the channel to a port: of this machine, or ``socket://host:port``.

    >>> from device.clock import MonotonicClock
    >>> open_channel("socket://127.0.0.1:1", MonotonicClock())
    Traceback (most recent call last):
    device.errors.LinkError: cannot open socket://127.0.0.1:1: ...
    """
    require_port(port)
    return (
        SocketChannel(port) if port.lower().startswith(SCHEME) else SerialChannel(port, clock, line)
    )


def port_lack(port: str) -> Lack | None:
    """Return what this machine lacks to open a port; it is not opened, and no host is reached.

    Examples
    --------
    >>> print(port_lack("/no/such/port"))
    port is missing: /no/such/port is not there; tactstrip devices lists the ports
    >>> port_lack("socket://127.0.0.1:5025")
    """
    if "://" in port or os.name != "posix" or Path(port).exists():  # no name server is asked
        return None
    return Lack(what="port", remedy=f"{port} is not there; tactstrip devices lists the ports")
