"""The few forms that the pages of the reference are made of."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    r"""Write a table; a bar in a cell is no end of it.

    >>> print(table(["key"], [["a | b"]]))
    | key |
    |---|
    | a \| b |
    <BLANKLINE>
    """
    lines = [heading, ["---"] * len(heading)]
    written = [_row(lines[0]), "|" + "|".join(lines[1]) + "|"]
    return "\n".join([*written, *map(_row, rows)]) + "\n"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(" ".join(cell.split()).replace("|", r"\|") for cell in cells) + " |"


def code(text: str, language: str = "text") -> str:
    """Write lines as they are."""
    return f"```{language}\n{text.rstrip()}\n```\n"


def literal(text: str) -> str:
    """Write a word of the program; nothing for none.

    >>> literal("width_mm"), literal("")
    ('`width_mm`', '')
    """
    return f"`{text}`" if text else ""


def prose(text: str | None) -> str:
    r"""Return a docstring as paragraphs, as far as its first section or example.

    >>> prose("Say.\n\n    More\n    of it.\n\n    Raises\n    ------\n    Nothing.")
    'Say.\n\nMore\nof it.'
    """
    first, _, rest = (text or "").strip().partition("\n")
    told = [first]
    for paragraph in textwrap.dedent(rest).strip().split("\n\n"):
        lines = paragraph.split("\n")
        if paragraph.startswith(">>>") or (len(lines) > 1 and set(lines[1]) == {"-"}):
            break
        told.append(paragraph.replace("``", "`"))
    return "\n\n".join(filter(None, told))
