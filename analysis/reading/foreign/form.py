"""How a table made elsewhere is written, and which of its rows are read: [file] and [rows]."""

from __future__ import annotations

import codecs
import json
import re
import tomllib
from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, BinaryIO, Final

from analysis.reading.sources import unreadable
from analysis.reading.text import (
    DELIMITERS,
    TWICE,
    ResultFileError,
    TextFormat,
    one_line,
    shown,
    text_chunks,
)
from experiment.bounded import parse_toml

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping
    from pathlib import Path

    from analysis.reading.text import Chunk


FILE_KEYS: Final = ("delimiter", "decimal", "encoding")
DECIMALS: Final = (".", ",")
_DELIMITER_OF: Final = {".tsv": "\t"}
_MOST_TOLD: Final = 8
_LOOKED_AT: Final = 2**20
_UTF_16: Final = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF32_BE)
_LONGEST_WORD: Final = 60


_BARE_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")
_SECTION: Final = re.compile(r"\s*\[([a-z._]+)\]\s*[^\s#]")
"""A section's name with more behind it than a comment."""
_BARE: Final = re.compile(r"\s*([^=#]+?)\s*=\s*((?:[^\W\d_][^#\"']*?)?)\s*(?:#.*)?")
"""A key of TOML with a word, or nothing, in the place of its value."""


def toml_document(text: str) -> dict[str, Any]:
    """Read a map's text; say what a word without quotation marks, or a section's line, needs.

    >>> toml_document("task = yes")
    Traceback (most recent call last):
    ValueError: Invalid value (at line 1, column 8); task: text needs quotation marks, task = "yes"
    >>> toml_document('[values.side] l = "left"')  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ValueError: Expected ...; [values.side] stands on a line of its own, what is in it below
    """
    try:
        return parse_toml(text)
    except tomllib.TOMLDecodeError as error:
        at = re.search(r"at line (\d+)", str(error))
        if at and (found := _SECTION.match(text.split("\n")[int(at[1]) - 1])):
            message = f"{error}; [{one_line(found[1])}] stands on a line of its own, what is in it"
            raise ValueError(f"{message} below") from None
        place = re.search(r"Invalid value \(at (?:line (\d+)|end)", str(error))
        line = text.split("\n")[int(place[1] or 0) - 1].rstrip("\r") if place else ""
        if not (found := _BARE.fullmatch(line)):
            raise
        key, value = one_line(found[1]), one_line(found[2][:_LONGEST_WORD]) or "..."
        message = f'{error}; {key}: text needs quotation marks, {key} = "{value}"'
        raise ValueError(message) from None


def toml_entry(key: str, value: str | list[str], comment: str = "") -> str:
    """Write a key of TOML with its value and a comment, if there is one.

    >>> print(toml_entry("resp.keys", "None", "guess"))
    "resp.keys" = "None"  # guess
    """
    name = key if _BARE_KEY.fullmatch(key) else _quoted(key)
    return f"{name} = {_quoted(value)}" + f"  # {comment}" * bool(comment)


def _quoted(value: str | list[str]) -> str:
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def check_file(section: Mapping[str, Any]) -> None:
    """Refuse what a map's section ``[file]`` cannot say.

    >>> check_file({"delimiter": ";", "decimal": ","})
    >>> check_file({"decimal": ";"})
    Traceback (most recent call last):
    ValueError: [file] decimal: allowed '.', ',', got ';'
    """
    choices = {"delimiter": tuple(DELIMITERS), "decimal": DECIMALS}
    for key, value in section.items():
        if key not in FILE_KEYS:
            raise ValueError(f"[file] {key}: allowed {', '.join(FILE_KEYS)}")
        if key in choices and value not in choices[key]:
            allowed = ", ".join(map(repr, choices[key]))
            raise ValueError(f"[file] {key}: allowed {allowed}, got {value!r}")
        if key == "encoding" and not _is_encoding(value):
            raise ValueError(
                f'[file] encoding: must name one, such as "cp1252" or "utf-16", got {value!r}'
            )
    if section.get("delimiter") == section.get("decimal", "."):
        raise ValueError("[file] delimiter: must be another sign than decimal")


