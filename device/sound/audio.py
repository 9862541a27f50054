"""The first channels of a sound card as a `BurstDevice`. Not tried with an actuator behind it.

A stream is held open and fed by a callback. A burst counts as fired only if the card took every
frame of it and reported no gap until it must have been heard.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from device.checks import require_positive
from device.core.converter import Converter, ConverterDevice, Played
from device.core.messages import full_scale
from device.driver import Outcome
from device.errors import LinkError
from device.sound.player import Player, SoundBurst
from device.sound.stream import Callback, Stream, open_duplex, open_stream, output_latency_s

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from device.clock import Clock
    from device.driver import FloatArray
    from device.limits import Limits
    from device.sound.recorder import Recorder

BITS: Final = 16
"""Of the frames; a card with more gets zeros below them."""

CANNOT: Final = (
    "bring its outputs to zero when the sound system hangs",
    "hold a ceiling of its own: a mixer's volume changes what full scale is",
    "cut short what the sound card was given already",
    "notice every gap: a sound system may lose frames without reporting it",
)
"""What no sound card can guarantee."""
UNMEASURED: Final = (
    "time the onset more precisely than the sound system states its latency: no loopback "
    "measured it"
)
"""What a sound card cannot guarantee without a loopback."""

_POLL_S: Final = 0.001
_MAX_DELAY_S: Final = 2.0
"""A burst that the card has not played so long after its end is given up."""


class AudioConverter(Converter):
    """The first outputs of a sound card as a `Converter`.

    `open_card` opens the stream that calls back. The largest sample is `volts_full_scale` at the
    actuator, to both sides. `first_frame` is the frame of the stream at which the last burst began;
    None if none did.
    """

    bits, emulated, protocol = BITS, False, "PortAudio"
    name = "audio"

    def __init__(
        self,
        open_card: Callable[[Callback], Stream],
        clock: Clock,
        *,
        volts_full_scale: float,
        sample_rate_hz: float,
        card: str,
        recorder: Recorder | None,
        channels: int = 2,
    ) -> None:
        require_positive("volts_full_scale", volts_full_scale)
        self.serial_number = card
        self.channels = channels
        self.full_scale_v = volts_full_scale
        self.sample_rate_hz = sample_rate_hz
        self.cannot = CANNOT if recorder is not None else (*CANNOT, UNMEASURED)
        self.first_frame: int | None = None
        self._open_card = open_card
        self._clock = clock
        self._recorder = recorder
        self._stream: Stream | None = None
        self._player = Player(clock, sample_rate_hz)

    def connect(self) -> None:
        """Open the stream, silent."""
        self._player.mute(on=True)
        self.renew()

    def renew(self) -> None:
        """Reopen the stream, which restores the delay of a new stream."""
        self.disconnect()
        self._player.frames = 0
        if self._recorder is not None:
            self._recorder.restart()
        self._stream = self._open_card(self._player)

    def disconnect(self) -> None:
        """Close the stream."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def switch_on(self) -> None:
        """Unmute the output, if the stream is open."""
        self._require_stream()
        self._player.mute(on=False)

    def select(self, slot: int, levels_vpp: Sequence[float]) -> None:
        """Refuse to arm a burst for a stream that is gone."""
        self._require_stream()

    def zero(self) -> None:
        """Play zeros from the next buffer on."""
        self._player.mute(on=True)

    def play(self, volts: FloatArray) -> Played:
        """Give a burst to the card, and wait until it must have been heard."""
        began_s = self._clock.now_s()
        latency_s = 0.0 if self._stream is None else output_latency_s(self._stream)
        scale = full_scale(BITS) / self.full_scale_v
        frames = np.rint(volts.T * scale).astype(np.int16)
        burst = self._player.play(frames, latency_s)
        until_s = began_s + len(frames) / self.sample_rate_hz + _MAX_DELAY_S
        while not burst.is_settled(self._clock.now_s()) and self._clock.now_s() < until_s:
            self._clock.wait(_POLL_S)
        self._player.forget()
        self.first_frame = burst.first if burst.taken else None
        half_s = burst.latency_s / 2
        return Played(
            outcome=outcome_of(burst), onset_s=burst.began_s + half_s, uncertainty_s=half_s
        )

    def _require_stream(self) -> None:
        if self._stream is None or not self._stream.active:
            raise LinkError(f"the sound card {self.serial_number} has gone away")


def outcome_of(burst: SoundBurst) -> Outcome:
    """Return what is known of a burst that is settled, or was waited for in vain.

    >>> two = np.zeros((2, 2), dtype=np.int16)
    >>> outcome_of(SoundBurst(frames=two, taken=2, callbacks_after=1)).value
    'fired'
    >>> outcome_of(SoundBurst(frames=two, taken=2, callbacks_after=1, clean=False)).value
    'indeterminate'
    >>> outcome_of(SoundBurst(frames=two, taken=0, cut=True)).value
    'not_fired'
    """
    if burst.cut and not burst.taken:
        return Outcome.NOT_FIRED
    if burst.is_complete and burst.callbacks_after and burst.clean and not burst.cut:
        return Outcome.FIRED
    return Outcome.INDETERMINATE


def audio_device(
    port: str,
    *,
    limits: Limits,
    clock: Clock,
    volts_full_scale: float,
    sample_rate_hz: float,
    channels: int = 2,
    recorder: Recorder | None = None,
) -> ConverterDevice:
    """Return the driver of a sound card; nothing is opened yet.

    The port is the sound card's name as `sounddevice` lists it, or a part that no other card has.
    `volts_full_scale` is a measured calibration: the volts at the actuator for a sample of 1. With
    a recorder, the card's inputs and outputs are opened as one stream.

    >>> from device.clock import VirtualClock
    >>> from device.limits import Limits
    >>> device = audio_device("no such card", limits=Limits(ceiling_vpp=200.0),
    ...                       clock=VirtualClock(), volts_full_scale=110.0, sample_rate_hz=48e3)
    >>> device.cannot[2]
    'cut short what the sound card was given already'
    """
    opened = partial(open_duplex, recorder=recorder) if recorder else partial(open_stream)
    converter = AudioConverter(
        partial(opened, card=port, channels=channels, sample_rate_hz=sample_rate_hz),
        clock,
        volts_full_scale=volts_full_scale,
        sample_rate_hz=sample_rate_hz,
        card=port,
        recorder=recorder,
        channels=channels,
    )
    return ConverterDevice(converter, limits=limits, clock=clock)
