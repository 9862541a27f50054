"""Masking noise, judged on a virtual sound card."""

from __future__ import annotations

import hashlib
import sys
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import pytest

from device import LinkError, MonotonicClock, VirtualClock
from experiment import paper_study
from experiment.hardware.noise import (
    FADE_IN_S,
    FADE_OUT_S,
    LATENCY_S,
    SLACK_S,
    NoiseError,
    SilentNoise,
    SoundCardNoise,
    noise_player,
)
from tests.plates import on_paper_plate

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from tests.conftest import Refused

    Frames: TypeAlias = NDArray[np.int16]
    Callback: TypeAlias = Callable[..., None]

PINK = paper_study().masking.changed(noise="pink", max_level_dba=75.0, loop_s=1.0)
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


def noise_on(card: Card, masking: Any = PINK) -> SoundCardNoise:
    return SoundCardNoise(masking, card, card.connect)


def playing_on(card: Card) -> SoundCardNoise:
    noise = noise_on(card)
    noise.start()
    card.wait(1.0)
    return noise


def assert_lost(noise: SoundCardNoise, word: str = "") -> None:
    health = noise.health()
    assert health.ok is False
    assert word in health.message


def test_it_fades_in_and_then_repeats_the_loop_whose_checksum_it_states(card: Card) -> None:
    noise = playing_on(card)
    card.wait(3.0)
    left, right = card.frames().T
    fade = round(FADE_IN_S * RATE_HZ)
    loop = np.roll(left[fade : fade + RATE_HZ], fade)
    assert np.array_equal(left, right)
    assert noise.sha256 == hashlib.sha256(loop.astype("<i2").tobytes()).hexdigest()
    assert np.array_equal(left[fade:], np.resize(np.roll(loop, -fade), len(left) - fade))
    gain = np.sin(np.pi / 2 * np.arange(1, fade + 1) / fade) ** 2
    assert np.abs(left[:fade] - gain * np.resize(loop, fade)).max() <= 0.5


def test_the_loop_has_the_level_of_the_study(card: Card) -> None:
    for level_dbfs in (-40.0, -30.0, -20.0):
        card.blocks.clear()
        noise = noise_on(card, PINK.changed(level_dbfs=level_dbfs))
        noise.start()
        card.wait(2.0)
        loop = card.frames()[-RATE_HZ:, 0] / 32_767
        assert 10 * np.log10(np.mean(loop**2)) == pytest.approx(level_dbfs, abs=0.01)
        noise.stop()


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


def test_a_gap_is_told_once_and_counted_for_ever(card: Card) -> None:
    card.underruns = 1
    noise = playing_on(card)
    assert noise.health().ok is True  # it was still fading in
    card.underruns = 2
    card.wait(1.0)
    health = noise.health()
    assert (health.ok, health.underruns) == (False, 3)
    assert (noise.health().ok, noise.health().underruns) == (True, 3)


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


def test_a_card_that_cannot_be_opened_is_an_error_of_one_line(
    card: Card, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(callback: Callback) -> Card:
        raise LinkError("card 7 is gone")

    monkeypatch.setitem(sys.modules, "sounddevice", None)
    noises = (
        SoundCardNoise(PINK, card, refuse),
        noise_player(PINK, MonotonicClock(), is_silent=False),
    )
    for noise, why in zip(noises, ("card 7", "sound"), strict=True):
        with pytest.raises(NoiseError, match=why) as refused:
            noise.start()
        assert str(refused.value).count("\n") == 0
        assert noise.health().ok is False


def test_nothing_is_played_to_a_simulated_participant_or_where_the_study_wants_none() -> None:
    for masking, simulated in ((PINK, True), (PINK.changed(noise="none"), False)):
        noise = noise_player(masking, VirtualClock(), is_silent=simulated)
        assert isinstance(noise, SilentNoise)
        noise.start()
        assert noise.health().ok is None
        assert noise.sha256 is None
        noise.stop()
        assert noise.health().ok is None


def test_everybody_hears_the_same_noise() -> None:
    sums = {noise_player(PINK, VirtualClock(), is_silent=False).sha256 for _ in range(2)}
    assert sums == {LOOP_SHA256}


def test_a_level_that_would_be_clipped_is_refused_before_anything_is_opened() -> None:
    masking = PINK.changed(level_dbfs=-18.0)
    assert noise_player(masking, VirtualClock(), is_silent=False).sha256 is not None
    object.__setattr__(masking, "level_dbfs", -10.0)
    with pytest.raises(NoiseError, match=r"-1\d\.\d\d.*got -10"):
        noise_player(masking, VirtualClock(), is_silent=False)


def test_without_noise_there_is_none_to_play(tmp_path: Path, refused: Refused) -> None:
    study = tmp_path / "study.toml"
    study.write_text(on_paper_plate('[masking]\nnoise = "none"\n'), encoding="utf-8")
    assert "masking.noise" in refused("check", study, "--noise", "5")
