"""The participant of a session: listened to, called away by a stop, and failing by one error."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, TypeVar

from device.errors import DeviceError
from device.installed import require_whole
from experiment.operator.requests import StopRequested
from experiment.trial.events import Event, Key
from experiment.trial.responder import ESCAPE, AwaitedAnswer, Press, Responder, ResponderError

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.session.setting import Setting
    from experiment.trial.events import Happening, Task
    from experiment.trial.responder import Progress, SessionPart


_Given = TypeVar("_Given")


def require_responder(responder: Responder) -> None:
    """Refuse what lacks a part of a responder; whether anybody is there, every row keeps."""
    try:
        require_whole(responder, Responder)
    except ValueError as error:
        raise ResponderError(str(error)) from error


class Attendance:
    """A participant who may be called away at any moment; `responses` are the answers offered.

    Only a key of an answer that counts in the trial's part is one: any other was a slip, or there
    was nothing to be said with it, and would otherwise be counted as a miss. It is left as a note,
    and `ignored` says it to the operator until the next trial.
    """

    def __init__(self, setting: Setting, *, responses: tuple[str, ...]) -> None:
        self._responder = setting.responder
        self._stop = setting.stop
        self._requests = setting.requests
        self._clock = setting.clock
        self._responses = responses
        self._cued_s = -math.inf
        self.ignored = ""

    def greet(self, progress: Progress) -> Happening:
        """Welcome and instruct."""
        return self._unless_stopped(lambda: _continued(go_on=self._responder.begin(progress)))

    def introduce(self, part: SessionPart, progress: Progress) -> Happening:
        """Tell what a part asks for."""
        return self._unless_stopped(
            lambda: _continued(go_on=self._responder.introduce(part, progress))
        )

    def cue(self, progress: Progress) -> None:
        """Announce a trial."""
        self._guarded(lambda: self._responder.cue(progress))
        self._cued_s = self._clock.now_s()

    def feedback(self, *, correct: bool) -> None:
        """Tell whether an answer was right."""
        self._guarded(lambda: self._responder.feedback(correct=correct))

    def wait(self, task: Task, until_s: float) -> Happening:
        """Let the foreperiod pass."""
        self.ignored = ""

        def waited() -> Happening:
            heard = self._heard(
                lambda: self._responder.wait(until_s), task, onset_s=None, until_s=until_s
            )
            left_s = until_s - self._clock.now_s()
            if heard is Event.ELAPSED and left_s > 0:  # a responder that did not wait
                self._clock.wait(left_s)
            return heard

        return self._unless_stopped(waited)

    def ask(self, task: Task, question: AwaitedAnswer) -> Happening:
        """Wait for an answer."""
        until_s = question.onset_s + question.window_s
        return self._unless_stopped(
            lambda: self._heard(
                lambda: self._responder.ask(question),
                task,
                onset_s=question.onset_s,
                until_s=until_s,
            )
        )

    def rest(self, progress: Progress, *, paused: bool, minimum_s: float) -> Happening:
        """Hold a pause, or offer a break."""
        return self._unless_stopped(
            lambda: _continued(
                go_on=self._responder.pause(progress, paused=paused, minimum_s=minimum_s)
            )
        )

    def leave(self, progress: Progress, *, finished: bool) -> Happening:
        """Say good-bye; a stop from outside leaves no time for it."""

        def end() -> Happening:
            self._responder.end(progress, finished=finished)
            return Event.CONTINUED

        return self._unless_stopped(end)

    def _unless_stopped(self, wait: Callable[[], Happening]) -> Happening:
        def interruptible() -> Happening:
            with self._stop.interruptible():
                return wait()

        try:
            return self._guarded(interruptible)
        except StopRequested:
            return Event.STOP_ASKED

    def _guarded(self, call: Callable[[], _Given]) -> _Given:
        """Let whatever a responder raises, an exit of the program too, end the session alike."""
        try:
            return call()
        except (DeviceError, ResponderError, StopRequested):
            raise
        except (Exception, SystemExit) as error:
            said = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise ResponderError(f"{type(self._responder).__name__} failed: {said}") from error

    def answers(self, task: Task) -> tuple[str, ...]:
        """Return the answers that count in a trial."""
        return task.part.answers(self._responses)

    def _heard(
        self,
        listen: Callable[[], Press | None],
        task: Task,
        *,
        onset_s: float | None,
        until_s: float,
    ) -> Happening:
        while (press := listen()) is not None:
            self._require_press(press)
            if press.response == ESCAPE:
                return Event.PAUSE_ASKED
            if press.response in self.answers(task):
                self._require_present(press)
                rt_s = None if onset_s is None else round(press.time_s - onset_s, 6)
                return Key(press.response, rt_s)
            self._ignore(press.response, task)
            # One that gives the same again and again, without waiting, is asked until the time is
            # over, which passes on any clock.
            self._clock.wait(_AGAIN_S)
            if self._clock.now_s() >= until_s:
                break
        return Event.ELAPSED

    def _require_press(self, press: object) -> None:
        """Refuse what a responder of a lab's own may return by mistake."""
        response: object = getattr(press, "response", None)
        time_s: object = getattr(press, "time_s", None)
        sound = isinstance(press, Press) and isinstance(response, str)
        if not (sound and isinstance(time_s, int | float) and math.isfinite(time_s)):
            raise ResponderError(
                f"{type(self._responder).__name__} must return a Press with a word and a finite "
                f"time, or None; got {press!r}"
            )

    def _require_present(self, press: Press) -> None:
        """Refuse an answer that is yet to come, or of long ago: reaction times would be off."""
        early_s = self._cued_s - press.time_s
        if early_s > LONGEST_BEFORE_S:
            raise ResponderError(
                f"{type(self._responder).__name__} returned a Press of {early_s:.3g} s before its "
                "trial: time_s must be a reading of the clock that the responder was given, and "
                "cue() has to drop what was pressed before"
            )
        ahead_s = press.time_s - self._clock.now_s()
        if ahead_s > LARGEST_LEAD_S:
            raise ResponderError(
                f"{type(self._responder).__name__} returned a Press that is {ahead_s:.3g} s in the "
                "future: time_s must be a reading of the clock that the responder was given"
            )

    def _ignore(self, key: str, task: Task) -> None:
        known = self.ignored
        self.ignored = f"trial {task.trial.number}: {key} was pressed, which is no answer here"
        if self.ignored != known:  # a key that is held, or hit again and again, is told once
            self._requests.note(self.ignored)


LARGEST_LEAD_S: Final = 0.01
"""By so much a button box whose clock is kept against the session's may be ahead."""
LONGEST_BEFORE_S: Final = 5.0
"""A press that waited for longer than this before its trial is no impatience, but another clock."""
_AGAIN_S: Final = 1e-3
"""So long after a key that is none of an answer the next one is waited for."""


def _continued(*, go_on: bool) -> Event:
    return Event.CONTINUED if go_on else Event.STOP_ASKED
