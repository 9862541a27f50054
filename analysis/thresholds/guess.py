"""Guess rates: known from the task, or Beta distributed after blank trials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy.special import xlogy

from stimuli.checks import finite

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


MAX_GUESS_RATE: Final = 0.9
FORCED_CHOICE: Final = "forced choice"
"""Basis of the guess rate where "none" could not be answered."""
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
        Its source: ``given``, ``forced choice``, ``blanks``, ``few blanks`` (fewer than 20) or
        ``assumed`` (none).

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

    def log_density(self, gamma: Floats) -> Floats:
        """Return the log density of the angle arcsin(sqrt(gamma)), but for a constant.

        As a function of the angle no such density is infinite; that of a known rate is constant.
        """
        a, b = self.beta or (0.5, 0.5)
        return np.asarray(xlogy(a - 0.5, gamma) + xlogy(b - 0.5, 1 - gamma))


def guess_rate_of(
    *, none_offered: bool, sided_answers: float, blanks: int, alternatives: int = 2
) -> GuessRate:
    """Return the guess rate that a participant's task and blank trials imply.

    A participant who cannot answer "none" guesses one of the `alternatives`. All others are correct
    by chance as often as they answer a blank trial with a given side (`sided_answers` of them). A
    rate of 0 would lower thresholds by 0.4 to 1 dB at true rates of 0.02 to 0.1.

    >>> guess_rate_of(none_offered=False, sided_answers=0, blanks=0).mean
    0.5
    >>> guess_rate_of(none_offered=True, sided_answers=3, blanks=60).basis
    'blanks'
    >>> guess_rate_of(none_offered=True, sided_answers=0, blanks=0).beta
    (1.0, 10.0)
    """
    if not none_offered:
        return GuessRate(mean=1 / alternatives, basis=FORCED_CHOICE)
    return GuessRate.after_blanks(answered=sided_answers, blanks=blanks)
