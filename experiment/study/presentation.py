"""The sections [screen], [keys] and [texts]: what stands before a participant, in any language."""

from __future__ import annotations

import re
import string
import unicodedata
from dataclasses import asdict
from typing import TYPE_CHECKING, Final

from pydantic import Field

from experiment.names import is_line
from experiment.rows import ANSWERS
from experiment.study.base import section

if TYPE_CHECKING:
    from collections.abc import Mapping

    from experiment.study.design import Design

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
        *(f"button_{number}" for number in range(32)),
    )
)
"""The names that PsychoPy 2026.2's keyboard has for keys on Linux, macOS and Windows, locks left
out, and buttons of game controllers."""


def _control(letter: str) -> tuple[str, ...]:
    return f"\x1b[{letter}", f"\x1bO{letter}"


def _numbered(number: int) -> tuple[str, ...]:
    return (f"\x1b[{number}~",)


_ARROWS: Final = {"up": "A", "down": "B", "right": "C", "left": "D"}
_SIGNS: Final = (
    "apostrophe' backslash\\ bracketleft[ bracketright] comma, equal= grave` less< minus- period. "
    "pound# quoteleft` semicolon; slash/ num_add+ num_decimal. num_divide/ num_equal= "
    "num_multiply* num_subtract-"
)
TYPED: Final[Mapping[str, tuple[str, ...]]] = {
    **{letter: (letter, letter.upper()) for letter in string.ascii_lowercase},
    **{digit: (digit,) for digit in string.digits},
    **{f"num_{digit}": (digit,) for digit in string.digits},
    **{word[:-1]: (word[-1],) for word in _SIGNS.split()},
    **{key: _control(letter) for key, letter in _ARROWS.items()},
    "home": (*_control("H"), *_numbered(1)),
    "end": (*_control("F"), *_numbered(4)),
    "insert": _numbered(2),
    "delete": _numbered(3),
    "pageup": _numbered(5),
    "pagedown": _numbered(6),
    "space": (" ",),
    "tab": ("\t",),
    "escape": ("\x1b",),
    "return": ("\r", "\n"),
    "num_enter": ("\r", "\n", "\x1bOM"),
    "backspace": ("\x7f", "\b"),
    **{f"f{i}": (_control(sign)[1], *_numbered(10 + i)) for i, sign in enumerate("PQRS", 1)},
    **{f"f{i}": _numbered(number) for i, number in enumerate((15, 17, 18, 19, 20, 21, 23, 24), 5)},
}
"""What a terminal sends for a key of `[keys]`: the signs of xterm, which the others follow."""

UNTYPED: Final = KEY_NAMES - set(TYPED)
"""Keys of which a terminal tells a program nothing, or not the same everywhere."""

_WITH_KEYS: Final = (
    *("instructions", "audibility", "practice", "warm_up", "main", "control"),
    *("prompt", "prompt_hands_off"),
)
"""Texts in which the keys of the answers are filled in."""
_PLACEHOLDERS: Final = {
    **dict.fromkeys(_WITH_KEYS, ANSWERS),
    "go_on": ("go_on",),
    "paused": ("done", "planned"),
    "rest": ("done", "planned", "seconds"),
    "rest_over": ("done", "planned"),
}
"""What is filled in, by text; the others are shown as they are."""
_HANDS_OFF: Final = ("audibility", "control", "prompt_hands_off")
"""Texts for trials with the fingers off the plate, where nothing can always be answered."""

_OPEN, _CLOSE = "\"'`“”„‘’‚«»‹›<[", "\"'`“”‘’«»‹›>]"
_KEY: Final = "[A-Za-z0-9]|[Ff]1?[0-9]|[Ee]nter|[Ee]sc|[Ss]pace"
_PATTERNS: Final = (
    re.compile("([←→↓↑])"),
    re.compile(r"\b(spacebar|space bar|esc|(?:left|right|up|down) arrow)\b", re.IGNORECASE),
    re.compile(rf"[{re.escape(_OPEN)}]({_KEY})[{re.escape(_CLOSE)}]"),
    re.compile(r"\b(?:press|keys?|taste|touche|tecla) (?!a\b)([a-z0-9]|enter)\b", re.IGNORECASE),
    re.compile(r"(?<![\w.'’-])(?<=[^.!?:\s] )([A-HJ-Z]|F1?[0-9]|Enter)(?![\w'’-]|\.\w)"),
    re.compile(r"(?<![\w.'’-])([BCDFGHJLMNPQRTX])(?![\w'’.)-])"),  # no word of one letter
)
"""How texts name keys in most languages: signs, quoted, after a verb, a capital letter alone."""
_NAMES: Final = {
    "←": "left",
    "→": "right",
    "↓": "down",
    "↑": "up",
    **{f"{side} arrow": side for side in ("left", "right", "down", "up")},
    "spacebar": "space",
    "space bar": "space",
    "esc": "escape",
    "enter": "return",
}
"""PsychoPy's names of keys by what texts call them; others by their own."""


