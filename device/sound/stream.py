"""Streams to a sound card through PortAudio, which is imported only when one is opened."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Final, Literal, Protocol, TypeAlias, TypeVar

from device.driver import LinkError
from device.sound.player import Frames

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.sound.player import StreamStatus, Timing


CHANNELS: Final = 2

_STDERR: Final = 2

Callback: TypeAlias = Callable[[Frames, int, "Timing", "StreamStatus"], None]
_Result = TypeVar("_Result")


class Stream(Protocol):
    """The part of `sounddevice.OutputStream` that is used."""

    @property
    def active(self) -> bool:
        """Whether the callback is being called."""

    @property
    def latency(self) -> float:
        """Seconds from callback to output, as PortAudio knows it."""

    def close(self) -> None:
        """End it."""


def open_stream(
    callback: Callback, *, card: str, sample_rate_hz: float, latency: float | Literal["low"]
) -> Stream:
    """Open two channels of int16 that are fed by a callback, and begin to call it.

    The card is a name, or a part of it that no other has, as `sounddevice` lists them; empty for
    the system's default. A `LinkError` says that PortAudio is missing, or cannot open or start it.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise LinkError(
            'sound needs sounddevice and PortAudio: pip install "tactstrip[audio]", on Debian '
            f"also the package libportaudio2; got {error}"
        ) from error
    try:
        stream = sounddevice.OutputStream(
            samplerate=sample_rate_hz,
            channels=CHANNELS,
            dtype="int16",
            device=card or None,
            latency=latency,
            callback=callback,
            dither_off=True,
        )
    except (sounddevice.PortAudioError, ValueError) as error:
        raise LinkError(f"cannot open the sound card {card or 'default'}: {error}") from error
    try:
        stream.start()
    except sounddevice.PortAudioError as error:
        stream.close()
        raise LinkError(f"cannot start the sound card {card or 'default'}: {error}") from error
    started: Stream = stream
    return started


def sound_cards() -> tuple[str, ...]:
    """Return the names of the sound cards with two outputs; none where PortAudio is missing."""
    try:
        import sounddevice
    except (ImportError, OSError):
        return ()
    cards = sounddevice.query_devices()
    return tuple(card["name"] for card in cards if card["max_output_channels"] >= CHANNELS)


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
    """Have standard error as before in the end.

    sounddevice turns it away while PortAudio looks for sound cards; if that hangs, nobody would
    read why the program ends.
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
