"""A person at the keyboard of a terminal: for trying an experiment out."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, Final, Self

from experiment.operator.requests import StopRequested
from experiment.operator.terminal import KEY, read_keys
from experiment.participant.wrapping import filled, wrapped
from experiment.study.design import EARLIEST_ANSWER_S
from experiment.study.presentation import TYPED, untyped_of
from experiment.trial.responder import ESCAPE, Press, SessionPart

if TYPE_CHECKING:
    from device.clock import Clock
    from experiment.participant.settings import ResponderSettings
    from experiment.study.presentation import Texts
    from experiment.trial.responder import AwaitedAnswer, Progress


_WORDS: Final = {
    "return": "Enter",
    "escape": "Esc",
    **{side: f"{side} arrow" for side in ("left", "right", "up", "down")},
}
TOO_EARLY: Final = " (too early)"
_COUNTED: Final = {
    SessionPart.AUDIBILITY: ("hands off", "hands-off trials"),
    SessionPart.PRACTICE: ("practice", "practice trials"),
    SessionPart.CONTROL: ("hands off", "hands-off trials"),
}
"""What is counted apart from the trials of the task, and several of them."""
_PLACEMENT: Final = (
    "Lay one finger of each hand on the plate, above the left and the right actuator, and keep "
    "them there."
)
"""In the place of the default, which speaks of a picture."""
_ALWAYS_SHOWN: Final = ("welcome", "instructions", "placement", "prompt")


class NoTerminalError(ValueError):
    """Nobody can press a key here, or read what has to be read."""


class TerminalResponder:
    """Asks a person at a terminal; a context manager that borrows the terminal's keyboard.

    Parameters
    ----------
    settings : ResponderSettings
        What is read, what may be answered, and the keys.
    clock : Clock
        The monotonic clock by which keys are timed.

    Raises
    ------
    NoTerminalError
        If standard input is no terminal, the system has no POSIX terminals, a text cannot be
        encoded for it, or a key that is needed cannot be typed at it.
    """

    simulated = False

    def __init__(self, settings: ResponderSettings, clock: Clock) -> None:
        if os.name != "posix" or not sys.stdin.isatty():
            raise NoTerminalError(
                "--responder terminal needs a terminal (on Linux or macOS) as standard input; "
                "use --responder simulated to try a study out without one"
            )
        _require_encodable(settings.texts, settings.parts, sys.stdout.encoding)
        self._meaning, self._labels = _typed_keys(settings)
        self._clock = clock
        self._responses = self._answers = settings.responses
        self._texts = settings.texts
        shown = self._texts.placement
        self._placement = _PLACEMENT if shown == type(self._texts)().placement else shown
        self._fingers_on = False
        self._asked: AwaitedAnswer | None = None
        self._input = sys.stdin.fileno()
        self._settings: list[Any] = []
        self._typed = ""
        self._key_s = 0.0
        self._gone = False

    def __enter__(self) -> Self:
        import termios
        import tty

        self._settings = termios.tcgetattr(self._input)
        tty.setcbreak(self._input)
        return self

    def __exit__(self, *_: object) -> None:
        import termios

        self._say("", "")
        with contextlib.suppress(termios.error):  # the terminal may be gone
            termios.tcsetattr(self._input, termios.TCSADRAIN, self._settings)

    def begin(self, progress: Progress) -> bool:
        """Welcome and instruct; the fingers are laid on the plate when a part needs them."""
        self._fingers_on = False
        self._forget_typed()
        told = (self._texts.welcome, self._with_keys(self._texts.instructions or ""))
        self._say("", *_broken(*told), "")
        pause = self._labels["pause"]
        self._say(*_broken(self._key_list()), "")
        self._say(f"In a trial {pause} pauses; in a pause, or on a page as this, it stops.", "")
        return self._goes_on()

    def _key_list(self) -> str:
        return ", ".join(f"{answer}: {self._labels[answer]}" for answer in self._responses)

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Say where the fingers go, what the part asks for, and the keys of its answers."""
        texts = self._texts
        lay = not part.hands_off and not self._fingers_on
        self._fingers_on = not part.hands_off
        told = (
            *([self._placement] if lay else []),
            self._with_keys(getattr(texts, part.value)),
            self._with_keys(texts.prompt_hands_off if part.hands_off else texts.prompt),
        )
        lines = (
            *_broken(*told),
            *(f"  {answer:<6} {self._labels[answer]}" for answer in part.answers(self._responses)),
        )
        self._forget_typed()
        self._say("", "", *lines, "")
        return self._goes_on()

    def cue(self, progress: Progress) -> None:
        """Show the trial's number in its part, if it counts; keys typed before are dropped."""
        self._forget_typed()
        self._answers = progress.part.answers(self._responses)
        one, _ = _COUNTED.get(progress.part, ("trial", ""))
        place = f"{one} {progress.done + 1} of {progress.planned}"
        self._say("", f"{'warm-up' if progress.part == SessionPart.WARM_UP else place}  ...")

    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass; of an answer in it, it is said that it is too early."""
        key = self._read(until_s)
        if key is None:
            return None
        response = self._word(key)
        if response in self._answers:
            self._say(TOO_EARLY)
        return Press(response, self._key_s)

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for the answer; of a key that is none it is said that it does not count."""
        if question is not self._asked:
            self._asked = question
            self._say(" ?")
        key = self._read(question.onset_s + question.window_s)
        if key is None:
            self._say(" no answer")
            return None
        response = self._word(key)
        counts = response in question.answers or response == ESCAPE
        self._say(f" {response}" if counts else f" ({response} is no answer here) ?")
        if response in question.answers and self._key_s - question.onset_s < EARLIEST_ANSWER_S:
            self._say(f" (too early: within {EARLIEST_ANSWER_S * 1e3:g} ms of the onset)")
        return Press(response, self._key_s)

    def feedback(self, *, correct: bool) -> None:
        """Say whether a practice answer was right."""
        self._say(f" - {self._texts.correct if correct else self._texts.wrong}")

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Wait for the key to go on, or that for a pause, which stops.

        Of what was typed before only the latter counts.
        """
        self._forget_typed(but="pause")
        what = "Paused" if paused else "Break"
        _, of = _COUNTED.get(progress.part, ("", "trials"))
        self._say("", f"{what}: {progress.done} of {progress.planned} {of} are done.", "")
        if minimum_s > 0:
            stops = f"{self._labels['pause']} stops the session"
            self._say(f"Rest for at least {minimum_s:g} s; {stops}.", "")
            rested_s = self._clock.now_s() + minimum_s
            while (key := self._read(rested_s)) is not None:
                if self._meaning.get(key) == "pause":
                    return False
        return self._goes_on()

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Say nothing: the command reports how it ended."""

    def _with_keys(self, text: str) -> str:
        return filled(text, self._labels)

    def _goes_on(self) -> bool:
        """Wait for a person to go on; ``False`` means stop."""
        go_on, pause = self._labels["go_on"], self._labels["pause"]
        self._say(f"{go_on} goes on, {pause} stops the session.", "")
        while True:
            key = self._read(None)
            meaning = None if key is None else self._meaning.get(key)
            if meaning in {"go_on", "pause"}:
                return meaning == "go_on"

    def _word(self, key: str) -> str:
        """Return the answer that a key stands for, else its name."""
        meaning = self._meaning.get(key, "go_on")
        if meaning == "go_on":
            return key if key.isprintable() else f"key {key!a}"
        return ESCAPE if meaning == "pause" else meaning

    def _forget_typed(self, but: str = "") -> None:
        """Drop the keys that were typed so far, but those of one meaning."""
        while not self._gone and select.select([self._input], [], [], 0)[0]:
            self._typed += self._typed_now()
        keys = KEY.findall(self._typed)
        self._typed = "".join(key for key in keys if self._meaning.get(key, "-") == but)

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
            self._key_s = self._clock.now_s()  # Esc is waited for, but came now
            self._typed = self._typed_now()
        else:
            self._key_s = self._clock.now_s()
        match = KEY.match(self._typed)
        assert match is not None
        self._typed = self._typed[match.end() :]
        return match[0]

    def _typed_now(self) -> str:
        try:
            typed = read_keys(self._input)
        except OSError:
            typed = b""
        if not typed:
            self._lose_terminal()
            raise StopRequested
        return typed.decode(errors="replace")


