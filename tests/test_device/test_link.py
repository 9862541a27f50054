"""A host and a device on a bad line: what the host says is what was emitted, or that it is unknown.

Every byte of the wire passes through the code of the real link and the real emulator; the line is
a pair of buffers and the clock is virtual, so that thousands of trials take seconds.
"""

import io
import json
from collections import Counter
from collections.abc import Callable
from itertools import count
from threading import Thread
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from device.clock import VirtualClock
from device.core.host import HostDriver
from device.core.messages import Arm, AskLimits, Beat, Enable, Levels, Message, Ping, Stop, to_codes
from device.core.output import Emission, OutputStage
from device.core.states import State
from device.driver import Outcome
from device.emulate.emulator import Nature
from device.emulate.faults import Faults, FaultScript
from device.errors import DeviceError, LinkError, Refusal, Rejected
from device.wire import codec
from device.wire.channels import LineSettings
from device.wire.codec import Kind
from device.wire.dialogue import _LONG_ROUND, _SHORT_ROUND, framed
from device.wire.frames import Decoder, Frame, encode
from device.wire.link import FrameLink
from tests.test_device.bursts import identity, play, ready, refusal, sine
from tests.test_device.in_process import InProcess, endpoint
from tests.test_device.trials import LIMITS, PATIENCE_S, Trials

DRIFT_PPM = 80.0
NATURE = Nature(limits=LIMITS, output=OutputStage(sample_rate_hz=12_000.0), drift_ppm=DRIFT_PPM)


class Virtual(Trials):
    """Trials with an emulator in this process."""

    clock: VirtualClock

    def __init__(self, script: str, seed: int) -> None:
        clock, rng = VirtualClock(start_s=100.0), np.random.default_rng(seed)
        self.truth = io.StringIO()
        self.faults = Faults(FaultScript.parse(script), rng.spawn(1)[0])
        self.rig = InProcess(clock, nature=NATURE, faults=self.faults, truth=self.truth)
        super().__init__(self.rig.link, clock, rng)

    def run(self, n_trials: int) -> "Virtual":
        for _ in range(n_trials):
            self.trial()
            self.rig.wait(float(self.rng.choice([0.008, 0.02, 0.3])))
        return self

    def counts(self) -> Counter[str]:
        truth = [json.loads(line) for line in self.truth.getvalue().splitlines()]
        return self.check(truth, drift_ppm=DRIFT_PPM)


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
SEEDS = range(4)
TRIALS_EACH = 250


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_what_the_host_says_is_what_was_emitted_or_it_says_that_it_does_not_know(name: str) -> None:
    counts: Counter[str] = Counter()
    for seed in SEEDS:
        counts += Virtual(SCRIPTS[name], seed).run(TRIALS_EACH).counts()
    print(f"{name}: {len(SEEDS) * TRIALS_EACH} trials, {dict(counts)}")
    assert counts["fired"] > len(SEEDS) * TRIALS_EACH / 2
    if name in LOSSLESS:
        assert counts["indeterminate"] <= 0.01 * len(SEEDS) * TRIALS_EACH


def why_not_open(baud: int | None, line: LineSettings, script: str, seed: int) -> str:
    """Return why a line cannot be opened, or nothing."""
    nature = Nature(limits=LIMITS, output=OutputStage(), baud=baud)
    faults, truth = Faults(FaultScript.parse(script), np.random.default_rng(seed)), io.StringIO()
    rig = InProcess(VirtualClock(), nature=nature, faults=faults, truth=truth, line=line)
    rig.beating = False  # as a host's heart is only once it is connected
    try:
        rig.link.hello()
    except LinkError as error:
        return str(error)
    return ""


@pytest.mark.slow
@pytest.mark.parametrize("script", [*SCRIPTS.values(), "stall=0.6,stall_s=0.15"])
def test_neither_a_bad_line_nor_a_busy_device_is_called_slow(script: str) -> None:
    told = [why_not_open(None, LineSettings(), script, seed) for seed in range(40)]
    assert not [said for said in told if "slow" in said]


