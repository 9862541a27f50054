"""External tables: their columns and words to ours, by a column map; trials or counts."""

from __future__ import annotations

import io
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import pandas as pd

from analysis.reading.cells import BLANK_LEVEL, NO, YES, read_columns, refuse_first, text_frame
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
from analysis.reading.sources import STANDS_FOR
from analysis.reading.text import (
    NUMBER,
    TWICE,
    ResultFileError,
    named,
    one_line,
    shown,
    text_chunks,
)
from experiment.names import NOT_AVAILABLE
from experiment.record.rows import COLUMNS, KINDS, RESPONSES, SCHEMA, SIDES
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Mapping, Sequence

    from analysis.reading.columns import ColumnMap
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
_KIND_OF_SIDE: Final = {p.name: p.kind for p in LEFT_RIGHT_BOTH.presentations}
_NO_BLANKS: Final = (
    "and a forced choice has no trials without a stimulus; [rows.skip] of a map leaves them out"
)
_BOOKKEEPING: Final = ("direction", "label")
"""Columns of words of PsychoPy's staircases that follow from the trials: no conditions."""


@dataclass(frozen=True, slots=True)
class RowFilter:
    """Which rows are read: with one of the words in each column of keep, in none of skip.

    A name that ends in ``-`` is in the file's name (`analysis.reading.sources.read_name`); a file
    without it has empty text there. `values` has what stood in these columns so far, `left_out` how
    many rows each key leaves out.
    """

    keys: Mapping[str, tuple[str, tuple[str, ...], bool]]  # as `Rows.filters`
    values: dict[str, set[str]] = field(default_factory=lambda: defaultdict(set))
    left_out: Counter[str] = field(default_factory=Counter)

    def reads(self, about: Mapping[str, str]) -> bool:
        """Return whether any row is read of a file whose name says this."""
        keys = [key for key in self.keys.values() if key[0].endswith("-")]
        for name, _, _ in keys:
            self.values[name].add(about.get(name, ""))
        return all((about.get(name, "") in words) is is_kept for name, words, is_kept in keys)

    def select(self, texts: pd.DataFrame) -> pd.DataFrame:
        """Return the rows of a table that are read."""
        is_read = pd.Series(data=True, index=texts.index)
        for key, (name, words, is_kept) in self.keys.items():
            if name in texts:
                self.values[name].update(texts[name])
                is_passed = texts[name].isin(words).eq(is_kept)
                self.left_out[key] += int((is_read & ~is_passed).sum())
                is_read &= is_passed
        return texts[is_read]

    def refuse_unmet(self, file: str) -> None:
        """Refuse a word that stood in no row: it is misspelled, or of another data set.

        Empty text is accepted: a table may have no empty cell.
        """
        for key, (name, texts, _) in self.keys.items():
            values = self.values.get(name, set())
            for word in texts:
                if word and values and word not in values:
                    allowed = named([*map(shown, sorted(values))])
                    message = f"{key}: {shown(word)} does not occur, allowed {allowed}"
                    raise ResultFileError(file, None, message)

    def format_keys(self) -> str:
        """Return the keys; of several those that leave out rows, and how many."""
        keys = [*self.keys]
        if len(keys) > 1 and self.left_out.total():
            keys = [f"{key} ({number})" for key, number in self.left_out.items() if number]
        return " and ".join(keys)


