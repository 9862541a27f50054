"""Masking noise: judged on a virtual sound card, heard through PulseAudio's null sink."""

from __future__ import annotations

import hashlib
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field, replace
from itertools import pairwise
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from click.testing import CliRunner

from device.clock import MonotonicClock, VirtualClock
from device.errors import LinkError
from experiment.apparatus.noise import (
    FADE_IN_S,
    FADE_OUT_S,
    LATENCY_S,
    SLACK_S,
    NoiseError,
    SilentNoise,
    SoundCardNoise,
    noise_player,
)
from experiment.commands.check import check
from experiment.study.sections.equipment import Masking

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from device.sound.player import Frames
    from device.sound.stream import Callback
    from tests.processes import NullSink

PINK = Masking(noise="pink", max_level_dba=75.0, loop_s=1.0)
RATE_HZ = 48_000
BUFFER = 2_400
LOOP_SHA256 = "dde72e97c82daaa8e91c8e9a31357acde9c467fcb5029fa511729679d2555a60"
"""No sample is so near to half a whole number that another FFT could round it the other way."""


@dataclass(slots=True)
class Card(VirtualClock):
    """A sound card and the clock that drives it; a card of another speed takes frames sooner."""

    callback: Callback | None = None
    active: bool = True
    latency: float = LATENCY_S
    speed: float = 1.0
    opened: int = 0
    underruns: int = 0
    blocks: list[Frames] = field(default_factory=list)
    _now_s: float = 0.0
    _due_s: float = 0.0

    def now_s(self) -> float:
        return self._now_s

    def connect(self, callback: Callback) -> Card:
        self.callback, self.active, self._due_s = callback, True, self._now_s
        self.opened += 1
        for _ in range(4):
            self._take(callback)
        return self

    def close(self) -> None:
        self.callback, self.active = None, False

    def wait(self, duration_s: float) -> None:
        until_s = self._now_s + duration_s
        while self.callback is not None and self.speed and self._due_s <= until_s:
            self._now_s = max(self._due_s, self._now_s)
            self._due_s += BUFFER / RATE_HZ / self.speed
            self._take(self.callback)
        self._now_s = until_s

    def stall(self) -> None:
        """Take nothing more, from now on."""
        self.speed = 0.0

    def _take(self, callback: Callback) -> None:
        out = np.full((BUFFER, 2), 99, dtype=np.int16)
        timing = SimpleNamespace(currentTime=0.0, outputBufferDacTime=self.latency)
        callback(out, BUFFER, timing, SimpleNamespace(output_underflow=self.underruns > 0))
        self.underruns = max(self.underruns - 1, 0)
        self.blocks.append(out)

    def frames(self) -> Frames:
        return np.concatenate(self.blocks)


@pytest.fixture
def card() -> Card:
    return Card()


def noise_on(card: Card, masking: Masking = PINK) -> SoundCardNoise:
    return SoundCardNoise(masking, card, card.connect)


def playing_on(card: Card) -> SoundCardNoise:
    noise = noise_on(card)
    noise.start()
    card.wait(1.0)
    return noise


def assert_lost(noise: SoundCardNoise, words: str = "") -> None:
    health = noise.health()
    assert health.ok is False
    assert words in health.words


def test_it_fades_in_and_then_repeats_the_loop_whose_checksum_it_states(card: Card) -> None:
    noise = playing_on(card)
    card.wait(3.0)
    left, right = card.frames().T
    fade = round(FADE_IN_S * RATE_HZ)
    loop = np.roll(left[fade : fade + RATE_HZ], fade)
    assert np.array_equal(left, right)
    assert noise.facts.sha256 == hashlib.sha256(loop.astype("<i2").tobytes()).hexdigest()
    assert np.array_equal(left[fade:], np.resize(np.roll(loop, -fade), len(left) - fade))
    gain = np.sin(np.pi / 2 * np.arange(1, fade + 1) / fade) ** 2
    assert np.abs(left[:fade] - gain * np.resize(loop, fade)).max() <= 0.5


