"""Guess rates: known from the task, or Beta distributed after blank trials."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import xlogy

from experiment.tasks.task import SINGLE
from stimuli.checks import finite

if TYPE_CHECKING:
    from collections.abc import Collection

    from numpy.typing import NDArray

    from experiment.tasks.task import Task

    Floats = NDArray[np.float64]


MAX_GUESS_RATE: Final = 0.9
FORCED_CHOICE: Final = "forced choice"
"""Basis of the guess rate where "none" could not be answered."""
COMPARISON: Final = "comparison"
"""Basis of the guess rate where two stimuli are compared, and no answer is a guess of either."""
BLANKS_NEEDED: Final = 20
"""The table of thresholds marks a guess rate from fewer blank trials."""
_ASSUMED: Final = (0.5, 10)
"""False alarms and blank trials that stand in where there was no blank trial."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GuessRate:
    """A guess rate that is known, or Beta distributed after blank trials.

    Attributes
    ----------
    mean : float
        The rate, or its mean; at most 0.9.
    beta : tuple of float or None
        Both parameters of its Beta distribution; ``None`` where the rate is known.
    basis : str
        Its source: ``given``, ``forced choice``, ``comparison``, ``blanks``, ``few blanks`` (fewer
        than 20) or ``assumed`` (none).

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
    basis: str = "given"

    def __post_init__(self) -> None:
        finite("guess_rate", self.mean, least=0, most=MAX_GUESS_RATE)
        for value in self.beta or ():
            finite("guess_rate.beta", value, above=0)

    @classmethod
    def after_blanks(cls, *, answered: float, blanks: int) -> GuessRate:
        """Return Beta(1/2 + answered, 1/2 + blanks - answered), the posterior after blank trials.

        Parameters
        ----------
        answered : float
            Blank trials that were answered with the side in question.
        blanks : int
            Blank trials; where there was none, Beta(1, 10) is assumed.

        Returns
        -------
        GuessRate

        Examples
        --------
        Ten times the trials give a third of the standard deviation:

        >>> few, many = (GuessRate.after_blanks(answered=n, blanks=20 * n).beta for n in (1, 10))
        >>> spreads = [(a * b / (a + b + 1)) ** 0.5 / (a + b) for a, b in (few, many)]
        >>> 2.5 < spreads[0] / spreads[1] < 4
        True
        """
        basis = "blanks" if blanks >= BLANKS_NEEDED else "few blanks"
        if not blanks:
            (answered, blanks), basis = _ASSUMED, "assumed"
        a, b = 0.5 + answered, 0.5 + blanks - answered
        return cls(mean=min(a / (a + b), MAX_GUESS_RATE), beta=(a, b), basis=basis)

    @property
    def share_of_blanks(self) -> float:
        """The share of blank trials that had the answer in question; NaN of a known rate.

        >>> round(GuessRate.after_blanks(answered=3, blanks=60).share_of_blanks, 12)
        0.05
        """
        if self.beta is None:
            return math.nan
        a, b = self.beta
        return (a - 0.5) / (a + b - 1)

    @property
    def lapse_share(self) -> float:
        """The share of lapses that count as detected.

        None of them does, but where two stimuli are compared: who misses both answers either.
        """
        return 0.5 if self.basis == COMPARISON else 0.0

    def log_density(self, gamma: Floats) -> Floats:
        """Return the log density of the angle arcsin(sqrt(gamma)), but for a constant.

        As a function of the angle no such density is infinite; that of a known rate is constant.
        """
        a, b = self.beta or (0.5, 0.5)
        return np.asarray(xlogy(a - 0.5, gamma) + xlogy(b - 0.5, 1 - gamma))


def forced_guess_rate(task: Task, alternatives: int | None = None) -> GuessRate:
    """Return the guess rate of a task where "none" cannot be answered.

    It is 1 / `alternatives`, by default the number of correct answers to single stimuli. In a
    comparison with a reference it is 0, because no answer counts as a guess.

    >>> from experiment.tasks import make_task
    >>> [round(forced_guess_rate(make_task(name)).mean, 2) for name in ("2ifc", "3ifc")]
    [0.5, 0.33]
    """
    if task.scoring == "discrimination":
        return GuessRate(mean=0.0, basis=COMPARISON)
    number = alternatives or len(task.correct_answers)
    return GuessRate(mean=min(1 / number, MAX_GUESS_RATE), basis=FORCED_CHOICE)


def chances_of(task: Task, presented: Collection[str] | None = None) -> dict[str, float]:
    """Return how often each answer, given without a stimulus, would detect a single one.

    It is the share of the single stimuli, or of those `presented`, that it detects.

    >>> from experiment.tasks import LEFT_RIGHT_BOTH, make_task
    >>> chances_of(LEFT_RIGHT_BOTH), chances_of(make_task("yes-no"))
    ({'left': 0.5, 'right': 0.5, 'both': 0.0, 'none': 0.0}, {'yes': 1.0, 'no': 0.0})
    """
    singles = [
        shown.name for shown in task.of_kind(SINGLE) if presented is None or shown.name in presented
    ]
    return {
        answer: sum(task.is_detected(name, answer) for name in singles) / max(len(singles), 1)
        for answer in task.answer_names
    }


def guess_rate_of(
    *, none_offered: bool, sided_answers: float, blanks: int, forced: GuessRate | None = None
) -> GuessRate:
    """Return the guess rate that a participant's task and blank trials imply.

    A participant who cannot answer "none" has the rate `forced`, by default that of two
    alternatives. All others are correct by chance as often as they answer a blank trial with a
    given side (`sided_answers` of them). A rate of 0 would lower thresholds by 0.4 to 1 dB at true
    rates of 0.02 to 0.1.

    >>> guess_rate_of(none_offered=False, sided_answers=0, blanks=0).mean
    0.5
    >>> guess_rate_of(none_offered=True, sided_answers=3, blanks=60).basis
    'blanks'
    >>> guess_rate_of(none_offered=True, sided_answers=0, blanks=0).beta
    (1.0, 10.0)
    """
    if not none_offered:
        return forced or GuessRate(mean=0.5, basis=FORCED_CHOICE)
    return GuessRate.after_blanks(answered=sided_answers, blanks=blanks)