def test_the_rounds_that_tell_rate_from_delay_are_as_long_as_they_are_taken_for() -> None:
    device = endpoint(identity(boot_id=5), sink=lambda _: None)
    asked: list[Message[Any]] = [Ping(), AskLimits()]
    questions = [encode(framed(one, number, 5)) for number, one in enumerate(asked)]
    n_bytes = [len(one) + len(device.receive(10, one)) for one in questions]
    assert n_bytes == [_SHORT_ROUND, _LONG_ROUND] == [48, 103]


@pytest.mark.parametrize("baud", [1200, 2400, 4800, 9600, 19_200, 38_400])
def test_a_slow_wire_is_called_slow_by_its_rate_and_driven_when_that_is_told(baud: int) -> None:
    told = why_not_open(baud, LineSettings(), "", 1)
    assert "the line is too slow" in told
    assert f"give device.baud = {baud}, or let both ends have 57600 or more" in told
    assert why_not_open(baud, LineSettings(baud=baud), "", 1) == ""
    assert why_not_open(57_600, LineSettings(), "", 1) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_an_upload_arrives_whole_over_any_line_or_is_said_to_have_failed(name: str) -> None:
    counts: Counter[str] = Counter()
    for seed in range(20):
        trials = Virtual(SCRIPTS[name], seed)
        trials.link._data_numbers = count(2**16 - 40)
        samples = sine(600, peak=float(trials.rng.uniform(0.1, 1.0)), cycles=seed + 1)
        try:
            trials.device.load(5, samples, -samples)
        except DeviceError:
            counts["failed"] += 1
            continue
        codes = to_codes(samples, 16)
        stored = trials.rig.emulator._endpoint.core._slots[5].codes
        assert np.array_equal(stored, (codes, -codes))
        counts["stored"] += 1
    print(f"{name}: {dict(counts)}")
    assert counts["stored"] == 20 or name not in LOSSLESS
    assert counts["stored"] > 0


@pytest.mark.slow
def test_a_line_lost_at_any_byte_of_a_trial_leaves_no_trial_wrong() -> None:
    counts: Counter[str] = Counter()
    for n_bytes in count(1):
        trials = Virtual("", n_bytes)
        trials.faults._room = n_bytes
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


@pytest.mark.slow
def test_numbers_that_wrap_around_leave_no_trial_wrong() -> None:
    trials = Virtual(SCRIPTS["all but losses"], 1)
    trials.link._numbers = count(2**16 - 200)
    trials.reopen()
    assert trials.run(100).counts()["fired"] > 90


class Line:
    """A device at the end of a line that keeps all that a host ever sent; time stands still."""

    def __init__(self) -> None:
        self.over: list[Emission] = []
        self.endpoint = endpoint(identity(boot_id=5), sink=self.over.append)
        self.core = self.endpoint.core
        self.clock = VirtualClock()
        self.sent: list[bytes] = []
        self.pending = b""
        self.on_write: Callable[[bytes], None] = lambda data: None
        self.on_read: Callable[[bytes], bytes] = lambda data: data

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        self.on_write(data)
        self.pending += self.answer(data)

    def read(self, timeout_s: float) -> bytes:
        data, self.pending = self.on_read(self.pending), b""
        self.clock.wait(0.0 if data else timeout_s)
        return data

    def close(self) -> None:
        self.endpoint.hang_up(round(self.clock.now_s() * 1e6))

    def answer(self, data: bytes) -> bytes:
        return self.endpoint.receive(round(self.clock.now_s() * 1e6), data)

    def refusals(self, data: bytes) -> list[Refusal | None]:
        """Return why the device refuses each question of these bytes, if it does."""
        frames = Decoder().feed(self.answer(data))
        return [codec.HEAD.read(frame.payload).refusal for frame in frames]

    def link(self) -> FrameLink:
        return FrameLink(lambda: self, self.clock)


