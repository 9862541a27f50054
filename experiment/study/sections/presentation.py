"""What stands before a participant: the window, its texts in any language, the keys that answer."""

from __future__ import annotations

import string
import unicodedata
from dataclasses import dataclass, fields
from typing import Final

from experiment.terms.checks import is_line
from stimuli.checks import finite, whole


@dataclass(frozen=True, slots=True, kw_only=True)
class Screen:
    """The participant's window.

    Attributes
    ----------
    full_screen : bool
        Whether it covers the screen.
    index : int
        Which screen, counted from 0.
    width_px, height_px : int
        Its size where it does not cover the screen.
    text_height : float
        Height of a line, as a fraction of the window's.
    right_to_left : bool
        Whether texts run from right to left.
    font : str
        Font of the texts.

    Raises
    ------
    ValueError
        If a value is out of its range; it begins with the name.

    Examples
    --------
    >>> Screen(text_height=0.5)
    Traceback (most recent call last):
    ValueError: text_height must be a finite number >= 0.01 and <= 0.2, got 0.5
    """

    full_screen: bool = True
    index: int = 0
    width_px: int = 1280
    height_px: int = 720
    text_height: float = 0.035
    right_to_left: bool = False
    font: str = "DejaVu Sans"

    def __post_init__(self) -> None:
        whole("index", self.index, least=0, most=15)
        whole("width_px", self.width_px, least=320, most=16384)
        whole("height_px", self.height_px, least=240, most=16384)
        finite("text_height", self.text_height, least=0.01, most=0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Keys:
    """The keys that mean an answer or a wish, by PsychoPy's names.

    Attributes
    ----------
    left, right, both, none : tuple of str
        Keys of each answer: arrows, the keys a pedal types, the operator's keys.
    pause : tuple of str
        A pause; pressed again within it, the end.
    go_on : tuple of str
        To the next screen.

    Raises
    ------
    ValueError
        If a wish has no key, or a key two meanings; it begins with the name.

    Examples
    --------
    >>> Keys(left=("space",))
    Traceback (most recent call last):
    ValueError: none must have keys without another meaning; got space, which means left
    """

    left: tuple[str, ...] = ("left",)
    right: tuple[str, ...] = ("right",)
    both: tuple[str, ...] = ("down",)
    none: tuple[str, ...] = ("space",)
    pause: tuple[str, ...] = ("escape",)
    go_on: tuple[str, ...] = ("return",)

    def __post_init__(self) -> None:
        meanings: dict[str, str] = {}
        for field in fields(self):
            keys: tuple[str, ...] = getattr(self, field.name)
            if not keys:
                raise ValueError(f"{field.name} must have at least one key; got none")
            for key in keys:
                if key in meanings:
                    raise ValueError(
                        f"{field.name} must have keys without another meaning; got {key}, "
                        f"which means {meanings[key]}"
                    )
                meanings[key] = field.name


@dataclass(frozen=True, slots=True, kw_only=True)
class Texts:
    """What a participant reads; ``{done}``, ``{planned}`` and ``{seconds}`` are filled in.

    Attributes
    ----------
    welcome, instructions, placement : str
        Before a sitting; `placement` stands above the picture of the fingers.
    audibility, practice, warm_up, main, control : str
        Before each part of a session.
    ready, prompt : str
        While the stimulus is awaited, and while the answer is.
    correct, wrong : str
        After a practice answer.
    paused, rest, rest_over : str
        In a pause; in a break, before and after its shortest time.
    go_on : str
        Below every screen that waits for its key.
    finished, stopped : str
        At the end, and after an early one.
    """

    welcome: str = "Welcome, and thank you for taking part."
    instructions: str = (
        "You will feel a short vibration under your left finger, your right finger, or both. "
        "Then say where you felt it. If you are not sure, answer what seems most likely."
    )
    placement: str = "Lay one finger of each hand on the plate as shown, and keep them there."
    audibility: str = (
        "First without touching: take both hands off the plate. If you hear the plate through the "
        "noise, press the key of the side; if you hear nothing, press the key for nothing."
    )
    practice: str = "Now a few trials for practice. You are told whether you were right."
    warm_up: str = "A few trials to get used to it again. They do not count."
    main: str = "Now the experiment begins."
    control: str = (
        "Now take both hands off the plate. Answer as before; if you notice nothing, press the "
        "key for nothing."
    )
    ready: str = "+"
    prompt: str = "Where did you feel it?"
    correct: str = "Right"
    wrong: str = "Not so"
    paused: str = "Paused: {done} of {planned} trials are done."
    rest: str = "Have a break: {done} of {planned} trials are done. It goes on in {seconds} s."
    rest_over: str = "Have a break: {done} of {planned} trials are done."
    go_on: str = "Press Enter to go on."
    finished: str = "That was all. Thank you very much!"
    stopped: str = "The session was stopped. Thank you."


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


def check_screen(screen: Screen) -> None:
    """Refuse a window whose font has no name.

    Raises
    ------
    ValueError
        If the font is not a name; it begins with the name of the key.
    """
    if not is_line(screen.font):
        raise ValueError(f"font must be a name in one line of text; got {screen.font!r}")


def check_keys(keys: Keys) -> None:
    """Refuse names that no keyboard's key has.

    Raises
    ------
    ValueError
        If there is one; it begins with the name of the meaning.

    Examples
    --------
    >>> from experiment.study.sections.presentation import Keys
    >>> check_keys(Keys(go_on=("enter",)))
    Traceback (most recent call last):
    ValueError: go_on[0] must be a key's name: a-z, 0-9, or one such as left, space, return, f1,
    num_4; got 'enter'
    """
    for field in fields(keys):
        for place, key in enumerate(getattr(keys, field.name)):
            if key not in KEY_NAMES:
                raise ValueError(
                    f"{field.name}[{place}] must be a key's name: a-z, 0-9, or one such as left, "
                    f"space, return, f1, num_4; got {key!r}"
                )


def check_texts(texts: Texts) -> None:
    """Refuse texts with nothing to read, with control characters, or with unknown placeholders.

    Raises
    ------
    ValueError
        If there is one; it begins with the name of the text.

    Examples
    --------
    >>> from experiment.study.sections.presentation import Texts
    >>> check_texts(Texts(paused="{done} von {total}"))
    Traceback (most recent call last):
    ValueError: paused may hold {done}, {planned}, and other braces doubled; got {total}
    """
    for field in fields(texts):
        text: str = getattr(texts, field.name)
        control = [sign for sign in text if unicodedata.category(sign) == "Cc" and sign != "\n"]
        if control:
            raise ValueError(f"{field.name} must have no control characters; got {control[0]!r}")
        if not any(map(is_line, text.split("\n"))):
            raise ValueError(f"{field.name} must hold something to read; got {text!r}")
        _check_placeholders(field.name, text)


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