def test_the_loop_has_the_level_of_the_study(card: Card) -> None:
    for level_dbfs in (-40.0, -30.0, -20.0):
        card.blocks.clear()
        noise = noise_on(card, replace(PINK, level_dbfs=level_dbfs))
        noise.start()
        card.wait(2.0)
        loop = card.frames()[-RATE_HZ:, 0] / 32_767
        assert 10 * np.log10(np.mean(loop**2)) == pytest.approx(level_dbfs, abs=0.01)
        noise.stop()


def test_when_start_returns_the_noise_has_its_full_level(card: Card) -> None:
    noise = noise_on(card)
    noise.start()
    assert FADE_IN_S - LATENCY_S - 0.1 <= card.now_s() <= FADE_IN_S + 0.1
    assert noise.health().ok is True


@pytest.mark.slow
def test_a_card_of_the_right_speed_is_healthy_for_an_hour(card: Card) -> None:
    card.speed = 1.001
    noise = playing_on(card)
    for _ in range(1200):
        card.wait(3.0)
        card.blocks.clear()
        assert noise.health().ok is True
    assert noise.health().words == "the noise plays"
    assert noise.health().frames == pytest.approx(3602 * RATE_HZ, rel=2e-3)


@pytest.mark.parametrize(
    ("change", "within_s", "words"),
    [
        ({"speed": 44.1 / 48}, 10.0, "too slow"),
        ({"speed": 48 / 44.1}, 10.0, "too fast"),
        ({"speed": 100.0}, LATENCY_S + SLACK_S, "too fast"),
        ({"active": False}, 0.0, "default"),
    ],
    ids=["of another rate, slow", "of another rate, fast", "runaway", "gone"],
)
def test_a_card_that_plays_something_else_is_found_in_time(
    card: Card, change: dict[str, Any], within_s: float, words: str
) -> None:
    noise = playing_on(card)
    assert noise.health().ok is True
    for name, value in change.items():
        setattr(card, name, value)
    card.wait(within_s)
    assert_lost(noise, words)


def test_a_card_that_takes_nothing_is_found_when_what_it_has_is_used_up(card: Card) -> None:
    noise = playing_on(card)
    card.stall()
    card.wait(0.1)
    assert noise.health().ok is True
    card.wait(LATENCY_S + SLACK_S)
    assert_lost(noise, "the sound card default takes no more frames")


def test_a_gap_is_told_once_and_counted_for_ever(card: Card) -> None:
    noise = playing_on(card)
    card.underruns = 2
    card.wait(1.0)
    told = noise.health()
    assert (told.ok, told.underruns) == (False, 2)
    assert told.words == "the noise had 2 gaps: the computer was too slow"
    assert (noise.health().ok, noise.health().underruns) == (True, 2)


def test_a_gap_while_it_fades_in_does_not_matter(card: Card) -> None:
    card.underruns = 1
    assert playing_on(card).health().ok is True


def test_before_the_start_and_after_the_stop_it_does_not_play(card: Card) -> None:
    noise = noise_on(card)
    noise.stop()
    assert card.opened == 0
    assert_lost(noise)
    noise.start()
    noise.stop()
    assert_lost(noise, "the noise is not playing")
    assert card.callback is None


def test_it_fades_out_and_what_was_faded_is_heard_before_it_is_closed(card: Card) -> None:
    noise = playing_on(card)
    before = len(card.frames())
    began_s = card.now_s()
    noise.stop()
    after = card.frames()[before:, 0]
    fade = round(FADE_OUT_S * RATE_HZ)
    early, late = (np.std(part) for part in np.split(after[:fade], 2))
    assert early > 2 * late > 0
    assert not after[fade:].any()
    assert len(after) >= fade + (LATENCY_S - 0.05) * RATE_HZ
    assert card.now_s() - began_s < FADE_OUT_S + 2 * LATENCY_S + SLACK_S


