"""Which rows are blanks, and which are no trials."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from analysis.reading.cells import NOTHING
from analysis.reading.drafted.answers import (
    answers_of,
    may_be_answers,
    only_key,
    words_of_each,
)
from analysis.reading.drafted.levels import level_of
from analysis.reading.drafted.names import CALLED, FELT, HITS
from analysis.reading.drafted.sample import listed

if TYPE_CHECKING:
    from analysis.reading.drafted.sample import Sample

_FEW_WORDS: Final = 4
_NO_TRIAL: Final = re.compile(
    "(?<![a-z])(practi[cs]e|prac|training|instructions?|demo|warm.?up|welcome|familiari[sz]ation|"
    "habituation|übung(?:sblock|sdurchgang|sphase)?|entra[iî]nement|[eé]chauffement)(?![a-zà-ÿ])",
    re.IGNORECASE,
)
_CAMEL: Final = re.compile("(?<=[a-z])(?=[A-Z])|[_.]")
_NO_LOOP: Final = re.compile("pract|train|instr|demo|warm.?up|welcome|famil", re.IGNORECASE)
_MOST_PRACTICE: Final = 0.5


def blank_words(table: Sample, level: str) -> tuple[str, list[str]]:
    """Return the column that tells rows without a level, and its words there.

    It has a few words, of which each stands there or elsewhere only; if there is none it is that of
    the level itself. Empty text where all rows have a level.
    """
    at = table.header.index(level)
    empty = [row[at].lower() in NOTHING for row in table.rows]
    if not any(empty) or all(empty):
        return "", []
    answers = {*table.named(CALLED["response"]), *table.named(HITS), *table.named(CALLED["rt_s"])}
    found: dict[int, tuple[str, list[str]]] = {}
    for name in dict.fromkeys(table.header):
        place = table.header.index(name)
        pairs = {(row[place], there) for row, there in zip(table.rows, empty, strict=True)}
        told = len({word for word, _ in pairs}) == len(pairs) <= _FEW_WORDS
        if told and name not in answers and name != level:
            found.setdefault(len(pairs), (name, [word for word, there in pairs if there]))
    itself = level, [word for word in table.words(level) if word.lower() in NOTHING]
    return found[min(found)] if found else itself


def without_level(table: Sample) -> tuple[str, int, float]:
    """Return the column of the level, how many rows have none, and which part of them an answer.

    Where a single key is pressed if something was felt no row tells that it was not answered. The
    word "none" is an answer, as in our tables; PsychoPy's None is not.
    """
    level = level_of(table)
    answers = [name for name in answers_of(table) if name] or may_be_answers(table)
    if level is None or not answers or any(only_key(table, name) for name in answers):
        return level or "", 0, 0.0
    at, places = table.header.index(level), [table.header.index(name) for name in answers]
    rows = [row for row in table.rows if row[at].lower() in NOTHING]
    if len(rows) == len(table.rows):
        return level, 0, 0.0
    said = [{row[place] for place in places} for row in rows]
    answered = [any(word == "none" or word.lower() not in NOTHING for word in one) for one in said]
    return level, len(rows), sum(answered) / max(len(rows), 1)


def trial_loop(table: Sample) -> tuple[str, str]:
    """Return the column of PsychoPy's loop of trials, and what is told of it; nothing without one.

    >>> from analysis.reading.drafted.sample import Sample
    >>> head = ["practice.thisN", "main.thisN"]
    >>> trial_loop(Sample(header=head, rows=[["0", ""], ["", "0"], ["", "1"]]))[0]
    'main.thisN'
    """
    loops = [name for name in table.header if name.endswith(".thisN")]
    if not loops:
        return "", ""
    of_trials = [name for name in loops if not _NO_LOOP.search(name)] or loops
    innermost = max(of_trials, key=table.changes)
    loop = "trials.thisN" if "trials.thisN" in loops else innermost
    inside = len(table.without(loop, "").rows)
    others = sum(len(table.without(one, "").rows) for one in of_trials if one != loop)
    apart = len(table.rows) - inside >= others >= inside / 2
    more = "; others hold trials, too: skip rows that are none by another column" * apart
    return loop, f"guess: outside this loop; loops: {listed(loops)}{more}"


def no_trials(table: Sample, name: str) -> list[str]:
    """Return the words of a column that say that rows are practice and the like.

    None of a column that says what a participant is: each word of it has to be one of several in
    who has it, and they are less than half of the rows. Of a column called practice true is such.
    """
    if name in {table.called(CALLED[one]) for one in ("participant", "condition", "session")}:
        return []
    words = table.words(name)
    found = [word for word in words if _NO_TRIAL.search(_CAMEL.sub(" ", word))]
    if _NO_TRIAL.search(_CAMEL.sub(" ", name)) and {w.lower() for w in words} <= {*FELT, ""}:
        found = [word for word in words if FELT.get(word.lower()) == "1"]
    if any(one <= {*found} for one in words_of_each(table, name)):
        return []
    others = sum(n for word, n in words.items() if word not in found)
    return found if others > _MOST_PRACTICE * len(table.rows) else []
