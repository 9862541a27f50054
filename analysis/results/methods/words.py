"""How names, numbers and lists are written in a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence


SPELLED: Final = 3
"""Of more conditions, or pairs of them, a sentence says where they stand."""
_ISOLATE, _END = "\u2068", "\u2069"


def isolated(name: object) -> str:
    """Return a name whose letters stay within it, should they run right to left."""
    return f"{_ISOLATE}{name}{_END}"


def plain(text: str) -> str:
    """Return a text without the signs that isolate names.

    >>> plain(f"in condition {isolated('main')}")
    'in condition main'
    """
    return text.replace(_ISOLATE, "").replace(_END, "")


def and_words(names: Sequence[str]) -> str:
    """Enumerate names."""
    *first, last = map(isolated, names)
    return f"{', '.join(first)} and {last}" if first else last


def number_of(number: int, noun: str) -> str:
    """Return a number of something.

    >>> number_of(1, "trial"), number_of(2, "trial")
    ('1 trial', '2 trials')
    """
    return f"{number} {noun}{'' if number == 1 else 's'}"
