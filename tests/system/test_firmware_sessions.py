"""Whole sessions on the firmware, natively and under QEMU: what is said is what came out."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Final, Self, TypeAlias

import numpy as np
import pytest

from device.emulate.faults import Faults, FaultScript
from device.wire.codec import Kind
from device.wire.frames import Decoder
from device.wire.serial import identify
from tests.system.firmware import FIRMWARE, make, require_tools
from tests.system.test_links import (
    ADC,
    MEASURED,
    PAPER,
    SHORT,
    bursts_of,
    events_of,
    finish,
    over,
    require_cut_told_and_mended,
    require_true,
    wait_for_bursts,
)
from tests.test_experiment.sessions import COMMAND, Sessions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    Start: TypeAlias = Callable[..., "Board"]

pytestmark = pytest.mark.firmware

CHUNK: Final = 4096
LATEST_OFF_S: Final = 0.6
TICK_S: Final = 0.002
EVERY_S: Final = 0.5


class Board:
    """A firmware that runs, and how it is reset as by a drop of its supply."""

    def __init__(self, command: list[str], monitor: Path | None) -> None:
        self._command = command
        self._monitor = monitor
        self.process = self._started()
        self.port = self._first_line()

    def _started(self) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        return subprocess.Popen(self._command, stdin=pipe, stdout=pipe, text=True)

    def _first_line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def reset(self) -> None:
        """Reset it: everything forgotten, its line stays where it was."""
        if self._monitor is None:
            self.end()
            number = self.port.rpartition(":")[2]
            self._command[self._command.index("--tcp") + 1] = number
            self.process = self._started()
            assert self._first_line() == self.port
            return
        with socket.socket(socket.AF_UNIX) as asked:
            asked.connect(str(self._monitor))
            answers = asked.makefile("rw")
            for order in ("qmp_capabilities", "system_reset"):
                answers.write(json.dumps({"execute": order}))
                answers.flush()
                while "return" not in json.loads(answers.readline()):
                    pass

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The firmware, natively with sanitizers and for QEMU."""
    require_tools("gcc", "make", "arm-none-eabi-gcc", "qemu-system-arm")
    folder = tmp_path_factory.mktemp("firmware")
    make(folder, "native", sanitize=True)
    return make(folder, "qemu")


@pytest.fixture
def start(images: Path, tmp_path: Path) -> Iterator[Start]:
    """Start a firmware, or the emulator; all are killed at the end."""
    with ExitStack() as boards:

        def started(kind: str, truth: Path, *options: str) -> Board:
            told = ["--tcp", "0", "--truth", str(truth), *options]
            if kind == "emulate":
                board = Board([*COMMAND, "emulate", *told], None)
            elif kind == "native":
                board = Board([str(images / "tactstrip-native"), *told], None)
            else:
                monitor = tmp_path / "monitor"
                command = [sys.executable, str(FIRMWARE / "hal/qemu/run.py"), *told]
                command += ["--image", str(images / "tactstrip-qemu.elf")]
                command += ["--", "-qmp", f"unix:{monitor},server=on,wait=off"]
                board = Board(command, monitor)
            boards.callback(board.end)
            return board

        yield started


