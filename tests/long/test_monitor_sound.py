"""A monitor on real sound: PortAudio, a sound server's null sink, and its own recording."""

from __future__ import annotations

import math
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import pytest

from device.clock import MonotonicClock
from device.driver import Outcome
from device.errors import LinkError
from device.monitor.inputs import QUIET_S, Calibration, InputMonitor
from device.monitor.matching import Template
from device.monitor.measured import Measured, Tap, Tolerances
from device.sound.audio import AudioDevice
from device.sound.recorder import Recorder
from tests.test_device.bursts import BURST, play, ready
from tests.test_device.counted import LOST, FrameCount, wide_sink
from tests.test_device.in_process import LIMITS
from tests.test_device.loops import (
    DELAY,
    FAULTS,
    FULL_SCALE_V,
    LEVEL_VPP,
    SHARE,
    SIDES,
    Line,
    clean_gain,
    planned,
    scaled,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.sound.stream import Callback
    from tests.processes import NullSink

PAIRS: Final = 4
"""With six or more a busy machine's callback is late, and PulseAudio adds a second of delay."""
LATENCY_S: Final = 0.4
STALLED_S: Final = 0.5
"""Without a call of the stream: nobody hears so long a buffer."""
GONE_S: Final = 5.0
LONGEST_LAG_S: Final = 0.9
MOST_OPENED: Final = 20
"""A busy machine's server begins with a second of delay, or PortAudio gives its stream up."""
SETTLED_S: Final = 0.4
BEGINS_S: Final = 10.0
"""A null sink is silent for its first two seconds."""
RINGING: Final = 16
"""Frames around a burst in which it rings, as it is delayed by a part of a frame."""
MOST_PLAYS: Final = 4
"""For each burst that is wanted: a busy machine's server tears some, which are played again."""


class Sound:
    """One stream to a null sink of many channels: pairs, each a sound card by itself, and a count.

    Two channels carry the number of each frame; so the recording itself tells which frame of the
    outputs each of its frames is, whatever the sound server lost or put in, and when.
    """

    def __init__(self, noises_db: tuple[float, ...]) -> None:
        import sounddevice

        self.frames = 0
        self.count = FrameCount()
        self._called_s = time.monotonic()
        self._flags = 0
        self.over = False  # whoever opened it closes it: PortAudio hangs if two do
        self.pairs = [Pair(self, db, seed=i) for i, db in enumerate(noises_db)]
        channels = 2 + 2 * len(self.pairs)
        self._stream = sounddevice.Stream(
            device="pulse",
            samplerate=48e3,
            channels=channels,
            dtype="int16",
            dither_off=True,
            latency=LATENCY_S,
            callback=self._take,
        )
        self._stream.start()

    @property
    def latency(self) -> float:
        return float(self._stream.latency[1])

    @property
    def active(self) -> bool:
        return not self.over and bool(self._stream.active)

    @property
    def stalled_s(self) -> float:
        """Since when PortAudio has not called."""
        return time.monotonic() - self._called_s

    @property
    def flags(self) -> int:
        """How often PortAudio told of trouble, or did not call for too long."""
        return self._flags + (self.stalled_s > STALLED_S)

    def begin(self) -> None:
        """Wait until what is played is heard without a tear, before anybody plays."""
        until_s = time.monotonic() + BEGINS_S
        while self.count.steady_for() < 48e3 and time.monotonic() < until_s:
            time.sleep(0.1)

    def close(self) -> None:
        self._stream.close()

    def _take(self, heard: Any, out: Any, count: int, timing: Any, status: Any) -> None:
        self._flags = self.flags + bool(status)
        self._called_s = time.monotonic()
        self.count.note(heard[:, :2], self.frames)
        self.count.put(out[:, :2], self.frames)
        for i, pair in enumerate(self.pairs):
            out[:, 2 * i + 2 : 2 * i + 4] = pair.take(
                heard[:, 2 * i + 2 : 2 * i + 4], count, timing, status
            )
        self.frames += count


class Heard(NamedTuple):
    """What was measured, beside what the count of frames tells of the same burst."""

    measured: Measured
    steady: bool
    fits: bool
    late: float


class Pair:
    """A sound card of two channels of a `Sound`, a line on which faults happen, and a monitor."""

    def __init__(self, sound: Sound, noise_db: float, *, seed: int) -> None:
        self._sound = sound
        self.noise_db = noise_db
        self.line = Line(seed=seed)
        self.line.noise = LEVEL_VPP / 2 / FULL_SCALE_V / math.sqrt(2) * 10 ** (-noise_db / 20)
        self.clock = MonotonicClock()
        self.recorder = Recorder(self.clock, 48e3)
        self.device = AudioDevice(
            self._connect,
            limits=LIMITS,
            clock=self.clock,
            volts_full_scale=FULL_SCALE_V,
            sample_rate_hz=48e3,
            name="pair",
            recorder=self.recorder,
        )
        self._callback: Callback | None = None
        self._template = Template(BURST)
        self._first = self._lag = self._token = 0

    latency = property(lambda self: self._sound.latency)
    active = property(lambda self: self._sound.active)

    def close(self) -> None:
        self._callback = None

    def _connect(self, callback: Callback) -> Pair:
        self._callback = callback
        return self

    def take(self, heard: Any, count: int, timing: Any, status: Any) -> Any:
        out = np.zeros((count, 2), dtype=np.int16)
        if self._callback is not None:
            if not self.recorder.frames:
                self._first = self._sound.frames
            self.recorder.take(heard, timing, status)
            self._callback(out, count, timing, status)
        return self.line.through(out)

    def open(self) -> None:
        ready(self.device, LEVEL_VPP)
        self.device.load(2, BURST, BURST)
        self.device.load(3, 0 * BURST, 0 * BURST)
        self._calibrate()

    def _calibrate(self) -> None:
        """Measure the way's delay, as somebody does who opens a sound server's card anew."""
        give_up_s = self.clock.now_s() + 4 * GONE_S
        while True:
            self.clock.wait(SETTLED_S)
            if self.clock.now_s() > give_up_s:  # it is called, and hears nothing
                self._sound.over = True
            if not self._sound.active or self._sound.stalled_s > GONE_S:
                raise LinkError("PortAudio has given the stream up")
            if self._sound.count.steady_for() > SETTLED_S / 2 * 48e3:
                break
        self._lag = self._sound.count.torn[-1].lag
        if self._lag > LONGEST_LAG_S * 48e3:
            self._sound.over = True
            raise LinkError("the way is longer than a delay may be")
        self.monitor = InputMonitor(
            self.recorder,
            self.clock,
            tap=Tap.LINE,
            calibration=Calibration(
                per_unit=(FULL_SCALE_V,) * 2, delay_s=((self._lag + DELAY) / 48e3,) * 2
            ),
            tolerances=Tolerances(),
            source="null sink",
            played=self.device.played,
        )
        self.monitor.open()

    @contextmanager
    def ending_all(self) -> Iterator[None]:
        """Let the other pairs end, too, where a claim does not hold here."""
        try:
            yield
        except AssertionError:
            self._sound.over = True
            raise

    def measure(self, side: str) -> Heard:
        """Play a burst, and return what was measured of it."""
        slot, left, right = SIDES[side]
        self._token += 1
        before, flags = self._sound.count.torn[-1], self._sound.flags
        self._rest()
        self.monitor.begin(self._token, planned(side))
        delivery = play(self.device, self._token, slot)
        self.clock.wait(0.06)
        measured = self.monitor.end(delivery)
        began, lag, late, fits = self.device.played(), None, math.nan, False
        if began is not None:
            first = self._first + began + int(min(self.line.delays)) - RINGING
            lag = self._sound.count.lag_of(first, len(BURST) + 3 * RINGING)
            fits = lag is not None or self._fits(self._first + began, (left, right))
        on = [d for d, on in zip(self.line.delays, (left, right), strict=True) if on]
        if lag is not None and on:
            late = lag - self._lag + min(on) - DELAY
        steady = delivery.outcome is Outcome.FIRED and flags == self._sound.flags
        steady = steady and before == self._sound.count.torn[-1] and lag == self._lag
        if not steady:
            self._calibrate()
        return Heard(measured, steady, fits, late)

    def _rest(self) -> None:
        """Let as much of the noise be heard as in a session: a busy machine brings it later."""
        rested = self.recorder.frames + QUIET_S * 48e3
        while self.recorder.frames < rested and self._sound.active:
            self.clock.wait(QUIET_S / 10)
            if self._sound.stalled_s > GONE_S:
                break

    def _fits(self, began: int, on: tuple[int, int]) -> bool:
        """Tell whether what came through of a torn burst is that burst within its tolerances."""
        at = began + self._lag
        numbers = self._sound.count.numbers(at - 4800, at + 4800)
        energy = float(BURST @ BURST)
        for delay in (delay for delay, sounds in zip(self.line.delays, on, strict=True) if sounds):
            wave = self._template.shifted(delay - int(delay))
            places = numbers - (began + int(delay) - (len(wave) - len(BURST)) // 2)
            inside = (numbers != LOST) & (places >= 0) & (places < len(wave))
            heard = np.where(inside, wave[np.clip(places, 0, len(wave) - 1)], 0.0)
            fit = float(np.max(np.correlate(heard, BURST, "valid")))
            like = fit / math.sqrt(energy * max(float(heard @ heard), 1e-9))
            if like < 0.94 or abs(fit / energy - 1) > 0.14:  # between two frames, and of its gain
                return False
        return True


TORN_OFF: Final = {"late", "early", "again at once", "again later"}
"""Faults that a tear may undo: by another delay, or as it takes the second burst away."""


class Tally(Counter[str]):
    """What became of bursts; `worst` is by how many frames an onset was told wrong at most."""

    worst = 0.0

    def good(self, heard: Heard, side: str) -> None:
        """Note a burst, or a blank, without a fault."""
        one = heard.measured
        self._count(heard)
        if not heard.steady:
            if one.verified == "line":  # torn beside the burst, or with a delay within tolerance
                self["torn, yet verified"] += 1
                assert heard.fits, one
                if not math.isnan(heard.late):
                    self._onset(heard)
        elif side == "none":
            assert (one.verified, one.faults, one.noted) == (None, (), ()), one
            self["blanks"] += 1
        else:
            assert (one.verified, one.faults, one.noted) == ("line", (), ()), one
            self["good"] += 1
            self._onset(heard)

    def faulty(self, heard: Heard, name: str) -> None:
        """Note a burst with a fault."""
        one = heard.measured
        self._count(heard)
        if heard.steady:
            assert one.verified == "false", (name, one)
            self["faults"] += 1
        else:
            assert one.verified == "false" or name in TORN_OFF, (name, one)

    def _count(self, heard: Heard) -> None:
        self["played"] += 1
        if not heard.steady:
            self["torn"] += 1

    def _onset(self, heard: Heard) -> None:
        late_s, known_s = heard.measured.late_s, heard.measured.onset_uncertainty_s
        assert late_s is not None
        assert known_s is not None
        self.worst = max(self.worst, abs(late_s * 48e3 - heard.late))
        assert self.worst < 1


def tallied(pair: Pair, tally: Tally, wanted: int, seed: int) -> None:
    """Play until so many good bursts and so many with a fault were played whole, if it can be."""
    rng = np.random.default_rng([seed, tally["played"]])
    gain = clean_gain(pair.noise_db)
    names = [*FAULTS, "late", "early"]
    sides = ["left", "right", "both", "left", "right", "both", "none"]
    with suppress(LinkError), pair.ending_all():
        pair.open()
        while min(tally["good"], tally["faults"]) < wanted:
            i = tally["played"]
            assert i < 20 + 2 * MOST_PLAYS * wanted, f"the machine is too busy: {tally}"
            if tally["good"] < wanted:
                drift, skew = 20 * math.sin(i / 50), rng.uniform(-5, 5)
                pair.line.delays = [DELAY + drift, DELAY + drift + skew]
                pair.line.path = scaled(1 + rng.uniform(-gain, gain))
                side = sides[(tally["good"] + tally["blanks"]) % len(sides)]
                tally.good(pair.measure(side), side)
            if tally["faults"] < wanted:
                name = names[(seed + tally["faults"]) % len(names)]
                late = {"late": 54.0, "early": -54.0}.get(name, 0.0)
                pair.line.delays = [DELAY + late] * 2
                pair.line.path = FAULTS[name][0] if name in FAULTS else scaled(1.0)
                tally.faulty(pair.measure(("left", "right")[rng.integers(2)]), name)


@pytest.mark.parametrize("wanted", [pytest.param(60), pytest.param(4000, marks=pytest.mark.long)])
def test_real_sound_every_fault_is_caught_and_no_good_burst_is_blamed(
    null_sink: NullSink, wanted: int
) -> None:
    each = math.ceil(wanted * (SHARE if wanted > 1000 else 1.0) / PAIRS)
    switched_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-3)  # the callback must not wait for whoever computes
    tallies, opened = [Tally() for _ in range(PAIRS)], 0
    try:
        for _ in range(MOST_OPENED):
            opened += 1
            with wide_sink(null_sink, 2 * PAIRS + 2):
                sound = Sound((20.0, 40.0) * (PAIRS // 2))
                with ThreadPoolExecutor(PAIRS) as pool, closing(sound):
                    sound.begin()
                    list(pool.map(tallied, sound.pairs, tallies, [each] * PAIRS, range(PAIRS)))
            if all(min(one["good"], one["faults"]) >= each for one in tallies):
                break
    finally:
        sys.setswitchinterval(switched_s)
    total: Counter[str] = sum(tallies, Counter())
    worst = max(one.worst for one in tallies)
    print(dict(total), f"the stream opened {opened} times; onset off by {worst:.2f} frames at most")
    assert min(total["good"], total["faults"]) >= each * PAIRS
