"""An emulated generator behind HiSLIP or a socket; pyvisa is at the other end.

The buses are written from the protocols' documents (IVI-6.1), as the `Line` of an emulator.
"""

from __future__ import annotations

import io
import json
import select
import socket
import struct
import threading
import time
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from device.emulate.faults import Faults, FaultScript
from device.emulate.generator import GeneratorEmulator
from device.emulate.lines import TcpLine

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

    from device.emulate.lines import Line

HOST: Final = "127.0.0.1"
LARGEST: Final = 64
"""Bytes that a bus takes in a piece of a message."""


NO_FAULTS: Final = Faults(FaultScript(), np.random.default_rng(1))


class Instrument:
    """A generator at work behind a bus, and what it was sent."""

    def __init__(self, bus: Line, *, gain: float) -> None:
        self.name = bus.name
        self.received = b""
        self.truth = io.StringIO()
        self._bus = bus
        self._over = threading.Event()
        self._emulator = GeneratorEmulator(self, self.truth, amplifier_gain=gain, faults=NO_FAULTS)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._over.is_set():
            self._emulator.turn()

    def read(self, timeout_s: float) -> bytes | None:
        message = self._bus.read(timeout_s)
        self.received += message or b""
        return message

    def write(self, data: bytes) -> None:
        self._bus.write(data)

    def drop(self) -> None:
        self._bus.drop()

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._bus.close()

    def events(self, kind: str, at_least: int = 0) -> list[dict[str, Any]]:
        """Return the events of a kind in the truth file, once there are so many."""
        give_up_s = time.monotonic() + 10.0
        while True:
            events = [json.loads(line) for line in self.truth.getvalue().splitlines()]
            named = [event for event in events if event["event"] == kind]
            if len(named) >= at_least or time.monotonic() > give_up_s:
                return named
            time.sleep(0.002)


class _Server:
    """A port of this machine; a bus says what the bytes of its connections mean."""

    def __init__(self) -> None:
        self._server = socket.create_server((HOST, 0))
        self.port = int(self._server.getsockname()[1])
        self._heard: dict[socket.socket, bytes] = {}

    def read(self, timeout_s: float) -> bytes | None:
        readable, _, _ = select.select([self._server, *self._heard], [], [], timeout_s)
        message = b""
        for line in readable:
            if line is self._server:
                self._heard[line.accept()[0]] = b""
            elif chunk := line.recv(65_536):
                self._heard[line] += chunk
                message += self._take(line)
            else:
                self.drop()
                break
        return message if self._heard else None

    def _take(self, line: socket.socket) -> bytes:
        raise NotImplementedError

    def _cut(self, line: socket.socket, size: int) -> bytes:
        taken, self._heard[line] = self._heard[line][:size], self._heard[line][size:]
        return taken

    def drop(self) -> None:
        for line in self._heard:
            line.close()
        self._heard.clear()

    def close(self) -> None:
        self.drop()
        self._server.close()


class HislipBus(_Server):
    """Two connections of one session, answers with the number of the message that asked."""

    _HEADER = struct.Struct(">2sBBIQ")

    def __init__(self) -> None:
        super().__init__()
        self.name = f"visa:TCPIP::{HOST}::hislip0,{self.port}::INSTR"
        self._sync: socket.socket | None = None
        self._message, self._asked = b"", 0

    def _take(self, line: socket.socket) -> bytes:
        data = b""
        while len(self._heard[line]) >= self._HEADER.size:
            _, kind, _, number, size = self._HEADER.unpack(self._heard[line][: self._HEADER.size])
            if len(self._heard[line]) < self._HEADER.size + size:
                break
            payload = self._cut(line, self._HEADER.size + size)[self._HEADER.size :]
            if kind == 0:  # Initialize: version 1.0, session 1
                self._sync = line
                self._say(line, 1, 0x0100_0001, control=1)  # it prefers overlap mode
            elif kind == 17:  # AsyncInitialize
                self._say(line, 18, 0)
            elif kind == 15:  # AsyncMaxMsgSize
                self._say(line, 16, 0, struct.pack(">Q", self._HEADER.size + LARGEST))
            elif kind in {6, 7}:  # Data, DataEnd
                assert size <= LARGEST
                self._message, self._asked = self._message + payload, number
                if kind == 7:
                    data, self._message = data + self._message, b""
        return data

    def _say(
        self, line: socket.socket, kind: int, number: int, payload: bytes = b"", control: int = 0
    ) -> None:
        line.sendall(self._HEADER.pack(b"HS", kind, control, number, len(payload)) + payload)

    def write(self, data: bytes) -> None:
        assert self._sync is not None
        self._say(self._sync, 7, self._asked, data)


def socket_bus() -> TcpLine:
    """Return a plain socket, under its name as a VISA resource."""
    line = TcpLine(0)
    line.name = f"visa:TCPIP::{HOST}::{line.name.rpartition(':')[2]}::SOCKET"
    return line


BUSES: Final[dict[str, Callable[[pytest.MonkeyPatch], Line]]] = {
    "hislip": lambda monkeypatch: HislipBus(),
    "socket": lambda monkeypatch: socket_bus(),
}