def live_link() -> tuple[Line, FrameLink, HostDriver]:
    line = Line()
    link = line.link()
    device = HostDriver(link, limits=LIMITS, clock=line.clock)
    ready(device, 100.0)
    return line, link, device


def state_of(line: Line) -> State:
    return line.core.state


@pytest.mark.parametrize("seed", range(20))
def test_old_bytes_in_any_order_do_nothing_but_stop(seed: int) -> None:
    line, _, device = live_link()
    for token in (1, 2, 3):
        device.arm(token, 0, time_to_live_s=1.0)
        if token != 2:
            device.fire(token)
        device.disarm(token)
        line.clock.wait(0.1)
    rng = np.random.default_rng(seed)
    old = list(line.sent)
    device.set_levels(50.0, 50.0)
    device.arm(4, 0, time_to_live_s=10.0)
    for index in rng.integers(len(old), size=300):
        assert {*line.refusals(old[int(index)])} <= {Refusal.STALE, Refusal.BAD_UPLOAD, None}
    assert line.core.state is State.ARMED
    felt = device.fire(4)
    assert (felt.outcome, felt.level_left_vpp) == (Outcome.FIRED, 50.0)
    line.clock.wait(0.1)
    device.stop()
    for index in rng.permutation(len(line.sent)):
        line.answer(line.sent[int(index)])
    assert state_of(line) is State.SAFE
    assert [burst.token for burst in line.over] == [1, 3, 4]


def test_a_greeting_of_an_earlier_connection_is_stale() -> None:
    line, _, device = live_link()
    (hello, *_) = line.sent
    device.close()
    ready(device)
    assert line.refusals(hello) == [Refusal.STALE]
    assert line.core.state is State.LIVE


def test_a_new_host_begins_with_the_outputs_at_zero_though_nothing_was_hung_up() -> None:
    line, _, _ = live_link()
    line.link().hello()
    assert line.core.state is State.SAFE


def question(message: Message[None], number: int, *, boot_id: int = 5) -> bytes:
    kind, payload = codec.kind_of(message), codec.payload(message, boot_id)
    return encode(Frame(kind=kind, sequence=number, payload=payload))


def test_an_output_that_a_stop_overtook_stays_off() -> None:
    line, link, _ = live_link()
    number = next(link._numbers) & 0xFFFF
    line.answer(question(Stop(), number + 1))
    assert line.refusals(question(Enable(), number)) == [Refusal.STALE]
    assert line.core.state is State.SAFE


def test_a_device_answers_no_answers() -> None:
    line, _, device = live_link()
    device.query(9)
    answer = line.answer(line.sent[-1])
    assert answer
    assert line.answer(answer) == b""


def test_a_question_for_another_power_cycle_does_nothing_and_leaves_the_count() -> None:
    line, link, _ = live_link()
    number = (next(link._numbers) + 1000) & 0xFFFF
    arm = Arm(token=1, slot=0, time_to_live_us=1000)
    foreign = question(arm, number, boot_id=6)
    assert line.refusals(foreign) == [Refusal.WRONG_BOOT]
    line.answer(question(Beat(), 0, boot_id=6))
    link.exchange(Levels(left_mvpp=1, right_mvpp=1))
    assert line.core.state is State.LIVE


@pytest.mark.parametrize("payload", [b"", codec.payload(Stop(), 5), codec.payload(Stop(), 6)])
def test_a_late_stop_is_obeyed_from_anyone_and_lets_no_old_question_through(payload: bytes) -> None:
    line, link, _ = live_link()
    late = (next(link._numbers) - 500) & 0xFFFF
    line.answer(encode(Frame(kind=Kind.STOP, sequence=late, payload=payload)))
    assert line.refusals(question(Enable(), (late + 100) & 0xFFFF)) == [Refusal.STALE]
    assert line.core.state is State.SAFE


