"""A sweep of an endless strip: few frequencies solved, its first waves taken at all of them.

Waves that begin to propagate or meet are what makes a field vary with frequency. Those up to a
little above the highest frequency are taken out, see `stimuli.solver.leading`; how many nodes the
rest needs follows from where its next singularity is, before which the band is bent. Places where
the estimate of the error is too large have more nodes, single frequencies are solved by themselves.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

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

_LESS_ROOM: Final = 1.2
"""The same where waves meet, less singular than a cut-off, and the band is bent before that."""

_MOST_PAIRS: Final = 4
"""Pairs taken out between edges that are no simple supports: roots of one polynomial, which loses
digits. Between those each is known by itself: any number will do."""

_WORTH: Final = 4
"""Times the nodes, of which no fewer frequencies may be asked."""

_LATER, _SOFTER = 1.9, 20.0
"""How much later, in first cut-offs of the supported strip, the second wave between clamped edges
meets the third than between simple supports, and how this falls with 1 / (kappa W)."""

_FEWEST_NODES: Final = 3
_BEYOND: Final = 1.0137
"""Top of a band over the highest frequency asked for, and again if too few nodes were taken: one
may be asked for because waves meet there, and a node there would lose digits."""

_LEAST_TOP: Final = 0.5
"""Least top of a band without its first waves, as a part of that cut-off: below, rounding grows."""

_LEAST_PART: Final = 0.0487
"""Least bottom of such a band, as a part of its top: at 0 Hz nothing can be solved. With viscous
loss its square, since the band is not stretched there."""

_MOST_PART: Final = 0.9

_SIZES: Final = {1: 1.5, 2: 150.0}
"""Size of its coefficients over that of the field and the powers of their ratio, by the power of
frequency: bent before the next singularity they fall so fast that a null asks for another one."""

_LOWEST: Final = 0.003
"""Below this part of that cut-off no frequency is solved by itself."""

_MORE: Final = 2
"""Nodes that are added if too few were taken."""

_SLANT: Final = 0.3
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
    # (f / top)^power of these, over what loss makes of the stiffness where nodes have none: (n,)
    powers: Real | Complex
    places: Real | Complex  # what nodes from -1 to 1 make of that, (92): (n,)
    top_hz: float
    low: float  # lower end, as a part of the upper one, to that power
    power: int
    end: float  # where the next singularity is, likewise; none is minded if it is infinite
    count: int  # how many nodes are enough
    counts: dict[int, int]  # how many pairs of waves are taken out of each symmetry
    ratio: float  # of successive coefficients
    rtol: float
    alone: NDArray[np.bool_]  # which of the frequencies may be solved by themselves

    @property
    def nodes_hz(self) -> Real:
        """Frequencies of the nodes, of which every other one has all solved."""
        low, high = _bent(self.low, self.end), _bent(1.0, self.end)
        part = (low + high + (high - low) * grid_nodes(self.count)) / 2
        if math.isfinite(self.end):
            part = 4 * self.end * part / (1 + part) ** 2
        return np.asarray(self.top_hz * part ** (1 / self.power))

    def wider(self) -> Parted:
        """Return a band with more nodes, all elsewhere."""
        more = _BEYOND**self.power
        powers, end = self.powers / more, self.end / more
        return replace(
            self,
            powers=powers,
            places=_places(powers, self.low, end),
            top_hz=_BEYOND * self.top_hz,
            end=end,
            count=self.count + _MORE,
        )

    def grid(self) -> Grid:
        """Return what makes values at the asked frequencies of those at the nodes."""
        return Grid.over(self.places, self.count, counts=self.counts, ratio=self.ratio)


def parted(
    strip: Strip, frequencies_hz: Real, rtol: float, signs: tuple[int, ...]
) -> Parted | None:
    """Return where the first waves are taken out of a sweep, if that saves work."""
    every = np.arange(frequencies_hz.size)
    if is_supported(strip):
        return _up_to(strip, frequencies_hz, every, rtol, signs)
    for most in range(_MOST_PAIRS, 0, -1):
        end_hz = min(_singular_hz(strip, sign, most) for sign in signs)
        rows = every[frequencies_hz * _BEYOND * _room(strip, most) <= end_hz]
        found = _up_to(strip, frequencies_hz, rows, rtol, signs)
        if found is not None:
            return found
    return None


def _up_to(
    strip: Strip, frequencies_hz: Real, rows: NDArray[np.intp], rtol: float, signs: tuple[int, ...]
) -> Parted | None:
    """Return the same for some of the frequencies."""
    if rows.size <= _WORTH * _FEWEST_NODES:
        return None
    supported_hz = supported_cutoff_hz(strip.material, strip.width_m, strip.thickness_m)
    some_hz = frequencies_hz[rows]
    top_hz = _BEYOND * max(float(np.max(some_hz)), _LEAST_TOP * supported_hz)
    counts = {sign: _pairs(strip, sign, top_hz) for sign in signs}
    singular_hz = min(_singular_hz(strip, sign, count) for sign, count in counts.items())
    least = max(float(np.min(some_hz)) / (_BEYOND * top_hz), _LEAST_PART)
    low, end, power = min(least, _MOST_PART) ** 2, (singular_hz / top_hz) ** 2, 2
    powers: Real | Complex = (some_hz / top_hz) ** 2
    met, bare = complex(end), _without_loss(strip)
    if bare is not None:
        powers = powers / stiffness_factors(strip, some_hz.astype(np.complex128))
        places = _places(powers, low, end)
        if np.max(np.abs(places.imag)) > _SLANT:
            bare = None
    if bare is None and strip.material.viscous_time_s > 0:
        least = max(least, _LEAST_PART**2)
        low, end, power = min(least, _MOST_PART), math.inf, 1
        powers, met = some_hz / top_hz, complex(singular_hz / top_hz)
    elif bare is None:
        powers, met = (some_hz / top_hz) ** 2, end * (1 - 1j * strip.material.loss_factor)
    if bare is None:
        places = _places(powers, low, end)
    ratio = _ratio(complex(_places(np.array([met]), low, end)[0]))
    count = math.ceil(math.log(_SIZES[power] / rtol) / -math.log(ratio))
    count = max(count, _FEWEST_NODES)
    if rows.size <= _WORTH * count:
        return None
    return Parted(
        strip=strip if bare is None else bare,
        rows=rows,
        powers=powers,
        places=places,
        top_hz=top_hz,
        low=low,
        power=power,
        end=end,
        count=count,
        counts=counts,
        ratio=ratio,
        rtol=rtol,
        alone=some_hz >= _LOWEST * supported_hz,
    )


def _without_loss(strip: Strip) -> Strip | None:
    """Return a strip without loss whose D U at a complex k^4 is that with loss, if there is one."""
    edge, material = strip.edge, strip.material
    lossless_spring = isinstance(edge, ElasticEdge) and edge.lossless and not is_supported(strip)
    if lossless_spring or not (material.loss_factor or material.viscous_time_s):
        return None
    return replace(strip, material=replace(material, loss_factor=0.0, viscous_time_s=0.0))


def _bent(powers: Any, end: float) -> Any:
    """Return what maps a plane cut from a singularity to infinity onto a disc, 0 onto 0, (92)."""
    if math.isinf(end):
        return powers
    part = powers / end
    return part / (1 + np.sqrt(1 - part)) ** 2


def _places(powers: Real | Complex, low: float, end: float) -> Real | Complex:
    """Return powers of frequencies as places, -1 at the lower end of the band and 1 at its top."""
    least, most = _bent(low, end), _bent(1.0, end)
    return np.asarray((2 * _bent(powers, end) - least - most) / (most - least))


def _ratio(place: complex) -> float:
    """Return the ratio of Chebyshev coefficients of what is singular at a place."""
    root = cmath.sqrt(place * place - 1)
    return 1 / max(abs(place + root), abs(place - root))


def _pairs(strip: Strip, sign: int, top_hz: float) -> int:
    """Return how many pairs of waves of a symmetry have to be taken out up to a frequency."""
    count = 1 if sign > 0 else 0
    while _singular_hz(strip, sign, count) < _room(strip, count) * top_hz:
        count += 1
    return count


def _room(strip: Strip, count: int) -> float:
    """Return the least part of a singularity to the top, so many pairs of waves taken out."""
    cutoff = is_supported(strip) or not count
    return _ROOM if cutoff or strip.material.viscous_time_s > 0 else _LESS_ROOM


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
    used_hz, parts, good = [way.nodes_hz[::2]], [], np.ones(way.powers.size, dtype=np.bool_)
    for job in jobs:
        part = _solved(job, way, np.arange(job.distance.size))
        fine = part.error <= rtol * part.sizes()
        kept = np.all(fine, axis=1)
        if np.count_nonzero(kept) < (1 - _FEW) * good.size:
            places, wider = np.flatnonzero(~np.all(fine, axis=0)), way.wider()
            better = _solved(job, wider, places)
            part.value[:, places], part.error[:, places] = better.value, better.error
            used_hz.append(wider.nodes_hz[::2])
            kept = part.relative() <= rtol
        good &= kept
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
    question = job.question(
        *dimensionless(way.strip, nodes_hz.astype(np.complex128)), rtol=way.rtol
    )
    n_parts = math.ceil(places.size * max(nodes_hz.size / _NODES, way.powers.size / _VALUES))
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
