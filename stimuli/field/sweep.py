"""At which frequencies a field is solved, and how it follows at the others.

The field of a finite strip with loss is rational in f^2, see `stimuli.field.rational`; that of an
endless one is smooth without its first waves, see `stimuli.field.parted`.

Below the first cut-off any field is an analytic function of f^2 (with viscous loss of f, through
0 and beyond), so that its values at a few Chebyshev nodes give it everywhere. At the lowest
frequencies this is the only way: there the two branches cancel, and the nodes are the nearest
places where they do not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.field.parted import parted
from stimuli.field.rational import FEWEST, PER_RESONANCE
from stimuli.strip.waves import supported_cutoff_hz

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.field.parted import Parted
    from stimuli.strip.strip import Strip


_UPPER: Final = 0.9
"""Part of the first cut-off up to which a sweep of a finite strip is interpolated."""

_LOWEST_TOPS: Final = (0.01, 0.3)
"""Least and largest top of the interval for the lowest frequencies, as a part of the supported
strip's first cut-off: the farther the points, the narrower, since the field varies more."""

_LOWEST_REACH: Final = 1.2
"""That part, times the distance in widths."""

_LOWEST: Final = (0.003, 0.1)
"""Below this part of that cut-off, or this part of the interval, nothing is solved by itself."""

_LOWEST_MOST: Final = _LOWEST[1] * _LOWEST_TOPS[1]
"""Part of that cut-off above which each frequency may be solved by itself."""

_NEXT: Final = 3.0
"""Times the least frequency that is solved, up to which the next one asked for tells of it."""

_MOST_RESONANCES: Final = 40.0
"""Resonances of one quotient; of more, the fit would take longer than to solve."""

_WORTH: Final = 1.5
"""Times the frequencies that a quotient takes, about, of which no fewer may be asked."""

_LOWEST_NODES: Final = 12
_FEWEST: Final = 4
_SPARE, _SPARE_FAR = 2.5, 3.8
"""Nepers beyond the wanted error, and those per width of distance, of the coefficients left out."""

