"""Two channels of a sound card as a `BurstDevice`. Not tried with an actuator behind it.

A stream is held open and fed by a callback. A sound card knows no tokens, states or rests: a
`DeviceCore` in this process keeps them. A burst counts as fired only if the card took every frame
of it and told of no gap until it must have been heard.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from device.checks import require_positive
from device.core.host import HostDriver
from device.core.local import HostedCore
from device.core.messages import Arm, Enable, Message, full_scale
from device.core.output import OutputStage
from device.core.tokens import Exchange, Fate, Record, Reply
from device.driver import Identity
from device.errors import LinkError
from device.sound.player import Frames, Played, Player
from device.sound.stream import CHANNELS, Callback, Stream, open_duplex, open_stream

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.limits import Limits
    from device.sound.recorder import Recorder

BITS: Final = 16
"""Of the frames; a card with more gets zeros below them."""

CANNOT: Final = (
    "bring its outputs to zero when the sound system hangs",
    "hold a ceiling of its own: a mixer's volume changes what full scale is",
    "cut short what the sound card was given already",
    "notice every gap: a sound system may lose frames and not tell",
)
"""What no sound card can promise."""
UNMEASURED: Final = (
    "tell the onset better than the sound system states its latency: no loopback measured it"
)
"""What none can promise that does not hear itself."""

_POLL_S: Final = 0.001
_PATIENCE_S: Final = 2.0
_SLEW_V_S: Final = 1e12


class AudioLink(HostedCore):
    """A `host.Link` to a sound card, with the core that it lacks.

    The largest sample is `volts_full_scale` at the actuator, to both sides; no ceiling above that.
    """

    def __init__(
        self,
        connect: Callable[[Callback], Stream],
        clock: Clock,
        *,
        limits: Limits,
        volts_full_scale: float,
        sample_rate_hz: float,
        name: str,
        recorder: Recorder | None,
    ) -> None:
        output = OutputStage(
            sample_rate_hz=sample_rate_hz, bits=BITS, rail_v=volts_full_scale, slew_v_s=_SLEW_V_S
        )
        super().__init__(clock, limits=limits, output=output)
        self._connect = connect
        self._name = name
        self._stream: Stream | None = None
        self._recorder = recorder
        self.player = Player(clock, sample_rate_hz)
        self.played: int | None = None

    def hello(self) -> Identity:
        """Open the stream, silent."""
        self._attend()
        self._drop()
        self.player.mute(on=True)
        self._begin()
        self._known = self._core.state
        limits, output = self._core.limits, self._core.output
        return Identity(
            model="audio",
            serial_number=self._name,
            boot_id=self.boot_id,
            protocol_version="PortAudio",
            sample_rate_hz=output.sample_rate_hz,
            bits=output.bits,
            channels=CHANNELS,
            ceiling_vpp=limits.ceiling_vpp,
            longest_waveform=limits.longest_waveform,
            emulated=False,
        )

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Give a message to the core; enabled and armed is only what has a stream that lives."""
        if isinstance(message, Enable | Arm):
            self._require_stream()
        told = super().exchange(message)
        if isinstance(message, Enable):
            self.player.mute(on=False)
            if self._stops:  # asked for meanwhile, by another thread: a stop has the last word
                self.player.mute(on=True)
        return told

    def stop(self) -> None:
        """Play zeros from the next buffer on, from any thread."""
        super().stop()
        self.player.mute(on=True)

    def hang_up(self) -> None:
        """Close the stream."""
        super().hang_up()
        self._drop()

    def renew(self) -> None:
        """Open the stream anew, with the delay that one has when it begins."""
        self._drop()
        self._begin()

    def _begin(self) -> None:
        self.player.frames = 0
        if self._recorder is not None:
            self._recorder.restart()
        self._stream = self._connect(self.player)

    def _drop(self) -> None:
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def _require_stream(self) -> Stream:
        if self._stream is None or not self._stream.active:
            raise LinkError(f"the sound card {self._name} has gone away")
        return self._stream

    def _play(self, record: Record) -> Exchange[Record]:
        asked_s = self._clock.now_s()
        stream = self._stream
        latency_s = 0.0 if stream is None else stream.latency
        self.played = None
        burst = self.player.play(self._frames(), latency_s)
        until_s = asked_s + len(burst.frames) / self._core.output.sample_rate_hz + _PATIENCE_S
        while not burst.settled(self._clock.now_s()) and self._clock.now_s() < until_s:
            self._clock.wait(_POLL_S)
        self.player.forget()
        self.played = burst.first if burst.taken else None
        fate = fate_of(burst)
        if fate is not Fate.FIRED:
            known = Record(token=record.token, fate=fate)
            return self._told(known, asked_s, self._clock.now_s(), 0)
        start_us = self._device_us(burst.began_s)
        known = replace(record, start_us=start_us)
        return self._told(known, burst.began_s, burst.began_s + burst.told_s, start_us)

    def _frames(self) -> Frames:
        """Return the samples, shape (n, 2), of what the core has just fired."""
        playing, output = self._core.playing, self._core.output
        rows = () if playing is None else (playing.left_v, playing.right_v)
        full = full_scale(output.bits) / output.rail_v
        return np.rint(np.array(rows).T * full).astype(np.int16)


