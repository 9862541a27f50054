"""A sound card that hears itself, with a monitor of its bursts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from device import Outcome
from device.core.converter import ConverterDevice
from device.monitor.inputs import Calibration, InputMonitor
from device.monitor.measured import Tap, Tolerances
from device.sound.audio import AudioConverter
from tests.test_device.bursts import BURST, play, ready
from tests.test_device.in_process import LoopCard, audio_on
from tests.test_device.loops import (
    DELAY,
    FAULTS,
    FULL_SCALE_V,
    LEVEL_VPP,
    SIDES,
    clean_gain,
    planned,
    scaled,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from device import BurstDevice, Clock
    from device.monitor.measured import Measured
    from device.sound.recorder import Recorder
    from device.sound.stream import Stream


def monitor_of(
    device: BurstDevice,
    recorder: Recorder,
    clock: Clock,
    *,
    tap: Tap = Tap.LINE,
    delay_s: float | None = None,
    connect: Callable[[Recorder], Stream] | None = None,
    tolerances: dict[str, float],
) -> InputMonitor:
    """Return the monitor of a sound card; `connect` opens inputs that are not its own."""
    assert isinstance(device, ConverterDevice)
    assert isinstance(device.converter, AudioConverter)
    return InputMonitor(
        recorder,
        clock,
        tap=tap,
        calibration=Calibration(
            per_unit=(FULL_SCALE_V,) * len(recorder.channels),
            delay_s=None if delay_s is None else (delay_s,) * len(recorder.channels),
        ),
        tolerances=Tolerances(**tolerances),
        source="loop",
        connect=connect,
        card=None if connect else device.converter,
    )


class MonitorRig:
    """A sound card that hears itself; `noise_db`, how far the noise is below its bursts."""

    def __init__(
        self,
        *,
        noise_db: float = 20.0,
        tap: Tap = Tap.LINE,
        seed: int = 1,
        stated: bool = True,
        buffer: int = 64,
        **tolerances: float,
    ) -> None:
        self.card = LoopCard(seed=seed, buffer=buffer)
        self.card.line.delays = [DELAY, DELAY]
        self.device = audio_on(self.card)
        ready(self.device, LEVEL_VPP)
        self.device.load(2, np.stack([BURST, BURST]))
        self.device.load(3, np.stack([0 * BURST, 0 * BURST]))
        self.card.line.noise = LEVEL_VPP / 2 / FULL_SCALE_V / math.sqrt(2) * 10 ** (-noise_db / 20)
        self.monitor = monitor_of(
            self.device,
            self.card.recorder,
            self.card,
            tap=tap,
            delay_s=DELAY / 48e3 if stated else None,
            tolerances=tolerances,
        )
        self.monitor.open()
        self._token = 0

    def measure(self, side: str = "left", *, answer_s: float = 0.15) -> Measured:
        """Play a burst, and return what is measured of it."""
        self._token += 1
        self.card.wait(0.1)
        self.monitor.begin(self._token, planned(side))
        delivery = play(self.device, self._token, SIDES[side][0])
        assert delivery.outcome is Outcome.FIRED
        self.card.wait(answer_s)
        return self.monitor.end(delivery)


def check_bursts(n_bursts: int, *, noise_db: float, seed: int) -> None:
    """Measure good bursts and as many with a fault: each fault is caught, no good one is blamed."""
    rig = MonitorRig(noise_db=noise_db, seed=seed, buffer=128)
    rng = np.random.default_rng([7, seed])
    names, gain = [*FAULTS, "late", "early"], clean_gain(noise_db)
    for i in range(n_bursts):
        side = ("left", "right", "both", "none")[i % 4]
        drift, skew = 20 * math.sin(i / 30), rng.uniform(-5, 5)
        rig.card.line.delays = [DELAY + drift, DELAY + drift + skew]
        rig.card.line.path = scaled(1 + rng.uniform(-gain, gain))
        good = rig.measure(side, answer_s=0.12)
        verified = None if side == "none" else "line"
        assert (good.verified, good.faults, good.noted) == (verified, (), ()), (i, good)
        if side != "none":
            on = [d for d, on in zip(rig.card.line.delays, SIDES[side][1:], strict=True) if on]
            assert good.late_s is not None
            assert abs(good.late_s * 48e3 - (min(on) - DELAY)) < 1
        name = names[i % len(names)]
        if name in {"late", "early"}:
            rig.card.line.delays = [DELAY + (54 if name == "late" else -54)] * 2
        else:
            rig.card.line.path = FAULTS[name][0]
        bad = rig.measure(("left", "right")[rng.integers(2)], answer_s=0.12)
        assert bad.verified == "false", (i, name, bad)
