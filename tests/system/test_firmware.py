"""The firmware answers byte for byte as the core in Python does, and emits the same.

The contract of devices runs on it by `make -C firmware check`.
"""

from __future__ import annotations

import ctypes
import json
import subprocess
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from device.clock import MonotonicClock
from device.core.host import HostDriver
from device.core.messages import AskMeasured, to_codes
from device.errors import Refusal, RefusedError
from device.limits import Limits
from device.wire.channels import open_channel
from device.wire.codec import ANSWER, HEAD, AnswerPayload, Kind
from device.wire.dialogue import framed
from device.wire.frames import Decoder, encode
from device.wire.link import FrameLink
from device.wire.upload import Data
from tests.system.differential import BEAT, KINDS, compare, small_server
from tests.system.firmware import Server, limits_of, make, require_tools
from tests.test_device.bursts import BURST, play, ready, sine
from tests.test_device.golden import FILE, ON_THE_HOST

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from device.wire.channels import Channel

pytestmark = pytest.mark.firmware

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.01)
GOLDEN = json.loads(FILE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def golden(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server with the limits of the golden device."""
    require_tools("gcc", "make")
    folder = tmp_path_factory.mktemp("golden")
    make(folder, "server", sanitize=True, **limits_of(GOLDEN["device"]))
    with Server(folder / "server") as server:
        yield server


def test_the_golden_frames_are_what_the_firmware_answers(golden: Server) -> None:
    golden.switch_on(GOLDEN["device"])
    for step in GOLDEN["steps"]:
        ask(golden, step)
    for step, told in zip(GOLDEN["steps"], golden.told(), strict=True):
        assert (told.frames + told.text).hex(" ") == step.get("answer", ""), step["meaning"]


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


def test_what_is_no_golden_frame_gets_no_answer_of_the_firmware(golden: Server) -> None:
    for noise in GOLDEN["no_frames"]:
        golden.switch_on(GOLDEN["device"])
        golden.receive(1, bytes.fromhex(noise["bytes"]))
        (told,) = golden.told()
        assert told.frames + told.text == b"", noise["meaning"]


def test_firmware_and_core_cannot_be_told_apart(tmp_path: Path) -> None:
    with small_server(tmp_path) as server:
        met = set.union(*(compare(server, seed) for seed in range(1600)))
    known = set(KINDS) - {0}
    refusals = {refusal for kind, refusal in met if kind in known}
    assert refusals == {0, *Refusal} - {Refusal[name] for name in ON_THE_HOST}
    assert {kind for kind, _ in met} >= known - {BEAT}


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
        monitor, found, n_steps = ctypes.create_string_buffer(ROOM), Measured(), 1
        library.monitor_begin(
            monitor, ctypes.c_void_p(codes.ctypes.data), len(planned),
            ctypes.c_void_p(words.ctypes.data), len(recorded),
        )  # fmt: skip
        while not library.monitor_step(monitor) & 0xFF:
            n_steps += 1
        n_lags = min(49, len(recorded) - len(planned) + 1)
        n_looks = 4 * len(recorded) + 2 * (n_lags + 1) * len(planned)
        assert n_steps == -(-n_looks // SLICE)
        library.monitor_tell(monitor, 48_000_000, ctypes.byref(found))
        return found

    return measure


@pytest.mark.parametrize("lag", [0, 3, 48])
@pytest.mark.parametrize("gain", [0.05, 0.6, -0.6])
def test_the_monitor_of_the_board_finds_a_burst_as_numpy_does(
    measure: Callable[..., Any], lag: int, gain: float
) -> None:
    rng = np.random.default_rng(3)
    planned = np.zeros((97, 2), dtype=np.int16)
    planned[:, 0] = to_codes(BURST, 12)
    seen = REST + rng.normal(0.0, 5.0, size=(97 + 48, 2))
    seen[lag : lag + 97] += gain * planned
    recorded = seen.round().astype(np.uint16)
    found = measure(planned, recorded)
    away = recorded - recorded.mean(axis=0).round()
    peaks_mv = np.abs(away).max(axis=0) * 80.566
    assert (found.tap, found.unit, found.uncertainty_us) == (2, 1, 21)
    assert [found.left, found.right] == pytest.approx(peaks_mv, abs=81)
    assert found.correlation_right == 0
    if gain > 0.0:
        at = slice(lag, lag + 97)
        norm = np.linalg.norm(planned[:, 0]) * np.linalg.norm(away[at, 0])
        assert found.onset_us == lag * 1_000_000 // 48_000
        assert found.correlation_left == pytest.approx(
            1e4 * planned[:, 0] @ away[at, 0] / norm, abs=3
        )
    else:
        assert found.correlation_left < 8_000  # upside down, found half a period away


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The device on this machine, with sanitizers; it takes its time to match a long burst."""
    require_tools("gcc", "make")
    folder = tmp_path_factory.mktemp("native")
    return make(folder, "native", sanitize=True, SLICE=8) / "tactstrip-native"


@contextmanager
def opened(native: Path, *options: str) -> Iterator[str]:
    """Start it; gives its port."""
    command = [str(native), "--tcp", "0", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.terminate()


def host_of(url: str) -> HostDriver:
    clock = MonotonicClock()
    return HostDriver(link_of(url), limits=LIMITS, clock=clock)


def link_of(url: str) -> FrameLink:
    clock = MonotonicClock()
    return FrameLink(lambda: open_channel(url, clock), clock)


LONG = sine(16_384, cycles=160)
"""So long that it takes hundreds of slices to match it."""


@pytest.mark.parametrize("then", ["wait", "load", "stop"])
def test_what_is_still_being_matched_is_busy_and_all_else_is_answered(
    native: Path, then: str
) -> None:
    with opened(native, "--adc", "gain=0.5,delay_us=250,noise=100") as url:
        device = host_of(url)
        ready(device, 100.0, burst=LONG)
        play(device, 7)
        ends_s = time.monotonic() + len(LONG) / 48_000.0 + 0.002
        n_busy = 0
        while is_busy(device, 7):
            n_busy += time.monotonic() > ends_s
            assert device.health().amplifier_enabled == (then != "stopped")
            if n_busy and then == "load":
                device.load(1, BURST, BURST)
            if n_busy and then == "stop":
                device.stop()
                then = "stopped"
        found = device.measured(7)
        assert device.measured(6) is None
        device.close()
    if then == "load":
        assert (n_busy, found) == (1, None)
        return
    assert then == "wait" or n_busy
    assert found is not None
    assert (found.tap, found.onset_offset_us, found.correlation_right) == ("amplifier", 250, 0)
    assert found.left == pytest.approx(25_000, rel=0.03)
    assert found.correlation_left > 9_990


def test_a_flood_of_questions_does_not_keep_a_burst_from_being_matched(native: Path) -> None:
    """At most one frame is answered between two slices of the matching."""
    n_slices, every = -(-(4 * (97 + 48) + 2 * (49 + 1) * 97) // 8), 50
    with opened(native, "--rate", "1000", "--adc", "gain=0.5") as url:
        link, channel = link_of(url), open_channel(url, MonotonicClock())
        link._connect = lambda: channel
        device = HostDriver(link, limits=LIMITS, clock=MonotonicClock())
        boot_id = ready(device, 100.0).boot_id
        number = next(link._numbers) + 9
        piece = encode(framed(Data(upload=0, offset=0, octets=b"-"), 0, boot_id)) * (every - 1)
        flood = b"".join(
            piece + encode(framed(AskMeasured(token=1), number + i, boot_id)) for i in range(1000)
        )
        end_us = (play(device, 1).device_us or 0) + 97_000
        flooding = threading.Thread(target=channel.write, args=(flood,))
        flooding.start()
        answers = answers_of(channel)
        flooding.join()
        device.close()
    told = [
        i for i, (kind, head) in enumerate(answers)
        if kind == Kind.MEASURED | ANSWER and head.refusal is not Refusal.BUSY
    ]  # fmt: skip
    waited = answers[: told[0]] if told else answers
    assert 0 < sum(head.device_us > end_us for _, head in waited) <= n_slices + every


def answers_of(channel: Channel) -> list[tuple[int, AnswerPayload]]:
    """Return the types and heads of answers until there are no more."""
    decoder, answers = Decoder(), []
    while some := channel.read(0.2):
        answers += [(frame.kind, HEAD.read(frame.payload)) for frame in decoder.feed(some)]
    return answers


def is_busy(device: HostDriver, token: int) -> bool:
    try:
        device.measured(token)
    except RefusedError as error:
        return error.code is Refusal.BUSY
    return False


def test_the_truth_of_the_firmware_is_that_of_the_emulator(
    native: Path, tmp_path: Path, emulate: Callable[..., tuple[str, Path, int]]
) -> None:
    ours = tmp_path / "native.jsonl"
    with opened(native, "--truth", str(ours)) as url:
        port, truth, _ = emulate("tcp", volts=True)
        play_some(url)
        play_some(port)
    told, expected = facts_of(ours), facts_of(truth)
    assert [fact["event"] for fact in told] == [
        *("boot", "on", "burst", "burst", "burst", "burst", "cut", "off"),
    ]
    assert told == expected


def play_some(url: str) -> None:
    """Play left, right, both at levels of all kinds; the last is cut."""
    clock, device = MonotonicClock(), host_of(url)
    ready(device)
    long = np.append(np.tile(BURST[:-1], 150), 0.0)
    device.load(2, long, 0.3 * long)
    for token, (slot, left_vpp, right_vpp) in enumerate(
        ((0, 14.5, 14.499), (1, 200.0, 0.001), (1, 0.0, 199.999), (2, 0.1, 77.777)), 1
    ):
        device.set_levels(left_vpp, right_vpp)
        play(device, token, slot)
        clock.wait(0.05)
    device.close()


def facts_of(truth: Path) -> list[dict[str, Any]]:
    """Return a truth file without what differs each time."""
    lines = truth.read_text(encoding="utf-8").splitlines()
    changing = ("t_s", "boot_id", "began_s")
    return [
        {name: fact for name, fact in json.loads(line).items() if name not in changing}
        for line in lines
    ]
