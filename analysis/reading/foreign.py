"""External tables: their columns and words to ours, by a column map; trials or counts."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from itertools import compress
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

from analysis.reading.cells import BLANK_LEVEL, NO, YES, CellReader, read_columns
from analysis.reading.columns import (
    ANSWERS,
    COUNTED_COLUMNS,
    COUNTED_REQUIRED,
    FORCED,
    OURS,
    REQUIRED,
    TASK_MISSING,
    YES_NO,
)
from analysis.reading.sources import FILE, STANDS_FOR
from analysis.reading.text import (
    NUMBER,
    TWICE,
    ResultFileError,
    named,
    one_line,
    shown,
    text_chunks,
)
from experiment.rows import COLUMNS, KINDS, NOT_AVAILABLE, RESPONSES, SCHEMA, Column
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from analysis.reading.columns import ColumnMap, Rows
    from analysis.reading.sources import InputTable

    Texts = dict[str, list[str]]


# An external table that lacks one of these has this in every row; other absent columns: n/a.
DEFAULTS: Final[Mapping[str, str]] = MappingProxyType(
    {"schema": str(SCHEMA), "session": "01", "condition": "main", "onset_clock": "1"}
    | dict.fromkeys(("block", "attempt"), "1")
    | dict.fromkeys(("premature", "simulated"), "false")
    | {"status": "ok"}
)
UNNUMBERED: Final = -1
NO_STIMULUS: Final = next(p.name for p in LEFT_RIGHT_BOTH.presentations if not p.sites)
MAX_CONDITIONS: Final = 24
MAX_PRESENTED: Final = 10**12
"""Of a row of counts."""
MAX_WORDS: Final = 6
"""A column with more words than this does not look like a condition."""
_MAX_LISTED: Final = 8
_KIND_OF_SIDE: Final = {p.name: p.kind for p in LEFT_RIGHT_BOTH.presentations}
_FOLLOWING: Final = (
    "direction",
    "stepsize",
    "stepsizes",
    "thisrepn",
    "thisindex",
    "response",
    "label",
)
"""Columns of PsychoPy's staircases and loops that follow from the trials: no conditions."""


@dataclass(frozen=True, slots=True)
class RowFilter:
    """Which rows are read: with one of the words in each column of keep, in none of skip.

    A name that ends in ``-`` is in the file's name (`analysis.reading.sources.read_name`); a file
    without it has empty text there. `values` has what stood in these columns so far.
    """

    rows: Rows
    values: dict[str, set[str]] = field(default_factory=dict)

    def reads(self, about: Mapping[str, str]) -> bool:
        """Return whether any row is read of a file whose name says this."""
        tests = [test for test in self._tests() if test[1].endswith("-")]
        for _, name, _, _ in tests:
            self.values.setdefault(name, set()).add(about.get(name, ""))
        return all((about.get(name, "") in texts) is keep for _, name, texts, keep in tests)

    def select(
        self, cells: Mapping[str, Sequence[str]], number: int
    ) -> tuple[NDArray[np.bool_], Counter[str]]:
        """Return which rows are read, and how many each key leaves out."""
        selected = np.ones(number, dtype=np.bool_)
        left_out: Counter[str] = Counter()
        for key, name, texts, keep in self._tests():
            if name not in cells:
                continue
            self.values.setdefault(name, set()).update(cells[name])
            passes = np.array([(cell in texts) is keep for cell in cells[name]], dtype=np.bool_)
            if dropped := int((selected & ~passes).sum()):
                left_out[key] += dropped
            selected &= passes
        return selected, left_out

    def check_columns(self, header: Sequence[str], file: str) -> None:
        """Refuse a column that the table does not have."""
        for _, name, _, _ in self._tests():
            if name not in header and not name.endswith("-"):
                message = f"no column {shown(name)}, named by [rows]; it has {named(header)}"
                raise ResultFileError(file, 1, message)

    def refuse_unmet(self, file: str) -> None:
        """Refuse a word that stood in no row: it is misspelled, or of another data set.

        Empty text is accepted: a table may have no empty cell.
        """
        for key, name, texts, _ in self._tests():
            values = self.values.get(name, set())
            for word in texts:
                if word and values and word not in values:
                    listed = ", ".join(map(shown, sorted(values)[:_MAX_LISTED]))
                    more = ", ..." * (len(values) > _MAX_LISTED)
                    where = "is in no file's name" if name.endswith("-") else "stands in no row"
                    message = f"{key}: {shown(word)} {where}, allowed {listed}{more}"
                    raise ResultFileError(file, None, message)

    def format_keys(self, rows: Mapping[str, int] | None = None) -> str:
        """Return the keys; of several those that leave out `rows`, and how many."""
        keys = [key for key, _, _, _ in self._tests()]
        if rows and len(keys) > 1:
            keys = [f"{key} ({rows[key]})" for key in keys if rows.get(key)]
        return " and ".join(keys)

    def _tests(self) -> list[tuple[str, str, tuple[str, ...], bool]]:
        sections = (("keep", self.rows.keep, True), ("skip", self.rows.skip, False))
        return [
            (f"[rows.{section}] {name}", name, texts, keep)
            for section, columns, keep in sections
            for name, texts in columns.items()
        ]


