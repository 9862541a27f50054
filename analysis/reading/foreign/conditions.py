"""Which columns of tables made elsewhere may tell conditions apart."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from analysis.reading.foreign.sample import listed, plain, sample_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from analysis.reading.foreign.columns import ColumnMap
    from analysis.reading.foreign.sample import Sample
    from analysis.reading.sources import InputTable

MOST_FILES: Final = 40
"""Files that are looked at, for a guess or a remark."""
_MOST: Final = 6
_SIDE: Final = re.compile("left|right")
_NONE: Final = ("date", "time", "expname", "expstart", "psychopyversion", "corrans")


def may_be_conditions(table: Sample, known: Collection[str]) -> Iterator[tuple[str, list[str]]]:
    """Yield columns of a few words, each there twice or more, that are none of the known ones.

    Nor has a known one all of its words, as that of the answers has those of the right answers;
    nor do they only name sides, as files left.wav and right.wav.
    """
    taken = [{*table.words(name)} for name in known if name in table.header]
    for name in dict.fromkeys(table.header):
        words = table.words(name)
        few = 1 < len(words) <= _MOST and "" not in words and not name.endswith("-")
        if not few or min(words.values()) == 1 or table.numbers(name):
            continue
        sides = len({_SIDE.sub("", word.lower()) for word in words}) == 1
        if plain(name) not in _NONE and not sides and not any({*words} <= one for one in taken):
            yield name, [*words]


def pooled(sources: Sequence[InputTable], columns: ColumnMap) -> Iterator[str]:
    """Say which columns a map leaves aside that may be conditions, unless it names one or none."""
    if {"condition"} & {*columns.columns, *columns.constant}:
        return
    table = sample_of(sources[:MOST_FILES], columns.form, columns.filter)
    if "condition" in table.header:
        return
    known = {theirs for _, theirs in columns.sources(table.header, str(sources[0].path))}
    for name, words in may_be_conditions(table, known):
        yield (
            f"column {name} ({listed(words)}) is no condition here: its trials are analysed "
            f'together; [columns] condition = "{name}" compares them, condition = "" says that '
            "there is none"
        )
