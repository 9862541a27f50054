"""A generator on a socket that does not say that it is emulated."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import device.emulate.generator
from device.emulate.generator import GeneratorEmulator
from device.emulate.lines import TcpLine

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


class RealGenerator:
    """A generator that does not say that it is emulated, and keeps what it was sent."""

    def __init__(self, truth: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(
            device.emulate.generator, "IDENTITY", "Keysight Technologies,33512B,MY01,1.0"
        )
        self.line = TcpLine(0)
        self.port = self.line.name
        self.received = b""
        self._read = self.line.read
        monkeypatch.setattr(self.line, "read", self._keep)
        self._over = threading.Event()
        self.truth = truth
        self._file = truth.open("w", encoding="utf-8")
        self._emulator = GeneratorEmulator(self.line, self._file, amplifier_gain=27.5)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _keep(self, timeout_s: float) -> bytes | None:
        data = self._read(timeout_s)
        self.received += data or b""
        return data

    def _serve(self) -> None:
        while not self._over.is_set():
            self._emulator.turn()

    def end(self) -> None:
        self._over.set()
        self._thread.join()
        self.line.close()
        self._file.close()
