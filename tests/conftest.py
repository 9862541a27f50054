"""The lanes of the tests, and what several test files need."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from typing import IO, TYPE_CHECKING, TypeAlias

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Before numpy, as tactstrip.py does: beside other work more threads cost ten times the time."""

import numpy as np
import pytest
from hypothesis import settings

from experiment.study.read import study_from_text

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from experiment.study.study import Study

    Emulate: TypeAlias = Callable[..., tuple[str, Path, int]]

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("explore", deadline=None)
settings.load_profile("repeatable")
"""The same examples in every run; ``--hypothesis-profile=explore`` looks for new ones."""

FAST = "not slow and not process and not gallery and not firmware and not long"
"""The fast lane as pyproject.toml gives it to ``-m``; another ``-m`` on the command line wins."""
LANES = ("slow", "process", "gallery", "firmware", "long")
MOST_S = 2.0
"""Processor time of a test of the fast lane, which everybody runs all the time: four times the half
second that is asked, for a slow and busy machine must not fail what is well: servers of two
generations differed by a factor of 2.7."""
PROCESSES = {"emulator_server", "kill_at", "null_sink"}
"""Fixtures that start a process: whoever asks for one is in the lane ``process``."""
SLOW_DOCTESTS = {
    "check_study",
    "check_findings",
    "study_gains",
    "expected_error_db",
}
"""Examples worth their second: an example has no place for a marker."""
SPENT_S = pytest.StashKey[float]()
AGAIN = pytest.StashKey[bool]()
AGAIN_NAME = "slow once"


def pytest_configure(config: pytest.Config) -> None:
    """Watch the doctests of the packages too: a conftest's own hooks see only its folder."""
    config.pluginmanager.register(Lanes(), "lanes")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Run a file named on the command line whole: who names it wants to know all about it."""
    here = config.invocation_params.dir
    paths = {(here / argument.split("::")[0]).resolve() for argument in config.args}
    named = {path for path in paths if path.is_file()}
    if not named or config.option.markexpr != FAST:
        return
    config.option.markexpr = ""
    left_out = [item for item in items if item.path not in named and in_a_slower_lane(item)]
    items[:] = [item for item in items if item not in set(left_out)]
    config.hook.pytest_deselected(items=left_out)


def in_a_slower_lane(item: pytest.Item) -> bool:
    """Tell whether a marker keeps a test out of the fast lane."""
    return any(item.get_closest_marker(lane) is not None for lane in LANES)


class Lanes:
    """Puts tests in their lanes, and keeps the fast one fast.

    A test of it that takes too much processor time twice in a row fails. Once is forgiven: the
    first test to need a library pays for its import.
    """

    def pytest_itemcollected(self, item: pytest.Item) -> None:
        """Mark what cannot be marked where it stands."""
        if PROCESSES.intersection(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.process)
        if "null_sink" in getattr(item, "fixturenames", ()):  # of two sound servers each is late
            item.add_marker(pytest.mark.xdist_group("sound"))
        if isinstance(item, pytest.DoctestItem) and item.name.split(".")[-1] in SLOW_DOCTESTS:
            item.add_marker(pytest.mark.slow)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(
        self, item: pytest.Item, nextitem: pytest.Item | None
    ) -> Generator[None, object, object]:
        """Run a test again that was too slow."""
        names = dict(item.dtest.globs) if isinstance(item, pytest.DoctestItem) else {}
        done = yield
        if AGAIN not in item.stash and item.stash.get(SPENT_S, 0.0) > MOST_S:
            item.stash[AGAIN] = True
            if isinstance(item, pytest.DoctestItem):
                item.dtest.globs.update(names)  # which its first run has emptied
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=nextitem)
        return done

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        """Take the time."""
        before_s = time.process_time()
        yield
        beside_boards = os.environ.get("TACTSTRIP_FIRMWARE") == "required"
        in_the_background = hasattr(os, "nice") and os.nice(0) > 0
        if not (in_a_slower_lane(item) or beside_boards or in_the_background):
            item.stash[SPENT_S] = time.process_time() - before_s

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Say of a test that was too slow that it is run again, or that it fails."""
        report = yield
        spent_s = item.stash.get(SPENT_S, 0.0)
        if call.when == "call" and report.passed and spent_s > MOST_S:
            if AGAIN in item.stash:
                report.outcome = "failed"
                report.longrepr = (
                    f"{spent_s:.2f} s of processor time, twice over {MOST_S} s: make it faster, "
                    f"or give it one of the markers {', '.join(LANES)}"
                )
            else:
                report.user_properties.append((AGAIN_NAME, spent_s))
        return report

    def pytest_report_teststatus(self, report: pytest.TestReport) -> tuple[str, str, str] | None:
        """Count a run that is repeated by itself, not as passed."""
        if report.when == "call" and dict(report.user_properties).get(AGAIN_NAME):
            return AGAIN_NAME, "S", AGAIN_NAME.upper()
        return None


