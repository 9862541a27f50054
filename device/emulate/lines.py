"""Where an emulated device's bytes come from and go to: a pseudo-terminal or a TCP port.

A line never waits for a host that does not read: what does not fit is lost, as on a wire.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import socket
import time
from typing import Final, Protocol

_CHUNK: Final = 4096


class Line(Protocol):
    """A port, seen from the device."""

    name: str

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has arrived within the time; None where the host is gone."""

    def write(self, data: bytes) -> None:
        """Send bytes, if there is a host."""

    def drop(self) -> None:
        """Lose the host."""

    def close(self) -> None:
        """Give the port back."""


class PtyLine:
    """A pseudo-terminal; its name is the port to open.

    >>> line = PtyLine()
    >>> line.read(0.0) is None
    True
    >>> line.close()
    """

    def __init__(self) -> None:
        import tty

        self._ours, theirs = os.openpty()
        tty.setraw(theirs)
        self.name = os.ttyname(theirs)
        os.close(theirs)
        os.set_blocking(self._ours, False)

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has arrived; None while no host has the port open."""
        readable, _, _ = select.select([self._ours], [], [], timeout_s)
        if not readable:
            return b""
        try:
            return os.read(self._ours, _CHUNK)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            time.sleep(timeout_s)
            return None

    def write(self, data: bytes) -> None:
        """Send bytes; what a host does not read is lost."""
        with contextlib.suppress(OSError):
            os.write(self._ours, data)

    def drop(self) -> None:
        """Do nothing: a pty cannot throw its host out."""

    def close(self) -> None:
        """Give the pty back."""
        os.close(self._ours)


class TcpLine:
    """A TCP port of this machine; one host at a time, a second one is shown the door.

    Port 0 takes any free one.

    >>> line = TcpLine(0)
    >>> line.name.startswith("socket://127.0.0.1:")
    True
    >>> line.close()
    """

    def __init__(self, port: int) -> None:
        self._server = socket.create_server(("127.0.0.1", port))
        self._server.settimeout(0.0)
        self.name = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._host: socket.socket | None = None

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has arrived; None while no host is connected."""
        watched = [self._server] if self._host is None else [self._host, self._server]
        readable, _, _ = select.select(watched, [], [], timeout_s)
        if self._host is not None and self._host in readable:
            return self._received(self._host)
        if self._server in readable:
            self._accept()
        return None if self._host is None else b""

    def write(self, data: bytes) -> None:
        """Send bytes; what a host does not read is lost."""
        try:
            if self._host is not None:
                self._host.send(data)
        except BlockingIOError:
            return
        except OSError:
            self.drop()

    def drop(self) -> None:
        """Lose the host."""
        if self._host is not None:
            self._host.close()
            self._host = None

    def close(self) -> None:
        """Give the port back."""
        self.drop()
        self._server.close()

    def _received(self, host: socket.socket) -> bytes | None:
        try:
            data = host.recv(_CHUNK)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self.drop()
            return None
        return data

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            newcomer, _ = self._server.accept()
            if self._host is not None:
                newcomer.close()
                return
            newcomer.settimeout(0.0)
            newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._host = newcomer
