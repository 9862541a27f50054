"""Boards as they are on serial ports: slow to start, of another rate, or of another age."""

from __future__ import annotations

import io
import termios
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Final

import numpy as np

from device.clock import MonotonicClock
from device.core.output import OutputStage
from device.emulate.amplifier import Amplifier
from device.emulate.emulator import Emulator, Nature, Truth
from device.emulate.faults import Faults, FaultScript
from device.emulate.lines import PtyLine
from tests.test_device.trials import LIMITS

if TYPE_CHECKING:
    from collections.abc import Iterator

RATES: Final = {termios.B9600: 9600, termios.B115200: 115_200, termios.B1000000: 1_000_000}
TICK_S: Final = 0.002
WHOLE: Final = Amplifier()


class BoardPort(PtyLine):
    """A serial port of a board that starts anew whenever the port is opened.

    Where the host has set another rate than the board's, neither can read the other. A `baud` of
    None is that of a USB adapter which hides the board's from the host.
    """

    def __init__(self, *, baud: int | None, boots_for_s: float) -> None:
        super().__init__()
        self._baud = baud
        self._boots_for_s = boots_for_s
        self._ready_s: float | None = None

    def read(self, timeout_s: float) -> bytes | None:
        """Return what the board can make of what has arrived."""
        data = super().read(timeout_s)
        if data is None:
            self._ready_s = None
            return None
        if self._ready_s is None:
            self._ready_s = time.monotonic() + self._boots_for_s
        if time.monotonic() < self._ready_s:
            return b""
        return self._on_line(data)

    def write(self, data: bytes) -> None:
        """Send bytes."""
        super().write(self._on_line(data))

    def _on_line(self, data: bytes) -> bytes:
        host = RATES.get(termios.tcgetattr(self._ours)[4])
        garbled = self._baud is not None and host != self._baud
        return bytes(octet | 0x81 for octet in data) if garbled else data


@contextmanager
def board(
    *,
    baud: int = 1_000_000,
    boots_for_s: float = 0.0,
    hidden: bool = False,
    amplifier: Amplifier = WHOLE,
    script: str = "",
) -> Iterator[tuple[str, io.StringIO]]:
    """Have a board run in a thread: its port, and what it emitted."""
    port = BoardPort(baud=None if hidden else baud, boots_for_s=boots_for_s)
    nature = Nature(limits=LIMITS, output=OutputStage(), baud=baud, amplifier=amplifier)
    faults, truth = Faults(FaultScript.parse(script), np.random.default_rng(1)), io.StringIO()
    emulator = Emulator(port, nature, faults, Truth(truth), MonotonicClock())
    over = threading.Event()

    def run() -> None:
        while not over.is_set():
            emulator.turn(min(TICK_S, emulator.due_in_s))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield port.name, truth
    finally:
        over.set()
        thread.join()
        port.close()


@contextmanager
def says(answer: bytes) -> Iterator[str]:
    """Have something answer *IDN? with this, and nothing else: the port's name."""
    port, over = PtyLine(), threading.Event()

    def run() -> None:
        heard = b""
        while not over.is_set():
            heard = (heard + (port.read(TICK_S) or b""))[-100:]
            if b"*IDN?\n" in heard:
                heard = b""
                port.write(answer)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield port.name
    finally:
        over.set()
        thread.join()
        port.close()
