"""What has to be computed for loads and points: each different thing once, in widths."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.load import DISCS, ForceRectangle, Load, PressureDisc, PressureRectangle
from stimuli.solver.across import Span
from stimuli.solver.guided import PI
from stimuli.solver.source import Ends, Question, Source
from stimuli.strip.edge import SIMPLY_SUPPORTED, ElasticEdge

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Exact, Real
    from stimuli.strip.strip import Strip

    _Member = tuple[int, Source, Real]


_DECIMALS: Final = 15
"""Places in widths that agree to so many decimals are one place."""


_A_FEW: Final = 32
"""Rows of which the different ones are sooner found one by one."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """All that is computed for loads that differ in nothing but their place, in widths."""

    source: Source  # with one place across for all places, or one for each of these
    loads: tuple[int, ...]  # of the scene, for which it stands
    distance: Real  # different places, relative to the load: (n_places,)
    across: Real
    # where each load's points are among these, or among the pairs of `ends`: (n_loads, n_points)
    places: NDArray[np.intp]
    signs: tuple[int, ...]  # symmetries that are not zero
    symmetries: NDArray[np.intp]  # how many of them move each place: (n_places,)
    ends: Ends | None = None  # of a finite strip, with the different pairs of a load and a point

    def question(self, exact_k: Exact, exact_hold: Exact, rtol: float) -> Question:
        """Return what is asked of the solver for all places."""
        return Question(
            exact_k=exact_k,
            exact_hold=exact_hold,
            source=self.source,
            distance=self.distance,
            across=self.across,
            rtol=rtol,
        )

    @property
    def n_pairs(self) -> int:
        """Number of different pairs of a load and a point."""
        return int(self.distance.size if self.ends is None else self.ends.load.size)

    @property
    def n_symmetries(self) -> int:
        """Number of symmetries that are driven, summed over the loads' places across."""
        each = self.source.span.each()
        return sum(int(np.max(self.symmetries, where=some, initial=1)) for _, some in each)


def jobs(
    strip: Strip,
    loads: tuple[Load, ...],
    points_m: tuple[tuple[float, float], ...],
    *,
    skip: bool,
    driven: tuple[bool, ...] | None = None,
) -> tuple[Job, ...]:
    """Return what has to be computed for loads and points, each different thing once.

    `skip` leaves out equal and mirrored pairs, symmetries that are zero, and loads not `driven`
    (all are where nothing is said).

    Points to the left and to the right of a load, above and below its middle, are one:

    >>> from stimuli import ALUMINIUM, CLAMPED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> corners = tuple((x, y) for x in (-0.01, 0.01) for y in (0.005, 0.020))
    >>> len(jobs(strip, (PointForce(x_m=0.0, y_m=0.0125),), corners, skip=True)[0].distance)
    1
    """
    width_m = strip.width_m
    x, y = np.array(points_m).T
    across = np.round((2 * y - width_m) / (2 * width_m), _DECIMALS)
    groups: dict[object, list[_Member]] = {}
    for index, load in enumerate(loads):
        if skip and driven is not None and not driven[index]:
            continue
        source, turn = _source(load, width_m)
        places = turn * across
        if skip and not source.span.centre:
            places = -np.abs(places)
        table = np.empty((x.size, 5))
        table[:, 0], table[:, 1], table[:, 2] = np.abs(x - load.x_m), load.x_m, x
        table[:, :3] = np.round(table[:, :3] / width_m, _DECIMALS)
        table[:, 3], table[:, 4] = places, source.span.centre
        source = replace(source, span=Span(centre=0.0, length=source.span.length))
        key = source if skip else index
        groups.setdefault(key, []).append((index, source, table))
    return tuple(_job(members, strip, skip=skip) for members in groups.values())


def _job(members: list[_Member], strip: Strip, *, skip: bool) -> Job:
    source = members[0][1]
    table = np.concatenate([m[2] for m in members])
    pairs, places = _different(table[:, [0, 3, 4]], skip=skip)
    distance, across, centre = pairs.T
    span = Span(
        centre=float(centre[0]) if np.all(centre == centre[0]) else centre,
        length=source.span.length,
    )
    symmetries = np.where((centre == 0) | (across == 0), 1, 2) if skip else np.full(len(pairs), 2)
    ends = None
    if strip.length_m is not None:
        if skip:
            table = _mirrored(table)
        table, inverse = _different(np.column_stack([table, places]), skip=skip)
        direct, places = table[:, 5].astype(np.intp), inverse
        ends = Ends(
            length=strip.length_m / strip.width_m,
            poisson_ratio=strip.material.poisson_ratio,
            load=table[:, 1],
            point=table[:, 2],
            direct=direct,
        )
    return Job(
        source=replace(source, span=span),
        loads=tuple(m[0] for m in members),
        distance=distance,
        across=across,
        places=places.reshape(len(members), -1),
        signs=(1, -1)[: int(np.max(symmetries))],
        symmetries=symmetries,
        ends=ends,
    )


