"""Counts and guess rate of every participant in every condition."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from itertools import count
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import xlogy

from analysis.answers.counting import counted
from analysis.answers.detection import cells
from stimuli.checks import finite

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.axis import Axis
    from analysis.reading.load import LoadedTrials

    Floats = NDArray[np.float64]


MOST_GUESSES: Final = 0.9
_PARTS_OF_ONE: Final = 2.0
"""Of a quarter turn, for one trial: after n the angle's standard deviation is 1 / (2 sqrt n)."""
_MATTERS: Final = 16.0
"""Of log density below the greatest."""
_BLOCK: Final = 4
"""Nodes begin and end with one of so many, so that people share them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuessRate:
    """A guess rate that is known, or Beta distributed after blank trials.

    Attributes
    ----------
    mean : float
        The rate, or its mean; the likeliest functions take no mean above 0.9.
    beta : tuple of float or None
        Both parameters of its Beta distribution; ``None`` where the rate is known.

    Raises
    ------
    ValueError
        If the rate is not from 0 to 0.9, or a parameter not above 0.

    Examples
    --------
    >>> GuessRate.after_blanks(answered=3, blanks=60).mean
    0.05737704918032787
    """

    mean: float
    beta: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        finite("guess_rate", self.mean, least=0, most=MOST_GUESSES)
        for value in self.beta or ():
            finite("guess_rate.beta", value, above=0)

    @property
    def known(self) -> bool:
        """Whether it is a number rather than a distribution."""
        return self.beta is None

    @classmethod
    def after_blanks(cls, *, answered: float, blanks: int) -> GuessRate:
        """Return what blank trials tell, Beta(1/2 + answered, 1/2 + blanks - answered).

        Parameters
        ----------
        answered : float
            Blank trials that were answered with the side in question.
        blanks : int
            Blank trials; where there was none, half an answer in ten is assumed: Beta(1, 10).

        Returns
        -------
        GuessRate

        Examples
        --------
        Ten times the trials tell it three times as well:

        >>> few, many = (GuessRate.after_blanks(answered=n, blanks=20 * n).beta for n in (1, 10))
        >>> spreads = [(a * b / (a + b + 1)) ** 0.5 / (a + b) for a, b in (few, many)]
        >>> 2.5 < spreads[0] / spreads[1] < 4
        True
        """
        if not blanks:
            answered, blanks = _ASSUMED
        a, b = 0.5 + answered, 0.5 + blanks - answered
        return cls(mean=min(a / (a + b), MOST_GUESSES), beta=(a, b))

    def log_density(self, gamma: Floats) -> Floats:
        """Return the log density of the angle arcsin(sqrt(gamma)) but for a constant.

        As a function of the angle no density is infinite, and each is even about 0.
        """
        a, b = self.beta or (0.5, 0.5)
        return np.asarray(xlogy(a - 0.5, gamma) + xlogy(b - 0.5, 1 - gamma))

    def nodes(self, stimuli: float) -> tuple[float, ...]:
        """Return rates over which a likelihood of so many stimuli times the density is summed.

        They are midpoints of equal parts of the angle's quarter turn, by which even functions are
        integrated with an error that falls exponentially; they lie at most 1.6 standard deviations
        of the posterior apart. People who know about as much have the same ones. A known rate is
        alone.

        >>> [round(one, 2) for one in GuessRate.after_blanks(answered=1, blanks=2).nodes(0)]
        [0.01, 0.08, 0.22, 0.4, 0.6, 0.78, 0.92, 0.99]
        """
        if self.beta is None:
            return (self.mean,)
        parts = next(
            n for n in _parts() if n >= _PARTS_OF_ONE * math.sqrt(sum(self.beta) + stimuli)
        )
        gamma = np.sin((np.arange(parts) + 0.5) * (math.pi / 2 / parts)) ** 2
        log = self.log_density(gamma)
        near = np.flatnonzero(log > log.max() - _MATTERS)
        first, last = near[0] // _BLOCK * _BLOCK, (near[-1] // _BLOCK + 1) * _BLOCK
        return tuple(gamma[first:last].tolist())


def _parts() -> Iterator[int]:
    """Yield 8, 12, 16, 24, 32, 48 and so on."""
    for power in count(3):
        yield 2**power
        yield 3 * 2 ** (power - 1)


FORCED_CHOICE: Final = "forced choice"
"""Basis of the guess rate where "none" could not be answered."""
BLANKS_NEEDED: Final = 20
"""Fewer blank trials tell little of a guess rate, and the table of thresholds says so."""

_ASSUMED: Final = (0.5, 10)
"""False alarms of one side and blank trials that count where there was no blank trial."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Guessing:
    """The guess rate of a participant, and where it comes from."""

    rate: GuessRate
    basis: str  # "forced choice", "blanks", "few blanks" or "assumed"