@dataclass(frozen=True, slots=True)
class UnusedColumns:
    """Columns of words that the map leaves aside: they may be conditions.

    `partners` has by column and word the participant, level, site and answer in the same row.
    Several are one `...`, as is a column that the table does not have.
    """

    partners: dict[str, dict[str, list[Any]]] = field(default_factory=dict)

    def collect(self, texts: pd.DataFrame, taken: Mapping[str, str], used: Collection[str]) -> None:
        """Collect the words of columns that the map does not use, while they are few."""
        answer = "response" if "response" in taken else "detected"
        sources = [taken.get(o, "") for o in ("participant", "level_vpp", "side", answer)]
        beside = [texts[o] if o and o in texts else [...] * len(texts) for o in sources]
        for name in texts.columns:
            partners = self.partners.setdefault(name, {})
            if name in used or not name or name.endswith("-") or len(partners) > MAX_WORDS:
                continue
            for word, *values in {*zip(texts[name], *beside, strict=True)}:
                pairs = zip(partners.get(word, values), values, strict=True)
                partners[word] = [before if before == value else ... for before, value in pairs]
                if len(partners) > MAX_WORDS:
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
        for name in self.varying():
            partners = {word: beside for word, beside in self.partners[name].items() if word}
            people, *trial = zip(*partners.values(), strict=True)
            is_of_people = ... not in people and len({*people}) > 1
            is_of_trial = any(... not in values for values in trial)
            is_number = any(map(NUMBER.fullmatch, partners))
            is_bookkeeping = name.rpartition(".")[2].lower() in _BOOKKEEPING
            if not (is_of_people or is_of_trial or is_number or is_bookkeeping):
                names.append(one_line(name))
        return names


def find_columns(columns: ColumnMap, header: Sequence[str], file: str) -> dict[str, str]:
    """Return our columns that a table has, and its counts, each with the table's column.

    Raises ResultFileError where a column named by the map is missing, a constant contradicts a
    column of the table, a required column has no source, or ``response`` and ``detected`` have one.
    """
    mapped, table, counts = columns.named(), columns.table, columns.counts()
    keys = {theirs: f"[columns] {ours}" for ours, theirs in mapped.items()}
    keys |= dict.fromkeys((*counts.values(), *(table.group if table else ())), "[table]")
    keys |= {name: "[rows]" for name, _, _ in columns.rows.filters().values() if name[-1:] != "-"}
    for theirs, key in keys.items():
        if theirs not in header:
            message = f"no column {shown(theirs)}, named by {key}; it has {named(header)}"
            raise ResultFileError(file, 1, message)
    same = _find_same_columns(columns, header, file)
    available = {*same, *mapped, *columns.constant}
    if available >= {*ANSWERS}:
        message = "response and detected both hold the answer; name one of them in [columns]"
        raise ResultFileError(file, 1, message)
    if "detected" in available and not columns.task:
        raise ResultFileError(file, 1, TASK_MISSING)
    if available & {*ANSWERS}:
        available.add("response")
    required = COUNTED_REQUIRED if table else REQUIRED
    if missing := [name for name in required if name not in available]:
        message = f"no column {', '.join(missing)}; the map must say where it comes from"
        raise ResultFileError(file, 1, message)
    return same | mapped | counts


def _find_same_columns(columns: ColumnMap, header: Sequence[str], file: str) -> dict[str, str]:
    """Return our columns that need no entry, for the table or its file's name has them."""
    names = {*COUNTED_COLUMNS} if columns.table else {*OURS} - {"unanswered"}
    names -= columns.columns.keys()
    if columns.conditions():
        names.discard("condition")
    if columns.named().keys() & {*ANSWERS}:
        names -= {*ANSWERS}
    if columns.columns.get("detected") == "correct":
        names.discard("correct")  # its 0 and 1 are what was answered
    same = {}
    for name in (name for name in OURS if name in names):
        source = name if name in header else STANDS_FOR.get(name, "")
        is_twice = name + TWICE in header
        if is_twice or (name in header and name in columns.constant):
            fault = "twice" if is_twice else "next to a constant of the map"
            message = f'the header names column {name} {fault}; [columns] {name} = "" leaves it out'
            raise ResultFileError(file, 1, message)
        if source and source in header and name not in columns.constant:
            same[name] = source
    return same


def read_texts(
    raw: bytes, source: InputTable, columns: ColumnMap, rows: RowFilter, unused: UnusedColumns
) -> Iterator[pd.DataFrame]:
    """Yield the rows of a table that are read, as text under our names, by their lines.

    Raises ResultFileError as `text_chunks` and `find_columns`.
    """
    file = str(source.path)
    form = columns.text_format(source.path.suffix)
    header, chunks = text_chunks(io.BytesIO(raw), file, form=form)
    about = {name: word for name, word in source.about.items() if name not in header}
    taken = find_columns(columns, [*header, *about], file)
    conditions = columns.conditions()
    used = {*taken.values(), *conditions, *(name for name, _, _ in rows.keys.values())}
    for lines, cells in chunks:
        texts = text_frame(header, lines, cells)
        texts = texts.loc[:, ~texts.columns.duplicated()].assign(**about)
        texts = rows.select(texts)
        unused.collect(texts, taken, used)
        ours = texts[[*taken.values()]].set_axis([*taken], axis="columns")
        if conditions:
            values = texts[conditions].itertuples(index=False, name=None)
            pairs = (zip(conditions, row, strict=True) for row in values)
            ours["condition"] = [", ".join(map("=".join, row)) for row in pairs]
        yield ours.assign(**columns.constant)