def _is_encoding(name: object) -> bool:
    try:
        return isinstance(name, str) and "".encode(name) is not None
    except (LookupError, ValueError):
        return False


def text_format(section: Mapping[str, str], suffix: str) -> TextFormat:
    r"""Return how a file with this ending is written; one that ends in .tsv has tabs.

    >>> text_format({"decimal": ","}, ".tsv").delimiter
    '\t'
    """
    delimiter = section.get("delimiter", _DELIMITER_OF.get(suffix.lower(), ""))
    return TextFormat(delimiter=delimiter, encoding=section.get("encoding", ""))


@dataclass(frozen=True, slots=True, kw_only=True)
class RowFilter:
    """Which rows are read: with one of the words in each column of `keep`, in none of `skip`.

    A name that ends in ``-`` is told by the file's name (`analysis.reading.foreign.files.about`); a
    file that does not tell it has empty text there. `met` has what stood in these columns so far.

    >>> leaves_out = RowFilter(skip={"trials.thisN": ("",)}).rule(["trials.thisN"], "t.csv")
    >>> leaves_out(["0"]), leaves_out([""])
    ('', '[rows.skip] trials.thisN')
    """

    keep: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    skip: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    met: dict[str, set[str]] = field(default_factory=dict)

    def reads(self, about: Mapping[str, str]) -> bool:
        """Tell whether any row is read of a file whose name tells this."""
        tests = [one for one in self._tests() if one[0].endswith("-")]
        for name, _, _ in tests:
            self.met.setdefault(name, set()).add(about.get(name, ""))
        return all((about.get(name, "") in words) is wanted for name, words, wanted in tests)

    def rule(self, header: list[str], file: str) -> Callable[[list[str]], str]:
        """Return what names the key that leaves out a row, the first; empty text for one to read.

        Raises ResultFileError for a column that the table does not have.
        """
        tests = []
        for key, (name, words, wanted) in zip(self._keys(), self._tests(), strict=True):
            if name in header:
                tests.append((key, header.index(name), words, wanted))
            elif not name.endswith("-"):
                message = f"no column {shown(name)}, named by [rows]; it has {', '.join(header)}"
                raise ResultFileError(file, 1, message)
        met = [(at, self.met.setdefault(header[at], set())) for _, at, _, _ in tests]

        def leaves_out(row: list[str]) -> str:
            for at, words in met:
                words.add(row[at])
            for key, at, allowed, wanted in tests:
                if (row[at] in allowed) is not wanted:
                    return key
            return ""

        return leaves_out

    def refuse_unmet(self, file: str) -> None:
        """Refuse a word that stood in no row so far: it is misspelled, or of another data set.

        Empty text is none: a table may have no empty cell.

        >>> kept = RowFilter(skip={"phase": ("practise",)}, met={"phase": {"practice", "main"}})
        >>> kept.refuse_unmet("t.csv")
        Traceback (most recent call last):
        analysis.reading.text.ResultFileError: t.csv: [rows.skip] phase: 'practise' stands in no
        row, allowed 'main', 'practice'
        """
        for key, (name, words, _) in zip(self._keys(), self._tests(), strict=True):
            met = self.met.get(name, set())
            for word in words:
                if word and word not in met and met:
                    there = sorted(met)[:_MOST_TOLD]
                    more = ", ..." * (len(met) > len(there))
                    what = "is told by no file's name" if name.endswith("-") else "stands in no row"
                    message = (
                        f"{key}: {shown(word)} {what}, allowed {', '.join(map(shown, there))}{more}"
                    )
                    raise ResultFileError(file, None, message)

    def told(self, rows: Mapping[str, int] | None = None) -> str:
        """Name the keys, for what is said of the `rows` that they leave out, if several do so.

        >>> kept = RowFilter(keep={"phase": ("main",)}, skip={"n": ("",)})
        >>> kept.told()
        '[rows.keep] phase and [rows.skip] n'
        >>> kept.told({"[rows.skip] n": 22, "[rows.keep] phase": 44})
        '[rows.keep] phase (44) and [rows.skip] n (22)'
        """
        keys = self._keys()
        if rows and len(keys) > 1:
            keys = [f"{key} ({rows[key]})" for key in keys if rows.get(key)]
        return " and ".join(keys)

    def _keys(self) -> list[str]:
        return [
            f"[rows.{section}] {name}"
            for section, columns in (("keep", self.keep), ("skip", self.skip))
            for name in columns
        ]

    def _tests(self) -> Iterator[tuple[str, tuple[str, ...], bool]]:
        for section, wanted in ((self.keep, True), (self.skip, False)):
            for name, words in section.items():
                yield name, words, wanted


