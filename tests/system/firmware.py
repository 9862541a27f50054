"""The firmware in C behind a pipe (firmware/check/server.c): asked at any device time."""

from __future__ import annotations

import shutil
import struct
import subprocess
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, NamedTuple, Self

from tests.processes import require

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

FIRMWARE: Final = Path(__file__).parents[2] / "firmware"

_RECORD = struct.Struct("<cQH")
_SIZE = struct.Struct("<I")
_BURST = struct.Struct("<QQQIIBI3x")
READING = struct.Struct("<BBIIIIHH")


def require_tools(*tools: str) -> None:
    """Skip a test, or fail it where the firmware is required, if a tool is missing."""
    require("firmware", [tool for tool in tools if shutil.which(tool) is None])


def make(folder: Path, target: str, *, sanitize: bool = False, **limits: int) -> Path:
    """Make a target of firmware/Makefile in a folder, with limits of firmware/hal/limits.h."""
    subprocess.run(making(folder, target, sanitize=sanitize, **limits), check=True)
    return folder


def making(folder: Path, target: str, *, sanitize: bool = False, **limits: int) -> list[str]:
    """Return the command that makes a target."""
    defines = " ".join(f"-D{name}={value}U" for name, value in limits.items())
    command = ["make", "--silent", "-C", str(FIRMWARE), f"BUILD={folder}", f"DEFINES={defines}"]
    return [*command, *(["SANITIZE=1"] if sanitize else []), target]


def limits_of(device: Mapping[str, Any]) -> dict[str, int]:
    """Return what is compiled in for a device of tests/test_device/golden_frames.json."""
    names = (
        *("least_interval_us", "max_duty_ppm", "dc_tolerance_ppm", "longest_time_to_live_us"),
        *("slots", "memory_samples", "data_window", "longest_waveform", "bits"),
    )
    ceiling_mvpp = round(1000 * device["ceiling_vpp"])
    return {name.upper(): device[name] for name in names} | {"CEILING_MVPP": ceiling_mvpp}


class LastBurst(NamedTuple):
    """The last burst: when, how loud, and a checksum of what the converter was given."""

    token: int
    start_us: int
    duration_us: int
    left_mvpp: int
    right_mvpp: int
    cut: int
    crc: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What the firmware answered: frames, text, and its last burst."""

    frames: bytes
    text: bytes
    burst: LastBurst


class Server:
    """A process of firmware/check/server.c."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        self._to, self._from = _pipe(self._process.stdin), _pipe(self._process.stdout)
        self._asked = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._to.close()
        assert self._process.wait() == 0
        self._from.close()

    def switch_on(self, device: Mapping[str, Any]) -> None:
        """Begin a power cycle of a device as tests/test_device/golden_frames.json describes one."""
        names = (device[name].encode() for name in ("model", "serial_number", "firmware"))
        rate_mhz = round(1000 * device["sample_rate_hz"])
        numbers = device["boot_id"], rate_mhz, device["entropy"], device["emulated"]
        about = struct.pack("<16s16s32sQIBB", *names, *numbers)
        self._put(b"B", 0, about)

    def receive(self, now_us: int, octets: bytes) -> None:
        self._ask(b"R", now_us, octets)

    def hang_up(self, now_us: int) -> None:
        self._ask(b"H", now_us, b"")

    def sense(self, now_us: int, known: int, set_bits: int) -> None:
        self._ask(b"S", now_us, bytes((known, set_bits)))

    def read_from_now_on(self, now_us: int, reading: Sequence[int] | None) -> None:
        """Have a monitor see this of every burst that ends: MEASURED without its token."""
        self._ask(b"M", now_us, b"" if reading is None else READING.pack(*reading))

    def told(self) -> list[Told]:
        """Return the answers to all that was asked since the last call."""
        self._put(b"F", 0, b"")
        self._to.flush()
        told = [self._next() for _ in range(self._asked)]
        self._asked = 0
        return told

    def _next(self) -> Told:
        frames, text = self._sized(), self._sized()
        return Told(
            frames=frames, text=text, burst=LastBurst(*_BURST.unpack(self._read(_BURST.size)))
        )

    def _sized(self) -> bytes:
        (size,) = _SIZE.unpack(self._read(_SIZE.size))
        return self._read(size)

    def _read(self, size: int) -> bytes:
        octets = self._from.read(size)
        if len(octets) < size:
            raise RuntimeError(f"the firmware ended with {self._process.wait()}")
        return octets

    def _ask(self, operation: bytes, now_us: int, octets: bytes) -> None:
        self._put(operation, now_us, octets)
        self._asked += 1

    def _put(self, operation: bytes, now_us: int, octets: bytes) -> None:
        self._to.write(_RECORD.pack(operation, now_us, len(octets)) + octets)


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


@contextmanager
def running(*command: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Have a firmware run: its process and its port."""
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()
