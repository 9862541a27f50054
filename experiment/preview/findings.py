"""What a check found, each fact stated once: a line on a terminal beside a value for programs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable


_COLUMN: Final = 15
"""Where the words begin in a line."""


class Findings:
    """Lines for a terminal and, from the same statements, facts by keys that carry their unit.

    Examples
    --------
    >>> found = Findings()
    >>> found.tell("cut-off", "2900.0 Hz, measured", cutoff_hz=2900.0)
    >>> found.text, found.json
    ('cut-off        2900.0 Hz, measured', '{"cutoff_hz": 2900.0}')
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.facts: dict[str, Any] = {}

    def tell(self, label: str, words: str, **facts: Any) -> None:
        """State facts in a line; without a label it goes on with what the line above says."""
        self.lines.append(f"{label:{_COLUMN}}{words}")
        self.facts |= facts

    def note(self, **facts: Any) -> None:
        """State facts that only programs are told."""
        self.facts |= facts

    def space(self) -> None:
        """Leave a line free."""
        self.lines.append("")

    def take(self, other: Findings) -> None:
        """Go on with other findings on the same thing."""
        self.lines += other.lines
        self.facts |= other.facts

    def part(self, key: str, part: Findings) -> None:
        """Take in the findings on one thing, under a key of their own."""
        self.lines += part.lines
        self.facts[key] = part.facts

    def parts(self, key: str, parts: Iterable[Findings]) -> None:
        """Take in the findings on several things of a kind, as a list."""
        self.facts[key] = []
        for part in parts:
            self.lines += part.lines
            self.facts[key].append(part.facts)

    @property
    def text(self) -> str:
        """The lines."""
        return "\n".join(self.lines)

    @property
    def json(self) -> str:
        """The facts as one JSON object on one line."""
        return json.dumps(self.facts, allow_nan=False)