def _different(rows: Real, *, skip: bool) -> tuple[Real, NDArray[np.intp]]:
    """Return the different rows, and which of them each row is."""
    if not skip or len(rows) == 1:
        return rows, np.arange(len(rows))
    if len(rows) <= _A_FEW:
        seen = {row: number for number, row in enumerate(sorted({*map(tuple, rows.tolist())}))}
        return np.array([*seen]), np.array([seen[tuple(row)] for row in rows.tolist()])
    different, inverse = np.unique(rows, axis=0, return_inverse=True)
    return different, inverse.ravel()


def _mirrored(table: Real) -> Real:
    """Return pairs turned about the middle of the strip so that the load is on its right."""
    load, point = table[:, 1], table[:, 2]
    turn = np.where((load < 0) | ((load == 0) & (point < 0)), -1.0, 1.0)
    return np.column_stack([table[:, 0], turn * load + 0.0, turn * point + 0.0, table[:, 3:]])


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


_NO_SPRING_N: Final = 1e-200
"""Softer edges are simple supports: 1 / (kappa W) would overflow."""

_SOFTEST: Final = 1e18
"""1 / (kappa W) that stands for a simple support where nothing is to be skipped."""


def is_supported(strip: Strip) -> bool:
    """Return whether both edges are simple supports.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, ElasticEdge, Strip
    >>> is_supported(Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...                    edge=ElasticEdge(stiffness_n=0.0)))
    True
    """
    edge = strip.edge
    if isinstance(edge, ElasticEdge):
        return edge.stiffness_n <= _NO_SPRING_N
    return edge is SIMPLY_SUPPORTED


def hold_at_rest(strip: Strip) -> float:
    """Return 1 / (kappa W) of a static plate."""
    edge = strip.edge
    if is_supported(strip):
        return np.inf
    if not isinstance(edge, ElasticEdge):
        return 0.0
    return strip.bending_stiffness_n_m / (edge.stiffness_n * strip.width_m)


def dimensionless(
    strip: Strip, frequencies_hz: Complex, *, skip: bool = True
) -> tuple[Exact, Exact]:
    """Return k W and 1 / (kappa W) with the digits that p needs near a cut-off.

    With `skip` False simple supports are treated as springs next to none.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> k, hold = dimensionless(strip, np.array([strip.cutoff_hz() + 0j]))
    >>> bool(abs(k[0] - PI) < 1e-14), bool(np.isinf(hold[0]))
    (True, True)
    """
    material = strip.material
    width, thickness, nu = (
        np.longdouble(v) for v in (strip.width_m, strip.thickness_m, material.poisson_ratio)
    )
    stiffness = material.youngs_modulus_pa * thickness**3 / (12 * (1 - nu) * (1 + nu))
    factor = stiffness_factors(strip, frequencies_hz).astype(np.clongdouble)
    inertia = np.sqrt(np.sqrt(material.density_kg_m3 * thickness / stiffness))
    forward_hz = np.where(frequencies_hz.real < 0, -frequencies_hz, frequencies_hz)
    k = np.sqrt(2 * PI * forward_hz) * inertia * width / np.sqrt(np.sqrt(factor))
    edge = strip.edge
    if is_supported(strip):
        return k, np.full(k.size, np.inf if skip else _SOFTEST, dtype=np.clongdouble)
    if not isinstance(edge, ElasticEdge):
        return k, np.zeros(k.size, dtype=np.clongdouble)
    hold = stiffness / (edge.stiffness_n * width)
    return k, hold * (factor if edge.lossless else np.ones_like(factor))


def stiffness_factors(strip: Strip, frequencies_hz: Complex) -> Complex:
    """Return what the loss makes of the bending stiffness, equation (15)."""
    material = strip.material
    loss = material.loss_factor + 2 * np.pi * frequencies_hz * material.viscous_time_s
    return np.asarray(1 - 1j * loss)
