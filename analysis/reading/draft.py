"""A proposed column map for external tables: what a word list and a check support, else FILL IN.

A column is proposed if names.toml lists its name for one of ours, and if its values are of the kind
that the name promises. A word is proposed if names.toml lists its meaning. If several columns pass,
or none does, the map has a line to fill in, with the columns and their values as a comment.
"""

from __future__ import annotations

import re
import tomllib
import unicodedata
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import chain, islice, product
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Final

import pandas as pd
from charset_normalizer import from_bytes

from analysis.reading.cells import NO, NOTHING, SILENT, YES, CellFault
from analysis.reading.columns import (
    COUNTED_COLUMNS,
    FILL_IN,
    OURS,
    SECTIONS,
    ColumnMap,
    File,
    format_key,
    toml_entry,
)
from analysis.reading.foreign import MAX_CONDITIONS, MAX_WORDS
from analysis.reading.sources import FILE, unreadable
from analysis.reading.text import (
    NUMBER,
    ResultFileError,
    named,
    one_line,
    text_chunks,
)
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.templates import open_templates

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Sequence

    from analysis.reading.sources import InputTable


_Value = str | float | list[str]
MAX_ROWS: Final = 5_000
"""Rows that are looked at in each file; fewer where they have very many columns."""
MAX_CELLS: Final = 1_000_000
MAX_ALL_CELLS: Final = 20_000_000
_MAX_WORDS: Final = 12
_MAX_SHOWN: Final = 8
_MAX_NAMED: Final = 5
_MAX_METRES: Final = 1e-3
_MAX_MEDIAN_S: Final = 10.0
_MIN_RUN: Final = 3
_MIN_NUMBERS: Final = 0.5
_ENCODING_BYTES: Final = 1_000_000
_BYTE_ORDER_MARKS: Final = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff", b"PK")
_LISTS: Final = tomllib.loads(Path(__file__).with_name("names.toml").read_text(encoding="utf-8"))
_PERSONS: Final = {*map("".join, product(*_LISTS["persons"].values()))}
NAMES: Final[dict[str, Collection[str]]] = _LISTS["columns"] | {
    "participant": _PERSONS | {*_LISTS["columns"]["participant"]},
    "level_vpp": {*map("".join, product(*_LISTS["levels"].values()))},
}
_MEANINGS: Final = {word: ours for ours, words in _LISTS["words"].items() for word in words}
_PRACTICE: Final = re.compile(
    f"(?<![a-z])({'|'.join(_LISTS['practice'])})(?![a-zà-ÿ])", re.IGNORECASE
)
_ORDER: Final = ["", *SECTIONS]
_CAMEL: Final = re.compile("(?<=[a-z])(?=[A-Z])|[_.]")
_CODE: Final = re.compile(r"-99+(\.0*)?", re.ASCII)


def _translate(ours: str, word: str) -> str:
    """Return our word for theirs, empty where no list has it."""
    key = word if NUMBER.fullmatch(word) else _plain(word)
    meaning = _MEANINGS.get(key, word)
    return meaning if meaning in OURS[ours].choices else ""


