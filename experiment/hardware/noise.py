"""The masking noise of a session: it is started, checked and stopped."""

from __future__ import annotations

import hashlib
import math
from concurrent.futures import TimeoutError as TooLate
from concurrent.futures import wait
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from device.errors import LinkError
from device.sound.player import LoopPlayer
from device.sound.stream import in_a_thread, open_stream, stderr_kept
from stimuli.drive.noise import pink_loop

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Future

    from device.clock import Clock
    from device.sound.stream import Callback, Stream
    from experiment.study.equipment import Masking


class NoiseError(RuntimeError):
    """The noise cannot be played; the message says why and what to do."""


@dataclass(frozen=True, slots=True)
class NoiseHealth:
    """Whether the noise is playing now.

    Attributes
    ----------
    ok : bool or None
        ``None`` where none is to be played, or the participant is simulated.
    message : str
        For the operator: what is wrong, or that it plays.
    frames, underruns : int
        Taken by the sound card so far, and how often it had to wait.
    """

    ok: bool | None
    message: str
    frames: int = 0
    underruns: int = 0


class NoisePlayer(Protocol):
    """What plays the masking noise of a study, or plays nothing."""

    @property
    def sha256(self) -> str | None:
        """Checksum of the loop's samples, or None if nothing plays."""

    def start(self) -> None:
        """Fade in, and play until `stop`; also again after the sound card was lost.

        Raises
        ------
        NoiseError
            If it cannot be played.
        """

    def health(self) -> NoiseHealth:
        """Return whether it plays now; returns at once, and touches no disk."""

    def stop(self) -> None:
        """Fall silent; from any state."""


FADE_IN_S: Final = 1.0
"""From silence to full level."""

FADE_OUT_S: Final = 0.1
"""From full level to silence."""

LATENCY_S: Final = 0.2
"""Sound that lies ready in the sound card: for so long may this program be held up."""

SLACK_S: Final = 0.1
"""A call for frames may come so much later than the frames given last are used up, and elapsed time
and that of the frames may differ by so much more than the latency over ten seconds."""

# One seed for all: every participant hears the same loop, as the checksum in the header shows.
_SEED: Final = 20_250_101
_FULL_SCALE: Final = 32_767
_PATIENCE_S: Final = 5.0
_POLL_S: Final = 0.02


def noise_player(masking: Masking, clock: Clock, *, is_silent: bool) -> NoisePlayer:
    """Return what plays a study's masking noise; no sound card is opened yet.

    Parameters
    ----------
    masking : Masking
        The study's.
    clock : Clock
        The machine's.
    is_silent : bool
        Whether no noise plays: the participant is simulated, or practises without a device.

    Raises
    ------
    NoiseError
        If the noise would be clipped at its level.

    Examples
    --------
    >>> from device.clock import VirtualClock
    >>> from experiment.study.equipment import Masking
    >>> pink = Masking(noise="pink", max_level_dba=75.0, loop_s=1.0)
    >>> player = noise_player(pink, VirtualClock(), is_silent=False)
    >>> player.sha256[:8], player.health().message
    ('dde72e97', 'the noise is not playing')
    >>> noise_player(pink, VirtualClock(), is_silent=True).sha256 is None
    True
    """
    if is_silent or masking.noise == "none":
        return SilentNoise()
    card, rate_hz = masking.sound_card, masking.sample_rate_hz
    connect = partial(open_stream, card=card, channels=2, sample_rate_hz=rate_hz, latency=LATENCY_S)
    return SoundCardNoise(masking, clock, connect)


class SilentNoise:
    """A `NoisePlayer` that plays nothing, for studies without noise and simulated participants.

    Examples
    --------
    >>> noise = SilentNoise()
    >>> noise.start(); noise.health().ok is None, noise.sha256 is None
    (True, True)
    """

    sha256 = None

    def start(self) -> None:
        """Do nothing."""

    def health(self) -> NoiseHealth:
        """Say that there is none."""
        return NoiseHealth(ok=None, message="no noise")

    def stop(self) -> None:
        """Do nothing."""


