"""Texts for a window that knows neither line breaks nor languages written from right to left."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def filled(text: str, facts: Mapping[str, object]) -> str:
    """Fill in facts: how far the session has come, how long a break still lasts, keys.

    Braces that are doubled stand for one; other braces stay as they are.

    Examples
    --------
    >>> filled("{done} of {planned} {{done}}", {"done": 2, "planned": 5})
    '2 of 5 {done}'
    """
    signs = {"{{": "{", "}}": "}"} | {f"{{{name}}}": str(value) for name, value in facts.items()}
    return _FILLED.sub(lambda found: signs.get(found[0], found[0]), text)


_FILLED: Final = re.compile(r"\{\{|\}\}|\{[a-z_]+\}")


def wrapped(text: str, fits: Callable[[str], bool]) -> tuple[str, ...]:
    """Break a text of any language into lines, in reading order; its own line breaks are kept.

    Text without spaces is broken anywhere, at least one character to a line.

    Examples
    --------
    >>> wrapped("one two three", lambda line: len(line) <= 7)
    ('one two', 'three')
    >>> wrapped("触覚実験", lambda line: len(line) <= 3)
    ('触覚実', '験')
    """
    lines: list[str] = []
    for paragraph in text.split("\n"):
        line = ""
        for word in paragraph.split():
            longer = f"{line} {word}" if line else word
            if fits(longer):
                line = longer
                continue
            if line:
                lines.append(line)
            *whole, line = _pieces(word, fits)
            lines += whole
        lines.append(line)
    return tuple(lines)


def _pieces(word: str, fits: Callable[[str], bool]) -> list[str]:
    """Break a word that is longer than a line."""
    pieces = [word[:1]]
    for character in word[1:]:
        if fits(pieces[-1] + character):
            pieces[-1] += character
        else:
            pieces.append(character)
    return pieces


def as_drawn(line: str, *, right_to_left: bool) -> str:
    """Return a line's characters from left to right, in the shapes in which they join.

    The line is in reading order, and was broken before: one that is broken after this would begin
    with its end. `right_to_left` is of the line as a whole.
    """
    from arabic_reshaper import ArabicReshaper
    from bidi.algorithm import get_display

    # vowel signs follow their letter once the line is turned around
    reshaper = ArabicReshaper({"delete_harakat": False, "shift_harakat_position": True})
    drawn: str = get_display(reshaper.reshape(line), base_dir="R" if right_to_left else "L")
    return drawn
