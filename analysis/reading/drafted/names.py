"""What others call our columns and our words, in small letters without accents, and digits.

In English, German and French; and what the words of a column of answers are, therefore.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from analysis.reading.cells import NOTHING
from analysis.reading.drafted.sample import Sample, plain

if TYPE_CHECKING:
    from collections.abc import Mapping


LEVELS: Final = (
    *("level", "stimlevel", "intensity", "stimintensity", "amplitude", "amp"),
    *("pegel", "stufe", "intensitat", "intensite", "niveau"),
)
OF_VOLTS: Final = ("vpp", "volt", "volts", "voltage", "spannung", "tension")
CALLED: Final[Mapping[str, tuple[str, ...]]] = {
    "participant": (
        *(
            "participant",
            "participantid",
            "person",
            "personid",
            "subject",
            "subjectid",
            "subj",
            "subjid",
            "sub",
            "ppid",
        ),
        *("pid", "observer", "subjectnr", "subjectnumber", "participantnumber", "vp", "vpn", "id"),
        *("versuchsperson", "proband", "teilnehmer", "sujet"),
    ),
    "session": ("session", "sessionid", "ses", "visit", "sitzung", "seance"),
    "condition": ("condition", "cond", "bedingung"),
    "trial": (
        "trial",
        "trialnumber",
        "trialnum",
        "trialno",
        "trialn",
        "thisn",
        "trialindex",
        "durchgang",
        "essai",
    ),
    "side": (
        *("side", "stimside", "stimulusside", "targetside", "location", "hand", "finger"),
        *("seite", "cote"),
    ),
    "level_vpp": (
        *("levelvpp", *LEVELS, *OF_VOLTS[2:], "volume", "gain", "strength", "contrast"),
        *("soa", *(f"{name}{unit}" for unit in ("um", "m", "nm", "mm", "pct") for name in LEVELS)),
    ),
    "response": (
        *("response", "resp", "answer", "keys", "choice", "keypress", "key", "ans", "reply"),
        *("judgment", "judgement", "percept", "report", "verdict"),
        *("antwort", "taste", "reponse", "touche"),
    ),
    "rt_s": (
        *("rts", "rt", "responsetime", "reactiontime", "resprt", "latency", "rtms"),
        *("reaktionszeit", "tempsdereaction", "tempsdereponse"),
    ),
}
"""The first that a heading has is taken."""
HITS: Final = (
    *("detected", "correct", "corr", "responsecorrect", "respcorr", "iscorrect", "felt", "hit"),
    *("accuracy", "acc", "yes", "richtig", "korrekt", "gespurt", "juste", "detecte", "percu"),
)
COUNTS: Final = ("k", "detected", "correct", "hits", "ncorrect", "yes", "nyes", "ndetected")
OF: Final = ("n", "presented", "total", "ntotal", "ntrials", "trials", "shown")
WORDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("l", "left", "arrowleft", "leftarrow", "links", "gauche"), "left"),
    **dict.fromkeys(("r", "right", "arrowright", "rightarrow", "rechts", "droite"), "right"),
    **dict.fromkeys(("b", "both", "beide", "lesdeux"), "both"),
    **dict.fromkeys(
        (
            "no",
            "nothing",
            "blank",
            "catch",
            "null",
            "none",
            "nichts",
            "rien",
            "keine",
            "aucun",
            "aucune",
            "catchtrial",
        ),
        "none",
    ),
}
FELT: Final[Mapping[str, str]] = {
    **dict.fromkeys(("true", "yes", "y", "ja", "j", "oui", "o", "1"), "1"),
    **dict.fromkeys(("false", "no", "n", "nein", "non", "0"), "0"),
}
_INITIALS: Final = {"l", "r"}
"""Keys that are the initials of sides only beside each other."""
_PART: Final = re.compile("[A-Z]?[a-z]+|[A-Z]+")
_MOST_LEVELS: Final = 20
_FEW_WORDS: Final = 4
_SIDES: Final = 2
CODE: Final = re.compile(r"-99|-?9{3,}")
"""Numbers that others write where there is none."""
CATCH: Final = (
    *("catch", "catchtrial", "iscatch", "blank", "blanktrial", "isblank", "nulltrial"),
    *("leer", "leerversuch", "essaiblanc"),
)
_VOLTS: Final = re.compile("volt|spannung|tension")
_UNIT: Final = re.compile(r"[_ .(\[]((?-i:V|mV)|um|µm|nm|mm|pct|percent)[)\]]?$", re.IGNORECASE)
_UNITS: Final = {"pct": "%", "percent": "%"}
_IN_UNIT: Final = re.compile(r"[_ .(\[](um|µm|nm|pct|percent)[)\]]?$", re.IGNORECASE)
_OF_DRIVES: Final = {"drive", "magnitude"}
_NO_TRIAL: Final = re.compile(
    "(?<![a-z])(practi[cs]e|prac|training|instructions?|demo|warm.?up|welcome)(?![a-z])",
    re.IGNORECASE,
)
_MOST_PRACTICE: Final = 0.5
_IN_DB: Final = re.compile(r"(?:^|[^A-Za-z])d[Bb](?=$|[^A-Za-z]|[A-Z])|[a-z]dB$")
_RIGHT: Final = re.compile("^[cC]orr|[._a-z][cC]orr|richtig|Richtig")
_ANSWERED: Final = re.compile("key|resp|answer|antwort|choice|button|taste|reponse")


def level_of(table: Sample) -> str | None:
    """Return the column of the level: by its name or, if it has a few numbers, by a part of it.

    That is a word such as "volts", or else "drive" or, of a single column, a unit of levels.
    """
    if named := table.called(CALLED["level_vpp"]):
        return named
    for words in ({*LEVELS, *OF_VOLTS}, _OF_DRIVES):
        for name in table.header:
            of_levels = {part.lower() for part in _PART.findall(name)} & words
            if of_levels and _has_few_numbers(table, name):
                return name
    units = [name for name in dict.fromkeys(table.header) if in_db(name) or _IN_UNIT.search(name)]
    in_unit = [name for name in units if _has_few_numbers(table, name)]
    return in_unit[0] if len(in_unit) == 1 else None


def _has_few_numbers(table: Sample, name: str) -> bool:
    return 1 < len({*(table.numbers(name) or ())}) <= _MOST_LEVELS


def in_db(name: str) -> bool:
    """Tell whether a column is named after dB.

    >>> [in_db(name) for name in ("level_dB", "dB SL", "leveldB", "gain.db", "feedback", "dbl")]
    [True, True, True, True, False, False]
    """
    return bool(_IN_DB.search(name))


def is_signed(table: Sample, level: str) -> bool:
    """Tell whether 0 is a level: in dB by the name, or where others are below; codes are none.

    >>> is_signed(Sample(header=["amp"], rows=[["-6"], ["0"]]), "amp")
    True
    """
    numbers = table.numbers(level) or []
    return in_db(level) or any(one < 0 and not CODE.fullmatch(f"{one:g}") for one in numbers)


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


def no_trials(table: Sample, name: str) -> list[str]:
    """Return the words of a column that say that rows are practice and the like.

    None of a column that says what a participant is: each word of it has to be one of several in
    who has it, and they are less than half of the rows. Of a column called practice true is such.
    """
    who = table.called(CALLED["participant"])
    if name in (who, table.called(CALLED["condition"]), table.called(CALLED["session"])):
        return []
    words = table.words(name)
    found = [word for word in words if _NO_TRIAL.search(word.replace("_", " "))]
    if _NO_TRIAL.search(re.sub("[_.]", " ", name)) and {w.lower() for w in words} <= {*FELT, ""}:
        found = [word for word in words if FELT.get(word.lower()) == "1"]
    others = [row for row in table.rows if row[table.header.index(name)] not in found]
    if who and {row[table.header.index(who)] for row in others} != {*table.words(who)}:
        return []
    return found if len(others) > _MOST_PRACTICE * len(table.rows) else []


def unit_of(level: str) -> str:
    """Return what levels are in by the name of their column; Vpp is V from peak to peak.

    >>> [unit_of(name) for name in ("amp_um", "drive_pct", "Spannung", "level_vpp", "amp dB", "x")]
    ['um', '%', 'V', 'Vpp', 'dB', '']
    >>> unit_of("amplitude_V"), unit_of("amp (mV)"), unit_of("x_v")
    ('V', 'mV', '')
    """
    if in_db(level):
        return "dB"
    if named := _UNIT.search(level):
        return _UNITS.get(named[1].lower(), named[1])
    return "Vpp" if plain(level).endswith("vpp") else "V" * bool(_VOLTS.search(plain(level)))


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