@pytest.mark.parametrize("lose", [Card.stall, Card.close])
def test_after_a_loss_it_stops_at_once_and_starts_again_with_a_fade_in(
    card: Card, lose: Callable[[Card], None]
) -> None:
    noise = playing_on(card)
    lose(card)
    card.wait(1.0)
    assert_lost(noise)
    card.speed = 1.0
    card.blocks.clear()
    noise.start()
    assert card.opened == 2
    assert noise.health().ok is True
    assert np.abs(card.frames()[:1000]).max() < 10
    assert np.abs(card.frames()[-1000:]).max() > 500


def test_a_card_that_takes_no_frames_is_an_error_within_six_seconds(card: Card) -> None:
    card.stall()
    noise = noise_on(card)
    with pytest.raises(NoiseError, match="default"):
        noise.start()
    assert card.now_s() < 6.1
    assert card.callback is None
    assert_lost(noise)


def test_a_card_that_cannot_be_opened_is_an_error_of_one_line(card: Card) -> None:
    def refuse(callback: Callback) -> Card:
        raise LinkError("cannot open the sound card default: none")

    noise = SoundCardNoise(PINK, card, refuse)
    with pytest.raises(
        NoiseError, match="none$"
    ):
        noise.start()
    assert_lost(noise)


def test_without_portaudio_one_line_says_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    noise = noise_player(PINK, MonotonicClock(), simulated=False)
    with pytest.raises(NoiseError, match="masking"):
        noise.start()


@pytest.mark.process
def test_portaudio_is_not_looked_for_before_the_noise_starts() -> None:
    lines = (
        "import sys",
        "from device.clock import MonotonicClock",
        "from experiment.study.sections.equipment import Masking",
        "from experiment.apparatus.noise import noise_player",
        "pink = Masking(noise='pink', max_level_dba=75.0)",
        "noise_player(pink, MonotonicClock(), simulated=False).health()",
        "assert 'sounddevice' not in sys.modules",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True)


