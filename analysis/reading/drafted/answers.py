"""Which columns are those of side and answer, and what their words are."""

from __future__ import annotations

import re
from collections import Counter
from statistics import fmean
from typing import TYPE_CHECKING, Final

from analysis.reading.cells import NOTHING
from analysis.reading.drafted.levels import level_of, silent_words
from analysis.reading.drafted.names import (
    ABSENT,
    CALLED,
    CATCH,
    FELT,
    HITS,
    MISSED,
    PRESENT,
    WORDS,
)
from analysis.reading.drafted.sample import Sample, plain
from analysis.reading.foreign.files import FILE, STANDS_FOR

if TYPE_CHECKING:
    from collections.abc import Sequence

_INITIALS: Final = (("l", "r"), ("g", "d"))
"""Of left and right in English, and in French."""
_SIDES: Final = 2
_LEAST_BLANKS: Final = 5  # from which it can be seen
_MOST_FALSE: Final = 0.5  # of blanks that are felt
_CLEAR: Final = 0.9  # of a key's answers are the same, felt or not
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
    blank = blank_rows(table)
    answers = {*table.named(CALLED["response"])}
    found: dict[bool, list[str]] = {False: [], True: []}
    for name in dict.fromkeys(table.header):
        words = [WORDS.get(plain(word), "") for word in given(table, name)]
        told = {"left", "right"} <= {*words} and words.count("") <= 1
        right = bool(_RIGHT.search(name))
        free = name not in answers and (right or not _ANSWERED.search(name.lower()))
        apart = any(blank) and _apart(table, name, blank)
        if apart and len(apart[1]) == 1:
            continue  # the right key of a yes/no task
        if told and free and not _of_person(table, name):
            found[right].append(name)
    one = found[False] or found[True]
    return one[0] if len(one) == 1 else None


def _of_person(table: Sample, name: str) -> bool:
    """Tell whether a column has several words, and most people one of them, as a handedness."""
    words = words_of_each(table, name)
    single = sum(len(one) == 1 for one in words)
    return len(set[str]().union(*words)) > 1 and 2 * single > len(words)


def words_of_each(table: Sample, name: str) -> list[set[str]]:
    """Return the words that a column has in each participant, by the files if nothing else tells.

    >>> words_of_each(Sample(header=["subject", "hand"], rows=[["1", "l"], ["2", "r"]]), "hand")
    [{'l'}, {'r'}]
    """
    at, whose = table.header.index(name), person_of(table)
    who = table.header.index(whose) if whose else None
    words: dict[str, set[str]] = {}
    for row in table.rows:
        words.setdefault("" if who is None else row[who], set()).add(row[at])
    return [*words.values()]


def person_of(table: Sample) -> str | None:
    """Return the column that tells whose a row is, if it is but the name of the file."""
    called = table.called(CALLED["participant"]) or STANDS_FOR["participant"]
    return next((one for one in (called, FILE) if one in table.header), None)


def _apart(table: Sample, name: str, blank: Sequence[bool]) -> tuple[set[str], set[str]] | None:
    """Return the words that a column has in blanks, and in stimuli, if none stands in both."""
    at = table.header.index(name)
    words: dict[bool, set[str]] = {False: set(), True: set()}
    for row, is_blank in zip(table.rows, blank, strict=True):
        words[is_blank].add(row[at])
    return (words[True], words[False]) if words[True].isdisjoint(words[False]) else None


def blank_rows(table: Sample) -> list[bool]:
    """Tell of each row whether it is a blank: by a level of 0, or else by a column of its own.

    Where 0 is a level, as in dB, -inf is none.
    """
    silent = [False] * len(table.rows)
    if (level := level_of(table)) is not None:
        words, at = silent_words(table, level), table.header.index(level)
        silent = [row[at] in words for row in table.rows]
    name, word = blanks_told_by(table)
    if any(silent) or not word:
        return silent
    at = table.header.index(name)
    return [row[at] == word for row in table.rows]


def blanks_told_by(table: Sample) -> tuple[str, str]:
    """Return a column of two words that may tell blanks, and its word for them; or nothing."""
    for names, blank in ((CATCH, "1"), (PRESENT, "0")):
        name = table.called(names)
        if name is not None and is_hit(table, name):
            words = {FELT[word.lower()]: word for word in given(table, name)}
            return name, words.get(blank, "")
    for name in dict.fromkeys(table.header):
        both = given(table, name)
        found = [word for word in both if plain(word) in (*CATCH, *ABSENT)]
        if len(both) - len(found) == len(found) == 1:
            return name, found[0]
    return "", ""


def says_right(table: Sample, hit: str) -> bool:
    """Tell whether 1 is a right answer, not something felt: more than half of the blanks have it.

    >>> rows = [["0", "1"]] * 5 + [["2", "0"], ["2", "1"], ["9", "1"]]
    >>> says_right(Sample(header=["level", "correct"], rows=rows), "correct")
    True
    """
    at = table.header.index(hit)
    said = [row[at].lower() for row, one in zip(table.rows, blank_rows(table), strict=True) if one]
    felt = [FELT[word] == "1" for word in said if word in FELT]
    return len(felt) >= _LEAST_BLANKS and fmean(felt) > _MOST_FALSE


