"""A strip, its loads and the places looked at: what has to be computed, what not, and why."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite, finite_array, instance
from stimuli.field.jobs import Job, dimensionless, is_supported, jobs
from stimuli.field.sweep import Band, bands
from stimuli.load import DISCS, LOADS, Load
from stimuli.solver.ends.ends import end_waves, faintness
from stimuli.solver.source import LEAST_RTOL, far_clearance
from stimuli.strip.strip import Strip
from stimuli.strip.waves import supported_cutoff_hz

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import ArrayLike

    from stimuli.arrays import Real


MOST_RTOL: Final = 0.1
MOST_CUTOFFS: Final = 5000.0
"""Highest frequency that is computed, in first cut-offs of the supported strip."""

_FARTHEST_M: Final = 1e3
_WIDEST_DISC: Final = 16.0
"""Largest k R of a disc: (50) loses exp(k R) of its digits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What a scene asks for and what of it is computed.

    Attributes
    ----------
    frequencies_asked, frequencies_solved : int
        The others follow from these by interpolation.
    pairs_asked, pairs_solved : int
        Pairs of a load and a point; the others are the same but for symmetry.
    symmetries_asked, symmetries_solved : int
        Symmetric and antisymmetric waves, for each different load.
    integrals_asked, integrals_solved : int
        Pairs, times symmetries, for which more is needed than the guided waves.
    reflections_asked, reflections_solved : int
        Pairs, times solved frequencies, for which the ends of a finite strip are asked for, and
        for which they count.
    wall_correction : bool
        Whether the edges are anything else than simple supports.
    skipped : tuple of str
        What is left out and why.

    Examples
    --------
    `Scene.work` gives one; on simple supports no wall correction is needed:

    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, PointForce
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> force = PointForce(x_m=0.0, y_m=0.0125)
    >>> Scene(strip=strip, loads=(force,), points_m=((0.0, 0.0125),)).work([300.0]).wall_correction
    False
    """

    frequencies_asked: int
    frequencies_solved: int
    pairs_asked: int
    pairs_solved: int
    symmetries_asked: int
    symmetries_solved: int
    integrals_asked: int
    integrals_solved: int
    reflections_asked: int
    reflections_solved: int
    wall_correction: bool
    skipped: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A strip with loads and the points at which its displacement is wanted.

    Attributes
    ----------
    strip : Strip
        The strip, endless or with two free ends at x = -length_m / 2 and length_m / 2.
    loads : tuple of Load
        At least one load, each wholly on the strip.
    points_m : tuple of (float, float)
        At least one point (x, y).
    driven : tuple of bool or None
        Which loads are ever driven, one value for each; all if None. The displacement of the
        others is 0.
    skip : bool
        Whether what does not change the result is left out. Switched off, everything is
        computed for every load, point and frequency: for tests and benchmarks.

    Raises
    ------
    ValueError
        If there is no load or no point, or one of them is not on the strip, or `driven` has
        not one bool for each load.

    Examples
    --------
    Two discs and the places above them are one pair of distances, and on the centre line only
    symmetric waves count:

    >>> from stimuli import ALUMINIUM, CLAMPED, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> discs = tuple(MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035))
    >>> scene = Scene(strip=strip, loads=discs, points_m=((-0.035, 0.0125), (0.035, 0.0125)))
    >>> work = scene.work([300.0], rtol=1e-6)
    >>> work.pairs_asked, work.pairs_solved, work.symmetries_asked, work.symmetries_solved
    (4, 2, 4, 1)
    """

    strip: Strip
    loads: tuple[Load, ...]
    points_m: tuple[tuple[float, float], ...]
    driven: tuple[bool, ...] | None = None
    skip: bool = field(default=True)

    def __post_init__(self) -> None:
        instance("strip", self.strip, Strip, "a Strip")
        instance("skip", self.skip, bool, "True or False")
        object.__setattr__(self, "loads", _some("loads", self.loads))
        for load in self.loads:
            instance("loads", load, LOADS, "a tuple of loads")
            _check_on_strip(load, self.strip)
        object.__setattr__(self, "points_m", _points(self.points_m, self.strip))
        if self.driven is not None:
            object.__setattr__(self, "driven", _switches(self.driven, len(self.loads)))

    def work(self, frequencies_hz: ArrayLike, rtol: float = 1e-6) -> Work:
        """Return what will be computed and what is left out, with the reason.

        For a sweep of a finite strip with loss it tells how many frequencies are solved at most:
        how many of them follow from others shows the field itself, see `Response.work`.

        Parameters
        ----------
        frequencies_hz : array_like of float, shape (n_frequencies,)
            Frequencies from 0.
        rtol : float
            Wanted relative error, from 1e-12 to 0.1.

        Returns
        -------
        Work
            Numbers of what is asked for and of what is solved, and the reasons.

        Raises
        ------
        ValueError
            If a frequency or `rtol` is out of its range.
        """
        frequencies, rtol = self.checked(frequencies_hz, rtol)
        jobs = self.jobs()
        return self.counted(frequencies.size, rtol, jobs, self.bands(frequencies, rtol, jobs))

    def counted(
        self,
        n_frequencies: int,
        rtol: float,
        jobs: tuple[Job, ...],
        found: tuple[Band, ...],
        *,
        reflections: int | None = None,
    ) -> Work:
        """Return the work that jobs and bands of frequencies are.

        `reflections` were counted on the way; before it they are sought.
        """
        n_pairs = len(self.loads) * len(self.points_m)
        n_solved = sum(band.solved_hz.size for band in found)
        asked = n_solved * n_pairs if self.strip.length_m is not None else 0
        if reflections is None:
            reflections = sum(
                job.n_pairs * self._reflecting(job, band.solved_hz, rtol)
                for job in jobs
                for band in found
            )
        work = Work(
            frequencies_asked=n_frequencies,
            frequencies_solved=n_solved,
            pairs_asked=n_pairs,
            pairs_solved=sum(job.n_pairs for job in jobs),
            symmetries_asked=2 * len(self.loads),
            symmetries_solved=sum(job.n_symmetries for job in jobs),
            integrals_asked=2 * n_pairs,
            integrals_solved=sum(self.near(job, rtol) for job in jobs),
            reflections_asked=asked,
            reflections_solved=min(reflections, asked),
            wall_correction=not (self.skip and self.is_supported),
            skipped=(),
        )
        idle = () if self.driven is None or not self.skip else self.driven
        reasons = (*_idle_loads(idle), *_reasons(work, found))
        object.__setattr__(work, "skipped", reasons)
        return work

    @property
    def is_supported(self) -> bool:
        """Whether both edges are simple supports."""
        return is_supported(self.strip)

    def checked(self, frequencies_hz: ArrayLike, rtol: float) -> tuple[Real, float]:
        """Return frequencies and tolerance, or refuse them.

        Raises
        ------
        ValueError
            If they are not one-dimensional, from 0 to 5000 first cut-offs (for wide discs to
            k R = 16), or `rtol` is not from 1e-12 to 0.1.
        """
        frequencies = finite_array("frequencies_hz", frequencies_hz)
        most_hz = self._most_hz()
        if frequencies.ndim != 1 or np.any((frequencies < 0) | (frequencies > most_hz)):
            raise ValueError(
                "frequencies_hz must be a one-dimensional array of frequencies from 0 to "
                f"{most_hz:.6g} Hz, got {frequencies_hz!r}"
            )
        return frequencies, finite("rtol", rtol, least=LEAST_RTOL, most=MOST_RTOL)

    def _most_hz(self) -> float:
        """Return the highest frequency that is computed."""
        strip = self.strip
        supported_hz = supported_cutoff_hz(strip.material, strip.width_m, strip.thickness_m)
        radii = [load.radius_m for load in self.loads if isinstance(load, DISCS)]
        widest = math.pi * max(radii, default=1e-9) / self.strip.width_m
        return min(MOST_CUTOFFS, (_WIDEST_DISC / widest) ** 2) * supported_hz

    def bands(
        self, frequencies_hz: Real, rtol: float, jobs: tuple[Job, ...], *, rational: bool = True
    ) -> tuple[Band, ...]:
        """Return how each frequency is obtained; without `rational` by no quotient."""
        farthest = max((float(np.max(job.distance)) for job in jobs), default=0.0)
        signs = tuple({sign: None for job in jobs for sign in job.signs})
        return bands(
            self.strip,
            frequencies_hz,
            rtol,
            farthest,
            signs=signs,
            skip=self.skip,
            rational=rational,
        )

    def near(self, job: Job, rtol: float) -> int:
        """Return for how many places of a job, times symmetries, waves are not enough."""
        if not self.skip:
            return int(np.sum(job.symmetries))
        clearance = job.distance - job.source.half_length - job.source.radius
        return int(np.sum(job.symmetries, where=clearance < far_clearance(rtol)))

    def _reflecting(self, job: Job, solved_hz: Real, rtol: float) -> int:
        """Return at how many frequencies the ends of the strip count for a job."""
        if job.ends is None or not self.skip:
            return 0 if job.ends is None else int(solved_hz.size)
        k, hold = dimensionless(self.strip, solved_hz.astype(np.complex128))
        question = job.question(k, hold, rtol).at(job.ends.direct)
        waves = end_waves(question, job.ends, job.signs)
        faint = faintness(question, job.ends, waves)
        return int(np.count_nonzero(np.any(faint > rtol, axis=1)))

    def jobs(self) -> tuple[Job, ...]:
        """Return what has to be computed, each different thing once.

        ValueError where the strip has patches: the field would be that of the bare plate.
        """
        if self.strip.patches:
            raise ValueError(
                "strip must have no patches: they count over time only, for bursts and in "
                f"`felt`, got {len(self.strip.patches)} of them"
            )
        loads, points_m = self.loads, self.points_m
        return jobs(self.strip, loads, points_m, skip=self.skip, driven=self.driven)


