"""Which columns of numbers in tables made elsewhere may be a factor of the design."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from dataclasses import dataclass
from itertools import groupby, pairwise
from math import sqrt
from statistics import median
from typing import TYPE_CHECKING, Final

from analysis.reading.drafted.names import CALLED, HITS, LEVELS
from analysis.reading.drafted.sample import NUMBER, float_of, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.reading.drafted.sample import Sample

MOST: Final = 6
"""Different values of a condition at most."""
_LEAST_ROWS, _LEAST_EACH, _LEAST_LEVELS = 20, 5, 2
_MOST_PEOPLE: Final = 0.8  # have that; others may have stopped early
_RUN: Final = 5  # rows on average without a change: given in blocks
_TOLD: Final = 0.95  # of rows that other columns foretell
_CELL: Final = 4  # rows of a cell from which that can be seen
_EVEN: Final = 0.5  # of the scatter of counts by chance: a plan, no draw
_RARE: Final = -2.33  # standard deviations: one draw in a hundred
_USUAL: Final = 0.6  # of the answers to a value, more than one of two that come as often
_FREQUENCY: Final = re.compile("^(stim|vib|test)?(freq|fr[eé]q|carrier)|freq(uency|uenz|hz)?$|hz$")
_PART: Final = re.compile("[A-Z]?[a-z]+|[A-Z]+")
_PARTED: Final = re.compile(r"[_ .(\[]+")
_UNIT: Final = re.compile(
    r"(?:[_ (\[]+|(?<=[a-z])(?=[kM]?Hz|dB|kPa|mN|N$))"
    "([kM]?Hz|[munµk]?[msNVAg]|[cm]m2?|k?Pa|dB|deg|[C%])$"
)
# What a name ends in, apart from units and the like: its numbers are no factor in whatever design.
_SUFFIX: Final = re.compile("nr?|no|num|number|idx|index|code|ms|s|secs?|us|hz|is|has|was|flag")
_ENDING: Final = re.compile(
    "(block|trial|session|repetition|repeat|date|visit|seed|random|frame|rate|birth|gender|"
    "handedness|catch|blank|correct|correctness|accuracy|response|answer|button|latency|interval|"
    "position|location|target|jitter|foreperiod|delay|fixation|staircase|reversal|version|present|"
    "presented|order|phase|practice|progress|timestamp|started|stopped|score|feedback|confidence|"
    "rating|randomi[sz]ation|counterbalance|participant|subject|observer|"
    "durchgang|wiederholung|datum|taste|antwort|richtig|sitzung|intervall|"
    "bloc|essai|reponse|touche|bloque|ensayo|respuesta|tecla)$"
)
_WORD: Final = re.compile(
    "runs?|reps?|this|ran|days?|time|age|year|yob|sex|keys?|ans|corr|acc|hits?|resp|rt|iti|isi|"
    "pos|stair|step|count|counter|id|list|item|odd|fps|width|height|screen|trials|blocks|repeats|"
    "signal|alter|zeit|edad"
)
_ANSWERS: Final = re.compile("key|resp|answer|antwort|choice|button|corr|acc$|hit|detect|felt|yes")


@dataclass(frozen=True, slots=True, kw_only=True)
class Roles:
    """Which columns tell whose a row is, its level, and what was answered."""

    person: str
    level: str | None
    answers: Sequence[str] = ()


_Row = tuple[str, float | None, tuple[str, ...]]
"""A word, the level, what was answered."""


def factor_words(table: Sample, name: str, roles: Roles) -> list[str]:
    """Return the numbers of a column that look like a factor, in the order of rows; else none.

    Each has many trials of several levels. It is given in blocks, or trial by trial in equal shares
    of each level, or people are split by it; no count, and neither answers nor levels foretell it.
    A number that only blanks have is none of them. Where a table does not tell a level, there is
    no factor.
    """
    if _FREQUENCY.search(plain(name)) and roles.level is not None and _is_varied(table, name):
        return [*table.words(name)]
    numeric = all(map(NUMBER.fullmatch, table.words(name)))
    if not numeric or roles.level is None or _other(name):
        return []
    people = _people(table, name, roles)
    words = Counter(word for rows in people for word, _, _ in rows)
    few = 1 < len(words) <= MOST
    return (
        [*words] if few and _is_factor(words, people, right_is_told=_right_is_told(table)) else []
    )


def _is_varied(table: Sample, name: str) -> bool:
    """Tell whether a few numbers come often enough each, whatever the levels at which they do."""
    words = table.words(name)
    numeric = all(map(NUMBER.fullmatch, words)) and not any(word in ("0", "1") for word in words)
    return numeric and 1 < len(words) <= MOST and min(words.values()) >= _LEAST_ROWS


def _is_factor(words: Counter[str], people: list[list[_Row]], *, right_is_told: bool) -> bool:
    full = sum(map(_enough, people)) >= _MOST_PEOPLE * len(people)
    if not full or min(words.values()) < max(_LEAST_ROWS, max(words.values()) / 2):
        return False
    several = [rows for rows in people if len({word for word, _, _ in rows}) > 1]
    if not several:
        return _splits(people)
    if 2 * len(several) < len(people) or all(map(_counts_on, several)):
        return False
    rows = [row for one in several for row in one]
    if _told([(word, answers) for word, _, answers in rows]):
        return False
    blocked = all(_RUN * len(_runs(one)) <= len(one) for one in several)
    may_be_place = _is_counting(words) and right_is_told
    return blocked or (_planned(several) and not _is_stimulus(rows) and not may_be_place)


def _is_stimulus(rows: Sequence[_Row]) -> bool:
    """Tell whether numbers are another name of the level, of the answer or of the right one."""
    levels = [(word, level) for word, level, _ in rows]
    return _told(levels) or _told([(w, (at, said)) for w, at, said in rows]) or _is_target(rows)


def with_unit(word: str, name: str) -> str:
    """Return a number with the unit, or what else it is, after the name of its column.

    >>> with_unit("200", "freq_Hz"), with_unit("32", "hand.temp")
    ('200 Hz', 'temp 32')
    """
    called, unit = _unit(name)
    return f"{word} {unit}" if unit else f"{' '.join(filter(None, _PARTED.split(called)))} {word}"


def _unit(name: str) -> tuple[str, str]:
    """Split the last part of a name from its unit."""
    last = name.rpartition(".")[2].rstrip(")] ")
    found = _UNIT.search(last)
    return (last[: found.start()], found[1]) if found else (last, "")


def _other(name: str) -> bool:
    """Tell whether a name says that its numbers are something else, as of ``trials.thisRepN``.

    >>> [one for one in ("freq_Hz", "keyCode", "iti_ms", "blockNr", "temp") if _other(one)]
    ['keyCode', 'iti_ms', 'blockNr']
    """
    parts = [part.lower() for part in _PART.findall(_unit(name)[0])]
    while len(parts) > 1 and _SUFFIX.fullmatch(parts[-1]):
        parts.pop()
    whole = "".join(parts)
    stems = {whole, *(whole.removesuffix(end) for end in ("nr", "num", "number", "code", "idx"))}
    named = {*stems, *parts[-1:], *(part for part in parts if part == "this")}
    return (
        not parts
        or any(map(_ENDING.search, stems))
        or any(map(_WORD.fullmatch, named))
        or bool({*parts} & {*LEVELS})
    )


def _people(table: Sample, name: str, roles: Roles) -> list[list[_Row]]:
    """Return each person's rows in their order, without words that only blanks have."""
    head = table.header
    answers = [
        one
        for one in dict.fromkeys((*roles.answers, *filter(_answers, head)))
        if one != name and one in head and len(table.words(one)) <= 2 * MOST
    ]
    person, place, level = (head.index(one) for one in (roles.person, name, roles.level or name))
    places = [head.index(one) for one in answers]
    found: dict[str, list[_Row]] = defaultdict(list)
    for row in table.rows:
        at = row[level].replace(",", ".")
        number = float(at) if NUMBER.fullmatch(at) else None
        found[row[person]].append((row[place], number, tuple(row[one] for one in places)))
    used = {word for rows in found.values() for word, level, _ in rows if level}
    return [[row for row in rows if row[0] in used] for rows in found.values()]


