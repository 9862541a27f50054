"""Names of a study and its files, words of every table, and what counts as a line of text."""

from __future__ import annotations

import re
import unicodedata
from numbers import Integral
from typing import Final, Literal, TypeAlias

from device.printing import shown

NOT_AVAILABLE: Final = "n/a"
"""What a table has for a value that does not exist or is not known."""
OTHER_VERSION: Final = "another version of tactstrip wrote it"
DeviceKind: TypeAlias = Literal["real", "emulated", "mock", "rehearsal"]
"""What drives the actuators."""
_RESERVED: Final = r"(?i:CON|PRN|AUX|NUL|COM[0-9]|LPT[0-9])"
"""Pattern of the names that Windows keeps for devices: a file or folder of one cannot be read."""
TOTALS: Final = "all"
"""The name of rows of totals in result tables, which no participant can have."""
_IDENTIFIER: Final = re.compile(rf"(?!(?:{_RESERVED}|{TOTALS})\Z)[A-Za-z0-9]{{1,32}}")
NAME: Final = re.compile(rf"(?!{_RESERVED}\Z)[A-Za-z0-9_-]{{1,32}}")
"""A name that can be part of a file's name on any system."""
NAME_RULE: Final = "must be 1 to 32 of A-Z a-z 0-9 _ -, and no name that Windows reserves"

_INVISIBLE: Final = ("Cf", "Zs")
"""Characters without a shape: marks of the direction, joiners, wide spaces."""


def is_line(text: object) -> bool:
    r"""Return whether a value is one line of text, not blank, in any script.

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


def require_identifier(name: str, value: object) -> None:
    """Refuse what cannot be the identifier of a participant or session, part of a folder's name.

    >>> require_identifier("participant", "01")
    """
    if not isinstance(value, str) or not _IDENTIFIER.fullmatch(value):
        raise ValueError(
            f"{name}: must be 1 to 32 letters (a-z, A-Z) or digits, and not {TOTALS!r} or a name "
            f"that Windows reserves, such as CON or COM1 (got {shown(value)})"
        )


def require_whole(name: str, value: object, minimum: int) -> None:
    """Refuse what is not a whole number of at least a minimum.

    >>> require_whole("participants", 0, 1)
    Traceback (most recent call last):
    ValueError: participants: must be a whole number of at least 1 (got 0)
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or int(value) < minimum:
        raise ValueError(
            f"{name}: must be a whole number of at least {minimum} (got {shown(value)})"
        )