def test_a_stop_during_an_enable_has_the_last_word() -> None:
    line, link, _ = live_link()

    def stop_now(data: bytes) -> None:
        line.on_write = lambda later: None
        Thread(target=link.stop).run()

    line.on_write = stop_now
    assert refusal(lambda: link.exchange(Enable()), Rejected) is Refusal.SAFE_STATE
    assert line.core.state is State.SAFE


def test_a_stop_during_an_upload_is_obeyed_at_once_and_the_upload_goes_on() -> None:
    line, link, device = live_link()
    n_data = count(1)
    stopped_after: list[int] = []

    def stop_at_third(data: bytes) -> None:
        frames = Decoder().feed(data)
        if any(frame.kind == Kind.STOP for frame in frames):
            stopped_after.append(next(n_data))
        if sum(frame.kind == Kind.DATA for frame in frames) and next(n_data) == 3:
            link.stop()

    line.on_write = stop_at_third
    samples = sine(600)
    device.load(5, samples, samples)
    assert stopped_after == [4]
    assert np.array_equal(line.core._slots[5].codes[0], to_codes(samples, 16))
    assert (state_of(line), link.state, link._stops) == (State.SAFE, State.SAFE, set())


def test_a_stop_after_the_device_enabled_has_the_last_word_too() -> None:
    line, link, _ = live_link()

    def late(data: bytes) -> bytes:
        line.on_read = lambda later: later
        link._last_stop -= 1
        return data

    line.on_read = late
    link.exchange(Enable())
    assert line.core.state is State.SAFE
    assert link.state is State.SAFE


def test_a_stop_during_a_greeting_is_sent_before_the_next_question() -> None:
    line = Line()
    link = line.link()

    def stop_at_hello(data: bytes) -> None:
        line.on_write = lambda later: None
        link.stop()
        line.pending = b""

    line.on_write = stop_at_hello
    link.hello()
    assert link.state is State.SAFE
    link.exchange(Levels(left_mvpp=0, right_mvpp=0))
    assert line.core.state is State.SAFE
    assert not link._stops


def test_a_stop_that_no_line_took_is_sent_on_the_next() -> None:
    line, link, device = live_link()

    def lost(data: bytes) -> None:
        raise LinkError("gone")

    line.on_write = lost
    device.stop()
    device.close()
    line.on_write = lambda data: None
    device.open()
    assert not link._stops
    assert line.core.state is State.SAFE


def test_the_heart_sends_the_stop_again_until_it_is_confirmed() -> None:
    line, link, _ = live_link()
    link.stop()
    line.pending = b""
    n_sent = len(line.sent)
    link.beat()
    (again,) = [frame for data in line.sent[n_sent:] for frame in Decoder().feed(data)]
    assert again.kind == Kind.STOP
    link.exchange(Ping())
    link.beat()
    assert {frame.kind for frame in Decoder().feed(line.sent[-1])} == {Kind.BEAT}


def test_a_link_that_is_not_connected_beats_and_stops_in_silence() -> None:
    line = Line()
    link = line.link()
    link.beat()
    link.stop()
    link.beat()
    assert (line.sent, link.state) == ([], State.CLOSED)


def test_an_answer_to_a_stop_that_was_sent_long_before_tells_no_time() -> None:
    line, link, _ = live_link()
    link.stop()
    line.clock.wait(1.0)
    line.write = lambda data: None  # type: ignore[method-assign] # only the early answer comes
    link._confirm_stops(PATIENCE_S)
    told = link.clock_sync.estimate
    assert told is not None
    assert abs(told.offset_s) <= told.offset_uncertainty_s + 1e-6