def _answers(name: str) -> bool:
    return bool(_ANSWERS.search(name.lower().rpartition(".")[2])) or ".keys" in name


def _enough(rows: list[_Row]) -> bool:
    """Tell whether a person has each value with several trials, and several levels."""
    trials = Counter(word for word, _, _ in rows)
    levels: dict[str, set[float]] = {word: set() for word in trials}
    for word, level, _ in rows:
        if level:
            levels[word].add(level)
    return min(trials.values()) >= _LEAST_EACH and all(
        len(one) >= _LEAST_LEVELS for one in levels.values()
    )


def _splits(people: list[list[_Row]]) -> bool:
    """Tell whether each value has two people or more, of whom each has one."""
    of_value = Counter(rows[0][0] for rows in people)
    return min(of_value.values()) > 1


def _runs(rows: list[_Row]) -> list[tuple[float, int]]:
    """Return each value with the number of rows that it lasts."""
    numbers = (float_of(word) for word, _, _ in rows)
    return [(value, len([*run])) for value, run in groupby(numbers)]


def _is_counting(words: Counter[str]) -> bool:
    values = sorted(float_of(word) for word in words)
    return values[0] in (0, 1) and all(two - one == 1 for one, two in pairwise(values))


def _counts_on(rows: list[_Row]) -> bool:
    """Tell whether numbers merely count on, perhaps anew after equal stretches."""
    runs = _runs(rows)
    values, lengths = zip(*runs, strict=True)
    first = min(values)
    steps = all(two in (one + 1, first) for one, two in pairwise(values))
    anew = list(values).count(first) > 1
    return values[0] == first and steps and not (anew and max(lengths) > 2 * median(lengths))


