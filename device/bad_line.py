"""A line on which a fault script works, for emulators that only know bytes."""

import heapq
from collections.abc import Callable

from device.clock import Clock
from device.faults import Faults, Mishap
from device.lines import Line

_Pieces = list[tuple[float, int, bytes]]


class BadLine:
    """A `lines.Line` that is in the way of another one.

    Parameters
    ----------
    line : Line
        The good one.
    faults : Faults
        What goes wrong on it; what arrives together is a frame.
    clock : Clock
        The machine's.
    restart : callable
        Restarts what is at the end of the line.

    Examples
    --------
    >>> import numpy as np
    >>> from device.clock import MonotonicClock
    >>> from device.faults import FaultScript
    >>> from device.lines import PtyLine
    >>> faults = Faults(FaultScript(drop=0.01), np.random.default_rng(1))
    >>> line = BadLine(PtyLine(), faults, MonotonicClock(), restart=lambda: None)
    >>> line.read(0.0) is None
    True
    >>> line.close()
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
