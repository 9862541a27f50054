"""Who answers: what a session asks of a participant, simulated or in person."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

ESCAPE = "escape"
"""What `Press.response` says when a pause is asked for."""


class SessionPart(StrEnum):
    """A part of a session, by what a person is told before it."""

    AUDIBILITY = "audibility"  # fingers off the plate, noise on: is anything heard?
    PRACTICE = "practice"  # with feedback
    WARM_UP = "warm_up"  # a few trials after a resume, not counted
    MAIN = "main"  # the task
    CONTROL = "control"  # fingers off the plate, the task as before

    @property
    def hands_off(self) -> bool:
        """Whether the fingers are off the plate."""
        return self in {SessionPart.AUDIBILITY, SessionPart.CONTROL}

    def answers(self, responses: tuple[str, ...]) -> tuple[str, ...]:
        """Return the answers that count, of a study that offers `responses`.

        Where the fingers are off the plate nothing may be noticed, so that can always be said.

        >>> SessionPart.CONTROL.answers(("left", "right")), SessionPart.MAIN.answers(("left",))
        (('left', 'right', 'none'), ('left',))
        """
        return tuple(dict.fromkeys((*responses, "none"))) if self.hands_off else responses


@dataclass(frozen=True, slots=True)
class Press:
    """A key that was pressed.

    Attributes
    ----------
    response : str
        One of `record.ANSWERS`, `ESCAPE`, or the name of a key that means neither.
    time_s : float
        When, on the clock that the responder was given.
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
    level_left_vpp, level_right_vpp : float
        What the device set. Not for a person's eyes.
    onset_s : float
        Onset on the responder's clock.
    window_s : float
        How long after the onset an answer counts.
    answers : tuple of str
        Those that count.
    """

    trial: int
    attempt: int
    level_left_vpp: float
    level_right_vpp: float
    onset_s: float
    window_s: float
    answers: tuple[str, ...]


class ResponderError(RuntimeError):
    """A responder that failed, or that returned what is no press; in one line."""


class Responder(Protocol):
    """A participant as a session sees one."""

    @property
    def simulated(self) -> bool:
        """Whether nobody is there."""
        ...

    def begin(self, progress: Progress) -> bool:
        """Welcome and instruct, before the first trial of a sitting; ``False`` means stop."""
        ...

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Tell what the next part asks for, where the fingers lie; ``False`` means stop."""
        ...

    def cue(self, progress: Progress) -> None:
        """Show that a trial begins."""
        ...

    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass; return early with a key that was pressed in it.

        Called again for the rest of it where the key is none of an answer that counts.
        """
        ...

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for an answer; ``None`` if the time is over.

        Called again with the same question where the key is none of an answer that counts.
        """
        ...

    def feedback(self, *, correct: bool) -> None:
        """Tell whether a practice answer was right."""
        ...

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Hold a pause, or offer a break of a least length; ``False`` means stop.

        The operator ends a pause, too: see `operator.Requests`.
        """
        ...

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Thank and say good-bye; ``finished`` is false where the session was stopped early."""
        ...


RESPONDERS: Final = ("screen", "terminal", "simulated")
"""Who can answer, by name on the command line, beside installed ones of a lab's own."""
