"""Which columns are those of side and answer, and what their words are."""

from __future__ import annotations

import re
from typing import Final

from analysis.reading.cells import NOTHING
from analysis.reading.drafted.levels import level_of
from analysis.reading.drafted.names import CALLED, FELT, HITS, WORDS
from analysis.reading.drafted.sample import Sample, plain

_INITIALS: Final = {"l", "r"}
"""Keys that are the initials of sides only beside each other."""
_SIDES: Final = 2
_RIGHT: Final = re.compile("^[cC]orr|[._a-z][cC]orr|richtig|Richtig")
_ANSWERED: Final = re.compile("key|resp|answer|antwort|choice|button|taste|reponse")


def side_of(table: Sample) -> str | None:
    """Return the column of the side: by its name or, if there is a single one, by its words.

    These are left and right, with at most one that is not known, and change within a participant,
    as a handedness does not. A column of answers is none, one of right answers only without others.
    """
    named = [*table.named(CALLED["side"])]
    if called := next((name for name in named if not _of_person(table, name)), None):
        return called
    answers = {*table.named(CALLED["response"])}
    found: dict[bool, list[str]] = {False: [], True: []}
    for name in dict.fromkeys(table.header):
        words = [WORDS.get(plain(word), "") for word in given(table, name)]
        told = {"left", "right"} <= {*words} and words.count("") <= 1
        right = bool(_RIGHT.search(name))
        free = name not in answers and (right or not _ANSWERED.search(name.lower()))
        if told and free and not _of_person(table, name):
            found[right].append(name)
    one = found[False] or found[True]
    return one[0] if len(one) == 1 else None


def _of_person(table: Sample, name: str) -> bool:
    """Tell whether a column has several words, but not in everybody, as a handedness does."""
    who = table.called(CALLED["participant"])
    pairs = {(row[table.header.index(who)] if who else "", row[table.header.index(name)])
             for row in table.rows}  # fmt: skip
    words = {word for _, word in pairs}
    return len(words) > 1 and len(pairs) < 2 * len({one for one, _ in pairs})


def guess_of(table: Sample, ours: str, theirs: str, word: str) -> str:
    """Guess what a word of a column of sides or of answers is; empty text where it must be told.

    A key is the side where it is the right answer, whatever its name: l may be the right one beside
    a. A side without a letter, where no level is above 0, is none.
    """
    if word.lower() in NOTHING:
        return "timeout" if ours == "response" else "none"
    side, level = side_of(table), level_of(table)
    if ours == "response" and side and (keys := _keys_of(table, side, theirs)):
        return keys.get(word, "")
    if plain(word) in WORDS:
        alone = ours == "response" and plain(word) in _INITIALS
        others = {plain(one) for one in table.words(theirs)} if alone else _INITIALS
        return WORDS[plain(word)] if others >= _INITIALS else ""
    if ours == "side" and level and not plain(word):
        at, beside = table.header.index(theirs), table.header.index(level)
        shown = Sample(header=[level], rows=[[r[beside]] for r in table.rows if r[at] == word])
        return "" if any(shown.numbers(level) or []) else "none"
    return ""


def _keys_of(table: Sample, side: str, theirs: str) -> dict[str, str]:
    """Return the keys that are the right answer at one side each, of both sides."""
    rights = [name for name in dict.fromkeys(table.header) if _RIGHT.search(name)]
    rights = [one for one in rights if {*given(table, one)} <= {*table.words(theirs)}]
    if len(rights) != 1 or len(given(table, rights[0])) < _SIDES:
        return {}
    at, beside = table.header.index(rights[0]), table.header.index(side)
    where: dict[str, set[str]] = {}
    for row in table.rows:
        where.setdefault(row[at], set()).add(row[beside])
    alone = {key: next(iter(one)) for key, one in where.items() if len(one) == 1}
    found = {key: guess_of(table, "side", side, one) for key, one in alone.items()}
    named = [*found.values()]
    return found if {"left", "right"} <= {*named} and len(named) == len({*named}) else {}


def has_buttons(table: Sample) -> bool:
    """Tell whether the answers are jsPsych's buttons: it counts them from 0."""
    return {"trial_type", "time_elapsed"} <= {*table.header} and any(
        "button" in kind for kind in table.words("trial_type")
    )


def given(table: Sample, name: str) -> list[str]:
    """Return the words of a column of answers that are answers."""
    return [word for word in table.words(name) if word.lower() not in NOTHING]


def is_hit(table: Sample, name: str) -> bool:
    """Tell whether a column says yes and no only."""
    words = {word.lower() for word in given(table, name)}
    return bool(words) and words <= {*FELT}


def only_key(table: Sample, name: str) -> str:
    """Return the only key of a go/no-go task, pressed where something was felt; else nothing.

    >>> from analysis.reading.drafted.sample import Sample
    >>> only_key(Sample(header=["key"], rows=[["space"], ["None"]]), "key")
    'space'
    """
    keys = given(table, name)
    told = len(keys) == 1 and (plain(keys[0]) in WORDS or FELT.get(keys[0].lower()) == "0")
    return keys[0] if len(keys) == 1 < len(table.words(name)) and not told else ""


def may_be_answers(table: Sample) -> list[str]:
    """List the columns whose words may be answers, where none is called so.

    >>> may_be_answers(Sample(header=["n", "said"], rows=[["1", "yes"], ["2", "no"]]))
    ['said']
    """
    if any(answers_of(table)):
        return []
    known = {*WORDS, *(word for word in FELT if word.isalpha())}
    words = {name: {*map(plain, given(table, name))} for name in dict.fromkeys(table.header)}
    return [name for name, one in words.items() if len(one) > 1 and one <= known]


def answers_of(table: Sample) -> tuple[str | None, str | None]:
    """Return the column of the answers, and that of whether something was detected."""
    response, hit = table.called(CALLED["response"]), table.called(HITS)
    both = hit if hit and is_hit(table, hit) else None
    if response and has_buttons(table):
        return response, None
    if response and (is_hit(table, response) or (only_key(table, response) and not both)):
        return response, response
    if both and response and all(map(str.isdecimal, given(table, response))):
        return both, both  # of two intervals the keys 1 and 2 are no sides
    return response, both
