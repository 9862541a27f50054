"""A host and a device on a bad line: what the host says is what was emitted, or that it is unknown.

Every byte of the wire passes through the code of the real link and the real emulator; the line is
a pair of buffers and the clock is virtual, so that thousands of trials take seconds.
"""

import io
import json
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from threading import Thread

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from device.clock import VirtualClock
from device.core.core import DeviceCore
from device.core.host import HostDriver
from device.core.messages import Arm, Beat, Enable, Levels, Message, Ping, Stop
from device.core.output import Emission, OutputStage
from device.core.states import State
from device.driver import (
    Delivery,
    DeviceError,
    Identity,
    LinkError,
    Outcome,
    Refusal,
    RefusedError,
    Rejected,
)
from device.emulate.emulator import Nature
from device.emulate.faults import Faults, FaultScript
from device.limits import Limits
from device.wire import codec
from device.wire.codec import AnswerPayload, Kind
from device.wire.endpoint import Endpoint
from device.wire.frames import Decoder, Frame, encode
from device.wire.link import FrameLink
from tests.test_device.in_process import InProcess

LIMITS = Limits(ceiling_vpp=200.0, least_interval_s=0.005)
RATE_HZ = 12_000.0
BURST = np.sin(2 * np.pi * np.arange(25) / 24)
BURST[-1] = 0.0
SILENCE = np.zeros_like(BURST)
PAIRS = [(BURST, SILENCE), (SILENCE, BURST), (BURST, BURST), (SILENCE, SILENCE)]
WINDOW_S = 3.0
DRIFT_PPM = 80.0
PATIENCE_S = 2.0
RESTS_S = (0.008, 0.02, 0.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What the host said of a token, and what would excuse it for not knowing."""

    outcome: Outcome
    levels_mv: tuple[int, int] = (0, 0)
    onset_s: tuple[float, float] = (-math.inf, math.inf)
    retries: int = 0
    restarted: bool = False
    lost: bool = False
    asked_s: float = 0.0


@dataclass(slots=True)
class Trials:
    """A host that runs trials as a session does, and keeps what it was told."""

    script: str
    seed: int
    claims: dict[int, Claim] = field(default_factory=dict)
    windows_s: dict[int, tuple[float, float]] = field(default_factory=dict)
    clock: VirtualClock = field(default_factory=lambda: VirtualClock(start_s=100.0))
    truth: io.StringIO = field(default_factory=io.StringIO)
    rng: np.random.Generator = field(init=False)
    faults: Faults = field(init=False)
    rig: InProcess = field(init=False)
    device: HostDriver = field(init=False)
    tokens: "count[int]" = field(default_factory=lambda: count(1))
    boot_id: int = 0

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.faults = Faults(FaultScript.parse(self.script), self.rng.spawn(1)[0])
        nature = Nature(
            limits=LIMITS, output=OutputStage(sample_rate_hz=RATE_HZ), drift_ppm=DRIFT_PPM
        )
        self.rig = InProcess(self.clock, nature=nature, faults=self.faults, truth=self.truth)
        self.device = HostDriver(self.rig.link, limits=LIMITS, clock=self.clock)
        self.reopen()

    def reopen(self) -> None:
        """Connect and make ready, as often as it takes."""
        for _ in range(200):
            try:
                self.device.close()
                self.boot_id = self.device.open().boot_id
                for slot, pair in enumerate(PAIRS):
                    self.device.load(slot, *pair)
                self.device.enable()
            except DeviceError:
                continue
            return
        pytest.fail("the device cannot be reached any more")

    def trial(self) -> int:
        """Run one trial; return its token."""
        token, slot = next(self.tokens), int(self.rng.integers(4))
        level_vpp = float(self.rng.integers(1, 200_001)) / 1000
        begin_s, boot_id = self.clock.now_s(), self.boot_id
        try:
            self.device.set_levels(level_vpp, level_vpp)
            self.device.arm(token, slot, time_to_live_s=WINDOW_S)
            self.windows_s[token] = begin_s, self.clock.now_s() + WINDOW_S
            began_s = self.clock.now_s()
            said = self.device.fire(token)
            restarted = said.boot_id != boot_id
            asked_s = self.clock.now_s() - began_s
            self.claim(said, restarted=restarted, asked_s=asked_s)
            if restarted:
                self.reopen()
        except RefusedError:
            self.claims[token] = Claim(outcome=Outcome.NOT_FIRED)
            self.ready_again()
        except LinkError:
            self.settle(token, boot_id)
        return token

    def claim(self, said: Delivery, *, restarted: bool, asked_s: float, lost: bool = False) -> None:
        levels_vpp = said.level_left_vpp, said.level_right_vpp
        self.claims[said.token] = Claim(
            outcome=said.outcome,
            levels_mv=(round(levels_vpp[0] * 1000), round(levels_vpp[1] * 1000)),
            onset_s=(said.host_before_s, said.host_after_s),
            retries=said.retries,
            restarted=restarted,
            lost=lost,
            asked_s=asked_s,
        )

    def ready_again(self) -> None:
        """Switch the output on again after a watchdog's stop."""
        try:
            self.device.enable()
        except DeviceError:
            self.reopen()

    def settle(self, token: int, boot_id: int) -> None:
        """Ask for a token after the line was lost, as a resumed session does."""
        for _ in range(200):
            self.reopen()
            began_s = self.clock.now_s()
            try:
                self.device.disarm(token)
                said = self.device.query(token)
            except DeviceError:
                continue
            if said.boot_id != boot_id:
                self.claims[token] = Claim(outcome=Outcome.INDETERMINATE, restarted=True, lost=True)
            else:
                asked_s = self.clock.now_s() - began_s
                self.claim(said, restarted=False, asked_s=asked_s, lost=True)
            return
        pytest.fail("no answer to any question")

    def run(self, n_trials: int) -> "Trials":
        for _ in range(n_trials):
            self.trial()
            self.rig.wait(float(self.rng.choice(RESTS_S)))
        return self

    def bursts(self) -> list[dict[str, object]]:
        events = [json.loads(line) for line in self.truth.getvalue().splitlines()]
        return [event for event in events if event["event"] == "burst"]


def check(trials: Trials) -> Counter[str]:
    """Join what the host said with what was emitted, by token; return the counts."""
    emitted = {}
    for burst in trials.bursts():
        token = burst["token"]
        assert isinstance(token, int)
        assert token not in emitted, "two bursts for one token"
        emitted[token] = burst
    for token, said in trials.claims.items():
        if said.outcome is Outcome.INDETERMINATE:
            assert said.restarted or said.lost or said.asked_s >= PATIENCE_S
        else:
            assert (said.outcome is Outcome.FIRED) == (token in emitted)
    for token, burst in emitted.items():
        said, t_s = trials.claims[token], burst["t_s"]
        assert isinstance(t_s, float)
        onset_s = 100.0 + t_s / (1 + DRIFT_PPM * 1e-6)
        begin_s, end_s = trials.windows_s[token]
        assert begin_s - 2e-6 <= onset_s <= end_s + WINDOW_S * 1e-4
        if said.outcome is Outcome.FIRED:
            assert burst["levels_mv"] == list(said.levels_mv)
            assert said.onset_s[0] - 2e-6 <= onset_s <= said.onset_s[1] + 2e-6
    counts = Counter(said.outcome.value for said in trials.claims.values())
    counts["bursts"] = len(emitted)
    counts["retries"] = sum(said.retries for said in trials.claims.values())
    return counts


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
        counts += check(Trials(SCRIPTS[name], seed).run(TRIALS_EACH))
    print(f"{name}: {len(SEEDS) * TRIALS_EACH} trials, {dict(counts)}")
    assert counts["fired"] > len(SEEDS) * TRIALS_EACH / 2
    if name in LOSSLESS:
        assert counts["indeterminate"] <= 0.01 * len(SEEDS) * TRIALS_EACH


@pytest.mark.slow
def test_a_line_lost_at_any_byte_of_a_trial_leaves_no_trial_wrong() -> None:
    whole = 0
    counts: Counter[str] = Counter()
    for n_bytes in count(1):
        trials = Trials("", n_bytes)
        trials.faults._room = n_bytes
        before_s = trials.clock.now_s()
        trials.trial()
        whole = n_bytes
        was_cut = trials.clock.now_s() > before_s or trials.claims[1].lost
        trials.rig.wait(0.02)
        trials.trial()
        counts += check(trials)
        if not was_cut:
            break
    print(f"cut after 1 to {whole} bytes: {dict(counts)}")
    assert whole > 150
    assert counts["indeterminate"] == 0


def test_numbers_that_wrap_around_leave_no_trial_wrong() -> None:
    trials = Trials(SCRIPTS["all but losses"], 1)
    trials.rig.link._numbers = count(2**16 - 200)
    trials.reopen()
    assert check(trials.run(100))["fired"] > 90


# --- a line that plays old bytes again


class Line:
    """A device at the end of a line that keeps all that a host ever sent; time stands still."""

    def __init__(self) -> None:
        self.over: list[Emission] = []
        core = DeviceCore(boot_id=5, limits=LIMITS, output=OutputStage(), sink=self.over.append)
        identity = Identity(
            model="m",
            serial_number="1",
            boot_id=5,
            protocol_version="1.0",
            sample_rate_hz=48_000.0,
            bits=16,
            channels=2,
            ceiling_vpp=200.0,
            longest_waveform=4096,
            emulated=True,
        )
        self.core = core
        self.endpoint = Endpoint(core, identity)
        self.clock = VirtualClock()
        self.sent: list[bytes] = []
        self.pending = b""
        self.on_write: Callable[[bytes], None] = lambda data: None

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        self.on_write(data)
        self.pending += self.endpoint.receive(round(self.clock.now_s() * 1e6), data)

    def read(self, timeout_s: float) -> bytes:
        data, self.pending = self.pending, b""
        self.clock.wait(0.0 if data else timeout_s)
        return data

    def close(self) -> None:
        self.endpoint.hang_up(round(self.clock.now_s() * 1e6))

    def receive(self, data: bytes) -> list[AnswerPayload]:
        frames = Decoder().feed(self.endpoint.receive(round(self.clock.now_s() * 1e6), data))
        return [codec.HEAD.read(frame.payload) for frame in frames]

    def link(self) -> FrameLink:
        return FrameLink(lambda: self, self.clock)


def live_link() -> tuple[Line, FrameLink, HostDriver]:
    line = Line()
    link = line.link()
    device = HostDriver(link, limits=LIMITS, clock=line.clock)
    device.open()
    device.load(0, BURST, SILENCE)
    device.enable()
    device.set_levels(100.0, 100.0)
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
        assert all(
            answer.refusal in {Refusal.STALE, None} for answer in line.receive(old[int(index)])
        )
    assert line.core.state is State.ARMED
    felt = device.fire(4)
    assert (felt.outcome, felt.level_left_vpp) == (Outcome.FIRED, 50.0)
    line.clock.wait(0.1)
    device.stop()
    for index in rng.permutation(len(line.sent)):
        line.receive(line.sent[int(index)])
    assert state_of(line) is State.SAFE
    assert [burst.token for burst in line.over] == [1, 3, 4]


def test_a_greeting_of_an_earlier_connection_is_stale() -> None:
    line, _, device = live_link()
    (hello, *_) = line.sent
    device.close()
    device.open()
    device.load(0, BURST, SILENCE)
    device.enable()
    assert [answer.refusal for answer in line.receive(hello)] == [Refusal.STALE]
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
    line.receive(question(Stop(), number + 1))
    assert [answer.refusal for answer in line.receive(question(Enable(), number))] == [
        Refusal.STALE
    ]
    assert line.core.state is State.SAFE


def test_a_device_answers_no_answers() -> None:
    line, _, device = live_link()
    device.query(9)
    answer = line.endpoint.receive(0, line.sent[-1])
    assert answer
    assert line.endpoint.receive(0, answer) == b""


def test_a_question_for_another_power_cycle_does_nothing_and_leaves_the_count() -> None:
    line, link, _ = live_link()
    number = (next(link._numbers) + 1000) & 0xFFFF
    arm = Arm(token=1, slot=0, time_to_live_us=1000)
    foreign = question(arm, number, boot_id=6)
    assert [answer.refusal for answer in line.receive(foreign)] == [Refusal.WRONG_BOOT]
    line.receive(question(Beat(), 0, boot_id=6))
    link.exchange(Levels(left_mvpp=1, right_mvpp=1))
    assert line.core.state is State.LIVE


@pytest.mark.parametrize("boot_id", [5, 6])
def test_a_stop_is_obeyed_from_anyone(boot_id: int) -> None:
    line, link, _ = live_link()
    stop = Frame(kind=Kind.STOP, sequence=(next(link._numbers) - 500) & 0xFFFF, payload=b"")
    line.receive(encode(stop))
    assert line.core.state is State.SAFE
    line.receive(question(Stop(), 0, boot_id=boot_id))
    assert line.core.state is State.SAFE


# --- stops and questions at once


def test_a_stop_during_an_enable_has_the_last_word() -> None:
    line, link, _ = live_link()

    def stop_now(data: bytes) -> None:
        line.on_write = lambda later: None
        Thread(target=link.stop).run()

    line.on_write = stop_now
    with pytest.raises(Rejected) as refused:
        link.exchange(Enable())
    assert refused.value.code is Refusal.SAFE_STATE
    assert line.core.state is State.SAFE


def test_a_stop_after_the_device_enabled_has_the_last_word_too() -> None:
    line, link, _ = live_link()
    read = line.read

    def late(timeout_s: float) -> bytes:
        line.read = read  # type: ignore[method-assign] # a fault in one read only
        data = read(timeout_s)
        link._last_stop -= 1
        return data

    line.read = late  # type: ignore[method-assign] # as above
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
    gone = line.write

    def lost(data: bytes) -> None:
        raise LinkError("gone")

    line.write = lost  # type: ignore[method-assign] # a line that is gone
    device.stop()
    device.close()
    line.write = gone  # type: ignore[method-assign] # and back
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


# --- answers that are none


def overwrite_answers(line: Line, kind: Kind, payload: Callable[[bytes], bytes]) -> None:
    """Have the device answer questions of one kind with something else."""
    read = line.read

    def other(timeout_s: float) -> bytes:
        frames = Decoder().feed(read(timeout_s))
        return b"".join(
            encode(
                frame
                if frame.kind != kind | codec.ANSWER
                else Frame(kind=frame.kind, sequence=frame.sequence, payload=payload(frame.payload))
            )
            for frame in frames
        )

    line.read = other  # type: ignore[method-assign] # the device's answers, changed


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
    device.arm(1, 0, time_to_live_s=1.0)
    overwrite_answers(line, Kind.FIRE, payload)
    with pytest.raises(LinkError):
        device.fire(1)
    assert device.query(1).outcome is Outcome.FIRED


def test_a_fire_without_answer_is_asked_for_and_found() -> None:
    line, _, device = live_link()
    device.arm(1, 0, time_to_live_s=5.0)
    overwrite_answers(line, Kind.FIRE, lambda said: said)
    silent = line.read

    def no_fire(timeout_s: float) -> bytes:
        data = silent(timeout_s)
        if any(frame.kind == Kind.FIRE | codec.ANSWER for frame in Decoder().feed(data)):
            line.clock.wait(timeout_s)
            return b""
        return data

    line.read = no_fire  # type: ignore[method-assign] # every answer to FIRE is lost
    felt = device.fire(1)
    assert felt.outcome is Outcome.FIRED
    assert felt.retries >= PATIENCE_S / 0.025 - 1
    assert felt.host_before_s <= 0.0 <= felt.host_after_s
    assert felt.uncertainty_s < 0.001


@pytest.mark.parametrize("restart_after_s", [1.0, PATIENCE_S + 0.1, 2 * PATIENCE_S + 0.2])
def test_a_restart_while_a_fire_is_unanswered_is_indeterminate(restart_after_s: float) -> None:
    trials = Trials("", 1)
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


# --- any order


class AnyOrder(RuleBasedStateMachine):
    """Trials, faults, stops, restarts and lost lines in any order."""

    @initialize(seed=st.integers(0, 2**32 - 1))
    def begin(self, seed: int) -> None:
        self.trials = Trials("", seed)

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
            check(self.trials)


TestAnyOrder = pytest.mark.slow(AnyOrder.TestCase)
TestAnyOrder.settings = settings(deadline=None, max_examples=60, stateful_step_count=25)