def _broken(*texts: str) -> list[str]:
    """Break texts into lines as long as the terminal's, between words."""
    from rich.cells import cell_len

    columns = shutil.get_terminal_size().columns
    return [line for text in texts for line in wrapped(text, lambda it: cell_len(it) <= columns)]


def _typed_keys(settings: ResponderSettings) -> tuple[dict[str, str], dict[str, str]]:
    """Return what a terminal sends for each meaning, and how its keys are named in a text.

    NoTerminalError where a meaning has no key that can be typed, or two share one.
    """
    answers = [answer for part in settings.parts for answer in part.answers(settings.responses)]
    if said := untyped_of(settings.keys, tuple(dict.fromkeys(answers))):
        raise NoTerminalError(f"{said}; or use --responder screen")
    meanings: dict[str, str] = {}
    labels = {}
    for meaning, names in asdict(settings.keys).items():
        typed = [name for name in names if name in TYPED]
        shown = (_WORDS.get(name, name.removeprefix("num_")) for name in typed)
        labels[meaning] = " or ".join(dict.fromkeys(shown))
        for name in typed:
            meanings |= dict.fromkeys(TYPED[name], meaning)
    return meanings, labels


def _require_encodable(texts: Texts, parts: frozenset[SessionPart], encoding: str) -> None:
    """Refuse texts that would end the session in its midst, when they are written."""
    off, practice = any(part.hands_off for part in parts), SessionPart.PRACTICE in parts
    shown = [*_ALWAYS_SHOWN, *(part.value for part in SessionPart if part in parts)]
    shown += ["prompt_hands_off"] * off + ["correct", "wrong"] * practice
    for name in shown:
        try:
            getattr(texts, name).encode(encoding)
        except UnicodeEncodeError as error:
            raise NoTerminalError(
                f"texts.{name} cannot be shown on this terminal, whose encoding is "
                f"{encoding}; got {error.object[error.start : error.end]!a} in {error.object!a}: "
                "use a terminal of UTF-8, or --responder screen"
            ) from error
