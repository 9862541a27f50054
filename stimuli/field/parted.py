"""A sweep of an endless strip: few frequencies solved, its first waves taken at all of them.

Waves that begin to propagate or meet are what makes a field vary with frequency. Those up to a
little above the highest frequency are taken out, see `stimuli.solver.leading`; how many nodes the
rest needs follows from where its next singularity is. Places where the estimate of the error is
too large have more nodes, single frequencies are solved by themselves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.field.jobs import dimensionless, hold_at_rest, is_supported, stiffness_factors
from stimuli.solver.leading import Grid, grid_nodes, over_frequency
from stimuli.solver.source import Answered
from stimuli.strip.edge import ElasticEdge
from stimuli.strip.waves import supported_cutoff_hz

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.field.jobs import Job
    from stimuli.strip.strip import Strip


_ROOM: Final = 1.4
"""Least part of the next singularity to the top of a band without its first waves."""

_MOST_PAIRS: Final = 4
"""Pairs taken out between edges that are no simple supports: roots of one polynomial, which loses
digits. Between those each is known by itself: any number will do."""

_WORTH: Final = 4
"""Times the nodes, of which no fewer frequencies may be asked."""

_LATER, _SOFTER = 1.9, 20.0
"""How much later, in first cut-offs of the supported strip, the second wave between clamped edges
meets the third than between simple supports, and how this falls with 1 / (kappa W)."""

_FEWEST_NODES: Final = {1: 4, 2: 3}
"""Fewest nodes with all solved, by their step among all nodes."""

_PLAIN: Final = 4.0
"""Top, in first cut-offs of the supported strip, up to which its waves need no more nodes: the
squares p^2 of sines are linear in f^2, and no disc is wide against the waves."""

_BEYOND: Final = 1.0137
"""Top of a band over the highest frequency asked for, and again if too few nodes were taken: one
may be asked for because waves meet there, and a node there would lose digits."""

_LEAST_TOP: Final = 0.5
"""Least top of a band without its first waves, as a part of that cut-off: below, rounding grows."""

_LEAST_PART: Final = 0.0487
"""Least bottom of such a band, as a part of its top: at 0 Hz nothing can be solved. With viscous
loss its square, since the band is not stretched there."""

_MOST_PART: Final = 0.9

_SIZES: Final = (1.0, 1.5)
"""Size of its coefficients over that of the field and the powers of their ratio: between simple
supports and other edges."""

_LOWEST: Final = 0.003
"""Below this part of that cut-off no frequency is solved by itself."""

_MORE: Final = 2
"""Nodes that are added if too few were taken."""

_SLANT: Final = 0.1
"""Imaginary part of places, which run from -1 to 1, up to which nodes need not have the loss."""

_FEW: Final = 0.02
"""Part of the frequencies that are rather solved by themselves."""

_NODES, _VALUES = 600, 200_000
"""Pairs of a node and a place, and of a frequency and a place, that fit the cache at once."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parted:
    """A band of an endless strip without its first waves, smooth in a power of the frequency."""

    strip: Strip  # whose field is solved at the nodes: without loss where that tells all
    rows: NDArray[np.intp]  # which of the asked frequencies: (n,)
    places: Real | Complex  # of these, near -1 to 1: (n,)
    top_hz: float
    low: float  # lower end, as a part of the upper one
    power: int
    count: int  # how many nodes are enough
    step: int  # every how many-th of the nodes has all solved, the others the waves
    counts: dict[int, int]  # how many pairs of waves are taken out of each symmetry
    ratio: float  # of successive coefficients
    rtol: float
    alone: NDArray[np.bool_]  # which of the frequencies may be solved by themselves

    @property
    def nodes_hz(self) -> Real:
        """Frequencies of the nodes, of which every `step`th has all solved."""
        part = (1 + self.low + (1 - self.low) * grid_nodes(self.count, self.step)) / 2
        return np.asarray(self.top_hz * part ** (1 / self.power))

    def wider(self) -> Parted:
        """Return a band with more nodes, all elsewhere."""
        middle, half = (1 + self.low) / 2, (1 - self.low) / 2
        places = ((self.places * half + middle) / _BEYOND**self.power - middle) / half
        return replace(self, places=places, top_hz=_BEYOND * self.top_hz, count=self.count + _MORE)

    def grid(self) -> Grid:
        """Return what makes values at the asked frequencies of those at the nodes."""
        return Grid.over(
            self.places, self.count, step=self.step, counts=self.counts, ratio=self.ratio
        )


def parted(
    strip: Strip, frequencies_hz: Real, rtol: float, signs: tuple[int, ...]
) -> Parted | None:
    """Return where the first waves are taken out of a sweep, if that saves work."""
    every = np.arange(frequencies_hz.size)
    if is_supported(strip):
        return _up_to(strip, frequencies_hz, every, rtol, signs)
    for most in range(_MOST_PAIRS, 0, -1):
        end_hz = min(_singular_hz(strip, sign, most) for sign in signs)
        rows = every[frequencies_hz * _BEYOND * _ROOM <= end_hz]
        found = _up_to(strip, frequencies_hz, rows, rtol, signs)
        if found is not None:
            return found
    return None


