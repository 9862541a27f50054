"""A host and a device on a bad line: what the host says is what was emitted, or that it is unknown.

Every byte of the wire passes through the code of the real link and the real emulator; the line is
a pair of buffers and the clock is virtual, so that thousands of trials take seconds.
"""

from collections import Counter
from collections.abc import Callable
from itertools import count
from threading import Thread

import numpy as np
import pytest

from device import (
    DeviceError,
    LineSettings,
    LinkError,
    Outcome,
    OutputStage,
    Refusal,
    Rejected,
    State,
    VirtualClock,
)
from tests.test_device import wire
from tests.test_device.bursts import play, refusal, sine
from tests.test_device.in_process import InProcess, RecordedLine
from tests.test_device.trials import PATIENCE_S, Trials

DRIFT_PPM = 80.0


class Virtual(Trials):
    """Trials with an emulator in this process."""

    clock: VirtualClock

    def __init__(self, script: str, seed: int) -> None:
        clock, rng = VirtualClock(start_s=100.0), np.random.default_rng(seed)
        output = OutputStage(sample_rate_hz=12_000.0)
        faults_rng = rng.spawn(1)[0]
        self.rig = InProcess(script, faults_rng, clock=clock, output=output, drift_ppm=DRIFT_PPM)
        super().__init__(self.rig.device, clock, rng)

    def run(self, n_trials: int) -> "Virtual":
        for _ in range(n_trials):
            self.trial()
            self.rig.wait(float(self.rng.choice([0.008, 0.02, 0.3])))
        return self

    def counts(self) -> Counter[str]:
        return self.check(self.rig.truth, drift_ppm=DRIFT_PPM)


SCRIPTS = {
    "clean": "",
    "noise": "drop=0.01,corrupt=0.01",
    "duplicates and delays": "duplicate=0.2,delay=0.2,delay_s=0.07",
    "stalls": "stall=0.03,stall_s=0.4",
    "long stalls": "stall=0.01,stall_s=6",
    "all but losses": "drop=0.005,corrupt=0.005,duplicate=0.1,delay=0.1,stall=0.01,stall_s=0.2",
    "resets": "reset=0.02,duplicate=0.05",
    "disconnects": "disconnect=0.02,delay=0.05",
    "everything": "drop=0.005,corrupt=0.005,duplicate=0.05,delay=0.05,stall=0.005,"
    "reset=0.005,disconnect=0.005",
}
LOSSLESS = [
    name for name, script in SCRIPTS.items() if "reset" not in script and "disconnect" not in script
]


