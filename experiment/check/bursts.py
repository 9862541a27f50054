"""Bursts on one plate: each checked as a study's own is, with the stated and the other edge."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Final

from experiment.check.check import check_study
from experiment.check.edges import with_other_edge
from experiment.perception.gains import significant
from experiment.perception.thresholds import KnownFor
from experiment.study.physics import own_per_load_m
from experiment.study.study import UnusableStudyError
from experiment.study.threshold import median_threshold, vibrations_of
from stimuli.drive.windows import WINDOWS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from experiment.check.check import ConditionCheck
    from experiment.study.study import Study
    from stimuli import Burst
    from stimuli.drive.windows import Window


FELT_HZ: Final = (200.0, 250.0, 300.0, 400.0, 500.0)
"""Frequencies that skin feels well, in Hz."""

CYCLES: Final = (1, 2, 3)
_DIGITS: Final = 9
"""Durations are equal to a nanosecond."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstAtEdge:
    """How a burst goes with one kind of edge; what is refused of it has no check."""

    found: ConditionCheck | None
    refusal: str = ""

    @property
    def energy_above_cutoff(self) -> float | None:
        """The greater part of the ideal burst's and of its staircase's energy."""
        if self.found is None:
            return None
        burst = self.found.burst
        return max(burst.energy_above_cutoff, burst.staircase_energy_above_cutoff)

    @property
    def level_db(self) -> float | None:
        """The greater level at the other finger, of the two sides."""
        if self.found is None or self.found.gains is None:
            return None
        return max(self.found.level_db(1, 0), self.found.level_db(0, 1))

    @property
    def is_fit(self) -> bool:
        """Whether nothing speaks against it."""
        return self.found is not None and not self.found.reasons


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedBurst:
    """A burst on the plate.

    Attributes
    ----------
    burst : Burst
        The burst.
    stated : BurstAtEdge
        With the edges that the study states.
    other : BurstAtEdge or None
        With the other ideal edge, where that was tried.
    own_um : tuple of (float or None)
        What the left and the right actuator give their own fingers at the study's highest level.
    threshold_vpp : float or None
        Where the median simulated person feels it, if the study says for which vibration its
        threshold is known.
    threshold_db : float or None
        Else the threshold in volts re that of the burst in [burst], by the curves.
    """

    burst: Burst
    stated: BurstAtEdge
    other: BurstAtEdge | None
    own_um: tuple[float | None, float | None] = (None, None)
    threshold_vpp: float | None = None
    threshold_db: float | None = None

    @property
    def is_fit_with_all(self) -> bool:
        """Whether it is fit with every edge that was tried."""
        return self.stated.is_fit and (self.other is None or self.other.is_fit)


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstComparison:
    """Bursts of one window on the plate of a study; that with its other ideal edge, where tried."""

    study: Study
    other: Study | None
    rows: tuple[ComparedBurst, ...]
    window: Window

    def has(self, row: ComparedBurst) -> list[str]:
        """Return the names of the study's conditions that have a burst."""
        return [one.name for one in self.study.conditions if one.drive == row.burst]

    @property
    def own_window(self) -> str:
        """What [burst] has, in words."""
        return self.study.burst.window or "a file"

    @property
    def best(self) -> ComparedBurst | None:
        """The shortest burst that is fit with all edges that were tried; else with the stated."""
        for fit in (
            [row for row in self.rows if row.is_fit_with_all],
            [row for row in self.rows if row.stated.is_fit],
        ):
            if fit:
                return min(fit, key=lambda row: by_length(row.burst))
        return None


def by_length(burst: Burst) -> tuple[float, float]:
    """Sort bursts by their length; of equally long ones the lower frequency comes first.

    It stays further below the cut-off, and 250 Hz is felt best.

    >>> from stimuli import Burst
    >>> one, two = (Burst(frequency_hz=f, cycles=c, window="hann") for f, c in ((250, 1), (500, 2)))
    >>> by_length(one) < by_length(two)
    True
    """
    return round(burst.duration_s, _DIGITS), burst.frequency_hz


def with_burst(
    study: Study, frequency_hz: float, cycles: int, window: Window | None = None
) -> Study:
    """Return a study with another sine in [burst], and no other conditions.

    Its window is that of [burst] unless another is given. ValueError where neither is one, or the
    burst does not suit the study.
    """
    burst = study.burst
    if window is None and (burst.file is not None or burst.window == "auto"):
        what = f'file = "{burst.file}"' if burst.file is not None else 'window = "auto"'
        raise UnusableStudyError(
            study.name,
            f"bursts of one window are compared, and [burst] has {what}; "
            "name one, such as --window hann",
        )
    other = replace(
        burst,
        frequency_hz=frequency_hz,
        cycles=cycles,
        window=window or burst.window,
        wanted_level_db=None,
        file=None,
        accept_unfit=None,
    )
    return study.changed(burst=other, condition=[{"name": "main"}])


