"""The firmware answers byte for byte as the core in Python does, and emits the same.

The contract of devices runs on it by `make -C firmware check`.
"""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from device import Health, Refusal
from tests.system.differential import KINDS, compare, small_server
from tests.system.firmware import FIRMWARE, Server, limits_of, make, making, require_tools, running
from tests.test_device.bursts import BURST
from tests.test_device.golden import GOLDEN
from tests.test_device.trials import device_at

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

BOARD = ("arm-none-eabi-gcc", "make")
QEMU = ("arm-none-eabi-gcc", "qemu-system-arm", "make")


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with the limits of the golden device."""
    require_tools("gcc", "make")
    folder = tmp_path_factory.mktemp("golden")
    make(folder, "server", sanitize=True, **limits_of(GOLDEN["device"]))
    with Server(folder / "server") as server:
        yield server


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The device on this machine, with sanitizers; it takes its time to match a long burst."""
    require_tools("gcc", "make")
    return make(tmp_path_factory.mktemp("native"), "native", sanitize=True, SLICE=8)


def command_of(kind: str, images: Path) -> list[str]:
    """Return what starts the firmware on this machine or under QEMU."""
    if kind == "native":
        return [str(images / "tactstrip-native")]
    require_tools(*QEMU)
    image = make(images, "qemu") / "tactstrip-qemu.elf"
    return [sys.executable, str(FIRMWARE / "hal/qemu/run.py"), "--image", str(image)]


def test_the_golden_frames_are_what_the_firmware_answers(golden: Server) -> None:
    golden.switch_on(GOLDEN["device"])
    for step in GOLDEN["steps"]:
        ask(golden, step)
    for step, told in zip(GOLDEN["steps"], golden.told(), strict=True):
        assert (told.frames + told.text).hex(" ") == step.get("answer", ""), step["meaning"]
    for noise in GOLDEN["no_frames"]:
        golden.switch_on(GOLDEN["device"])
        golden.receive(1, bytes.fromhex(noise["bytes"]))
        (told,) = golden.told()
        assert told.frames + told.text == b"", noise["meaning"]


def ask(server: Server, step: dict[str, Any]) -> None:
    at_us = step["at_us"]
    match step:
        case {"sense": sensed}:
            server.sense(at_us, sensed["known"], sensed["set"])
        case {"hang_up": True}:
            server.hang_up(at_us)
        case {"reading": reading}:
            server.read_from_now_on(at_us, reading and tuple(reading.values()))
        case _:
            server.receive(at_us, bytes.fromhex(step["question"]))


def test_firmware_and_core_do_the_same(tmp_path: Path) -> None:
    with small_server(tmp_path) as server:
        met = set.union(*(compare(server, seed) for seed in range(1600)))
    refusals = {refusal for _, refusal in met}
    hosts_only = {Refusal[name] for name in GOLDEN["refusals_of_hosts_only"]}
    assert refusals >= {0, *Refusal} - hosts_only - {Refusal.BAD_TOKEN, Refusal.BAD_MESSAGE}
    assert len({kind for kind, _ in met}) >= len(set(KINDS)) - 1  # all but BEAT


class Measured(ctypes.Structure):
    _fields_ = (
        *(("tap", ctypes.c_uint8), ("unit", ctypes.c_uint8)),
        *(("left", ctypes.c_uint32), ("right", ctypes.c_uint32)),
        *(("onset_us", ctypes.c_uint32), ("uncertainty_us", ctypes.c_uint32)),
        *(("correlation_left", ctypes.c_uint16), ("correlation_right", ctypes.c_uint16)),
    )


REST = 2060.0
"""Where the input of a board rests, about the middle of its 12 bits."""
ROOM = 4096
"""More bytes than a struct monitor has."""
SLICE = 1000