def test_a_sound_system_that_hangs_holds_nobody_up(
    card: Card, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("experiment.apparatus.noise._PATIENCE_S", 0.05)
    answers = threading.Event()

    def hang(callback: Callback) -> Card:
        assert answers.wait(10.0)
        return card.connect(callback)

    noise = SoundCardNoise(PINK, card, hang)
    with pytest.raises(NoiseError, match="restart"):
        noise.start()
    assert_lost(noise)
    answers.set()
    give_up_s = time.monotonic() + 10.0
    while (card.opened == 0 or card.callback is not None) and time.monotonic() < give_up_s:
        time.sleep(0.01)
    assert (card.opened, card.callback) == (1, None)
    assert not card.frames().any()


def test_a_sound_card_that_hangs_while_it_is_closed_holds_nobody_up(
    card: Card, monkeypatch: pytest.MonkeyPatch
) -> None:
    noise = playing_on(card)
    monkeypatch.setattr("experiment.apparatus.noise._PATIENCE_S", 0.05)
    answers = threading.Event()
    monkeypatch.setattr(Card, "close", lambda self: answers.wait(10.0))
    noise.stop()
    assert noise.health().words == "the noise is not playing"
    answers.set()


def test_nothing_is_played_to_a_simulated_participant_or_where_the_study_wants_none() -> None:
    for masking, simulated in ((PINK, True), (replace(PINK, noise="none"), False)):
        noise = noise_player(masking, VirtualClock(), simulated=simulated)
        assert isinstance(noise, SilentNoise)
        noise.start()
        assert noise.health().ok is None
        assert (noise.facts.noise, noise.facts.played) == (masking.noise, False)
        assert noise.facts.sha256 is None
        noise.stop()
        assert noise.health().ok is None


def test_the_facts_are_those_of_the_study() -> None:
    masking = replace(PINK, measured_level_dba=71.5, level_dbfs=-33.0, sound_card="headphones")
    facts = noise_player(masking, VirtualClock(), simulated=False).facts
    assert (facts.played, facts.noise, facts.sound_card) == (True, "pink", "headphones")
    assert (facts.max_level_dba, facts.measured_level_dba, facts.level_dbfs) == (75.0, 71.5, -33.0)
    assert (facts.loop_s, facts.sample_rate_hz) == (1.0, 48_000.0)


def test_the_loop_is_the_same_everywhere() -> None:
    sums = {noise_player(PINK, VirtualClock(), simulated=False).facts.sha256 for _ in range(2)}
    assert sums == {LOOP_SHA256}


def test_a_level_that_would_be_clipped_is_refused_before_anything_is_opened() -> None:
    masking = replace(PINK, level_dbfs=-18.0)
    assert noise_player(masking, VirtualClock(), simulated=False).facts.level_dbfs == -18.0
    object.__setattr__(masking, "level_dbfs", -10.0)
    with pytest.raises(NoiseError, match=r"-1\d\.\d\d.*got -10"):
        noise_player(masking, VirtualClock(), simulated=False)


def machine_noise() -> SoundCardNoise:
    noise = noise_player(PINK, MonotonicClock(), simulated=False)
    assert isinstance(noise, SoundCardNoise)
    return noise


@pytest.fixture(scope="module")
def heard(null_sink: NullSink) -> Frames:
    """Three seconds of noise after the fade-in and what came before, of the left channel."""
    for _ in range(3):
        null_sink.listen()
        noise = machine_noise()
        noise.start()
        MonotonicClock().wait(3.0)
        healthy = noise.health().ok
        noise.stop()
        if healthy:
            break
    recorded = null_sink.recorded()
    left: Frames = recorded[:, 0]
    assert np.array_equal(left, recorded[:, 1])
    first, *_, last = np.flatnonzero(left)
    return left[first : last + 1]


def steady(heard: Frames) -> Frames:
    """Two and a half seconds in which the noise has its full level."""
    fade = round(FADE_IN_S * RATE_HZ)
    return heard[fade : fade + 5 * RATE_HZ // 2]


def test_its_density_falls_by_3_01_db_an_octave_from_50_hz_to_8_khz(heard: Frames) -> None:
    samples = steady(heard)[: 2 * RATE_HZ] / 32_768
    power = np.abs(np.fft.rfft(samples)) ** 2
    edges_hz = 50.0 * 2 ** np.linspace(0, np.log2(160), 23)
    places = np.round(edges_hz * 2).astype(int)
    density = [power[a:b].mean() for a, b in pairwise(places)]
    middles = np.log2(np.sqrt(edges_hz[:-1] * edges_hz[1:]))
    slope_db, level_db = np.polyfit(middles, 10 * np.log10(density), 1)
    print(f"slope {slope_db:.4f} dB an octave")
    assert slope_db == pytest.approx(-3.01, abs=0.15)
    assert np.abs(10 * np.log10(density) - slope_db * middles - level_db).max() < 0.3


def test_it_has_no_gap_longer_than_one_sample(heard: Frames) -> None:
    samples = steady(heard)
    changes = np.flatnonzero(np.diff(samples, prepend=samples[0] - 1, append=samples[-1] - 1))
    nothing = np.flatnonzero(np.diff(np.flatnonzero(samples)) > 2)
    assert np.diff(changes).max() <= 3
    assert len(nothing) == 0
    assert np.array_equal(samples[RATE_HZ:], samples[:-RATE_HZ])


def test_every_window_of_it_correlates_with_the_loop_at_one_lag_the_seam_too(heard: Frames) -> None:
    samples = steady(heard).astype(float)
    loop = machine_noise()._loop.astype(float)
    width = 512
    seams, lags = 0, set()
    for start in range(0, len(samples) - width, width // 2):
        window = samples[start : start + width]
        wanted = np.zeros(len(loop))
        wanted[:width] = window
        products = np.fft.irfft(np.fft.rfft(loop) * np.conj(np.fft.rfft(wanted)), n=len(loop))
        place = int(np.argmax(products))
        match = np.resize(np.roll(loop, -place), width)
        assert np.corrcoef(window, match)[0, 1] > 0.9999
        lags.add((place - start) % len(loop))
        seams += width // 4 <= len(loop) - place <= 3 * width // 4
    assert len(lags) == 1
    assert seams >= 2


def test_over_its_seam_it_correlates_with_itself_as_anywhere(heard: Frames) -> None:
    samples = steady(heard).astype(float)
    first = machine_noise()._loop[:64].astype(float)
    seam = next(k for k in range(256, RATE_HZ + 256) if np.array_equal(samples[k : k + 64], first))
    places = np.append(seam, np.arange(256, 2 * RATE_HZ, 101))
    for lag in (1, 2, 4, 8):
        pairs = [(samples[k - lag - 64 : k + 64 - lag], samples[k - 64 : k + 64]) for k in places]
        here, *elsewhere = (np.arctanh(np.corrcoef(*pair)[0, 1]) for pair in pairs)
        assert abs(here - np.mean(elsewhere)) < 3 * np.std(elsewhere)


def test_it_fades_in_over_one_second_from_nothing(heard: Frames) -> None:
    block = RATE_HZ // 20
    soft, full = heard[: 2 * RATE_HZ].astype(float).reshape(2, -1, block)
    gain = np.sum(soft * full, axis=1) / np.sum(full**2, axis=1)
    wanted = np.sin(np.pi / 2 * (np.arange(20) + 0.5) / 20) ** 2
    assert np.all(np.diff(gain) > 0)
    assert gain[0] < 0.01
    assert np.abs(gain - wanted).max() < 0.03


def until_not_ok(noise: SoundCardNoise) -> tuple[float, str]:
    """Return how long it took that the health was bad, in seconds, and the words."""
    began_s = time.monotonic()
    while (health := noise.health()).ok and time.monotonic() < began_s + 5.0:
        time.sleep(0.01)
    return time.monotonic() - began_s, health.words


def ways_to_lose(sink: NullSink) -> dict[str, Callable[[], object]]:
    def pactl(*command: str) -> Callable[[], object]:
        return lambda: subprocess.run(["pactl", "-s", f"unix:{sink.socket}", *command], check=True)

    return {
        "killed": sink.kill,
        "hanging": lambda: sink.freeze(on=True),
        "unloaded": pactl("unload-module", "module-null-sink"),
        "suspended": pactl("suspend-sink", "plate", "1"),
    }


@pytest.fixture
def started(null_sink: NullSink) -> Iterator[SoundCardNoise]:
    """Noise on the null sink; afterwards there is a fresh server."""
    noise = machine_noise()
    noise.start()
    yield noise
    noise.stop()
    null_sink.kill()
    null_sink.start()


@pytest.mark.parametrize("way", ["killed", "hanging", "unloaded", "suspended"])
def test_a_loss_is_found_within_half_a_second_and_the_noise_comes_back(
    null_sink: NullSink, started: SoundCardNoise, way: str
) -> None:
    started.health()
    ways_to_lose(null_sink)[way]()
    took_s, words = until_not_ok(started)
    print(f"{way}: {took_s:.2f} s, {words}")
    assert took_s < 0.5
    assert "gone away" in words or "frames" in words
    null_sink.freeze(on=False)
    null_sink.kill()
    with pytest.raises(NoiseError, match="masking"):
        started.start()
    assert started.health().ok is False
    null_sink.start()
    null_sink.listen()
    started.start()
    assert started.health().ok is True
    assert null_sink.until(lambda: bool(np.abs(null_sink.recorded()).max(initial=0) > 500))


def test_a_check_plays_it_alone(null_sink: NullSink, tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(
        '[masking]\nnoise = "pink"\nmax_level_dba = 75\nloop_s = 1.0\n', encoding="utf-8"
    )
    null_sink.listen()
    done = CliRunner().invoke(check, [str(study), "--noise", "1"])
    assert done.exit_code == 0, done.stderr
    assert "1 s; Ctrl-C ends it" in done.stderr
    recorded = null_sink.recorded()
    assert np.count_nonzero(recorded[:, 0]) > 0.5 * RATE_HZ


def test_without_noise_there_is_none_to_play(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text('[masking]\nnoise = "none"\n', encoding="utf-8")
    done = CliRunner().invoke(check, [str(study), "--noise", "5"])
    assert (done.exit_code, done.stdout) == (2, "")
    assert '--noise needs masking.noise = "pink"' in done.stderr
