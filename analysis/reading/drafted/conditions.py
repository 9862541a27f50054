"""Which columns of tables made elsewhere may tell conditions apart, or sides, unknown to a map."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from analysis.axis import axis_of
from analysis.reading.cells import NOTHING, SILENT
from analysis.reading.drafted.answers import (
    blanks_told_by,
    given,
    may_be_answers,
    person_of,
    side_of,
    words_of_each,
)
from analysis.reading.drafted.blanks import blank_words, without_level
from analysis.reading.drafted.factors import (
    MOST,
    factor_words,
    roles_by_name,
    with_unit,
)
from analysis.reading.drafted.levels import CODE, is_signed, level_of, silent_words
from analysis.reading.drafted.names import CALLED, CATCH, PRESENT, WORDS
from analysis.reading.drafted.sample import NUMBER, float_of, listed, plain, sample_of
from analysis.reading.foreign.files import FILE
from analysis.reading.foreign.form import toml_entry
from analysis.reading.text import ResultFileError, one_line

if TYPE_CHECKING:
    from collections.abc import Collection, Iterator, Sequence

    from analysis.reading.drafted.factors import Roles
    from analysis.reading.drafted.sample import Sample
    from analysis.reading.foreign.columns import ColumnMap
    from analysis.reading.sources import InputTable

OFFERED: Final = "guess: delete the first # to compare "
"""How the comment of a condition that is offered begins."""
MOST_FILES: Final = 40
"""Files that are looked at, for a guess or a remark."""
BLANKS: Final = "rows without a level are blanks"
_ASIDE: Final = {"none": "blanks", "both": "in no threshold"}
_ANSWERED: Final = 0.8
_FORETELLING: Final = ("level_vpp", "side", "response", "detected")
"""What also tells a stimulus from a blank, or a hit from a miss, as others' columns say again."""
_SIDE: Final = re.compile("left|right")
_NONE: Final = (
    "date",
    "time",
    "expname",
    "expstart",
    "psychopyversion",
    "corrans",
    "gender",
    "sex",
    "geschlecht",
    "sexe",
    "order",
    "outcome",
    "feedback",
    "os",
    "room",
    "experimenter",
    "device",
    "language",
    "browser",
    "logfile",
)
_OF_DESIGN: Final = re.compile("counterbal|keymap|mapping|parity|lateralit|handedness|handigkeit")


def may_be_conditions(
    table: Sample, known: Collection[str], roles: Roles
) -> Iterator[tuple[str, list[str]]]:
    """Yield columns that may tell conditions apart and are none of the known ones.

    These are a few words, each there twice or more, or a few numbers that are a factor. No known
    column has all of the words, as that of the answers has those of the right answers; nor do they
    only name sides, as files left.wav and right.wav. A column that only repeats the side is not
    yielded, nor numbers that so repeat another such column.
    """
    side = side_of(table)
    taken = [{*table.words(name)} for name in known if name in table.header]
    found: list[str] = []
    names = [*dict.fromkeys(table.header)]
    for name in sorted(names, key=lambda one: bool(table.numbers(one))):
        words = table.words(name)
        few = 1 < len(words) <= MOST and "" not in words and not name.endswith("-")
        if not few or min(words.values()) == 1 or name in known:
            continue
        sides = len({_SIDE.sub("", word.lower()) for word in words}) == 1
        if table.numbers(name):
            told = factor_words(table, name, roles)
            if not told or any(_same(table, name, one) for one in found):
                continue
        elif (
            name in roles.answers
            or plain(name) in _NONE
            or _OF_DESIGN.search(plain(name))
            or sides
            or _within(words, taken)
            or (side and _same(table, name, side))
        ):
            continue
        else:
            told = [*words]
        found.append(name)
        yield name, told


def offered_conditions(table: Sample) -> Iterator[tuple[str, str]]:
    """Yield lines of a draft, with their section, that would make a column the condition.

    For numbers a line each says what may be printed in their place.
    """
    known = {name for names in CALLED.values() for name in (table.called(names),) if name}
    known |= {blank_words(table, level)[0]} if (level := without_level(table)[0]) else set()
    known |= {
        *may_be_answers(table),
        *table.named(CATCH),
        *table.named(PRESENT),
        blanks_told_by(table)[0],
    }
    whose = person_of(table) or FILE
    roles = roles_by_name(table, whose, level_of(table))
    same: dict[tuple[str, ...], str] = {}
    session = table.called(CALLED["session"])
    if session and not table.numbers(session) and _in_everybody(table, session):
        known -= {session}  # as pre and post
    for name, words in may_be_conditions(table, {*known, side_of(table) or whose}, roles):
        at = table.header.index(name)
        first = same.setdefault(tuple(row[at] for row in table.rows), name)
        as_well = "" if first == name else f" (in every row as {one_line(first)})"
        yield "columns", offer(name, [*words], as_well)
        for word in sorted(words, key=float_of) if table.numbers(name) else ():
            told = f"to print so, or as you like, where {one_line(name)} is the condition"
            yield "values.condition", f"# {toml_entry(word, with_unit(word, name), told)}"


