"""Sound cards: frames as the callback hands them out, on a virtual clock."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import BurstDevice, Limits, LinkError, Outcome, Refusal, RefusedError
from device.sound import stream
from tests.test_device.bursts import BURST, play, ready, refusal
from tests.test_device.in_process import LoopCard, SoundCard, audio_on
from tests.test_device.loops import FULL_SCALE_V

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Frames = NDArray[np.int16]

RATE_HZ = 48_000.0


class Card(SoundCard):
    """A sound card that keeps what it plays, with trouble at some buffers."""

    def __init__(self) -> None:
        super().__init__()
        self.played: list[Frames] = []
        self.gap: int | None = None
        self.at_buffer: Callable[[int], None] = lambda _: None

    def take(self, callback: Any, *, underflow: bool = False) -> Frames:
        self.at_buffer(len(self.played))
        self.played.append(super().take(callback, underflow=len(self.played) == self.gap))
        return self.played[-1]

    def frames(self) -> Frames:
        return np.concatenate(self.played)


@pytest.fixture
def card() -> Card:
    return Card()


@pytest.fixture
def live(card: Card) -> BurstDevice:
    """Slot 0 plays left, 1 right, 2 a hundred periods to the left."""
    device = audio_on(card)
    ready(device, 100.0)
    long = np.append(np.tile(BURST[:-1], 100), 0.0)
    device.load(2, np.stack([long, 0 * long]))
    card.wait(0.1)
    card.played.clear()
    return device


def codes(level_vpp: float) -> Frames:
    volts = np.trunc(np.trunc(BURST * 32767) * level_vpp / 2 / FULL_SCALE_V)
    return volts.astype(np.int16)


@pytest.mark.parametrize("slot", [0, 1])
def test_a_burst_comes_out_on_its_channel_frame_by_frame(
    live: BurstDevice, card: Card, slot: int
) -> None:
    assert play(live, 1, slot).outcome is Outcome.FIRED
    frames = card.frames()
    assert np.array_equal(frames[:97, slot], codes(100.0))
    assert not frames[:, 1 - slot].any()
    assert not frames[97:].any()


def test_the_onset_interval_is_the_latency_that_was_told(live: BurstDevice, card: Card) -> None:
    asked_s = card.now_s()
    delivery = play(live, 1)
    assert delivery.host_before_s >= asked_s
    width_s = delivery.host_after_s - delivery.host_before_s
    assert width_s == pytest.approx(card.latency + card.buffer / RATE_HZ)
    assert delivery.uncertainty_s >= width_s / 2
    assert card.now_s() >= delivery.host_after_s


def test_the_same_token_again_plays_nothing_more(live: BurstDevice, card: Card) -> None:
    delivery = play(live, 1)
    card.wait(0.1)
    assert live.fire(1) == delivery == live.query(1)
    assert np.count_nonzero(np.diff(np.sign(np.abs(card.frames()[:, 0]).astype(int))) > 0) <= 2


@pytest.mark.parametrize("gap", range(6))
def test_a_gap_in_the_burst_or_before_it_is_heard_is_indeterminate_and_one_before_it_is_not(
    live: BurstDevice, card: Card, gap: int
) -> None:
    card.gap = gap
    assert play(live, 1).outcome is (Outcome.INDETERMINATE if gap else Outcome.FIRED)
    card.wait(0.1)
    assert play(live, 2).outcome is Outcome.FIRED


def test_a_card_that_takes_nothing_leaves_the_burst_open(live: BurstDevice, card: Card) -> None:
    live.arm(1, 0, time_to_live_s=1.0)
    card.active = False
    assert live.fire(1).outcome is Outcome.INDETERMINATE
    with pytest.raises(LinkError):
        live.arm(2, 0, time_to_live_s=1.0)


def test_a_stop_in_the_burst_silences_it_from_the_next_buffer_on(
    live: BurstDevice, card: Card
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
    live: BurstDevice, card: Card
) -> None:
    card.at_buffer = lambda index: live.stop() if index == 0 else None
    assert play(live, 1).outcome is Outcome.NOT_FIRED
    assert not card.frames().any()


@settings(deadline=None, max_examples=25)
@given(
    level_vpp=st.floats(0.0, 300.0), peak=st.floats(0.01, 1.0), ceiling_vpp=st.floats(1.0, 300.0)
)
def test_no_frame_is_above_the_ceiling(level_vpp: float, peak: float, ceiling_vpp: float) -> None:
    card = Card()
    device = audio_on(card, Limits(ceiling_vpp=ceiling_vpp))
    ready(device)
    device.load(2, np.stack([peak * BURST, peak * BURST]))
    try:
        device.set_levels([level_vpp, level_vpp])
        play(device, 1, slot=2)
    except RefusedError:
        card.wait(0.1)
        assert not card.frames().any()
        return
    volts = np.abs(card.frames().astype(float)).max() / 32767 * FULL_SCALE_V
    assert 2 * volts <= min(ceiling_vpp, level_vpp * peak) * (1 + 1e-9)


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
    with pytest.raises(LinkError, match=r"^[^\n]*default: .*$"):
        stream.open_stream(lambda *_: None, card="", channels=2, sample_rate_hz=RATE_HZ)
    assert not opened["stream"].active
    assert (opened["samplerate"], opened["channels"], opened["dtype"]) == (RATE_HZ, 2, "int16")
    assert (opened["device"], opened["latency"]) == (None, "low")
    assert opened["dither_off"]  # dither would be noise on frames that are exact, silence included


def test_a_card_without_the_inputs_of_a_monitor_is_refused_by_their_key(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class PortAudioError(Exception):
        pass

    def refuse(**_: object) -> None:
        raise PortAudioError("in another language", -9998)

    library = SimpleNamespace(PortAudioError=PortAudioError, Stream=refuse)
    monkeypatch.setitem(sys.modules, "sounddevice", library)
    with pytest.raises(LinkError, match=r"monitor\.inputs"):
        stream.open_duplex(print, LoopCard().recorder, card="x", channels=2, sample_rate_hz=RATE_HZ)
