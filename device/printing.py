"""Everything that a command prints passes here: control characters are escaped.

The names of folders, keys of files and answers of instruments may hold characters that move a
terminal's cursor or wipe its lines. Printed raw, a folder's name could replace a verdict.
"""

from __future__ import annotations

import sys
import unicodedata
from typing import Any, Final, TextIO

import click

MAX_SHOWN: Final = 80
"""A message repeats at most so many characters of a value."""
_JOINERS: Final = "\u200c\u200d"
"""Invisible, but needed to spell Persian words and to compose emoji."""


def escaped(text: object) -> str:
    r"""Return a text in one line whose control characters are replaced by escape sequences.

    Line breaks, tabs, marks that reverse the direction of text, and bytes that are no text are
    replaced, too.

    Examples
    --------
    >>> escaped("ses-01\x1b[2K\rses-01: unmodified")
    'ses-01\\x1b[2K\\rses-01: unmodified'
    >>> escaped("שלום")
    'שלום'
    """
    string = str(text)
    if string.isascii() and string.isprintable():
        return string
    return "".join(c if _is_harmless(c) else _escape_sequence(c) for c in string)


def _is_harmless(character: str) -> bool:
    return (
        character.isprintable()
        or character in _JOINERS
        or unicodedata.category(character) == "Zs"  # spaces of other widths
    )


def _escape_sequence(character: str) -> str:
    code = ord(character)
    # from 0x7f on in the form that is valid in JSON, too, where the others are escaped already
    return repr(character)[1:-1] if code < 0x7F else f"\\u{code:04x}"  # noqa: PLR2004


def shown(value: object) -> str:
    """Return a value as a message repeats it: like `repr`, of at most `MAX_SHOWN` characters.

    Examples
    --------
    >>> shown("up"), len(shown("x" * 1000))
    ("'up'", 80)
    """
    return shortened(escaped(repr(value)))


def shortened(text: str) -> str:
    """Return at most `MAX_SHOWN` characters of a text, the last three of them dots.

    Examples
    --------
    >>> shortened("x" * 100)[-5:]
    'xx...'
    """
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def echo(*lines: object, err: bool = False, file: TextIO | None = None, **style: Any) -> None:
    """Print lines, escaped, by default to stdout, with `err` to stderr.

    Characters that the encoding of the stream lacks are escaped as well. `style` is as for
    `click.style` and has no effect in a pipe.

    Examples
    --------
    >>> echo("done", 3)
    done
    3
    """
    stream = file or (sys.stderr if err else sys.stdout)
    encoding = getattr(stream, "encoding", None) or "utf-8"
    for line in lines or ("",):
        text = escaped(line).encode(encoding, "backslashreplace").decode(encoding)
        click.echo(click.style(text, **style) if style else text, file=file, err=err)
