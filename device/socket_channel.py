"""A TCP connection as a channel of the wire format."""

import select
import socket
from typing import Final
from urllib.parse import urlsplit

from device.driver import LinkError

SCHEME: Final = "socket://"

_CHUNK: Final = 4096
_CONNECT_WITHIN_S: Final = 5.0
_WRITE_WITHIN_S: Final = 0.5


class SocketChannel:
    """A `channel.Channel` over TCP.

    pyserial opens such URLs too, but waits 0.3 s whenever it closes one and keeps the socket open
    if the other side was faster.

    Parameters
    ----------
    url : str
        ``socket://host:port``.

    Raises
    ------
    LinkError
        If nobody listens there, or it is no such URL.

    Examples
    --------
    >>> SocketChannel("socket://nowhere")
    Traceback (most recent call last):
    device.driver.LinkError: cannot open socket://nowhere: it must be socket://host:port
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
