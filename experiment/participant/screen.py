"""A person in front of a window, with a keyboard or anything else that types keys."""

from __future__ import annotations

import contextlib
import math
from itertools import chain
from typing import TYPE_CHECKING, Self

from experiment.operator.requests import StopRequested
from experiment.trial.responder import ESCAPE, Press, Responder, SessionPart

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from device.clock import Clock
    from experiment.participant.pages import Page
    from experiment.participant.settings import ResponderSettings
    from experiment.trial.responder import AwaitedAnswer, Progress


POLL_S = 0.004
"""How often keys are read; when they went down is known better than that."""
KEY_DELAY_S = 0.01
"""So long after the last moment of an answer a key of that moment is read at the latest."""
FEEDBACK_S = 0.8
END_S = 30.0
"""Longest time of the last page if no key is pressed."""
STOPPED_S = 1.5


class ScreenResponder(Responder):
    """Asks a person in front of a PsychoPy window; a context manager that owns the window.

    Keys count only while the system reports that the window has the keyboard, so that text which
    the operator types elsewhere is not an answer. A jump of the clock and a key that was not heard
    are left as notes in `requests`, for the journal.

    Parameters
    ----------
    settings : ResponderSettings
        Window, keys and texts; closing the window requests a stop.
    clock : Clock
        The monotonic clock by which keys are timed.

    Raises
    ------
    NoScreenError
        On entry, if no window can be shown; the message names the remedy.
    """

    simulated = False

    def __init__(self, settings: ResponderSettings, clock: Clock) -> None:
        self._clock = clock
        self._settings = settings
        self._requests = settings.requests
        self._keys = keys = settings.keys
        self._paused_by_key = False
        self._part = SessionPart.MAIN
        self._fingers_on = False
        answers = {key: name for name in settings.task.answer_names for key in getattr(keys, name)}
        self._meaning = answers | dict.fromkeys(keys.pause, ESCAPE)

    def __enter__(self) -> Self:
        from experiment.participant.window import Stage

        settings = self._settings
        self._stage = Stage(settings.screen)  # first: its error says what is missing
        from experiment.participant.keys import PREFIX, ButtonReader, KeyReader
        from experiment.participant.pages import Pages

        self._pages = Pages(self._stage, settings)
        has_buttons = any(key.startswith(PREFIX) for key in chain(*self._keys.meanings.values()))
        self._reader = KeyReader(
            self._clock,
            keep=self._keys.pause,
            report=self._leave_note,
            buttons=ButtonReader(self._clock) if has_buttons else None,
        )
        if not self._stage.has_font:
            self._leave_note(
                f"font {settings.screen.font} is not installed here: another one is shown"
            )
        pages = (*self._pages.prompts.values(), self._pages.ready, *self._pages.intervals)
        for page in pages:
            self._stage.show(page)  # what is drawn first is drawn slowly
        self._stage.show(())
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.close()
        self._stage.close()

    def begin(self, progress: Progress) -> bool:
        """Show welcome and instructions, which end with Enter, or the key that replaces it.

        They are shown before the first trial and after each resume. The fingers are placed later,
        when a part needs them.
        """
        self._fingers_on = False
        self._stage.take_focus()
        self._reader.drop_all()
        return self._read_through(self._pages.before_visit(), progress)

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Show where the fingers go and what the participant does in the part."""
        lay = not part.hands_off and not self._fingers_on
        self._fingers_on = not part.hands_off
        return self._read_through(self._pages.before_part(part, lay=lay), progress)

    def cue(self, progress: Progress) -> None:
        """Show the sign of a coming trial; earlier keys are dropped, but a wish for a pause."""
        self._part = progress.part
        self._reader.drop_earlier()
        self._stage.show(self._pages.ready)

    def interval(self, number: int | None) -> None:
        """Show the number of an interval; nothing between two intervals."""
        self._stage.show(self._pages.intervals[number - 1] if number else ())

    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass."""
        return self._pressed(until_s)

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for the answer; a key pressed before the onset is one, with its time."""
        self._stage.show(self._pages.prompts[self._part.hands_off])
        return self._pressed(question.onset_s + question.window_s + KEY_DELAY_S)

    def feedback(self, *, correct: bool) -> None:
        """Show whether a practice answer was right, for a moment."""
        self._stage.show(self._pages.feedback[correct])
        self._hold(FEEDBACK_S)

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Hold a pause or offer a break.

        The key to continue ends it, after the shortest time and unless the operator requested the
        pause; the operator can end it at any time. The key for a pause turns a break into a pause,
        and stops the session in a pause.
        """
        self._requests.take_continue()
        if paused and not self._paused_by_key:
            self._reader.drop_all()
        else:
            self._reader.drop_earlier()
        self._paused_by_key = False
        rested_s = self._clock.now_s() + minimum_s
        if not paused and self._show_until_continued(
            lambda left_s: self._pages.rest(progress, left_s=left_s),
            lambda: max(0, math.ceil(rested_s - self._clock.now_s())),
        ):
            return True
        return self._hold_pause(progress)

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Say good-bye until the key to continue, or for a moment after an early end."""
        self._stage.show(self._pages.end(progress, finished=finished))
        if not finished:
            self._hold(STOPPED_S)
            return
        self._reader.drop_all()
        until_s = self._clock.now_s() + END_S
        with contextlib.suppress(StopRequested):
            while (
                press := self._next_press(until_s)
            ) and press.response not in self._keys.continue_:
                pass

    def _hold_pause(self, progress: Progress) -> bool:
        """Show a pause, which only the operator can end if the operator requested it."""
        return self._show_until_continued(
            lambda by_operator: self._pages.pause(progress, may_continue=not by_operator),
            lambda: self._requests.paused,
        )

    def _show_until_continued(
        self, page: Callable[[int], Page], reason_to_wait: Callable[[], int]
    ) -> bool:
        """Show a page until the session continues; ``False`` if the key for a pause is pressed.

        As long as there is a reason to wait, only the operator can continue. `page` gets the
        reason, and is shown again when the reason changes.
        """
        shown: int | None = None
        while True:
            reason = reason_to_wait()
            if reason != shown:
                shown = reason
                self._stage.show(page(reason))
            key = self._next_key()
            if key in self._keys.pause:
                return False
            if (key in self._keys.continue_ and not reason) or self._requests.take_continue():
                self._stage.take_focus()
                return True

    def _read_through(self, pages: Sequence[Page], progress: Progress) -> bool:
        """Show pages, each until the key to continue; ``False`` if the session is to stop."""
        return all(self._read_page(page, progress) for page in pages)

    def _read_page(self, page: Page, progress: Progress) -> bool:
        self._reader.drop_earlier()
        while not self._show_until_continued(lambda _: page, lambda: False):
            if not self._hold_pause(progress):
                return False
        return True

    def _pressed(self, until_s: float) -> Press | None:
        """Return the next key's meaning, or its name; ``None`` when the time is over."""
        press = self._next_press(until_s)
        if press is None:
            return None
        meaning = self._meaning.get(press.response, f"key {press.response}")
        self._paused_by_key = meaning == ESCAPE
        return Press(meaning, press.time_s)

    def _next_key(self) -> str | None:
        """Return the next key, ``None`` after a moment without."""
        press = self._next_press(self._clock.now_s() + 5 * POLL_S)
        return None if press is None else press.response

    def _next_press(self, until_s: float) -> Press | None:
        """Return a key and when it was pressed, ``None`` when the time is over.

        A window that was closed ends the wait by `StopRequested`, as a wish to stop does.
        """
        while True:
            self._stage.poll()
            if self._stage.closed and not self._settings.stop.is_requested:
                self._settings.stop.request()
            if self._settings.stop.is_requested:
                raise StopRequested
            press = self._reader.next()
            if press is None:
                left_s = until_s - self._clock.now_s()
                if left_s <= 0:
                    return None
                self._clock.wait(min(POLL_S, left_s))
            elif self._stage.focused:
                return press
            else:
                key = press.response
                self._leave_note(f"a key ({key}) was not heard: the window had lost the keyboard")

    def _hold(self, duration_s: float) -> None:
        """Leave a screen for a moment; keys stay unread."""
        until_s = self._clock.now_s() + duration_s
        while not self._stage.closed and (left_s := until_s - self._clock.now_s()) > 0:
            self._stage.poll()
            self._clock.wait(min(5 * POLL_S, left_s))

    def _leave_note(self, text: str) -> None:
        self._requests.note(f"screen: {text}")
