"""What has to be computed for loads and points: each different thing once, in widths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.load import DISCS, ForceRectangle, Load, PressureDisc, PressureRectangle
from stimuli.transform import Source
from stimuli.transverse import Span

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Real = NDArray[np.float64]
    _Member = tuple[int, Source, Real, Real]

_DECIMALS: Final = 15
"""Places in widths that agree to so many decimals are one place."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """All that is computed for loads that differ in nothing but their place, in widths.

    Attributes
    ----------
    source : Source
        The load.
    loads : tuple of int
        Which loads of the scene it stands for.
    distance, across : ndarray of float64, shape (n_pairs,)
        Different places relative to the load.
    places : ndarray of int, shape (n_loads, n_points)
        Where each load's points are among them.
    signs : tuple of int
        Symmetries that are not zero.
    """

    source: Source
    loads: tuple[int, ...]
    distance: Real
    across: Real
    places: NDArray[np.intp]
    signs: tuple[int, ...]


def jobs(
    width_m: float,
    loads: tuple[Load, ...],
    points_m: tuple[tuple[float, float], ...],
    *,
    skip: bool,
    driven: tuple[bool, ...] | None = None,
) -> tuple[Job, ...]:
    """Return what has to be computed for loads and points, each different thing once.

    Parameters
    ----------
    width_m : float
        Width of the strip.
    loads : tuple of Load
        Loads.
    points_m : tuple of (float, float)
        Points.
    skip : bool
        Whether equal and mirrored pairs, symmetries that are zero and loads that are not driven
        are left out.
    driven : tuple of bool or None
        Which loads are driven; all if none is given.

    Returns
    -------
    tuple of Job

    Examples
    --------
    Points to the left and to the right of a load, above and below its middle, are one:

    >>> from stimuli import PointForce
    >>> corners = tuple((x, y) for x in (-0.01, 0.01) for y in (0.005, 0.020))
    >>> len(jobs(0.025, (PointForce(x_m=0.0, y_m=0.0125),), corners, skip=True)[0].distance)
    1
    """
    x, y = np.array(points_m).T
    across = np.round((2 * y - width_m) / (2 * width_m), _DECIMALS)
    groups: dict[object, list[_Member]] = {}
    for index, load in enumerate(loads):
        if skip and driven is not None and not driven[index]:
            continue
        source, turn = _source(load, width_m)
        distance = np.round(np.abs(x - load.x_m) / width_m, _DECIMALS)
        places = turn * across
        if skip and source.span.centre == 0:
            places = -np.abs(places)
        key = source if skip else index
        groups.setdefault(key, []).append((index, source, distance, places))
    return tuple(_job(members, skip=skip) for members in groups.values())


def _job(members: list[_Member], *, skip: bool) -> Job:
    source = members[0][1]
    pairs = np.concatenate([m[2] + 1j * m[3] for m in members])
    inverse = np.arange(pairs.size)
    if skip:
        pairs, inverse = np.unique(pairs, return_inverse=True)
    symmetric = source.span.centre == 0 or not np.any(pairs.imag)
    return Job(
        source=source,
        loads=tuple(m[0] for m in members),
        distance=pairs.real.copy(),
        across=pairs.imag.copy(),
        places=inverse.reshape(len(members), -1),
        signs=(1,) if skip and symmetric else (1, -1),
    )


def _source(load: Load, width_m: float) -> tuple[Source, int]:
    """Return a load in widths, mirrored so that it lies at or below the centre line, and how."""
    centre = round((2 * load.y_m - width_m) / (2 * width_m), _DECIMALS)
    turn = -1 if centre > 0 else 1
    centre = turn * centre
    along_m, across_m = load.half_size_m
    moment = load.is_moment
    if isinstance(load, DISCS):
        span = Span(centre=centre)
        return Source(span=span, radius=min(along_m / width_m, 0.5), moment=moment), turn
    span = Span(centre=centre, length=min(2 * across_m / width_m, 1.0))
    return Source(span=span, half_length=along_m / width_m, moment=moment), turn


def unit_scale(load: Load, width_m: float) -> float:
    """Return what makes of the dimensionless field D times metres per unit load, equation (37)."""
    if isinstance(load, (PressureDisc, PressureRectangle)):
        return width_m**4
    if isinstance(load, ForceRectangle):
        return width_m**4 / load.area_m2
    return width_m**2
