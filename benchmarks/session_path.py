"""`tactstrip run` with the way from the engine's decision to the wire and to the key timed.

``python -m benchmarks.session_path RESULT.json ARGUMENTS OF run``: a process of its own, because it
puts itself between the parts of a session.
"""

from __future__ import annotations

import json
import os
import stat
import sys
import threading
import time
from dataclasses import asdict, dataclass, field
from functools import partialmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from device.wire.channels import SerialChannel
from experiment.session.simulate import SimulatedResponder
from experiment.trial import engine, events
from tactstrip import main

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.trial.responder import AwaitedAnswer, Press

_COUNTERS = Path("/proc/self/io")
_OPENING = "open"


@dataclass(kw_only=True)
class Found:
    """What was found: times, and what happened to files between the stimuli and their answers.

    `opened` counts files, `written` calls of os.write and os.fsync on regular files; bytes are of
    the whole process, all threads, from the first stimulus on, and None where the system tells
    none.
    """

    arm_to_byte_s: list[float] = field(default_factory=list)
    fire_to_byte_s: list[float] = field(default_factory=list)
    awaited: int = 0
    opened: int = 0
    written_awaited: int = 0
    written_all: int = 0
    bytes_awaited: int | None = None
    bytes_all: int | None = None


class Probe:
    """Stands between engine, line and participant, and notes when each has its turn."""

    def __init__(self) -> None:
        self.found = Found()
        self._counters = os.open(_COUNTERS, os.O_RDONLY) if _COUNTERS.exists() else None
        self._arm_s = 0.0
        self._fire_s: float | None = None
        self._awaiting = False
        self._first = self._before = self.storage_bytes()
        self._bytes_awaited = 0

    def storage_bytes(self) -> int | None:
        """Return the bytes to and from storage so far, as the system counts them."""
        if self._counters is None:
            return None
        text = os.pread(self._counters, 1024, 0).decode()
        counts = dict(line.split(": ") for line in text.splitlines())
        return int(counts["read_bytes"]) + int(counts["write_bytes"])

    def step(
        self, state: events.SessionState, event: events.Input
    ) -> tuple[events.SessionState, tuple[events.Effect, ...]]:
        """Ask the engine; note when it has decided to arm or to fire."""
        after, effects = engine.step(state, event)
        now_s = time.perf_counter()
        if any(isinstance(effect, events.ArmStimulus) for effect in effects):
            self._arm_s = now_s
        if any(isinstance(effect, events.FireStimulus) for effect in effects):
            self._fire_s = now_s
        return after, effects

    def write(self, channel: SerialChannel, data: bytes) -> None:
        """Write to the line; note when the first byte after the decision to fire is on it."""
        _WRITE(channel, data)
        if self._fire_s is None or threading.current_thread() is not threading.main_thread():
            return
        now_s = time.perf_counter()
        self.found.fire_to_byte_s.append(now_s - self._fire_s)
        self.found.arm_to_byte_s.append(now_s - self._arm_s)
        self._fire_s = None
        self._before, self._awaiting = self.storage_bytes(), True
        if self.found.awaited == 0:
            self._first = self._before

    def ask(self, responder: SimulatedResponder, question: AwaitedAnswer) -> Press | None:
        """Have the participant answer; note what was read and written since the stimulus."""
        press = _ASK(responder, question)
        now = self.storage_bytes()
        self._awaiting = False
        self.found.awaited += 1
        if now is not None and self._before is not None:
            self._bytes_awaited += now - self._before
        return press

    def heed(self, event: str, _: tuple[object, ...]) -> None:
        """Count the files that are opened between a stimulus and its answer."""
        self.found.opened += event == _OPENING and self._awaiting

    def write_file(self, handle: int, data: bytes) -> int:
        """Write; count what goes to a file between a stimulus and its answer."""
        self._count_file(handle)
        return _WRITE_FILE(handle, data)

    def sync_file(self, handle: int) -> None:
        """Sync; likewise."""
        self._count_file(handle)
        _SYNC_FILE(handle)

    def _count_file(self, handle: int) -> None:
        if stat.S_ISREG(os.fstat(handle).st_mode):
            self.found.written_all += 1
            self.found.written_awaited += self._awaiting

    def finish(self) -> Found:
        """Return what was found."""
        now = self.storage_bytes()
        if now is not None and self._first is not None:
            self.found.bytes_all = now - self._first
            self.found.bytes_awaited = self._bytes_awaited
        return self.found


_WRITE, _ASK = SerialChannel.write, SimulatedResponder.ask
_WRITE_FILE, _SYNC_FILE = os.write, os.fsync


def _by(itself: Any, probe: Callable[[Any, Any], Any], asked: Any) -> Any:
    """Have a probe do what a method of an object does."""
    return probe(itself, asked)


def measure(arguments: list[str]) -> Found:
    """Run a session with these arguments of the command and return what was found."""
    probe = Probe()
    sys.addaudithook(probe.heed)
    with (
        patch("experiment.session.session.step", probe.step),
        patch("os.write", probe.write_file),
        patch("os.fsync", probe.sync_file),
        patch.object(SerialChannel, "write", partialmethod(_by, probe.write)),
        patch.object(SimulatedResponder, "ask", partialmethod(_by, probe.ask)),
    ):
        main(["run", *arguments], standalone_mode=False)
    return probe.finish()


if __name__ == "__main__":
    found = measure(sys.argv[2:])
    Path(sys.argv[1]).write_text(json.dumps(asdict(found)), encoding="utf-8")