@section
class Screen:
    """The participant's window, for `run --responder screen`."""

    full_screen: bool = Field(default=True, description="false: a window")
    index: int = Field(default=0, ge=0, le=15, description="which screen, counted from 0")
    width_px: int = Field(default=1280, ge=320, le=16384, description="of a window")
    height_px: int = Field(default=720, ge=240, le=16384, description="of a window")
    text_height: float = Field(
        default=0.035, ge=0.01, le=0.2, description="of a line, part of the window's"
    )
    right_to_left: bool = Field(default=False, description="for Arabic, Hebrew, ...")
    font: str = Field(default="DejaVu Sans", description="as the system names it")

    def __post_init__(self) -> None:
        if not is_line(self.font):
            raise ValueError(f"font must be a name in one line of text; got {self.font!r}")


@section
class Keys:
    """The keys of each answer and wish, by PsychoPy's names.

    They are a-z, 0-9, left, space, return, num_4, f1 and such, and button_0 to button_31 of a game
    controller; a pedal types keys. Several keys may mean the same, no key two things.
    """

    left: tuple[str, ...] = Field(default=("left",), strict=False, description="felt left")
    right: tuple[str, ...] = Field(default=("right",), strict=False, description="felt right")
    both: tuple[str, ...] = Field(default=("down",), strict=False, description="felt at both")
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

    {done}, {planned} (of practice, or of the task) and, in rest, {seconds} are filled in where the
    defaults have them; {left}, {right}, {both} and {none} are the keys of these answers, in texts
    about answers, {go_on} that to go on.
    """

    welcome: str = Field(
        default="Welcome, and thank you for taking part.", description="first of all"
    )
    instructions: str | None = Field(
        default=None, description="by default made from what is presented and may be answered"
    )
    placement: str = Field(
        default="Lay one finger of each hand on the plate as shown, and keep them there.",
        description="above the picture of the fingers",
    )
    audibility: str = Field(
        default=(
            "First without touching: take both hands off the plate. If you hear it, answer where; "
            "if you hear nothing, press {none}."
        ),
        description="before each part of a session",
    )
    practice: str = Field(
        default="Now a few trials for practice. You are told whether you were right.",
        description="before practice",
    )
    warm_up: str = Field(
        default="A few trials to get used to it again. They do not count.",
        description="after an interruption",
    )
    main: str = Field(default="Now the experiment itself.", description="before the first block")
    control: str = Field(
        default=(
            "Now take both hands off the plate. Answer as before; if you notice nothing, press "
            "{none}."
        ),
        description="before the part with the fingers off the plate, at the end",
    )
    ready: str = Field(default="+", description="until the stimulus")
    prompt: str = Field(default="Where did you feel it?", description="the question")
    prompt_hands_off: str = Field(
        default="Did you notice anything, and where?", description="the hands off the plate"
    )
    correct: str = Field(default="Correct", description="after a practice answer")
    wrong: str = Field(default="Not so", description="after a practice answer")
    paused: str = Field(
        default="Paused: {done} of {planned} trials are done.", description="in a pause"
    )
    rest: str = Field(
        default="Have a break: {done} of {planned} trials are done. You can go on in {seconds} s.",
        description="in a break",
    )
    rest_over: str = Field(
        default="Have a break: {done} of {planned} trials are done.",
        description="in a break that may be ended",
    )
    go_on: str = Field(
        default="Press {go_on} to go on.", description="below screens that wait for this key"
    )
    finished: str = Field(default="That was all. Thank you very much!", description="at the end")
    stopped: str = Field(
        default="The session was stopped. Thank you.", description="at an earlier end"
    )

    def __post_init__(self) -> None:
        for name, text in asdict(self).items():
            if text is None:
                continue
            control = [sign for sign in text if unicodedata.category(sign) == "Cc" and sign != "\n"]
            if control:
                raise ValueError(f"{name} must have no control characters; got {control[0]!r}")
            if not any(map(is_line, text.split("\n"))):
                raise ValueError(f"{name} must hold something to read; got {text!r}")
            _check_placeholders(name, text)

    def check_answers(self, responses: tuple[str, ...]) -> None:
        """Refuse a text that names the key of an answer that is not offered where it is shown."""
        for name in _WITH_KEYS:
            offered = (*responses, "none") if name in _HANDS_OFF else responses
            named = _words(getattr(self, name) or "")
            for word in named - set(offered):
                raise ValueError(
                    f"texts.{name} has the key of an answer that is not offered there, {{{word}}}: "
                    f"leave it out, or add it to design.responses; got {list(responses)}"
                )


def untyped_of(keys: Keys, responses: tuple[str, ...]) -> str:
    """Tell of the first meaning whose keys are not its own at a terminal, or cannot be typed there.

    >>> untyped_of(Keys(pause=("lalt",)), ("left", "right"))
    "keys.pause = ['lalt'] cannot be typed at a terminal: add a key that can, such as a letter"
    >>> untyped_of(Keys(pause=("lalt", "p"), both=("menu",)), ("left", "right"))
    ''
    >>> untyped_of(Keys(left=("4",), right=("num_4",)), ("left", "right"))
    'keys.right: num_4 is the same key at a terminal as one of keys.left: take another'
    """
    for meaning in (*responses, "pause", "go_on"):
        names = getattr(keys, meaning)
        if set(names) <= UNTYPED:
            return (
                f"keys.{meaning} = {list(names)} cannot be typed at a terminal: add a key that "
                "can, such as a letter"
            )
    meanings: dict[str, str] = {}
    for meaning, names in asdict(keys).items():
        for name in names:
            for sign in TYPED.get(name, ()):
                if meanings.setdefault(sign, meaning) != meaning:
                    return (
                        f"keys.{meaning}: {name} is the same key at a terminal as one of "
                        f"keys.{meanings[sign]}: take another"
                    )
    return ""


def instructions_of(design: Design) -> str:
    """Tell a person what comes, from what a design presents and offers as answers.

    >>> from experiment.study.design import Design
    >>> instructions_of(Design(responses=("left", "right"), both_trials=0))
    'You will feel a short vibration under your left or your right finger. Then say where you fe...
    """
    both, none = (word in design.responses for word in ("both", "none"))
    where = (
        "your left finger, your right finger, or both" if both else "your left or your right finger"
    )
    nothing = ""
    if none and design.blank_trials:
        nothing = " Sometimes there will be no vibration: press {none} then."
    elif none:
        nothing = " If you feel nothing, press {none}."
    return (
        f"You will feel a short vibration under {where}. Then say where you felt it.{nothing} If "
        "you are not sure, answer what seems most likely."
    )


def unsaid_in(texts: Texts, design: Design) -> str:
    """Tell what a lab's own instructions seem not to say; nothing of those made from the design.

    >>> from experiment.study.design import Design
    >>> unsaid_in(Texts(instructions="Press {left} or {right}."), Design())
    'without {both}, the answer to 5 trials'
    """
    trials = {"both": design.both_trials, "none": design.blank_trials}
    named = set(trials) if texts.instructions is None else _words(texts.instructions)
    missing = [
        f"without {{{word}}}, the answer to {n} trial{'s' * (n > 1)}"
        for word, n in trials.items()
        if n and word not in named
    ]
    return "; ".join(missing)


def named_keys(text: str) -> tuple[str, ...]:
    """List the keys that a text seems to name by itself, not by a word in braces.

    >>> named_keys("Press F or “j”, and the space bar or {none} for nothing. A vibration follows.")
    ('F', 'j', 'space bar')
    """
    own = re.sub(r"\{\w*\}", "_", text)
    found = [match for pattern in _PATTERNS for match in pattern.finditer(own)]
    found.sort(key=lambda match: match.start(1))
    return tuple(dict.fromkeys(match[1] for match in found))


def key_doubts(texts: Texts, keys: Keys, design: Design) -> tuple[str, ...]:
    """Tell of keys that a lab's own texts name by themselves and that mean nothing there.

    Which keys a text names is a guess in any language, so that nothing is refused for it.

    >>> from experiment.study.design import Design
    >>> key_doubts(Texts(main="Press F or {right}."), Keys(), Design())
    ('texts.main names F, which means nothing there by [keys]: write {left}, {right}, {both} where
    keys belong, and they are filled in',)
    """
    meant, default = asdict(keys), asdict(Texts())
    hands_off = design.audibility_trials + design.control_trials > 0
    answers = dict.fromkeys((*design.responses, *(["none"] if hands_off else [])))
    doubts = []
    for name, text in asdict(texts).items():
        if text is None or text == default[name]:
            continue
        words = ("go_on",) if name == "go_on" else tuple(answers)
        known = {
            key.removeprefix("num_").replace("enter", "return")
            for word in (*words, "go_on", *(["pause"] if name != "go_on" else []))
            for key in meant[word]
        }
        unknown = [
            key for key in named_keys(text) if _NAMES.get(key.lower(), key.lower()) not in known
        ]
        if unknown:
            mean = "means" if len(unknown) == 1 else "mean"
            write = ", ".join(f"{{{word}}}" for word in words)
            doubts.append(
                f"texts.{name} names {' and '.join(unknown)}, which {mean} nothing there by "
                f"[keys]: write {write} where keys belong, and they are filled in"
            )
    return tuple(doubts)


def _words(text: str) -> set[str]:
    return {word for _, word, _, _ in string.Formatter().parse(text) if word is not None}


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