@dataclass(frozen=True, slots=True)
class UnusedColumns:
    """Columns of words that the map leaves aside: they may be conditions.

    `partners` has by column and word the participant, level, site and answer beside it; several
    are one `...`, as is a column that the table does not have.
    """

    partners: dict[str, dict[str, list[Any]]] = field(default_factory=dict)

    def collect(
        self,
        cells: Mapping[str, Sequence[str]],
        taken: Mapping[str, str],
        used: set[str],
        selected: Sequence[bool] | NDArray[np.bool_],
    ) -> None:
        """Collect the words of columns that nobody uses, while they are few."""
        answer = "response" if "response" in taken else "detected"
        sources = [taken.get(o, "") for o in ("participant", "level_vpp", "side", answer)]
        beside: list[Sequence[Any]] = [cells.get(o, [...] * len(selected)) for o in sources]
        for name, column in cells.items():
            beside_word = self.partners.setdefault(name, {})
            if name in used or not name or name.endswith("-") or len(beside_word) > MAX_WORDS:
                continue
            for word, *values in {*compress(zip(column, *beside, strict=True), selected)}:
                before = beside_word.setdefault(word, values)
                beside_word[word] = [
                    a if a == b else ... for a, b in zip(before, values, strict=True)
                ]
                if len(beside_word) > MAX_WORDS:
                    break

    def varying(self) -> list[str]:
        """Return the columns with 2 to 6 values, be they words or numbers."""
        values = {name: {*partners} - {""} for name, partners in self.partners.items()}
        return [name for name, texts in values.items() if 1 < len(texts) <= MAX_WORDS]

    def names(self) -> list[str]:
        """Return the columns with 2 to 6 words, but those that only say the trial again.

        These are columns with one participant, level, site or answer for each word, and the
        bookkeeping of PsychoPy.
        """
        names = []
        for name, partners in self.partners.items():
            beside_word = {word: values for word, values in partners.items() if word}
            if not 1 < len(beside_word) <= MAX_WORDS or any(map(NUMBER.fullmatch, beside_word)):
                continue
            participants, *trial = zip(*beside_word.values(), strict=True)
            repeats = any(... not in values for values in trial) or (
                ... not in participants and len({*participants}) > 1
            )
            if not repeats and name.rpartition(".")[2].lower() not in _FOLLOWING:
                names.append(one_line(name))
        return names


def find_columns(columns: ColumnMap, header: Sequence[str], file: str) -> dict[str, str]:
    """Return our columns that a table has, each with the table's.

    Raises ResultFileError where a column named by the map is missing, a constant contradicts a
    column of the table, a required column has no source, or ``response`` and ``detected`` have one.
    """
    mapped = columns.named()
    for ours, theirs in mapped.items():
        if theirs not in header:
            has = named(header)
            message = f"no column {shown(theirs)}, named by the map for {ours}; it has {has}"
            raise ResultFileError(file, 1, message)
    same = {}
    for name in _unmapped(columns):
        leave_out = f'[columns] {name} = "" leaves it out'
        if name + TWICE in header:
            message = f"the header names column {name} twice; {leave_out}"
            raise ResultFileError(file, 1, message)
        if name in header and name in columns.constant:
            message = f"column {shown(name)} stands in the table, and the map has a constant"
            raise ResultFileError(file, 1, f"{message}; {leave_out}")
        if name in header:
            same[name] = name
        elif STANDS_FOR.get(name) in header and name not in columns.constant:
            same[name] = STANDS_FOR[name]
    if mapped.get("detected") == "correct":
        same.pop("correct", None)  # its 0 and 1 are what was answered
    return _with_one_answer(columns, same | mapped, file)


