"""The sections [screen], [keys] and [texts]: what stands before a participant, in any language."""

from __future__ import annotations

import string
import unicodedata
from dataclasses import asdict
from typing import Final

from pydantic import Field

from experiment.study.sections.table import section
from experiment.terms.checks import is_line

_NAMED: Final = (
    "apostrophe backslash backspace bracketleft bracketright comma delete down end equal escape "
    "grave home insert lalt lcommand lctrl left less loption lshift lwindows menu minus "
    "num_add num_decimal num_divide num_enter num_equal num_multiply num_subtract pagedown pageup "
    "pause period pound quoteleft ralt rcommand rctrl return right roption rshift rwindows "
    "semicolon slash space tab up"
)
KEY_NAMES: Final = frozenset(
    (
        *string.ascii_lowercase,
        *string.digits,
        *_NAMED.split(),
        *(f"num_{digit}" for digit in string.digits),
        *(f"f{number}" for number in range(1, 20)),
    )
)
"""The names that PsychoPy 2026.2's keyboard has for keys on Linux, macOS and Windows, locks left
out."""

_PLACEHOLDERS: Final = {
    "paused": ("done", "planned"),
    "rest": ("done", "planned", "seconds"),
    "rest_over": ("done", "planned"),
}
"""What is filled in, by text; the others are shown as they are."""


@section
class Screen:
    """The participant's window, for `run --responder screen`."""

    full_screen: bool = True
    index: int = Field(default=0, ge=0, le=15, description="which screen, counted from 0")
    width_px: int = Field(default=1280, ge=320, le=16384, description="of a window")
    height_px: int = Field(default=720, ge=240, le=16384)
    text_height: float = Field(
        default=0.035, ge=0.01, le=0.2, description="of a line, part of the window's"
    )
    right_to_left: bool = Field(default=False, description="for Arabic, Hebrew, ...")
    font: str = "DejaVu Sans"

    def __post_init__(self) -> None:
        if not is_line(self.font):
            raise ValueError(f"font must be a name in one line of text; got {self.font!r}")


@section
class Keys:
    """The keys of each answer and wish, by PsychoPy's names.

    They are a-z, 0-9, left, space, return, num_4, f1 and such; a pedal types keys. Several keys may
    mean the same, no key two things.
    """

    left: tuple[str, ...] = Field(default=("left",), strict=False)
    right: tuple[str, ...] = Field(default=("right",), strict=False)
    both: tuple[str, ...] = Field(default=("down",), strict=False)
    none: tuple[str, ...] = Field(
        default=("space",), strict=False, description="where the answer none is offered"
    )
    pause: tuple[str, ...] = Field(
        default=("escape",), strict=False, description="pressed again in the pause: stop"
    )
    go_on: tuple[str, ...] = Field(
        default=("return",), strict=False, description="to the next screen"
    )

    def __post_init__(self) -> None:
        meanings: dict[str, str] = {}
        for meaning, keys in asdict(self).items():
            if not keys:
                raise ValueError(f"{meaning} must have at least one key; got none")
            for place, key in enumerate(keys):
                if key not in KEY_NAMES:
                    raise ValueError(
                        f"{meaning}[{place}] must be a key's name: a-z, 0-9, or one such as left, "
                        f"space, return, f1, num_4; got {key!r}"
                    )
                if key in meanings:
                    raise ValueError(
                        f"{meaning} must have keys without another meaning; got {key}, "
                        f"which means {meanings[key]}"
                    )
                meanings[key] = meaning


@section
class Texts:
    """What the participant reads, in any language.

    {done}, {planned} and, in rest, {seconds} are filled in where the defaults have them.
    """

    welcome: str = "Welcome, and thank you for taking part."
    instructions: str = Field(
        default=(
            "You will feel a short vibration under your left finger, your right finger, or both. "
            "Then say where you felt it. If you are not sure, answer what seems most likely."
        ),
    )
    placement: str = Field(
        default="Lay one finger of each hand on the plate as shown, and keep them there.",
        description="above the picture of the fingers",
    )
    audibility: str = Field(
        default=(
            "First without touching: take both hands off the plate. If you hear the plate through "
            "the noise, press the key of the side; if you hear nothing, press the key for nothing."
        ),
        description="before each part of a session",
    )
    practice: str = "Now a few trials for practice. You are told whether you were right."
    warm_up: str = "A few trials to get used to it again. They do not count."
    main: str = "Now the experiment begins."
    control: str = Field(
        default=(
            "Now take both hands off the plate. Answer as before; if you notice nothing, press the "
            "key for nothing."
        ),
    )
    ready: str = Field(default="+", description="until the stimulus")
    prompt: str = "Where did you feel it?"
    correct: str = Field(default="Right", description="after a practice answer")
    wrong: str = "Not so"
    paused: str = "Paused: {done} of {planned} trials are done."
    rest: str = "Have a break: {done} of {planned} trials are done. It goes on in {seconds} s."
    rest_over: str = "Have a break: {done} of {planned} trials are done."
    go_on: str = Field(
        default="Press Enter to go on.", description="below screens that wait for its key"
    )
    finished: str = "That was all. Thank you very much!"
    stopped: str = "The session was stopped. Thank you."

    def __post_init__(self) -> None:
        for name, text in asdict(self).items():
            control = [sign for sign in text if unicodedata.category(sign) == "Cc" and sign != "\n"]
            if control:
                raise ValueError(f"{name} must have no control characters; got {control[0]!r}")
            if not any(map(is_line, text.split("\n"))):
                raise ValueError(f"{name} must hold something to read; got {text!r}")
            _check_placeholders(name, text)


def _check_placeholders(name: str, text: str) -> None:
    allowed = _PLACEHOLDERS.get(name, ())
    if not allowed:
        if "{" in text or "}" in text:
            raise ValueError(f"{name} must have no braces, nothing is filled in; got {text!r}")
        return
    listed = ", ".join(f"{{{word}}}" for word in allowed)
    try:
        parts = list(string.Formatter().parse(text))
    except ValueError as error:
        raise ValueError(f"{name} may hold {listed}, and other braces doubled; {error}") from error
    for _, word, spec, conversion in parts:
        if word is not None and (word not in allowed or spec or conversion):
            raise ValueError(f"{name} may hold {listed}, and other braces doubled; got {{{word}}}")