@dataclass(slots=True)
class _Draft:
    """A map by section and key, and the rows of the tables that are trials by it."""

    file: str
    rows: pd.DataFrame = field(default_factory=pd.DataFrame)
    entries: dict[str, dict[str, tuple[_Value, str]]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    sources: dict[str, str] = field(default_factory=dict)  # our columns, each with theirs

    def put(self, section: str, key: str, value: _Value, comment: str) -> None:
        self.entries.setdefault(section, {})[key] = (value, comment)

    def ask(
        self, section: str, key: str, request: str = "", names: Sequence[str] = (), **texts: object
    ) -> None:
        """Put a line to fill in, with the columns that may be meant and their first values."""
        text = _LISTS["requests"][request or key].format(**texts)
        self.put(section, key, "", f"{FILL_IN}: {text}{self.such_as(names)}")

    def take(self, ours: str, theirs: str, section: str = "columns") -> None:
        self.sources[ours] = theirs
        self.put(section, ours, theirs, f"guess; {_listed(self.rows[theirs])}")

    def skip(self, name: str, texts: list[str], why: str) -> None:
        self.put("rows.skip", name, texts if any(texts) else "", why)
        self.rows = self.rows[~self.rows[name].isin(texts)]

    def such_as(self, names: Sequence[str]) -> str:
        columns = [f"{one_line(name)} ({_listed(self.rows[name])})" for name in names[:_MAX_NAMED]]
        return f", such as {' or '.join(columns)}" if columns else ""

    def values(self, name: str) -> list[str]:
        """Return the different words of a column but those for nothing."""
        return [word for word in self.rows[name].unique() if word.lower() not in NOTHING]

    def numbers(self, name: str) -> list[float]:
        """Return the different numbers of a column but codes; propose the comma that they have."""
        texts = [w for w in self.values(name) if NUMBER.fullmatch(w) and not _CODE.fullmatch(w)]
        if any("," in word for word in texts):
            self.put("file", "decimal", ",", "guess: there are numbers with a comma")
        return [float(word.replace(",", ".")) for word in texts]

    def sites(self, name: str) -> set[str]:
        """Return the sites that a column names."""
        return {_translate("side", word) for word in self.values(name)} - {"", "none"}

    def says_detected(self, name: str) -> bool:
        """Return whether all words of a column say whether something was detected.

        Numbers do not: they may be those of keys or buttons.
        """
        meanings = {_translate("detected", word) for word in self.values(name)}
        return (
            "" not in meanings
            and not meanings.isdisjoint({YES, NO})
            and self.share_of_numbers(name) < 1
        )

    def matching(self, ours: str) -> list[str]:
        """Return the columns with a name and values of one of ours; it alone if it is there."""
        names = [name for name in self.rows.columns if _is_named(name, ours) and self.values(name)]
        names = [name for name in names if ours not in _KINDS or _KINDS[ours](self, name)]
        return [ours] if ours in names else names

    def share_of_numbers(self, name: str) -> float:
        """Return how many of the different values of a column are numbers, from 0 to 1."""
        values = self.values(name)
        return sum(1 for word in values if NUMBER.fullmatch(word)) / len(values)

    def may_be_people(self, name: str) -> bool:
        """Return whether a column may hold participants: no value for each row or stimulus."""
        values = self.values(name)
        if 2 * len(values) > len(self.rows) > _MIN_RUN:
            return False
        cells = self.rows[[FILE, name]]
        n_runs = cells.ne(cells.shift()).any(axis=1).sum()
        is_person = any(plain in _PERSONS for plain in _plain_names(name))
        return is_person or len(values) == 1 or len(cells) >= _MIN_RUN * n_runs


# What the values of a column must be like, besides its name; those of others are free.
_KINDS: Final[dict[str, Callable[[_Draft, str], bool]]] = {
    "participant": _Draft.may_be_people,
    "level_vpp": lambda draft, name: draft.share_of_numbers(name) >= _MIN_NUMBERS,
    "rt_s": lambda draft, name: draft.share_of_numbers(name) == 1,
    "trial": lambda draft, name: draft.share_of_numbers(name) == 1,
    "detected": lambda draft, name: all(_translate("detected", w) for w in draft.values(name)),
    "condition": lambda draft, name: len(draft.values(name)) <= MAX_CONDITIONS,
    "side": lambda draft, name: len(draft.values(name)) <= _MAX_WORDS,
}


def propose_map(sources: Sequence[InputTable]) -> tuple[str, list[str], list[str]]:
    """Return the text of a column map for tables, the keys to fill in, and notes on rows.

    Of a data set with several tasks the tables of the first are looked at. Raises ResultFileError
    for a table that cannot be read, where it is the only one.
    """
    draft = _Draft(str(sources[0].path))
    tasks = [*dict.fromkeys(source.about.get("task-", "") for source in sources)]
    if len(tasks) > 1:
        draft.put("rows.keep", "task-", tasks[0], f"guess; tasks here: {', '.join(tasks)}")
        sources = [source for source in sources if source.about.get("task-", "") == tasks[0]]
    try:
        tables, faults = _read_tables(sources, draft)
    except OSError as error:
        raise unreadable(error, sources[0].path) from None
    table = draft.rows = pd.concat(tables, ignore_index=True).fillna("")
    _propose_rows(draft)
    _propose_columns(draft)
    filters = [draft.entries.get(section, {}) for section in ("rows.keep", "rows.skip")]
    used = {*draft.sources.values(), *chain(*filters)}
    for cells in tables:
        if missing := [one_line(name) for name in table if name in used and name not in cells]:
            faults[cells[FILE].iloc[0]] = f"no column {named(missing)}"
    if faults:
        draft.skip(FILE, [*faults], "files that have no trials, or other columns")
        draft.notes += [f"file {one_line(s)} is left out: {fault}" for s, fault in faults.items()]
    if skipped := len(table) - len(draft.rows):
        names = ", ".join(map(one_line, chain(*filters)))
        draft.notes.append(f"{skipped} of {len(table)} rows skipped by [rows] {names}")
    # in the order of the reference; the words of each column have a section of their own
    sections = sorted(draft.entries.items(), key=lambda item: _ORDER.index(item[0].split(".")[0]))
    entries = [entry for _, section in sections for entry in section.items()]
    fill_in = [format_key(key) for key, (_, comment) in entries if comment.startswith(FILL_IN)]
    templates = open_templates(
        str(__package__), {"one_line": one_line, "entry": toml_entry, "words": _listed}
    )
    template = templates.get_template("map.toml.jinja")
    text = template.render(sources=sources, draft=draft, sections=sections, table=table)
    return text, fill_in, draft.notes


def _read_tables(
    sources: Sequence[InputTable], draft: _Draft
) -> tuple[list[pd.DataFrame], dict[str, str]]:
    """Return the first rows of each file, and by its stem why one cannot be read."""
    tables: list[pd.DataFrame] = []
    faults: dict[str, str] = {}
    columns = ColumnMap(file=File(encoding=_propose_encoding(sources, draft)))
    max_cells = min(MAX_CELLS, MAX_ALL_CELLS // len(sources))
    for source in sources:
        try:
            with source.path.open("rb") as stream:
                form = columns.text_format(source.path.suffix)
                header, chunks = text_chunks(stream, str(source.path), form=form)
                max_rows = min(MAX_ROWS, max_cells // len(header) + 1)
                rows = [*islice(chain.from_iterable(rows for _, rows in chunks), max_rows)]
        except ResultFileError as error:
            if len(sources) == len(faults) + 1:
                raise
            faults[source.about[FILE]] = error.message
            continue
        about = {name: [text] * len(rows) for name, text in source.about.items()}
        cells = about | dict(zip(header, zip(*rows, strict=True), strict=True))
        tables.append(pd.DataFrame({n: cells[n] for n in cells if n}, dtype=object))
    return tables, faults


def _propose_encoding(sources: Sequence[InputTable], draft: _Draft) -> str | None:
    """Return an encoding that can read a table that is not UTF-8, and ask for the right one."""
    for source in sources:
        with source.path.open("rb") as stream:
            start = stream.read(_ENCODING_BYTES)
        if start.startswith(_BYTE_ORDER_MARKS):
            continue
        if b"\0" in start and (likeliest := from_bytes(start).best()):
            draft.put("file", "encoding", likeliest.encoding, "guess: there is no byte order mark")
            return likeliest.encoding
        start = start[: start.rfind(b"\n") + 1] or start
        try:
            start.decode()
        except UnicodeDecodeError as error:
            line = start[start.rfind(b"\n", 0, error.start) + 1 :].splitlines()[0][:40]
            found = [match.encoding for match in [*from_bytes(start)][:3]]
            reads: dict[str, str] = {}
            for name in dict.fromkeys(["cp1252", *found]):
                with suppress(UnicodeDecodeError):
                    start.decode(name)
                    reads[name] = line.decode(name, "replace")
            reads = reads or {"latin-1": line.decode("latin-1")}
            texts = [f'"{name}" reads {one_line(text)}' for name, text in reads.items()]
            draft.ask("file", "encoding", reads="; ".join(texts))
            return next(iter(reads))
    return None


def _propose_rows(draft: _Draft) -> None:
    """Propose which rows are trials: those of a loop of PsychoPy, of a plugin of jsPsych."""
    if loop := _find_loop(draft):
        draft.skip(loop, [""], "guess: rows outside this loop")
    if {"trial_type", "time_elapsed", "rt"} <= {*draft.rows}:
        kinds = draft.rows["trial_type"]
        timed = kinds[_are_numbers(draft.rows["rt"])]
        plugin = (timed if len(timed) else kinds).value_counts().index[0]
        draft.put("rows.keep", "trial_type", plugin, f"guess; there are {_listed(kinds)}")
        draft.rows = draft.rows[kinds.eq(plugin)]
    for name in draft.rows.columns:
        texts = draft.rows[name].unique()
        if len(texts) > _MAX_WORDS or name.endswith(("-", ".thisN")):
            continue
        practice = [word for word in texts if _names_practice(word)]
        if _names_practice(name) and all(_translate("detected", word) for word in texts):
            practice = [word for word in texts if _translate("detected", word) == YES]
        # practice is the smaller number of rows, and a condition may be called training
        is_minority = 2 * draft.rows[name].isin(practice).sum() < len(draft.rows)
        if practice and is_minority and not _is_named(name, "condition"):
            draft.skip(name, practice, f"guess; there are {_listed(draft.rows[name])}")


def _names_practice(text: str) -> bool:
    return bool(_PRACTICE.search(_CAMEL.sub(" ", text)))


def _find_loop(draft: _Draft) -> str:
    """Return the innermost of PsychoPy's loops that has all trials; none where several have some.

    Trials are rows with a level outside the loops of practice.
    """
    rows = draft.rows
    loops = [name for name in rows.columns if name.endswith(".thisN")]
    practice = [name for name in loops if _names_practice(name)]
    levels = [name for name in rows.columns if loops and _is_named(name, "level_vpp")]
    has_level = rows[levels].apply(_are_numbers).any(axis=1)
    trials = rows[has_level & (rows[practice] == "").all(axis=1)]
    covering = [name for name in loops if name not in practice and trials[name].ne("").all()]
    if trials.empty or not covering:
        return ""
    loop = max(covering, key=lambda name: rows[name].ne(rows[name].shift()).sum())
    return loop if rows[loop].eq("").any() else ""


def _propose_columns(draft: _Draft) -> None:
    """Propose where our columns come from."""
    draft.entries["columns"] = {}
    counted = _propose_counts(draft)
    _propose_participant(draft)
    _propose_level(draft, counted=counted)
    _choose("session", draft)
    _choose("condition", draft)
    if counted:
        rows, used = draft.rows, draft.sources.values()
        key = [FILE, *(theirs for ours, theirs in draft.sources.items() if ours in COUNTED_COLUMNS)]
        names = [n for n in rows.columns if n not in used and 1 < len(draft.values(n)) <= MAX_WORDS]
        if names and rows.duplicated(key).any():
            draft.ask("columns", "condition", names=names)
    else:
        _propose_answer(draft)
        _propose_times(draft)
        _propose_trial(draft)
    for ours in COUNTED_COLUMNS if counted else OURS:
        if ours in draft.rows and ours not in {*draft.sources.values(), *draft.entries["columns"]}:
            texts = [word for word in draft.rows[ours].unique() if word]
            fault = ColumnMap().reader(ours).read(texts)
            if isinstance(fault, CellFault):
                unlike = one_line(texts[fault.row])
            elif texts and ours in _KINDS and not _KINDS[ours](draft, ours):
                unlike = f"{len(texts)} values"
            else:
                continue
            draft.put("columns", ours, "", f"left out: it has a name of tactstrip, but {unlike}")


def _propose_counts(draft: _Draft) -> bool:
    """Propose the columns of counts: hits of so many presented, or next to so many missed."""
    plain = {_plain(name): name for name in reversed(draft.rows.columns)}
    hits, *totals = (
        next((plain[name] for name in names if name in plain), "")
        for names in _LISTS["counts"].values()
    )
    for ours, total in zip(("presented", "missed"), totals, strict=True):
        pair = [hits, total]
        if "" in pair or hits == total or not draft.rows[pair].map(str.isdecimal).all(axis=None):
            continue
        k, n = (draft.rows[name].astype(float) for name in pair)
        if (ours == "missed" or k.le(n).all()) and n.max() > 1:
            draft.take("detected", hits, "table")
            draft.take(ours, total, "table")
            draft.ask("", "task")
            return True
    return False


def _propose_participant(draft: _Draft) -> None:
    """Propose the column of the participant, or the file's name; skip rows without one."""
    names = draft.matching("participant")
    pairs = [draft.rows[[names[0], name]].drop_duplicates() for name in names]
    if names and all(len(pair) == pair.nunique().min() for pair in pairs):
        draft.take("participant", names[0])
        if number := draft.rows[names[0]].eq("").sum():
            draft.skip(names[0], [""], f"guess: without a participant; number of rows: {number}")
    elif names or (len({*draft.rows[FILE]}) == 1 and "sub-" not in draft.rows):
        draft.ask("columns", "participant", names=names)
    elif "sub-" not in draft.rows:  # that is the participant in a data set of BIDS
        draft.put("columns", "participant", FILE, "guess: the name of the file")


def _propose_level(draft: _Draft, *, counted: bool) -> None:
    """Propose the column of levels, its axis and its words."""
    names = [name for name in draft.matching("level_vpp") if name not in draft.sources.values()]
    names = [name for name in names if len(draft.values(name)) > 1] or names
    if len(names) != 1:
        draft.ask("columns", "level_vpp", names=names)
        draft.ask("axis", "unit")
        return
    level = names[0]
    draft.take("level_vpp", level)
    silent = _propose_axis(level, draft)
    is_silent = {word: silent == "-inf" and word.lower() in SILENT for word in draft.rows[level]}
    missing = [w for w in is_silent if w.lower() in NOTHING and not is_silent[w]]
    without = draft.rows[draft.rows[level].isin(missing)]
    answers = [*draft.matching("response"), *draft.matching("detected")]
    is_answered = counted or ~without[answers].map(str.lower).isin(NOTHING).all(axis=None)
    if missing and not is_answered:
        draft.skip(level, missing, "guess: rows without a level and an answer")
    for word in draft.rows[level].unique():
        if is_silent[word] or (NUMBER.fullmatch(word) and not _CODE.fullmatch(word)):
            continue
        # where blank trials have a level, a missing one may be unknown
        is_blank = word in missing and silent not in is_silent
        if is_blank or _translate("side", word) == LEFT_RIGHT_BOTH.nothing:
            draft.put("values.level_vpp", word, silent, "guess: a blank trial")
        else:
            row = toml_entry(level, word)
            draft.ask("values.level_vpp", word, "level_word", silent=silent, row=row)


def _propose_axis(level: str, draft: _Draft) -> str:
    """Propose scale and unit of the levels; return the level of a blank trial."""
    plain, numbers = _plain(level), draft.numbers(level)
    unit = next((unit for end, unit in _LISTS["units"].items() if plain.endswith(end)), "")
    if unit == "dB":
        draft.put("axis", "x_scale", "dB", "guess, by the name: 0 is a level")
    elif min(numbers, default=0) < 0:
        draft.put("axis", "x_scale", "linear", 'guess: levels below 0; "dB" if they are in dB')
    silent = "-inf" if "axis" in draft.entries else "0"
    if not unit and plain.endswith("m") and max(numbers, default=1) < _MAX_METRES:
        draft.put("scale", "level_vpp", 1e6, "guess: the levels are metres")
        unit = "µm"
    if unit:
        draft.put("axis", "unit", unit, "guess, by the name")
    elif not plain.endswith("vpp"):  # V peak-to-peak need no unit
        draft.ask("axis", "unit")
    return silent


def _propose_answer(draft: _Draft) -> None:
    """Propose the columns of side and answer, their words, and the task.

    An answer says whether something was detected, or it names a site, which a column of sites or
    the answer "both" shows. A column of right and wrong answers does neither: it has 1 for a blank
    trial that was rightly not felt.
    """
    responses, hits, sides = map(draft.matching, ("response", "detected", "side"))
    sides = [name for name in sides if draft.sites(name)] or sides
    yes_no = [name for name in responses if draft.says_detected(name)]
    sites = [name for name in responses if draft.sites(name)]
    located = [name for name in sites if sides or "both" in draft.sites(name)]
    blanks = _blank_rows(draft)
    false_alarms = {
        name: sum(_translate("detected", word) == YES for word in blanks[name])
        for name in [*hits, *yes_no]
    }
    answers = yes_no + located
    if not responses:
        answers = [name for name in hits if 2 * false_alarms[name] <= len(blanks)]
    elif not (answers or hits or sites):
        answers = responses
    meanings = set[str]()
    if len(answers) != 1:
        draft.ask("columns", "response", names=[*responses, *hits])
    else:
        is_site = answers[0] not in false_alarms and (sides or located)
        meanings = _propose_words("response" if is_site else "detected", answers[0], draft)
    if LEFT_RIGHT_BOTH.nothing not in meanings:
        draft.ask("", "task")
    if len(sides) == 1 and any(false_alarms.get(name) for name in answers):
        draft.ask("constant", "side", "pooled_side")
        if "side" in draft.rows:
            draft.put("columns", "side", "", "left out: the constant below replaces it")
    elif len(sides) == 1:
        _propose_words("side", sides[0], draft)
    elif sides or located:
        draft.ask("columns", "side", names=sides)
    else:
        draft.ask("constant", "side", "only_side")


def _blank_rows(draft: _Draft) -> pd.DataFrame:
    """Return the rows without a level, or of level 0 where 0 is none; none without levels."""
    if "level_vpp" not in draft.sources:
        return draft.rows[:0]
    levels = draft.rows[draft.sources["level_vpp"]].str.replace(",", ".")
    numbers = pd.to_numeric(levels, errors="coerce")
    is_level = numbers.notna() & (numbers.ne(0) | ("x_scale" in draft.entries.get("axis", {})))
    return draft.rows[~is_level]


def _propose_words(ours: str, theirs: str, draft: _Draft) -> set[str]:
    """Propose a column and the meaning of each word, or a line to fill in. Return our words.

    A word for nothing is a time-out if its rows have no reaction time, where others have one. With
    a single other word it is not: that may be the key that is pressed if something is felt. Raises
    ResultFileError for many numbers in the place of answers: those of a method of adjustment.
    """
    draft.take(ours, theirs)
    numbers = draft.numbers(theirs)
    if len(numbers) > _MAX_WORDS and any(number % 1 for number in numbers):
        message = _LISTS["requests"]["settings"].format(name=one_line(theirs), n=len(numbers))
        raise ResultFileError(draft.file, None, message)
    times = draft.matching("rt_s") if ours != "side" else []
    timed = draft.rows[_are_numbers(draft.rows[times[0]])] if times else draft.rows
    meanings: dict[str, str] = {}
    for word in draft.rows[theirs].unique()[: 2 * _MAX_WORDS]:
        meanings[word] = _translate(ours, word)
        if word.lower() in NOTHING and word not in OURS[ours].choices and ours != "side":
            is_timeout = word not in {*timed[theirs]} and len(draft.values(theirs)) > 1
            meanings[word] = "timeout" if is_timeout else meanings[word] if times else ""
    is_unknown = any(not meanings[word] for word in meanings if word.lower() not in NOTHING)
    for word, meaning in meanings.items():
        # a letter means what it says among such letters only: l and r, not l, a and space
        if not meaning or (is_unknown and len(word) == 1):
            n_rows = draft.rows[theirs].eq(word).sum()
            draft.ask(f"values.{ours}", word, f"{ours}_word", rows=n_rows)
        elif meaning != word:
            skipped = "; counted as not detected, unless [rows.skip] leaves it out"
            comment = f"guess{skipped if meaning == 'timeout' else ''}"
            draft.put(f"values.{ours}", word, meaning, comment)
    return {*meanings.values()}


def _propose_times(draft: _Draft) -> None:
    times = _choose("rt_s", draft)
    if not times:
        return
    for word in draft.rows[times].unique():
        is_negative = NUMBER.fullmatch(word) and word.startswith("-")
        if is_negative or (word.lower() in NOTHING and word not in ("", "n/a")):
            draft.put("values.rt_s", word, "n/a", "guess")
    middle = median(draft.numbers(times))
    if "time_elapsed" in draft.rows or middle > _MAX_MEDIAN_S:
        why = f"the median is {middle:g}" if middle > _MAX_MEDIAN_S else "jsPsych writes ms"
        draft.put("units", "rt_s", "ms", f"guess: {why}")


def _propose_trial(draft: _Draft) -> None:
    """Propose the column that numbers the trials of a session, or the order of rows instead."""
    key = [FILE, *(draft.sources.get(ours, FILE) for ours in ("participant", "session"))]
    names = draft.matching("trial")
    numbering = [name for name in names if not draft.rows.duplicated([*key, name]).any()]
    if numbering:
        draft.take("trial", numbering[0])
    elif names:
        comment = "left out: the numbers repeat, so they show no order"
        draft.put("columns", "trial", "", comment)


def _choose(ours: str, draft: _Draft) -> str:
    """Propose the column of one of ours that no map needs; of several name all."""
    names = draft.matching(ours)
    if len(names) == 1:
        draft.take(ours, names[0])
        return names[0]
    if names:
        draft.notes.append(f"no column is proposed for {ours}; name one{draft.such_as(names)}")
    return ""


def _is_named(name: str, ours: str) -> bool:
    """Return whether a column has a name of ours; what the file's name says has none."""
    if name.endswith("-"):
        return False
    if ours == "level_vpp":
        *stem, unit = re.split("[^a-zμ]+", name.casefold().rstrip(")]"))
        if stem and unit in _LISTS["unit_endings"]:
            return True
    return any(plain in NAMES[ours] for plain in _plain_names(name))


def _are_numbers(cells: pd.Series[str]) -> pd.Series[bool]:
    return cells.str.fullmatch(NUMBER)


def _listed(cells: pd.Series[str]) -> str:
    """Return the first words of a column."""
    texts = cells.unique()
    listed = [one_line(word[:40]) or "empty" for word in texts[:_MAX_SHOWN]]
    return ", ".join(listed) + (", ..." if len(texts) > _MAX_SHOWN else "")


@lru_cache(maxsize=4096)
def _plain_names(name: str) -> tuple[str, str]:
    """Return the plain name of a column, whole and, as PsychoPy writes it, without its routine."""
    return _plain(name), _plain(name.rpartition(".")[2])


def _plain(name: str) -> str:
    """Return a name in small letters and digits, without accents and signs."""
    decomposed = unicodedata.normalize("NFKD", name.casefold())
    return "".join(c for c in decomposed if c.isalnum())
