"""How a session is asked to stop from outside: by a signal, at a point where that is safe."""

from __future__ import annotations

import contextlib
import signal
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator


class StopRequested(Exception):  # noqa: N818 - not an error: it ends a wait
    """The wait in progress is over because the session is to be stopped."""


class StopSignal:
    """A wish to stop: kept until the session can heed it, and ending any wait for a person."""

    def __init__(self) -> None:
        self.asked = False
        self._waiting = False

    def ask(self) -> None:
        """Ask the session to stop."""
        self.asked = True
        if self._waiting:
            self._waiting = False
            raise StopRequested

    @contextlib.contextmanager
    def interruptible(self) -> Iterator[None]:
        """Mark a wait for a person: `StopRequested` is raised in it when a stop is asked for.

        Raises
        ------
        StopRequested
            At once where the stop was asked for before.
        """
        self._waiting = True
        try:
            if self.asked:
                raise StopRequested
            yield
        finally:
            self._waiting = False

    @contextlib.contextmanager
    def on_signals(self) -> Iterator[None]:
        """Let Ctrl-C, SIGTERM and a closed terminal ask for the stop, not end the program."""
        names = ("SIGINT", "SIGTERM", "SIGHUP")
        numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
        before = [signal.signal(number, lambda *_: self.ask()) for number in numbers]
        try:
            yield
        finally:
            for number, handler in zip(numbers, before, strict=True):
                signal.signal(number, handler)
