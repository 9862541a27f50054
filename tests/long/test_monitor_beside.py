"""A sound card's inputs beside another driver: two clocks, and how well an onset is known then."""

from __future__ import annotations

import json
import math
import threading
import time
from contextlib import closing, suppress
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pytest

from device.clock import MonotonicClock
from device.driver import Outcome
from device.errors import DeviceError
from device.monitor.inputs import Calibration, InputMonitor
from device.monitor.measured import Measured, Tap, Tolerances
from device.sound.recorder import Recorder
from device.sound.stream import open_inputs
from device.wire.serial import serial_device
from tests.test_device.bursts import BURST, play, ready
from tests.test_device.counted import FrameCount, wide_sink
from tests.test_device.in_process import LIMITS
from tests.test_device.loops import FULL_SCALE_V, LEVEL_VPP, SHARE, planned

if TYPE_CHECKING:
    from pathlib import Path

    from tests.processes import Emulate, NullSink

RATE_HZ: Final = 48e3
LATENCY_S: Final = 0.1
AHEAD_S: Final = 0.35
"""So long after a burst of the emulator's truth the bridge has the sound card play it."""
DRIFT: Final = 50e-6
TOLERANCE_S: Final = 0.1
WIDEST_S: Final = 0.03
AFTER_S: Final = 4.0
"""So long the truth's line goes on after the last burst."""
MOST_PLAYS: Final = 4


class DriftingClock(MonotonicClock):
    """A host's clock that runs faster than the sound card's, and than the device's."""

    def __init__(self) -> None:
        self._began_s = time.monotonic()

    def now_s(self) -> float:
        return self.of(time.monotonic())

    def of(self, real_s: float) -> float:
        return self._began_s + (real_s - self._began_s) * (1 + DRIFT)


class Bridge:
    """Plays what an emulator's truth tells, a fixed time later, on a card of four channels."""

    def __init__(self, truth: Path) -> None:
        import sounddevice

        self._truth = truth
        self.frames = 0
        self.played: dict[int, float] = {}
        self._due: list[tuple[float, list[int], float]] = []
        self._zero: float | None = None
        self._over = threading.Event()
        self._stream = sounddevice.OutputStream(
            device="pulse", samplerate=RATE_HZ, channels=4, dtype="int16", dither_off=True,
            latency=LATENCY_S, callback=self._fill,
        )  # fmt: skip
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._stream.start()
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._stream.close()

    def _fill(self, out: Any, count: int, timing: Any, status: Any) -> None:
        FrameCount.put(out, self.frames)
        sound = np.zeros((count, 2))
        for first, channels, peak in self._due[-3:]:
            at = (np.arange(self.frames, self.frames + count) - first) / RATE_HZ
            wave = peak * np.sin(2 * np.pi * 500 * at) * ((at >= 0) & (at <= 2e-3))
            sound += wave[:, np.newaxis] * channels
        out[:, 2:] = np.rint(sound * 32767)
        self.frames += count

    def _read(self) -> None:
        with self._truth.open(encoding="utf-8") as file:
            line = ""
            while not self._over.is_set():
                line += file.readline()
                if not line.endswith("\n"):
                    time.sleep(2e-3)
                    continue
                told, line = json.loads(line), ""
                if told["event"] == "burst":
                    first = told["t_s"] * RATE_HZ
                    if self._zero is None:
                        self._zero = self.frames + AHEAD_S * RATE_HZ - first
                    peak = LEVEL_VPP / 2 / FULL_SCALE_V
                    self.played[told["token"]] = first + self._zero
                    self._due.append((first + self._zero, told["channels"], peak))


class Noted(Recorder):
    """A recorder of channels 3 and 4 that keeps what the first two tell, and when it was called."""

    def __init__(self, clock: DriftingClock) -> None:
        super().__init__(clock, RATE_HZ, channels=(3, 4))
        self.count = FrameCount()
        self.calls: list[tuple[int, float]] = []

    def take(self, heard: Any, timing: Any, status: Any) -> None:
        self.count.note(heard[:, :2], self.frames)
        super().take(heard, timing, status)
        self.calls.append(self._marks[-1][:2])

    def truly_at(self, frame: float) -> float:
        """Return when a frame was heard: by a line through all calls of its stretch, later too."""
        torn = [one.frame for one in self.count.torn] + [self.frames]
        first = max(one for one in torn if one <= frame)
        last = min(one for one in torn if one > frame)
        calls = np.array([one for one in self.calls if first <= one[0] < last])
        slope, rest = np.polyfit(calls[:, 0] - frame, calls[:, 1], 1) if len(calls) > 99 else (0, 0)
        apart = calls[:, 1] - slope * (calls[:, 0] - frame) - rest
        near = np.abs(apart) < 4 * np.median(np.abs(apart)) + 1e-4  # but for a call that came late
        return float(np.polyfit(calls[near, 0] - frame, calls[near, 1], 1)[1])


@pytest.mark.parametrize("wanted", [25, pytest.param(400, marks=pytest.mark.long)])
def test_an_onset_on_another_clock_is_told_with_its_uncertainty(
    null_sink: NullSink, emulate: Emulate, wanted: int
) -> None:
    wanted = math.ceil(wanted * (SHARE if wanted > 100 else 1))
    port, truth, _ = emulate("tcp")
    clock = DriftingClock()
    device = serial_device(port, limits=LIMITS, clock=clock)
    recorder = Noted(clock)
    monitor = InputMonitor(
        recorder,
        clock,
        tap=Tap.LINE,
        calibration=Calibration(per_unit=(FULL_SCALE_V,) * 2, delay_s=(AHEAD_S + LATENCY_S,) * 2),
        tolerances=Tolerances(onset_s=TOLERANCE_S),
        source="null sink",
        connect=lambda heard: open_inputs(heard, card="pulse"),
    )
    told: list[Measured] = []
    with wide_sink(null_sink, 4), closing(Bridge(truth)) as bridge:
        monitor.open()
        ready(device, LEVEL_VPP)
        for token in range(1, MOST_PLAYS * wanted):
            if len(told) >= wanted:
                break
            clock.wait(0.1)
            monitor.begin(token, planned("left"))
            try:
                delivery = play(device, token)
            except DeviceError:  # a busy machine sent no heart beat, or had no answer, for too long
                with suppress(DeviceError):
                    device.close()
                ready(device, LEVEL_VPP)
                continue
            one = monitor.end(delivery)
            told += [one] if delivery.outcome is Outcome.FIRED and one.onset_s is not None else []
        clock.wait(AFTER_S)
        monitor.close()
    device.close()
    errors_s, known_s = [], []
    for one in told:
        played = bridge.played[one.token]
        lag = recorder.count.lag_of(int(played), 2 * len(BURST))
        if lag is None:  # torn by the sound server
            continue
        assert one.onset_s is not None
        assert one.onset_uncertainty_s is not None
        errors_s.append(one.onset_s - recorder.truly_at(played + lag))
        known_s.append(one.onset_uncertainty_s)
    covered = sum(abs(e) <= k for e, k in zip(errors_s, known_s, strict=True))
    words = f"{covered} of {len(errors_s)} onsets within what is told, "
    worst_s, usual_s = max(map(abs, errors_s)), float(np.median(known_s))
    print(f"{words}which is {usual_s * 1e3:.2f} ms (median); {worst_s * 1e3:.2f} ms off at most")
    assert len(errors_s) >= wanted // 2
    assert covered >= 0.95 * len(errors_s), words
    assert usual_s < WIDEST_S
