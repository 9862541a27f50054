"""The actuator device without an actuator: the device's core behind a pty or a TCP port.

A process of its own, so that it outlives its host; what it really emitted goes to a file that no
host can touch.
"""

import errno
import heapq
import json
import os
import secrets
import select
import socket
import time
import zlib
from dataclasses import dataclass
from typing import IO, Final, Protocol

import numpy as np

from device.core import DeviceCore
from device.driver import Identity
from device.endpoint import Endpoint
from device.faults import Faults, Mishap
from device.frames import MINOR, VERSION
from device.limits import Limits
from device.output import Emission, OutputStage
from device.states import State

TICK_S: Final = 0.002
"""How late the device notices what is due by itself, such as its watchdog."""

_CHUNK: Final = 4096
_BITS_PER_BYTE: Final = 10
_QUIET: Final = (State.IDLE, State.LOADED, State.SAFE)


class Line(Protocol):
    """Where the device's bytes come from and go to.

    Examples
    --------
    >>> sorted(name for name in vars(Line) if not name.startswith("_"))
    ['drop', 'read', 'write']
    """

    name: str

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has arrived within the time; None where the host is gone."""

    def write(self, data: bytes) -> None:
        """Send bytes, if there is a host."""

    def drop(self) -> None:
        """Lose the host."""


class PtyLine:
    """A pseudo-terminal; its name is the port to open.

    Examples
    --------
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
        try:
            os.write(self._ours, data)
        except (BlockingIOError, OSError):
            return

    def drop(self) -> None:
        """Do nothing: a pty cannot throw its host out."""

    def close(self) -> None:
        """Give the pty back."""
        os.close(self._ours)


