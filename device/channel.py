"""A line of bytes as the host sees it, and the heart that keeps a device on it awake."""

import contextlib
from collections.abc import Callable
from threading import Event, Thread
from typing import Final, Protocol

from device.driver import LinkError

BEAT_EVERY_S: Final = 0.1
"""Interval of the heartbeat."""


class Channel(Protocol):
    """A line that carries bytes both ways.

    Every method raises `LinkError` once the line is gone.

    Examples
    --------
    >>> sorted(name for name in vars(Channel) if not name.startswith("_"))
    ['close', 'read', 'write']
    """

    def write(self, data: bytes) -> None:
        """Send bytes; from several threads."""

    def read(self, timeout_s: float) -> bytes:
        """Return what has arrived, or wait for it; nothing after `timeout_s`."""

    def close(self) -> None:
        """Close the line."""


class Heart:
    """A thread that beats until it is told to end, whatever the line is like.

    Parameters
    ----------
    beat : callable
        What it does every 100 ms; a `LinkError` of it is passed over.

    Examples
    --------
    >>> beaten = Event()
    >>> heart = Heart(beaten.set)
    >>> beaten.wait(60.0)
    True
    >>> heart.end()
    """

    def __init__(self, beat: Callable[[], None]) -> None:
        self._beat = beat
        self._over = Event()
        self._thread = Thread(target=self._run, name="tactstrip heartbeat", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Stop beating; return when the thread is over."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(BEAT_EVERY_S):
            with contextlib.suppress(LinkError):
                self._beat()
