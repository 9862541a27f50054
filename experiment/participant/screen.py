"""A person in front of a window, with a keyboard or anything else that types keys."""

from __future__ import annotations

import contextlib
import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Self

from experiment.operator.requests import StopRequested
from experiment.trial.responder import ESCAPE, Press, SessionPart

if TYPE_CHECKING:
    from collections.abc import Sequence

    from device.clock import Clock
    from experiment.participant.buttons import ButtonReader
    from experiment.participant.keys import KeyReader
    from experiment.participant.pages import Page, Pages
    from experiment.participant.settings import ResponderSettings
    from experiment.participant.window import Stage
    from experiment.trial.responder import AwaitedAnswer, Progress


POLL_S = 0.004
"""How often keys are read; when they went down is known better than that."""
KEY_DELAY_S = 0.01
"""So long after the last moment of an answer a key of that moment is read at the latest."""
FEEDBACK_S = 0.8
END_S = 30.0
"""How long the last screen stands where nobody goes on."""
STOPPED_S = 1.5


class ScreenResponder:
    """Asks a person in front of a PsychoPy window; a context manager that owns the window.

    Keys count only while the window has the keyboard, as far as the system tells: what an operator
    types elsewhere is no answer. A jump of the clock and an unheard key are left as notes in
    `requests`, for the journal.

    Parameters
    ----------
    settings : ResponderSettings
        Window, keys and texts; a stop is asked for when the window is closed.
    clock : Clock
        The monotonic clock by which keys are timed.

    Raises
    ------
    NoScreenError
        On entry, if nothing can be shown here; the message says what to install or use instead.
    """

    simulated = False

    def __init__(self, settings: ResponderSettings, clock: Clock) -> None:
        self._clock = clock
        self._settings = settings
        self._keys = keys = settings.keys
        self._requests = settings.requests
        self._stop = settings.stop
        self._paused_by_key = False
        self._part = SessionPart.MAIN
        self._fingers_on = False
        answers = {
            key: name for name in ("left", "right", "both", "none") for key in getattr(keys, name)
        }
        self._meaning = answers | dict.fromkeys(keys.pause, ESCAPE)

    _stage: Stage
    _pages: Pages
    _reader: KeyReader

    def __enter__(self) -> Self:
        from experiment.participant.window import Stage

        settings = self._settings
        self._stage = Stage(settings.screen)  # first: it tells what is missing
        from experiment.participant.keys import KeyReader
        from experiment.participant.pages import Pages

        self._pages = Pages(
            self._stage,
            screen=settings.screen,
            keys=settings.keys,
            texts=settings.texts,
            responses=settings.responses,
        )
        self._reader = KeyReader(
            self._clock, keep=self._keys.pause, tell=self._tell, buttons=self._buttons()
        )
        if not self._stage.has_font:
            self._tell(f"font {settings.screen.font} is not installed here: another one is shown")
        prompts = [self._pages.prompt(part) for part in SessionPart]
        for page in (*prompts, self._pages.ready):
            self._stage.show(page)  # what is drawn first is drawn slowly
        self._stage.show(())
        return self

    def _buttons(self) -> ButtonReader | None:
        """Listen to controllers where any button means anything."""
        from experiment.participant.buttons import PREFIX, ButtonReader

        named = (key for keys in asdict(self._keys).values() for key in keys)
        if not any(key.startswith(PREFIX) for key in named):
            return None
        return ButtonReader(self._clock)

    def __exit__(self, *_: object) -> None:
        self._reader.close()
        self._stage.close()

    def begin(self, progress: Progress) -> bool:
        """Show welcome and instructions; the fingers are laid on the plate when a part needs them.

        Enter, or what stands for it, is needed here before the first trial and after each resume.
        """
        self._fingers_on = False
        self._stage.take_focus()
        self._reader.drop_all()
        return self._read_through(self._pages.before_sitting(), progress)

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Tell where the fingers go and what the part asks for."""
        lay = not part.hands_off and not self._fingers_on
        self._fingers_on = not part.hands_off
        return self._read_through(self._pages.before_part(part, lay=lay), progress)

    def cue(self, progress: Progress) -> None:
        """Show the sign of a coming trial; earlier keys are dropped, but a wish for a pause."""
        self._part = progress.part
        self._reader.drop_earlier()
        self._stage.show(self._pages.ready)

    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass."""
        return self._pressed(until_s)

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for the answer; a key pressed before the onset is one, with its time."""
        self._stage.show(self._pages.prompt(self._part))
        return self._pressed(question.onset_s + question.window_s + KEY_DELAY_S)

    def feedback(self, *, correct: bool) -> None:
        """Show whether a practice answer was right, for a moment."""
        self._stage.show(self._pages.feedback(correct=correct))
        self._linger(FEEDBACK_S)

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Hold a pause or offer a break.

        The key to go on ends it, after the least time and unless the operator asked for the pause;
        the operator ends it at any time. The key for a pause makes a pause of a break, and stops
        the session in a pause.
        """
        self._requests.take_go_on()
        if paused and not self._paused_by_key:
            self._reader.drop_all()
        else:
            self._reader.drop_earlier()
        self._paused_by_key = False
        if not paused and self._rest(progress, self._clock.now_s() + minimum_s):
            return True
        return self._hold_pause(progress)

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Say good-bye until the key to go on, or for a moment after an early end."""
        self._stage.show(self._pages.end(progress, finished=finished))
        if not finished:
            self._linger(STOPPED_S)
            return
        self._reader.drop_all()
        until_s = self._clock.now_s() + END_S
        with contextlib.suppress(StopRequested):
            while (stroke := self._stroke(until_s)) and stroke[0] not in self._keys.go_on:
                pass

    def _rest(self, progress: Progress, rested_s: float) -> bool:
        """Show a break and what is left of its least time; ``False`` if a pause is wanted."""
        shown = -1
        while True:
            left_s = max(0, math.ceil(rested_s - self._clock.now_s()))
            if left_s != shown:
                shown = left_s
                self._stage.show(self._pages.rest(progress, left_s=left_s))
            key = self._next_key()
            if key in self._keys.pause:
                return False
            if (key in self._keys.go_on and not left_s) or self._requests.take_go_on():
                self._stage.take_focus()
                return True

    def _hold_pause(self, progress: Progress) -> bool:
        asked = None
        while True:
            if asked is not self._requests.paused:
                asked = self._requests.paused
                self._stage.show(self._pages.pause(progress, go_on=not asked))
            key = self._next_key()
            if key in self._keys.pause:
                return False
            if (key in self._keys.go_on and not asked) or self._requests.take_go_on():
                self._stage.take_focus()
                return True

    def _read_through(self, pages: Sequence[Page], progress: Progress) -> bool:
        """Show pages, each until the key to go on; ``False`` if the session is to be stopped."""
        return all(self._read_page(page, progress) for page in pages)

    def _read_page(self, page: Page, progress: Progress) -> bool:
        self._reader.drop_earlier()
        self._stage.show(page)
        while True:
            key = self._next_key()
            if key in self._keys.go_on or self._requests.take_go_on():
                return True
            if key in self._keys.pause:
                if not self._hold_pause(progress):
                    return False
                self._stage.show(page)

    def _pressed(self, until_s: float) -> Press | None:
        """Return the next key's meaning, or its name; ``None`` when the time is over."""
        stroke = self._stroke(until_s)
        if stroke is None:
            return None
        meaning = self._meaning.get(stroke[0], f"key {stroke[0]}")
        self._paused_by_key = meaning == ESCAPE
        return Press(meaning, stroke[1])

    def _next_key(self) -> str | None:
        """Return the next key, ``None`` after a moment without."""
        stroke = self._stroke(self._clock.now_s() + 5 * POLL_S)
        return None if stroke is None else stroke[0]

    def _stroke(self, until_s: float) -> tuple[str, float] | None:
        """Return a key and when it was pressed, ``None`` when the time is over.

        A window that was closed ends the wait by `StopRequested`, as a wish to stop does.
        """
        while True:
            self._heed_stop()
            stroke = self._reader.next()
            if stroke is None:
                left_s = until_s - self._clock.now_s()
                if left_s <= 0:
                    return None
                self._clock.wait(min(POLL_S, left_s))
            elif self._stage.focused:
                return stroke.key, stroke.time_s
            else:
                self._tell(f"a key ({stroke.key}) was not heard: the window had lost the keyboard")

    def _heed_stop(self) -> None:
        self._stage.poll()
        if self._stage.closed and not self._stop.asked:
            self._stop.ask()
        if self._stop.asked:
            raise StopRequested

    def _linger(self, duration_s: float) -> None:
        """Leave a screen for a moment; keys stay unread."""
        until_s = self._clock.now_s() + duration_s
        while not self._stage.closed and (left_s := until_s - self._clock.now_s()) > 0:
            self._stage.poll()
            self._clock.wait(min(5 * POLL_S, left_s))

    def _tell(self, what: str) -> None:
        self._requests.note(f"screen: {what}")