@pytest.mark.parametrize("n_trials", [10, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SCRIPTS)
def test_what_the_host_says_is_what_was_emitted_or_it_says_that_it_does_not_know(
    name: str, n_trials: int
) -> None:
    counts: Counter[str] = Counter()
    for seed in range(4):
        counts += Virtual(SCRIPTS[name], seed).run(n_trials // 4).counts()
    print(f"{name}: {n_trials} trials, {dict(counts)}")
    assert counts["fired"] > n_trials / 4
    if name in LOSSLESS:
        assert counts["indeterminate"] <= 0.01 * n_trials


def why_not_open(baud: int | None, line: LineSettings, script: str = "", seed: int = 1) -> str:
    """Return why a line cannot be opened, or nothing."""
    rig = InProcess(script, seed, line=line, baud=baud)
    rig.beating = False  # as a host's heart is only once it is connected
    try:
        rig.link.hello()
    except LinkError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("baud", [1200, 2400, 4800, 9600, 19_200, 38_400])
def test_a_slow_wire_is_refused_and_driven_when_its_rate_is_given(baud: int) -> None:
    assert "slower than device.baud = 115200" in why_not_open(baud, LineSettings())
    assert why_not_open(baud, LineSettings(baud=baud)) == ""
    assert why_not_open(57_600, LineSettings()) == ""


@pytest.mark.parametrize("name", SCRIPTS)
def test_an_upload_arrives_whole_over_any_line_or_is_said_to_have_failed(name: str) -> None:
    counts: Counter[str] = Counter()
    for seed in range(24):
        trials = Virtual(SCRIPTS[name], seed)
        trials.rig.link.requests._numbers = count(2**16 - 60)  # they turn over meanwhile
        trials.reopen()
        samples = sine(600, peak=float(trials.rng.uniform(0.1, 1.0)), cycles=seed + 1)
        try:
            trials.device.load(5, np.stack([samples, -samples]))
        except DeviceError:
            counts["failed"] += 1
            continue
        codes = np.trunc(samples * 32767)
        assert np.array_equal(trials.rig.stored(5), (codes, -codes))
        counts["stored"] += 1
    print(f"{name}: {dict(counts)}")
    assert counts["stored"] == 24 or name not in LOSSLESS
    assert counts["stored"] > 0


@pytest.mark.slow
def test_a_line_lost_at_any_byte_of_a_trial_leaves_no_trial_wrong() -> None:
    counts: Counter[str] = Counter()
    for n_bytes in count(1):
        trials = Virtual("", n_bytes)
        trials.rig.set_faults("", cut_after=n_bytes)
        before_s = trials.clock.now_s()
        trials.trial()
        was_cut = trials.clock.now_s() > before_s or trials.claims[1].lost
        trials.rig.wait(0.02)
        trials.trial()
        counts += trials.counts()
        if not was_cut:
            break
    print(f"cut after 1 to {n_bytes} bytes: {dict(counts)}")
    assert n_bytes > 150
    assert counts["indeterminate"] == 0


@pytest.fixture
def line() -> RecordedLine:
    return RecordedLine().live()


def question(name: str, number: int, *, boot_id: int = RecordedLine.BOOT_ID, **of: int) -> bytes:
    return wire.question(name, number, boot_id=boot_id, **of)


def next_number(line: RecordedLine) -> int:
    return int(next(line.link.requests._numbers)) & 0xFFFF


@pytest.mark.parametrize("seed", range(5))
def test_old_bytes_in_any_order_do_nothing_but_stop(line: RecordedLine, seed: int) -> None:
    device = line.device
    for token in (1, 2, 3):
        device.arm(token, 0, time_to_live_s=1.0)
        if token != 2:
            device.fire(token)
        device.disarm(token)
        line.clock.wait(0.1)
    rng = np.random.default_rng(seed)
    old = list(line.sent)
    device.set_levels([50.0, 50.0])
    device.arm(4, 0, time_to_live_s=10.0)
    for index in rng.integers(len(old), size=300):
        assert {*line.refusals(old[int(index)])} <= {Refusal.STALE, Refusal.BAD_UPLOAD, None}
    assert line.core.state is State.ARMED
    delivery = device.fire(4)
    assert (delivery.outcome, delivery.levels_vpp[0]) == (Outcome.FIRED, 50.0)
    line.clock.wait(0.1)
    device.stop()
    for index in rng.permutation(len(line.sent)):
        line.answer(line.sent[int(index)])
    assert str(line.core.state) == "safe"
    assert [burst.token for burst in line.over] == [1, 3, 4]


def test_a_question_for_another_power_cycle_does_nothing_and_leaves_the_count(
    line: RecordedLine,
) -> None:
    number = (next_number(line) + 1000) & 0xFFFF
    foreign = question("ARM", number, boot_id=6, token=1, slot=0, time_to_live_us=1000)
    assert line.refusals(foreign) == [Refusal.WRONG_BOOT]
    line.answer(question("BEAT", 0, boot_id=6))
    line.device.set_levels([0.001, 0.001])
    assert line.core.state is State.LIVE


@pytest.mark.parametrize("boot_id", [5, 6])
def test_a_late_stop_is_obeyed_from_anyone_and_lets_no_old_question_through(
    line: RecordedLine, boot_id: int
) -> None:
    late = (next_number(line) - 500) & 0xFFFF
    line.answer(question("STOP", late, boot_id=boot_id))
    assert line.refusals(question("OUTPUT", (late + 100) & 0xFFFF)) == [Refusal.STALE]
    assert line.core.state is State.SAFE


def stop_at(line: RecordedLine, nth: int, kind: str) -> None:
    """Have the host stop, from another thread, as it sends its nth question of a type."""
    n_left = [nth]

    def stop(data: bytes) -> None:
        n_left[0] -= kind in wire.kinds(data)
        if n_left[0] == 0:
            line.on_write = lambda later: None
            Thread(target=line.link.stop).run()

    line.on_write = stop


def test_a_stop_during_an_enable_has_the_last_word(line: RecordedLine) -> None:
    stop_at(line, 1, "OUTPUT")
    assert refusal(line.device.enable, Rejected) is Refusal.SAFE_STATE
    assert line.core.state is State.SAFE


def test_a_stop_after_the_device_enabled_has_the_last_word_too(line: RecordedLine) -> None:
    def late(data: bytes) -> bytes:
        line.on_read = lambda later: later
        line.link.requests.last_stop -= 1
        return data

    line.on_read = late
    line.device.enable()
    assert line.core.state is line.link.state is State.SAFE


def test_a_stop_during_an_upload_is_obeyed_at_once_and_the_upload_goes_on(
    line: RecordedLine,
) -> None:
    stop_at(line, 3, "DATA")
    n_before = len(line.sent)
    samples = sine(600)
    line.device.load(5, np.stack([samples, samples]))
    writes = [wire.kinds(data) for data in line.sent[n_before:]]
    third = [number for number, kinds in enumerate(writes) if "DATA" in kinds][2]
    assert "STOP" in writes[third + 1]
    assert "DATA" in writes[third + 2]
    assert np.array_equal(line.core._slots[5].codes[0], np.trunc(samples * 32767))
    assert line.core.state is line.link.state is State.SAFE
    line.link.beat()
    assert wire.kinds(line.sent[-1])[-1] == "BEAT"


def test_the_heart_sends_the_stop_again_until_it_is_confirmed(line: RecordedLine) -> None:
    line.link.stop()
    line.pending = b""
    for kind in ("STOP", "BEAT"):
        line.link.beat()
        assert {*wire.kinds(line.sent[-1])} == {kind}
        line.link.exchange(wire.message("PING"))


@pytest.mark.parametrize(
    "payload",
    [
        lambda said: said[:-1],
        lambda said: b"",
        lambda said: b"\xfe" + said[1:],
        lambda said: said[:18] + b"\x02" + said[19:],
        lambda said: said[:1] + b"\x63" + said[2:],
    ],
    ids=["short", "empty", "unknown refusal", "another token", "unknown state"],
)
def test_an_answer_to_fire_that_makes_no_sense_is_no_refusal(
    line: RecordedLine, payload: Callable[[bytes], bytes]
) -> None:
    line.on_read = lambda data: wire.answer_otherwise(data, "FIRE", payload)
    with pytest.raises(LinkError):
        play(line.device, 1)
    assert line.device.query(1).outcome is Outcome.FIRED


def test_a_fire_without_answer_is_asked_for_and_its_record_comes(line: RecordedLine) -> None:
    line.on_read = lambda data: wire.answer_otherwise(data, "FIRE", lambda payload: None)
    delivery = play(line.device, 1, within_s=5.0)
    assert delivery.outcome is Outcome.FIRED
    assert delivery.retries >= PATIENCE_S / 0.025 - 1
    assert delivery.host_before_s <= 0.0 <= delivery.host_after_s
    assert delivery.uncertainty_s < 0.001


@pytest.mark.parametrize("restart_after_s", [1.0, PATIENCE_S + 0.1, 2 * PATIENCE_S + 0.2])
def test_a_restart_while_a_fire_is_unanswered_is_indeterminate(restart_after_s: float) -> None:
    trials = Virtual("", 1)
    trials.device.arm(1, 0, time_to_live_s=5.0)
    trials.rig.set_faults("drop=1")
    wait, restart_s = trials.clock.wait, trials.clock.now_s() + restart_after_s

    def restarting(duration_s: float) -> None:
        wait(duration_s)
        if trials.clock.now_s() > restart_s and trials.rig.faults.script.drop:
            trials.rig.set_faults("")
            trials.rig.emulator.reset()

    trials.clock.wait = restarting  # type: ignore[method-assign] # the device's power fails
    delivery = trials.device.fire(1)
    assert delivery.outcome is Outcome.INDETERMINATE
    assert (delivery.boot_id != trials.boot_id) == (restart_after_s < 2 * PATIENCE_S)
