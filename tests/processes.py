"""Fixtures that start processes: emulators, commands to be killed, a sound server."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING, Final, TypeAlias

import numpy as np
import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Emulate: TypeAlias = Callable[..., tuple[str, Path, int]]

EMULATORS = """
import json, os, signal, sys
from dataclasses import replace
from pathlib import Path
import numpy as np
from device import Limits, MonotonicClock, OutputStage
from device.emulate.amplifier import Amplifier
from device.emulate.emulator import Emulator, Nature, Truth
from device.emulate.faults import Faults, FaultScript
from device.emulate.firmware import FirmwareLibrary
from device.emulate.lines import PtyLine, TcpLine

class OverloadedAmplifier(Amplifier):
    pulses = []
    def sensed_at(self, now_s):
        over = bool(self.pulses and self.pulses.pop())
        return replace(Amplifier.sensed_at(self, now_s), over_current=over)

signal.signal(signal.SIGCHLD, signal.SIG_IGN)
signal.signal(signal.SIGUSR1, lambda *_: OverloadedAmplifier.pulses.append(True))
for order in sys.stdin:
    wish = json.loads(order)
    if os.fork():
        continue
    os.setsid()
    nature = Nature(
        limits=Limits(ceiling_vpp=200.0, min_interval_s=wish["min_interval_s"]),
        output=OutputStage(sample_rate_hz=wish["sample_rate_hz"]),
        baud=wish["baud"],
        amplifier=OverloadedAmplifier(),
        firmware=FirmwareLibrary(Path(wish["firmware"])) if wish["firmware"] else None,
    )
    line = PtyLine() if wish["kind"] == "pty" else TcpLine(0)
    faults = Faults(FaultScript.parse(wish["faults"]), np.random.default_rng(wish["seed"]))
    with open(wish["truth"], "w", encoding="utf-8") as file:
        truth = Truth(file, volts=wish["volts"])
        emulator = Emulator(line, nature, faults, truth, MonotonicClock())
        print(json.dumps([line.name, os.getpid()]), flush=True)
        emulator.run()
    os._exit(0)
"""
"""A process that forks one emulator for each line it reads: starting Python each time is slow.

SIGUSR1 overloads an emulator's amplifier for a moment.
"""

USUAL_EMULATOR: dict[str, object] = {
    "faults": "",
    "seed": 1,
    "baud": None,
    "volts": False,
    "sample_rate_hz": 48_000.0,
    "min_interval_s": 0.005,
    "firmware": None,
}

HALT_AT = """
import os, sys, time
from pathlib import Path
steps, calls = int(sys.argv[1]), 0
def counted(function):
    def call(*args, **kwargs):
        global calls
        calls += 1
        if calls == steps:
            print("halted", flush=True)
            time.sleep(600)
        return function(*args, **kwargs)
    return call
from tactstrip import main
for name in ("unlink", "rmdir", "fsync", "mkdir"):
    setattr(os, name, counted(getattr(os, name)))
for name in ("replace", "rename"):
    setattr(Path, name, counted(getattr(Path, name)))
try:
    main(sys.argv[2:])
finally:
    print("calls", calls, flush=True)
