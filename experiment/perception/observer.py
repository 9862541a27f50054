"""The observer model: the parameters of one simulated participant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stimuli.checks import finite

if TYPE_CHECKING:
    from experiment.perception.gains import FingerGains


FASTEST_ANSWER_S = 0.15
"""No one answers a vibration sooner than this after its onset."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observer:
    """One simulated participant.

    `experiment.perception.answers` derives the answers from these numbers. The displacement of each
    finger is the sum of the amplitudes from its own actuator and from the other one. The finger
    detects an amplitude u with probability Phi(log10(u / threshold) / sigma), independently of the
    other finger, but not at all if the other gets 20 dB more. The section [simulation] checks the
    ranges; only the threshold, which a draw changes, is checked here.

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
        Crosstalk: amplitude at the undriven finger, dB re the driven finger. None uses the gain
        matrix.
    reaction_time_s : float
        Median reaction time to a stimulus that is always felt.
    reaction_time_spread : float
        Standard deviation of ln(reaction time - `min_reaction_time_s`).
    min_reaction_time_s : float
        Shortest possible reaction time.
    reaction_time_slowing : float
        Factor by which the rest of the reaction time is longer if the stimulus cannot be felt.
    finger_difference_db : float
        Threshold at the first site above that at the last, half of it on either side; in equal
        steps from site to site.
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
    reversed_mapping : bool
        Whether the keys are confused in every answer.

    Raises
    ------
    ValueError
        If not one of the two thresholds is given, or it is not a finite number above 0.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> person = paper_study().simulation.median
    >>> person.sigma > 0, person.reversed_mapping
    (True, False)
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
    min_reaction_time_s: float = FASTEST_ANSWER_S
    reaction_time_slowing: float = 2.0
    finger_difference_db: float = 0.0
    difference_db: float = 0.0
    masking_slope: float | None = None
    drift_db: float = 0.0
    block_drift_db: float = 0.0
    wander_db: float = 0.0
    wander_trials: float = 1.0
    last_answer_db: float = 0.0
    reversed_mapping: bool = False

    def __post_init__(self) -> None:
        if (self.threshold_um is None) == (self.threshold_vpp is None):
            raise ValueError(
                "threshold_um or threshold_vpp must be given, not both; "
                f"got {self.threshold_um!r} and {self.threshold_vpp!r}"
            )
        name = "threshold_vpp" if self.threshold_um is None else "threshold_um"
        finite(name, getattr(self, name), above=0)

    def thresholds(self, gains: FingerGains) -> list[float]:
        """Return the threshold of the finger at each site, in the unit of the gains."""
        if self.threshold_vpp is not None:
            same = [self.threshold_vpp * gain for gain in gains.own]
        elif self.threshold_um is not None and gains.basis is not None:
            same = [self.threshold_um for _ in gains.own]
        else:
            rule = "threshold_um must meet gains in um"
            raise ValueError(f"{rule}; got gains of which no displacement is known")
        higher = 10.0 ** (self.finger_difference_db / 2 / 20)
        last = max(len(same) - 1, 1)
        return [value * higher ** (1 - 2 * site / last) for site, value in enumerate(same)]
