"""The sections [screen], [keys] and [texts]: the participant's window, keys and texts."""

from __future__ import annotations

import string
import unicodedata
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import AfterValidator, ConfigDict, Field

from experiment.names import is_line
from experiment.study.base import Line, Section, obey, refusal
from experiment.study.key_names import KEY_NAMES

if TYPE_CHECKING:
    from experiment.study.design import Design
    from experiment.tasks.task import Task


class Screen(Section):
    """The participant's window, for `run --responder screen`."""

    full_screen: bool = True
    """whether the window fills the screen"""
    index: Annotated[int, Field(ge=0, le=15)] = 0
    """number of the screen, counted from 0"""
    width_px: Annotated[int, Field(ge=320, le=16384)] = 1280
    """width of a window"""
    height_px: Annotated[int, Field(ge=240, le=16384)] = 720
    """height of a window"""
    text_height: Annotated[float, Field(ge=0.01, le=0.2)] = 0.035
    """height of a line as a fraction of the window's height"""
    right_to_left: bool = False
    """whether texts are in Arabic, Hebrew or another script from right to left"""
    font: Line = "DejaVu Sans"
    """name of the font"""


def _key_names(names: tuple[str, ...]) -> tuple[str, ...]:
    rule = "must be the name of a key, such as a, 1, left, space, return, num_4, button_0"
    obey((name not in KEY_NAMES, f"[{i}]", rule, name) for i, name in enumerate(names))
    return names


KeyList = Annotated[tuple[str, ...], Field(min_length=1), AfterValidator(_key_names)]


class Keys(Section):
    """The keys of each answer, by PsychoPy's names: a-z, 0-9, left, space, return, num_4, f1, ...

    button_0 to button_31 are those of a game controller; a pedal types keys. An answer can have
    several keys; no key has two meanings.
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, KeyList] = Field(init=False)

    pause: KeyList = ("escape",)
    """pause a trial; in a pause, end the session"""
    continue_: KeyList = Field(default=("return",), alias="continue")
    """continue to the next page"""

    @property
    def meanings(self) -> dict[str, tuple[str, ...]]:
        """The keys of each answer, of pause and of continue."""
        return self.__pydantic_extra__ | {"pause": self.pause, "continue": self.continue_}

    def with_answers(self, task: Task) -> Keys:
        """Return the keys with the task's defaults for answers without keys, checked."""
        answers = ", ".join(task.answer_names)
        rule = f"unknown key; must be pause, continue or an answer: {answers}"
        extra = {
            name: keys
            for name, keys in self.__pydantic_extra__.items()
            if name in self.model_fields_set
        }
        obey((answer not in task.answer_names, answer, rule, None) for answer in extra)
        complete = self.model_copy()
        object.__setattr__(complete, "__pydantic_extra__", task.keys | extra)
        meanings: dict[str, str] = {}
        for meaning, names in complete.meanings.items():
            for name in _key_names(names):
                rule = f"must not share a key with {meanings.get(name)}"
                obey([(name in meanings, meaning, rule, name)])
                meanings[name] = meaning
        return complete


_HANDS_OFF: Final = ("hands_off_before", "hands_off_after", "prompt_hands_off")
"""Texts for trials with the hands off the plate, where nothing can always be answered."""
_ANSWER_TEXTS: Final = ("instructions", "practice", "warm_up", "main", "prompt", *_HANDS_OFF)
"""Texts that may contain the keys of the answers."""
_PLACEHOLDERS: Final = {
    "continue": ("continue",),
    "paused": ("done", "planned"),
    "rest": ("done", "planned", "seconds"),
    "rest_over": ("done", "planned"),
}
"""What may be filled into other texts."""


def _readable(text: str) -> str:
    has_control = any(unicodedata.category(c) == "Cc" and c != "\n" for c in text)
    obey([(has_control, "", "must have no control characters", text)])
    obey([(not any(map(is_line, text.split("\n"))), "", "must not be blank", text)])
    return text


_Text = Annotated[str, AfterValidator(_readable)]


class Texts(Section):
    """What the participant reads, in any language.

    {done}, {planned} and {seconds} are replaced by numbers. In texts about answers, the name of an
    answer in braces is replaced by its keys, and {continue} by the key that continues.
    """

    welcome: _Text = "Welcome, and thank you for taking part."
    """first page"""
    instructions: _Text = ""
    """instructions; by default those of the task"""
    placement: _Text = ""
    """text above the picture of the fingers; by default that of the task"""
    hands_off_before: _Text = ""
    """before the trials with the hands off the plate at the beginning; by default the task's"""
    practice: _Text = "First, a few practice trials. You will see whether each answer is correct."
    """before practice"""
    warm_up: _Text = "Here are a few trials to get used to the task again. They do not count."
    """after an interruption"""
    main: _Text = "Now the experiment begins."
    """before the first block"""
    hands_off_after: _Text = ""
    """before the trials with the hands off the plate at the end; by default the task's"""
    ready: _Text = "+"
    """until the stimulus"""
    prompt: _Text = ""
    """question; by default the task's"""
    prompt_hands_off: _Text = ""
    """question with the hands off the plate; by default the task's"""
    correct: _Text = "Correct"
    """after a correct practice answer"""
    incorrect: _Text = "Incorrect"
    """after an incorrect practice answer"""
    paused: _Text = "Paused: {done} of {planned} trials are done."
    """in a pause"""
    called: _Text = "Please call the experimenter."
    """in a pause that only the experimenter can end"""
    rest: _Text = (
        "Have a break: {done} of {planned} trials are done. You can continue in {seconds} s."
    )
    """in a break"""
    rest_over: _Text = "Have a break: {done} of {planned} trials are done."
    """in a break that may be ended"""
    continue_: _Text = Field(default="Press {continue} to continue.", alias="continue")
    """below pages that wait for this key"""
    finished: _Text = "You have finished. Thank you very much!"
    """at the end"""
    stopped: _Text = "The session was stopped. Thank you."
    """at an earlier end"""

    def with_task(self, task: Task, design: Design) -> Texts:
        """Return the texts with the task's defaults for those that are omitted, checked."""
        offered = frozenset(design.responses) & frozenset(task.optional_answers)
        defaults = {**task.texts, "instructions": task.instructions[offered]}
        missing = {
            name: text for name, text in defaults.items() if name not in self.model_fields_set
        }
        complete = self.completed(**missing)
        for name, text in complete.model_dump(by_alias=True).items():
            allowed = _PLACEHOLDERS.get(name, ())
            if name in _ANSWER_TEXTS:
                allowed = task.offered(design.responses, hands_off=name in _HANDS_OFF)
            listed = ", ".join(f"{{{placeholder}}}" for placeholder in allowed)
            rule = f"must have no placeholders but {listed or 'none'}; write other braces twice"
            try:
                placeholders = list(string.Formatter().parse(text))
            except ValueError as error:
                raise refusal(name, rule, text) from error
            for _, placeholder, specification, conversion in placeholders:
                is_plain = not specification and not conversion
                is_allowed = placeholder is None or (placeholder in allowed and is_plain)
                obey([(not is_allowed, name, rule, f"{{{placeholder}}}")])
        return complete
