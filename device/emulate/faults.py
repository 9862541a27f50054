"""What can go wrong on a line and behind it, drawn from a seed: for emulators and tests.

A script is a list of faults, `name=value` with commas between: ``drop=0.01,corrupt=0.01``.
"""

from __future__ import annotations

import heapq
import math
import re
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from device.checks import require_real

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.emulate.lines import Line

_SECONDS: Final = ("delay_s", "stall_s")
_MAX_S: Final = 86_400.0
_FRAME: Final = re.compile(rb"\0*[^\0]+\0?|\0+")
"""What faults may happen to, one by one: bytes up to the delimiter that ends a frame."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultScript:
    """How often each fault happens.

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
            maximum = {"disconnect_at": math.inf} | dict.fromkeys(_SECONDS, _MAX_S)
            require_real(field.name, value, minimum=0.0, maximum=maximum.get(field.name, 1.0))

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the script that a text states; an empty one has no fault.

        >>> FaultScript.parse("drops=0.01")
        Traceback (most recent call last):
        ValueError: faults must be of drop, corrupt, duplicate, delay, stall, reset, disconnect,
        delay_s, stall_s, disconnect_at, each once as name=value; got 'drops=0.01'
        """
        return cls(**parse_settings("faults", text, cls))


def parse_settings(subject: str, text: str, settings: type) -> dict[str, Any]:
    """Return the fields of a dataclass that a text states, as name=value with commas between.

    What is no number is returned as it is, for the dataclass to refuse or take.

    >>> parse_settings("faults", "drop=0.01,delay_s=soon", FaultScript)
    {'drop': 0.01, 'delay_s': 'soon'}
    """
    names = [field.name for field in fields(settings)]
    values: dict[str, Any] = {}
    for setting in filter(None, map(str.strip, text.split(","))):
        name, _, value = setting.partition("=")
        if name not in names or name in values:
            rule = f"of {', '.join(names)}, each once as name=value"
            raise ValueError(f"{subject} must be {rule}; got {setting!r}")
        try:
            values[name] = float(value)
        except ValueError:
            values[name] = value
    return values


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
        """Return, once, whether the line has carried the bytes after which it fails."""
        if self._room > 0:
            return False
        self._room = math.inf
        return True

    def arrived(self) -> str | None:
        """Return what happens to the device when something arrives: reset, disconnect or stall."""
        names = ("reset", "disconnect", "stall")
        return next(
            (name for name in names if self._rng.random() < getattr(self.script, name)), None
        )

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


class _Wire:
    """One direction of a line: pieces under way, each with the time of its arrival."""

    def __init__(self, faults: Faults, clock: Clock, byte_s: float) -> None:
        self._faults = faults
        self._clock = clock
        self._byte_s = byte_s
        self._free_s = 0.0
        self._n_pieces = 0
        self._pieces: list[tuple[float, int, bytes]] = []

    @property
    def due_s(self) -> float:
        """When the next piece arrives; infinite if there is none."""
        return self._pieces[0][0] if self._pieces else math.inf

    def put(self, data: bytes) -> None:
        """Send bytes; each frame among them may be damaged, delayed, doubled or lost."""
        for frame in _FRAME.findall(data):
            for delay_s, piece in self._faults.passed(frame):
                self._free_s = max(self._clock.now_s(), self._free_s) + len(piece) * self._byte_s
                self._n_pieces += 1
                heapq.heappush(self._pieces, (self._free_s + delay_s, self._n_pieces, piece))

    def take(self) -> bytes | None:
        """Return the next piece whose time has come; None if there is none."""
        return heapq.heappop(self._pieces)[2] if self.due_s <= self._clock.now_s() else None

    def clear(self) -> None:
        """Lose what is under way."""
        self._pieces.clear()


class FaultyLine:
    """A `lines.Line` in the way of another one: with a rate, and with faults.

    Parameters
    ----------
    line : Line
        The line to the host.
    faults : Faults
        What goes wrong.
    clock : Clock
        By which pieces arrive.
    on_reset : callable
        Restarts what is at the device's end of the line.
    byte_s : float
        Seconds that one byte takes on the wire.
    """

    def __init__(
        self,
        line: Line,
        faults: Faults,
        clock: Clock,
        *,
        on_reset: Callable[[], object],
        byte_s: float = 0.0,
    ) -> None:
        self.name = line.name
        self._line = line
        self._faults = faults
        self._clock = clock
        self._on_reset = on_reset
        self._inbound = _Wire(faults, clock, byte_s)
        self._outbound = _Wire(faults, clock, byte_s)

    @property
    def due_in_s(self) -> float:
        """Seconds until a piece arrives at either end; infinite if there is none."""
        return max(0.0, min(self._inbound.due_s, self._outbound.due_s) - self._clock.now_s())

    def read(self, timeout_s: float) -> bytes | None:
        """Return the next piece that has come through; None if the host is gone."""
        data = self._line.read(timeout_s)
        if data is None:
            self._clear()
            return None
        if data and self._survives():
            self._inbound.put(data)
        self._send_due()
        if self._faults.cut_off():
            self.drop()
            return None
        return self._inbound.take() or b""

    def write(self, data: bytes) -> None:
        """Send bytes that come through at once, later, damaged or not at all."""
        self._outbound.put(data)
        self._send_due()

    def drop(self) -> None:
        """Lose the host, and what is on the line."""
        self._line.drop()
        self._clear()

    def close(self) -> None:
        """Give the port back."""
        self._line.close()

    def _survives(self) -> bool:
        """Return whether what arrives finds the line and the device as they were."""
        fault = self._faults.arrived()
        if fault == "stall":
            self._clock.wait(self._faults.stall_s())
        elif fault == "reset":
            self._clear()
            self._on_reset()
        elif fault == "disconnect":
            self.drop()
        return fault in {None, "stall"}

    def _send_due(self) -> None:
        while (piece := self._outbound.take()) is not None:
            self._line.write(piece)

    def _clear(self) -> None:
        self._inbound.clear()
        self._outbound.clear()
