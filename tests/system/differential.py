"""The same inputs for the core in Python and for the firmware in C, drawn from a seed.

Inputs are what a host, a bad line and an amplifier do: most questions are what a host would ask
next, for only these come far.

`python -m tests.system.differential LIBRARY FIRST COUNT` compares COUNT power cycles from the seed
FIRST on; the library is compiled with the limits of `make_small_library`.
"""

from __future__ import annotations

import math
import re
import struct
import sys
import time
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import numpy as np
from cobs import cobs

from device import Emission, Health
from device.emulate.firmware import FirmwareLibrary
from tests.system.firmware import firmware_device, limits_of, make, require_tools
from tests.test_device.golden import Reader, device_of, measurement_of
from tests.test_device.wire import fields_of, question, upload_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from device.emulate.firmware import FirmwareEndpoint
    from device.wire.endpoint import Endpoint

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
        self._pauses_us: list[int] = []
        self._n_samples = {0: 1, 1: 1}
        self._device = device
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
        return self._rng.bytes(size)

    def next(self) -> tuple[str, int, bytes]:
        """Return an operation, its device time and its bytes."""
        self._now_us += self._pause_us()
        if self._waiting or not self._one_in(40):
            return "R", self._now_us, self._on_the_line(self._question())
        operation, some = self._of("HSSSM"), b""
        if operation == "S":
            some = bytes((self._below(8), self._below(8) & self._below(8)))
        elif operation == "M" and not self._one_in(3):
            some = bytes((1,)) + self._some(20)
        return operation, self._now_us, some

    def _pause_us(self) -> int:
        """Return the time from the last input to the next."""
        if self._waiting and self._pauses_us:
            return self._pauses_us.pop(0)
        return self._of(SHORT_US if self._waiting else PAUSES_US)

    def _question(self) -> bytes:
        if self._last and self._one_in(15):
            self._pauses_us.clear()
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
            "levels_mvpp": lambda: tuple(
                self._of(LEVELS_MVPP) for _ in range(self._of((*(2,) * 20, 0, 1, 3, 22)))
            ),
        }
        return draw[name]()

    def _upload(self) -> None:
        """Have a waveform sent next, in pieces: most are good."""
        n_samples = self._of((1, 2, 8, 16, 25, 39, 40))
        number, slot = (self._number + 1) & 0xFFFF, self._of((0, 0, 1, 1, 2))
        codes = np.stack([self._waveform(n_samples), self._waveform(n_samples)])
        octets, data = upload_of(codes, number)
        pieces = [
            ("DATA", {"upload": number, "offset": piece.offset, "octets": piece.octets})
            for piece in data
        ]
        if self._one_in(3):
            pieces.reverse()
        if self._one_in(10):
            pieces.pop()
        begin = ("BEGIN", {"slot": slot, "samples": n_samples})
        self._n_samples[slot] = n_samples
        self._waiting = [begin, *pieces, ("COMMIT", {"slot": slot, "crc": zlib.crc32(octets)})]

    def _play(self) -> None:
        """Have two bursts played next, the second when the rest of the first ends, or 1 us off."""
        level = self._of((0, 1, 75_000, 75_000, 149_999))
        self._waiting = [("LEVEL", {"levels_mvpp": (level, level)}), ("OUTPUT", {})]
        slot = self._of((0, 1))
        duration_us = math.ceil(1e6 * self._n_samples[slot] / self._device["sample_rate_hz"])
        rest_us = self._of(
            (
                self._device["least_interval_us"],
                math.ceil(1e6 * duration_us / self._device["max_duty_ppm"]) - duration_us,
            )
        )
        self._pauses_us = [0, 0, 0, duration_us, max(0, rest_us + self._of((-1, 0, 1)))]
        for _ in range(2):
            self._token += 1
            armed = {"token": self._token, "slot": slot, "time_to_live_us": 5_000}
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
        if not self._one_in(20):
            return frame
        at, noise = self._below(len(frame)), self._some(self._below(130))
        changed = (
            *(frame[:at] + noise[:2] + frame[at + 1 :], frame + frame, frame[:at]),
            *(noise + frame, frame + self._of(TYPED)),
        )
        return self._of(changed)