def _some(name: str, values: Iterable[object]) -> tuple[object, ...]:
    instance(name, values, (tuple, list), "a tuple")
    if not tuple(values):
        raise ValueError(f"{name} must hold at least one, got {values!r}")
    return tuple(values)


def _switches(driven: object, n_loads: int) -> tuple[bool, ...]:
    values = tuple(driven) if isinstance(driven, (tuple, list)) else ()
    if len(values) != n_loads or not all(isinstance(one, bool) for one in values):
        raise ValueError(f"driven must hold a bool for each of {n_loads} loads, got {driven!r}")
    return values


def _points(points: Iterable[object], strip: Strip) -> tuple[tuple[float, float], ...]:
    """Return points as pairs of floats, or refuse them: at once where they are that already."""
    some = _some("points_m", points)
    pairs = [one for one in some if type(one) is tuple and list(map(type, one)) == [float, float]]
    if len(pairs) == len(some):
        x_m, y_m = np.array(pairs).T
        if np.all(np.abs(x_m) <= _end_m(strip)) and np.all((y_m >= 0) & (y_m <= strip.width_m)):
            return tuple(pairs)
    return tuple(_point(point, strip) for point in some)


def _point(point: object, strip: Strip) -> tuple[float, float]:
    if not isinstance(point, (tuple, list)) or len(point) != 2:  # noqa: PLR2004 - x and y
        raise ValueError(f"points_m must hold pairs (x, y), got {point!r}")
    end_m = _end_m(strip)
    x_m = finite("points_m: x", point[0], least=-end_m, most=end_m)
    return x_m, finite("points_m: y", point[1], least=0.0, most=strip.width_m)