class SoundCardNoise:
    """A `NoisePlayer` that repeats a loop of pink noise, always the same, on a sound card.

    `connect` opens a stream of two channels of int16 for a callback, and raises `LinkError` where
    it cannot. Noise that would be clipped at its level is refused by `NoiseError`.
    """

    def __init__(
        self, masking: Masking, clock: Clock, connect: Callable[[Callback], Stream]
    ) -> None:
        sound = masking.model_dump(include={"sample_rate_hz", "loop_s", "level_dbfs"})
        try:
            loop = pink_loop(**sound, rng=np.random.default_rng(_SEED))
        except ValueError as error:
            raise NoiseError(f"masking.{error}") from error
        self._loop = np.rint(loop * _FULL_SCALE).astype(np.int16)
        self._rate_hz = masking.sample_rate_hz
        self._clock = clock
        self._connect = connect
        self._card = masking.sound_card or "default"
        self._player: LoopPlayer | None = None
        self._stream: Stream | None = None
        self._since_s = 0.0
        self._underruns_seen = 0
        # of the samples as int16, low byte first
        self.sha256 = hashlib.sha256(self._loop.astype("<i2").tobytes()).hexdigest()

    def start(self) -> None:
        """Open the sound card, fade in, and return when the noise has its full level.

        What played before is stopped first. A card that takes no frames is refused by `NoiseError`.
        """
        self.stop()
        fade_in, fade_out = round(FADE_IN_S * self._rate_hz), round(FADE_OUT_S * self._rate_hz)
        player = LoopPlayer(self._loop, self._clock, fade_in=fade_in, fade_out=fade_out)
        with stderr_kept():
            self._stream = self._open(player)
        self._player = player
        self._wait_until(lambda: player.full, FADE_IN_S + _PATIENCE_S)
        self._since_s = self._clock.now_s()
        self._underruns_seen = player.underruns
        if not player.full:
            self._close()
            raise NoiseError(f"the masking noise does not start: {self._card} takes no frames")

    def health(self) -> NoiseHealth:
        """Return whether it plays now, and has played without a gap since the last call."""
        player = self._player
        if player is None or self._stream is None:
            return NoiseHealth(ok=False, message="the noise is not playing")
        fault = self._fault(self._stream, player)
        self._underruns_seen, frames = player.underruns, player.frames
        message = fault or "the noise plays"
        return NoiseHealth(not fault, message, frames=frames, underruns=self._underruns_seen)

    def stop(self) -> None:
        """Fade out, wait until that must have been heard, and close the sound card."""
        player, stream = self._player, self._stream
        # Only a card that still asks for frames can be faded out; waiting for one that hangs would
        # keep the participant. What the player has handed over is heard a latency later.
        if player is not None and stream is not None and self._is_called(stream, player):
            player.fade_out()
            if self._wait_until(lambda: player.silent, FADE_OUT_S + stream.latency + SLACK_S):
                self._clock.wait(stream.latency)
        self._close()

    def _fault(self, stream: Stream, player: LoopPlayer) -> str:
        if not stream.active:
            return f"the sound card {self._card} has gone away"
        if not self._is_called(stream, player):
            return f"the sound card {self._card} takes no more frames"
        gaps = player.underruns - self._underruns_seen
        if gaps > 0:
            return f"the noise had {gaps} gap{'s' * (gaps > 1)}: the computer was too slow"
        # A card that has gone away may go on asking for frames, much too fast or too slowly: that
        # it asks is no proof that it plays. Marks of the last ten seconds count from the full level
        # on, for at its start a card takes frames ahead to fill its buffers.
        ahead_s, marks = 0.0, [mark for mark in player.marks if mark.at_s >= self._since_s]
        if player.last is not None and marks:
            played_s = (player.last.frames - marks[0].frames) / self._rate_hz
            ahead_s = played_s - (player.last.at_s - marks[0].at_s)
        if abs(ahead_s) > stream.latency + SLACK_S:
            wrong = "fast" if ahead_s > 0 else "slow"
            return f"the sound card {self._card} is too {wrong}: {ahead_s:+.1f} s in 10 s or less"
        return ""

    def _is_called(self, stream: Stream, player: LoopPlayer) -> bool:
        last_s = -math.inf if player.last is None else player.last.at_s
        return stream.active and self._clock.now_s() - last_s <= stream.latency + SLACK_S

    def _wait_until(self, done: Callable[[], bool], response_timeout_s: float) -> bool:
        until_s = self._clock.now_s() + response_timeout_s
        while not done() and self._clock.now_s() < until_s:
            self._clock.wait(_POLL_S)
        return done()

    def _open(self, player: LoopPlayer) -> Stream:
        opening: Future[Stream] = in_a_thread(lambda: self._connect(player))
        try:
            return opening.result(timeout=_PATIENCE_S)
        # A thread that hangs in the sound system cannot be ended. If it opens the card after all,
        # the card gets silence and is closed at once.
        except TooLate as error:
            player.fade_out()
            opening.add_done_callback(_close_late)
            why = "the sound system hangs; restart it"
            raise NoiseError(f"the masking noise does not start: {why}") from error
        except LinkError as error:
            raise NoiseError(f"the masking noise does not start: {error}") from error

    def _close(self) -> None:
        stream, self._stream, self._player = self._stream, None, None
        if stream is not None:
            wait([in_a_thread(stream.close)], timeout=_PATIENCE_S)


def _close_late(opening: Future[Stream]) -> None:
    if opening.exception() is None:
        opening.result().close()