def _told(rows: Sequence[tuple[str, object]]) -> bool:
    """Tell whether what stands beside it foretells a word in nearly all rows."""
    cells: dict[object, Counter[str]] = defaultdict(Counter)
    for word, beside in rows:
        cells[beside][word] += 1
    large = [cell for cell in cells.values() if cell.total() >= _CELL]
    seen = sum(cell.total() for cell in large)
    return 2 * seen >= len(rows) and sum(max(cell.values()) for cell in large) >= _TOLD * seen


def _planned(people: list[list[_Row]]) -> bool:
    """Tell whether each level has its share of each value more evenly than draws would give it."""
    squares, freedom = 0.0, 0
    for rows in people:
        words = Counter(word for word, _, _ in rows)
        cells = Counter((level, word) for word, level, _ in rows)
        levels = Counter(level for _, level, _ in rows)
        for (level, number), (word, share) in (
            (one, two) for one in levels.items() for two in words.items()
        ):
            expected = number * share / len(rows)
            squares += (cells[level, word] - expected) ** 2 / expected
        freedom += (len(levels) - 1) * (len(words) - 1)
    return squares <= freedom * _even(freedom)


def _even(freedom: int) -> float:
    """Return what share of the scatter by chance one draw in a hundred stays below, half at most.

    The quantile is that of chi square by the cube root (Wilson and Hilferty 1931).

    >>> [round(_even(freedom), 2) for freedom in (1, 5, 20, 100)]
    [0.0, 0.1, 0.41, 0.5]
    """
    spread = 2 / (9 * max(freedom, 1))
    return min(_EVEN, max(1 - spread + _RARE * sqrt(spread), 0.0) ** 3)


def _is_target(rows: Sequence[_Row]) -> bool:
    """Tell whether the usual answer to the highest levels goes with the value."""
    levels = sorted(level for _, level, _ in rows if level is not None)
    least = levels[-max(1, len(levels) // 4)]
    high = [
        (word, answers) for word, level, answers in rows if level is not None and level >= least
    ]
    for at in range(len(rows[0][2])):
        cells: dict[str, Counter[str]] = defaultdict(Counter)
        for word, answers in high:
            cells[word][answers[at]] += 1
        usual = [cell.most_common(1)[0] for cell in cells.values()]
        clear = all(
            n > _USUAL * cell.total() for (_, n), cell in zip(usual, cells.values(), strict=True)
        )
        if clear and len({answer for answer, _ in usual}) > 1:
            return True
    return False


def _right_is_told(table: Sample) -> bool:
    """Tell whether answers are told as right or wrong: 1 and 2 may be where the stimulus was."""
    others = {"detected", "felt", "yes"}
    return any(True for _ in table.named([one for one in HITS if one not in others]))


def roles_by_name(table: Sample, person: str, level: str | None) -> Roles:
    """Return the roles where names alone tell the answers."""
    answers = [*table.named(CALLED["response"]), *table.named(HITS)]
    return Roles(person=person, level=level, answers=answers)
