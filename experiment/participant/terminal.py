"""A person at the keyboard of a terminal: for trying an experiment out."""

from __future__ import annotations

import os
import shutil
import sys
from typing import TYPE_CHECKING, Final, Self

from experiment.operator.keyboard import open_keyboard
from experiment.operator.requests import StopRequested
from experiment.participant.window import wrapped
from experiment.study.design import EARLIEST_ANSWER_S
from experiment.study.key_names import ARROWS, TYPED
from experiment.trial.responder import ESCAPE, Press, Responder, SessionPart

if TYPE_CHECKING:
    from device.clock import Clock
    from experiment.participant.settings import ResponderSettings
    from experiment.study.presentation import Texts
    from experiment.trial.responder import AwaitedAnswer, Progress


_KEY_NAMES: Final = {
    "return": "Enter",
    "escape": "Esc",
    **{arrow: f"{arrow} arrow" for arrow in ARROWS},
}


class NoTerminalError(ValueError):
    """There is no terminal on which a participant can read texts and press keys."""


class TerminalResponder(Responder):
    """Asks a person at a terminal; a context manager that takes over the terminal's keyboard.

    Parameters
    ----------
    settings : ResponderSettings
        What is read, what may be answered, and the keys.
    clock : Clock
        The monotonic clock by which keys are timed.

    Raises
    ------
    NoTerminalError
        If standard input is no terminal, a text cannot be encoded for it, or a key that is needed
        cannot be typed at it.
    """

    simulated = False

    def __init__(self, settings: ResponderSettings, clock: Clock) -> None:
        if not sys.stdin.isatty():
            raise NoTerminalError(
                "--responder terminal needs a terminal as standard input; use --responder "
                "simulated to try a study out without one"
            )
        _require_encodable(settings.texts, sys.stdout.encoding)
        self._meaning, self._labels = _typed_keys(settings)
        self._clock = clock
        self._answers = settings.responses
        self._session = settings
        self._fingers_on = False
        self._question: AwaitedAnswer | None = None
        self._keyboard = open_keyboard()
        self._typed: list[str] = []
        self._gone = False

    def __enter__(self) -> Self:
        self._keyboard.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        self._say("", "")
        self._keyboard.__exit__(*exception)

    def begin(self, progress: Progress) -> bool:
        """Welcome and instruct; the fingers are laid on the plate when a part needs them."""
        self._fingers_on = False
        self._forget_typed()
        instructions = self._session.texts.instructions.format(**self._labels)
        self._say("", *_broken(self._session.texts.welcome, instructions), "")
        keys = (f"{answer}: {self._labels[answer]}" for answer in self._answers)
        self._say(*_broken(", ".join(keys)), "")
        pause = self._labels["pause"]
        self._say(f"{pause} pauses a trial. On a page like this one, it ends the session.", "")
        return self._goes_on()

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        """Say where the fingers go, what the part asks for, and the keys of its answers."""
        lay = not part.hands_off and not self._fingers_on
        self._fingers_on = not part.hands_off
        texts = (getattr(self._session.texts, part), self._session.prompt(part))
        shown = [self._session.texts.placement] * lay + [
            text.format(**self._labels) for text in texts
        ]
        answers = self._session.answers(part)
        self._forget_typed()
        keys = (f"  {answer:<6} {self._labels[answer]}" for answer in answers)
        self._say("", "", *_broken(*shown), *keys, "")
        return self._goes_on()

    def cue(self, progress: Progress) -> None:
        """Show the trial's number in its part, if it counts; keys typed before are dropped."""
        self._forget_typed()
        self._answers = self._session.answers(progress.part)
        part = progress.part
        name = "trial" if part is SessionPart.MAIN else part.replace("_", "-")
        number = f" {progress.done + 1} of {progress.planned}" * (part is not SessionPart.WARM_UP)
        self._say("", f"{name}{number}  ...")

    def interval(self, number: int | None) -> None:
        """Show the number of an interval; dots between two."""
        self._say(f" {number}" if number else " ...")

    def wait(self, until_s: float) -> Press | None:
        """Let the foreperiod pass; of an answer in it, it is said that it is too early."""
        key = self._read(until_s)
        if key is None:
            return None
        response = self._word(key)
        if response in self._answers:
            self._say(" (too early)")
        return Press(response, self._key_s)

    def ask(self, question: AwaitedAnswer) -> Press | None:
        """Wait for the answer; of a key that is none it is said that it does not count."""
        if question is not self._question:
            self._question = question
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
        self._say(f" - {self._session.texts.correct if correct else self._session.texts.incorrect}")

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        """Wait for the key to continue, or for the key of a pause, which stops the session.

        Of what was typed before only the latter counts.
        """
        self._forget_typed(but="pause")
        what = "Paused" if paused else "Break"
        self._say("", f"{what}: {progress.done} of {progress.planned} trials are done.", "")
        if minimum_s > 0:
            pause = self._labels["pause"]
            self._say(f"Rest for at least {minimum_s:g} s. {pause} stops the session.", "")
            if self._await_key("pause", until_s=self._clock.now_s() + minimum_s):
                return False
        return self._goes_on()

    def end(self, progress: Progress, *, finished: bool) -> None:
        """Say nothing: the command reports how it ended."""

    def _goes_on(self) -> bool:
        """Wait for the key to continue; ``False`` if the session is to stop."""
        resume, pause = self._labels["continue"], self._labels["pause"]
        self._say(f"Press {resume} to continue, or {pause} to stop the session.", "")
        return self._await_key("continue", "pause") == "continue"

    def _await_key(self, *meanings: str, until_s: float | None = None) -> str | None:
        """Return the meaning of the next key that has one of these; None when the time is over."""
        while (key := self._read(until_s)) is not None:
            if (meaning := self._meaning.get(key)) in meanings:
                return meaning
        return None

    def _word(self, key: str) -> str:
        """Return the answer of a key, else the name of the key."""
        meaning = self._meaning.get(key, "continue")
        if meaning == "continue":
            return key if key.isprintable() else f"key {key!a}"
        return ESCAPE if meaning == "pause" else meaning

    def _forget_typed(self, but: str = "") -> None:
        """Drop the keys that were typed so far, but those of one meaning."""
        while not self._gone and self._keyboard.wait(0.0):
            self._typed += self._typed_now()
        self._typed = [key for key in self._typed if self._meaning.get(key, "-") == but]

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
        """Note that the terminal is gone; what is still written goes nowhere."""
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
            if not self._keyboard.wait(remaining_s):
                return None
        self._key_s = self._clock.now_s()  # before the rest of a control sequence is awaited
        self._typed = self._typed or self._typed_now()
        return self._typed.pop(0)

    def _typed_now(self) -> list[str]:
        try:
            return self._keyboard.read()
        except EOFError as error:
            self._lose_terminal()
            raise StopRequested from error