def guessing(
    *, none_offered: bool, sided_answers: float, blanks: int, alternatives: int = 2
) -> Guessing:
    """Return the guess rate that a participant's answers allow.

    Who feels nothing and cannot say so guesses one of the `alternatives`. Who can say so is right
    by chance as often as a blank trial is answered with a given side (`sided_answers` of them). A
    rate of 0 would lower thresholds by 0.4 to 1 dB at true rates of 0.02 to 0.1.

    >>> guessing(none_offered=False, sided_answers=0, blanks=0).rate.mean
    0.5
    >>> guessing(none_offered=True, sided_answers=3, blanks=60).basis
    'blanks'
    >>> guessing(none_offered=True, sided_answers=0, blanks=0).rate.beta
    (1.0, 10.0)
    """
    if not none_offered:
        return Guessing(rate=GuessRate(mean=1 / alternatives), basis=FORCED_CHOICE)
    rate = GuessRate.after_blanks(answered=sided_answers, blanks=blanks)
    if not blanks:
        return Guessing(rate=rate, basis="assumed")
    return Guessing(rate=rate, basis="blanks" if blanks >= BLANKS_NEEDED else "few blanks")


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

    def by_content(self) -> PersonCounts:
        """Return the same people, ordered by their counts: other names change no last digit."""
        return self.at(sorted(range(len(self.names)), key=self._content))

    def at(self, places: list[int]) -> PersonCounts:
        """Return the people at these places."""
        return PersonCounts(
            names=tuple(self.names[i] for i in places),
            level_vpp=self.level_vpp[places],
            detected=self.detected[places],
            presented=self.presented[places],
            guesses=tuple(self.guesses[i] for i in places),
        )

    def _content(self, i: int) -> tuple[list[float], ...]:
        rate = self.guesses[i].rate
        counts = (self.level_vpp[i], self.detected[i], self.presented[i])
        return (*(one.tolist() for one in counts), [rate.mean, *(rate.beta or ())])


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
    for place, some in enumerate((theirs.tolist(), names)):
        for name in some:
            short.setdefault(_SIGNS.sub("", name), (set(), set()))[place].add(name)
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
    return _side_by_side(cells(trials), lambda names: _guesses(trials, names, alternatives))


def people_in(loaded: LoadedTrials, table: pd.DataFrame) -> PersonCounts:
    """Return the people of trials, or of a table of counts where there is one, and of its cells."""
    if loaded.cells is None:
        return _side_by_side(
            table, lambda names: _guesses(loaded.trials, names, loaded.alternatives)
        )
    return people_of_counts(table, loaded.blanks, loaded.alternatives)


def people_of_counts(
    table: pd.DataFrame, blanks: pd.DataFrame | None = None, alternatives: int = 2
) -> PersonCounts:
    """Lay cells and blanks of `analysis.reading.foreign.counts.Counted` out by participant."""
    always = table.groupby(_KEY)["none_offered"].all().to_dict()
    columns = [*_KEY, "felt", "presented", "sides"]
    rows = () if blanks is None else blanks[columns].itertuples(index=False, name=None)
    told = {(where, who): (felt / sides, number) for where, who, felt, number, sides in rows}
    return _side_by_side(
        table,
        lambda names: [
            guessing(
                none_offered=bool(always[name]),
                sided_answers=told.get(name, (0, 0))[0],
                blanks=int(told.get(name, (0, 0))[1]),
                alternatives=alternatives,
            )
            for name in names
        ],
    )


_KEY = ["condition", "participant"]


def _side_by_side(
    table: pd.DataFrame, guesses_of: Callable[[Sequence[tuple[str, str]]], Sequence[Guessing]]
) -> PersonCounts:
    """Lay levels, detected and presented of each participant in a row of its own."""
    counts = table.sort_values([*_KEY, "level_vpp"])
    names = tuple(dict.fromkeys(zip(counts["condition"], counts["participant"], strict=True)))
    place = {name: i for i, name in enumerate(names)}
    row = [place[name] for name in zip(counts["condition"], counts["participant"], strict=True)]
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
    told = zip(*(blank[name] for name in (*_KEY, "response")), strict=True)
    sided = [int(answer in sides.get((where, who), ())) for where, who, answer in told]
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