def test_stops_of_many_threads_are_all_confirmed() -> None:
    _, link, _ = live_link()
    threads = [Thread(target=link.stop) for _ in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    link.exchange(Ping())
    assert (link._stops, link.state) == (set(), State.SAFE)


def overwrite_fire(line: Line, payload: Callable[[bytes], bytes | None]) -> None:
    """Have the device answer FIRE with something else, or with nothing."""

    def other(data: bytes) -> bytes:
        answers = b""
        for frame in Decoder().feed(data):
            is_fire = frame.kind == Kind.FIRE | codec.ANSWER
            said = payload(frame.payload) if is_fire else frame.payload
            if said is not None:
                answers += encode(Frame(kind=frame.kind, sequence=frame.sequence, payload=said))
        return answers

    line.on_read = other


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
    payload: Callable[[bytes], bytes],
) -> None:
    line, _, device = live_link()
    overwrite_fire(line, payload)
    with pytest.raises(LinkError):
        play(device, 1)
    assert device.query(1).outcome is Outcome.FIRED


def test_a_fire_without_answer_is_asked_for_and_found() -> None:
    line, _, device = live_link()
    overwrite_fire(line, lambda said: None)
    felt = play(device, 1, within_s=5.0)
    assert felt.outcome is Outcome.FIRED
    assert felt.retries >= PATIENCE_S / 0.025 - 1
    assert felt.host_before_s <= 0.0 <= felt.host_after_s
    assert felt.uncertainty_s < 0.001


@pytest.mark.parametrize("restart_after_s", [1.0, PATIENCE_S + 0.1, 2 * PATIENCE_S + 0.2])
def test_a_restart_while_a_fire_is_unanswered_is_indeterminate(restart_after_s: float) -> None:
    trials = Virtual("", 1)
    trials.device.arm(1, 0, time_to_live_s=5.0)
    trials.faults.script = FaultScript(drop=1.0)
    wait, restart_s = trials.clock.wait, trials.clock.now_s() + restart_after_s

    def restarting(duration_s: float) -> None:
        wait(duration_s)
        if trials.clock.now_s() > restart_s and trials.faults.script.drop:
            trials.faults.script = FaultScript()
            trials.rig.emulator.reset()

    trials.clock.wait = restarting  # type: ignore[method-assign] # the device's power fails
    felt = trials.device.fire(1)
    assert felt.outcome is Outcome.INDETERMINATE
    assert (felt.boot_id != trials.boot_id) == (restart_after_s < 2 * PATIENCE_S)


class AnyOrder(RuleBasedStateMachine):
    """Trials, faults, stops, restarts and lost lines in any order."""

    @initialize(seed=st.integers(0, 2**32 - 1))
    def begin(self, seed: int) -> None:
        self.trials = Virtual("", seed)

    @rule(n_trials=st.integers(1, 3))
    def run(self, n_trials: int) -> None:
        self.trials.run(n_trials)

    @rule(name=st.sampled_from(sorted(SCRIPTS)))
    def line(self, name: str) -> None:
        self.trials.faults.script = FaultScript.parse(SCRIPTS[name])

    @rule(n_bytes=st.integers(0, 400))
    def cut(self, n_bytes: int) -> None:
        self.trials.faults._room = n_bytes

    @rule()
    def restart(self) -> None:
        self.trials.rig.emulator.reset()

    @rule(beating=st.booleans())
    def heart(self, *, beating: bool) -> None:
        self.trials.rig.beating = beating

    @rule()
    def stop(self) -> None:
        self.trials.device.stop()

    @rule(duration_s=st.sampled_from([0.001, 0.01, 0.2, 0.7]))
    def wait(self, duration_s: float) -> None:
        self.trials.rig.wait(duration_s)

    @invariant()
    def what_was_said_is_what_was_emitted(self) -> None:
        if hasattr(self, "trials"):
            self.trials.counts()


TestAnyOrder = pytest.mark.slow(AnyOrder.TestCase)
TestAnyOrder.settings = settings(deadline=None, max_examples=60, stateful_step_count=25)