def _up_to(
    strip: Strip, frequencies_hz: Real, rows: NDArray[np.intp], rtol: float, signs: tuple[int, ...]
) -> Parted | None:
    """Return the same for some of the frequencies."""
    if rows.size <= _WORTH * min(_FEWEST_NODES.values()):
        return None
    supported_hz = supported_cutoff_hz(strip.material, strip.width_m, strip.thickness_m)
    some_hz = frequencies_hz[rows]
    top_hz = _BEYOND * max(float(np.max(some_hz)), _LEAST_TOP * supported_hz)
    counts = {sign: _pairs(strip, sign, top_hz) for sign in signs}
    singular_hz = min(_singular_hz(strip, sign, count) for sign, count in counts.items())
    power = 1 if strip.material.viscous_time_s > 0 else 2
    low = float(np.min(some_hz)) / (_BEYOND * top_hz)
    low = min(max(low, _LEAST_PART ** (3 - power)), _MOST_PART) ** power
    centre = (2 * (singular_hz / top_hz) ** power - 1 - low) / (1 - low)
    ratio = 1 / (centre + math.sqrt(centre**2 - 1))
    places = (2 * (some_hz / top_hz) ** power - 1 - low) / (1 - low)
    nodes_of = strip
    if _is_turned(strip):
        # D U depends on k^4 alone, of which loss makes a complex number: nodes need none
        bare = replace(strip, material=replace(strip.material, loss_factor=0.0))
        turned = (places + (1 + low) / (1 - low)) / stiffness_factors(strip, some_hz)
        turned = turned - (1 + low) / (1 - low)
        if np.max(np.abs(turned.imag)) < _SLANT:
            places, nodes_of = turned, bare
    held = not is_supported(strip)
    step = 2 if held or top_hz > _PLAIN * supported_hz else 1
    count = math.ceil(math.log(_SIZES[held] / rtol) / -math.log(ratio))
    count = max(count, _FEWEST_NODES[step])
    if rows.size <= _WORTH * count:
        return None
    return Parted(
        strip=nodes_of,
        rows=rows,
        places=places,
        top_hz=top_hz,
        low=low,
        power=power,
        count=count,
        step=step,
        counts=counts,
        ratio=ratio,
        rtol=rtol,
        alone=some_hz >= _LOWEST * supported_hz,
    )


def _is_turned(strip: Strip) -> bool:
    """Return whether loss changes nothing of D U but k, and its part of k^4 no frequency."""
    edge, material = strip.edge, strip.material
    if isinstance(edge, ElasticEdge) and edge.lossless and not is_supported(strip):
        return False
    return material.loss_factor > 0 and not material.viscous_time_s


def _pairs(strip: Strip, sign: int, top_hz: float) -> int:
    """Return how many pairs of waves of a symmetry have to be taken out up to a frequency."""
    count = 1 if sign > 0 else 0
    while _singular_hz(strip, sign, count) < _ROOM * top_hz:
        count += 1
    return count


def _singular_hz(strip: Strip, sign: int, count: int) -> float:
    """Return up to where a field without so many pairs of waves is smooth: a cut-off, or (88)."""
    supported_hz = supported_cutoff_hz(strip.material, strip.width_m, strip.thickness_m)
    order = 2 * count + (1 if sign > 0 else 2)
    if is_supported(strip):
        return order**2 * supported_hz
    if not count:
        return strip.cutoff_hz(order)
    meeting = 4.0 * count if sign > 0 else 4.0 * count + 2
    if count == 1:
        meeting += _LATER / (1 + _SOFTER * hold_at_rest(strip))
    return meeting * supported_hz


def swept(
    way: Parted,
    rtol: float,
    jobs: tuple[Job, ...],
    alone: Callable[[NDArray[np.bool_]], Answered],
) -> tuple[Answered, Real, NDArray[np.bool_]]:
    """Return D U of all jobs' pairs, the nodes, and which of the frequencies were solved alone."""
    used_hz, parts, good = [way.nodes_hz[:: way.step]], [], np.ones(way.places.size, dtype=np.bool_)
    for job in jobs:
        part = _solved(job, way, np.arange(job.distance.size))
        fine = part.error <= rtol * part.sizes()
        if np.count_nonzero(np.all(fine, axis=1)) < (1 - _FEW) * good.size:
            places, wider = np.flatnonzero(~np.all(fine, axis=0)), way.wider()
            better = _solved(job, wider, places)
            part.value[:, places], part.error[:, places] = better.value, better.error
            used_hz.append(wider.nodes_hz[:: wider.step])
        good &= part.relative() <= rtol
        parts.append(part)
    found = Answered(
        value=np.concatenate([part.value for part in parts], axis=1),
        error=np.concatenate([part.error for part in parts], axis=1),
    )
    poor = way.alone & ~good
    if np.any(poor):
        better = alone(poor)
        found.value[poor], found.error[poor] = better.value, better.error
    return found, np.unique(np.concatenate(used_hz)), poor


def _solved(job: Job, way: Parted, places: NDArray[np.intp]) -> Answered:
    """Return D U of a job's pairs at some places, in portions that fit the cache."""
    nodes_hz, grid = way.nodes_hz, way.grid()
    question = job.question(*dimensionless(way.strip, nodes_hz.astype(np.complex128)), rtol=way.rtol)
    n_parts = math.ceil(places.size * max(nodes_hz.size / _NODES, way.places.size / _VALUES))
    if n_parts == 1:
        return over_frequency(question.at(places), job.signs, grid)
    parts = [
        over_frequency(question.at(some), job.signs, grid)
        for some in np.array_split(places, n_parts)
    ]
    return Answered(
        value=np.concatenate([part.value for part in parts], axis=1),
        error=np.concatenate([part.error for part in parts], axis=1),
    )