_READING: Final = struct.Struct("<BIIIIHH")
"""MEASURED without its token."""
_PIECE: Final = re.compile(rb"[^\0]*\0?")
"""Bytes up to a delimiter, which complete a frame or a line of text, but not both."""


class Device:
    """A core, in Python or in C, behind the operations of a `Host`."""

    def __init__(self, make_device: Callable[[Reader, Callable[[Emission], None]], Any]) -> None:
        self._reader = Reader()
        self._emissions: list[Emission] = []
        self._endpoint: Endpoint | FirmwareEndpoint = make_device(
            self._reader, self._emissions.append
        )

    def take(self, operation: str, now_us: int, octets: bytes) -> list[bytes]:
        """Return the answer to each piece of what arrives."""
        self._endpoint.core.advance(now_us)
        if operation == "R":
            pieces = filter(None, _PIECE.findall(octets))
            return [self._endpoint.receive(now_us, piece) for piece in pieces]
        if operation == "H":
            self._endpoint.hang_up(now_us)
        elif operation == "S":
            health = Health.of_bits(reported_bits=octets[0], set_bits=octets[1])
            self._endpoint.core.sense(now_us, health)
        else:
            reading = measurement_of(_READING.unpack(octets)) if octets else None
            self._reader.reading = reading
        return []

    def output(self) -> tuple[Any, ...]:
        """Return the state, the burst that plays, and those that ended since the last call."""
        ended = [emission_facts(emission) for emission in self._emissions]
        self._emissions.clear()
        return (
            self._endpoint.core.state,
            emission_facts(self._endpoint.core.playing),
            ended,
        )


def emission_facts(burst: Emission | None) -> tuple[Any, ...]:
    """Return a burst as a value that can be compared, to the last bit of each sample."""
    if burst is None:
        return ()
    return (
        burst.token,
        burst.start_us,
        burst.cut_us,
        burst.levels_vpp,
        burst.volts.tobytes(),
    )


def make_small_library(folder: Path, *, sanitize: str = "") -> Path:
    """Compile the firmware with the limits that `compare` needs; return the library."""
    require_tools("gcc", "make")
    limits = limits_of(DEVICE) | {"HISTORY": HISTORY}
    return make(folder, "library", sanitize=sanitize, **limits) / "firmware.so"


def compare(library: FirmwareLibrary, seed: int, steps: int = STEPS) -> set[tuple[int, int]]:
    """Give both cores one power cycle; return the types of questions with their refusals.

    Raises AssertionError with the seed and the number of the input where they differ.
    """
    host = Host(seed, DEVICE)
    rail_v = DEVICE["ceiling_vpp"] / 2
    reference = Device(lambda *ends: device_of(DEVICE, *ends, history=HISTORY, rail_v=rail_v))
    firmware = Device(lambda *ends: firmware_device(library, DEVICE, *ends))
    met = set()
    for number in range(steps):
        operation, now_us, octets = host.next()
        expected = reference.take(operation, now_us, octets), reference.output()
        got = firmware.take(operation, now_us, octets), firmware.output()
        where = f"seed {seed}, input {number}: {operation} at {now_us} us: {octets.hex(' ')}"
        assert got == expected, f"{where}\n C: {got}\nPy: {expected}"
        for answer in got[0]:
            if answer.startswith(b"\0"):
                body = cobs.decode(answer.split(b"\0", 2)[1])
                met.add((body[1] - 0x80, body[4]))
    return met


def main(path: str, first: int, count: int) -> None:
    """Compare power cycles; print the number of inputs and the seconds, every 100 cycles."""
    library, began_s = FirmwareLibrary(Path(path)), time.monotonic()
    for number in range(1, count + 1):
        compare(library, first + number - 1)
        if number % 100 == 0 or number == count:
            print(number * STEPS, round(time.monotonic() - began_s), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
