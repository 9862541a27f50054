"""The Bayesian rule: the level with the least expected entropy of the threshold.

A. B. Watson, QUEST+: a general multidimensional Bayesian adaptive psychometric method, J. Vision
17(3):10 (2017), with the answer probabilities of the task itself, and with the entropy of the
threshold alone (N. Prins, The psi-marginal adaptive method, J. Vision 13(7):3 (2013)).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal, TypeAlias

import numpy as np
from pydantic import Field, field_validator
from scipy.special import ndtr, xlogy

from experiment.levels.rule import Choice, Estimate, LevelRule, Levels, Track
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.tasks.task import BOTH, SINGLE, Guessing, Sensation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from experiment.tasks.task import Presentation, Task

    Floats = NDArray[np.float64]

Rates: TypeAlias = Annotated[
    tuple[Annotated[float, Field(ge=0, lt=1)], ...], Field(min_length=1, strict=False)
]
"""Probabilities below 1."""

THRESHOLDS: Final = 61
"""Points of the threshold grid."""
THRESHOLD_MARGIN: Final = 2.0
"""How far the threshold grid reaches beyond the lowest and the highest candidate, as a factor."""
FIRST_CHOICES: Final = (2 / 3, 1 / 3)
"""Where the first levels of a track lie in the logarithmic range of the candidates."""
ENTROPY_DIGITS: Final = 9
"""Digits of an entropy in bits. Levels whose entropies agree in them are tied, so that the last
bits of a machine's arithmetic do not choose a level."""
INTERPOLATED: Final = 1001
"""Points between which quantiles are interpolated."""
QUANTILES: Final = (0.5, 0.025, 0.975)
"""The estimate and the ends of its interval."""


class Bayesian(LevelRule):
    """Choose the level after whose answer the threshold is expected to be known best.

    The participant detects a level with probability Phi(log10(level / threshold) / sigma) at the
    driven site, and nothing at the other sites: crosstalk is neglected. The task decides which
    answer follows. Guesses between sites are unbiased, and lapses are spread evenly over the
    offered answers. The prior is flat over the grid, whose thresholds have equal steps of their
    logarithm.

    Examples
    --------
    >>> rule = Bayesian(candidates_vpp=(50.0, 70.0, 100.0, 140.0), seed=1)
    >>> site, other = LEFT_RIGHT_BOTH.sites
    >>> track = rule.start((site, other, "none"))
    >>> track.choose(1, 1).level_vpp, track.estimate()
    (100.0, None)
    >>> track.update(LEFT_RIGHT_BOTH.presentation(site), 100.0, "none")
    >>> track.estimate().threshold_vpp > 100.0
    True
    """

    kind: Literal["bayesian"] = "bayesian"
    sigmas: Levels = (0.03, 0.05, 0.09, 0.15, 0.25)
    """Widths of the psychometric function, in units of log10(level)."""
    lapse_rates: Rates = (0.0, 0.03, 0.08)
    """Probabilities of an answer at random."""
    false_alarm_rates: Rates = (0.02, 0.08, 0.2)
    """Probabilities of a guess where nothing was detected and ``none`` is offered."""

    @field_validator("lapse_rates")
    @classmethod
    def _check_lapse_rates(cls, rates: tuple[float, ...]) -> tuple[float, ...]:
        if max(rates) == 0:  # an answer could be impossible under every hypothesis
            raise ValueError("must have at least one rate above 0")
        return rates

    def start(self, responses: tuple[str, ...], task: Task = LEFT_RIGHT_BOTH) -> BayesianTrack:
        """Start a track with the prior."""
        return BayesianTrack(self, responses, task)


