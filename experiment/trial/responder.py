"""Who answers: what a session asks of a participant, simulated or in person."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

ESCAPE = "escape"
"""`Press.response` of a request for a pause."""


class SessionPart(StrEnum):
    """A part of a session; its value is the key of [texts] that introduces it.

    Examples
    --------
    >>> [part.value for part in SessionPart if part.hands_off]
    ['hands_off_before', 'hands_off_after']
    """

    HANDS_OFF_BEFORE = "hands_off_before"
    """Hands off the plate, masking noise on: is anything heard?"""
    PRACTICE = "practice"
    """Trials with feedback."""
    WARM_UP = "warm_up"
    """A few trials after a resume, not counted."""
    MAIN = "main"
    """The task."""
    HANDS_OFF_AFTER = "hands_off_after"
    """The same task with the hands off the plate."""

    @property
    def hands_off(self) -> bool:
        """Whether the hands are off the plate."""
        return self in {SessionPart.HANDS_OFF_BEFORE, SessionPart.HANDS_OFF_AFTER}


@dataclass(frozen=True, slots=True)
class Press:
    """A key that was pressed.

    Attributes
    ----------
    response : str
        An answer of the task; ``escape``, which asks for a pause; or the name of a key that means
        neither.
    time_s : float
        When, on the clock that the responder was given, in seconds.

    Examples
    --------
    >>> Press("escape", 12.25).response
    'escape'
    """

    response: str
    time_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a session has come.

    Attributes
    ----------
    done, planned : int
        Trials of this part answered, and in the plan: practice is counted apart from the task. Of
        a warm-up they are those of the part that goes on behind it.
    part : SessionPart
        What the current trial belongs to, in a break the one before it; at the end the task.

    Examples
    --------
    >>> progress = Progress(done=31, planned=155, part=SessionPart.MAIN)
    >>> f"{progress.done / progress.planned:.0%}"
    '20%'
    """

    done: int
    planned: int
    part: SessionPart


@dataclass(frozen=True, slots=True, kw_only=True)
class AwaitedAnswer:
    """A stimulus that just went out, and how long an answer to it is awaited.

    Attributes
    ----------
    trial, attempt : int
        Which trial it is. Not for a person's eyes.
    levels_vpp : tuple of tuple of float
        Levels that the device set on the left and on the right in each observation interval, in
        peak-to-peak volts. Not for a person's eyes.
    onset_s : float
        Onset of the last burst on the responder's clock, in seconds.
    window_s : float
        How many seconds after the onset an answer counts.
    answers : tuple of str
        Those that count.

    Examples
    --------
    An answer half a second after the onset is a press at that time:

    >>> question = AwaitedAnswer(trial=3, attempt=1, levels_vpp=((130.0, 0.0),),
    ...                          onset_s=12.0, window_s=3.0, answers=("yes", "no"))
    >>> Press(question.answers[0], question.onset_s + 0.5)
    Press(response='yes', time_s=12.5)
    """

    trial: int
    attempt: int
    levels_vpp: tuple[tuple[float, ...], ...]
    onset_s: float
    window_s: float
    answers: tuple[str, ...]


class ResponderError(RuntimeError):
    """A responder that lacks a method, raises an error, or returns no valid `Press`.

    The message is one line. The session ends, and you can resume it.

    Examples
    --------
    >>> from device import VirtualClock
    >>> from experiment import first_study, run_session
    >>> try:
    ...     run_session(first_study(), "01", None, "nobody", clock=VirtualClock())
    ... except RuntimeError as error:
    ...     print(type(error).__name__, error)
    ResponderError 'nobody' must be an instance of a subclass of experiment.Responder
    """


class Responder(ABC):
    """A participant as a session sees one.

    docs/own-device.md has one in 26 lines. Whatever it raises ends the session, which can be
    resumed.

    Examples
    --------
    Somebody who always gives the first answer, half a second after the onset:

    >>> class First(Responder):
    ...     simulated = True
    ...     def __init__(self, clock): self.clock = clock
    ...     def begin(self, progress): return True
    ...     def introduce(self, part, progress): return True
    ...     def cue(self, progress): pass
    ...     def wait(self, until_s): self.clock.wait(until_s - self.clock.now_s())
    ...     def ask(self, question):
    ...         self.clock.wait(0.5)
    ...         return Press(question.answers[0], self.clock.now_s())
    ...     def feedback(self, *, correct): pass
    ...     def pause(self, progress, *, paused, minimum_s): return True
    ...     def end(self, progress, *, finished): pass
    >>> from device import VirtualClock
    >>> somebody: Responder = First(VirtualClock())
    >>> somebody.wait(2.0), somebody.clock.now_s()
    (None, 2.0)
    """

    @property
    @abstractmethod
    def simulated(self) -> bool:
        """Whether the participant is simulated."""

    @abstractmethod
    def begin(self, progress: Progress) -> bool:
        """Welcome and instruct, before the first trial of a visit.

        Parameters
        ----------
        progress : Progress
            How far the session has come, perhaps in earlier visits.

        Returns
        -------
        bool
            Whether to continue; False ends the visit.
        """

    @abstractmethod
    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Explain the task of the next part, and where the fingers lie.

        Parameters
        ----------
        part : SessionPart
            The part that begins.
        progress : Progress
            How far the session has come.

        Returns
        -------
        bool
            Whether to continue; False ends the visit.
        """

    @abstractmethod
    def cue(self, progress: Progress) -> None:
        """Show that a trial begins; what was pressed before is to be forgotten.

        Parameters
        ----------
        progress : Progress
            How far the session has come.
        """

    def interval(self, number: int | None) -> None:  # noqa: B027 (most tasks have one interval)
        """Show that an observation interval begins, in tasks with several; by default nothing.

        Parameters
        ----------
        number : int or None
            Which one, counted from 1; None when it is over, and before the next.
        """

    @abstractmethod
    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass; return early with a key that was pressed in it.

        Called again for the rest of it where the key is none of an answer that counts.

        Parameters
        ----------
        until_s : float
            When it ends, on the clock that the responder was given, in seconds.

        Returns
        -------
        Press or None
            The key; None if the time is over.
        """

    @abstractmethod
    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for an answer.

        Called again with the same question where the key is none of an answer that counts.

        Parameters
        ----------
        question : AwaitedAnswer
            The stimulus, and how long an answer to it counts.

        Returns
        -------
        Press or None
            The answer; None if the time is over.
        """

    @abstractmethod
    def feedback(self, *, correct: bool) -> None:
        """Show whether a practice answer was correct.

        Parameters
        ----------
        correct : bool
            Whether it was.
        """

    @abstractmethod
    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Hold a pause, or offer a break.

        Parameters
        ----------
        progress : Progress
            How far the session has come.
        paused : bool
            Whether it is a pause, not a planned break: somebody asked for it, keys came too early,
            or noise or bursts were not as they should be. The operator ends it, too: see
            `ResponderSettings.requests`.
        minimum_s : float
            Least length of a break, in seconds.

        Returns
        -------
        bool
            Whether to continue; False ends the visit.
        """

    @abstractmethod
    def end(self, progress: Progress, *, finished: bool) -> None:
        """Thank and say good-bye.

        Parameters
        ----------
        progress : Progress
            How far the session came.
        finished : bool
            Whether it came to its end; false where it was stopped early.
        """


RESPONDERS: Final = ("screen", "terminal", "simulated")
"""Built-in responders by name on the command line; a lab can install others."""
