"""What an operator, or a signal, requests of a running session: a pause, a note, a stop."""

from __future__ import annotations

import contextlib
import signal
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


class StopRequested(Exception):  # noqa: N818 - not an error: it ends a wait
    """A stop was requested, which ends the wait in progress."""


class StopSignal:
    """A request to stop: kept until the session can stop, and ending any wait for a person."""

    def __init__(self) -> None:
        self.is_requested = False
        self._waiting = False

    def request(self) -> None:
        """Request that the session stops."""
        self.is_requested = True
        if self._waiting:
            self._waiting = False
            raise StopRequested

    @contextlib.contextmanager
    def interruptible(self) -> Iterator[None]:
        """Mark a wait for a person: `StopRequested` is raised in it when a stop is requested.

        Raises
        ------
        StopRequested
            At once if a stop was requested before.
        """
        self._waiting = True
        try:
            if self.is_requested:
                raise StopRequested
            yield
        finally:
            self._waiting = False

    @contextlib.contextmanager
    def on_signals(self) -> Iterator[None]:
        """Let Ctrl-C, SIGTERM and a closed terminal request a stop, not end the program."""
        names = ("SIGINT", "SIGTERM", "SIGHUP")
        numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
        before = {number: signal.signal(number, lambda *_: self.request()) for number in numbers}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class Requests:
    """What an operator requests, from any thread; a session acts on it between two trials.

    Attributes
    ----------
    paused : bool
        Whether a pause is requested or in progress; responders end it when this becomes false.
    attended : bool
        Whether an operator has keys that end a pause.

    Examples
    --------
    >>> requests = Requests()
    >>> requests.pause(); requests.paused
    True
    >>> requests.note("chair moved"); requests.notes()
    ('chair moved',)
    >>> requests.notes()
    ()
    """

    def __init__(self) -> None:
        self.attended = False
        self.paused = False
        self._is_continue_requested = False
        self._notes: deque[str] = deque()

    def pause(self) -> None:
        """Request a pause after the current trial."""
        self._is_continue_requested = False
        self.paused = True

    def request_continue(self) -> None:
        """End a pause that the operator or the participant requested."""
        self.paused = False
        self._is_continue_requested = True

    def take_continue(self) -> bool:
        """Return, once, whether the end of a pause was requested."""
        is_requested, self._is_continue_requested = self._is_continue_requested, False
        return is_requested

    def note(self, text: str) -> None:
        """Add a note for the journal."""
        self._notes.append(text)

    def notes(self) -> tuple[str, ...]:
        """Return the notes since the last call."""
        return tuple(self._notes.popleft() for _ in range(len(self._notes)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """Answers to the single stimuli of one side so far.

    Attributes
    ----------
    presented, correct : int
        Trials that count, and those whose answer named the side.
    last : tuple of str
        The last answers, newest last, five at most.
    """

    presented: int = 0
    correct: int = 0
    last: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """A session as its operator sees it.

    Attributes
    ----------
    phase : str
        A word of `Phase`.
    done, planned : int
        Trials answered, and trials in the plan.
    block, blocks : int
        Open block (0 is practice), and how many there are.
    left_s : float
        Expected time to the end.
    noise : str
        Health of the masking noise in a few words.
    device : str
        Health of the device in a few words.
    message : str
        What the operator has to know or do now; empty if nothing.
    tallies : mapping of str to Tally
        By side.
    estimates : tuple of str
        Thresholds so far, where levels are chosen from the answers.
    """

    phase: str
    done: int
    planned: int
    block: int
    blocks: int
    left_s: float
    noise: str
    device: str
    message: str
    tallies: Mapping[str, Tally]
    estimates: tuple[str, ...] = ()
