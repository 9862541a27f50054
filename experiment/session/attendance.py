"""The participant's part of a session, as events: every wait for a person ends by a stop, too."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiment.operator.requests import StopRequested
from experiment.terms.responder import ESCAPE
from experiment.trial.events import Event, Key

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.session.setting import Setting
    from experiment.terms.responder import Press, Progress, Question, SessionPart
    from experiment.trial.events import Happening, Task


class Attendance:
    """A participant who may be called away at any moment.

    Parameters
    ----------
    setting : Setting
        Its responder, and the signal that the session is to be stopped.
    responses : tuple of str
        The answers offered; ``none`` always is with the fingers off the plate.
    """

    def __init__(self, setting: Setting, *, responses: tuple[str, ...]) -> None:
        self._responder = setting.responder
        self._stop = setting.stop
        self._responses = responses

    def greet(self, progress: Progress) -> Happening:
        """Welcome and instruct."""
        return self._unless_stopped(lambda: _continued(go_on=self._responder.begin(progress)))

    def introduce(self, part: SessionPart, progress: Progress) -> Happening:
        """Tell what a part asks for."""
        return self._unless_stopped(
            lambda: _continued(go_on=self._responder.introduce(part, progress))
        )

    def wait(self, task: Task, until_s: float) -> Happening:
        """Let the foreperiod pass."""
        return self._unless_stopped(
            lambda: self._event_of(self._responder.wait(until_s), task, onset_s=None)
        )

    def ask(self, task: Task, question: Question) -> Happening:
        """Wait for an answer."""
        return self._unless_stopped(
            lambda: self._event_of(self._responder.ask(question), task, onset_s=question.onset_s)
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
        try:
            with self._stop.interruptible():
                return wait()
        except StopRequested:
            return Event.STOP_ASKED

    def _event_of(self, press: Press | None, task: Task, *, onset_s: float | None) -> Happening:
        if press is None:
            return Event.ELAPSED
        if press.response == ESCAPE:
            return Event.PAUSE_ASKED
        control = task.trial.kind == "control"
        offered = (*self._responses, "none") if control else self._responses
        rt_s = None if onset_s is None else round(press.time_s - onset_s, 6)
        return Key(press.response if press.response in offered else "invalid", rt_s)


def _continued(*, go_on: bool) -> Event:
    return Event.CONTINUED if go_on else Event.STOP_ASKED
