"""What can go wrong on a line and behind it, drawn from a seed: for emulators and tests.

A script is a list of faults, `name=value` with commas between: ``drop=0.01,corrupt=0.01``.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import TYPE_CHECKING, Final

import numpy as np

from device.checks import require_real

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.emulate.lines import Line

_SECONDS: Final = ("delay_s", "stall_s")
_LONGEST_S: Final = 86_400.0


class Mishap(StrEnum):
    """What happens to the device as a whole."""

    NONE = "none"
    STALL = "stall"
    RESET = "reset"
    DISCONNECT = "disconnect"


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultScript:
    """How often what goes wrong.

    Parameters
    ----------
    drop, corrupt : float
        Probability for each byte, both ways.
    duplicate, delay : float
        Probability for each frame, both ways; a delayed frame comes up to `delay_s` late.
    stall, reset, disconnect : float
        Probability each time that something arrives at the device: it does nothing for up to
        `stall_s`, restarts, or loses the line.
    delay_s, stall_s : float
        Longest times, up to a day.
    disconnect_at : float
        The line is lost once it has carried this many bytes, both ways together; infinite for
        never.

    Raises
    ------
    ValueError
        If a probability is not from 0 to 1, a time not from 0 to a day, or a number negative.

    Examples
    --------
    >>> FaultScript.parse("drop=0.01,delay=0.1").delay
    0.1
    """

    drop: float = 0.0
    corrupt: float = 0.0
    duplicate: float = 0.0
    delay: float = 0.0
    stall: float = 0.0
    reset: float = 0.0
    disconnect: float = 0.0
    delay_s: float = 0.05
    stall_s: float = 0.1
    disconnect_at: float = math.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "disconnect_at" and value == math.inf:
                continue
            most = {"disconnect_at": math.inf} | dict.fromkeys(_SECONDS, _LONGEST_S)
            require_real(field.name, value, least=0.0, most=most.get(field.name, 1.0))

    @staticmethod
    def parse(text: str) -> FaultScript:
        """Return the script that a text states; an empty one has no fault.

        >>> FaultScript.parse("drops=0.01")
        Traceback (most recent call last):
        ValueError: faults must be of drop, corrupt, duplicate, delay, stall, reset, disconnect,
        delay_s, stall_s, disconnect_at, each once as name=number; got 'drops=0.01'
        """
        known = [field.name for field in fields(FaultScript)]
        values: dict[str, float] = {}
        for part in filter(None, (part.strip() for part in text.split(","))):
            name, _, number = part.partition("=")
            try:
                value = float(number)
            except ValueError:
                value = math.nan
            if name not in known or name in values or math.isnan(value):
                raise ValueError(
                    f"faults must be of {', '.join(known)}, each once as name=number; got {part!r}"
                )
            values[name] = value
        return FaultScript(**values)


class Faults:
    """A script at work.

    The script may be changed at any time.

    >>> faults = Faults(FaultScript(drop=1.0), np.random.default_rng(1))
    >>> faults.passed(b"abc")
    [(0.0, b'')]
    """

    def __init__(self, script: FaultScript, rng: np.random.Generator) -> None:
        self.script = script
        self._rng = rng
        self._room: float = script.disconnect_at

    def passed(self, data: bytes) -> list[tuple[float, bytes]]:
        """Return what comes out of the line for a frame put into it: pieces and their delays."""
        script = self.script
        if self._room < len(data):
            data = data[: int(self._room)]
        self._room -= len(data)
        copies = 1 + (self._rng.random() < script.duplicate)
        pieces = []
        for _ in range(copies):
            late = self._rng.random() < script.delay
            delay_s = float(self._rng.random()) * script.delay_s if late else 0.0
            pieces.append((delay_s, self._damaged(data)))
        return pieces

    def cut_off(self) -> bool:
        """Tell, once, that the line has carried as many bytes as it was to carry."""
        if self._room > 0:
            return False
        self._room = math.inf
        return True

    def arrived(self) -> Mishap:
        """Return what happens to the device when something arrives."""
        for mishap, probability in (
            (Mishap.RESET, self.script.reset),
            (Mishap.DISCONNECT, self.script.disconnect),
            (Mishap.STALL, self.script.stall),
        ):
            if self._rng.random() < probability:
                return mishap
        return Mishap.NONE

    def stall_s(self) -> float:
        """Return how long a stall lasts."""
        return float(self._rng.random()) * self.script.stall_s

    def _damaged(self, data: bytes) -> bytes:
        script = self.script
        if not (script.drop or script.corrupt):
            return data
        octets = np.frombuffer(data, dtype=np.uint8).copy()
        hit = self._rng.random(octets.size) < script.corrupt
        octets[hit] ^= self._rng.integers(1, 256, size=int(hit.sum()), dtype=np.uint8)
        return octets[self._rng.random(octets.size) >= script.drop].tobytes()


_Pieces = list[tuple[float, int, bytes]]


class BadLine:
    """A `lines.Line` that is in the way of another one.

    What arrives together is a frame; `restart` restarts what is at the end of the line.
    """

    def __init__(
        self, line: Line, faults: Faults, clock: Clock, *, restart: Callable[[], object]
    ) -> None:
        self.name = line.name
        self._line = line
        self._faults = faults
        self._clock = clock
        self._restart = restart
        self._inbox: _Pieces = []
        self._outbox: _Pieces = []
        self._pieces = 0

    def read(self, timeout_s: float) -> bytes | None:
        """Return what has come through; None where the host is gone."""
        data = self._line.read(timeout_s)
        if data and not self._survives():
            data = None
        if data:
            self._put(data, self._inbox)
        for piece in self._due(self._outbox):
            self._line.write(piece)
        if data is None or self._faults.cut_off():
            self.drop()
            return None
        return b"".join(self._due(self._inbox))

    def write(self, data: bytes) -> None:
        """Send bytes that come through at once, later, damaged or not at all."""
        self._put(data, self._outbox)
        for piece in self._due(self._outbox):
            self._line.write(piece)

    def drop(self) -> None:
        """Lose the host, and what is on the line."""
        self._line.drop()
        self._inbox.clear()
        self._outbox.clear()

    def close(self) -> None:
        """Give the port back."""
        self._line.close()

    def _survives(self) -> bool:
        """Tell whether what arrives finds the line and the device as they were."""
        mishap = self._faults.arrived()
        if mishap is Mishap.STALL:
            self._clock.wait(self._faults.stall_s())
        if mishap is Mishap.RESET:
            self._restart()
        return mishap in {Mishap.NONE, Mishap.STALL}

    def _put(self, data: bytes, box: _Pieces) -> None:
        for delay_s, piece in self._faults.passed(data):
            self._pieces += 1
            heapq.heappush(box, (self._clock.now_s() + delay_s, self._pieces, piece))

    def _due(self, box: _Pieces) -> list[bytes]:
        """Take the pieces whose time has come."""
        pieces = []
        while box and box[0][0] <= self._clock.now_s():
            pieces.append(heapq.heappop(box)[2])
        return pieces
