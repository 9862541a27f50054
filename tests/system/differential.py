"""The same inputs for the core in Python and for the firmware in C, drawn from a seed.

Inputs are what a host, a bad line and an amplifier do: most questions are what a host would ask
next, for only these come far.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
from cobs import cobs

from device import Emission, Health
from tests.system.firmware import READING, LastBurst, Server, limits_of, make, require_tools
from tests.test_device.golden import Reader, device_of, measurement_of
from tests.test_device.wire import fields_of, question, upload_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

_One = TypeVar("_One")

DEVICE: Final[dict[str, Any]] = {
    "model": "sixteen letters!",
    "serial_number": "7",
    "boot_id": 0x0102030405060708,
    "sample_rate_hz": 44_100.0,
    "bits": 16,
    "ceiling_vpp": 150.0,
    "longest_waveform": 40,
    "emulated": True,
    "slots": 3,
    "memory_samples": 70,
    "least_interval_us": 300,
    "max_duty_ppm": 333_333,
    "dc_tolerance_ppm": 20_000,
    "longest_time_to_live_us": 600_000,
    "data_window": 8,
    "entropy": 1,
    "firmware": "compared",
}
"""Small, so that its limits are met often."""
HISTORY: Final = 3
"""Tokens remembered: so few that they are forgotten often."""
STEPS: Final = 250
"""Inputs to one power cycle."""

WEIGHTS: Final = {
    "HELLO": 1,
    "PING": 1,
    "LIMITS": 1,
    "HEALTH": 3,
    "BEGIN": 2,
    "DATA": 3,
    "COMMIT": 2,
    "LEVEL": 8,
    "OUTPUT": 12,
    "ARM": 22,
    "DISARM": 4,
    "FIRE": 24,
    "QUERY": 8,
    "MEASURED": 5,
    "STOP": 1,
    "BEAT": 22,
}
"""How often which question is asked."""
KINDS: Final = tuple(kind for kind, weight in WEIGHTS.items() for _ in range(weight))
PAUSES_US: Final = (
    *(0, 0, 1, 7, 50, 299, 300, 301, 900, 1810, 2721, 30_000, 100_000, 499_999, 500_000),
)
SHORT_US: Final = (0, 0, 0, 1, 50, 300, 900)
LEVELS_MVPP: Final = (0, 1, 75_000, 149_999, 150_000, 150_001, 151_000, 300_000, 2**32 - 1)
LIVES_US: Final = (0, 1, 50, 5_000, 400_000, 600_000, 600_001, 2**32 - 1)
TYPED: Final = (b"*IDN?\r X\n", b"*IDN?\r\n", b"*IDN? \t\v\f\r\n", b"\n*IDN?\nx\n*I")


class Host:
    """Draws what happens next: the operation, its time and its bytes."""

    def __init__(self, seed: int, device: Mapping[str, Any]) -> None:
        self._rng = np.random.default_rng(seed)
        self._words: list[int] = []
        self._boot_id = device["boot_id"]
        self._now_us = 0
        self._number = self._below(0x10000)
        self._token = 1
        self._waiting: list[tuple[str, dict[str, Any]]] = []
        self._last = b""
        self._upload()

    def _below(self, limit: int) -> int:
        if not self._words:
            self._words = self._rng.integers(0, 2**62, 512).tolist()
        return self._words.pop() % limit

    def _one_in(self, many: int) -> bool:
        return self._below(many) == 0

    def _of(self, some: Sequence[_One]) -> _One:
        return some[self._below(len(some))]

    def _some(self, size: int) -> bytes:
        return bytes(self._below(256) for _ in range(size))

    def next(self) -> tuple[str, int, bytes]:
        """Return an operation, its device time and its bytes."""
        self._now_us += self._of(SHORT_US if self._waiting else PAUSES_US)
        if self._waiting or not self._one_in(40):
            return "R", self._now_us, self._on_the_line(self._question())
        operation, some = self._of("HSSSM"), b""
        if operation == "S":
            some = bytes((self._below(8), self._below(8) & self._below(8)))
        elif operation == "M" and not self._one_in(3):
            some = bytes((1, 1)) + self._some(20)
        return operation, self._now_us, some

    def _question(self) -> bytes:
        if self._last and self._one_in(15):
            return self._last  # the same again: its answer was lost
        if not self._waiting:
            if self._one_in(15):
                self._upload()
            elif self._one_in(8):
                self._play()
            else:
                kind = self._of(KINDS)
                self._waiting = [(kind, {name: self._field(name) for name in fields_of(kind)})]
        kind, fields = self._waiting.pop(0)
        if kind not in {"DATA", "BEAT"}:
            self._number = (self._number + self._of((*(1,) * 50, 2, 0x7FFF))) & 0xFFFF
        old = self._of((0, 0xFFFF, 0x8000, 0x8001)) if self._one_in(20) else 0
        boot_id = self._below(2**62) if self._one_in(60) else self._boot_id
        number = (self._number + old) & 0xFFFF
        self._last = question(kind, number, boot_id=boot_id, **fields)
        return self._last

    def _field(self, name: str) -> Any:
        """Return a value of a field: mostly one that comes far, or one at a limit."""
        if name == "token":
            self._token += self._of((0, 0, 1))
            return max(1, self._token - self._of((0, 0, 0, 0, 1, 2, 3, 8, 15)))
        draw: dict[str, Callable[[], Any]] = {
            "slot": lambda: self._of((0, 0, 0, 1, 1, 2, 3)),
            "time_to_live_us": lambda: self._of(LIVES_US),
            "samples": lambda: self._of((0, 1, 4, 40, 41)),
            "upload": lambda: self._number,
            "offset": lambda: 32 * self._below(3),
            "octets": lambda: self._some(self._of((32, 16, 4))),
            "crc": lambda: 0,
            "nonce": lambda: self._of((0, 1, self._below(2**62))),
        }
        return draw[name]() if name in draw else self._of(LEVELS_MVPP)

    def _upload(self) -> None:
        """Have a waveform sent next, in pieces: most are good."""
        n_samples = self._of((1, 2, 8, 16, 25, 39, 40))
        number, slot = (self._number + 1) & 0xFFFF, self._of((0, 0, 1, 1, 2))
        rows = self._waveform(n_samples), self._waveform(n_samples)
        octets, data = upload_of(*rows, number)
        pieces = [
            ("DATA", {"upload": number, "offset": piece.offset, "octets": piece.octets})
            for piece in data
        ]
        if self._one_in(3):
            pieces.reverse()
        if self._one_in(10):
            pieces.pop()
        begin = ("BEGIN", {"slot": slot, "samples": n_samples})
        self._waiting = [begin, *pieces, ("COMMIT", {"slot": slot, "crc": zlib.crc32(octets)})]

    def _play(self) -> None:
        """Have two bursts played next, as soon after each other as may be."""
        level = self._of((0, 1, 75_000, 75_000, 149_999))
        self._waiting = [("LEVEL", {"left_mvpp": level, "right_mvpp": level}), ("OUTPUT", {})]
        for _ in range(2):
            self._token += 1
            armed = {"token": self._token, "slot": self._of((0, 1)), "time_to_live_us": 5_000}
            self._waiting += [("ARM", armed), ("FIRE", {"token": self._token})]

    def _waveform(self, n_samples: int) -> Any:
        peak = self._of((0, 1, 100, 16_384, 32_767))
        codes = np.rint(peak * np.sin(np.arange(n_samples) * 2 * np.pi / max(1, n_samples - 1)))
        if n_samples > 4 and self._one_in(4):  # at the edge of what counts as DC
            codes[1 + self._below(n_samples - 2)] += self._of((-1, 1)) * (peak // 4)
        if self._one_in(12):
            codes[self._below(n_samples)] = self._of((1, -1, 32_767, -32_767, -32_768))
        return codes.clip(-32_768, 32_767).astype(np.int32)

    def _on_the_line(self, frame: bytes) -> bytes:
        """Return what arrives of a frame: with noise, twice, cut short, damaged; mostly itself."""
        at, noise = self._below(len(frame)), self._some(self._below(130))
        changed = (
            *(frame[:at] + noise[:2] + frame[at + 1 :], frame + frame, frame[:at]),
            *(noise + frame, frame + self._of(TYPED)),
        )
        return self._of(changed) if self._one_in(20) else frame


class Reference:
    """The core in Python behind the same operations."""

    def __init__(self, device: Mapping[str, Any]) -> None:
        self._reader = Reader()
        self._emitted: Emission | None = None
        self._crc = (0, 0)
        self._rail_v = device["ceiling_vpp"] / 2
        self._endpoint = device_of(
            device, self._reader, self._emit, history=HISTORY, rail_v=self._rail_v
        )
        self._core = self._endpoint.core

    def _emit(self, burst: Emission) -> None:
        self._emitted = burst

    def take(self, operation: str, now_us: int, some: bytes) -> tuple[bytes, LastBurst]:
        """Return what is answered, and the last burst."""
        answer = b""
        self._core.advance(now_us)  # as an emulator does, and server.c, whatever arrives
        if operation == "R":
            answer = self._endpoint.receive(now_us, some)
        elif operation == "H":
            self._endpoint.hang_up(now_us)
        elif operation == "S":
            self._core.sense(now_us, Health.of_bits(reported_bits=some[0], set_bits=some[1]))
        else:
            self._reader.reading = measurement_of(READING.unpack(some)) if some else None
        return answer, self._burst()

    def _burst(self) -> LastBurst:
        last = self._core._last
        if last is None:
            return LastBurst(0, 0, 0, 0, 0, 0, 0)
        if last.token != self._crc[0]:
            full = 2 ** (self._core.output.bits - 1) - 1
            volts = np.concatenate((last.left_v, last.right_v))
            steps = np.rint(volts * full / self._rail_v).astype("<i4")
            self._crc = last.token, zlib.crc32(steps.tobytes())
        ended = self._emitted
        cut = ended is not None and ended.token == last.token and ended.cut_us is not None
        levels = round(last.level_left_vpp * 1000), round(last.level_right_vpp * 1000)
        return LastBurst(
            last.token, last.start_us, last.duration_us, *levels, int(cut), self._crc[1]
        )


def small_server(folder: Path) -> Server:
    """Return the firmware with the limits that `compare` needs, with sanitizers."""
    require_tools("gcc", "make")
    make(folder, "server", sanitize=True, HISTORY=HISTORY, **limits_of(DEVICE))
    return Server(folder / "server")


def compare(server: Server, seed: int, steps: int = STEPS) -> set[tuple[int, int]]:
    """Give both one power cycle; return the types of questions with the refusals that were told.

    Raises AssertionError with the seed and the number of the input where they differ.
    """
    host, reference, script = Host(seed, DEVICE), Reference(DEVICE), []
    server.switch_on(DEVICE)
    for _ in range(steps):
        operation, now_us, some = host.next()
        script.append((operation, now_us, some, *reference.take(operation, now_us, some)))
        if operation == "M":
            server.read_from_now_on(now_us, READING.unpack(some) if some else None)
        elif operation == "S":
            server.sense(now_us, *some)
        elif operation == "H":
            server.hang_up(now_us)
        else:
            server.receive(now_us, some)
    met = set()
    for number, (step, told) in enumerate(zip(script, server.told(), strict=True)):
        operation, now_us, some, answer, burst = step
        where = f"seed {seed}, input {number}: {operation} at {now_us} us: {some.hex(' ')}"
        assert told.frames + told.text == answer, f"{where}\n C: {told}\nPy: {answer.hex(' ')}"
        assert told.burst == burst, f"{where}\n C: {told.burst}\nPy: {burst}"
        if told.frames:
            body = cobs.decode(told.frames.split(b"\0", 2)[1])
            met.add((body[1] - 0x80, body[4]))
    return met