class BayesianTrack(Track):
    """The posterior of threshold, sigma, false-alarm rate and lapse rate."""

    def __init__(self, rule: Bayesian, responses: tuple[str, ...], task: Task) -> None:
        self._rule, self._responses, self._task = rule, responses, task
        candidates_vpp = np.array(rule.candidates_vpp)
        log_levels = np.log10(candidates_vpp)
        margin = np.log10(THRESHOLD_MARGIN)
        self._log_thresholds = np.linspace(
            log_levels[0] - margin, log_levels[-1] + margin, THRESHOLDS
        )
        first = np.interp(FIRST_CHOICES, (0, 1), log_levels[[0, -1]])
        self._first = np.abs(log_levels - first[:, np.newaxis]).argmin(axis=1)
        # Sites and intervals are exchangeable, so that one of them serves for the choice.
        site = task.of_kind(SINGLE)[0]
        # (answers, candidates, thresholds, sigmas x false-alarm rates x lapse rates)
        table = self._probabilities(site, candidates_vpp)
        self._table = table.reshape(*table.shape[:3], -1)
        self._posterior = np.full(table.shape[2:], 1 / table[0, 0].size)
        self._answered = 0  # stimuli, without blank trials

    def _probabilities(self, presentation: Presentation, levels_vpp: Floats) -> Floats:
        """Return the probability of each answer to each level under each hypothesis.

        Shape (answers, levels, thresholds, sigmas, false-alarm rates, lapse rates).
        """
        rule = self._rule
        levels_vpp = levels_vpp[:, np.newaxis, np.newaxis, np.newaxis]
        shape = (1, 1, 1, len(rule.false_alarm_rates))
        with np.errstate(divide="ignore"):  # a silent interval has the level 0
            over = np.log10(levels_vpp) - self._log_thresholds[:, np.newaxis, np.newaxis]
        strength = over / np.array(rule.sigmas)[:, np.newaxis] + np.zeros(shape)
        detected = ndtr(strength)
        intervals = []
        for burst in presentation.bursts:
            is_driven = [site in burst.sites for site in self._task.sites]
            sensation = Sensation(
                [detected * driven for driven in is_driven],
                [levels_vpp * driven for driven in is_driven],
                [np.where(driven, strength, -np.inf) for driven in is_driven],
            )
            intervals.append(sensation)
        answers = self._task.decide(
            intervals,
            self._responses,
            Guessing(np.array(rule.false_alarm_rates), np.array(0.5), np.array(0.0)),
        )
        lapse = np.array(rule.lapse_rates)
        decided = np.stack([answers[name] for name in self._responses])[..., np.newaxis]
        probabilities: Floats = lapse / len(self._responses) + (1 - lapse) * decided
        return probabilities

    def choose(self, trial: int, attempt: int) -> Choice:
        """Return the level with the least expected entropy, but for the first two levels."""
        entropies = self._expected_entropies()
        if self._answered < len(self._first):
            index = self._first[self._answered]
        else:
            tied = np.flatnonzero(entropies == entropies.min())
            seed = [self._rule.seed, trial, attempt]
            index = np.random.Generator(np.random.PCG64(seed)).choice(tied)
        return Choice(self._rule.candidates_vpp[index], float(entropies[index]))

    def _expected_entropies(self) -> Floats:
        """Return the expected entropy of the threshold after a trial at each candidate, in bits."""
        posterior = self._posterior.reshape(THRESHOLDS, -1)
        # the joint probability of answer and threshold: (answers, candidates, thresholds)
        joint = np.einsum("actn,tn->act", self._table, posterior)
        answer = joint.sum(axis=-1)
        nats = (xlogy(answer, answer) - xlogy(joint, joint).sum(axis=-1)).sum(axis=0)
        bits: Floats = np.round(nats / np.log(2), ENTROPY_DIGITS)
        return bits

    def update(self, presentation: Presentation, level_vpp: float | None, answer: str) -> None:
        """Multiply the posterior by the probability of the answer under each hypothesis."""
        if presentation.kind == BOTH or answer not in self._responses:
            return
        probabilities = self._probabilities(presentation, np.array([level_vpp or 0.0]))
        posterior = self._posterior * probabilities[self._responses.index(answer), 0]
        self._posterior = posterior / posterior.sum()
        self._answered += presentation.kind == SINGLE

    def estimate(self) -> Estimate | None:
        """Return the median of the threshold's posterior; None before the first stimulus.

        The posterior may be narrower than a few steps of the grid. Its logarithm is smooth, and
        close to a parabola, so that a cubic spline of it between the points gives the quantiles.
        """
        from scipy.interpolate import CubicSpline

        if self._answered == 0:
            return None
        marginal = self._posterior.sum(axis=(1, 2, 3))
        spline = CubicSpline(self._log_thresholds, np.log(np.maximum(marginal, 1e-300)))
        x = np.linspace(self._log_thresholds[0], self._log_thresholds[-1], INTERPOLATED)
        cumulative = np.exp(spline(x)).cumsum()
        quantiles = np.interp(QUANTILES, cumulative / cumulative[-1], x)
        return Estimate(*(float(10**quantile) for quantile in quantiles))
