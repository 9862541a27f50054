"""The observer model: what a simulated person feels, and what it answers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from experiment.perception.gains import OWN_FINGER_ONLY, FingerGains
from experiment.rows import ANSWERS
from stimuli.checks import finite

if TYPE_CHECKING:
    import numpy as np


MASKING_DB = 20.0
"""Level difference, 20 log10 of the amplitudes' ratio, from which the weaker finger feels nothing.

Source: paper, section V, after Kim et al. 2012.
"""
FASTEST_ANSWER_S = 0.15
"""No one answers a vibration sooner than this after its onset."""

MASKING_RATIO: float = 10.0 ** (MASKING_DB / 20)
ROUNDING = 1.0 + 1e-12
"""Amplitudes that differ by `MASKING_DB` but for the rounding of a product count as doing so."""
_SQRT_2 = math.sqrt(2.0)
_OTHER = {"left": "right", "right": "left"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverAnswer:
    """What was answered, and how long after the onset; neither where no answer came in time."""

    response: str | None  # a word of `record.ANSWERS`
    rt_s: float | None


NO_ANSWER = ObserverAnswer(response=None, rt_s=None)


@dataclass(frozen=True, slots=True, kw_only=True)
class Observer:
    """One simulated participant.

    Each finger gets the displacement of its own actuator plus what reaches it from the other; the
    amplitudes add. It feels an amplitude u with Phi(log10(u / threshold) / sigma), independently of
    the other finger, but not at all if the other gets 20 dB more (`MASKING_DB`); equations (28),
    (29) and (71) of docs/model.md. The ranges of its values are those of the keys of [simulation],
    which refuses what is outside; here is checked what a draw makes of them, the threshold.

    Attributes
    ----------
    threshold_um : float or None
        Displacement felt half of the time by one finger, um.
    threshold_vpp : float or None
        The same as the level at the finger's own actuator; one of the two is given.
    sigma : float
        Width of the psychometric function in units of log10(level).
    lapse_rate : float
        Probability of an answer at random among those offered, whatever was felt.
    false_alarm_rate : float
        Probability that a person who felt nothing and may answer ``none`` guesses all the same.
    side_bias : float
        Probability of ``left`` in a guess between left and right.
    guess_both : float
        Probability of ``both`` in a guess where it is offered.
    crosstalk_db : float or None
        Amplitude of the burst at the other finger, dB re its amplitude at its own finger, if it is
        to be another than that of the gain matrix.
    reaction_time_s : float
        Median reaction time to a stimulus that is always felt.
    reaction_time_spread : float
        Standard deviation of ln(reaction time - `reaction_time_least_s`).
    reaction_time_least_s : float
        What no reaction takes less than.
    reaction_time_doubt : float
        How much longer than that to what cannot be felt than to what is always felt.
    finger_difference_db : float
        Threshold of the left finger above that of the right one; half of it on either side.
    difference_db : float
        Thresholds in a study's second condition above those in its first, whatever the stimuli do.
    masking_slope : float or None
        By how many dB a finger's threshold rises for each dB by which the other finger gets more
        than its own threshold; ``None`` for the rule of section V.
    drift_db : float
        Rise of the thresholds from the first trial to the last, half of it on either side.
    block_drift_db : float
        The same within each block; the break undoes it.
    wander_db, wander_trials : float
        Standard deviation of a slow random course of the thresholds, and the number of trials over
        which it is forgotten (to 1/e).
    last_answer_db : float
        By how much lower the thresholds are after an answer that something was felt than after
        ``none``; only where that is offered.
    swapped : bool
        Whether left and right are confused in every answer.

    Raises
    ------
    ValueError
        If not one of the two thresholds is given, or it is not a finite number above 0.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> person = paper_study().simulation.median
    >>> person.felt_probability(1.0), person.felt_probability(0.0)
    (0.5, 0.0)
    """

    threshold_um: float | None = None
    threshold_vpp: float | None = None
    sigma: float
    lapse_rate: float
    false_alarm_rate: float
    side_bias: float
    guess_both: float
    crosstalk_db: float | None = None
    reaction_time_s: float
    reaction_time_spread: float
    reaction_time_least_s: float = FASTEST_ANSWER_S
    reaction_time_doubt: float = 2.0
    finger_difference_db: float = 0.0
    difference_db: float = 0.0
    masking_slope: float | None = None
    drift_db: float = 0.0
    block_drift_db: float = 0.0
    wander_db: float = 0.0
    wander_trials: float = 1.0
    last_answer_db: float = 0.0
    swapped: bool = False

    def __post_init__(self) -> None:
        if (self.threshold_um is None) == (self.threshold_vpp is None):
            raise ValueError(
                "threshold_um or threshold_vpp must be given, not both; "
                f"got {self.threshold_um!r} and {self.threshold_vpp!r}"
            )
        for name in ("threshold_um", "threshold_vpp"):
            if getattr(self, name) is not None:
                finite(name, getattr(self, name), above=0)

    def felt_probability(self, strength: float) -> float:
        """Return the probability that one finger, not masked, feels a vibration.

        The psychometric function without guesses and lapses (docs/model.md).

        Parameters
        ----------
        strength : float
            Its amplitude over the threshold, 0 or more.

        Raises
        ------
        ValueError
            If the strength is negative or not finite.
        """
        finite("strength", strength, least=0)
        if strength == 0:
            return 0.0
        z = math.log10(strength) / self.sigma
        return 0.5 * math.erfc(-z / _SQRT_2)

    def answer(
        self,
        level_left_vpp: float,
        level_right_vpp: float,
        responses: tuple[str, ...],
        rng: np.random.Generator,
        response_window_s: float,
        *,
        gains: FingerGains = OWN_FINGER_ONLY,
        shift_db: tuple[float, float] = (0.0, 0.0),
    ) -> ObserverAnswer:
        """Draw the answer to one trial.

        Parameters
        ----------
        level_left_vpp, level_right_vpp : float
            Levels at the two actuators; 0 for a silent one.
        responses : tuple of str
            The answers offered, ``left`` and ``right`` among them.
        rng : numpy.random.Generator
            Where chance comes from.
        response_window_s : float
            Longest time to answer.
        gains : FingerGains
            What the fingers get of the two actuators.
        shift_db : tuple of float
            By how much the thresholds of the left and the right finger lie higher in this trial.

        Returns
        -------
        ObserverAnswer
            `NO_ANSWER` where the reaction takes longer than the window.

        Raises
        ------
        ValueError
            If a level is negative or not finite, the responses are not such a list, or a
            threshold in um meets gains without displacements.
        """
        _require_responses(responses)
        amplitudes, chances = self._felt(level_left_vpp, level_right_vpp, gains, shift_db)
        rt_s = self._reaction_time_s(max(chances), rng)
        if rng.random() < self.lapse_rate:
            response = responses[int(rng.random() * len(responses))]
        else:
            response = self._respond(amplitudes, chances, responses, rng)
        if rt_s > response_window_s:
            return NO_ANSWER
        if self.swapped:
            response = _OTHER.get(response, response)
        return ObserverAnswer(response=response, rt_s=rt_s)

    def _felt(
        self,
        level_left_vpp: float,
        level_right_vpp: float,
        gains: FingerGains,
        shift_db: tuple[float, float],
    ) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the amplitudes at the left and the right finger, and how often each is felt."""
        finite("level_left_vpp", level_left_vpp, least=0)
        finite("level_right_vpp", level_right_vpp, least=0)
        if self.crosstalk_db is not None:
            gains = gains.with_crosstalk(self.crosstalk_db)
        amplitudes = gains.amplitudes(level_left_vpp, level_right_vpp)
        thresholds = self._raised(amplitudes, _shifted(self.thresholds(gains), shift_db))
        return amplitudes, (
            self.felt_probability(amplitudes[0] / thresholds[0]),
            self.felt_probability(amplitudes[1] / thresholds[1]),
        )

    def thresholds(self, gains: FingerGains) -> tuple[float, float]:
        """Return the thresholds of the left and the right finger, in the unit of the gains."""
        half_db = self.finger_difference_db / 2
        if self.threshold_vpp is not None:
            return _shifted(
                (self.threshold_vpp * gains.left[0], self.threshold_vpp * gains.right[1]),
                (half_db, -half_db),
            )
        if self.threshold_um is None or gains.basis is None:
            raise ValueError(
                "threshold_um must meet gains in um; got gains of which no displacement is known"
            )
        return _shifted((self.threshold_um, self.threshold_um), (half_db, -half_db))

    def _raised(
        self, amplitudes: tuple[float, float], thresholds: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the thresholds that the other finger's vibration leaves, where it masks by dB."""
        if self.masking_slope is None:
            return thresholds
        left_db, right_db = (
            20 * math.log10(max(one / threshold, 1.0))
            for one, threshold in zip(amplitudes, thresholds, strict=True)
        )
        return _shifted(thresholds, (self.masking_slope * right_db, self.masking_slope * left_db))

    def _respond(
        self,
        amplitudes: tuple[float, float],
        chances: tuple[float, float],
        responses: tuple[str, ...],
        rng: np.random.Generator,
    ) -> str:
        """Say what was felt, or guess; the pairs are those of the left and the right finger."""
        left, right = amplitudes
        felt_left = rng.random() < chances[0]
        felt_right = rng.random() < chances[1]
        if self.masking_slope is None:
            felt_left = felt_left and not _masked(left, right)
            felt_right = felt_right and not _masked(right, left)
        told = self._told(felt_left, felt_right, amplitudes, responses)
        if told is not None:
            return told
        if not felt_left and "none" in responses and rng.random() >= self.false_alarm_rate:
            return "none"
        return self._guess(responses, rng)

    @staticmethod
    def _told(
        felt_left: bool,  # noqa: FBT001
        felt_right: bool,  # noqa: FBT001
        amplitudes: tuple[float, float],
        responses: tuple[str, ...],
    ) -> str | None:
        """Return the answer that what was felt decides; none where it is left to a guess."""
        left, right = amplitudes
        if felt_left and felt_right and "both" in responses:
            return "both"
        if felt_left != felt_right:
            return "left" if felt_left else "right"
        if felt_left and left != right:
            return "left" if left > right else "right"
        return None

    def _guess(self, responses: tuple[str, ...], rng: np.random.Generator) -> str:
        if "both" in responses and rng.random() < self.guess_both:
            return "both"
        return "left" if rng.random() < self.side_bias else "right"

    def _reaction_time_s(self, clarity: float, rng: np.random.Generator) -> float:
        """Draw a shifted log-normal time, longer past the shift the less could be felt."""
        return self.reaction_time_least_s + self._median_s(clarity) * math.exp(
            self.reaction_time_spread * rng.standard_normal()
        )

    def _median_s(self, clarity: float) -> float:
        doubt = self.reaction_time_doubt - (self.reaction_time_doubt - 1.0) * clarity
        return (self.reaction_time_s - self.reaction_time_least_s) * doubt


def _shifted(thresholds: tuple[float, float], shift_db: tuple[float, float]) -> tuple[float, float]:
    """Return thresholds that lie higher by some dB."""
    left, right = (
        one * 10.0 ** (db / 20) if db else one for one, db in zip(thresholds, shift_db, strict=True)
    )
    return left, right


def _masked(amplitude: float, other: float) -> bool:
    """Tell whether a finger feels nothing because the other gets `MASKING_DB` more."""
    return amplitude * MASKING_RATIO <= other * ROUNDING


def _require_responses(responses: object) -> None:
    if not isinstance(responses, tuple) or not {"left", "right"} <= {*responses} <= {*ANSWERS}:
        raise ValueError(
            f"responses must be a tuple of {', '.join(ANSWERS)} with left and right; "
            f"got {responses!r}"
        )