def _unmapped(columns: ColumnMap) -> list[str]:
    """Return our columns that need no entry where the table has them under our name."""
    names = [name for name in OURS if name != "unanswered"]
    if columns.table:
        names = [name for name in COUNTED_COLUMNS if name not in columns.conditions()]
    return [name for name in names if name not in columns.columns]


def _with_one_answer(columns: ColumnMap, sources: dict[str, str], file: str) -> dict[str, str]:
    """Return the columns with one answer; refuse two, or a required column without a source."""
    mapped = columns.named()
    if {*ANSWERS} <= {*sources, *columns.constant}:
        if not mapped.keys() & {*ANSWERS}:
            message = "response and detected both hold the answer; name one of them in [columns]"
            raise ResultFileError(file, 1, message)
        sources = {o: t for o, t in sources.items() if o not in ANSWERS or o in mapped}
    available = {*sources, *columns.constant}
    if "detected" in available:
        if not (columns.task or columns.table):
            raise ResultFileError(file, 1, TASK_MISSING)
        available.add("response")
    required = COUNTED_REQUIRED if columns.table else REQUIRED
    if missing := [name for name in required if name not in available]:
        message = f"no column {', '.join(missing)}; the map must say where it comes from"
        raise ResultFileError(file, 1, message)
    return sources


def read_texts(
    source: InputTable, columns: ColumnMap, rows: RowFilter, unused: UnusedColumns
) -> Iterator[tuple[Texts, list[int], Counter[str]]]:
    """Yield the rows of a table that are read, under our names, with their lines.

    The third is how many rows each key of the map leaves out. Raises ResultFileError as
    `text_chunks` and `find_columns`.
    """
    file = str(source.path)
    with source.path.open("rb") as stream:
        header, chunks = text_chunks(stream, file, form=columns.text_format(source.path.suffix))
        about = {name: word for name, word in source.about.items() if name not in header}
        names = [*header, *about]
        rows.check_columns(names, file)
        counts = _find_counts(columns, names, file)
        taken = find_columns(columns, names, file) | counts
        conditions = columns.conditions()
        used = {*taken.values(), *conditions, *columns.rows.keep, *columns.rows.skip}
        for lines, cells_of_rows in chunks:
            number = len(cells_of_rows)
            cells: dict[str, Sequence[str]] = dict(
                zip(header, zip(*cells_of_rows, strict=True), strict=True)
            )
            cells |= {name: [word] * number for name, word in about.items()}
            selected, left_out = rows.select(cells, number)
            unused.collect(cells, taken, used, selected)
            texts = {o: list(compress(cells[theirs], selected)) for o, theirs in taken.items()}
            kept = int(selected.sum())
            texts |= {ours: [word] * kept for ours, word in columns.constant.items()}
            if conditions:
                values = zip(*(compress(cells[name], selected) for name in conditions), strict=True)
                texts["condition"] = [
                    ", ".join(f"{n}={v}" for n, v in zip(conditions, row, strict=True))
                    for row in values
                ]
            yield texts, list(compress(lines, selected)), left_out


def _find_counts(columns: ColumnMap, header: Sequence[str], file: str) -> dict[str, str]:
    """Return the columns of counts by what they count."""
    if columns.table is None:
        return {}
    table = columns.table
    counts = {"presented": table.presented} if table.presented else {"missed": table.missed}
    counts = {"detected": table.detected} | counts
    for name in (*counts.values(), *table.group):
        if name not in header:
            message = f"no column {shown(name)}, named by [table]; it has {named(header)}"
            theirs = columns.columns.get(name, "")
            if theirs and theirs in header:
                message += f". [table] takes the table's own names, here {shown(theirs)}"
            raise ResultFileError(file, 1, message)
    return counts


