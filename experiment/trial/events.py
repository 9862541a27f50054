"""The words of the trial: where a session stands, what can happen, what can be done."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, TypeAlias

from experiment.trial.plan import PRACTICE_BLOCK
from experiment.trial.responder import SessionPart

if TYPE_CHECKING:
    from experiment.trial.plan import Trial


class Phase(StrEnum):
    """Where a session stands."""

    READY = "ready"  # between two trials
    WELCOME = "welcome"  # a sitting begins
    INTRODUCTION = "introduction"  # a part begins: what it asks for, where the fingers lie
    FOREPERIOD = "foreperiod"  # the cue is shown, the stimulus has yet to come
    ARMING = "arming"  # the device was told of the stimulus
    FIRING = "firing"  # the device was told to emit it
    ANSWER = "answer"  # the stimulus is out, the answer is awaited
    BREAK = "break"  # between two blocks
    PAUSED = "paused"  # on the participant's or the operator's wish
    FINISHED = "finished"  # every planned trial is answered
    STOPPED = "stopped"  # before that; the session can be resumed


@dataclass(frozen=True, slots=True)
class Task:
    """A trial to be presented, for the how-many-eth time.

    Attributes
    ----------
    trial : Trial
        The trial.
    attempt : int
        Counted from 1.
    warm_up : bool
        Whether it is one of those after a resume, which do not count.
    early : int
        How many earlier attempts at it had a key too early.
    """

    trial: Trial
    attempt: int
    warm_up: bool = False
    early: int = 0

    @property
    def part(self) -> SessionPart:
        """The part of the session that it belongs to."""
        if self.warm_up:
            return SessionPart.WARM_UP
        if self.trial.kind == "control":
            return (
                SessionPart.AUDIBILITY if self.trial.block < PRACTICE_BLOCK else SessionPart.CONTROL
            )
        return SessionPart.PRACTICE if self.trial.kind == "practice" else SessionPart.MAIN


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionState:
    """A session between two events.

    Attributes
    ----------
    pending : tuple of Task
        What is still to be presented, in order; the first is the current one.
    keep_anticipated : bool
        The study's rule: an anticipated trial is kept and flagged, not presented again.
    most_anticipated : int
        After so many keys too early, in a row or at one trial, the operator is called.
    response_window_s : float
        How long an answer is awaited.
    phase : Phase
        Where the session stands.
    block : int or None
        The open block.
    anticipated : bool
        A key came too early in the current trial.
    early : int
        Trials in a row, the current one included, in which a key came too early.
    called : bool
        The operator was called, and nobody has gone on yet.
    failures : int
        Stimuli in a row that were not delivered.
    greeted : bool
        The participant was welcomed in this sitting.
    part : SessionPart or None
        The part that was introduced last in this sitting.
    noise_lost : bool
        The masking noise has to be started again before the next trial.
    unverified : bool
        A burst was not verified, and nobody has gone on yet.
    """

    pending: tuple[Task, ...]
    keep_anticipated: bool
    most_anticipated: int
    response_window_s: float
    phase: Phase = Phase.READY
    block: int | None = None
    anticipated: bool = False
    early: int = 0
    called: bool = False
    failures: int = 0
    greeted: bool = False
    part: SessionPart | None = None
    noise_lost: bool = False
    unverified: bool = False


class Event(StrEnum):
    """What can happen. A key press is a `Key`; the table knows it by one of four words."""

    SITTING_DUE = "sitting due"  # the participant was not welcomed yet
    PART_DUE = "part due"  # the next trial belongs to a part that was not introduced yet
    TRIAL_DUE = "trial due"  # the next trial belongs to the open block, or opens one
    PRACTICE_OVER = "practice over"  # no trial left before the first block, which follows at once
    BREAK_DUE = "break due"  # the open block has no trial left, a later one has
    NOTHING_LEFT = "nothing left"  # no trial at all
    ELAPSED = "elapsed"  # the foreperiod, or the time for an answer, is over
    KEY = "key"  # an answer within its time
    EARLY_KEY = "early key"  # a key before an answer was possible; the trial is void
    EARLY_KEY_AGAIN = "early key again"  # the same once too often: the operator has to come
    EARLY_KEY_KEPT = "early key kept"  # the same, where the study keeps and flags such a trial
    ARMED = "armed"  # the device holds the stimulus ready
    FIRED = "fired"  # the device confirmed that the stimulus went out
    NOT_FIRED = "not fired"  # the device confirmed that it did not
    NOT_FIRED_AGAIN = "not fired again"  # the same for the last time: it does not do its work
    FIRED_PERHAPS = "fired perhaps"  # nobody can tell whether it went out
    DEVICE_FAILED = "device failed"  # it refused, or its link is lost
    NOT_VERIFIED = "not verified"  # what was measured is another burst, or could not be measured
    NOISE_LOST = "noise lost"  # the masking noise does not play, or did not at the onset
    PAUSE_ASKED = "pause asked"  # Esc was pressed, or the operator asked for a pause
    CONTINUED = "continued"  # welcome, introduction, break or pause is over
    STOP_ASKED = "stop asked"  # the session is to be stopped now


@dataclass(frozen=True, slots=True)
class Key:
    """An answer key was pressed; `rt_s` after the onset, or before it where there is none."""

    response: str
    rt_s: float | None


Happening: TypeAlias = Event | Key


# What is to be done: the effects.


@dataclass(frozen=True, slots=True)
class Effect:
    """Something to be done; a few of them are answered by an event."""


@dataclass(frozen=True, slots=True)
class TaskEffect(Effect):
    """One that belongs to an attempt at a trial."""

    task: Task


class Greet(Effect):
    """Welcome and instruct the participant. Answered by CONTINUED or STOP_ASKED."""


@dataclass(frozen=True, slots=True)
class Introduce(Effect):
    """Tell what a part asks for. Answered by CONTINUED or STOP_ASKED."""

    part: SessionPart


class OpenBlock(TaskEffect):
    """Note that a block begins; its waveforms go to the device."""


@dataclass(frozen=True, slots=True)
class CloseBlock(Effect):
    """Note that a block is over."""

    block: int


class Cue(TaskEffect):
    """Show that a trial begins."""


class Wait(TaskEffect):
    """Let the foreperiod pass, or its rest. Answered by ELAPSED, Key, PAUSE_ASKED or STOP_ASKED."""


class ArmStimulus(TaskEffect):
    """Journal the token, then arm the device. Answered by ARMED, NOISE_LOST or DEVICE_FAILED."""


class FireStimulus(TaskEffect):
    """Emit the stimulus. Answered by FIRED, NOT_FIRED, FIRED_PERHAPS or DEVICE_FAILED."""


@dataclass(frozen=True, slots=True)
class Listen(TaskEffect):
    """Wait for the answer.

    Answered by Key, ELAPSED, NOT_VERIFIED, NOISE_LOST, PAUSE_ASKED or STOP_ASKED.
    """

    window_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EndTrial(Effect):
    """Record how the trial ended."""

    task: Task
    status: str
    response: str | None = None
    rt_s: float | None = None
    anticipated: bool = False


@dataclass(frozen=True, slots=True)
class Feedback(Effect):
    """Tell the participant whether a practice answer was right."""

    correct: bool


@dataclass(frozen=True, slots=True)
class Rest(Effect):
    """Offer a break, or hold a pause. Answered by CONTINUED or STOP_ASKED."""

    paused: bool


class OpenMonitor(Effect):
    """Have the monitor listen anew, where it can. Answered by NOT_VERIFIED if that fails."""


class StartNoise(Effect):
    """Start the masking noise again. Answered by NOISE_LOST if that fails."""


class ZeroOutputs(Effect):
    """Put the device's outputs to zero."""


@dataclass(frozen=True, slots=True)
class CloseSession(Effect):
    """Note that the session is over, and whether it is complete."""

    finished: bool


@dataclass(frozen=True, slots=True)
class Farewell(Effect):
    """Fall silent and say good-bye to the participant."""

    finished: bool
