"""Sound cards: frames as the callback hands them out, on a virtual clock and on a null sink."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import given, settings
from hypothesis import strategies as st

from device.clock import MonotonicClock
from device.driver import Outcome
from device.errors import LinkError, Refusal, RefusedError
from device.limits import Limits
from device.sound.audio import AudioDevice, audio_device
from device.sound.recorder import Recorder
from device.sound.stream import (
    _has_card,
    in_a_thread,
    open_duplex,
    open_stream,
    sound_cards,
    sound_lack,
    stderr_kept,
)
from tactstrip import main
from tests.test_device.bursts import BURST, play, ready, refusal
from tests.test_device.in_process import LIMITS, SoundCard, audio_on
from tests.test_device.loops import FULL_SCALE_V

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.sound.player import Frames
    from device.sound.stream import Callback
    from tests.processes import NullSink

RATE_HZ = 48_000.0
CONFIRM = "--confirm-hardware"


class Card(SoundCard):
    """A sound card that keeps what it plays, with trouble at some buffers."""

    def __init__(self) -> None:
        super().__init__()
        self.played: list[Frames] = []
        self.gap: int | None = None
        self.at_buffer: Callable[[int], None] = lambda _: None

    def take(self, callback: Callback, *, underflow: bool = False) -> Frames:
        self.at_buffer(len(self.played))
        self.played.append(super().take(callback, underflow=len(self.played) == self.gap))
        return self.played[-1]

    def frames(self) -> Frames:
        return np.concatenate(self.played)


@pytest.fixture
def card() -> Card:
    return Card()


@pytest.fixture
def live(card: Card) -> AudioDevice:
    """Slot 0 plays left, 1 right, 2 a hundred periods to the left."""
    device = audio_on(card)
    ready(device, 100.0)
    device.load(2, np.append(np.tile(BURST[:-1], 100), 0.0), np.zeros(9601))
    card.wait(0.1)
    card.played.clear()
    return device


def codes(level_vpp: float) -> Frames:
    volts = np.trunc(np.trunc(BURST * 32767) * level_vpp / 2 / FULL_SCALE_V)
    return volts.astype(np.int16)


@pytest.mark.parametrize("slot", [0, 1])
def test_a_burst_comes_out_on_its_channel_frame_by_frame(
    live: AudioDevice, card: Card, slot: int
) -> None:
    assert play(live, 1, slot).outcome is Outcome.FIRED
    frames = card.frames()
    assert np.array_equal(frames[:97, slot], codes(100.0))
    assert not frames[:, 1 - slot].any()
    assert not frames[97:].any()


def test_between_bursts_it_plays_zeros_and_counts_them(live: AudioDevice, card: Card) -> None:
    before = live._audio.player.frames
    card.wait(1.0)
    assert live._audio.player.frames - before == card.frames().shape[0] >= RATE_HZ
    assert not card.frames().any()


def test_the_onset_interval_is_the_latency_that_was_told(live: AudioDevice, card: Card) -> None:
    asked_s = card.now_s()
    told = play(live, 1)
    assert told.host_before_s >= asked_s
    width_s = told.host_after_s - told.host_before_s
    assert width_s == pytest.approx(card.latency + card.buffer / RATE_HZ)
    assert told.uncertainty_s >= width_s / 2
    assert card.now_s() >= told.host_after_s


def test_the_same_token_again_plays_nothing_more(live: AudioDevice, card: Card) -> None:
    told = play(live, 1)
    card.wait(0.1)
    assert live.fire(1) == told == live.query(1)
    assert np.count_nonzero(np.diff(np.sign(np.abs(card.frames()[:, 0]).astype(int))) > 0) <= 2


@pytest.mark.parametrize("gap", range(6))
def test_a_gap_in_the_burst_or_before_it_is_heard_is_indeterminate_and_one_before_it_is_not(
    live: AudioDevice, card: Card, gap: int
) -> None:
    card.gap = gap
    assert play(live, 1).outcome is (Outcome.INDETERMINATE if gap else Outcome.FIRED)
    assert live._audio.player.underruns == 1
    card.wait(0.1)
    assert play(live, 2).outcome is Outcome.FIRED


def test_a_card_that_takes_nothing_leaves_the_burst_open(live: AudioDevice, card: Card) -> None:
    live.arm(1, 0, time_to_live_s=1.0)
    card.active = False
    assert live.fire(1).outcome is Outcome.INDETERMINATE
    with pytest.raises(LinkError):
        live.arm(2, 0, time_to_live_s=1.0)


def test_a_stop_in_the_burst_silences_it_from_the_next_buffer_on(
    live: AudioDevice, card: Card
) -> None:
    card.at_buffer = lambda index: live.stop() if index == 10 else None
    assert play(live, 1, slot=2).outcome is Outcome.INDETERMINATE
    cut = 10 * card.buffer
    assert card.frames()[:cut].any()
    assert not card.frames()[cut:].any()
    assert refusal(lambda: play(live, 2)) is Refusal.SAFE_STATE
    live.enable()
    card.wait(1.0)
    assert play(live, 3).outcome is Outcome.FIRED


def test_a_stop_before_the_first_frame_means_that_nothing_came_out(
    live: AudioDevice, card: Card
) -> None:
    card.at_buffer = lambda index: live.stop() if index == 0 else None
    assert play(live, 1).outcome is Outcome.NOT_FIRED
    assert not card.frames().any()


def test_the_ceiling_is_no_higher_than_full_scale(card: Card) -> None:
    device = audio_on(card, Limits(ceiling_vpp=400.0))
    assert ready(device).ceiling_vpp == 2 * FULL_SCALE_V
    assert refusal(lambda: device.set_levels(2 * FULL_SCALE_V + 1.0, 0.0)) is Refusal.CEILING


@settings(deadline=None, max_examples=60)
@given(
    level_vpp=st.floats(0.0, 300.0), peak=st.floats(0.01, 1.0), ceiling_vpp=st.floats(1.0, 300.0)
)
def test_no_frame_is_above_the_ceiling(level_vpp: float, peak: float, ceiling_vpp: float) -> None:
    card = Card()
    device = audio_on(card, Limits(ceiling_vpp=ceiling_vpp))
    ready(device)
    device.load(2, peak * BURST, peak * BURST)
    try:
        device.set_levels(level_vpp, level_vpp)
        play(device, 1, slot=2)
    except RefusedError:
        card.wait(0.1)
        assert not card.frames().any()
        return
    volts = np.abs(card.frames().astype(float)).max() / 32767 * FULL_SCALE_V
    assert 2 * volts <= min(ceiling_vpp, level_vpp * peak) * (1 + 1e-9)


def test_what_a_sound_card_cannot_promise_is_told(card: Card) -> None:
    assert any("loopback" in sentence for sentence in audio_on(card).cannot)


def test_a_stream_is_opened_without_dither_and_closed_where_it_cannot_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    opened: dict[str, Any] = {}

    class UnpluggedError(Exception):
        pass

    class Opened(Card):
        def __init__(self, **settings: Any) -> None:
            super().__init__()
            opened.update(settings, stream=self)

        def start(self) -> None:
            raise UnpluggedError("no such device")

    library = SimpleNamespace(PortAudioError=UnpluggedError, OutputStream=Opened)
    monkeypatch.setitem(sys.modules, "sounddevice", library)
    with pytest.raises(LinkError, match=r"^cannot start the sound card default: no such device$"):
        open_stream(lambda *_: None, card="", sample_rate_hz=RATE_HZ, latency="low")
    assert not opened["stream"].active
    assert (opened["samplerate"], opened["channels"], opened["dtype"]) == (RATE_HZ, 2, "int16")
    assert (opened["device"], opened["latency"]) == (None, "low")
    assert opened["dither_off"]  # dither would be noise on frames that are exact, silence included


def test_a_card_without_the_inputs_of_a_monitor_is_told_by_their_key(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(**_: object) -> None:
        raise ValueError("Invalid number of channels [PaErrorCode -9998]")

    library = SimpleNamespace(PortAudioError=OSError, Stream=refuse)
    monkeypatch.setitem(sys.modules, "sounddevice", library)
    recorder = Recorder(MonotonicClock(), RATE_HZ, channels=(1, 4))
    with pytest.raises(
        LinkError, match=r"it must have 4 inputs, as monitor\.inputs has them, and 2"
    ):
        open_duplex(lambda *_: None, recorder, card="x", sample_rate_hz=RATE_HZ)


def _holds(recorded: Frames, wanted: Frames) -> bool:
    """Tell whether the recording holds these frames, shape (n, 2), without a change."""
    first = np.flatnonzero(wanted.any(axis=1))[0]
    starts = np.flatnonzero(np.all(recorded == wanted[first], axis=1)) - first
    return any(
        start >= 0 and np.array_equal(recorded[start : start + len(wanted)], wanted)
        for start in starts
    )


@pytest.mark.parametrize("side", [0, 1])
def test_a_null_sink_hears_the_burst_bit_for_bit(null_sink: NullSink, side: int) -> None:
    null_sink.listen()
    device = audio_device(
        "pulse",
        limits=LIMITS,
        clock=MonotonicClock(),
        volts_full_scale=FULL_SCALE_V,
        sample_rate_hz=RATE_HZ,
    )
    assert "pulse" in sound_cards()
    ready(device, 100.0)
    wanted = np.zeros((97, 2), dtype=np.int16)
    wanted[:, side] = codes(100.0)

    def heard() -> bool:
        recorded = null_sink.recorded()
        return not recorded[:, 1 - side].any() and _holds(recorded, wanted)

    fired = []
    for token in range(1, 21):
        fired.append(play(device, token, side).outcome is Outcome.FIRED)
        MonotonicClock().wait(0.1)
        if fired[-1] and heard():
            break
    device.close()
    assert any(fired)
    assert device._audio.player.frames > 0
    assert null_sink.until(heard)


STUDY = """
[burst]
window = "hann"
[device]
driver = "audio"
port = "pulse"
volts_full_scale = 125
least_interval_s = 0.01
[design]
trials_per_side = 3
both_trials = 1
foreperiod_s = [0.05, 0.06]
minimum_break_s = 0
[simulation]
reaction_time_s = 0.151
reaction_time_spread = 0
"""


def bursts_in(recorded: Frames) -> list[tuple[float, float]]:
    """Return the peak-to-peak volts of each burst, left and right."""
    sounding = np.flatnonzero(recorded.any(axis=1))
    pieces = np.split(sounding, np.flatnonzero(np.diff(sounding) > RATE_HZ * 0.02) + 1)
    volts = [
        np.ptp(recorded[piece].astype(float), axis=0) / 32767 * FULL_SCALE_V for piece in pieces
    ]
    return [(float(left), float(right)) for left, right in volts]


def test_a_session_of_run_comes_out_of_a_null_sink(null_sink: NullSink, tmp_path: Path) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(STUDY, encoding="utf-8")
    exact = []
    for participant in ("01", "02", "03", "04"):  # a busy machine may lose or split what it plays
        null_sink.listen()
        words = ["run", str(study), "--participant", participant, "--responder", "simulated"]
        result = CliRunner().invoke(main, [*words, "--out", str(out), "--seed", "7", CONFIRM])
        assert result.exit_code == 0, result.output
        assert "this device cannot bring its outputs to zero" in result.stdout
        folder = out / f"sub-{participant}" / "ses-01"
        header = json.loads((folder / "header.json").read_text(encoding="utf-8"))
        assert header["hardware_confirmed"]["how"] == CONFIRM
        assert not header["device_identity"]["emulated"]
        with (folder / "trials.csv").open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert sum(row["status"] == "ok" for row in rows) == 7
        expected = [(float(r["level_left_vpp"]), float(r["level_right_vpp"])) for r in rows]
        exact.append(_comes_out(null_sink, expected))
        if exact[-1]:
            break
    assert any(exact)


def _comes_out(null_sink: NullSink, expected: list[tuple[float, float]]) -> bool:
    """Tell whether these bursts were recorded, none above its level."""

    def heard() -> list[tuple[float, float]]:
        return bursts_in(null_sink.recorded())

    if not null_sink.until(lambda: len(heard()) >= len(expected)) or len(heard()) > len(expected):
        return False
    short_v = np.array(expected) - np.array(heard())
    return bool((short_v >= 0).all() and (short_v < 0.02).all())


@pytest.mark.process
def test_the_program_ends_although_the_sound_system_hangs() -> None:
    hang = (
        "import time; from device.sound.stream import in_a_thread; "
        "in_a_thread(lambda: time.sleep(600))"
    )
    subprocess.run([sys.executable, "-c", hang], check=True, timeout=60)


def test_an_error_in_the_thread_is_raised_where_the_result_is_taken() -> None:
    with pytest.raises(ZeroDivisionError):
        in_a_thread(lambda: 1 / 0).result(timeout=10)


def test_what_is_turned_away_from_standard_error_is_given_back(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with stderr_kept():
        away = os.open(os.devnull, os.O_WRONLY)
        os.dup2(away, 2)
        os.close(away)
        os.write(2, b"unheard")
    os.write(2, b"heard")
    assert capfd.readouterr().err == "heard"


@pytest.mark.parametrize(
    ("pcm", "server", "has"),
    [
        ("00-00: ALC : ALC : playback 1 : capture 1\n", "", 1),
        ("00-01: webcam : webcam : capture 1\n", "", 0),
        ("", "pulse/native", 1),
        ("", "pipewire-0", 1),
        ("", "", 0),
    ],
)
def test_a_card_is_an_output_of_the_kernel_or_of_a_sound_server(
    pcm: str, server: str, has: int, tmp_path: Path
) -> None:
    (tmp_path / "pcm").write_text(pcm)
    if server:
        (tmp_path / server).parent.mkdir(exist_ok=True)
        (tmp_path / server).touch()
    assert _has_card(tmp_path / "pcm", {"XDG_RUNTIME_DIR": str(tmp_path)}) == has
    assert _has_card(tmp_path / "none", {"PULSE_SERVER": "tcp:lab"})


def test_sound_without_sounddevice_lacks_it_before_anything_else(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("device.sound.stream.find_spec", lambda name: None)
    lack = sound_lack()
    assert lack is not None
    assert lack.what == "sounddevice"