@pytest.fixture(scope="module")
def measure(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """The board's monitor, as a function of planned codes and of what was recorded."""
    require_tools("gcc", "make")
    folder = tmp_path_factory.mktemp("monitor")
    make(folder, str(folder / "monitor.so"), SLICE=SLICE)
    library = ctypes.CDLL(str(folder / "monitor.so"))

    def measure(planned: NDArray[np.int16], recorded: NDArray[np.uint16]) -> Any:
        codes, words = np.ascontiguousarray(planned.T), np.ascontiguousarray(recorded)
        monitor, result, n_steps = ctypes.create_string_buffer(ROOM), Measured(), 1
        planned_at, recorded_at = (ctypes.c_void_p(row.ctypes.data) for row in (codes, words))
        library.monitor_begin(monitor, planned_at, len(planned), recorded_at, len(recorded))
        while not library.monitor_step(monitor) & 0xFF:
            n_steps += 1
        n_lags = min(49, len(recorded) - len(planned) + 1)
        n_looks = 4 * len(recorded) + 2 * (n_lags + 1) * len(planned)
        assert n_steps == -(-n_looks // SLICE)
        library.monitor_tell(monitor, 48_000_000, ctypes.byref(result))
        return result

    return measure


@pytest.mark.parametrize("lag", [0, 3, 48])
@pytest.mark.parametrize("gain", [0.05, 0.6, -0.6])
def test_the_monitor_of_the_board_measures_a_burst_as_numpy_does(
    measure: Callable[..., Any], lag: int, gain: float
) -> None:
    rng = np.random.default_rng(3)
    planned = np.zeros((97, 2), dtype=np.int16)
    planned[:, 0] = np.trunc(BURST * 2047)
    seen = REST + rng.normal(0.0, 5.0, size=(97 + 48, 2))
    seen[lag : lag + 97] += gain * planned
    recorded = seen.round().astype(np.uint16)
    result = measure(planned, recorded)
    away = recorded - recorded.mean(axis=0).round()
    peaks_mv = np.abs(away).max(axis=0) * 80.566
    assert (result.tap, result.unit, result.uncertainty_us) == (2, 1, 21)
    assert [result.left, result.right] == pytest.approx(peaks_mv, abs=81)
    assert result.correlation_right == 0
    if gain > 0.0:
        at = slice(lag, lag + 97)
        norm = np.linalg.norm(planned[:, 0]) * np.linalg.norm(away[at, 0])
        assert result.onset_us == lag * 1_000_000 // 48_000
        assert result.correlation_left == pytest.approx(
            1e4 * planned[:, 0] @ away[at, 0] / norm, abs=3
        )
    else:
        assert result.correlation_left < 8_000  # upside down, found half a period away


def facts_of(truth: Path) -> list[dict[str, Any]]:
    """Return a truth file without what differs each time."""
    lines = truth.read_text(encoding="utf-8").splitlines()
    changing = ("t_s", "boot_id", "began_s")
    return [
        {name: fact for name, fact in json.loads(line).items() if name not in changing}
        for line in lines
    ]


@pytest.mark.parametrize("kind", ["emulate", "native", "qemu"])
def test_only_open_and_closed_move_the_switch(
    kind: str, images: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    truth, others = tmp_path / "truth.jsonl", ["o", "c", "closed door", " opened", "", "crash"]
    command = [sys.executable, "-m", "tactstrip", "emulate"]
    if kind != "emulate":
        command = command_of(kind, images)
    options = ("--tcp", "0", "--truth", str(truth), "--switch-stdin")
    with running(*command, *options) as (process, url):
        print(*others, "open", sep="\n", file=process.stdin, flush=True)
        give_up_s = time.monotonic() + 5.0
        while not truth.exists() or "switch" not in truth.read_text(encoding="utf-8"):
            assert time.monotonic() < give_up_s
            time.sleep(0.002)
        device = device_at(url)
        device.open()
        assert device.health() == Health(
            amplifier_enabled=False, switch_closed=False, over_current=False
        )
        device.close()
    assert [fact.get("closed") for fact in facts_of(truth)][:2] == [None, False]
    errors = capfd.readouterr().err.splitlines()[-len(others) :]  # below how to use the port
    assert [repr(word) in error for word, error in zip(others, errors, strict=True)] == [True] * 6


@pytest.mark.parametrize(
    ("limits", "target", "tools"),
    [
        ({"RAIL_MVPP": 199_999}, "monitor.so", ("gcc", "make")),
        ({"CEILING_MVPP": 0}, "monitor.so", ("gcc", "make")),
        ({"RAIL_MVPP": 2**32}, "monitor.so", ("gcc", "make")),
        ({"DC_TOLERANCE_PPM": 1_000_001}, "monitor.so", ("gcc", "make")),
        ({"SLOTS": 256}, "monitor.so", ("gcc", "make")),
        ({"DATA_WINDOW": 0}, "monitor.so", ("gcc", "make")),
        ({"DATA_WINDOW": 256}, "monitor.so", ("gcc", "make")),
        ({"RAIL_MVPP": 228_000}, "board", BOARD),
    ],
)
def test_limits_that_cannot_be_kept_are_not_compiled(
    tmp_path: Path, limits: dict[str, int], target: str, tools: tuple[str, ...]
) -> None:
    require_tools(*tools)
    path = target if target == "board" else str(tmp_path / target)
    for given, fails in ((limits, True), ({}, False)):
        command = making(tmp_path, path, sanitize=False, **given)
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (run.returncode != 0, "static assertion" in run.stderr) == (fails, fails)