class Middle:
    """What is between host and device, and does what bad lines do.

    A chunk that comes at once is a frame to the faults. Every half second it is the turn of one
    of `floods`, 4 kB of noise to both sides, or of `cuts`, every eighth of which ends the line.
    `passing` is told each whole question before, and after, it goes on to the device.
    """

    def __init__(
        self,
        port: str,
        *,
        faults: str = "",
        floods: bool = False,
        cuts: bool = False,
        passing: Callable[[int, bool], None] = lambda kind, gone: None,
    ) -> None:
        self._device_address = ("127.0.0.1", int(port.rpartition(":")[2]))
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._rng = np.random.default_rng(5)
        self._faults = Faults(FaultScript.parse(faults), self._rng)
        self._turns = [self._flood] * floods + [self._cut] * cuts
        self._passing = passing
        self._pair: tuple[socket.socket, socket.socket] | None = None
        self._decoder = Decoder()
        self._late: list[tuple[float, socket.socket, bytes]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self.done = {"flood": 0, "cut turn": 0, "cut": 0}

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._hang_up()
        self._server.close()

    def _serve(self) -> None:
        turn_s = time.monotonic() + EVERY_S
        while not self._over.is_set():
            if self._pair is None:
                self._meet()
            elif self._turns and time.monotonic() > turn_s:
                turn_s = time.monotonic() + EVERY_S
                self._turns.append(self._turns.pop(0))
                self._turns[-1]()
            else:
                self._carry(self._pair)

    def _meet(self) -> None:
        if select.select([self._server], [], [], 0.05)[0]:
            host, _ = self._server.accept()
            device = socket.create_connection(self._device_address)
            for end in (host, device):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._pair = host, device
            self._decoder = Decoder()

    def _carry(self, pair: tuple[socket.socket, socket.socket]) -> None:
        host, device = pair
        try:
            for end in select.select(pair, [], [], TICK_S)[0]:
                some = end.recv(CHUNK)
                if not some:
                    self._hang_up()
                    return
                kinds = self._kinds(some) if end is host else []
                for kind in kinds:
                    self._passing(kind, False)  # noqa: FBT003 - before
                other = device if end is host else host
                for delay_s, piece in self._faults.passed(some):
                    self._late.append((time.monotonic() + delay_s, other, piece))
                self._send_due()
                for kind in kinds:
                    self._passing(kind, True)  # noqa: FBT003 - after
            self._send_due()
        except OSError:
            self._hang_up()

    def _kinds(self, some: bytes) -> list[int]:
        return [frame.kind for frame in self._decoder.feed(some)]

    def _send_due(self) -> None:
        now_s = time.monotonic()
        due = [piece for piece in self._late if piece[0] <= now_s]
        self._late = [piece for piece in self._late if piece[0] > now_s]
        for _, end, piece in due:
            end.sendall(piece)

    def _flood(self) -> None:
        self.done["flood"] += 1
        assert self._pair is not None
        with suppress(OSError):
            for end in self._pair:
                end.sendall(self._rng.bytes(CHUNK))

    def _cut(self) -> None:
        self.done["cut turn"] += 1
        if self.done["cut turn"] % 8 == 4:
            self.done["cut"] += 1
            self._hang_up()

    def _hang_up(self) -> None:
        for end in self._pair or ():
            end.close()
        self._pair, self._late = None, []


@pytest.mark.parametrize("kind", ["qemu"])
def test_a_whole_session_over_a_line_that_does_everything_wrong_equals_the_truth(
    kind: str, tmp_path: Path, start: Start
) -> None:
    truth = tmp_path / "truth.jsonl"
    board = start(kind, truth)
    sessions = Sessions(tmp_path / "host", PAPER)
    faults = "drop=0.0005,corrupt=0.0005,duplicate=0.02,delay=0.02,delay_s=0.03"
    with Middle(board.port, faults=faults, floods=True, cuts=True) as middle:
        failures = finish(sessions, *over("serial", middle.port, "--seed", "7"))
    found = require_true(sessions, truth)
    print(f"{middle.done}, {failures} failures, {found}")
    assert found["ok"] == 155
    assert middle.done["cut"] > 0
    assert middle.done["flood"] > 10


@pytest.mark.parametrize("kind", ["native", "qemu"])
@pytest.mark.parametrize("sensed", [True, False])
def test_what_came_back_of_each_burst_verifies_it_and_not_behind_an_open_switch(
    kind: str, tmp_path: Path, start: Start, *, sensed: bool
) -> None:
    truth = tmp_path / "truth.jsonl"
    more = [] if sensed else ["--unsensed"]
    board = start(kind, truth, "--adc", ADC, "--switch-stdin", *more)
    sessions = Sessions(tmp_path / "host", MEASURED)
    require_cut_told_and_mended(sessions, truth, board.process, board.port, sensed=sensed)


def test_a_reset_does_not_close_a_switch_that_was_opened(tmp_path: Path, start: Start) -> None:
    truth = tmp_path / "truth.jsonl"
    board = start("qemu", truth, "--switch-stdin")
    write_and_wait(board, truth, "open\n")
    board.reset()
    found = identify(board.port)
    assert found is not None
    assert found[2].switch_closed is False
    assert [event["event"] for event in events_of(truth)] == ["boot", "switch", "boot"]


def write_and_wait(board: Board, truth: Path, words: str) -> None:
    """Write on its standard input, and wait until the truth tells that the switch was moved."""
    assert board.process.stdin is not None
    board.process.stdin.write(words)
    board.process.stdin.flush()
    give_up_s = time.monotonic() + 5.0
    while "switch" not in [event["event"] for event in events_of(truth)]:
        assert time.monotonic() < give_up_s
        time.sleep(TICK_S)


@pytest.mark.parametrize("kind", ["emulate", "native", "qemu"])
def test_only_open_and_closed_move_the_switch_and_what_else_is_said_is_told(
    kind: str, tmp_path: Path, start: Start, capfd: pytest.CaptureFixture[str]
) -> None:
    truth = tmp_path / "truth.jsonl"
    others = ["o", "c", "closed door", " opened", "", "crash"]
    board = start(kind, truth, "--switch-stdin")
    write_and_wait(board, truth, "".join(f"{word}\n" for word in [*others, "open"]))
    assert [event.get("closed") for event in events_of(truth)] == [None, False]
    told = [f"the switch is open or closed, got {word!r}" for word in others]
    assert capfd.readouterr().err.splitlines() == told


@pytest.mark.parametrize("kind", ["native", "qemu"])
def test_a_killed_host_leaves_the_outputs_at_zero_within_600_ms(
    kind: str, tmp_path: Path, start: Start
) -> None:
    truth = tmp_path / "truth.jsonl"
    board = start(kind, truth)
    sessions = Sessions(tmp_path / "host", SHORT)
    command = [*COMMAND, *sessions.words(*over("serial", board.port))]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as host:
        wait_for_bursts(truth, 3, host)
        os.kill(host.pid, signal.SIGKILL)
        killed_s = time.monotonic()
        while events_of(truth)[-1]["event"] != "off":
            assert time.monotonic() < killed_s + 5.0
            time.sleep(TICK_S)
        took_s = time.monotonic() - killed_s
    print(f"{took_s:.3f} s, {events_of(truth)[-1]}")
    assert took_s < LATEST_OFF_S
    finish(sessions, *over("serial", board.port))
    assert require_true(sessions, truth)["ok"] == 11


@pytest.mark.parametrize("kind", ["native", "qemu"])
@pytest.mark.parametrize("gone", [False, True])
@pytest.mark.parametrize("asked", [Kind.ARM, Kind.FIRE])
def test_a_reset_between_arm_and_fire_leaves_a_trial_of_which_nobody_knows(
    kind: str, asked: Kind, tmp_path: Path, start: Start, *, gone: bool
) -> None:
    truth = tmp_path / "truth.jsonl"
    board = start(kind, truth)
    sessions = Sessions(tmp_path / "host", SHORT)
    passed = []

    def reset_at_the_fourth(passing: int, was_sent: bool) -> None:  # noqa: FBT001
        if passing == asked and was_sent == gone:
            passed.append(passing)
            if len(passed) == 4:
                board.reset()

    with Middle(board.port, passing=reset_at_the_fourth) as middle:
        finish(sessions, *over("serial", middle.port))
    boots = [event["boot_id"] for event in events_of(truth) if event["event"] == "boot"]
    assert len(boots) == len(set(boots)) == 2
    found = require_true(sessions, truth)
    if asked is Kind.FIRE and not gone:  # else the answer may come before the reset
        assert found["indeterminate"] >= 1
    assert found["ok"] == 11
    assert len(bursts_of(truth)) >= 11
