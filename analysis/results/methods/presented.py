"""What was presented, in which order, and what takes no part, as far as tables tell it."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Final

from analysis.axis import shortest
from analysis.definitions import TOTAL
from analysis.groups.criterion import ALTERNATED, MIXED
from analysis.results.methods.words import SPELLED, isolated, number_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import pandas as pd

    from analysis.results.tables import Analysis


_FEW_OF_ALL: Final = 0.25
_TURNS: Final = {
    MIXED: "the conditions were interleaved [say how]",
    ALTERNATED: "blocks of the conditions alternated [say how]",
}


def presented_words(analysis: Analysis) -> Iterator[str]:
    """Say of conditions, levels and trials what tables without a plan tell."""
    for name, rows in analysis.participants.groupby("condition"):
        condition = str(name)
        told = "There were "
        if analysis.counts.conditions > 1:
            told = f"Condition {isolated(condition)} had "
        people = [*rows["participant"].unique()]
        more = [*_catch(analysis, condition, people), *_both(analysis, condition, people)]
        parts = [f"{number_of(rows['level_vpp'].nunique(), 'level')} ({_ends(rows, analysis)})"]
        number = rows.set_index("participant")["presented"]
        parts += [f"{_trials(number)} of each for a participant", *more[:-1]]
        yield f"{told}{', '.join(parts)}{f', and {more[-1]}' if more else ''}."


def design_words(analysis: Analysis) -> str:
    """Say in two sentences which conditions and levels there were, and how many trials of each."""
    rows = analysis.participants
    if rows.empty:
        return ""
    names = [isolated(name) for name in rows["condition"].unique()]
    several = len(names) > 1
    told = ""
    if several:
        told = f"There were {len(names)} conditions. "
        if len(names) <= SPELLED:
            told = f"The conditions were {', '.join(names[:-1])} and {names[-1]}. "
    number = rows.groupby(["condition", "participant"])["level_vpp"].nunique()
    levels = " to ".join(dict.fromkeys(str(int(one)) for one in (number.min(), number.max())))
    noun = "level" if number.eq(1).all() else "levels"
    trials = _trials(rows.set_index("participant")["presented"])
    of = "A participant had" if not several else "In each a participant had"
    return f"{told}{of} {levels} {noun} ({_ends(rows, analysis)}) with {trials} of each."


def _catch(analysis: Analysis, condition: str, people: Sequence[str]) -> Iterator[str]:
    number = _of_people(analysis.blank, condition, people)
    if len(number):
        yield _trials(number, "blank (catch) ")


def _both(analysis: Analysis, condition: str, people: Sequence[str]) -> Iterator[str]:
    number = _of_people(analysis.both, condition, people)
    if not len(number):
        return
    trials = analysis.trials
    here = trials["kind"].eq("both") & trials["reason"].eq("") & trials["condition"].eq(condition)
    shown = trials[here & trials["level_vpp"].notna()]
    at = f" (at {_ends(shown, analysis)})" if len(shown) else ""
    yield f"{_trials(number, 'both-finger ')}{at}, which enter no threshold"


def _of_people(table: pd.DataFrame, condition: str, people: Sequence[str]) -> pd.Series[int]:
    """Return how many trials of a kind each of the people had; empty where nobody had any."""
    rows = table[table["participant"].ne(TOTAL)]
    if "condition" in rows:
        rows = rows[rows["condition"].eq(condition)]
    number = rows.set_index("participant")["presented"]
    return (
        number if number.empty else number.reindex(sorted({*number.index, *people}), fill_value=0)
    )


def _ends(rows: pd.DataFrame, analysis: Analysis) -> str:
    """Return the least and the greatest level."""
    ends = (float(rows["level_vpp"].min()), float(rows["level_vpp"].max()))
    return f"{' to '.join(dict.fromkeys(map(shortest, ends)))} {analysis.axis.unit}"


def _trials(numbers: pd.Series[int], kind: str = "") -> str:
    """Return so many trials, the least and the most of a participant, by whom they are indexed.

    Few people with others than the rest, such as one who broke off, are told apart.

    >>> import pandas as pd
    >>> _trials(pd.Series([20, 18])), _trials(pd.Series([1, 1]), "blank ")
    ('18 to 20 trials', '1 blank trial')
    >>> _trials(pd.Series([20, 12, 20, 20, 20]))
    '20 (12 for 1 of 5 participants) trials'
    """
    usual = numbers.eq(numbers.mode().iloc[0])
    people, others = numbers.index.nunique(), numbers[~usual].index.nunique()
    noun = f"{kind}trial{'' if numbers.eq(1).all() else 's'}"
    if 0 < others <= _FEW_OF_ALL * people:
        few = f"({_span(numbers[~usual])} for {others} of {people} participants)"
        return f"{_span(numbers[usual])} {few} {noun}"
    return f"{_span(numbers)} {noun}"


def _span(numbers: pd.Series[int]) -> str:
    return " to ".join(dict.fromkeys(str(int(one)) for one in (numbers.min(), numbers.max())))


def both_words(analysis: Analysis) -> str:
    """Say how many trials with two stimuli are in no threshold; empty text without any."""
    number = analysis.counts.both
    if not number:
        return ""
    enter = "enters" if number == 1 else "enter"
    return f"{number_of(number, 'both-finger trial')} {enter} no threshold"


def order_words(analysis: Analysis) -> str:
    """Say how many participants began with which condition; empty text where that is not known."""
    found = [*_begun(analysis)]
    began = Counter(condition for condition, _ in found if condition)
    turns = Counter(how for condition, how in found if how and not condition)
    told: list[str] = []
    for condition, number in sorted(began.items()):
        people, named = number_of(number, "participant"), f"with condition {isolated(condition)}"
        told.append(f"{number} with {isolated(condition)}" if told else f"{people} began {named}")
    for how, words in _TURNS.items():
        if turns[how]:
            people = str(turns[how]) if told else number_of(turns[how], "participant")
            told.append(f"{'in' if told else 'In'} {people} {words}")
    unknown = len(found) - began.total() - turns.total()
    if told and unknown:
        told.append(f"of {unknown} the order is not known")
    return f"{', '.join(told)}." if told else ""


def _begun(analysis: Analysis) -> Iterator[tuple[str, str]]:
    """Yield of each in several conditions which was over before all others began, or the turns."""
    rows = analysis.differences
    rows = rows[rows["participant"].ne(TOTAL)]
    for _, own in rows.groupby("participant"):
        names = {*own["condition_a"], *own["condition_b"]}
        wins = Counter(one for one in own["first"] if one in names)
        first = [name for name, number in wins.items() if number == len(names) - 1]
        turns = next((one for one in (MIXED, ALTERNATED) if own["first"].eq(one).any()), "")
        yield (str(first[0]) if first else ""), turns
