"""Phases, events and effects of a session."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Literal, TypeAlias

from experiment.trial.plan import HANDS_OFF, PRACTICE, PRACTICE_BLOCK
from experiment.trial.responder import SessionPart

if TYPE_CHECKING:
    from experiment.trial.plan import Trial

Status: TypeAlias = Literal["ok", "device_error", "indeterminate", "aborted", "voided"]
"""How a trial ends: `ok`, or why it does not count."""


class Phase(StrEnum):
    """Phase of a session."""

    READY = "ready"  # between two trials
    WELCOME = "welcome"  # a visit begins
    INTRODUCTION = "introduction"  # a part begins: what it asks for, where the fingers lie
    FOREPERIOD = "foreperiod"  # the cue is shown, the stimulus has yet to come
    ARMING = "arming"  # the command to arm the stimulus was sent
    FIRING = "firing"  # the command to play it was sent
    GAP = "gap"  # the stimulus of an interval is out, another interval follows
    ANSWER = "answer"  # the stimulus is out, the answer is awaited
    BREAK = "break"  # between two blocks
    PAUSED = "paused"  # on the participant's or the operator's wish
    FINISHED = "finished"  # every planned trial is answered
    STOPPED = "stopped"  # before that; the session can be resumed


@dataclass(frozen=True, slots=True)
class Attempt:
    """One presentation of a trial.

    Attributes
    ----------
    trial : Trial
        The trial.
    number : int
        Counted from 1.
    warm_up : bool
        Whether it is one of those after a resume, which do not count.
    premature : int
        How many earlier attempts at the trial had a premature response.
    """

    trial: Trial
    number: int
    warm_up: bool = False
    premature: int = 0

    @property
    def part(self) -> SessionPart:
        """The part of the session that it belongs to."""
        if self.warm_up:
            return SessionPart.WARM_UP
        if self.trial.kind == HANDS_OFF:
            is_before = self.trial.block < PRACTICE_BLOCK
            return SessionPart.HANDS_OFF_BEFORE if is_before else SessionPart.HANDS_OFF_AFTER
        return SessionPart.PRACTICE if self.trial.kind == PRACTICE else SessionPart.MAIN


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionState:
    """A session between two events.

    Attributes
    ----------
    pending : tuple of Attempt
        What is still to be presented, in order; the first is the current one.
    accept_premature : bool
        The study's rule: a trial with a premature response counts, flagged, and is not repeated.
    max_premature : int
        The operator is called after this many premature responses in a row, or at one trial.
    response_window_s : float
        How long an answer is awaited.
    n_intervals : int
        Observation intervals of a trial.
    interval : int
        The interval of the current trial, counted from 1.
    phase : Phase
        Phase of the session.
    block : int or None
        The open block.
    premature : bool
        The current trial had a premature response.
    premature_in_a_row : int
        Trials in a row, the current one included, with a premature response.
    operator_needed : bool
        The operator was called, and the session has not continued yet.
    failures : int
        Stimuli in a row that were not delivered.
    welcomed : bool
        The participant was welcomed in this visit.
    part : SessionPart or None
        The part that was introduced last in this visit.
    noise_lost : bool
        The masking noise has to be started again before the next trial.
    burst_mismatch : bool
        A burst was not verified, and the session has not continued yet.
    """

    pending: tuple[Attempt, ...]
    accept_premature: bool
    max_premature: int
    response_window_s: float
    n_intervals: int = 1
    interval: int = 1
    phase: Phase = Phase.READY
    block: int | None = None
    premature: bool = False
    premature_in_a_row: int = 0
    operator_needed: bool = False
    failures: int = 0
    welcomed: bool = False
    part: SessionPart | None = None
    noise_lost: bool = False
    burst_mismatch: bool = False


class Event(StrEnum):
    """What can happen. An answer is a `Response`; the table knows it by one of four events."""

    VISIT_STARTS = "visit starts"  # the participant was not welcomed yet
    PART_STARTS = "part starts"  # the next trial belongs to a part that was not introduced yet
    TRIAL_STARTS = "trial starts"  # the next trial belongs to the open block, or opens one
    PRACTICE_ENDS = "practice ends"  # no trial is left before the first block, which follows
    BREAK_STARTS = "break starts"  # the open block has no trial left, a later one has
    NO_TRIAL_LEFT = "no trial left"  # every planned trial is answered
    ELAPSED = "elapsed"  # the foreperiod, or the time for an answer, is over
    RESPONSE = "response"  # an answer within its time
    PREMATURE = "premature response"  # before an answer was possible; the trial is void
    TOO_MANY_PREMATURE = "too many premature responses"  # the same: the operator has to come
    PREMATURE_ACCEPTED = "premature response accepted"  # the same, where such a trial counts
    ARMED = "armed"  # the device holds the stimulus ready
    FIRED = "fired"  # the device confirmed that the stimulus went out
    INTERVAL_FIRED = "interval fired"  # the same, and the trial has another interval
    INTERVAL_STARTS = "interval starts"  # the gap between two intervals is over
    NOT_FIRED = "not fired"  # the device confirmed that it did not
    TOO_MANY_FAILURES = "too many failures"  # the same too often: the device does not do its work
    DELIVERY_UNKNOWN = "delivery unknown"  # the stimulus may or may not have gone out
    DEVICE_FAILED = "device failed"  # it refused, or its link is lost
    BURST_MISMATCH = "burst mismatch"  # what was measured is another burst, or was not measurable
    NOISE_LOST = "noise lost"  # the masking noise does not play, or did not at the onset
    PAUSE_REQUESTED = "pause requested"  # by the participant or the operator
    CONTINUED = "continued"  # welcome, introduction, break or pause is over
    STOP_REQUESTED = "stop requested"  # the session is to be stopped now


@dataclass(frozen=True, slots=True)
class Response:
    """An answer was given; `rt_s` after the onset, or None before there is one."""

    answer: str
    rt_s: float | None


Input: TypeAlias = Event | Response


# What is to be done: the effects.


@dataclass(frozen=True, slots=True)
class Effect:
    """Something to be done; a few of them are answered by an event."""


@dataclass(frozen=True, slots=True)
class AttemptEffect(Effect):
    """One that belongs to an attempt at a trial."""

    attempt: Attempt


class Welcome(Effect):
    """Welcome and instruct the participant. Answered by CONTINUED or STOP_REQUESTED."""


@dataclass(frozen=True, slots=True)
class Introduce(Effect):
    """Introduce a part to the participant. Answered by CONTINUED or STOP_REQUESTED."""

    part: SessionPart


class OpenBlock(AttemptEffect):
    """Note that a block begins; its waveforms go to the device."""


@dataclass(frozen=True, slots=True)
class CloseBlock(Effect):
    """Note that a block is over."""

    block: int


class Cue(AttemptEffect):
    """Show that a trial begins."""


class Wait(AttemptEffect):
    """Let the foreperiod pass, or its rest.

    Answered by ELAPSED, Response, PAUSE_REQUESTED or STOP_REQUESTED.
    """


class Pass(AttemptEffect):
    """Let the gap after an interval pass, or its rest.

    Answered by INTERVAL_STARTS, Response, BURST_MISMATCH, NOISE_LOST, PAUSE_REQUESTED or
    STOP_REQUESTED.
    """


@dataclass(frozen=True, slots=True)
class CueInterval(AttemptEffect):
    """Show that the next interval begins, counted from 1."""

    interval: int


class ArmStimulus(AttemptEffect):
    """Journal the token, then arm the device. Answered by ARMED, NOISE_LOST or DEVICE_FAILED."""


class FireStimulus(AttemptEffect):
    """Emit the stimulus. Answered by FIRED, NOT_FIRED, DELIVERY_UNKNOWN or DEVICE_FAILED."""


@dataclass(frozen=True, slots=True)
class Listen(AttemptEffect):
    """Wait for the answer.

    Answered by Response, ELAPSED, BURST_MISMATCH, NOISE_LOST, PAUSE_REQUESTED or STOP_REQUESTED.
    """

    window_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EndTrial(Effect):
    """Record how the trial ended."""

    attempt: Attempt
    status: Status
    response: str | None = None
    rt_s: float | None = None
    premature: bool = False


@dataclass(frozen=True, slots=True)
class Feedback(Effect):
    """Show the participant whether a practice answer was correct."""

    correct: bool


@dataclass(frozen=True, slots=True)
class Rest(Effect):
    """Offer a break, or hold a pause. Answered by CONTINUED or STOP_REQUESTED."""

    paused: bool


class OpenMonitor(Effect):
    """Reopen the monitor, if it can be. Answered by BURST_MISMATCH if that fails."""


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
