"""A proposed column map for external tables: what a word list and a check support, else FILL IN."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections import Counter
from dataclasses import dataclass, field
from itertools import compress, groupby, product
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Final

from charset_normalizer import from_bytes

from analysis.reading.cells import NO, NOTHING, SILENT, TRUTHS, YES
from analysis.reading.columns import FILL_IN, FORCED, YES_NO, ColumnMap, File, toml_entry
from analysis.reading.foreign import MAX_CONDITIONS, MAX_WORDS, UnusedColumns
from analysis.reading.sources import FILE, STANDS_FOR, unreadable
from analysis.reading.text import (
    NUMBER,
    ResultFileError,
    guess_unmarked_utf_16,
    named,
    one_line,
    text_chunks,
)
from experiment.rows import COLUMNS
from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from analysis.reading.sources import InputTable


NOTE: Final = "# Note: "
"""How a line of a proposed map begins that says what becomes of rows and columns."""
MAX_ROWS: Final = 5_000
"""Rows that are looked at in each file; fewer where they have very many columns."""
MAX_CELLS: Final = 1_000_000
MAX_ALL_CELLS: Final = 20_000_000
_MAX_WORDS: Final = 12
_MAX_SHOWN: Final = 8
_MAX_NAMED: Final = 5
_MIN_CODE_DIGITS: Final = 2
_MAX_METRES: Final = 1e-3
_MAX_SECONDS: Final = 10.0
_ENCODING_BYTES: Final = 1_000_000
_MIN_COHERENCE: Final = 0.3
_MIN_RUN: Final = 3

_LISTS: Final = tomllib.loads(Path(__file__).with_name("names.toml").read_text(encoding="utf-8"))
_PERSONS: Final = _LISTS["persons"]["names"]
NAMES: Final[dict[str, list[str]]] = _LISTS["columns"]
NAMES["participant"] = [
    *(person + suffix for person in _PERSONS for suffix in ("", *_LISTS["persons"]["suffixes"])),
    *NAMES["participant"],
]
_VOCABULARY: Final[dict[str, list[str]]] = _LISTS["words"]
_UNITS: Final = {"um": "um", "nm": "nm", "mm": "mm", "pct": "%", "db": "dB", "dbsl": "dB"} | (
    dict.fromkeys(("volt", "volts", "voltage", "spannung", "tension"), "V")
)
_SUFFIXES: Final = ("", *_UNITS, "m", "vpp", "v", "mv", "left", "right", "l", "r", "1", "2")
_SITES: Final = {word: site for site in ("left", "right", "both") for word in _VOCABULARY[site]}
_NONE: Final = frozenset(_VOCABULARY["none"])
_YES_NO: Final = {
    **dict.fromkeys([*_VOCABULARY["yes"], *_VOCABULARY["perceived"]], YES),
    **dict.fromkeys(
        [
            *_VOCABULARY["no"],
            *map("".join, product(_VOCABULARY["negations"], _VOCABULARY["perceived"])),
        ],
        NO,
    ),
}
_MISSED: Final = frozenset(_VOCABULARY["miss"])
"""A stimulus that was not felt, beside a word for a hit; alone it may be a time-out."""
_TIMED_OUT: Final = frozenset(_VOCABULARY["timeout"])
_NO_TRIAL: Final = re.compile(
    "(?<![a-z])(practi[cs]e|prac|training|train|instructions?|instr|demo|warm.?up|welcome|"
    "familiari[sz]ation|habituation|übung(?:sblock|sdurchgang|sphase)?|entra[iî]nement|"
    "[eé]chauffement)(?![a-zà-ÿ])",
    re.IGNORECASE,
)
_CAMEL: Final = re.compile("(?<=[a-z])(?=[A-Z])|[_.]")
_CODE: Final = re.compile(r"-9+(\.0*)?", re.ASCII)
_SECTION_ORDER: Final = (
    *("file", "rows.keep", "rows.skip", "columns", "values.condition", "values.side"),
    *("values.level_vpp", "values.response", "values.detected", "values.rt_s", "constant"),
    *("units", "scale", "axis", "table"),
)
_TASK: Final = (
    f'"{YES_NO}" if people who felt nothing could say so, "{FORCED}" if they had to guess'
)
_UNIT: Final = "write the unit of the levels; it is printed, and nothing is converted"


@dataclass(frozen=True, slots=True)
class Sample:
    """Cells of some tables by column, and the file of each row."""

    cells: dict[str, list[str]]
    counts: dict[str, Counter[str]] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """The number of rows."""
        return len(self.cells[FILE])

    def tally(self, name: str) -> Counter[str]:
        """Return the words of a column and how often each stands there."""
        if name not in self.counts:
            self.counts[name] = Counter(self.cells[name])
        return self.counts[name]

    def values(self, name: str) -> Counter[str]:
        """Return the words of a column but those for nothing."""
        return Counter({w: n for w, n in self.tally(name).items() if w.lower() not in NOTHING})

    def numbers(self, name: str) -> list[float]:
        """Return the numbers of a column, each different one once."""
        return [float(w.replace(",", ".")) for w in self.tally(name) if NUMBER.fullmatch(w)]

    def without(self, name: str, tally: Iterable[str]) -> Sample:
        """Return the rows that have none of the words in a column."""
        dropped = {*tally}
        keep = [cell not in dropped for cell in self.cells[name]]
        return Sample({key: list(compress(column, keep)) for key, column in self.cells.items()})

    def is_unique(self, names: Sequence[str]) -> bool:
        """Return whether no two rows have the same cells in these columns."""
        rows = list(zip(*(self.cells[name] for name in names), strict=True))
        return len({*rows}) == len(rows)


@dataclass(slots=True)
class _Draft:
    sections: dict[str, list[str]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    used: dict[str, None] = field(default_factory=dict)  # columns of theirs, in their order
    sources: dict[str, str] = field(default_factory=dict)  # our columns, each with theirs

    def put(self, section: str, key: str, value: str | list[str], comment: str = "") -> None:
        line = toml_entry(key, value, comment)
        if section in ("columns", "table") and isinstance(value, str) and value:
            self.used[value] = None
            self.sources[key] = value
        elif section in ("rows.keep", "rows.skip"):
            self.used[key] = None
        if line not in (lines := self.sections.setdefault(section, [])):
            lines.append(line)

    def ask(self, section: str, key: str, what: str) -> None:
        self.put(section, key, "", f"{FILL_IN}: {what}")

    def remark(self, text: str) -> None:
        self.sections.setdefault("columns", []).append(f"# {text}")

    def has(self, section: str, key: str) -> bool:
        return any(line.startswith(f"{key} = ") for line in self.sections.get(section, ()))


def propose_map(sources: Sequence[InputTable]) -> tuple[str, list[str]]:
    """Return the text of a column map for tables, and the keys that are to be filled in.

    Of a data set with several tasks the tables of the first are looked at. Raises ResultFileError
    for a table that cannot be read, where it is the only one.
    """
    draft = _Draft()
    tasks = [*dict.fromkeys(source.about.get("task-", "") for source in sources)]
    if len(tasks) > 1:
        draft.put("rows.keep", "task-", tasks[0], f"guess; tasks here: {_listed(tasks)}")
        sources = [source for source in sources if source.about.get("task-", "") == tasks[0]]
    encoding = _propose_encoding([source.path for source in sources], draft)
    tables, faults = _read_samples(sources, encoding)
    everything = _join(tables)
    sample = _propose_rows(everything, draft)
    sample = _propose_columns(sample, draft)
    sample, lacking = _without_lacking_files(tables, sample, draft)
    for stem, fault in (faults | lacking).items():
        draft.notes.append(f"file {one_line(stem)} is left out: {fault}")
    if skipped := [*faults, *lacking]:
        draft.put("rows.skip", FILE, skipped, "files that have no trials, or other columns")
    _note_rows(everything, sample, draft)
    more = f" and {len(sources) - 1} more" if len(sources) > 1 else ""
    title = f"# Proposed for {one_line(sources[0].name)}{more}: check each guess, fill in the rest."
    lines = [title, *(NOTE + note for note in draft.notes), *draft.sections.get("", ())]
    for name in _SECTION_ORDER:
        if draft.sections.get(name):
            lines += ["", f"[{name}]", *draft.sections[name]]
    lines += ["", "# All columns:", *(f"#   {line}" for line in _list_columns(everything))]
    fill_in = [line.split(" = ")[0] for line in lines if f"# {FILL_IN}" in line]
    return "\n".join(lines) + "\n", fill_in


def _propose_encoding(paths: Sequence[Path], draft: _Draft) -> str:
    """Return the encoding of tables that are not UTF-8; ask for it where it is unsure."""
    for path in paths:
        try:
            with path.open("rb") as stream:
                start = stream.read(_ENCODING_BYTES)
        except OSError as error:
            raise unreadable(error, path) from None
        if unmarked := guess_unmarked_utf_16(start):
            comment = "guess: UTF-16 without a byte order mark"
            draft.put("file", "encoding", unmarked, comment)
            return unmarked
        start = start[: start.rfind(b"\n") + 1] or start
        if _is_marked_or_utf_8(start):
            continue
        matches = [*from_bytes(start)]
        likely = dict.fromkeys(["cp1252", *(match.encoding for match in matches[:3])])
        sure = bool(matches) and matches[0].coherence >= _MIN_COHERENCE
        if sure and "cp1252" in matches[0].could_be_from_charset:
            draft.put("file", "encoding", "cp1252", "guess: it is not UTF-8")
        else:
            shown = "; ".join(f'"{name}" reads {_first_sign(start, name)}' for name in likely)
            draft.ask("file", "encoding", f"it is not UTF-8; {shown}")
        return "cp1252"
    return ""


def _is_marked_or_utf_8(raw: bytes) -> bool:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff", b"PK")):
        return True
    try:
        raw.decode()
    except UnicodeDecodeError:
        return False
    return True


def _first_sign(raw: bytes, encoding: str) -> str:
    """Return the first word that is not ASCII."""
    texts = re.split("[,;\t ]", raw.decode(encoding, "replace"))
    return one_line(next((text for text in texts if not text.isascii()), "")[:20])


def _read_samples(
    sources: Sequence[InputTable], encoding: str
) -> tuple[dict[str, dict[str, list[str]]], dict[str, str]]:
    """Return the cells of each file, and by its stem why one cannot be read."""
    tables: dict[str, dict[str, list[str]]] = {}
    faults: dict[str, str] = {}
    columns = ColumnMap(file=File(encoding=encoding or None))
    max_cells = min(MAX_CELLS, MAX_ALL_CELLS // len(sources))
    for source in sources:
        file = str(source.path)
        try:
            with source.path.open("rb") as stream:
                form = columns.text_format(source.path.suffix)
                header, chunks = text_chunks(stream, file, form=form)
                rows: list[list[str]] = []
                while len(rows) < min(MAX_ROWS, max_cells // len(header) + 1):
                    if (chunk := next(chunks, None)) is None:
                        break
                    rows += chunk[1]
        except OSError as error:
            raise unreadable(error, source.path) from None
        except ResultFileError as error:
            if len(sources) == len(faults) + 1:
                raise
            line = "" if error.line is None else f":{error.line}"
            faults[source.about[FILE]] = str(error).removeprefix(f"{one_line(file)}{line}: ")
            continue
        about = {name: [text] * len(rows) for name, text in source.about.items()}
        cells = dict(zip(header, map(list, zip(*rows, strict=True)), strict=True))
        tables[file] = about | {name: column for name, column in cells.items() if name}
    return tables, faults


def _join(tables: dict[str, dict[str, list[str]]]) -> Sample:
    """Put tables together; a column that one lacks is empty there."""
    joined: dict[str, list[str]] = {name: [] for cells in tables.values() for name in cells}
    for cells in tables.values():
        empty = [""] * len(cells[FILE])
        for name, column in joined.items():
            column.extend(cells.get(name, empty))
    return Sample(joined)


def _without_lacking_files(
    tables: dict[str, dict[str, list[str]]], sample: Sample, draft: _Draft
) -> tuple[Sample, dict[str, str]]:
    """Leave out the files that lack a column of the draft; return why."""
    lacking = {}
    for cells in tables.values():
        missing = [name for name in draft.used if name in sample.cells and name not in cells]
        if missing:
            stem = cells[FILE][0]
            lacking[stem] = f"no column {named([*map(one_line, missing)])}"
    return (sample.without(FILE, lacking) if lacking else sample), lacking


def _propose_rows(sample: Sample, draft: _Draft) -> Sample:
    """Propose which rows are trials: those of a loop of PsychoPy, of a plugin of jsPsych."""
    if loop := _find_loop(sample):
        draft.put("rows.skip", loop, "", "guess: rows outside this loop")
        sample = sample.without(loop, [""])
    if {"trial_type", "time_elapsed", "rt"} <= {*sample.cells}:
        kinds = sample.tally("trial_type")
        timed = Counter(
            kind
            for kind, time in zip(sample.cells["trial_type"], sample.cells["rt"], strict=True)
            if NUMBER.fullmatch(time)
        )
        plugin = (timed or kinds).most_common(1)[0][0]
        draft.put("rows.keep", "trial_type", plugin, f"guess; there are {_listed(kinds)}")
        sample = sample.without("trial_type", [kind for kind in kinds if kind != plugin])
    for name in [*sample.cells]:
        if len(sample.tally(name)) > _MAX_WORDS or name.endswith(("-", ".thisN")):
            continue
        tally = _practice_words(sample, name)
        if tally:
            there = f"guess; there are {_listed(sample.tally(name))}"
            draft.put("rows.skip", name, tally, there)
            sample = sample.without(name, tally)
    return sample


def _find_loop(sample: Sample) -> str:
    """Return the innermost of PsychoPy's loops that has all trials; none where several have some.

    Trials are rows with a level outside the loops of practice.
    """
    loops = [name for name in sample.cells if name.endswith(".thisN") and sample.values(name)]
    practice = [name for name in loops if _NO_TRIAL.search(_CAMEL.sub(" ", name))]
    levels = [name for name in sample.cells if _is_named(name, "level_vpp")]
    trials = [
        row
        for row in range(sample.size)
        if any(NUMBER.fullmatch(sample.cells[name][row]) for name in levels)
        and not any(sample.cells[name][row] for name in practice)
    ]
    covering = [
        name
        for name in loops
        if name not in practice and trials and all(sample.cells[name][row] for row in trials)
    ]
    changes = {name: sum(1 for _ in groupby(sample.cells[name])) for name in covering}
    loop = max(covering, key=lambda name: changes[name], default="")
    return loop if loop and sample.tally(loop)[""] else ""


def _practice_words(sample: Sample, name: str) -> list[str]:
    """Return the words of a column that stand for practice, not for all or most of the rows."""
    tally = sample.tally(name)
    practice = [word for word in tally if _NO_TRIAL.search(_CAMEL.sub(" ", word))]
    if _NO_TRIAL.search(_CAMEL.sub(" ", name)) and {*tally} <= {*TRUTHS, YES, NO}:
        practice = [word for word in tally if TRUTHS.get(word, word) == YES]
    if _plain(name) in NAMES["condition"]:
        return []
    return practice if 2 * sum(tally[w] for w in practice) < sample.size else []


def _propose_columns(sample: Sample, draft: _Draft) -> Sample:
    """Propose where our columns come from; return the rows that are trials."""
    draft.sections["columns"] = []
    counts = _propose_counts(sample, draft)
    sample, participant = _propose_participant(sample, draft, counted=bool(counts))
    level = _choose(sample, "level_vpp", draft, required=True, taken=counts)
    if level:
        sample = _propose_levels(sample, level, draft, counted=bool(counts))
    elif not draft.has("columns", "level_vpp"):
        numeric = _columns_of_numbers(sample, draft)
        draft.ask(
            "columns", "level_vpp", f"name the column of the level{_such_as(sample, numeric)}"
        )
    if not draft.sections.get("axis"):
        draft.ask("axis", "unit", _UNIT)
    session = _choose(sample, "session", draft)
    condition = _choose(sample, "condition", draft)
    if counts:
        key = [name for name in (participant, level, session, condition) if name]
        _ask_for_condition(sample, key, draft)
    else:
        _propose_answers(sample, draft)
        times = _choose(sample, "rt_s", draft)
        if times:
            _propose_times(sample, times, draft)
        key = [name for name in (participant, session) if name] or [FILE]
        _propose_trial(sample, key, draft)
        _leave_out_other_values(sample, draft)
    return sample


def _ask_for_condition(sample: Sample, key: Sequence[str], draft: _Draft) -> None:
    """Ask for the column that distinguishes several rows of one participant and level."""
    unused = UnusedColumns()
    unused.collect(sample.cells, draft.sources, {*draft.used}, [True] * sample.size)
    if (names := unused.varying()) and not sample.is_unique(key):
        which = " or ".join(map(one_line, names))
        draft.ask(
            "columns",
            "condition",
            f"name {which} if it is a condition; if it numbers blocks, name it in session instead",
        )


def _columns_of_numbers(sample: Sample, draft: _Draft) -> list[str]:
    """Return the columns that may be levels: several numbers, and no other column of ours."""
    explained = {name for ours in NAMES for name in _matching(sample, ours)} | {*draft.used}
    return [
        name
        for name in sample.cells
        if name not in explained
        and not name.endswith("-")
        and len(values := sample.values(name)) > 1
        and all(map(NUMBER.fullmatch, values))
    ]


def _such_as(sample: Sample, names: Sequence[str]) -> str:
    """Return an example of columns for a request, with their first values."""
    columns = [f"{one_line(name)} ({_listed(sample.tally(name))})" for name in names[:_MAX_NAMED]]
    return f", such as {' or '.join(columns)}" if columns else ""


def _matching(sample: Sample, ours: str) -> list[str]:
    """Return the columns that have a name of ours, and what such a column must have."""
    return [
        name
        for name in sample.cells
        if not name.endswith("-")
        and any(_is_named(called, ours) for called in {name, name.rpartition(".")[2]})
        and sample.values(name)
        and _fits(sample, name, ours)
    ]


def _is_named(name: str, ours: str) -> bool:
    plain = _plain(name)
    if ours != "level_vpp":
        return plain in NAMES[ours]
    if plain.removeprefix("stim").removeprefix("drive").removeprefix("piezo") in NAMES[ours]:
        return True
    *stem, unit = re.split("[^a-zµ]+", name.lower().rstrip(")]"))
    return bool(stem and unit.replace("µ", "u") in ("um", "nm", "db", "v", "vpp", "mv")) or any(
        plain == base + suffix for base in NAMES[ours] for suffix in _SUFFIXES
    )


def _fits(sample: Sample, name: str, ours: str) -> bool:
    """Return whether the values of a column are of the kind that its name promises."""
    values = sample.values(name)
    numbers = sum(1 for word in values if NUMBER.fullmatch(word))
    match ours:
        case "level_vpp":
            return 2 * numbers >= len(values) and (len(values) > 1 or sample.size < _MIN_RUN)
        case "rt_s" | "trial":
            return numbers == len(values)
        case "detected":
            return all(
                _read_yes_no(word) or word.lower() in _MISSED | _TIMED_OUT for word in values
            )
        case "participant":
            return _is_person(sample, name)
        case "condition":
            return len(values) <= MAX_CONDITIONS
        case _:
            return ours != "side" or len(values) <= _MAX_WORDS


def _is_person(sample: Sample, name: str) -> bool:
    """Return whether a column may hold participants: not a value for each row or each stimulus."""
    values = sample.values(name)
    if 2 * len(values) > sample.size and sample.size > _MIN_RUN:
        return False
    strong = any(_plain(name).startswith(person) for person in _PERSONS)
    runs = sum(1 for _ in groupby(zip(sample.cells[FILE], sample.cells[name], strict=True)))
    return strong or len(values) == 1 or sample.size >= _MIN_RUN * runs


def _choose(
    sample: Sample,
    ours: str,
    draft: _Draft,
    *,
    required: bool = False,
    taken: Sequence[str] = (),
) -> str:
    """Propose the column of one of ours; of several name all, and ask where it is required."""
    names = [name for name in _matching(sample, ours) if name not in taken]
    names = [ours] if ours in names else names
    if len(names) == 1:
        _take(sample, ours, names[0], draft)
        return names[0]
    if names and required:
        draft.ask("columns", ours, f"name one of these columns: {', '.join(map(one_line, names))}")
    elif names:
        columns = ", ".join(map(one_line, names))
        draft.remark(f"{ours}: several columns may be meant ({columns}); add the right one")
    return ""


def _take(sample: Sample, ours: str, theirs: str, draft: _Draft) -> None:
    values = _listed(sample.tally(theirs))
    if ours == theirs:
        draft.used[ours] = None
        draft.sources[ours] = ours
        draft.remark(f"{ours}: taken as it is; {values}")
    else:
        draft.put("columns", ours, theirs, f"guess; {values}")


def _propose_participant(sample: Sample, draft: _Draft, *, counted: bool) -> tuple[Sample, str]:
    names = _matching(sample, "participant")
    ranked = sorted(names, key=lambda name: NAMES["participant"].index(_last_plain(name)))
    strong = [name for name in ranked if _last_plain(name) not in ("id", "code", "user", "sid")]
    chosen = "participant" if "participant" in names else next(iter(strong or ranked), "")
    same = [name for name in strong if name != chosen and not _agree(sample, chosen, name)]
    if chosen and same:
        which = ", ".join(map(one_line, [chosen, *same]))
        draft.ask("columns", "participant", f"name one of these columns: {which}")
        return sample, ""
    if chosen:
        _take(sample, "participant", chosen, draft)
        empty = sample.tally(chosen)[""]
        if empty and empty < sample.size:
            comment = f"guess: {_count_rows(empty)} without a participant"
            draft.put("rows.skip", chosen, "", comment)
            sample = sample.without(chosen, [""])
        return sample, chosen
    if STANDS_FOR["participant"] in sample.cells:
        return sample, STANDS_FOR["participant"]
    level = next(iter(_matching(sample, "level_vpp")), "")
    alone = len(sample.tally(FILE)) == 1
    of_one = counted and level and sample.is_unique([level])
    if alone and not of_one and (counted or _unclaimed(sample)):
        request = f'name the column of the participant, or write "{FILE}" for one participant'
        draft.ask("columns", "participant", request)
        return sample, ""
    draft.put("columns", "participant", FILE, "guess: the name of the file")
    return sample, FILE


def _unclaimed(sample: Sample) -> list[str]:
    """Return the columns that no list of names explains and that may hold participants."""
    explained = {name for ours in NAMES for name in _matching(sample, ours)}
    names = [name for name in sample.cells if name not in explained and not name.endswith("-")]
    return [n for n in names if len(sample.values(n)) > 1 and _is_person(sample, n)]


def _agree(sample: Sample, first: str, second: str) -> bool:
    """Return whether two columns distinguish the same rows."""
    pairs = {*zip(sample.cells[first], sample.cells[second], strict=True)}
    return len(pairs) == len(sample.tally(first)) == len(sample.tally(second))


def _propose_counts(sample: Sample, draft: _Draft) -> list[str]:
    """Propose the columns of counts: hits of so many presented, or beside so many missed."""
    plain = {_plain(name): name for name in reversed(sample.cells)}
    hits, presented, missed = (
        next((plain[name] for name in names if name in plain), "")
        for names in _LISTS["counts"].values()
    )
    for ours, total in (("presented", presented), ("missed", missed)):
        if not hits or not total or hits == total:
            continue
        pairs = [*zip(sample.cells[hits], sample.cells[total], strict=True)]
        if not all(a.isdecimal() and b.isdecimal() for a, b in pairs):
            continue
        fit = ours == "missed" or all(int(a) <= int(b) for a, b in pairs)
        if fit and max(int(b) for _, b in pairs) > 1:
            draft.put("table", "detected", hits, f"guess; {_listed(sample.tally(hits))}")
            draft.put("table", ours, total, f"guess; {_listed(sample.tally(total))}")
            draft.ask("", "task", _TASK)
            return [hits, total]
    return []


def _propose_levels(sample: Sample, level: str, draft: _Draft, *, counted: bool) -> Sample:
    """Propose the axis and the words of a column of levels; return the rows that are trials."""
    tally = sample.tally(level)
    codes = [word for word in tally if _CODE.fullmatch(word) and len(word) > _MIN_CODE_DIGITS]
    silent = _propose_axis(sample, level, codes, draft)
    _propose_decimal(tally, draft)
    for word in tally:
        lower = word.lower()
        if word in codes:
            request = f'write "{silent}" if this code marks a blank trial, or else the level'
            draft.ask("values.level_vpp", word, request)
        elif NUMBER.fullmatch(word) or (lower in SILENT and silent == "-inf"):
            continue
        elif lower in SILENT or _plain(word) in _VOCABULARY["catch"]:
            draft.put("values.level_vpp", word, silent, "guess: a blank trial")
        elif lower in NOTHING:
            sample = _propose_missing_level(sample, level, word, silent, draft, counted=counted)
        else:
            request = f'write the level as a number, or "{silent}" if this is a blank trial'
            draft.ask("values.level_vpp", word, request)
    return sample


def _propose_axis(sample: Sample, level: str, codes: Sequence[str], draft: _Draft) -> str:
    """Propose scale and unit of the levels; return the level of a blank trial."""
    plain, numbers = _plain(level), {*sample.numbers(level)} - {float(code) for code in codes}
    unit = next((unit for end, unit in _UNITS.items() if plain.endswith(end)), "")
    if unit == "dB":
        draft.put("axis", "x_scale", "dB", "guess, by the name: 0 is a level")
    elif min(numbers, default=0) < 0:
        draft.put("axis", "x_scale", "linear", 'guess: levels below 0; "dB" if they are in dB')
    silent = "-inf" if "axis" in draft.sections else "0"
    if not unit and plain.endswith("m") and max(numbers, default=1) < _MAX_METRES:
        draft.sections["scale"] = ["level_vpp = 1e6  # guess: the levels are metres"]
        unit = "um"
    if unit:
        draft.put("axis", "unit", unit, "guess, by the name")
    elif plain.endswith("vpp"):
        draft.sections["axis"] = ["# unit: V peak-to-peak, by the name; else state it"]
    else:
        draft.ask("axis", "unit", _UNIT)
    return silent


def _propose_missing_level(
    sample: Sample, level: str, word: str, silent: str, draft: _Draft, *, counted: bool
) -> Sample:
    """Skip rows without a level and without an answer; those with an answer are blank trials."""
    answers = [*_matching(sample, "response"), *_matching(sample, "detected")]
    rows = [n for n, cell in enumerate(sample.cells[level]) if cell == word]
    answered = [n for n in rows if any(sample.cells[a][n].lower() not in NOTHING for a in answers)]
    if answered or counted:
        comment = (
            f"guess: a blank trial; {_count_rows(len(answered))} with an answer and without a level"
        )
        draft.put("values.level_vpp", word, silent, comment)
        return sample
    comment = f"guess: {_count_rows(len(rows))} without a level and an answer"
    draft.put("rows.skip", level, word, comment)
    return sample.without(level, [word])


def _propose_decimal(tally: Iterable[str], draft: _Draft) -> None:
    if any("," in word for word in tally if NUMBER.fullmatch(word)):
        draft.put("file", "decimal", ",", "guess: there are numbers with a comma")


def _propose_answers(sample: Sample, draft: _Draft) -> None:
    """Propose the columns of side and answer, their words, and the task."""
    responses, hits = _matching(sample, "response"), _matching(sample, "detected")
    sides = _matching(sample, "side")
    sides = [name for name in sides if _site_words(sample, name)] or sides
    unnamed = [] if sides else _columns_of_sites(sample, responses)
    sites = [name for name in responses if _site_words(sample, name)]
    yes_no = [name for name in responses if _is_yes_or_no(sample, name, with_digits=not sides)]
    has_both = any(_SITES.get(_plain(word)) == "both" for n in sites for word in sample.tally(n))
    answers = (sites if sides or unnamed or has_both else []) or yes_no or responses
    if not responses:
        answers = [name for name in hits if not _says_right(sample, name)]
    if len(answers) != 1 or (hits and answers[0] not in [*hits, *sites, *yes_no]):
        _ask_answer(answers if responses else [], hits, draft)
        _propose_side(sample, sides, draft, unnamed)
        return
    answer = answers[0]
    _refuse_settings(sample, answer)
    named_sites = answer in sites and bool(sides or unnamed or has_both)
    if named_sites or (sides and answer not in [*yes_no, *hits]):
        _take(sample, "response", answer, draft)
        if sides:
            _propose_side(sample, sides, draft)
        else:
            request = f"name the column of the stimulated site{_such_as(sample, unnamed)}"
            draft.ask("columns", "side", request)
        ours = _propose_words(sample, "response", answer, draft)
        if "" in ours:
            remark = f'# task is not needed if a word below stands for "none"; otherwise {_TASK}'
            draft.sections.setdefault("", []).append(remark)
        elif LEFT_RIGHT_BOTH.nothing not in ours:
            draft.ask("", "task", _TASK)
        return
    draft.put("columns", "detected", answer, f"guess; {_listed(sample.tally(answer))}")
    draft.ask("", "task", _TASK)
    _propose_words(sample, "detected", answer, draft)
    if len(sides) == 1 and _has_felt_blanks(sample, answer):
        _ask_to_pool(sample, sides[0], draft)
    else:
        _propose_side(sample, sides, draft, unnamed)


def _ask_answer(responses: Sequence[str], hits: Sequence[str], draft: _Draft) -> None:
    names = ", ".join(map(one_line, responses))
    request = (
        f"name one of these columns: {names}" if responses else "name the column of the answer"
    )
    if hits:
        hit = one_line(hits[0])
        request += f'; if 1 in {hit} means felt, write detected = "{hit}" instead'
    draft.ask("columns", "response", request)
    draft.ask("", "task", f"needed if the answers are yes and no, or right and wrong; {_TASK}")


def _ask_to_pool(sample: Sample, side: str, draft: _Draft) -> None:
    sites = _listed(sample.tally(side))
    request = (
        f'write "left" to pool the sites of {one_line(side)} ({sites}); blank trials that were '
        "felt name no site"
    )
    draft.ask("constant", "side", request)
    if side == "side":
        draft.put("columns", "side", "", "left out: the constant below replaces it")


def _columns_of_sites(sample: Sample, answers: Sequence[str]) -> list[str]:
    """Return the columns that name several sites in all their words, whatever they are called."""
    return [
        name
        for name in sample.cells
        if name not in answers
        and len({_SITES.get(_plain(word)) for word in sample.values(name)} - {None}) > 1
        and all(_plain(word) in {*_SITES} | _NONE for word in sample.values(name))
    ]


def _blank_rows(sample: Sample) -> list[int]:
    """Return the rows of level 0, or without a level, where a single column has the level."""
    levels = _matching(sample, "level_vpp")
    cells = sample.cells[levels[0]] if len(levels) == 1 else ()
    signed = any(number < 0 for number in sample.numbers(levels[0])) if levels else False
    return [
        row
        for row, cell in enumerate(cells)
        if cell.lower() in NOTHING
        or (not signed and NUMBER.fullmatch(cell) and not float(cell.replace(",", ".")))
    ]


def _has_felt_blanks(sample: Sample, answer: str) -> bool:
    return any(_read_yes_no(sample.cells[answer][row]) == YES for row in _blank_rows(sample))


def _says_right(sample: Sample, hits: str) -> bool:
    """Return whether most blank trials are 1: right answers, it seems, not felt ones."""
    blanks = [_read_yes_no(sample.cells[hits][row]) == YES for row in _blank_rows(sample)]
    return 2 * sum(blanks) > len(blanks)


def _refuse_settings(sample: Sample, answer: str) -> None:
    """Refuse a column of many numbers in the place of answers: a method of adjustment."""
    numbers = {*sample.numbers(answer)}
    if len(numbers) > _MAX_WORDS and any(number % 1 for number in numbers):
        message = (
            f"the column {one_line(answer)} holds {len(numbers)} different numbers, settings "
            "rather than answers; tactstrip has no analysis for them"
        )
        raise ResultFileError(sample.cells[FILE][0], None, message)


def _site_words(sample: Sample, name: str) -> list[str]:
    """Return the words of a column that name a site."""
    return [word for word in sample.values(name) if _plain(word) in _SITES]


def _is_yes_or_no(sample: Sample, name: str, *, with_digits: bool) -> bool:
    """Return whether a column answers yes and no: all its words do, or are words for a miss.

    Digits may be the numbers of keys or, in jsPsych, of buttons.
    """
    values = sample.values(name)
    digits = with_digits and "time_elapsed" not in sample.cells
    if (
        not values
        or len(values) > _MAX_WORDS
        or (all(map(NUMBER.fullmatch, values)) and not digits)
    ):
        return False
    listed = all(
        _read_yes_no(word) or word.strip().lower() in _MISSED | _TIMED_OUT for word in values
    )
    return listed and any(_read_yes_no(word) for word in values)


def _read_yes_no(word: str) -> str:
    return _YES_NO.get(word.strip().lower(), "")


def _propose_side(
    sample: Sample, sides: Sequence[str], draft: _Draft, unnamed: Sequence[str] = ()
) -> None:
    if not sides:
        draft.ask(
            "constant",
            "side",
            'write "left" or "right"; with a single site, both give the same result. With several '
            "sites, delete this line and name the column of the site in [columns] side"
            f"{_such_as(sample, unnamed)}",
        )
    elif len(sides) > 1:
        draft.ask(
            "columns", "side", f"name one of these columns: {', '.join(map(one_line, sides))}"
        )
    else:
        _take(sample, "side", sides[0], draft)
        _propose_words(sample, "side", sides[0], draft)


def _propose_words(sample: Sample, ours: str, theirs: str, draft: _Draft) -> set[str]:
    """Propose what each word stands for; ask for those that no list has. Return our words."""
    allowed = {"detected": (YES, NO, "timeout", "invalid")}.get(ours, ()) or next(
        column.choices for column in COLUMNS if column.name == ours
    )
    tally = sample.tally(theirs)
    has_hit = any(_read_yes_no(word) == YES for word in tally)
    proposed: dict[str, str] = {}
    for word in [*tally][: 2 * _MAX_WORDS]:
        if word in allowed or (ours == "detected" and word in TRUTHS):
            proposed[word] = word
        else:
            proposed[word] = _stands_for(sample, ours, theirs, word, has_hit=has_hit)
    # a letter means what it says among such letters only: l and r, not l, a and space
    unknown = any(not to for word, to in proposed.items() if word.lower() not in NOTHING)
    for word, stands_for in proposed.items():
        rows = _count_rows(tally[word])
        code = unknown and word in (YES, NO)
        if (word == stands_for and not code) or (word in TRUTHS and ours == "detected"):
            continue
        if stands_for == "timeout":
            pronoun = "it" if tally[word] == 1 else "them"
            comment = f"counted as not detected; [rows.skip] leaves {pronoun} out"
            draft.put(
                f"values.{ours}", word, stands_for, f"guess: {rows} without an answer, {comment}"
            )
        elif stands_for and not (unknown and len(word) == 1):
            draft.put(f"values.{ours}", word, stands_for, "guess")
        else:
            draft.ask(
                f"values.{ours}", word, f"{_format_choices(allowed)}; the word stands in {rows}"
            )
    return {*proposed.values()}


def _format_choices(allowed: Sequence[str]) -> str:
    """Return the request for the word of ours that a word stands for."""
    meanings = {YES: " (detected)", NO: " (not detected)"}
    quoted = [f'"{word}"{meanings.get(word, "")}' for word in allowed]
    return f"write {', '.join(quoted[:-1])} or {quoted[-1]}"


def _count_rows(number: int) -> str:
    return f"{number} row" if number == 1 else f"{number} rows"


def _stands_for(sample: Sample, ours: str, theirs: str, word: str, *, has_hit: bool) -> str:
    """Return our word for theirs, empty where no list and no check supports one."""
    lower, plain = word.strip().lower(), _plain(word)
    if lower in NOTHING and (lower != LEFT_RIGHT_BOTH.nothing or _is_untimed(sample, theirs, word)):
        if ours == "side":
            return ""
        several = len(sample.values(theirs)) > 1  # else a key that is pressed if felt
        return "timeout" if several and _is_untimed(sample, theirs, word) else ""
    if lower in _TIMED_OUT and ours != "side":
        return "timeout"
    if ours == "detected":
        return NO if lower in _MISSED and has_hit else _read_yes_no(word)
    if plain in _NONE and (ours == "side" or plain != "no"):
        return LEFT_RIGHT_BOTH.nothing
    return _SITES.get(plain, "")


def _is_untimed(sample: Sample, theirs: str, word: str) -> bool:
    """Return whether rows with a word have no reaction time, where most rows have one.

    PsychoPy writes None into the column of the keys where none was pressed.
    """
    times = _matching(sample, "rt_s")
    if not times:
        return word == "None" and theirs.endswith(".keys")
    there = [
        NUMBER.fullmatch(time) is not None
        for time, cell in zip(sample.cells[times[0]], sample.cells[theirs], strict=True)
        if cell == word
    ]
    return not any(there)


def _propose_times(sample: Sample, times: str, draft: _Draft) -> None:
    tally, numbers = sample.tally(times), sample.numbers(times)
    for word in tally:
        negative = NUMBER.fullmatch(word) and word.startswith("-")
        if negative or (word.lower() in NOTHING and word not in ("", "n/a")):
            draft.put("values.rt_s", word, "n/a", "guess")
    _propose_decimal(tally, draft)
    if "time_elapsed" in sample.cells:
        draft.put("units", "rt_s", "ms", "as jsPsych writes it")
    elif numbers and median(numbers) > _MAX_SECONDS:
        draft.put("units", "rt_s", "ms", f"guess: the median is {median(numbers):g}")


def _propose_trial(sample: Sample, key: Sequence[str], draft: _Draft) -> None:
    """Propose the column that numbers the trials of a session, or the order of rows instead."""
    names = _matching(sample, "trial")
    numbering = [name for name in names if sample.is_unique([*key, name])]
    # In several files of one session: analyze refuses them and says what may be meant.
    numbering = numbering or [n for n in names if sample.is_unique([*key, n, FILE])]
    if numbering:
        _take(sample, "trial", "trial" if "trial" in numbering else numbering[0], draft)
    elif names:
        comment = "left out: the numbers repeat, so the order of the rows is used"
        draft.put("columns", "trial", "", comment)


def _leave_out_other_values(sample: Sample, draft: _Draft) -> None:
    """Leave out columns that have our names and not our values, as a block with a word for name."""
    for column in COLUMNS:
        name = column.name
        if name not in sample.cells or name in draft.used or draft.has("columns", name):
            continue
        choices = column.choices or ("true", "false") * (column.type == "bool")
        for word in sample.values(name):
            if (
                word not in choices
                if choices
                else column.type != "str" and not NUMBER.fullmatch(word)
            ):
                comment = (
                    f"left out: it has a name of tactstrip, but values such as {one_line(word)}"
                )
                draft.put("columns", name, "", comment)
                break


def _note_rows(everything: Sample, sample: Sample, draft: _Draft) -> None:
    """Say how many rows are skipped, and which columns of words the map leaves aside."""
    keys = [
        f"[{section}] {line.partition('  # ')[0]}"
        for section in ("rows.keep", "rows.skip")
        for line in draft.sections.get(section, ())
    ]
    if skipped := everything.size - sample.size:
        verb = "row is" if everything.size == 1 else "rows is" if skipped == 1 else "rows are"
        total = f"{skipped} of {everything.size} {verb} skipped"
        draft.notes.append(f"{total} by {', '.join(map(one_line, keys))}")
    unused = UnusedColumns()
    unused.collect(sample.cells, draft.sources, {*draft.used}, [True] * sample.size)
    if names := unused.names():
        aside = f"columns with 2 to {MAX_WORDS} words that the map leaves aside: {named(names)}"
        draft.notes.append(f"{aside}; conditions are compared by [columns] condition")


def _list_columns(sample: Sample) -> Iterator[str]:
    for name in sample.cells:
        about = "; from the name of the file" if name.endswith("-") else ""
        yield f"{one_line(name)}: {_listed(sample.tally(name))}{about}"


def _listed(tally: Iterable[str]) -> str:
    """Return the first words of a column."""
    listed = [one_line(word[:40]) or "empty" for word in [*tally][:_MAX_SHOWN]]
    return ", ".join(listed) + (", ..." if len([*tally]) > _MAX_SHOWN else "")


def _plain(name: str) -> str:
    """Return a name in small letters and digits, without accents and signs."""
    if name.isascii():
        return "".join(filter(str.isalnum, name.lower()))
    decomposed = unicodedata.normalize("NFKD", name.casefold())
    return "".join(c for c in decomposed if c.isalnum() and not unicodedata.combining(c))


def _last_plain(name: str) -> str:
    """Return the plain name that a list of names has, the whole or its last part."""
    whole = _plain(name)
    return whole if whole in NAMES["participant"] else _plain(name.rpartition(".")[2])
