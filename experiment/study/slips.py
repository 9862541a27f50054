"""Lines of a study file that are no TOML, and what they were meant to be."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from experiment.names import NUMBERS

if TYPE_CHECKING:
    from collections.abc import Sequence


_KEY: Final = r"(?P<key>[\w.-]+)\s*=\s*"
_END: Final = r"\s*(?:#.*)?"
# What a line that is no TOML was meant to be, by its form: the first that fits is told.
_MEANT: Final = tuple(
    (re.compile(_KEY + value + _END), words)
    for value, words in (
        ("", "{key} has no value; write one behind the =, or # before the key"),
        (
            r"(?P<whole>[-+]?\d+),(?P<part>\d+)",
            "{key} has a decimal comma; write {key} = {whole}.{part}; got {whole},{part}",
        ),
        (
            r"(?P<sign>[-+]?)\.(?P<part>\d+)",
            "{key} needs a digit before its point; write {key} = {sign}0.{part}",
        ),
        (r"(?P<whole>[-+]?\d+)\.", "{key} needs a digit after its point; write {key} = {whole}.0"),
        (
            r"\d{1,2}[./]\d{1,2}[./]\d{2,4}",
            "{key} must be a day as year-month-day, such as 2026-05-04",
        ),
        ("True", "{key} must be true or false; write {key} = true"),
        ("False", "{key} must be true or false; write {key} = false"),
        (
            r"(?P<sign>[-+]?)0+(?P<whole>\d+(?:\.\d+)?)",
            "{key} begins with a 0; write {key} = {sign}{whole}",
        ),
        (
            r"(?P<number>[-+]?[\d.]+)\s*%",
            "{key} is in per cent; write {key} = {number}e-2",
        ),
        (
            r"(?P<number>[-+]?[\d.]+)\s*[^\W\d_][\w/]*",
            "{key} has its unit in its name; write {key} = {number}",
        ),
    )
)
_UNQUOTED: Final = re.compile(_KEY + r"([^\W\d][^\"'#,=\[\]{}]*?)" + _END)


def meant_line(lines: Sequence[str], message: str) -> str:
    """Say what to write in a line that is no TOML, where that can be told; else an empty text.

    >>> meant_line(["width_mm = 25,4"], "Expected newline")
    'width_mm has a decimal comma; write width_mm = 25.4; got 25,4'
    """
    line = lines[0].strip() if lines else ""
    if message.startswith("Cannot overwrite"):
        what = "[actuator] and [condition] are written [[actuator]] and [[condition]]"
        return f"{line.split('=')[0].strip()} is given twice; keep one" if "=" in line else what
    for form, words in _MEANT:
        if found := form.fullmatch(line):
            return words.format(**found.groupdict())
    found = _UNQUOTED.fullmatch(line)
    if found is None or found[2] in {"true", "false", "inf", "nan"}:
        return ""
    if found["key"].endswith(NUMBERS) and " " not in found[2]:
        return f'{found["key"]} must be a number, or a word in quotes, "{found[2]}"; got {found[2]}'
    return f'{found["key"]} has a text without quotes; write {found["key"]} = "{found[2]}"'