def blank_entries(table: Sample, side: str | None) -> list[tuple[str, str, str, str]]:
    """Return what a draft says of rows without a level that have answers: they are blanks.

    Section, key, value and comment each; none where a column of the side says so.
    """
    level, rows, answered = without_level(table)
    sides = table.words(side) if side else {}
    named = any(word.lower() in NOTHING or WORDS.get(plain(word)) == "none" for word in sides)
    if named or not rows or answered < _ANSWERED:
        return []
    ours, known = ("-inf", SILENT) if is_signed(table, level) else ("0", ())
    words = {word: n for word, n in table.words(level).items() if word.lower() in NOTHING}
    return [
        ("values.level_vpp", word, ours, f"guess: {n} {BLANKS}")
        for word, n in words.items()
        if word.lower() not in known
    ]


def without_stimulus(table: Sample) -> dict[str, int]:
    """Count the rows by their words for the level of no stimulus: 0, or -inf where 0 is a level."""
    level = level_of(table)
    if level is None or not table.numbers(level):
        return {}
    silent = silent_words(table, level)
    return {word: rows for word, rows in table.words(level).items() if word in silent}


def side_notes(table: Sample, side: str | None) -> Iterator[str]:
    """Say what becomes of rows without a side, and with both; or that these are the blanks told."""
    words = table.words(side) if side else {}
    level, silent = level_of(table), without_stimulus(table)
    for ours, told in _ASIDE.items():
        own = {word: rows for word, rows in words.items() if WORDS.get(plain(word)) == ours}
        have = f"{sum(own.values())} {'row has' if sum(own.values()) == 1 else 'rows have'}"
        if side and level and silent and ours == "none":
            each = table.of([level], side)
            same = all((at in silent) == (word in own) for (at,), word in each)
            have = "the same rows have" if same else have
        if own:
            yield f"{have} side {ours}: {told}"


def other_side_notes(table: Sample, side: str, response: str) -> Iterator[str]:
    """Say in how many rows the other side was answered, and what they count for."""
    meant = [
        (WORDS.get(plain(one)), WORDS.get(plain(at))) for (one,), at in table.of([response], side)
    ]
    rows = sum({*both} == {"left", "right"} for both in meant)
    if rows:
        yield (
            f"{rows} {'row has' if rows == 1 else 'rows have'} the other side for an answer: not "
            'detected, which asks for the right place; to count them, too: "Felt at either side", '
            "docs/howto/foreign-table.md"
        )


def blank_notes(table: Sample, side: str | None, *, where: bool) -> Iterator[str]:
    """Say which rows are blanks by their level, and which may be, so that only a person can tell.

    `where` it was is asked, or only whether something was felt.
    """
    level, silent = level_of(table), without_stimulus(table)
    if rows := sum(silent.values()):
        yield (
            f"{rows} {'row has' if rows == 1 else 'rows have'} level {next(iter(silent))}: blanks, "
            'where the answer "none" is right (in a forced choice [rows.skip] has to leave them '
            "out); each counts for its own condition only"
        )
    ours = "-inf" if level and is_signed(table, level) else "0"
    for word in filter(CODE.fullmatch, table.words(level) if level else ()):
        yield (
            f"level {word} may be a code for no stimulus: if it is, [values.level_vpp] "
            f"{toml_entry(word, ours)} makes blanks of its rows; else it is a level"
        )
    catch, blank = blanks_told_by(table)
    if level is None or not blank:
        return
    at, place = table.header.index(catch), table.header.index(level)
    levels = {row[place] for row in table.rows if row[at] == blank} - {*silent}
    other = next((word for word in given(table, catch) if word != blank), "")
    if not other or not any(map(NUMBER.fullmatch, levels)):
        return
    places = {*table.words(side)} if side else set()
    yield f"column {one_line(catch)} may tell blanks: if it does, " + (
        f"[rows.skip] {toml_entry(catch, blank)} leaves them out, or let column "
        f"{one_line(side or '')} say none in their rows"
        if where and len(places) > 1
        else f"[columns] {toml_entry('side', catch)}, instead of any other side, with "
        f"[values.side] {toml_entry(blank, 'none')} and {toml_entry(other, 'left')}; their levels "
        "are not read then"
    )


def offer(name: str, words: Sequence[str], more: str = "") -> str:
    """Return the line that makes a column the condition once its first # is deleted."""
    return f"# {toml_entry('condition', name, f'{OFFERED}{listed(words)}{more}')}"


