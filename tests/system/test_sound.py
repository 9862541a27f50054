"""Sound cards and their monitor on real sound: PortAudio, and a sound server's null sink.

A busy machine's server tears some of what it plays; what was torn may not be verified, or come
again, but never be taken for another burst.
"""

from __future__ import annotations

import subprocess
import sys
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
import pytest

from device import BurstDevice, DeviceError, DriverSettings, MonotonicClock, Outcome, make_device
from device.sound.stream import open_inputs, sound_cards
from tests.test_device.bursts import BURST, play, ready
from tests.test_device.in_process import LIMITS, recorder_on
from tests.test_device.loops import FULL_SCALE_V, LEVEL_VPP, SIDES, planned
from tests.test_device.monitors import monitor_of

if TYPE_CHECKING:
    from tests.processes import NullSink

pytestmark = pytest.mark.xdist_group("sound")


def card() -> BurstDevice:
    """Return the null sink as a device."""
    settings = DriverSettings(limits=LIMITS, port="pulse", volts_full_scale=FULL_SCALE_V)
    return make_device("audio", settings, MonotonicClock())


@pytest.mark.parametrize("side", [0, 1])
def test_a_null_sink_hears_the_burst_bit_for_bit(null_sink: NullSink, side: int) -> None:
    null_sink.listen()
    device, codes = card(), np.zeros((97, 2), dtype="<i2")
    assert "pulse" in sound_cards()
    ready(device, LEVEL_VPP)
    codes[:, side] = np.trunc(np.trunc(BURST * 32767) * LEVEL_VPP / 2 / FULL_SCALE_V)
    wanted = codes[1:-1].tobytes()

    def heard() -> bool:
        recorded = null_sink.recorded()
        return not recorded[:, 1 - side].any() and wanted in recorded.tobytes()

    fired = []
    for token in range(1, 21):
        fired.append(play(device, token, side).outcome is Outcome.FIRED)
        MonotonicClock().wait(0.1)
        if fired[-1] and heard():
            break
    device.close()
    assert any(fired)
    assert null_sink.until(heard)


WRONG = {
    "silence": ("left", 3, 1.0),
    "swap": ("left", 1, 1.0),
    "on both": ("left", 2, 1.0),
    "not on both": ("both", 0, 1.0),
    "a burst in a blank": ("none", 0, 1.0),
    "too weak": ("left", 0, 0.85),
    "too strong": ("right", 1, 1.15),
    "inverted": ("left", 4, 1.0),
    "twice": ("left", 5, 1.0),
}
"""What is planned, the slot that is played instead, and at how much of its level."""


def test_good_bursts_are_verified_on_real_sound_and_wrong_ones_never_are(
    null_sink: NullSink, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PULSE_SOURCE", "plate.monitor")
    clock = MonotonicClock()
    recorder = recorder_on(clock)
    device = card()
    twice = np.concatenate((BURST, np.zeros(960), BURST))
    monitor = monitor_of(
        device,
        recorder,
        clock,
        connect=lambda heard: open_inputs(heard, card="pulse"),
        tolerances={"onset_s": 0.05},
    )

    def reopen() -> None:
        """Open both, as often as a busy machine's PortAudio gives its stream up."""
        for _ in range(5):
            with suppress(DeviceError):
                device.close()
                ready(device, LEVEL_VPP)
                for slot, left, right in (
                    *((2, BURST, BURST), (3, 0 * BURST, 0 * BURST)),
                    *((4, -BURST, 0 * BURST), (5, twice, 0 * twice)),
                ):
                    device.load(slot, left, right)
                monitor.open()
                return

    def verified(token: int, side: str, slot: int, share: float = 1.0) -> str | None:
        clock.wait(0.1)
        try:
            device.set_levels(share * LEVEL_VPP, share * LEVEL_VPP)
            monitor.begin(token, planned(side))
            delivery = play(device, token, slot)
            clock.wait(0.1)
            result = monitor.end(delivery).verified
            if result == "false":
                monitor.open()
        except DeviceError:
            reopen()
            return "lost"
        return result

    reopen()
    good = [
        verified(token, side, SIDES[side][0])
        for token, side in enumerate(["left", "right", "both"] * 7, 1)
    ]
    wrong = {
        name: verified(100 + token, side, slot, share)
        for token, (name, (side, slot, share)) in enumerate(WRONG.items())
    }
    monitor.close()
    device.close()
    print(good, wrong)
    assert good.count("line") >= len(good) / 2
    assert "line" not in wrong.values()


def test_the_program_ends_although_the_sound_system_hangs() -> None:
    hang = (
        "import time; from device.sound.stream import in_a_thread; "
        "in_a_thread(lambda: time.sleep(600))"
    )
    subprocess.run([sys.executable, "-c", hang], check=True, timeout=60)