def grid_of(
    study: Study, frequencies_hz: Iterable[float] = (), cycles: Iterable[int] = ()
) -> tuple[tuple[float, int], ...]:
    """Return the bursts to be compared; by default those that skin feels well, and the study's.

    >>> from experiment.study.files import paper_study
    >>> grid_of(paper_study(), (300, 100), (1,))
    ((100, 1), (300, 1))
    """
    own = [study.burst, *study.conditions]
    every_hz = [*frequencies_hz] or [*FELT_HZ, *(one.frequency_hz or FELT_HZ[0] for one in own)]
    every_cycles = [*cycles] or [*CYCLES, *(one.cycles or CYCLES[0] for one in own)]
    return tuple(product(sorted(set(every_hz)), sorted(set(every_cycles))))


def compare_bursts(
    study: Study,
    bursts: Iterable[tuple[float, int]],
    step: Callable[[int, int], object],
    *,
    window: Window | None = None,
) -> BurstComparison:
    """Check bursts on the plate of a study, with its edges and with the other ideal ones.

    Parameters
    ----------
    study : Study
        The study; what it accepts as unfit is not accepted here.
    bursts : iterable of (float, int)
        Frequencies in Hz and cycles.
    step : callable
        Told how many of how many are done.
    window : str, optional
        Of all of them, in place of that in [burst].

    Raises
    ------
    ValueError
        If none of them can be checked, and for an unknown window.
    """
    if window is not None and window not in WINDOWS:
        raise ValueError(f"window must be one of {', '.join(WINDOWS)}; got {window!r}")
    every, rows = tuple(bursts), list[ComparedBurst]()
    own_m = None
    if not study.simulation.known_for.stated:
        with contextlib.suppress(ValueError):  # others may do where the study's own does not
            own_m = own_per_load_m(_own(study))
    for place, (frequency_hz, cycles) in enumerate(every):
        step(place, len(every))
        other = with_burst(study, frequency_hz, cycles, window)
        row = _compared(other)
        if own_m is not None and row.stated.level_db is not None:
            row = replace(row, threshold_db=_threshold_db(other, known_for(study), own_m))
        rows.append(row)
    if all(row.stated.found is None for row in rows):
        raise ValueError(rows[0].stated.refusal)
    return BurstComparison(
        study=study, other=with_other_edge(study), rows=tuple(rows), window=rows[0].burst.window
    )


def _own(study: Study) -> Study:
    """Return a study with [burst] alone."""
    burst = study.burst
    return with_burst(study, burst.frequency_hz or FELT_HZ[0], burst.cycles or CYCLES[0])


def known_for(study: Study) -> KnownFor:
    """Return of which vibration a threshold is known: as stated, else re that of [burst]."""
    if study.simulation.known_for.stated:
        return study.simulation.known_for
    burst = _own(study).conditions[0].stated
    return KnownFor(frequency_hz=burst.frequency_hz, duration_s=burst.energy_duration_s)


def _threshold_db(study: Study, known: KnownFor, own_m: float) -> float:
    """Return the threshold of a burst in volts: by the curves, and by how much the plate moves."""
    both = vibrations_of(study, study.conditions[0].stated)
    curve_db = sum(map(known.shift_db, both)) / len(both)
    return curve_db - 20 * math.log10(own_per_load_m(study) / own_m)


def _compared(study: Study) -> ComparedBurst:
    stated, other = _at_edge(study), with_other_edge(study)
    found = stated.found
    row = ComparedBurst(
        burst=study.conditions[0].stated,
        stated=stated,
        other=None if other is None else _at_edge(other),
    )
    if found is None or found.gains is None:
        return row
    gains, level_vpp = found.gains, study.design.highest_vpp
    left_um, right_um = (
        None if gains.bases[side] is None else significant(gains.per_vpp[side][side] * level_vpp)
        for side in (0, 1)
    )
    known = study.simulation.known_for.stated
    threshold = median_threshold(study, gains.fingers()).level_vpp if known else None
    return replace(row, own_um=(left_um, right_um), threshold_vpp=threshold)


def _at_edge(study: Study) -> BurstAtEdge:
    try:
        (found,) = check_study(study).conditions
    except ValueError as error:
        return BurstAtEdge(found=None, refusal=str(error))
    return BurstAtEdge(found=found)
