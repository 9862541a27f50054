"""The burst that a new plate gets: the shortest of a few that is fit, at best with both edges."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, Final

from experiment.check.bursts import CYCLES, FELT_HZ, by_length
from experiment.check.check import check_study
from experiment.check.edges import edge_words, with_other_edge
from experiment.study.physics import LEAST_LOSS, study_gains
from stimuli import Burst

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment.check.check import ConditionCheck
    from experiment.study.study import Study


CANDIDATES: Final = tuple(
    sorted(
        (
            Burst(frequency_hz=frequency_hz, cycles=cycles, window="hann")
            for frequency_hz, cycles in product(FELT_HZ, CYCLES)
        ),
        key=by_length,
    )
)
"""What is tried on a new plate, the shortest first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenBurst:
    """A study with the burst chosen for it, how that goes, and whether with the other edge too.

    `other` is none where no other edge was tried.
    """

    study: Study
    found: ConditionCheck
    other: Study | None = None
    is_fit_with_other: bool | None = None

    @property
    def words(self) -> str:
        """What it was chosen for."""
        if self.found.verdict != "fit":
            hz, cycles = f"{FELT_HZ[0]:g} to {FELT_HZ[-1]:g} Hz", f"{CYCLES[0]} to {CYCLES[-1]}"
            return f"so are all others tried, of {hz} and {cycles} cycles"
        if self.other is None:
            return "the shortest of those tried that is fit"
        stated, other = (edge_words(one.plate.edge) for one in (self.study, self.other))
        if self.is_fit_with_other:
            return f"the shortest of those tried that is fit with {stated} and with {other} edges"
        return (
            f"the shortest of those tried that is fit with {stated} edges; with {other} ones all "
            "are unfit: measure the cut-off"
        )


def chosen_burst(
    with_burst: Callable[[dict[str, Any]], Study], step: Callable[[int, int], object]
) -> ChosenBurst:
    """Return the shortest candidate that is fit for a plate; the shortest of all if none is.

    Where the edges are ideal ones and no cut-off was measured, one that is fit with the other
    ideal edge as well goes before all that are not.

    Parameters
    ----------
    with_burst : callable
        Returns the plate's study with the keys of [burst] that it is given.
    step : callable
        Told how many of how many were tried.
    """
    first, fit = None, None
    for place, burst in enumerate(CANDIDATES):
        step(place, len(CANDIDATES))
        study = with_burst(
            {"frequency_hz": burst.frequency_hz, "cycles": burst.cycles, "window": burst.window}
        )
        found = _at_first_sight(study)
        if found.verdict == "fit":
            (found,) = check_study(study).conditions
        first = first or ChosenBurst(study=study, found=found)
        if found.verdict != "fit":
            continue
        other = with_other_edge(study)
        is_fit = None if other is None else _is_fit(other)
        one = ChosenBurst(study=study, found=found, other=other, is_fit_with_other=is_fit)
        if is_fit is not False:
            return one
        fit = fit or one
    chosen = fit or first
    assert chosen is not None  # there are candidates
    return chosen


def _at_first_sight(study: Study) -> ConditionCheck:
    """Return what speaks against a study's burst, as far as little work tells it.

    The energy above the cut-off needs no field at all; at the other finger the least loss assumed
    leaves the most, as a rule. Only a burst that passes both is worth the whole check.
    """
    (found,) = check_study(study, gains=()).conditions
    if found.verdict == "fit":
        (found,) = check_study(study, gains=study_gains(study, LEAST_LOSS)).conditions
    return found


def _is_fit(study: Study) -> bool:
    """Tell whether a study is fit; not worth more work than it needs."""
    return _at_first_sight(study).verdict == "fit" and check_study(study).verdict == "fit"
