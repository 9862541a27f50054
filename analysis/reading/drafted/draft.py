"""A draft of the map of a table made elsewhere, from its heading and its cells.

What is guessed is called a guess, in a comment with the values that it is guessed from; what cannot
be guessed is left empty, and refused by the key's name until somebody fills it in.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import partial
from statistics import median
from typing import TYPE_CHECKING, Final

from analysis.reading.cells import NOTHING, SILENT, TRUTHS
from analysis.reading.checks import MAX_MEDIAN_RT_S
from analysis.reading.drafted.answers import (
    answers_of,
    guess_of,
    has_buttons,
    meaning_of,
    only_key,
    says_right,
    side_of,
)
from analysis.reading.drafted.blanks import no_trials, trial_loop, without_level
from analysis.reading.drafted.conditions import (
    BLANKS,
    MOST_FILES,
    OFFERED,
    blank_entries,
    blank_notes,
    offer,
    offered_conditions,
    other_side_notes,
    side_notes,
    without_stimulus,
)
from analysis.reading.drafted.levels import in_db, is_signed, level_of, unit_of, unit_words
from analysis.reading.drafted.names import CALLED, COUNTS, HITS, OF, WORDS
from analysis.reading.drafted.sample import (
    FILL,
    NUMBER,
    Sample,
    columns_told,
    listed,
    plain,
    sample_of,
    told_of,
    unanswered,
)
from analysis.reading.foreign.files import (
    FILE,
    STANDS_FOR,
    begun_anew,
    begun_anew_words,
    shorter_files,
)
from analysis.reading.foreign.form import RowFilter, guessed_encoding, text_format, toml_entry
from analysis.reading.text import one_line
from experiment.rows import COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from analysis.reading.sources import InputTable


_MOST_WORDS: Final = 12
_BLOCK: Final = re.compile(r"\.thisN$|^(block|run)_?(n|nr|no|num|number|index|id)?$", re.IGNORECASE)
NOTE: Final = "# Note: "
"""How a line of a draft begins that says what becomes of rows."""
_ROWS: Final = ("rows.keep", "rows.skip")
_DECIMAL: Final = 'decimal = ","  # guess: there are numbers with a comma'
_PEAKS: Final = "# its unit: V peak-to-peak, by the name; else state it, in [units]"
_GO: Final = "guess: the only key, pressed if felt"
_TASK: Final = '"yes/no" if people who felt nothing could say so, "forced choice" if they guessed'


def map_draft(sources: Sequence[InputTable]) -> tuple[str, list[str]]:
    """Return the text of a map for tables, and the keys that are to be filled in.

    Of a data set with several tasks the tables of the first are looked at. Raises ResultFileError
    for a table that cannot be read as text.
    """
    tasks = [*dict.fromkeys(one.about.get("task-", "") for one in sources)]
    chosen = [one for one in sources if one.about.get("task-", "") == tasks[0]]
    encoding = guessed_encoding([one.path for one in chosen[:MOST_FILES]])
    form = partial(text_format, {"encoding": encoding})
    table = sample_of(chosen[:MOST_FILES], form, RowFilter())
    more = f" and {len(chosen) - 1} more" if len(chosen) > 1 else ""
    more += f", of which {MOST_FILES} were looked at" * (len(chosen) > MOST_FILES)
    lines = [
        f"# A draft for {one_line(chosen[0].name)}{more}: check each guess, fill in what is empty."
    ]
    sections: dict[str, list[str]] = {}
    if encoding:
        _put(sections, "file", "encoding", encoding, "guess: it is not UTF-8")
    if len(tasks) > 1:
        _put(sections, "rows.keep", "task-", tasks[0], f"guess; tasks here: {listed(tasks)}")
    looked_at, table = table, _rows(table, sections)
    _columns(table, sections)
    lines += [f"{NOTE}{words}" for words in _notes(looked_at, table, sections)]
    needs_task = "table" in sections or any("detected" in line for line in sections["columns"])
    if needs_task and _GO in "".join(sections.get("values.detected", [])):
        lines.append(
            toml_entry("task", "yes/no", "guess: who felt nothing pressed no key (go/no-go)")
        )
    elif needs_task:
        lines.append(toml_entry("task", "", f"{FILL}{_TASK}"))
    else:
        lines.append(
            f'# task: not needed where a key below stands for "none"; where no key does, {_TASK}'
        )
    order = (
        "file",
        "rows.keep",
        "rows.skip",
        "columns",
        "values.condition",
        "values.side",
        "values.level_vpp",
        "values.response",
        "values.detected",
        "values.rt_s",
        "constant",
        "units",
        "axis",
        "table",
    )
    for name in order:
        if sections.get(name):
            lines += ["", f"[{name}]", *sections[name]]
    lines += ["", "# All columns:", *(f"#   {line}" for line in columns_told(table, looked_at))]
    blanks = [line.split(" = ")[0] for line in lines if f"# {FILL}" in line]
    return "\n".join(lines) + "\n", blanks


def _notes(looked_at: Sample, trials: Sample, sections: Mapping[str, list[str]]) -> Iterator[str]:
    """Say how many rows are skipped and by what, and what becomes of blanks and both sides."""
    if skipped := len(looked_at.rows) - len(trials.rows):
        kept = [
            f"[{name}] {line.partition('  # ')[0]}"
            for name in _ROWS
            for line in sections.get(name, ())
            if not line.startswith("#")
        ]
        are = "is" if skipped == 1 else "are"
        level = level_of(looked_at)
        words = {} if level is None else looked_at.words(level) - trials.words(level)
        with_level = sum(n for word, n in words.items() if word.lower() not in NOTHING)
        silent = sum(n for word, n in words.items() if word.lower() in SILENT)
        of_silent = f"{silent} of -inf, " * bool(silent)
        rest = skipped - with_level - silent
        of = f" ({with_level} with a level, {of_silent}{rest} without)" if with_level else ""
        yield f"{skipped} of {len(looked_at.rows)} rows {are} skipped{of}, by {', '.join(kept)}"
    for line in sections.get("rows.skip", ()):
        yield from [line.partition("  # ")[2]] * line.startswith("#")
    side, (response, hit) = side_of(trials), answers_of(trials)
    yield from blank_notes(trials, side, where=hit is None or response not in (None, hit))
    yield from side_notes(trials, side)
    if side and response and hit is None:
        yield from other_side_notes(trials, side, response)
    for line in (*sections.get("values.level_vpp", ()), *sections["columns"]):
        if line.endswith(BLANKS):
            yield line.partition("  # guess: ")[2]
        key, _, names = line.removeprefix("# ").partition(f"  # {OFFERED}")
        if names:
            yield f"{key} compares {names} once its # is deleted; else all are analysed together"


def _rows(table: Sample, sections: dict[str, list[str]]) -> Sample:
    """Guess which rows are trials: those of a loop of PsychoPy, of a plugin of jsPsych."""
    loop, told = trial_loop(table)
    if loop:
        _put(sections, "rows.skip", loop, "", told)
        table = table.without(loop, "")
    if {"trial_type", "time_elapsed", "rt"} <= {*table.header}:
        kinds = table.words("trial_type")
        place, times = (table.header.index(name) for name in ("trial_type", "rt"))
        timed = Counter(row[place] for row in table.rows if NUMBER.fullmatch(row[times]))
        most = (timed or kinds).most_common(1)[0][0]
        _put(sections, "rows.keep", "trial_type", most, f"guess; there are: {listed([*kinds])}")
        for kind in kinds:
            table = table if kind == most else table.without("trial_type", kind)
    for name in dict.fromkeys(table.header):
        words = table.words(name)
        if len(words) > _MOST_WORDS or name.endswith("-") or name == loop:
            continue
        if skipped := no_trials(table, name):
            _put(sections, "rows.skip", name, skipped, f"guess; there are: {listed([*words])}")
        for word in skipped:
            table = table.without(name, word)
    level, rows, answered = without_level(table)
    if rows and not answered:
        empty = [word for word in table.words(level) if word.lower() in NOTHING]
        told = f"guess: {rows} rows without a level and without an answer"
        _put(sections, "rows.skip", level, empty, told)
        for word in empty:
            table = table.without(level, word)
    return table


def _columns(table: Sample, sections: dict[str, list[str]]) -> None:
    sections["columns"] = []
    k, n = table.called(COUNTS), table.called(OF)
    numbers = table.numbers(n) if k and n and k != n and table.numbers(k) else None
    counted = max(numbers or [0]) > 1
    response, both = (None, None) if counted else answers_of(table)
    if counted:
        _put(sections, "table", "detected", k or "", "guess")
        _put(sections, "table", "presented", n or "", "guess")
    for ours, names in CALLED.items():
        if counted and ours in ("trial", "response", "rt_s", "side"):
            continue
        by_words = {"level_vpp": level_of, "side": side_of}.get(ours)
        theirs = by_words(table) if by_words else table.called(names)
        if ours == "trial":
            _trial(table, sections)
        elif ours == "response":
            _answer(table, response, both, sections)
        elif ours == "side":
            _side(table, theirs, sections, where=both is None or response not in (None, both))
        elif theirs is not None:
            _named(table, ours, theirs, sections)
        else:
            _absent(table, ours, sections)
    _ours_unread(table, sections)


def _absent(table: Sample, ours: str, sections: dict[str, list[str]]) -> None:
    """Say what a column of ours may be that no column of theirs is named after."""
    if ours == "participant" and STANDS_FOR["participant"] not in table.header:
        _put(sections, "columns", ours, FILE, "guess: the name of the file")
    elif ours == "level_vpp":
        _put(sections, "columns", ours, "", f"{FILL}the column of the level")
        _unit(sections, "")
    elif ours == "condition":
        for section, line in offered_conditions(table):
            sections.setdefault(section, []).append(line)


def _ours_unread(table: Sample, sections: dict[str, list[str]]) -> None:
    """Leave out columns that have our names and not our values, as a block with a word for name."""
    taken = "\n".join(line.removeprefix("# ") for line in sections["columns"])
    for column in COLUMNS:
        if column.name not in table.header or re.search(rf"^{column.name} = ", taken, re.MULTILINE):
            continue
        words = [word for word in table.words(column.name) if word.lower() not in NOTHING]
        known = [*TRUTHS] if column.type == "bool" else [*filter(NUMBER.fullmatch, words)]
        if column.type != "str" and (others := [word for word in words if word not in known]):
            what = "true or false" if column.type == "bool" else "numbers"
            told = f"has our name and other values than {what}, such as {one_line(others[0])}"
            _put(sections, "columns", column.name, "", f"{told}: left out")


def _trial(table: Sample, sections: dict[str, list[str]]) -> None:
    """Take a column that numbers the trials of a session, or the order of rows instead."""
    columns = [*table.named(CALLED["trial"])]
    person = table.called(CALLED["participant"]) or STANDS_FOR["participant"]
    session = table.called(CALLED["session"]) or STANDS_FOR["session"]
    of_person = [name for name in (person, session, "attempt") if name in table.header]
    within = of_person if person in table.header else [*of_person, FILE]
    numbered = next((name for name in columns if table.unique(name, within)), None)
    if numbered is None and (again := begun_anew(table.of(within, FILE))):
        numbered = next((name for name in columns if table.unique(name, [*within, FILE])), None)
        if numbered is not None:
            line = toml_entry(FILE, shorter_files(again), begun_anew_words(again))
            sections.setdefault("rows.skip", []).append(f"# {line}")
    if numbered is not None:
        _named(table, "trial", numbered, sections)
    elif columns:
        of_file = any(table.unique(name, [*within, FILE]) for name in columns)
        told = f"numbered anew in each {'file' if of_file else 'block'}: the order of rows is taken"
        _put(sections, "columns", "trial", "", told)
        blocks = [one for one in table.header if _BLOCK.search(one)]
        outer = (
            one
            for one in blocks
            if any(one != name and table.unique(name, [*within, one]) for name in columns)
        )
        if block := next(outer, None):
            told = "guess: trials are numbered anew in each, so it tells their order"
            _put(sections, "columns", "block", block, told)


def _unit(sections: dict[str, list[str]], level: str) -> None:
    """Ask for the unit of levels, unless their column is named after one."""
    unit = unit_of(level)
    if unit == "Vpp":
        sections["columns"].append(_PEAKS)
        return
    _put(sections, "axis", "unit", unit, unit_words(unit))


def _side(
    table: Sample, theirs: str | None, sections: dict[str, list[str]], *, where: bool
) -> None:
    """Guess the side; if not `where` was asked, a yes to a blank trial names none of several."""
    for section, *entry in (entries := blank_entries(table, theirs)):
        _put(sections, section, *entry)
    if theirs is None:
        _put(
            sections,
            "constant",
            "side",
            "",
            f'{FILL}"left" or "right": of a single place '
            "nothing depends on which; of several name the column in [columns]",
        )
        return
    words = [WORDS.get(plain(word), word) for word in table.words(theirs)]
    places = {word for word in words if word != "none" and word.lower() not in NOTHING}
    blank = "none" in words or bool(entries or without_stimulus(table))
    told = "felt or not was asked, not where: leave it, the places of {} are pooled"
    told = (told if len(places) > 1 else "{} has a single place").format(one_line(theirs))
    if not where and places and (blank or len(places) == 1):
        _put(sections, "constant", "side", "left", f"guess: {told}")
        if len(places) > 1 and "none" not in words:
            sections["columns"].append(offer(theirs, [*table.words(theirs)]))
        if theirs == "side":
            _put(sections, "columns", "side", "", "left out, for the constant below")
    else:
        _named(table, "side", theirs, sections)


def _answer(
    table: Sample, response: str | None, hit: str | None, sections: dict[str, list[str]]
) -> None:
    if "table" in sections:
        return
    if hit is not None and response not in (None, hit) and side_of(table) is not None:
        told = f"guess; {one_line(hit)} ({listed([*table.words(hit)])}) does not say where"
        _put(sections, "columns", "response", response, told)
        _words(table, "response", response, sections)
    elif hit is not None:
        _put(sections, "columns", "detected", hit, f"guess; {told_of(table, hit)}")
        if "response" in table.header:
            _put(sections, "columns", "response", "", "its words are no sides")
        key = only_key(table, hit)
        for word, ours in meaning_of(table, hit).items():
            if key:
                _go_or_no_go(table, hit, word, sections)
            elif ours != word and word not in TRUTHS:
                told = unanswered(table, hit, word) if ours == "timeout" else ""
                what = f"guess{told}" if ours else f"{FILL}1 if it means felt, 0 if not"
                _put(sections, "values.detected", word, ours, what)
    elif response is not None:
        _named(table, "response", response, sections)
    else:
        told = f"{FILL}the column of the answer"
        if (right := table.called(HITS)) and says_right(table, right):
            told += f"; {one_line(right)} is 1 for most blanks: right answers, it seems, not felt"
        _put(sections, "columns", "response", "", told)


def _go_or_no_go(table: Sample, name: str, word: str, sections: dict[str, list[str]]) -> None:
    """Say what a cell is where a single key tells that something was felt, and no key that not."""
    if word.lower() in NOTHING:
        rows = table.words(name)[word]
        told = f': {rows} rows without it, nothing felt; if no key is an answer missed, "timeout"'
        _put(sections, "values.detected", word, "0", f"guess{told}")
    else:
        _put(sections, "values.detected", word, "1", _GO)


def _named(table: Sample, ours: str, theirs: str, sections: dict[str, list[str]]) -> None:
    if ours != theirs:
        _put(sections, "columns", ours, theirs, f"guess; {told_of(table, theirs)}")
    else:
        told = f"# {ours}: taken as it is; {told_of(table, theirs)}"
        sections["columns"].append(told)
    if ours in ("side", "response"):
        _words(table, ours, theirs, sections)
    elif ours in ("level_vpp", "rt_s"):
        _numbers(table, ours, theirs, sections)


def _numbers(table: Sample, ours: str, theirs: str, sections: dict[str, list[str]]) -> None:
    """Say what the numbers of a column are in, and which of its words are none."""
    words, numbers = table.words(theirs), table.numbers(theirs)
    signed = ours == "level_vpp" and is_signed(table, theirs)
    read = {"", "n/a", *(without_stimulus(table) if signed else ())}
    for word in () if f"values.{ours}" in sections else words:
        negative = ours == "rt_s" and NUMBER.fullmatch(word) and word.startswith("-")
        if negative or (word.lower() in NOTHING and word not in read):
            _put(sections, f"values.{ours}", word, "n/a", "guess")
    if numbers and any("," in word for word in words) and _DECIMAL not in sections.get("file", []):
        sections.setdefault("file", []).append(_DECIMAL)
    if ours == "level_vpp" and in_db(theirs):
        _put(sections, "axis", "x_scale", "dB", "guess, by the name: 0 is a level")
    elif signed:
        told = 'guess: levels below 0; "dB", if that is what they are in'
        _put(sections, "axis", "x_scale", "linear", told)
    if ours == "level_vpp":
        _unit(sections, theirs)
    if ours == "rt_s" and "time_elapsed" in table.header:
        _put(sections, "units", "rt_s", "ms", "as jsPsych writes it")
    elif ours == "rt_s" and numbers and median(numbers) > MAX_MEDIAN_RT_S:
        _put(sections, "units", "rt_s", "ms", f"guess: the median is {median(numbers):g}")


def _words(table: Sample, ours: str, theirs: str, sections: dict[str, list[str]]) -> None:
    """Say what each word of theirs is, where it is known or must be told."""
    known = next(column.choices for column in COLUMNS if column.name == ours)
    guesses = {word: guess_of(table, ours, theirs, word) for word in table.words(theirs)}
    words = [w for w, one in guesses.items() if w not in known or {w, one} == {"left", "right"}]
    for word in words[:_MOST_WORDS]:
        guess = guesses[word]
        button = "the button that jsPsych counts so, the first is 0: " * has_buttons(table)
        told = unanswered(table, theirs, word) if guess == "timeout" else ""
        what = f"guess{told}" if guess else f"{FILL}{button}{', '.join(known)}"
        _put(sections, f"values.{ours}", word, guess, what)


def _put(
    sections: dict[str, list[str]], section: str, key: str, value: str | list[str], comment: str
) -> None:
    sections.setdefault(section, []).append(toml_entry(key, value, comment))
