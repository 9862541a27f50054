"""A person at the keyboard of a terminal: for trying an experiment out."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from typing import TYPE_CHECKING, Any, Final, Self

from experiment.operator.requests import StopRequested
from experiment.operator.terminal import KEY
from experiment.terms.responder import ESCAPE, Press, SessionPart

if TYPE_CHECKING:
    from device.clock import Clock
    from experiment.study.sections.presentation import Texts
    from experiment.terms.responder import AwaitedAnswer, Progress


_ESCAPE_KEY: Final = "\x1b"
_ANSWER_OF: Final = {
    "\x1b[D": "left",
    "\x1bOD": "left",
    "l": "left",
    "\x1b[C": "right",
    "\x1bOC": "right",
    "r": "right",
    "\x1b[B": "both",
    "\x1bOB": "both",
    "b": "both",
    " ": "none",
    "n": "none",
    _ESCAPE_KEY: ESCAPE,
}
TERMINAL_KEYS: Final = {
    "left": "left arrow or l",
    "right": "right arrow or r",
    "both": "down arrow or b",
    "none": "space or n",
}
"""What a person may press for each answer, for the explanation and for the session's header."""
_GO_ON: Final = ("\r", "\n", " ")
_HANDS_OFF: Final = (SessionPart.AUDIBILITY, SessionPart.CONTROL)


class NoTerminalError(ValueError):
    """Nobody can press a key here, or read what has to be read."""


class TerminalResponder:
    """Asks a person at a terminal; a context manager that borrows the terminal's keyboard.

    Parameters
    ----------
    clock : Clock
        The monotonic clock by which keys are timed.
    responses : tuple of str
        The answers offered.
    texts : Texts
        What is read before a part without the fingers on the plate, and after it.
    lifted : bool
        Whether there is such a part: else nothing of the texts is shown.

    Raises
    ------
    NoTerminalError
        If standard input is no terminal, the system has no POSIX terminals, or a text cannot be
        encoded for it.
    """

    simulated = False

    def __init__(
        self, clock: Clock, *, responses: tuple[str, ...], texts: Texts, lifted: bool
    ) -> None:
        if os.name != "posix" or not sys.stdin.isatty():
            raise NoTerminalError(
                "--responder terminal needs a terminal (on Linux or macOS) as standard input; "
                "use --responder simulated to try a study out without one"
            )
        if lifted:
            _require_encodable(texts, sys.stdout.encoding)
        self._clock = clock
        self._responses = responses
        self._texts = texts
        self._hands_off = False
        self._input = sys.stdin.fileno()
        self._settings: list[Any] = []
        self._typed = ""
        self._gone = False

    def __enter__(self) -> Self:
        import termios
        import tty

        self._settings = termios.tcgetattr(self._input)
        tty.setcbreak(self._input)
        self._say(
            "Lay one finger on each actuator. Answer where you felt the stimulus:",
            *_key_lines(self._responses),
            "  Esc    pause; Esc again stops the session",
            "",
        )
        return self

    def __exit__(self, *_: object) -> None:
        import termios

        self._say("", "")
        with contextlib.suppress(termios.error):  # the terminal may be gone
            termios.tcsetattr(self._input, termios.TCSADRAIN, self._settings)

    def begin(self, progress: Progress) -> bool:
        """Go on: the keys were explained when the terminal was borrowed."""
        return True

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Say when the fingers leave the plate and when they come back; else go on."""
        off = part in _HANDS_OFF
        if not off and not self._hands_off:
            return True
        self._hands_off = off
        text: str = getattr(self._texts, part.value)
        if off:
            answers = self._responses if "none" in self._responses else (*self._responses, "none")
            lines = (text, *_key_lines(answers))
        else:
            lines = ("Lay one finger on each actuator.", text)
        self._forget_typed()
        self._say("", "", *lines, "")
        return self._goes_on()

    def cue(self, progress: Progress) -> None:
        """Show the trial's number; keys typed before it are dropped."""
        self._forget_typed()
        place = f"trial {progress.done + 1} of {progress.planned}"
        self._say("", f"{'practice' if progress.practice else place}  ...")

    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass; other keys than an answer or Esc are ignored."""
        while (key := self._read(until_s)) is not None:
            if key in _ANSWER_OF:
                return Press(_ANSWER_OF[key], self._clock.now_s())
        return None

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for the answer; a key that means nothing is an invalid answer."""
        self._say(" ?")
        key = self._read(question.onset_s + question.window_s)
        time_s = self._clock.now_s()
        if key is None:
            self._say(" no answer")
            return None
        response = _ANSWER_OF.get(key, "invalid")
        self._say(f" {response}")
        return Press(response, time_s)

    def feedback(self, *, correct: bool) -> None:
        """Say whether a practice answer was right."""
        self._say(" - right" if correct else " - not so")

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Wait for Enter or the space bar to go on, or Esc to stop."""
        what = "Paused" if paused else "Break"
        self._say("", f"{what}: {progress.done} of {progress.planned} trials are done.", "")
        if minimum_s > 0:
            self._say(f"Rest for at least {minimum_s:g} s; Esc stops the session.", "")
            rested_s = self._clock.now_s() + minimum_s
            while (key := self._read(rested_s)) is not None:
                if key == _ESCAPE_KEY:
                    return False
        return self._goes_on()

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Say nothing: the command reports how it ended."""

    def _goes_on(self) -> bool:
        """Wait for a person to go on; ``False`` means stop."""
        self._say("Enter goes on, Esc stops the session.", "")
        while (key := self._read(None)) not in _GO_ON:
            if key == _ESCAPE_KEY:
                return False
        return True

    def _forget_typed(self) -> None:
        import termios

        with contextlib.suppress(termios.error):
            termios.tcflush(self._input, termios.TCIFLUSH)
        self._typed = ""

    def _say(self, *lines: str) -> None:
        """Write lines; the last stays open. A terminal that is gone ends the next wait."""
        if self._gone:
            return
        try:
            sys.stdout.write("\n".join(lines))
            sys.stdout.flush()
        except OSError:
            self._lose_terminal()

    def _lose_terminal(self) -> None:
        """Note that nobody sees the screen; what is still written goes nowhere."""
        self._gone = True
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)

    def _read(self, until_s: float | None) -> str | None:
        """Return the next key, ``None`` when the time is over; a terminal that is gone stops."""
        if self._gone:
            raise StopRequested
        if not self._typed:
            remaining_s = None if until_s is None else max(0.0, until_s - self._clock.now_s())
            ready, _, _ = select.select([self._input], [], [], remaining_s)
            if not ready:
                return None
            self._typed = self._typed_now()
        match = KEY.match(self._typed)
        assert match is not None
        self._typed = self._typed[match.end() :]
        return match[0]

    def _typed_now(self) -> str:
        try:
            typed = os.read(self._input, 64)
        except OSError:
            typed = b""
        if not typed:
            self._lose_terminal()
            raise StopRequested
        return typed.decode(errors="replace")


def _require_encodable(texts: Texts, encoding: str) -> None:
    """Refuse texts that would end the session in its midst, when they are written."""
    for part in SessionPart:
        try:
            getattr(texts, part.value).encode(encoding)
        except UnicodeEncodeError as error:
            raise NoTerminalError(
                f"texts.{part.value} cannot be shown on this terminal, whose encoding is "
                f"{encoding}; got {error.object[error.start : error.end]!a} in {error.object!a}: "
                "use a terminal of UTF-8, or --responder screen"
            ) from error


def _key_lines(responses: tuple[str, ...]) -> list[str]:
    return [f"  {response:<6} {TERMINAL_KEYS[response]}" for response in responses]
