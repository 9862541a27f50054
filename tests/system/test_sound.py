"""Sound cards and their monitor on real sound: PortAudio, and a sound server's null sink.

A busy machine's server tears some of what it plays; what was torn may not be verified, or come
again, but never be taken for another burst.
"""

from __future__ import annotations

import csv
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
    from collections.abc import Iterator
    from pathlib import Path

    from tests.conftest import Run
    from tests.processes import NullSink

pytestmark = pytest.mark.xdist_group("sound")


def card(channels: int = 2) -> BurstDevice:
    """Return the null sink as a device."""
    settings = DriverSettings(
        limits=LIMITS,
        port="pulse",
        volts_full_scale=FULL_SCALE_V,
        channels=tuple(range(1, channels + 1)),
    )
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


def test_each_of_sixteen_slots_is_heard_on_its_own_channel_bit_for_bit(wide_sink: NullSink) -> None:
    channels = range(wide_sink.channels)
    device = card(wide_sink.channels)
    device.open()
    for slot in channels:
        device.load(slot, np.stack([BURST * (channel == slot) for channel in channels]))
    device.enable()
    levels_vpp = [LEVEL_VPP - 2.0 * channel for channel in channels]
    device.set_levels(levels_vpp)
    wide_sink.listen()
    token = 0
    for channel, level_vpp in enumerate(levels_vpp):
        codes = np.trunc(np.trunc(BURST * 32767) * level_vpp / 2 / FULL_SCALE_V).astype("<i2")
        burst = codes[1:-1].tobytes()

        def heard(channel: int = channel, burst: bytes = burst) -> bool:
            return burst in wide_sink.recorded()[:, channel].tobytes()

        for _ in range(20):
            token += 1
            delivery = play(device, token, channel)
            MonotonicClock().wait(0.1)
            if delivery.outcome is Outcome.FIRED and heard():
                break
        assert delivery.levels_vpp == tuple(
            level_vpp if other == channel else 0.0 for other in channels
        )
        assert wide_sink.until(heard)
    device.close()
    recorded = wide_sink.recorded()
    assert np.count_nonzero(recorded, axis=1).max() == 1
    assert np.abs(recorded).max(axis=0).tolist() == [
        int(level_vpp / 2 / FULL_SCALE_V * 32767) for level_vpp in levels_vpp
    ]


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


class SoundRig:
    """A null sink as a device, and the monitor of what it plays."""

    def __init__(self) -> None:
        self._clock = MonotonicClock()
        self._device = card()
        self._monitor = monitor_of(
            self._device,
            recorder_on(self._clock),
            self._clock,
            connect=lambda heard: open_inputs(heard, card="pulse"),
            tolerances={"onset_s": 0.05},
        )
        self._token = 0
        self._open()

    def verified(self, side: str, slot: int, share: float = 1.0) -> str | None:
        """Play a slot where a side is planned; return how far the burst is verified, or "lost"."""
        self._token += 1
        self._clock.wait(0.1)
        try:
            self._device.set_levels([share * LEVEL_VPP, share * LEVEL_VPP])
            self._monitor.begin(self._token, planned(side))
            delivery = play(self._device, self._token, slot)
            self._clock.wait(0.1)
            result = self._monitor.end(delivery).verified
            if result == "false":
                self._monitor.open()
        except DeviceError:
            self._open()
            return "lost"
        return result

    def close(self) -> None:
        self._monitor.close()
        self._device.close()

    def _open(self) -> None:
        """Open both, as often as a busy machine's PortAudio gives its stream up."""
        twice = np.concatenate((BURST, np.zeros(960), BURST))
        for _ in range(5):
            with suppress(DeviceError):
                self._device.close()
                ready(self._device, LEVEL_VPP)
                for slot, left, right in (
                    *((2, BURST, BURST), (3, 0 * BURST, 0 * BURST)),
                    *((4, -BURST, 0 * BURST), (5, twice, 0 * twice)),
                ):
                    self._device.load(slot, np.stack([left, right]))
                self._monitor.open()
                return


@pytest.fixture
def sound_rig(null_sink: NullSink, monkeypatch: pytest.MonkeyPatch) -> Iterator[SoundRig]:
    """A device on real sound, with its monitor."""
    assert null_sink.socket.exists()
    monkeypatch.setenv("PULSE_SOURCE", "plate.monitor")
    rig = SoundRig()
    yield rig
    rig.close()


def test_good_bursts_are_verified_on_real_sound_and_wrong_ones_never_are(
    sound_rig: SoundRig,
) -> None:
    good = [sound_rig.verified(side, SIDES[side][0]) for side in ["left", "right", "both"] * 7]
    wrong = {name: sound_rig.verified(*how) for name, how in WRONG.items()}
    print(good, wrong)
    assert good.count("line") >= len(good) / 2
    assert "line" not in wrong.values()


def test_the_program_ends_although_the_sound_system_hangs() -> None:
    hang = (
        "import time; from device.sound.stream import in_a_thread; "
        "in_a_thread(lambda: time.sleep(600))"
    )
    subprocess.run([sys.executable, "-c", hang], check=True, timeout=60)


SIXTEEN = tuple(f"s{number}" for number in range(1, 17))
IDENTIFICATION = """
[task]
kind = "identification"
[strip]
width_mm = 25
length_mm = 400
thickness_mm = 0.5
edge = "clamped"
material = "aluminium"
loss_factor = 0.01
[design]
levels_vpp = [60]
trials_per_side = 1
foreperiod_s = [0.2, 0.3]
break_every = 0
[masking]
noise = "none"
[device]
driver = "audio"
port = "pulse"
volts_full_scale = 100
ceiling_vpp = 200
""" + "".join(
    f'[[actuator]]\nsite = "{site}"\nx_mm = {20 * index - 150}\ndiameter_mm = 8\n'
    "finger_diameter_mm = 8\n"
    for index, site in enumerate(SIXTEEN)
)


def test_a_session_identifies_sixteen_sites_and_each_burst_is_on_its_channel(
    wide_sink: NullSink, tmp_path: Path, run: Run
) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "results"
    study.write_text(IDENTIFICATION, encoding="utf-8")
    wide_sink.listen()
    words = ("--responder", "simulated", "--seed", "5", "--confirm-hardware", "--out", out)
    result = run("run", study, "--participant", "01", "--session", "01", *words)
    assert result.exit_code == 0, result.stderr
    with (out / "sub-01" / "ses-01" / "trials.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["side"] for row in rows if row["status"] == "ok"} == {*SIXTEEN}
    driven = [
        {site for site in SIXTEEN if float(row[f"level_{site}_vpp"] or 0) > 0}
        for row in rows
        if row["status"] == "ok"
    ]
    assert driven == [{row["side"]} for row in rows if row["status"] == "ok"]
    frames, channels = np.nonzero(wide_sink.recorded())
    assert np.bincount(frames).max() == 1  # never two at once
    first = np.flatnonzero(np.diff(frames, prepend=-10_000) > 4_000)  # a pause before each burst
    heard = [SIXTEEN[channel] for channel in channels[first]]
    presented = iter(row["side"] for row in rows)
    assert all(site in presented for site in heard)  # in their order; what was torn is missing
    assert len(heard) >= len(SIXTEEN) / 2
