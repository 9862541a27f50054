"""Whether keys and texts of a study can be used: PsychoPy knows the keys, nothing is unfilled."""

from __future__ import annotations

import string
import unicodedata
from dataclasses import fields
from typing import TYPE_CHECKING, Final

from experiment.checks import is_line

if TYPE_CHECKING:
    from experiment.presentation import Keys, Screen, Texts

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
    >>> from experiment.presentation import Keys
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
    >>> from experiment.presentation import Texts
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
