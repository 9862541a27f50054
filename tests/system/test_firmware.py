"""The firmware answers byte for byte as the core in Python does, and emits the same.

The contract of devices runs on it in test_device_contract.py.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import time
import zlib
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from device import Health, Outcome, Refusal
from device.emulate.firmware import FirmwareLibrary, MeasuredStruct
from tests.system.differential import KINDS, STEPS, compare, make_small_library
from tests.system.firmware import (
    firmware_device,
    limits_of,
    make,
    make_command,
    require_tools,
)
from tests.test_device.bursts import BURST, play, ready, refusal
from tests.test_device.golden import GOLDEN, Reader, replay
from tests.test_device.trials import device_at
from tests.test_device.wire import answers, question, upload_of

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

BOARD = ("arm-none-eabi-gcc", "make")


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> FirmwareLibrary:
    """The firmware with the limits of the golden device."""
    require_tools("gcc", "make")
    folder = tmp_path_factory.mktemp("golden")
    make(folder, "library", sanitize="undefined", **limits_of(GOLDEN["device"]))
    return FirmwareLibrary(folder / "firmware.so")


def power_on(library: FirmwareLibrary, reader: Reader) -> Any:
    return firmware_device(library, GOLDEN["device"], reader, lambda _: None)


def test_the_golden_frames_are_what_the_firmware_answers(golden: FirmwareLibrary) -> None:
    reader = Reader()
    device = power_on(golden, reader)
    for step in GOLDEN["steps"]:
        answer = replay(device, reader, step)
        assert answer.hex(" ") == step.get("answer", ""), step["meaning"]
    for noise in GOLDEN["no_frames"]:
        answer = power_on(golden, reader).receive(1, bytes.fromhex(noise["bytes"]))
        assert answer == b"", noise["meaning"]


def test_firmware_and_core_do_the_same(tmp_path: Path) -> None:
    library = FirmwareLibrary(make_small_library(tmp_path))
    met = set.union(*(compare(library, seed) for seed in range(400)))
    refusals = {refusal for _, refusal in met}
    hosts_only = {Refusal[name] for name in GOLDEN["refusals_of_hosts_only"]}
    assert refusals >= {0, *Refusal} - hosts_only - {Refusal.BAD_TOKEN, Refusal.BAD_MESSAGE}
    assert len({kind for kind, _ in met}) >= len(set(KINDS)) - 1  # all but BEAT


def test_the_sanitizers_find_nothing_where_firmware_and_core_do_the_same(tmp_path: Path) -> None:
    library = make_small_library(tmp_path, sanitize="address,undefined")
    runtime = subprocess.run(
        ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    )
    run = subprocess.run(
        [sys.executable, "-m", "tests.system.differential", str(library), "500", "100"],
        env=os.environ | {"LD_PRELOAD": runtime.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith(f"{100 * STEPS} ")


def codes_of_sine() -> NDArray[np.int32]:
    codes: NDArray[np.int32] = np.rint(10_000 * np.sin(2 * np.pi * np.arange(25) / 24)).astype(
        np.int32
    )
    return codes


def test_measured_is_busy_until_a_board_has_matched_its_recording(golden: FirmwareLibrary) -> None:
    device, boot_id, numbers = power_on(golden, Reader()), GOLDEN["device"]["boot_id"], count(1)

    def ask(at_us: int, kind: str, **fields: Any) -> Refusal | None:
        message = question(kind, next(numbers), boot_id=boot_id, **fields)
        (answer,) = answers(device.receive(at_us, message))
        return answer.refusal

    def load(at_us: int) -> None:
        codes = np.outer((1, 0), codes_of_sine())
        octets, data = upload_of(codes, number := next(numbers))
        device.receive(at_us, question("BEGIN", number, boot_id=boot_id, slot=0, samples=25))
        for piece in data:
            fields = {"upload": number, "offset": piece.offset, "octets": piece.octets}
            assert ask(at_us, "DATA", **fields) is None
        assert ask(at_us, "COMMIT", slot=0, crc=zlib.crc32(octets)) is None

    def fire(at_us: int, token: int) -> None:
        assert ask(at_us, "ARM", token=token, slot=0, time_to_live_us=1000) is None
        assert ask(at_us, "FIRE", token=token) is None

    load(1)
    assert ask(2, "LEVEL", levels_mvpp=(100_000, 0)) is None
    assert ask(3, "OUTPUT") is None
    fire(4, token=1)
    address = device.core._device
    golden.functions.device_begin_measuring.argtypes = [ctypes.c_void_p]
    golden.functions.device_begin_measuring(address)  # it plays: there is nothing to match yet
    assert ask(5, "MEASURED", token=1) is Refusal.BUSY
    assert ask(10_000, "MEASURED", token=1) is None
    golden.functions.device_begin_measuring(address)
    assert ask(10_001, "MEASURED", token=1) is Refusal.BUSY
    assert ask(10_001, "MEASURED", token=2) is None
    golden.functions.device_measure(address, ctypes.byref(MeasuredStruct(tap=2, peaks=(7, 0))))
    assert ask(10_002, "MEASURED", token=1) is None
    golden.functions.device_begin_measuring(address)
    load(10_003)  # the codes to match with are gone
    assert ask(10_004, "MEASURED", token=1) is None


@pytest.mark.parametrize("core", ["python", "c"])
def test_only_open_and_closed_move_the_switch_and_what_is_played_is_measured(
    core: str, firmware_build: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    truth, others = tmp_path / "truth.jsonl", ["o", "c", "closed door", " opened", "", "crash"]
    command = [sys.executable, "-m", "tactstrip", "emulate", "--tcp", "0", "--truth", str(truth)]
    command += ["--switch-stdin", "--adc", "gain=0.5"]
    if core == "c":
        require_tools("gcc", "make")
        library = make(firmware_build, "library", sanitize="undefined") / "firmware.so"
        command += ["--firmware", str(library)]

    def move_switch(*words: str) -> None:
        before = truth.read_text(encoding="utf-8").count("switch")
        print(*words, sep="\n", file=process.stdin, flush=True)
        give_up_s = time.monotonic() + 5.0
        while truth.read_text(encoding="utf-8").count("switch") == before:
            assert time.monotonic() < give_up_s
            time.sleep(0.002)

    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        device = device_at(process.stdout.readline().strip())
        ready(device, 100.0)
        assert play(device, 1).outcome is Outcome.FIRED
        time.sleep(0.1)  # the burst lasts 2 ms
        measured = device.measured(1)
        assert measured is not None
        assert measured.tap == "amplifier"
        assert measured.peaks[0] == pytest.approx(25_000, abs=2)
        move_switch(*others, "open")
        assert device.health() == Health(
            amplifier_enabled=True, switch_closed=False, over_current=False
        )
        assert refusal(lambda: play(device, 2)) is Refusal.AMPLIFIER_OFF
        move_switch("closed")
        assert device.health().switch_closed is True
        device.close()
        process.kill()
    errors = capfd.readouterr().err.splitlines()[-len(others) :]  # below how to use the port
    assert [repr(word) in error for word, error in zip(others, errors, strict=True)] == [True] * 6


REST = 2060.0
"""Where the input of a board rests, about the middle of its 12 bits."""
ROOM = 4096
"""More bytes than a struct monitor has."""
SLICE = 1000


@pytest.fixture(scope="module")
def measure(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Any]:
    """The board's monitor, as a function of planned codes and of what was recorded."""
    require_tools("gcc", "make")
    folder = make(tmp_path_factory.mktemp("monitor"), "library", SLICE=SLICE)
    library = FirmwareLibrary(folder / "firmware.so").functions

    def measure(planned: NDArray[np.int16], recorded: NDArray[np.uint16]) -> Any:
        codes, words = np.ascontiguousarray(planned.T), np.ascontiguousarray(recorded)
        monitor, result, n_steps = ctypes.create_string_buffer(ROOM), MeasuredStruct(), 1
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
    assert (result.tap, result.uncertainty_us) == (2, 21)
    assert [*result.peaks] == pytest.approx(peaks_mv, abs=81)
    assert result.correlations[1] == 0
    if gain > 0.0:
        at = slice(lag, lag + 97)
        norm = np.linalg.norm(planned[:, 0]) * np.linalg.norm(away[at, 0])
        assert result.onset_us == lag * 1_000_000 // 48_000
        assert result.correlations[0] == pytest.approx(
            1e4 * planned[:, 0] @ away[at, 0] / norm, abs=3
        )
    else:
        assert result.correlations[0] < 8_000  # upside down, found half a period away


@pytest.mark.parametrize(
    ("limits", "target", "tools"),
    [
        ({"RAIL_MVPP": 199_999}, "library", ("gcc", "make")),
        ({"CEILING_MVPP": 0}, "library", ("gcc", "make")),
        ({"RAIL_MVPP": 2**32}, "library", ("gcc", "make")),
        ({"DC_TOLERANCE_PPM": 1_000_001}, "library", ("gcc", "make")),
        ({"SLOTS": 256}, "library", ("gcc", "make")),
        ({"RAIL_MVPP": 228_000}, "board", BOARD),
    ],
)
def test_limits_that_cannot_be_kept_are_not_compiled(
    tmp_path: Path, limits: dict[str, int], target: str, tools: tuple[str, ...]
) -> None:
    require_tools(*tools)
    for given, fails in ((limits, True), ({}, False)):
        command = make_command(tmp_path, target, sanitize="", **given)
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        assert (run.returncode != 0, "static assertion" in run.stderr) == (fails, fails)