def _end_m(strip: Strip) -> float:
    """Return the largest x on the strip."""
    return _FARTHEST_M if strip.length_m is None else strip.length_m / 2


def _check_on_strip(load: Load, strip: Strip) -> None:
    """Refuse a load that is not wholly on the strip; one that touches an edge or an end is."""
    half_m = strip.width_m / 2
    for room_m, size_m in zip((_end_m(strip), half_m), load.half_size_m, strict=True):
        if size_m > room_m + 1e-12 * strip.width_m:
            raise ValueError(
                f"loads: sizes must be at most that of the strip, {2 * room_m:g} m in that "
                f"direction, got {load!r}"
            )
    limits = (
        ("y_m", load.y_m, half_m, half_m - load.half_size_m[1]),
        ("x_m", load.x_m, 0.0, _end_m(strip) - load.half_size_m[0]),
    )
    for name, place_m, middle_m, room_m in limits:
        if not abs(place_m - middle_m) <= room_m + 1e-12 * strip.width_m:
            raise ValueError(
                f"loads: {name} must lie from {middle_m - room_m:g} to {middle_m + room_m:g} m, so "
                f"that the load is on the strip, got {load!r}"
            )


def _idle_loads(driven: tuple[bool, ...]) -> Iterable[str]:
    """Say which loads are left out because they are never driven."""
    if not all(driven):
        yield f"{driven.count(False)} of {len(driven)} loads: never driven"


def _reasons(work: Work, found: tuple[Band, ...]) -> Iterable[str]:
    """Say what is left out and why."""
    for band in found:
        if band.solved_hz.size < band.rows.size and band.reason:
            yield (f"{band.rows.size} frequencies follow from {band.solved_hz.size}: {band.reason}")
    counts = (
        ("pairs", work.pairs_asked, work.pairs_solved, "they are repeated or mirror images"),
        (
            "symmetries",
            work.symmetries_asked,
            work.symmetries_solved,
            "zero on the centre line, or the load is repeated",
        ),
        (
            "integrals",
            work.integrals_asked,
            work.integrals_solved,
            "far from the load the guided waves are enough, or it is zero or repeated",
        ),
        (
            "reflections",
            work.reflections_asked,
            work.reflections_solved,
            "the ends are too far to be felt, or the pair is repeated or a mirror image",
        ),
    )
    for name, asked, solved, why in counts:
        if solved < asked:
            yield f"{asked - solved} of {asked} {name}: {why}"
    if not work.wall_correction:
        yield "the wall correction: the edges are simply supported"
