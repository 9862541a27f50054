"""Some rows of tables made elsewhere, from which a map is drafted, and what stands in a column."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

from analysis.reading.cells import NOTHING
from analysis.reading.foreign.files import FILE
from analysis.reading.foreign.form import foreign_chunks, toml_entry
from analysis.reading.sources import unreadable
from analysis.reading.text import one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from analysis.reading.foreign.form import RowFilter
    from analysis.reading.sources import InputTable
    from analysis.reading.text import TextFormat


NUMBER: Final = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_PADDED: Final = re.compile(r"0\d")
_SHOWN: Final = 8
_LONG: Final = 60
_OF_FILE: Final = "; the name of the file without its ending, to be used like a column"
FILL: Final = "FILL IN: "
EMPTY: Final = "empty"
"""What stands in a column without a value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """Some rows of some tables under one heading."""

    header: list[str]
    rows: list[list[str]]

    def words(self, name: str) -> Counter[str]:
        """Count the words of a column."""
        place = self.header.index(name)
        return Counter(row[place] for row in self.rows)

    def numbers(self, name: str) -> list[float] | None:
        """Return the numbers of a column that has nothing else; of an empty one none."""
        words = [word for word in self.words(name).elements() if word.lower() not in NOTHING]
        if not words or not all(NUMBER.fullmatch(word) for word in words):
            return None
        return [float_of(word) for word in words]

    def named(self, names: Sequence[str]) -> Iterator[str]:
        """Yield the columns that have one of the names, of PsychoPy's their last part."""
        for name in names:
            for column in self.header:
                called = {plain(column), plain(column.rpartition(".")[2])}
                if name in called and any(word not in NOTHING for word in self.words(column)):
                    yield column

    def called(self, names: Sequence[str]) -> str | None:
        """Return the first of these."""
        return next(self.named(names), None)

    def without(self, name: str, word: str) -> Sample:
        """Leave out the rows that have a word in a column."""
        place = self.header.index(name)
        return Sample(header=self.header, rows=[row for row in self.rows if row[place] != word])

    def changes(self, name: str) -> int:
        """Count the rows that differ from the one above: most in the innermost of nested loops."""
        place = self.header.index(name)
        return sum(one[place] != other[place] for one, other in pairwise(self.rows))

    def of(self, names: Sequence[str], other: str) -> Iterator[tuple[tuple[str, ...], str]]:
        """Yield what each row has in some columns, and in another."""
        *places, at = (self.header.index(name) for name in (*names, other))
        return ((tuple([row[place] for place in places]), row[at]) for row in self.rows)

    def unique(self, name: str, within: Sequence[str]) -> bool:
        """Tell whether no two rows that agree in the columns `within` agree in this one.

        >>> rows = [["1", "0"], ["1", "1"], ["2", "0"]]
        >>> sample = Sample(header=["person", "n"], rows=rows)
        >>> sample.unique("n", ["person"]), sample.unique("n", [])
        (True, False)
        """
        places = [self.header.index(one) for one in (*within, name)]
        return len({tuple([row[at] for at in places]) for row in self.rows}) == len(self.rows)


def sample_of(
    sources: Sequence[InputTable], form: Callable[[str], TextFormat], rows: RowFilter
) -> Sample:
    """Read the first rows of those tables that have the heading of the first; `form` by suffix."""
    header: list[str] = []
    found: list[list[str]] = []
    for source in sources:
        try:
            with source.path.open("rb") as stream:
                own, chunks = foreign_chunks(
                    stream,
                    str(source.path),
                    form=form(source.path.suffix),
                    rows=rows,
                    about=source.about,
                )
                header = header or own
                if own == header:
                    found += next(chunks)[0][1]
        except OSError as error:
            raise unreadable(error, source.path) from None
    return Sample(header=header, rows=found)


def float_of(word: str) -> float:
    """Return the number that a word is, also with a decimal comma.

    >>> float_of("0,5")
    0.5
    """
    return float(word.replace(",", "."))


def plain(name: str) -> str:
    """Return the small letters, without accents, and the digits of a name.

    >>> plain("Trial No."), plain("Réponse")
    ('trialno', 'reponse')
    """
    return re.sub("[^a-z0-9]", "", unicodedata.normalize("NFKD", name.lower()))


def told_of(sample: Sample, name: str) -> str:
    """Say what stands in a column.

    >>> sample = Sample(header=["rt"], rows=[["0.5"], ["0.25"], [""]])
    >>> told_of(sample, "rt")
    '2 values: 0.25, 0.5; and empty cells'
    """
    words = sample.words(name)
    values = [word for word in words if word]
    empty = "; and empty cells" if "" in words else ""
    if not values:
        return EMPTY
    numbers = sample.numbers(name)
    if numbers and len(values) > _SHOWN and not any(map(_PADDED.match, values)):
        others = [word for word in values if not NUMBER.fullmatch(word)]
        told = f"{len(values) - len(others)} values from {min(numbers):g} to {max(numbers):g}"
        return "; and ".join([told, *map(one_line, others)]) + empty
    if all(map(NUMBER.fullmatch, values)):
        values.sort(key=float_of)
    return f"{len(values)} value{'s'[: len(values) != 1]}: {listed(values)}{empty}"


def columns_told(table: Sample, looked_at: Sample) -> Iterator[str]:
    """Say what stands in each column, of the rows that are read."""
    for name in dict.fromkeys(table.header):
        if name:
            told = told_of(table, name)
            read = " in the rows that are read" * (EMPTY == told != told_of(looked_at, name))
            yield f"{one_line(name)}: {told}{read}{_OF_FILE * (name == FILE)}"


def unanswered(table: Sample, name: str, word: str) -> str:
    """Say how many rows have no answer, what they count for, and how to leave them out."""
    skip = toml_entry(name, word)
    rows = table.words(name)[word]
    return (
        f": {rows} row{'s' * (rows != 1)}, counted as not detected: say so in a paper; to leave "
        f"them out, write {skip} below [rows.skip]"
    )


def _cut(word: str) -> str:
    """Return the beginning of a word that is too long, marked as one."""
    return word if len(word) <= _LONG else f"{word[: _LONG - 3]}..."


def listed(words: Sequence[str]) -> str:
    """Name the first of several words.

    >>> listed(["a", ""]), listed("abcdefghijk")
    ('a, (empty)', 'a, b, c, d, e, f, g, h, ...')
    >>> listed(["a" * 60, "a" * 61]).endswith("aaa, " + "a" * 57 + "...")
    True
    """
    told = [_cut(one_line(word)) if word else "(empty)" for word in words[:_SHOWN]]
    return ", ".join(told) + (", ..." if len(words) > _SHOWN else "")