def _in_everybody(table: Sample, name: str) -> bool:
    """Tell whether most people have every word of a column."""
    each, words = words_of_each(table, name), len(table.words(name))
    return words > 1 and sum(map(len, each)) > len(each) * words / 2


def _within(words: Collection[str], taken: list[set[str]]) -> bool:
    return any({*words} <= one for one in taken)


def _same(table: Sample, one: str, other: str) -> bool:
    """Tell whether each word of one column goes with a single word of the other."""
    at, beside = table.header.index(one), table.header.index(other)
    pairs = {(row[at], row[beside]) for row in table.rows}
    return len(pairs) == len(table.words(one)) == len(table.words(other))


def pooled(sources: Sequence[InputTable], columns: ColumnMap) -> Iterator[str]:
    """Say which columns a map leaves aside that may be conditions, unless it says there is none.

    Beside one that it names these are those that vary within participants and its words.
    """
    if "condition" in columns.constant or columns.columns.get("condition") == "":
        return
    table = sample_of(sources[:MOST_FILES], columns.form, columns.filter)
    found = dict(columns.sources(table.header, str(sources[0].path)))
    roles = roles_by_name(table, found.get("participant", FILE), found.get("level_vpp"))
    taken = found.get("condition")
    known = [found.get(ours) for ours in ("participant", "condition", *_FORETELLING)]
    key = [name for name in known if name in table.header]
    for name, words in may_be_conditions(table, {*found.values()}, roles):
        told = f"column {name} ({listed(words)})"
        if taken is None:
            yield (
                f"{told} is no condition here: its trials are analysed together; [columns] "
                f'condition = "{name}" compares them, condition = "" says that there is none'
            )
        elif _varies(table, name, key):
            yield (
                f"{told} varies within {taken}, which is the condition here: its trials are "
                f"analysed together; one part of them is taken by {_kept(name, words[0])}"
            )


def _varies(table: Sample, name: str, within: Sequence[str]) -> bool:
    """Tell whether a column varies in most of the parts of a table that agree in others."""
    at, *places = (table.header.index(one) for one in (name, *within))
    words: dict[tuple[str, ...], list[str]] = {}
    for row in table.rows:
        words.setdefault(tuple([row[place] for place in places]), []).append(row[at])
    several = [{*one} for one in words.values() if len(one) > 1]
    return 2 * sum(len(one) > 1 for one in several) > len(several)


def _kept(name: str, word: str) -> str:
    """Say what keeps the rows that have a word in a column."""
    return f"[rows.keep] {toml_entry(name, word)}"


def has_one_place(columns: ColumnMap, sides: Collection[str]) -> bool:
    """Tell whether the only side that was read is a word of the map's, for a single place.

    >>> from analysis.reading.foreign.columns import ColumnMap
    >>> has_one_place(ColumnMap(values={"side": {"1": "left", "0": "none"}}), {"left", "none"})
    True
    """
    if "side" in columns.constant:
        return True
    told = {*columns.values.get("side", {}).values()} - {"none"}
    return len(told) == 1 and "response" not in columns.columns and {*sides} <= {*told, "none"}


def refuse_blank_levels(columns: ColumnMap, file: str) -> None:
    """Refuse a map that makes an empty level 0 where 0 is a level: its blanks would be stimuli."""
    for word, ours in columns.values.get("level_vpp", {}).items():
        if word.lower() in NOTHING and ours == "0" and axis_of(columns.axis).signed:
            raise ResultFileError(
                columns.name or file,
                None,
                f'[values.level_vpp] "{word}" = "0": 0 is a level where x_scale = '
                f'"{columns.axis["x_scale"]}"; "{word}" = "-inf" makes blanks of these rows',
            )


def refuse_lost_sides(sources: Sequence[InputTable], columns: ColumnMap) -> None:
    """Refuse a map with one place for all stimuli where a column tells several, as answers do.

    Else each answer to the other place would count as a stimulus that was not felt.
    """
    if "side" not in columns.constant or "response" not in columns.columns:
        return
    table = sample_of(sources[:MOST_FILES], columns.form, columns.filter)
    theirs = columns.columns["response"]
    ours = columns.values.get("response", {})
    words = table.words(theirs) if theirs in table.header else ()
    answers = {ours.get(word, word) for word in words}
    side = side_of(table)
    if side and side != theirs and {"left", "right"} <= answers:
        raise ResultFileError(
            columns.name or str(sources[0].path),
            None,
            f'[constant] side = "{columns.constant["side"]}" gives all stimuli one place, but '
            f"column {side} says {listed([*table.words(side)])}, and answers name left and right: "
            f'[columns] side = "{side}" in its stead; if only "felt" was asked, map detected '
            "instead of response",
        )