def row_filter(section: Mapping[str, Any]) -> RowFilter:
    """Return what a map's section ``[rows]`` says.

    >>> row_filter({"keep": {"phase": "main"}}).keep
    {'phase': ('main',)}
    >>> row_filter({"drop": {}})
    Traceback (most recent call last):
    ValueError: [rows.drop] is not known, allowed [rows.keep] and [rows.skip]
    """
    told: dict[str, dict[str, tuple[str, ...]]] = {}
    for which, columns in section.items():
        if which not in ("keep", "skip"):
            raise ValueError(f"[rows.{which}] is not known, allowed [rows.keep] and [rows.skip]")
        if not hasattr(columns, "items"):
            raise ValueError(f'[rows.{which}] must be a table of "column" = "word", got {columns}')
        told[which] = {}
        for name, given in columns.items():
            words = (given,) if isinstance(given, str) else given
            if type(words) not in (list, tuple) or not all(isinstance(w, str) for w in words):
                raise ValueError(
                    f"[rows.{which}] {name}: must be text in quotation marks or a list of it, "
                    f"got {given!r}"
                )
            told[which][name] = tuple(words)
    return RowFilter(keep=told.get("keep", {}), skip=told.get("skip", {}))


def refuse_doubled(header: list[str], ours: list[str], file: str) -> None:
    """Refuse a heading that has a name of ours more than once, where a map does not help.

    >>> refuse_doubled(["side (twice)", "rt", "side (twice)"], ["rt"], "t.csv")
    """
    for name in ours:
        if name + TWICE in header:
            message = f'the header names column {name} twice; [columns] {name} = "" leaves it out'
            raise ResultFileError(file, 1, message)


def foreign_chunks(
    stream: BinaryIO,
    file: str,
    *,
    form: TextFormat,
    rows: RowFilter,
    about: Mapping[str, str],
) -> tuple[list[str], Iterator[tuple[Chunk, Counter[str]]]]:
    """Read a table made elsewhere, with what its name tells as further columns.

    Each chunk comes with how many rows each key of `rows` leaves out of it. Raises ResultFileError
    as `text_chunks` and `RowFilter.rule`.
    """
    header, chunks = text_chunks(stream, file, form=form)
    told = {name: word for name, word in about.items() if name not in header}
    header = [*header, *told]
    return header, _kept(chunks, [*told.values()], rows.rule(header, file))


def _kept(
    chunks: Iterator[Chunk], told: list[str], leaves_out: Callable[[list[str]], str]
) -> Iterator[tuple[Chunk, Counter[str]]]:
    for lines, rows in chunks:
        whole = [(line, [*row, *told]) for line, row in zip(lines, rows, strict=True)]
        by = [leaves_out(row) for _, row in whole]
        kept = [one for one, key in zip(whole, by, strict=True) if not key]
        out = Counter(key for key in by if key)
        yield ([line for line, _ in kept], [row for _, row in kept]), out


def guessed_encoding(paths: Iterable[Path]) -> str:
    """Guess what tables are in that are not UTF-8: what a spreadsheet in Western Europe writes.

    >>> guessed_encoding([])
    ''
    """
    for path in paths:
        try:
            with path.open("rb") as stream:
                start = stream.read(_LOOKED_AT)
        except OSError as error:
            raise unreadable(error, path) from None
        if start.startswith(_UTF_16):
            return ""
        try:
            codecs.getincrementaldecoder("utf-8")().decode(start)
        except UnicodeDecodeError:
            return "cp1252"
    return ""
