"""The responder of a session, guarded: interrupted by a stop, and failing by one error."""

from __future__ import annotations

import contextlib
import math
from typing import TYPE_CHECKING, Final, Literal, ParamSpec

from device.errors import DeviceError
from device.installed import require_instance
from experiment.operator.requests import StopRequested
from experiment.trial.events import Event, Response
from experiment.trial.responder import ESCAPE, AwaitedAnswer, Press, Responder, ResponderError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from experiment.session.config import SessionConfig
    from experiment.trial.events import Attempt, Input
    from experiment.trial.plan import Plan
    from experiment.trial.responder import Progress


_P = ParamSpec("_P")


def require_responder(responder: Responder) -> None:
    """Refuse what is no `Responder`; whether anybody is there, every row keeps."""
    try:
        require_instance(responder, Responder)
    except ValueError as error:
        raise ResponderError(str(error)) from error


class GuardedResponder:
    """A responder that a stop may interrupt.

    Only a key of an answer that counts in the trial's part is one: any other was a slip, or there
    was nothing to be said with it, and would otherwise be counted as a miss. It is left as a note,
    and `ignored` says it to the operator until the next trial.
    """

    def __init__(self, config: SessionConfig, plan: Plan) -> None:
        self._plan = plan
        self._responder = config.responder
        self._config = config
        self._clock = config.clock
        self._cued_s = -math.inf
        self.ignored = ""

    def attend(
        self, step: Callable[_P, object], *args: _P.args, **kwargs: _P.kwargs
    ) -> Literal[Event.CONTINUED, Event.STOP_REQUESTED]:
        """Let the participant read or rest, until they, or a stop from outside, end it."""
        try:
            with self._guarded(), self._config.stop.interruptible():
                return Event.CONTINUED if step(*args, **kwargs) else Event.STOP_REQUESTED
        except StopRequested:
            return Event.STOP_REQUESTED

    def cue(self, progress: Progress) -> None:
        """Announce a trial."""
        with self._guarded():
            self._responder.cue(progress)
        self._cued_s = self._clock.now_s()

    def interval(self, number: int | None) -> None:
        """Show that an interval begins, or that it is over."""
        with self._guarded():
            self._responder.interval(number)

    def feedback(self, *, correct: bool) -> None:
        """Show whether an answer was correct."""
        with self._guarded():
            self._responder.feedback(correct=correct)

    def wait(self, attempt: Attempt, until_s: float) -> Input:
        """Let the foreperiod pass, also with a responder that does not wait."""
        self.ignored = ""

        def listen() -> Press | None:
            press = self._responder.wait(until_s)
            if press is None:
                self._clock.wait(max(0.0, until_s - self._clock.now_s()))
            return press

        return self._next_input(listen, attempt, onset_s=None, until_s=until_s)

    def ask(self, attempt: Attempt, question: AwaitedAnswer) -> Input:
        """Wait for an answer."""
        until_s = question.onset_s + question.window_s
        return self._next_input(
            lambda: self._responder.ask(question),
            attempt,
            onset_s=question.onset_s,
            until_s=until_s,
        )

    @contextlib.contextmanager
    def _guarded(self) -> Iterator[None]:
        """Let whatever a responder raises, an exit of the program too, end the session alike."""
        try:
            yield
        except (DeviceError, ResponderError, StopRequested):
            raise
        except (Exception, SystemExit) as error:
            message = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise ResponderError(f"{type(self._responder).__name__} failed: {message}") from error

    def _next_input(
        self,
        listen: Callable[[], Press | None],
        attempt: Attempt,
        *,
        onset_s: float | None,
        until_s: float,
    ) -> Input:
        try:
            with self._guarded(), self._config.stop.interruptible():
                while (press := listen()) is not None:
                    self._require_press(press)
                    if press.response == ESCAPE:
                        return Event.PAUSE_REQUESTED
                    if press.response in self._plan.answers_to(attempt.trial):
                        self._require_present(press)
                        rt_s = None if onset_s is None else round(press.time_s - onset_s, 6)
                        return Response(press.response, rt_s)
                    ignored = f"trial {attempt.trial.number}: {press.response} was pressed"
                    ignored += ", which is no answer here"
                    if ignored != self.ignored:  # of a key that is held one note is enough
                        self._config.requests.note(ignored)
                    self.ignored = ignored
                    # One that gives the same again and again, without waiting, is asked until the
                    # time is over, which passes on any clock.
                    self._clock.wait(_AGAIN_S)
                    if self._clock.now_s() >= until_s:
                        break
                return Event.ELAPSED
        except StopRequested:
            return Event.STOP_REQUESTED

    def _require_press(self, press: object) -> None:
        """Refuse what a responder of a lab's own may return by mistake."""
        match press:
            case Press(str(), int() | float() as time_s) if math.isfinite(time_s):
                return
        raise ResponderError(
            f"{type(self._responder).__name__} must return a Press with a word and a finite time, "
            f"or None; got {press!r}"
        )

    def _require_present(self, press: Press) -> None:
        """Refuse an answer that is yet to come, or of long ago: reaction times would be off."""
        now_s = self._clock.now_s()
        if not self._cued_s - LONGEST_BEFORE_S <= press.time_s <= now_s + LARGEST_LEAD_S:
            raise ResponderError(
                f"{type(self._responder).__name__} returned a Press that is "
                f"{press.time_s - now_s:.3g} s from now: time_s must be a reading of the clock "
                "that the responder was given, and cue() has to drop what was pressed before"
            )


LARGEST_LEAD_S: Final = 0.01
"""By so much a button box whose clock is kept against the session's may be ahead."""
LONGEST_BEFORE_S: Final = 5.0
"""A press that waited for longer than this before its trial is no impatience, but another clock."""
_AGAIN_S: Final = 1e-3
"""So long after a key that is none of an answer the next one is waited for."""