def _broken(*texts: str) -> list[str]:
    """Break texts into lines as long as the terminal's, between words."""
    from rich.cells import cell_len

    columns = shutil.get_terminal_size().columns
    return [line for text in texts for line in wrapped(text, lambda it: cell_len(it) <= columns)]


def _typed_keys(settings: ResponderSettings) -> tuple[dict[str, str], dict[str, str]]:
    """Return what a terminal sends for each meaning, and how its keys are named in a text.

    NoTerminalError where a meaning has no key that can be typed, or two share one.
    """
    answers = [answer for part in settings.parts for answer in settings.answers(part)]
    meanings: dict[str, str] = {}
    labels = {}
    for meaning, names in settings.keys.meanings.items():
        typed = [name for name in names if name in TYPED]
        if not typed and meaning in {*answers, "pause", "continue"}:
            raise NoTerminalError(
                f"keys.{meaning}: none of {', '.join(names)} can be typed at a terminal; add a key "
                "that can, or use --responder screen"
            )
        shown = (_KEY_NAMES.get(name, name.removeprefix("num_")) for name in typed)
        labels[meaning] = " or ".join(dict.fromkeys(shown))
        for sign in (sign for name in typed for sign in TYPED[name]):
            if meanings.setdefault(sign, meaning) != meaning:
                raise NoTerminalError(
                    f"keys.{meaning}: is the same key at a terminal as keys.{meanings[sign]}"
                )
    return meanings, labels


def _require_encodable(texts: Texts, encoding: str) -> None:
    """Refuse texts that would end the session in its midst, when they are written."""
    for name, text in texts.model_dump(by_alias=True).items():
        try:
            text.encode(encoding)
        except UnicodeEncodeError as error:
            raise NoTerminalError(
                f"texts.{name} cannot be shown on this terminal, whose encoding is {encoding}: "
                "use a terminal of UTF-8, or --responder screen"
            ) from error
