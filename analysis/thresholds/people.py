"""Counts and guess rate of every participant in every condition."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.counts.table import count_answers, count_levels, counted
from analysis.thresholds.guess import Guessing, guessing
from analysis.thresholds.likelihood import Tables, likelihoods

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.reading.trials import LoadedTrials
    from analysis.thresholds.function import FunctionName
    from analysis.thresholds.likelihood import Likelihood

    Floats = NDArray[np.float64]


_SIGNS: Final = re.compile(r"[^A-Za-z0-9.]")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PersonCounts:
    """What was presented to participants, and what they detected.

    Attributes
    ----------
    names : tuple of tuple of str
        Condition and participant; sorted.
    level_vpp, detected, presented : ndarray of float64, shape (people, most levels of one)
        The levels of each, and counts; a place that is left over is 0 of 0 at 1.
    guesses : tuple of Guessing
    """

    names: tuple[tuple[str, str], ...]
    level_vpp: Floats
    detected: Floats
    presented: Floats
    guesses: tuple[Guessing, ...]
    function: FunctionName = "normal"

    def at(self, places: list[int]) -> PersonCounts:
        """Return the people at these places."""
        return replace(
            self,
            names=tuple(self.names[i] for i in places),
            level_vpp=self.level_vpp[places],
            detected=self.detected[places],
            presented=self.presented[places],
            guesses=tuple(self.guesses[i] for i in places),
        )

    def conditions(self) -> dict[str, list[int]]:
        """Return the rows of each condition, sorted by name."""
        rows: dict[str, list[int]] = {}
        for i, (condition, _) in enumerate(self.names):
            rows.setdefault(condition, []).append(i)
        return dict(sorted(rows.items()))

    def tables(self, axis: Axis) -> Tables:
        """Return the counts on the axis."""
        return Tables(
            x=axis.on_axis(self.level_vpp),
            detected=self.detected,
            presented=self.presented,
            guesses=[one.rate for one in self.guesses],
            x_scale=axis.fitted,
            function=self.function,
        )


@lru_cache(maxsize=2)
def tables_and_likelihoods(people: PersonCounts, axis: Axis) -> tuple[Tables, list[Likelihood]]:
    """Return the counts of people on the axis and their likelihoods.

    The tables of people, groups and differences, and the bands, ask for the same ones in turn.
    """
    tables = people.tables(axis)
    return tables, likelihoods(tables)


def as_amplitudes(people: PersonCounts, axis: Axis) -> tuple[PersonCounts, str]:
    """Return people with levels in dB as amplitudes, and the unit: per cent of 0 dB.

    Levels in another unit stay as they are.
    """
    if axis.x_scale != "dB":
        return people, axis.unit
    amplitudes = 100 * 10 ** (people.level_vpp / 20)
    return replace(people, level_vpp=amplitudes), f"% of 0 {axis.unit}"


def as_named(trials: pd.DataFrame, names: Sequence[str]) -> pd.DataFrame:
    """Return trials with conditions named so, where theirs differ by blanks and signs only.

    A study's names have none: 60Hz is the condition that a table calls 60 Hz. Where two would be
    one so, all stay as they are.

    >>> import pandas as pd
    >>> trials = pd.DataFrame({"condition": ["60 Hz", "rest"]})
    >>> as_named(trials, ["60Hz"])["condition"].tolist()
    ['60Hz', 'rest']
    >>> apart = trials.assign(condition=["+6 dB", "-6 dB"])
    >>> as_named(apart, ["6dB"])["condition"].tolist()
    ['+6 dB', '-6 dB']
    """
    theirs = trials["condition"].astype(str)
    short: dict[str, tuple[set[str], set[str]]] = {}
    for index, some in enumerate((theirs.tolist(), names)):
        for name in some:
            short.setdefault(_SIGNS.sub("", name), (set(), set()))[index].add(name)
    same = {
        one: other
        for own, ours in short.values()
        for one in own
        for other in ours
        if len(own) == len(ours) == 1
    }
    return trials.assign(condition=[same.get(one, one) for one in theirs])


def people_of(trials: pd.DataFrame, alternatives: int = 2) -> PersonCounts:
    """Count the single stimuli and their detections, and find what guesses are worth.

    >>> import pandas as pd
    >>> trials = pd.DataFrame({"participant": "1", "condition": "main", "kind": "single",
    ...     "side": "left", "level_vpp": [60.0, 60.0, 90.0], "reason": "",
    ...     "response": ["left", "both", "left"], "none_offered": True})
    >>> people = people_of(trials)
    >>> people.names, people.detected.tolist(), people.presented.tolist()
    ((('main', '1'),), [[1.0, 1.0]], [[2.0, 1.0]])
    """
    return side_by_side(
        count_levels(count_answers(trials)), lambda names: _guesses(trials, names, alternatives)
    )


def people_in(loaded: LoadedTrials, table: pd.DataFrame) -> PersonCounts:
    """Return the people of trials, or of a table of counts where there is one, and of its cells."""
    if loaded.cells is None:
        return side_by_side(
            table, lambda names: _guesses(loaded.trials, names, loaded.alternatives)
        )
    return people_of_counts(table, loaded.blanks, loaded.alternatives)


def people_of_counts(
    table: pd.DataFrame, blanks: pd.DataFrame | None = None, alternatives: int = 2
) -> PersonCounts:
    """Lay cells and blanks of `analysis.reading.foreign.sum_counts` out by participant."""
    always = table.groupby(_KEY)["none_offered"].all().to_dict()
    columns = [*_KEY, "felt", "presented", "sides"]
    rows = () if blanks is None else blanks[columns].itertuples(index=False, name=None)
    answers_of = {(where, who): (felt / sides, number) for where, who, felt, number, sides in rows}
    return side_by_side(
        table,
        lambda names: [
            guessing(
                none_offered=bool(always[name]),
                sided_answers=answers_of.get(name, (0, 0))[0],
                blanks=int(answers_of.get(name, (0, 0))[1]),
                alternatives=alternatives,
            )
            for name in names
        ],
    )


_KEY = ["condition", "participant"]


def side_by_side(
    table: pd.DataFrame, guesses_of: Callable[[Sequence[tuple[str, str]]], Sequence[Guessing]]
) -> PersonCounts:
    """Lay levels, detected and presented of each participant in a row of its own."""
    counts = table.sort_values([*_KEY, "level_vpp"])
    names = tuple(dict.fromkeys(zip(counts["condition"], counts["participant"], strict=True)))
    index = {name: i for i, name in enumerate(names)}
    row = [index[name] for name in zip(counts["condition"], counts["participant"], strict=True)]
    column = counts.groupby(_KEY).cumcount().to_numpy()
    shape = (len(names), int(column.max(initial=0)) + 1)
    level_vpp, detected, presented = np.ones(shape), np.zeros(shape), np.zeros(shape)
    level_vpp[row, column] = counts["level_vpp"]
    detected[row, column] = counts["detected"]
    presented[row, column] = counts["presented"]
    return PersonCounts(
        names=names,
        level_vpp=level_vpp,
        detected=detected,
        presented=presented,
        guesses=tuple(guesses_of(names)),
    )


def _guesses(
    trials: pd.DataFrame, people: Sequence[tuple[str, str]], alternatives: int
) -> list[Guessing]:
    blank, single = counted(trials, "blank"), counted(trials, "single")
    # Of a task with stimuli at one side only, answers with the other are no chance hits.
    sides: dict[tuple[str, str], set[str]] = {}
    for where, who, side in single[[*_KEY, "side"]].drop_duplicates().itertuples(index=False):
        sides.setdefault((where, who), set()).add(side)
    answers_of = zip(*(blank[name] for name in (*_KEY, "response")), strict=True)
    sided = [int(answer in sides.get((where, who), ())) for where, who, answer in answers_of]
    blanks = blank[_KEY].assign(sided=sided).groupby(_KEY)["sided"]
    answers, numbers = blanks.sum().to_dict(), blanks.size().to_dict()
    offered = single["none_offered"].astype("boolean").fillna(value=False).astype(bool)
    always = single[_KEY].assign(offered=offered).groupby(_KEY)["offered"].all().to_dict()
    return [
        guessing(
            none_offered=bool(always[person]),
            sided_answers=int(answers.get(person, 0)) / len(sides[person]),
            blanks=int(numbers.get(person, 0)),
            alternatives=alternatives,
        )
        for person in people
    ]
