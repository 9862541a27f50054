"""Counts and guess rate of every participant in every condition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.answers.counting import counted
from analysis.answers.detection import cells
from analysis.thresholds.density import legendre
from stimuli.checks import finite

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import pandas as pd
    from numpy.typing import NDArray

    from analysis.reading.load import LoadedTrials

    Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class GuessRate:
    """A guess rate that is known, or Beta distributed after blank trials.

    Attributes
    ----------
    mean : float
        The rate, or its mean.
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
    >>> at, weight = GuessRate.after_blanks(answered=3, blanks=60).nodes(5)
    >>> round(float(at @ weight), 12)
    0.05737704918
    """

    mean: float
    beta: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        finite("guess_rate", self.mean, least=0, most=0.9)
        for value in self.beta or ():
            finite("guess_rate.beta", value, above=0)

    @property
    def known(self) -> bool:
        """Whether it is a number rather than a distribution."""
        return self.beta is None

    @classmethod
    def after_blanks(cls, *, answered: float, blanks: int) -> GuessRate:
        """Return what blank trials tell, Beta(1/2 + answered, 1/2 + blanks - answered).

        Where there was none, half an answer in ten is assumed: Beta(1, 10).
        """
        if not blanks:
            answered, blanks = _ASSUMED
        a, b = 0.5 + answered, 0.5 + blanks - answered
        return cls(mean=a / (a + b), beta=(a, b))

    def nodes(self, points: int) -> tuple[Floats, Floats]:
        """Return points and weights that integrate over it, by Gauss and Jacobi.

        Parameters
        ----------
        points : int
            How many; a known rate is all of them.

        Returns
        -------
        at, weight : ndarray of float64, shape (points,)
            The weights sum to 1.
        """
        if self.beta is None:
            return np.full(points, self.mean), np.full(points, 1 / points)
        return _gauss_jacobi(*self.beta, points)

    def between(self, low: float, high: float, points: int) -> tuple[Floats, Floats]:
        """Return points and relative weights of a distributed rate between two bounds.

        By Gauss and Legendre in the angle arcsin(sqrt(gamma)), where no density is infinite.
        """
        from scipy.special import xlogy

        a, b = self.beta or (0.5, 0.5)
        at, weight = legendre(points)
        ends = np.arcsin(np.sqrt([low, high]))
        sine = np.sin(ends[0] + at * np.ptp(ends)) ** 2
        log = xlogy(a - 0.5, sine) + xlogy(b - 0.5, 1 - sine)
        return sine, weight * np.exp(log - log.max())


def _gauss_jacobi(a: float, b: float, points: int) -> tuple[Floats, Floats]:
    """Return points and weights by which Beta(a, b) is integrated over.

    From the recurrence of the Jacobi polynomials (G. H. Golub and J. H. Welsch, Math. Comp. 23
    (1969) 221-230), whose weights sum to 1 by themselves: no power of a large number is taken.
    """
    k = np.arange(1, points)
    s = 2.0 * k + a + b - 2
    middle = np.concatenate([[(a - b) / (a + b)], (a - b) * (a + b - 2) / (s * (s + 2))])
    first = np.where(k == 1, 1.0, (k + a + b - 2) / (s - 1))
    beside = np.sqrt(4 * k * (k + a - 1) * (k + b - 1) * first / (s * s * (s + 1)))
    at, vectors = np.linalg.eigh(np.diag(middle) + np.diag(beside, 1) + np.diag(beside, -1))
    return (at + 1) / 2, vectors[0] ** 2


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
        return Guessing(rate=GuessRate(mean=1 / alternatives), basis="forced choice")
    rate = GuessRate.after_blanks(answered=sided_answers, blanks=blanks)
    if not blanks:
        return Guessing(rate=rate, basis="assumed")
    return Guessing(rate=rate, basis="blanks" if blanks >= BLANKS_NEEDED else "few blanks")


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
        order = sorted(range(len(self.names)), key=self._content)
        return PersonCounts(
            names=tuple(self.names[i] for i in order),
            level_vpp=self.level_vpp[order],
            detected=self.detected[order],
            presented=self.presented[order],
            guesses=tuple(self.guesses[i] for i in order),
        )

    def _content(self, i: int) -> tuple[list[float], ...]:
        rate = self.guesses[i].rate
        counts = (self.level_vpp[i], self.detected[i], self.presented[i])
        return (*(one.tolist() for one in counts), [rate.mean, *(rate.beta or ())])


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


def people_in(loaded: LoadedTrials) -> PersonCounts:
    """Return the people of trials, or of a table of counts where there is one."""
    if loaded.cells is None:
        return people_of(loaded.trials, loaded.alternatives)
    return people_of_counts(loaded.cells, loaded.blanks, loaded.alternatives)


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
    sides = {person: {*rows} for person, rows in single.groupby(_KEY)["side"]}
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
