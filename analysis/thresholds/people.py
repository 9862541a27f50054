"""Counts and guess rate of every participant in every condition."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.counts.table import count_answers, count_levels, counted
from analysis.thresholds.guess import Guessing, guessing
from analysis.thresholds.likelihood import likelihoods
from analysis.thresholds.tables import Tables

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.reading.trials import LoadedTrials
    from analysis.thresholds.function import FunctionName
    from analysis.thresholds.likelihood import Likelihood

    Floats = NDArray[np.float64]

_PERSON: Final = ["condition", "participant"]


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
            guesses=[guess.rate for guess in self.guesses],
            x_scale=axis.fitted,
            function=self.function,
        )


def likelihoods_of(
    people: PersonCounts, axis: Axis, rows: Sequence[int] | None = None
) -> tuple[Tables, list[Likelihood]]:
    """Return the counts on the axis and the likelihoods of people, or of some of them."""
    tables, every = _all_likelihoods(people, axis)
    return (tables, every) if rows is None else (tables.at(rows), [every[row] for row in rows])


@lru_cache(maxsize=2)
def _all_likelihoods(people: PersonCounts, axis: Axis) -> tuple[Tables, list[Likelihood]]:
    # The tables of people, groups and differences, and the bands, need the same ones in turn.
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
    cells = count_levels(count_answers(trials))
    return people_of_counts(cells, _count_sided_answers(trials), alternatives)


def people_in(loaded: LoadedTrials, cells: pd.DataFrame) -> PersonCounts:
    """Return the people of trials, or of a table of counts where there is one, and of its cells."""
    blanks = _count_sided_answers(loaded.trials) if loaded.cells is None else loaded.blanks
    return people_of_counts(cells, blanks, loaded.alternatives)


def people_of_counts(
    cells: pd.DataFrame, blanks: pd.DataFrame | None = None, alternatives: int = 2
) -> PersonCounts:
    """Lay cells and blanks of `analysis.reading.foreign.sum_counts` out by participant."""
    always = cells.groupby(_PERSON)["none_offered"].all()
    answered = {} if blanks is None else blanks.set_index(_PERSON).to_dict("index")

    def guess_of(name: tuple[str, str]) -> Guessing:
        answers = answered.get(name, {"felt": 0, "sides": 1, "presented": 0})
        return guessing(
            none_offered=bool(always[name]),
            sided_answers=answers["felt"] / answers["sides"],
            blanks=int(answers["presented"]),
            alternatives=alternatives,
        )

    return side_by_side(cells, guess_of)


def side_by_side(
    cells: pd.DataFrame, guess_of: Callable[[tuple[str, str]], Guessing]
) -> PersonCounts:
    """Lay levels, detected and presented of each participant in a row of its own."""
    cells = cells.sort_values([*_PERSON, "level_vpp"])
    people = cells.groupby(_PERSON)
    row, column = people.ngroup().to_numpy(), people.cumcount().to_numpy()
    names = tuple(dict.fromkeys(zip(cells["condition"], cells["participant"], strict=True)))
    shape = (len(names), int(column.max(initial=0)) + 1)
    level_vpp, detected, presented = np.ones(shape), np.zeros(shape), np.zeros(shape)
    level_vpp[row, column] = cells["level_vpp"]
    detected[row, column] = cells["detected"]
    presented[row, column] = cells["presented"]
    return PersonCounts(
        names=names,
        level_vpp=level_vpp,
        detected=detected,
        presented=presented,
        guesses=tuple(map(guess_of, names)),
    )


def _count_sided_answers(trials: pd.DataFrame) -> pd.DataFrame:
    """Count the blank trials, and those answered with a side, as `sum_counts` of counts does.

    Of a task with stimuli at one side only, answers with the other are no chance hits.
    """
    single, blank = counted(trials, "single"), counted(trials, "blank")
    sites = {*single[[*_PERSON, "side"]].itertuples(index=False, name=None)}
    answers = blank[[*_PERSON, "response"]].itertuples(index=False, name=None)
    sided = blank[_PERSON].assign(sided=[answer in sites for answer in answers])
    people = sided.groupby(_PERSON, observed=True)["sided"].agg(["sum", "size"])
    sides = single.groupby(_PERSON, observed=True)["side"].nunique().rename("sides")
    people = people.rename(columns={"sum": "felt", "size": "presented"}).join(sides)
    return people.reset_index()