def read_external(
    texts: Texts, columns: ColumnMap, files: Sequence[str], lines: Sequence[int]
) -> pd.DataFrame:
    """Read rows of an external table as trials; what it lacks gets its default.

    ``detected`` may stand in the place of ``response``, and ``trial`` is `UNNUMBERED` where the
    table does not number its trials. Where ``unanswered`` is true, the answer is ``timeout``.
    Without ``kind``, a level of 0 is a blank trial, whatever its side; where 0 is a level, as in
    dB, -inf is. What the map says has no stimulus has no level, whatever is written there.

    Raises ResultFileError for the first cell that cannot be read, and for a blank trial in a forced
    choice.
    """
    rows = read_columns(texts, [columns.reader(name) for name in texts], files, lines)
    silent, rows = without_blank_level(rows, columns)
    if "kind" not in rows:
        silent &= rows["side"].ne(NO_STIMULUS)
        if silent.any() and columns.task == FORCED:
            first = rows[silent].iloc[0]
            raise ResultFileError(first["file"], int(first["line"]), _no_blanks(columns))
        rows["side"] = rows["side"].mask(silent, NO_STIMULUS)
        kinds = rows["side"].astype(object).map(_KIND_OF_SIDE).fillna("single")
        rows["kind"] = pd.Categorical(kinds, categories=list(KINDS))
    for name in (column.name for column in COLUMNS):
        if name == "trial" and name not in rows:
            rows[name] = UNNUMBERED
        elif name not in rows and name != "response":
            default = columns.reader(name).read([DEFAULTS.get(name, NOT_AVAILABLE)])
            rows[name] = default.repeat(len(rows))
    says_none = NO_STIMULUS in columns.values.get("side", {}).values()  # noqa: PD011 (of a map)
    if "level_vpp" in columns.constant or says_none:
        rows["level_vpp"] = rows["level_vpp"].mask(rows["side"].eq(NO_STIMULUS))
    answer = "response" if "response" in rows else "detected"
    if "unanswered" in rows:
        rows.loc[rows.pop("unanswered"), answer] = "timeout"
    rows["rt_s"] = rows["rt_s"].mask(rows[answer].eq("timeout"))
    return rows


def without_blank_level(
    rows: pd.DataFrame, columns: ColumnMap
) -> tuple[pd.Series[bool], pd.DataFrame]:
    """Return which rows have the level of no stimulus, 0 or -inf, and the rows without -inf."""
    level = rows["level_vpp"]
    silent = level.eq(BLANK_LEVEL if columns.axis.signed else 0)
    return silent, rows.assign(level_vpp=level.mask(level.eq(BLANK_LEVEL)))


def _no_blanks(columns: ColumnMap) -> str:
    signed = columns.axis.signed
    scale = "" if signed else ', [axis] x_scale = "dB" or "linear" takes 0 for a level'
    return (
        f"the level is {BLANK_LEVEL if signed else 0}, and a forced choice has no trials without a "
        f"stimulus; [rows.skip] of a map leaves them out{scale}"
    )


def with_responses(rows: pd.DataFrame, columns: ColumnMap) -> pd.DataFrame:
    """Turn ``detected`` into the response it stands for.

    A detected stimulus was answered with its side, a missed one with ``none`` or, in a forced
    choice, with the other side. A blank trial has no side: a felt one counts for the only side at
    which its file has stimuli.

    Raises ResultFileError for a felt blank trial in a file with stimuli at several sides.
    """
    if "response" in rows:
        return rows
    sides = rows["side"].astype(object)
    missed: Any = LEFT_RIGHT_BOTH.nothing
    if columns.task == FORCED:
        missed = sides.map(LEFT_RIGHT_BOTH.reversed_mapping)
    answers = rows["detected"].astype(object)
    answers = answers.mask(answers.eq(NO), missed)
    detected = answers.eq(YES)
    blanks = rows.loc[detected & sides.eq(NO_STIMULUS), ["file", "line"]].drop_duplicates("file")
    only_side: dict[str, str] = {}
    for file, line in blanks.itertuples(index=False):
        stimulated = sorted({*sides[rows["file"].eq(file)]} - {NO_STIMULUS})
        if len(stimulated) != 1:
            message = (
                f"column 'detected' holds '{YES}' in a blank trial, and the table has stimuli at "
                f"{', '.join(stimulated) or 'no side'}: which side was answered? Map response "
                "instead or, where only felt or not was asked, one [constant] side for all rows in "
                "place of [columns] side"
            )
            raise ResultFileError(file, int(line), message)
        only_side[file] = stimulated[0]
    at_blank = detected & sides.eq(NO_STIMULUS)
    answers = answers.mask(detected, sides.mask(at_blank, rows["file"].map(only_side)))
    return rows.assign(response=pd.Categorical(answers, categories=list(RESPONSES)))


