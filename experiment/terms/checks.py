"""Checks of single values that the modules of this package share; numbers: `stimuli.checks`."""

from __future__ import annotations

import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


def require_word(name: str, value: str, words: Iterable[str]) -> None:
    """Refuse a value that is none of the words.

    Parameters
    ----------
    name : str
        What the message calls the value.
    value : str
        The value.
    words : iterable of str
        What it may be.

    Raises
    ------
    ValueError
        If it is none of them; the message lists the words.

    Examples
    --------
    >>> require_word("side", "left", ("left", "right"))
    >>> require_word("side", "up", ("left", "right"))
    Traceback (most recent call last):
    ValueError: side must be one of left, right; got 'up'
    """
    listed = tuple(words)
    if value not in listed:
        raise ValueError(f"{name} must be one of {', '.join(listed)}; got {value!r}")


def require_known(name: str, value: str, words: Iterable[str]) -> None:
    """Refuse a value that is none of the words, and say which is nearest to it.

    >>> require_known("material", "steal", ("steel", "glass"))
    Traceback (most recent call last):
    ValueError: material must be one of steel, glass; got 'steal', did you mean steel?
    """
    import difflib

    listed = tuple(words)
    if value not in listed:
        near = difflib.get_close_matches(value.lower(), listed, n=1)
        told = f", did you mean {near[0]}?" if near else ""
        raise ValueError(f"{name} must be one of {', '.join(listed)}; got {value!r}{told}")


def is_line(text: object) -> bool:
    r"""Tell whether a value is one line of text with something to read, in any script.

    Examples
    --------
    >>> is_line("שלום"), is_line(" "), is_line("two\nlines"), is_line(3)
    (True, False, False, False)
    """
    if not isinstance(text, str):
        return False
    return all(c.isprintable() or unicodedata.category(c) in _INVISIBLE for c in text) and any(
        c.isprintable() and not c.isspace() for c in text
    )


_INVISIBLE = ("Cf", "Zs")
"""Signs without a form: marks of the direction, joiners, wide spaces."""


def unknown_key(path: str, known: Iterable[str]) -> str:
    """Say that a key is unknown, and which known one is nearest to it.

    Parameters
    ----------
    path : str
        The key with the tables it stands in, joined by dots.
    known : iterable of str
        The keys of that table.

    Examples
    --------
    >>> unknown_key("design.trails_per_side", ["levels_vpp", "trials_per_side"])
    'unknown key design.trails_per_side; did you mean trials_per_side?'
    """
    import difflib

    near = difflib.get_close_matches(path.rsplit(".", maxsplit=1)[-1], list(known), n=1)
    return f"unknown key {path}" + (f"; did you mean {near[0]}?" if near else "")


RESERVED = r"(?i:CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])"
"""Pattern of the names that Windows keeps for devices: a file or folder of one cannot be read."""
NAME = re.compile(rf"(?!{RESERVED}\Z)[A-Za-z0-9_-]{{1,32}}")
NAME_RULE = "1 to 32 of the characters A-Z a-z 0-9 _ -, and none that Windows reserves, as CON"
