"""Streams to a sound card through PortAudio, which is imported only when one is opened."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Future
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final, Literal, Protocol, TypeAlias, TypeVar

from device.driver import Lack, installing
from device.errors import LinkError, SoundCardError
from device.sound.player import Frames

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.sound.player import StreamStatus, Timing
    from device.sound.recorder import Recorder


# PortAudio's error numbers, from portaudio.h
INVALID_CHANNEL_COUNT: Final = -9998
INVALID_SAMPLE_RATE: Final = -9997

_STDERR: Final = 2

Latency: TypeAlias = float | Literal["low"]
Callback: TypeAlias = Callable[[Frames, int, "Timing", "StreamStatus"], None]
_Result = TypeVar("_Result")


class Stream(Protocol):
    """The part of `sounddevice.OutputStream` that is used."""

    @property
    def active(self) -> bool:
        """Whether the callback is being called."""

    @property
    def latency(self) -> Any:
        """Seconds that PortAudio states; of a stream of inputs and outputs a pair."""

    def close(self) -> None:
        """End it."""


def open_stream(
    callback: Callback, *, card: str, channels: int, sample_rate_hz: float, latency: Latency = "low"
) -> Stream:
    """Open outputs of int16 that are fed by a callback, and begin to call it.

    The card is a name, or a part of it that no other has, as `sounddevice` lists them; empty for
    the system's default. A `LinkError` says that PortAudio is missing, or cannot open or start it.
    """
    stream: Stream = _started(
        "OutputStream",
        card,
        f"{channels} outputs",
        samplerate=sample_rate_hz,
        channels=channels,
        latency=latency,
        callback=callback,
    )
    return stream


def open_duplex(
    callback: Callback, recorder: Recorder, *, card: str, channels: int, sample_rate_hz: float
) -> Stream:
    """Open outputs and inputs of one card as one stream, so on one clock; as `open_stream`."""

    def both(heard: Frames, out: Frames, count: int, timing: Any, status: Any) -> None:
        recorder.take(heard, timing, status)
        callback(out, count, timing, status)

    inputs = max(recorder.channels)
    stream: Stream = _started(
        "Stream",
        card,
        f"{inputs} inputs, as monitor.inputs has them, and {channels} outputs",
        samplerate=sample_rate_hz,
        channels=(inputs, channels),
        latency="low",
        callback=both,
    )
    recorder.latency_s = stream.latency[0]
    return stream


def output_latency_s(stream: Stream) -> float:
    """Return the seconds from callback to output; a stream with inputs has their latency, too."""
    latency = stream.latency
    return float(latency[1] if isinstance(latency, tuple) else latency)


def open_inputs(recorder: Recorder, *, card: str) -> Stream:
    """Open a card's inputs, and begin to record; a `LinkError` as of `open_stream`."""

    def heard(frames: Frames, _: int, timing: Any, status: Any) -> None:
        recorder.take(frames, timing, status)

    inputs = max(recorder.channels)
    stream: Stream = _started(
        "InputStream",
        card,
        f"{inputs} inputs",
        samplerate=recorder.sample_rate_hz,
        channels=inputs,
        latency="low",
        callback=heard,
    )
    recorder.latency_s = stream.latency
    return stream


def _started(kind: str, card: str, needed: str, **settings: Any) -> Any:
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise LinkError(
            f"sound needs sounddevice and PortAudio: {installing('audio')}, on Debian also the "
            f"package libportaudio2; got {error}"
        ) from error
    try:
        stream = getattr(sounddevice, kind)(
            dtype="int16", device=card or None, dither_off=True, **settings
        )
    except (sounddevice.PortAudioError, ValueError) as error:
        raise _sound_card_error(card, "open", error, needed) from error
    try:
        stream.start()
    except sounddevice.PortAudioError as error:
        stream.close()
        raise _sound_card_error(card, "start", error, needed) from error
    return stream


def _sound_card_error(card: str, step: str, error: Exception, needed: str) -> SoundCardError:
    """Take over the error number, which PortAudio's errors carry in addition to their message."""
    code = next((value for value in error.args[1:2] if isinstance(value, int)), None)
    hint = f"; it must have {needed}" if code == INVALID_CHANNEL_COUNT else ""
    return SoundCardError(card=card, step=step, reason=f"{error}{hint}", code=code)


def sound_cards() -> dict[str, int]:
    """Return the outputs of each sound card by its name; none where PortAudio is missing."""
    try:
        import sounddevice
    except (ImportError, OSError):
        return {}
    cards = sounddevice.query_devices()
    return {card["name"]: n for card in cards if (n := card["max_output_channels"])}


def sound_lack() -> Lack | None:
    """Return what this machine lacks to play sound; PortAudio is not started and no card opened."""
    if find_spec("sounddevice") is None:
        return Lack(what="sounddevice", remedy=installing("audio"))
    if not sys.platform.startswith("linux"):
        return None  # the wheels of sounddevice bring PortAudio there
    try:
        ctypes.CDLL("libportaudio.so.2")
    except OSError:
        return Lack(what="PortAudio", remedy="on Debian it is the package libportaudio2")
    return None


def in_a_thread(act: Callable[[], _Result]) -> Future[_Result]:
    """Begin what may never return, in a thread for which neither caller nor program's end waits.

    >>> in_a_thread(lambda: 6 * 7).result(timeout=1.0)
    42
    """
    future: Future[_Result] = Future()

    def run() -> None:
        try:
            future.set_result(act())
        except BaseException as error:  # noqa: BLE001 - it is raised where the result is taken
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future


@contextlib.contextmanager
def stderr_kept() -> Iterator[None]:
    """Restore standard error at the end.

    sounddevice redirects it while PortAudio looks for sound cards. If that hangs, the message that
    ends the program would be lost.
    """
    try:
        kept = os.dup(_STDERR)
    except OSError:  # there is none
        yield
        return
    try:
        yield
    finally:
        os.dup2(kept, _STDERR)
        os.close(kept)