CELL: Final = ["condition", "level_vpp", "participant"]
_UNKNOWN: Final = ("over_report", "mislocalised", "timeouts", "invalid")
"""What answers other than the right one were, counts do not say."""


def read_count_rows(
    texts: Texts, columns: ColumnMap, files: Sequence[str], lines: Sequence[int]
) -> pd.DataFrame:
    """Read rows of a table of counts, with ``kind``, ``detected`` and ``presented``."""
    readers = []
    table = columns.table
    assert table is not None
    for name in texts:
        if name in ("detected", "presented", "missed"):
            column = Column(name=name, type="int", optional=False, choices=(), description="")
            readers.append(CellReader(column=column, label=getattr(table, name)))
        else:
            readers.append(columns.reader(name))
    rows = read_columns(texts, readers, files, lines)
    if "missed" in rows:
        rows["presented"] = rows["detected"] + rows.pop("missed")
    if "condition" not in rows:
        rows["condition"] = DEFAULTS["condition"]
    silent, rows = without_blank_level(rows, columns)
    if "kind" not in rows:
        blank = rows["side"].eq(NO_STIMULUS) if "side" in rows else False
        rows["kind"] = np.where(blank | silent, "blank", "single")
    return rows


def sum_counts(rows: pd.DataFrame, columns: ColumnMap) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the cells and the blanks of tables of counts, summed over sessions, sides and blocks.

    The cells have one row per condition, level and participant, as `analysis.counts.detection`
    gives them; what counts do not say is NaN. The blanks have ``felt`` of ``presented``, and among
    how many ``sides`` an answer had to choose.
    """
    rows = rows[rows["presented"].gt(0)]
    single, blank = rows[rows["kind"].eq("single")], rows[rows["kind"].eq("blank")]
    cells = single.groupby(CELL, as_index=False)[["detected", "presented"]].sum()
    cells = cells.assign(
        **dict.fromkeys(_UNKNOWN, float("nan")), none_offered=columns.task == YES_NO
    )
    key = ["condition", "participant"]
    false_alarms = blank.groupby(key, as_index=False)[["detected", "presented"]].sum()
    sides: Any = 1
    if "side" in single:
        several = single.groupby(key)["side"].nunique()
        sides = false_alarms.merge(several, "left", key)["side"].fillna(1)
    return cells, false_alarms.rename(columns={"detected": "felt"}).assign(sides=sides)


def refuse_repeated_counts(rows: pd.DataFrame, aside: Sequence[str]) -> None:
    """Refuse counts of one cell in two files, or in rows that a column left aside distinguishes.

    Other rows of one cell are blocks, which are summed.
    """
    key = [name for name in COUNTED_COLUMNS if name in rows]
    rows = rows if aside else rows.drop_duplicates(["file", *key])
    repeated = rows.duplicated(key)
    if not repeated.any():
        return
    second = rows[repeated].iloc[0]
    cells = rows.groupby(key, dropna=False, observed=True).ngroup()
    first = rows[cells.eq(cells[repeated].iloc[0])].iloc[0]
    cell = ", ".join(f"{name} {second[name]}" for name in key)
    message = f"{cell}: counted already at {first['file']}:{first['line']}"
    if first["file"] != second["file"]:
        message += f'; if the files are of two people, [columns] participant = "{FILE}"'
    elif aside:
        message += (
            f'; if {named(aside)} is a condition, the map needs [table] group = ["{aside[0]}"], if '
            f'it numbers blocks, [columns] session = "{aside[0]}"'
        )
    raise ResultFileError(second["file"], int(second["line"]), message)