def fate_of(burst: Played) -> Fate:
    """Return what is known of a burst that is settled, or was waited for in vain.

    >>> two = np.zeros((2, 2), dtype=np.int16)
    >>> fate_of(Played(frames=two, taken=2, callbacks_after=1)).value
    'fired'
    >>> fate_of(Played(frames=two, taken=2, callbacks_after=1, clean=False)).value
    'unknown'
    >>> fate_of(Played(frames=two, taken=0, cut=True)).value
    'aborted'
    """
    if burst.cut and not burst.taken:
        return Fate.ABORTED
    if burst.complete and burst.callbacks_after and burst.clean and not burst.cut:
        return Fate.FIRED
    return Fate.UNKNOWN


class AudioDevice(HostDriver):
    """A `BurstDevice` that is a sound card with an amplifier behind it.

    `volts_full_scale` is a measured calibration: volts at the actuator, to both sides, for the
    largest sample.

    >>> from device.clock import VirtualClock
    >>> from device.limits import Limits
    >>> device = audio_device("no such card", limits=Limits(ceiling_vpp=200.0),
    ...                       clock=VirtualClock(), volts_full_scale=110.0, sample_rate_hz=48e3)
    >>> device.cannot[2]
    'cut short what the sound card was given already'
    """

    def __init__(
        self,
        connect: Callable[[Callback], Stream],
        *,
        limits: Limits,
        clock: Clock,
        volts_full_scale: float,
        sample_rate_hz: float,
        name: str,
        recorder: Recorder | None = None,
    ) -> None:
        require_positive("volts_full_scale", volts_full_scale)
        reachable_vpp = min(limits.ceiling_vpp, 2 * volts_full_scale)
        reachable = replace(limits, ceiling_vpp=reachable_vpp)
        self._audio = AudioLink(
            connect,
            clock,
            limits=reachable,
            volts_full_scale=volts_full_scale,
            sample_rate_hz=sample_rate_hz,
            name=name,
            recorder=recorder,
        )
        self.recorder = recorder
        super().__init__(self._audio, limits=reachable, clock=clock)

    @property
    def cannot(self) -> tuple[str, ...]:
        """What a sound card cannot promise."""
        return CANNOT if self.recorder is not None else (*CANNOT, UNMEASURED)

    def renew(self) -> None:
        """Open the stream anew between two bursts; nothing else changes."""
        self._audio.renew()

    def played(self) -> int | None:
        """Return the frame of the stream at which the last burst began; None if none did."""
        return self._audio.played


def audio_device(
    port: str,
    *,
    limits: Limits,
    clock: Clock,
    volts_full_scale: float,
    sample_rate_hz: float,
    recorder: Recorder | None = None,
) -> AudioDevice:
    """Return the driver of a sound card; nothing is opened yet.

    The port is the sound card's name, or a part of it that no other has, as `sounddevice` lists
    them. With a recorder its inputs are opened beside its outputs, as one stream.
    """

    def connect(callback: Callback) -> Stream:
        if recorder is not None:
            return open_duplex(callback, recorder, card=port, sample_rate_hz=sample_rate_hz)
        return open_stream(callback, card=port, sample_rate_hz=sample_rate_hz, latency="low")

    return AudioDevice(
        connect,
        limits=limits,
        clock=clock,
        volts_full_scale=volts_full_scale,
        sample_rate_hz=sample_rate_hz,
        name=port,
        recorder=recorder,
    )