def read_external(texts: pd.DataFrame, columns: ColumnMap) -> pd.DataFrame:
    """Read rows of an external table as trials or counts; what they lack gets its default.

    Without ``kind``, a level of 0 is a blank trial, whatever its side; where 0 is a level, as in
    dB, -inf is. Counts have ``detected`` and ``presented``.

    Raises ResultFileError for the first cell that cannot be read, and for a blank trial in a forced
    choice.
    """
    names = texts.columns.drop(["file", "line"])
    rows = read_columns(texts, [columns.reader(name) for name in names])
    level, blank_level = rows["level_vpp"], BLANK_LEVEL if columns.axis.signed else 0
    if "kind" not in rows:
        sides = rows["side"].astype(object) if "side" in rows else pd.Series("", index=rows.index)
        is_silent = level.eq(blank_level) & sides.ne(NO_STIMULUS)
        if columns.task == FORCED:
            refuse_first(rows, is_silent, f"the level is {blank_level}, {_NO_BLANKS}")
        sides = sides.mask(is_silent, NO_STIMULUS)
        kinds = sides.map(_KIND_OF_SIDE).fillna("single")
        rows["kind"] = pd.Categorical(kinds, categories=list(KINDS))
        if "side" in rows:
            rows["side"] = pd.Categorical(sides, categories=list(SIDES))
    rows["level_vpp"] = level.mask(level.eq(BLANK_LEVEL))
    if "missed" in rows:
        rows["presented"] = rows["detected"] + rows.pop("missed")
    if columns.table:
        return rows if "condition" in rows else rows.assign(condition=DEFAULTS["condition"])
    return _with_defaults(rows, columns)


def _with_defaults(rows: pd.DataFrame, columns: ColumnMap) -> pd.DataFrame:
    """Return trials with all columns of trials.csv.

    ``detected`` may stand in the place of ``response``, and ``trial`` is `UNNUMBERED` where the
    table does not number its trials. Where ``unanswered`` is true, the answer is ``timeout``. What
    the map says has no stimulus has no level, whatever is written there.
    """
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


def with_responses(rows: pd.DataFrame, columns: ColumnMap) -> pd.DataFrame:
    """Turn ``detected`` into the response that it means.

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
    detected, blank = answers.eq(YES), sides.eq(NO_STIMULUS)
    stimulated = sides.mask(blank).groupby(rows["file"])
    stimuli = ", ".join(sorted({*sides[~blank]})) or "no side"
    message = (
        f"column 'detected' holds '{YES}' in a blank trial, and the table has stimuli at "
        f"{stimuli}: which side was answered? Map response instead or, if participants "
        "answered only felt or not, one [constant] side for all rows in place of [columns] side"
    )
    is_unclear = detected & blank & stimulated.transform("nunique").ne(1)
    refuse_first(rows, is_unclear, message)
    answers = answers.mask(detected, sides.mask(blank, stimulated.transform("first")))
    return rows.assign(response=pd.Categorical(answers, categories=list(RESPONSES)))


CELL: Final = ["condition", "level_vpp", "participant"]
_UNKNOWN: Final = ("over_report", "mislocalised", "timeouts", "invalid")
"""What answers other than the right one were, counts do not say."""


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
    person = ["condition", "participant"]
    blanks = blank.groupby(person, as_index=False)[["detected", "presented"]].sum()
    blanks = blanks.rename(columns={"detected": "felt"}).assign(sides=1)
    if "side" in single:
        sides = single.groupby(person)["side"].nunique()
        blanks["sides"] = blanks.join(sides, on=person)["side"].fillna(1)
    return cells, blanks
