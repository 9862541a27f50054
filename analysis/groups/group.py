"""Group thresholds and differences of conditions from tables of counts: what a script calls."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from analysis.answers.intervals import checked_counts
from analysis.groups.difference import paired_difference, unpaired_difference
from analysis.groups.hierarchy import PeopleTables, hierarchy
from analysis.thresholds.fit import (
    BOUNDED,
    PsychometricFit,
    checked_levels,
    in_volts,
    status_of,
)
from analysis.thresholds.people import GuessRate
from analysis.thresholds.posterior import within_levels
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from analysis.axis import XScale
    from analysis.groups.difference import Difference
    from analysis.groups.hierarchy import Hierarchy
    from analysis.thresholds.density import Ruler
    from analysis.thresholds.fit import FitStatus

    Floats = NDArray[np.float64]


_NAN: Final = float("nan")
LEVEL: Final = ("decreasing", "flat")
"""Statuses of tables that do not rise with level."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupFit:
    """The threshold of a group of people, every one of whom takes part.

    Attributes
    ----------
    status : str
        A word as of `PsychometricFit`, of the pooled table and the group's median; ``flat`` and
        ``decreasing`` only where nobody's table rises.
    threshold : float
        Middle of the people's thresholds, posterior median, in the levels' unit; NaN where the
        status tells none.
    threshold_limits : tuple of float
        95 % equal-tailed limits; outside the tested levels an end is open, -inf or inf.
    spread_db : float
        Standard deviation between people, posterior median: dB, or the levels' unit on a linear
        axis. Of fewer than five people it comes mostly from its prior.
    spread_limits_db : tuple of float
        Its 95 % limits.
    new_person_limits : tuple of float
        Where the threshold of another person is expected with 95 %; ends open as above.
    people : tuple of PsychometricFit
        Each person by themselves.

    Examples
    --------
    `fit_group` gives one. Of people who differ more another person is known less well:

    >>> levels, presented = [60, 85, 120, 170, 240], np.full((3, 5), 30)
    >>> alike, apart = (fit_group(levels, people, presented, guess_rate=0.0) for people in (
    ...     [[2, 9, 22, 29, 30]] * 3, [[9, 22, 29, 30, 30], [2, 9, 22, 29, 30], [0, 2, 9, 22, 29]]))
    >>> bool(np.ptp(alike.new_person_limits) < np.ptp(apart.new_person_limits))
    True
    """

    status: FitStatus
    threshold: float = _NAN
    threshold_limits: tuple[float, float] = (_NAN, _NAN)
    spread_db: float = _NAN
    spread_limits_db: tuple[float, float] = (_NAN, _NAN)
    new_person_limits: tuple[float, float] = (_NAN, _NAN)
    people: tuple[PsychometricFit, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionDifference:
    """How much the threshold of condition b lies above that of condition a.

    Attributes
    ----------
    status : {"ok", "at_least", "at_most", "unknown"}
        Whether both ends are bounded, only the lower, only the upper, or none.
    difference_db, difference_limits_db : float, tuple of float
        20 log10(threshold b / threshold a) of the group, posterior median, NaN unless ``ok``; its
        95 % limits, of which an open end is -inf or inf.
    spread_db, spread_limits_db : float, tuple of float
        Standard deviation of people's differences and its 95 % limits; NaN of different people.
    people : tuple of Difference
        Each person's, where the same people took part in both conditions.

    Examples
    --------
    `compare_conditions` gives one; of the same answers in both conditions it is 0 dB:

    >>> answers = [60, 85, 120, 170], [[3, 9, 22, 29]] * 2, [[30] * 4] * 2
    >>> found = compare_conditions(*answers, *answers[1:], guess_rate=0.0)
    >>> found.status, bool(abs(found.difference_db) < 0.01)
    ('ok', True)
    """

    status: str
    difference_db: float
    difference_limits_db: tuple[float, float]
    spread_db: float
    spread_limits_db: tuple[float, float]
    people: tuple[Difference, ...] = ()


@tuned
def fit_group(
    levels_vpp: ArrayLike,
    detected: ArrayLike,
    presented: ArrayLike,
    *,
    guess_rate: float | None = None,
    blanks: tuple[ArrayLike, ArrayLike] | None = None,
    x_scale: XScale = "log10",
) -> GroupFit:
    """Fit the threshold of a group: mu_i ~ N(M, tau), hierarchical, without anything drawn.

    Equation, priors and coverage: docs/statistics.md, section 8.

    Parameters
    ----------
    levels_vpp : array_like, shape (levels,)
        Drive levels of all people; above 0 on the axis ``log10``.
    detected, presented : array_like of whole numbers, shape (people, levels)
        Counts; presented 0 where a person has no such level.
    guess_rate : float, optional
        gamma of everybody, 1/2 in forced choice; or
    blanks : tuple of array_like, shape (people,) each, optional
        False alarms of that side and blank trials of each person; Beta(1, 10) is assumed of who had
        none. Exactly one of the two.
    x_scale : str
        ``log10`` or ``linear``.

    Returns
    -------
    GroupFit

    Raises
    ------
    ValueError
        For impossible counts or levels, and unless exactly one of guess_rate and blanks is given.

    Examples
    --------
    Nobody is left out: the third person felt everything, and lowers the group's threshold.

    >>> levels_vpp, presented = [60, 85, 120, 170, 240], np.full((3, 5), 30)
    >>> two = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30]]
    >>> both = fit_group(levels_vpp, two, presented[:2], guess_rate=0.5)
    >>> all_three = fit_group(levels_vpp, [*two, [30] * 5], presented, guess_rate=0.5)
    >>> all_three.threshold < both.threshold, all_three.people[2].status
    (True, 'threshold_below_levels')
    """
    k, n = checked_counts(detected, presented)
    guesses = _guesses(len(np.atleast_1d(k)), guess_rate, blanks)
    tables = _tables(levels_vpp, (k, n), guesses, x_scale)
    people = tables.fits()
    fit = threshold_on_axis(tables, [one.status for one in people])
    if x_scale == "log10":
        people = tuple(in_volts(one) for one in people)
        fit = _in_volts(fit)
    return replace(fit, people=people)


def threshold_on_axis(
    tables: PeopleTables, statuses: Sequence[FitStatus] | None = None
) -> GroupFit:
    """Return the fit of a group on the axis, with the statuses of its people's own fits.

    Without them people are fitted here, if that decides anything.
    """
    ruler = tables.ruler()
    if ruler is None:
        return GroupFit(status="one_level")
    return _told(tables, ruler, hierarchy(tables.surfaces(ruler), ruler), statuses)


@tuned
def compare_conditions(
    levels_vpp: ArrayLike,
    detected_a: ArrayLike,
    presented_a: ArrayLike,
    detected_b: ArrayLike,
    presented_b: ArrayLike,
    *,
    guess_rate: float | None = None,
    blanks_a: tuple[ArrayLike, ArrayLike] | None = None,
    blanks_b: tuple[ArrayLike, ArrayLike] | None = None,
    levels_b_vpp: ArrayLike | None = None,
    paired: bool = True,
) -> ConditionDifference:
    """Return by how many dB the threshold of condition b lies above that of condition a.

    Equation, priors and coverage: docs/statistics.md, section 8. The priors of the thresholds take
    no part: where tables tell only bounds, so does the difference.

    Parameters
    ----------
    levels_vpp : array_like, shape (levels,)
        Drive levels, above 0.
    detected_a, presented_a, detected_b, presented_b : array_like of whole numbers
        Counts, shape (people, levels).
    guess_rate : float, optional
        gamma of everybody, 1/2 in forced choice; or
    blanks_a, blanks_b : tuple of array_like, shape (people,) each, optional
        False alarms of that side and blank trials of each person in either condition.
    levels_b_vpp : array_like, optional
        Levels of condition b where they are others.
    paired : bool
        Whether a row is the same person in both conditions.

    Returns
    -------
    ConditionDifference
        The group's difference in dB with its 95 % limits, whether either end is bounded, how much
        people differ in it, and each person's difference where the same people took part.

    Raises
    ------
    ValueError
        For impossible counts or levels, unless either guess_rate or both blanks are given, and for
        paired conditions of different numbers of people.

    Examples
    --------
    The other way round it is the opposite:

    >>> levels_vpp, presented = [60, 85, 120, 170, 240], np.full((2, 5), 30)
    >>> a = [[16, 19, 27, 30, 30], [15, 21, 28, 30, 30]]
    >>> b = [[15, 15, 18, 28, 30], [16, 14, 21, 29, 30]]
    >>> up, down = (compare_conditions(levels_vpp, *pair, guess_rate=0.5)
    ...             for pair in ((a, presented, b, presented), (b, presented, a, presented)))
    >>> up.difference_db > 0, bool(np.isclose(up.difference_db, -down.difference_db, atol=0.01))
    (True, True)
    """
    levels_b = levels_vpp if levels_b_vpp is None else levels_b_vpp
    counts_a = checked_counts(detected_a, presented_a)
    counts_b = checked_counts(detected_b, presented_b)
    a, b = (
        _tables(
            levels, counts, _guesses(len(np.atleast_1d(counts[0])), guess_rate, blanks), "log10"
        )
        for levels, counts, blanks in (
            (levels_vpp, counts_a, blanks_a),
            (levels_b, counts_b, blanks_b),
        )
    )
    if paired and len(a.x) != len(b.x):
        raise ValueError(
            f"detected_a and detected_b must have a row for each person; got {len(a.x)} and "
            f"{len(b.x)}: paired=False compares different people"
        )
    return difference_on_axis(a, b, same_people=paired)


def difference_on_axis(
    a: PeopleTables, b: PeopleTables, *, same_people: bool
) -> ConditionDifference:
    """Return the difference of two conditions on a logarithmic axis."""
    ruler = a.ruler_with(b)
    found = a.surfaces(ruler), b.surfaces(ruler)
    people: list[Difference] = []
    if same_people:
        group, people = paired_difference(*found, ruler)
    else:
        group = unpaired_difference(*(hierarchy(o, ruler, prior_of_middle=False) for o in found))
    return ConditionDifference(
        status=group.status,
        difference_db=group.difference_db,
        difference_limits_db=group.difference_limits_db,
        spread_db=group.spread_db,
        spread_limits_db=group.spread_limits_db,
        people=tuple(people),
    )


def _told(
    tables: PeopleTables, ruler: Ruler, found: Hierarchy, statuses: Sequence[FitStatus] | None
) -> GroupFit:
    """Lay a group's posterior on the axis, as far as its status lets it be told."""
    low, middle, high = (float(value) for value in found.of_middle())
    status = status_of(tables.x, tables.detected, tables.presented, (low, middle, high), ruler)
    if status in LEVEL and not all(
        one in LEVEL for one in statuses or [fit.status for fit in tables.fits()]
    ):
        # People who lie below, between and above the levels tell a threshold, if not a slope.
        status = "ok" if middle <= ruler.high else "median_above_levels"
        status = status if middle >= ruler.low else "median_below_levels"
    limits = within_levels(low, high, ruler)
    if status in BOUNDED:
        return GroupFit(status=status, threshold_limits=limits)
    if status in ("one_level", *LEVEL):
        return GroupFit(status=status)
    unit = ruler.step * 20 if tables.x_scale == "log10" else ruler.step
    least, spread, most = (float(value) * unit for value in found.of_spread())
    new = found.of_a_new_person()
    return GroupFit(
        status=status,
        threshold=middle * ruler.step,
        threshold_limits=limits,
        spread_db=spread,
        spread_limits_db=(least, most),
        new_person_limits=within_levels(float(new[0]), float(new[2]), ruler),
    )


def _in_volts(fit: GroupFit) -> GroupFit:
    def volts(limits: tuple[float, float]) -> tuple[float, float]:
        return (limits[0] if limits[0] == -math.inf else 10.0 ** limits[0], 10.0 ** limits[1])

    return replace(
        fit,
        threshold=10.0**fit.threshold,
        threshold_limits=volts(fit.threshold_limits),
        new_person_limits=volts(fit.new_person_limits),
    )


def _tables(
    levels_vpp: ArrayLike,
    counts: tuple[Floats, Floats],
    guesses: Sequence[GuessRate],
    x_scale: XScale,
) -> PeopleTables:
    """Lay the counts of people on the axis."""
    k, n = counts
    levels = np.asarray(levels_vpp)
    if levels.ndim != 1 or k.shape != n.shape or k.shape != (len(k), levels.size):
        raise ValueError(
            "detected and presented must have the shape (people, levels); got "
            f"{k.shape} and {n.shape} for {levels.size} levels"
        )
    if not (n > 0).any(axis=1).all():
        raise ValueError("presented must hold at least one stimulus of each person; got none")
    return PeopleTables(
        x=np.broadcast_to(checked_levels("levels_vpp", levels, x_scale), k.shape),
        detected=k,
        presented=n,
        guesses=guesses,
        x_scale=x_scale,
    )


def _guesses(
    people: int, guess_rate: float | None, blanks: tuple[ArrayLike, ArrayLike] | None
) -> list[GuessRate]:
    """Return what the guess rate of each person is known from."""
    if guess_rate is not None and blanks is None:
        return [GuessRate(mean=guess_rate)] * people
    if blanks is None or guess_rate is not None:
        raise ValueError("exactly one of guess_rate and blanks must be given")
    answered, shown = checked_counts(*blanks)
    if answered.shape != (people,) or shown.shape != (people,):
        raise ValueError(
            f"blanks must be two lists of {people}, a number for each person; got the shapes "
            f"{answered.shape} and {shown.shape}"
        )
    return [
        GuessRate.after_blanks(answered=float(a), blanks=int(b))
        for a, b in zip(answered, shown, strict=True)
    ]