def felt_keys(table: Sample, hit: str) -> tuple[str, dict[str, str]]:
    """Return the column of the answers and which of its words mean felt, by what was right.

    On blanks the right answer is that nothing was felt. Empty where no column fits.
    """
    at, blank = table.header.index(hit), blank_rows(table)
    felt = [
        (FELT[row[at].lower()] == "1") is not is_blank if row[at].lower() in FELT else None
        for row, is_blank in zip(table.rows, blank, strict=True)
    ]
    named = [*table.named(CALLED["response"])]
    others = [name for name in table.header if not _apart(table, name, blank)]  # tell no blanks
    for name in dict.fromkeys((*named, *others)):
        place, cells = table.header.index(name), dict[str, Counter[bool]]()
        for row, one in zip(table.rows, felt, strict=True):
            if one is not None and row[place].lower() not in (*NOTHING, *MISSED):
                cells.setdefault(row[place], Counter())[one] += 1
        least = (1 - _CLEAR) * len(table.rows)  # others are no answers, as a code of time-outs
        usual = {w: cell.most_common(1)[0] for w, cell in cells.items() if cell.total() > least}
        clear = all(n >= _CLEAR * cells[word].total() for word, (_, n) in usual.items())
        if name != hit and clear and {False, True} == {one for one, _ in usual.values()}:
            return name, {word: "01"[one] for word, (one, _) in usual.items()}
    return "", {}


def meaning_of(table: Sample, name: str) -> dict[str, str]:
    """Return what each word of a column of answers is, 1 for felt, by what was right or itself."""
    hit, keys = table.called(HITS), dict[str, str]()
    if hit and hit != name and is_hit(table, hit) and says_right(table, hit):
        column, found = felt_keys(table, hit)
        keys = found if column == name else {}
    return {
        word: keys[word]
        if word in keys
        else "timeout"
        if word.lower() in (*NOTHING, *MISSED)
        else FELT.get(word.lower(), "")
        for word in table.words(name)
    }


def guess_of(table: Sample, ours: str, theirs: str, word: str) -> str:
    """Guess what a word of a column of sides or of answers is; empty text where it must be told.

    A key is the side where it is the right answer, whatever its name: l may be the right one beside
    a. A side without letter or digit, where no level is above 0, is none.
    """
    if word.lower() in NOTHING or (ours == "response" and word.lower() in MISSED):
        return "timeout" if ours == "response" else "none"
    side, level = side_of(table), level_of(table)
    if ours == "response" and side and (keys := _keys_of(table, side, theirs)):
        return keys.get(word, "")
    if ours == "response" and side is None and WORDS.get(plain(word)) in ("left", "right"):
        return ""  # of an arrow for yes, too
    if named := _named(table, ours, theirs, plain(word)):
        return named
    if ours == "side" and level and not plain(word):
        at, beside = table.header.index(theirs), table.header.index(level)
        shown = Sample(header=[level], rows=[[r[beside]] for r in table.rows if r[at] == word])
        return "" if any(shown.numbers(level) or []) else "none"
    return ""


def _named(table: Sample, ours: str, theirs: str, word: str) -> str:
    """Return what a word is by its letters; initials are sides only beside each other."""
    others = {plain(one) for one in table.words(theirs)}
    for initials in _INITIALS:
        if word in initials and (ours == "response" or initials != _INITIALS[0]):
            found = {initials[0]: "left", initials[1]: "right"}[word]
            return found if {*initials} <= others else ""
    return WORDS.get(word, "")


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


def _names_sides(table: Sample, name: str) -> bool:
    """Tell whether answers are left and right where there are stimuli at both."""
    words = {WORDS.get(plain(word), "") for word in given(table, name)}
    return {"left", "right"} <= words and side_of(table) is not None


def has_buttons(table: Sample) -> bool:
    """Tell whether the answers are jsPsych's buttons: it counts them from 0."""
    return {"trial_type", "time_elapsed"} <= {*table.header} and any(
        "button" in kind for kind in table.words("trial_type")
    )


def given(table: Sample, name: str) -> list[str]:
    """Return the words of a column of answers that are answers."""
    return [word for word in table.words(name) if word.lower() not in (*NOTHING, *MISSED)]


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


def _by_what_is_right(
    table: Sample, response: str | None, hit: str
) -> tuple[str | None, str | None]:
    """Return the columns of the answers where `hit` is right and wrong, also of blanks."""
    if response and only_key(table, response):
        return response, response
    name, keys = felt_keys(table, hit)
    if [*keys.values()].count("1") == 1 and not _names_sides(table, name):
        return name, name
    return response if response != hit else None, None


def answers_of(table: Sample) -> tuple[str | None, str | None]:
    """Return the column of the answers, and that of whether something was detected."""
    response, hit = table.called(CALLED["response"]), table.called(HITS)
    both = hit if hit and is_hit(table, hit) else None
    if response and has_buttons(table):
        return response, None
    if both and says_right(table, both):
        return _by_what_is_right(table, response, both)
    in_words = response and all(map(str.isalpha, given(table, response)))
    if response and (
        ((in_words or not both) and is_hit(table, response))
        or (not both and only_key(table, response))
    ):
        return response, response
    if both and response and all(map(str.isdecimal, given(table, response))):
        return both, both  # of two intervals the keys 1 and 2 are no sides
    return response, both