QUICK_BURST = """
[burst]
window = "hann"
"""
"""What it does at the other finger is computed quickest: it ends without a jump."""
EMULATORS = """
import json, os, signal, sys
import numpy as np
from device.clock import MonotonicClock
from device.emulate.emulator import Emulator, Nature
from device.emulate.faults import Faults, FaultScript
from device.limits import Limits
from device.emulate.lines import PtyLine, TcpLine
from device.core.output import OutputStage
from device.emulate.emulator import Truth

signal.signal(signal.SIGCHLD, signal.SIG_IGN)
for order in sys.stdin:
    wish = json.loads(order)
    if os.fork():
        continue
    os.setsid()
    nature = Nature(
        limits=Limits(ceiling_vpp=200.0, least_interval_s=wish["least_interval_s"]),
        output=OutputStage(sample_rate_hz=wish["sample_rate_hz"]),
        baud=wish["baud"],
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
"""A process that forks one emulator for each line it reads: starting Python each time is slow."""

SHORT_DESIGN = """
[design]
levels_vpp = [80, 160]
trials_per_side = 2
both_trials = 1
break_every = 3
foreperiod_s = [0.01, 0.02]
"""


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
def short_study_text() -> str:
    """A study file of five trials in two blocks."""
    return SHORT_DESIGN


@pytest.fixture(scope="session")
def quick_study_text(short_study_text: str) -> str:
    """The same with a burst whose displacements are computed in a moment."""
    return QUICK_BURST + short_study_text


@pytest.fixture(scope="session")
def make_study() -> Callable[[str], Study]:
    """A study from the text of a study file; what the text leaves out is the paper's protocol."""
    return lambda text: study_from_text(text, "study.toml")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add where real hardware is."""
    parser.addoption(
        "--driver",
        metavar="NAME",
        help="run the contract of devices on an installed driver of your own, at --port",
    )
    parser.addoption("--port", metavar="P", help="of that driver's device")
    parser.addoption(
        "--device-url",
        help="port or URL of a real device: tests/test_device/test_contract.py drives it. "
        "Its outputs go up to 200 Vpp: nobody may touch the plate.",
    )
    parser.addoption(
        "--device-command",
        action="append",
        default=[],
        metavar="NAME=COMMAND",
        help="run the contract of devices on what this command starts, once for each test: its "
        "first line of output is the port or URL; {port} becomes 0 (any), {truth} the file for "
        "what it emits, {rate} the sample rate",
    )


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

    def start(
        kind: str,
        *,
        faults: str = "",
        seed: int = 1,
        baud: int | None = None,
        volts: bool = False,
        sample_rate_hz: float = 48_000.0,
        least_interval_s: float = 0.005,
    ) -> tuple[str, Path, int]:
        truth = tmp_path / f"truth-{len(pids)}.jsonl"
        wish = {
            "kind": kind,
            "faults": faults,
            "seed": seed,
            "baud": baud,
            "volts": volts,
            "sample_rate_hz": sample_rate_hz,
            "least_interval_s": least_interval_s,
            "truth": str(truth),
        }
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


SOUND = "TACTSTRIP_SOUND"
"""Set to "required", tests with real sound fail where they would be skipped."""


class NullSink:
    """A PulseAudio server with a sink of 48 kHz, 16 bit and two channels, which records itself."""

    def __init__(self, folder: Path) -> None:
        self.socket = folder / "socket"
        self._file = folder / "recording.raw"
        self._server: subprocess.Popen[bytes] | None = None
        self._recorder: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the server."""
        sink = "--load=module-null-sink sink_name=plate rate=48000 format=s16le channels=2"
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
            command += ["--format=s16le", "--rate=48000", "--channels=2"]
            self._recorder = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL)
        assert self.until(lambda: self._file.stat().st_size > 0)

    def recorded(self) -> NDArray[np.int16]:
        """Return the frames recorded so far, shape (n, 2)."""
        raw = self._file.read_bytes()
        frames: NDArray[np.int16] = np.frombuffer(raw[: len(raw) // 4 * 4], dtype="<i2")
        return frames.reshape(-1, 2)

    def kill(self) -> None:
        """Kill the server."""
        self._end(self._server)
        self.socket.unlink(missing_ok=True)

    def control(self, *words: str) -> str:
        """Have pactl do something, and return what it says."""
        command = ["pactl", f"--server=unix:{self.socket}", *words]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=30)
        return done.stdout.strip()

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


def _sound_missing() -> str:
    missing = [tool for tool in ("pulseaudio", "parec", "pactl") if shutil.which(tool) is None]
    try:
        import sounddevice  # noqa: F401 - looks for PortAudio when it is imported
    except (ImportError, OSError):
        missing.append("sounddevice with PortAudio")
    return ", ".join(missing)


@pytest.fixture(scope="module")
def null_sink(tmp_path_factory: pytest.TempPathFactory) -> Iterator[NullSink]:
    """Real sound: PortAudio plays into a null sink, which can be listened to and killed."""
    missing = _sound_missing()
    if missing and os.environ.get(SOUND) != "required":
        pytest.skip(f"real sound needs {missing}")
    import sounddevice

    folder = tmp_path_factory.mktemp("sound")
    sink = NullSink(folder)
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