_FARTHEST: Final = 6.0
"""Distance in widths up to which a sweep is interpolated."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Band:
    """Frequencies that are obtained in the same way: n asked for, from m solved."""

    rows: NDArray[np.intp]  # which of the asked frequencies: (n,)
    # (m,); with viscous loss some are negative: the field at -f is that of negative viscous loss
    solved_hz: Real
    # from solved values to the asked ones, (n, m); none if they are the same
    matrix: Real | Complex | None = None
    last: Real | None = None  # from solved values to the last four Chebyshev coefficients, (4, m)
    # error at the asked frequencies per size of the first coefficient left out, (n,)
    rest: Real | None = None
    ratio: float = 0.0  # of successive coefficients, at most
    reason: str = ""  # why it is done so; empty if there is nothing to tell
    parted: Parted | None = None  # then the first waves are taken out
    rational: Rational | None = None  # then which of `solved_hz` are solved is found on the way


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rational:
    """A band of a finite strip with loss, in increasing frequency."""

    place: Real  # what the field is rational in: (n,)
    first: int  # how many of them are solved to begin with
    least: int  # how many, the lowest, cannot be solved


def bands(
    strip: Strip,
    frequencies_hz: Real,
    rtol: float,
    distance: float,
    *,
    signs: tuple[int, ...],
    skip: bool,
    rational: bool = True,
) -> tuple[Band, ...]:
    """Return how each frequency is obtained.

    `distance` is the largest along the strip in widths, `signs` are the symmetries driven. With
    `skip` False only the lowest frequencies, which cannot be solved, are interpolated. Without
    `rational` no band is rational.

    Examples
    --------
    Five hundred frequencies below the cut-off need no more solutions than fifty:

    >>> from stimuli import ALUMINIUM, CLAMPED, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> [bands(strip, np.linspace(4, 1500, n), 1e-6, 3.0, signs=(1,), skip=True)[0].solved_hz.size
    ...  for n in (50, 500)]
    [3, 3]
    """
    supported_hz = supported_cutoff_hz(strip.material, strip.width_m, strip.thickness_m)
    every = np.arange(frequencies_hz.size)
    if every.size < _FEWEST and frequencies_hz.min(initial=np.inf) >= _LOWEST_MOST * supported_hz:
        return (Band(rows=every, solved_hz=frequencies_hz),) if every.size else ()
    found = _without_waves(strip, frequencies_hz, rtol, signs) if skip else []
    done = np.zeros(frequencies_hz.size, dtype=np.bool_)
    for band in found:
        done[band.rows] = True
    if done.all():
        return tuple(found)
    viscous = strip.material.viscous_time_s > 0
    singular_hz = _first_singular_hz(strip)
    top_hz = _UPPER * singular_hz
    below = np.flatnonzero(frequencies_hz <= top_hz)
    part = float(np.clip(_LOWEST_REACH / max(distance, 1e-9), *_LOWEST_TOPS))
    part = min(part, top_hz / supported_hz)
    least_hz = max(_LOWEST[0], _LOWEST[1] * part) * supported_hz
    if skip and rational and strip.length_m is not None and _is_lossy(strip):
        found += _rational(strip, frequencies_hz, least_hz)
        done[np.concatenate([every[:0], *(band.rows for band in found)])] = True
        below = below[~done[below]]
    if skip and below.size and distance <= _FARTHEST and strip.length_m is not None:
        most_hz = max(float(np.max(frequencies_hz[below])), part * supported_hz)
        ratio = _ratio(most_hz / singular_hz, viscous=viscous)
        count = _count(ratio, rtol, distance)
        count += count % 2 if viscous else 0  # none of them 0 Hz
        if count < below.size:
            reason = "below cut-off the field is smooth in frequency"
            found.append(
                _interpolated(
                    frequencies_hz,
                    below,
                    viscous=viscous,
                    top_hz=most_hz,
                    count=count,
                    ratio=ratio,
                    reason=reason,
                )
            )
            done[below] = True
    lowest = np.flatnonzero((frequencies_hz < least_hz) & ~done)
    if lowest.size:
        most_hz = part * supported_hz
        n_lowest = _LOWEST_NODES * (2 if viscous else 1)
        reason = "near 0 Hz the two branches cancel"
        band = _interpolated(
            frequencies_hz,
            lowest,
            viscous=viscous,
            top_hz=most_hz,
            count=n_lowest,
            ratio=_ratio(most_hz / singular_hz, viscous=viscous),
            reason=reason,
        )
        found.append(band)
        done[lowest] = True
    rest = np.flatnonzero(~done)
    if rest.size:
        found.append(Band(rows=rest, solved_hz=frequencies_hz[rest]))
    return tuple(found)


def _without_waves(
    strip: Strip, frequencies_hz: Real, rtol: float, signs: tuple[int, ...]
) -> list[Band]:
    """Return the band of an endless strip without its first waves, where that saves work."""
    way = parted(strip, frequencies_hz, rtol, signs) if signs and strip.length_m is None else None
    if way is None:
        return []
    reason = "without its first waves the field is smooth in frequency"
    return [Band(rows=way.rows, solved_hz=way.nodes_hz[::2], reason=reason, parted=way)]


def _is_lossy(strip: Strip) -> bool:
    return strip.material.loss_factor > 0 or strip.material.viscous_time_s > 0


def _rational(strip: Strip, frequencies_hz: Real, least_hz: float) -> list[Band]:
    """Return the bands in which the field is a quotient, where that saves work."""
    order = np.argsort(frequencies_hz, kind="stable")
    rising = frequencies_hz[order]
    n_lowest = int(np.searchsorted(rising, least_hz))
    if n_lowest < rising.size and rising[n_lowest] > _NEXT * least_hz:
        order, rising, n_lowest = order[n_lowest:], rising[n_lowest:], 0
    if rising.size - n_lowest <= FEWEST:
        return []
    resonances = _resonances(strip, rising)
    resonances -= resonances[0]
    parts = math.ceil(resonances[-1] / _MOST_RESONANCES) or 1
    cuts = np.searchsorted(resonances, resonances[-1] * np.arange(1, parts) / parts)
    found = []
    for part in np.split(np.arange(rising.size), cuts):
        if not part.size:
            continue
        count = float(resonances[part[-1]] - resonances[part[0]])
        if part.size < _WORTH * (FEWEST + PER_RESONANCE * count):
            continue
        place_hz = rising[part] / rising[part[-1]]
        band = Rational(
            place=place_hz if strip.material.viscous_time_s > 0 else place_hz**2,
            first=FEWEST + math.ceil(count),
            least=max(n_lowest - int(part[0]), 0),
        )
        reason = "between free ends and with loss the field is a quotient in frequency"
        found.append(Band(rows=order[part], solved_hz=rising[part], reason=reason, rational=band))
    return found


def _resonances(strip: Strip, frequencies_hz: Real) -> Real:
    """Return about how many resonances lie below frequencies: p L = n pi, p of (9)."""
    material, count = strip.material, np.zeros(frequencies_hz.size)
    length_m = strip.length_m or 0.0
    inertia = material.density_kg_m3 * strip.thickness_m / strip.bending_stiffness_n_m
    mode = 1
    while (cutoff_hz := strip.cutoff_hz(mode)) < frequencies_hz[-1]:
        above = 2 * np.pi * np.maximum(frequencies_hz - cutoff_hz, 0.0)
        count += np.sqrt(np.sqrt(inertia) * above) * length_m / np.pi
        mode += 1
    return count


def _first_singular_hz(strip: Strip) -> float:
    """Return up to where the field is smooth: the first cut-off, or a bound of resonances, (59)."""
    cutoff_hz = strip.cutoff_hz()
    if strip.length_m is None:
        return cutoff_hz
    poisson_ratio = strip.material.poisson_ratio
    return cutoff_hz * float(np.sqrt((1 - poisson_ratio) * (1 + poisson_ratio)))


def _ratio(part: float, *, viscous: bool) -> float:
    """Return the ratio of coefficients up to a part of where the nearest singularity is."""
    centre = 1 / part if viscous else 2 / part**2 - 1
    return float(1 / (centre + np.sqrt(centre**2 - 1)))


def _count(ratio: float, rtol: float, distance: float) -> int:
    """Return how many nodes reach the wanted error."""
    digits = -math.log(rtol) + _SPARE + _SPARE_FAR * distance
    return max(math.ceil(-digits / math.log(ratio)) + 1, _FEWEST)


def _interpolated(
    frequencies_hz: Real,
    rows: NDArray[np.intp],
    *,
    viscous: bool,
    top_hz: float,
    count: int,
    ratio: float,
    reason: str,
) -> Band:
    """Return a band from 0 to its top that is interpolated in f^2 or, viscous, in f, (53)."""
    angle = np.pi * (np.arange(count) + 0.5) / count
    nodes_hz, place = top_hz * np.cos(angle), frequencies_hz[rows] / top_hz
    if not viscous:
        nodes_hz, place = top_hz * np.cos(angle / 2), 2 * place**2 - 1
    place = np.clip(place, -1.0, 1.0)
    order, turn = np.arange(count), np.arccos(place)
    to_coefficients = 2 / count * np.cos(order[:, np.newaxis] * angle)
    to_coefficients[0] /= 2
    return Band(
        rows=rows,
        solved_hz=nodes_hz,
        matrix=np.cos(order * turn[:, np.newaxis]) @ to_coefficients,
        last=to_coefficients[-4:],
        rest=np.abs(np.cos(count * turn)) * (1 - ratio**2) / (1 - 2 * ratio * place + ratio**2),
        ratio=ratio,
        reason=reason,
    )