"""
"""A command that halts before its n-th change of the disk."""


@pytest.fixture
def kill_at() -> Callable[..., int | None]:
    """Run a command, killed before its n-th change of the disk; returns how many, if it ended."""

    def run(step: int, *arguments: str, typed: str = "") -> int | None:
        with subprocess.Popen(
            [sys.executable, "-c", HALT_AT, str(step), *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        ) as process:
            _pipe(process.stdin).write(typed)
            _pipe(process.stdin).flush()
            for line in _pipe(process.stdout):
                if line == "halted\n":
                    process.kill()
                    return None
                if line.startswith("calls "):
                    return int(line.split()[1])
        raise AssertionError(arguments)

    return run


@pytest.fixture(scope="session")
def emulator_server() -> Iterator[subprocess.Popen[str]]:
    """A process that starts emulators."""
    command = [sys.executable, "-c", EMULATORS]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as server:
        yield server
        assert server.stdin is not None
        server.stdin.close()


@pytest.fixture
def emulate(emulator_server: subprocess.Popen[str], tmp_path: Path) -> Iterator[Emulate]:
    """Start an emulator behind a "pty" or "tcp" line: its port, truth file and process id."""
    pids: list[int] = []

    def start(kind: str, **wish: object) -> tuple[str, Path, int]:
        truth = tmp_path / f"truth-{len(pids)}.jsonl"
        wish = USUAL_EMULATOR | wish | {"kind": kind, "truth": str(truth)}
        print(json.dumps(wish), file=_pipe(emulator_server.stdin), flush=True)
        port, pid = json.loads(_pipe(emulator_server.stdout).readline())
        pids.append(pid)
        return port, truth, pid

    yield start
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def _pipe(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None
    return pipe


def require(area: str, missing: Iterable[str]) -> None:
    """Skip a test whose tools are missing, or fail it where TACTSTRIP_REQUIRED names its area.

    Areas are sound, browser, firmware and screen.
    """
    if names := ", ".join(missing):
        required = area in os.environ.get("TACTSTRIP_REQUIRED", "").split()
        (pytest.fail if required else pytest.skip)(f"not installed: {names}")


# The channels of a stream through ALSA's plugin have these names. A sink with others would get a
# mixture of them, as a sound server matches channels by their names.
_CHANNEL_NAMES: Final = (
    *("front-left", "front-right", "rear-left", "rear-right"),
    *("front-center", "lfe", "side-left", "side-right"),
    *(f"aux{i}" for i in range(24)),
)


class NullSink:
    """A PulseAudio server with a sink of 48 kHz and 16 bit, which records itself."""

    def __init__(self, folder: Path, channels: int = 2) -> None:
        self.socket = folder / "socket"
        self.channels = channels
        self._map = ",".join(_CHANNEL_NAMES[:channels])
        self._file = folder / "recording.raw"
        self._server: subprocess.Popen[bytes] | None = None
        self._recorder: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the server."""
        sink = "--load=module-null-sink sink_name=plate rate=48000 format=s16le"
        sink += f" channels={self.channels} channel_map={self._map}"
        line = f"--load=module-native-protocol-unix socket={self.socket} auth-anonymous=1"
        command = ["pulseaudio", "-n", "--daemonize=no", "--use-pid-file=no", "--disable-shm=yes"]
        command += ["--exit-idle-time=-1", sink, line]
        self._server = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        assert self.until(self.socket.exists)

    def listen(self) -> None:
        """Begin a new recording, in which there is something when this returns."""
        self._end(self._recorder)
        with self._file.open("wb") as out:
            command = ["parec", "--device=plate.monitor", "--raw", "--latency-msec=10"]
            command += ["--format=s16le", "--rate=48000", f"--channels={self.channels}"]
            command += [f"--channel-map={self._map}"]
            self._recorder = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL)
        assert self.until(lambda: self._file.stat().st_size > 0)

    def recorded(self) -> NDArray[np.int16]:
        """Return the frames recorded so far, shape (n, channels)."""
        raw, size = self._file.read_bytes(), 2 * self.channels
        frames: NDArray[np.int16] = np.frombuffer(raw[: len(raw) // size * size], dtype="<i2")
        return frames.reshape(-1, self.channels)

    def kill(self) -> None:
        """Kill the server."""
        self._end(self._server)
        self.socket.unlink(missing_ok=True)

    def freeze(self, *, on: bool) -> None:
        """Have the server stand still, or go on."""
        assert self._server is not None
        self._server.send_signal(signal.SIGSTOP if on else signal.SIGCONT)

    def close(self) -> None:
        """End the server and the recording."""
        self._end(self._recorder)
        self._end(self._server)

    @staticmethod
    def until(done: Callable[[], bool]) -> bool:
        """Wait until something is done, 20 s at most, and tell whether it is."""
        give_up_s = time.monotonic() + 20.0
        while not done() and time.monotonic() < give_up_s:
            time.sleep(0.02)
        return done()

    @staticmethod
    def _end(process: subprocess.Popen[bytes] | None) -> None:
        if process is not None:
            process.kill()
            process.wait()


def _sound_missing() -> list[str]:
    missing = [tool for tool in ("pulseaudio", "parec", "pactl") if shutil.which(tool) is None]
    try:
        import sounddevice  # noqa: F401 - looks for PortAudio when it is imported
    except (ImportError, OSError):
        missing.append("sounddevice with PortAudio")
    return missing


@pytest.fixture(scope="module")
def null_sink(tmp_path_factory: pytest.TempPathFactory) -> Iterator[NullSink]:
    """Real sound: PortAudio plays into a null sink, which can be listened to and killed."""
    with playing_into(NullSink(tmp_path_factory.mktemp("sound"))) as sink:
        yield sink


@pytest.fixture
def wide_sink(tmp_path: Path) -> Iterator[NullSink]:
    """A null sink with sixteen channels."""
    with playing_into(NullSink(tmp_path, channels=16)) as sink:
        yield sink


@contextmanager
def playing_into(sink: NullSink) -> Iterator[NullSink]:
    """Have PortAudio play into a sink, of this process and of those that it starts."""
    require("sound", _sound_missing())
    import sounddevice

    folder = sink.socket.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(folder))
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        patch.setenv("PULSE_SERVER", f"unix:{sink.socket}")
        try:
            sink.start()
            sounddevice._terminate()
            sounddevice._initialize()  # it lists the sound cards that there are now
            yield sink
        finally:
            sink.close()