class TcpLine:
    """A TCP port of this machine; one host at a time.

    Parameters
    ----------
    port : int
        0 takes any free one.

    Examples
    --------
    >>> line = TcpLine(0)
    >>> line.name.startswith("socket://127.0.0.1:")
    True
    >>> line.close()
    """

    def __init__(self, port: int) -> None:
        self._server = socket.create_server(("127.0.0.1", port))
        self.name = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._host: socket.socket | None = None

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has arrived; None while no host is connected."""
        waiting = self._server if self._host is None else self._host
        readable, _, _ = select.select([waiting], [], [], timeout_s)
        if not readable:
            return None if self._host is None else b""
        if self._host is None:
            self._host, _ = self._server.accept()
            self._host.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._host.recv(_CHUNK)
        except OSError:
            data = b""
        if not data:
            self.drop()
            return None
        return data

    def write(self, data: bytes) -> None:
        """Send bytes, if there is a host."""
        try:
            if self._host is not None:
                self._host.sendall(data)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Nature:
    """What kind of device is emulated.

    Parameters
    ----------
    limits : Limits
        The device's own.
    output : OutputStage
        Converter and amplifier.
    baud : int or None
        Rate of a modelled wire, 10 bits a byte; none for no time on the wire.
    """

    limits: Limits
    output: OutputStage
    baud: int | None = None


class Emulator:
    """A device between a line and a truth file.

    Parameters
    ----------
    line : Line
        Where its host is.
    nature : Nature
        What it is.
    faults : Faults
        What goes wrong.
    truth : file
        JSON lines of what really happened.
    """

    def __init__(self, line: Line, nature: Nature, faults: Faults, truth: IO[str]) -> None:
        self._line = line
        self._nature = nature
        self._faults = faults
        self._truth = truth
        self._began_s = time.monotonic()
        self._inbox: list[tuple[float, int, bytes]] = []
        self._outbox: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self._busy_until_s = 0.0
        self._connected = False
        self._was = State.IDLE
        self._endpoint = self._power_up()

    def run(self) -> None:
        """Serve until the process ends."""
        while True:
            self.turn()

    def turn(self) -> None:
        """Do what is due, for one tick."""
        data = self._line.read(self._patience_s())
        if data is None and self._connected:
            self._endpoint.hang_up(self._now_us())
        self._connected = data is not None
        if data:
            self._arrive(data)
        self._take_due()
        self._endpoint.core.advance(self._now_us())
        self._note_output("watchdog")
        self._send_due()

    def _arrive(self, data: bytes) -> None:
        if self._nature.baud is not None:
            time.sleep(len(data) * _BITS_PER_BYTE / self._nature.baud)
        mishap = self._faults.arrived(len(data))
        if mishap is Mishap.STALL:
            time.sleep(self._faults.stall_s())
        if mishap is Mishap.RESET:
            self._endpoint.hang_up(self._now_us())
            self._note_output("reset")
            self._endpoint = self._power_up()
            return
        if mishap is Mishap.DISCONNECT:
            self._line.drop()
            self._endpoint.hang_up(self._now_us())
            self._note_output("disconnect")
            return
        for delay_s, piece in self._faults.passed(data):
            self._sent += 1
            heapq.heappush(self._inbox, (time.monotonic() + delay_s, self._sent, piece))

    def _take_due(self) -> None:
        while self._inbox and self._inbox[0][0] <= time.monotonic():
            answers = self._endpoint.receive(self._now_us(), heapq.heappop(self._inbox)[2])
            self._note_output("host")
            if answers:
                self._post(answers)

    def _post(self, answers: bytes) -> None:
        wire_s = 0.0 if self._nature.baud is None else _BITS_PER_BYTE / self._nature.baud
        for delay_s, piece in self._faults.passed(answers):
            begin_s = max(time.monotonic(), self._busy_until_s)
            self._busy_until_s = begin_s + len(piece) * wire_s
            self._sent += 1
            heapq.heappush(self._outbox, (self._busy_until_s + delay_s, self._sent, piece))
        self._send_due()

    def _send_due(self) -> None:
        while self._outbox and self._outbox[0][0] <= time.monotonic():
            self._line.write(heapq.heappop(self._outbox)[2])

    def _patience_s(self) -> float:
        due_s = [box[0][0] for box in (self._inbox, self._outbox) if box]
        return min([TICK_S, *(max(0.0, at_s - time.monotonic()) for at_s in due_s)])

    def _now_us(self) -> int:
        return int((time.monotonic() - self._began_s) * 1e6)

    def _power_up(self) -> Endpoint:
        boot_id = secrets.randbits(63)
        limits, output = self._nature.limits, self._nature.output
        core = DeviceCore(boot_id=boot_id, limits=limits, output=output, sink=self._note_burst)
        identity = Identity(
            model="emulator",
            serial_number=f"pid {os.getpid()}",
            boot_id=boot_id,
            protocol_version=f"{VERSION}.{MINOR}",
            sample_rate_hz=output.sample_rate_hz,
            bits=output.bits,
            channels=2,
            ceiling_vpp=limits.ceiling_vpp,
            longest_waveform=limits.longest_waveform,
            emulated=True,
        )
        core.advance(self._now_us())
        self._was = State.IDLE
        self._note({"event": "boot", "boot_id": boot_id})
        return Endpoint(core, identity)

    def _note_output(self, cause: str) -> None:
        """Write down when the output goes on or off, and why."""
        now = self._endpoint.core.state
        if (now in _QUIET) != (self._was in _QUIET):
            off = now in _QUIET
            self._note({"event": "off" if off else "on", "cause": cause})
        self._was = now

    def _note_burst(self, burst: Emission) -> None:
        volts = np.stack((burst.left_v, burst.right_v))
        self._note(
            {
                "event": "burst",
                "token": burst.token,
                "t_s": burst.start_us / 1e6,
                "channels": [int(np.any(row)) for row in volts],
                "levels_mv": [
                    round(burst.level_left_vpp * 1000),
                    round(burst.level_right_vpp * 1000),
                ],
                "peak_v": [float(np.abs(row).max(initial=0.0)) for row in volts],
                "crc": zlib.crc32(volts.tobytes()),
                "cut": burst.cut_us is not None,
            }
        )

    def _note(self, facts: dict[str, object]) -> None:
        line = {"t_s": self._now_us() / 1e6} | facts
        self._truth.write(json.dumps(line) + "\n")
        self._truth.flush()
