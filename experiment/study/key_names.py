"""The names of keys, as PsychoPy has them, and what a terminal sends for each."""

from __future__ import annotations

import string
import tomllib
from pathlib import Path
from typing import Final

_SENT: Final = tomllib.loads(Path(__file__).with_name("key_names.toml").read_text("utf-8"))
ARROWS: Final[dict[str, str]] = _SENT.pop("symbols")
"""The arrow keys with their symbols, each a quarter turn after the one before."""
TYPED: Final[dict[str, tuple[str, ...]]] = {
    **{letter: (letter, letter.upper()) for letter in string.ascii_lowercase},
    **{name: (digit,) for digit in string.digits for name in (digit, f"num_{digit}")},
    **{name: tuple(characters) for name, characters in _SENT.items()},
}
"""What a terminal sends for a key of `[keys]`."""

UNTYPED: Final = frozenset(
    (
        *(f"{side}{key}" for side in "lr" for key in ("alt", "command", "ctrl", "option", "shift")),
        *("lwindows", "rwindows", "menu", "pause"),
        *(f"f{number}" for number in range(13, 20)),
        *(f"button_{number}" for number in range(32)),
    )
)
"""Keys for which terminals send nothing, or different characters."""

KEY_NAMES: Final = frozenset(TYPED) | UNTYPED
"""The names that PsychoPy 2026.2's keyboard has for keys on Linux, macOS and Windows, locks left
out, and buttons of game controllers."""
