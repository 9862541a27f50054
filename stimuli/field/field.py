"""The displacement of a strip over frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import instance
from stimuli.field.jobs import Job, dimensionless, stiffness_factors, unit_scale
from stimuli.field.parted import swept as without_waves
from stimuli.field.rational import swept
from stimuli.field.scene import Scene, Work
from stimuli.solver.endless import Waves, n_waves, solved, summed
from stimuli.solver.ends.ends import ResonanceError, end_waves, with_ends
from stimuli.solver.source import LEAST_RTOL, Answered
from stimuli.strip.waves import supported_cutoff_hz
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.field.parted import Parted
    from stimuli.field.sweep import Band, Rational


_CHUNK: Final = 300
"""Pairs of a frequency and a place that are solved at once: more do not fit the cache."""

_STEADY: Final = 0.1
"""Part of the wanted error that is asked of what a quotient goes through: it makes more of it."""

_SHARED: Final = 8
"""Waves that the field of the endless strip may have beyond its own, if the ends need them."""

_AT_CUTOFF: Final = 4e-15

_LOW: Final = 1e-4
"""Part of the first cut-off at which inertia moves a plate by 1e-8 more than at rest."""

_CAUTION: Final = 3.0
"""What the first coefficient left out of a sweep is multiplied with."""

_TINIEST, _LEAST_FALL = 1e-300, 0.02


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """The displacement of a scene with its error.

    Attributes
    ----------
    displacement_m : ndarray of complex128, shape (n_frequencies, n_loads, n_points)
        Metres per unit load (1 N, 1 Pa, 1 N m/m), time factor exp(-i omega t).
    error_m : ndarray of float64, same shape
        Estimate of its error.
    work : Work
        What was computed.

    Examples
    --------
    `response` gives one; its estimate of the error keeps what was asked for:

    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> scene = Scene(strip=strip, loads=(PointForce(x_m=0.0, y_m=0.0125),),
    ...               points_m=((0.0, 0.0125),))
    >>> found = response(scene, [300.0, 500.0], rtol=1e-4)
    >>> found.displacement_m.shape, bool((found.error_m <= 1e-4 * abs(found.displacement_m)).all())
    ((2, 1, 1), True)
    """

    displacement_m: Complex
    error_m: Real
    work: Work


@dataclass(slots=True)
class _Tally:
    """What was computed, counted on the way."""

    reflections: int = 0


def displacement(scene: Scene, frequencies_hz: ArrayLike, rtol: float = 1e-6) -> Complex:
    """Return the displacement of a strip at points under unit loads, equations (37) to (53).

    Parameters
    ----------
    scene : Scene
        Strip, loads and points.
    frequencies_hz : array_like of float, shape (n_frequencies,)
        Frequencies from 0.
    rtol : float
        Wanted relative error, from 1e-12 to 0.1. It holds for every value, down to a floor of
        1e-3 rtol of the field's largest value there: where waves cancel, a null is not resolved
        further.

    Returns
    -------
    ndarray of complex128, shape (n_frequencies, n_loads, n_points)
        Metres per unit load (1 N, 1 Pa, 1 N m/m), time factor exp(-i omega t).

    Raises
    ------
    ValueError
        If an argument is out of its range, or a frequency is a cut-off of a strip without loss,
        or a resonance of a finite one to its last digit, where the field is infinite.

    Examples
    --------
    A load and a point may be exchanged:

    >>> from stimuli import ALUMINIUM, CLAMPED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> there = displacement(Scene(strip=strip, loads=(PointForce(x_m=0.0, y_m=0.005),),
    ...                            points_m=((0.02, 0.015),)), [5000.0])
    >>> back = displacement(Scene(strip=strip, loads=(PointForce(x_m=0.02, y_m=0.015),),
    ...                           points_m=((0.0, 0.005),)), [5000.0])
    >>> bool(abs(there / back - 1).max() < 1e-6)
    True
    """
    return response(scene, frequencies_hz, rtol).displacement_m


def at_rest(scene: Scene, rtol: float) -> Real:
    """Return the static displacement of a strip without loss: (n_loads, n_points).

    U is a series in the square of the frequency, of which a very low one leaves nothing: a ninth of
    the work of `displacement` at 0 Hz, and within 1e-7 of its largest value.
    """
    low_hz = _LOW * scene.strip.cutoff_hz()
    return np.asarray(solve(scene, np.array([low_hz], dtype=np.complex128), rtol).value[0].real)


@tuned
def response(scene: Scene, frequencies_hz: ArrayLike, rtol: float = 1e-6) -> Response:
    """Return the displacement with an estimate of its error and the work done.

    Parameters
    ----------
    scene : Scene
        Strip, loads and points.
    frequencies_hz : array_like of float, shape (n_frequencies,)
        Frequencies from 0.
    rtol : float
        Wanted relative error, from 1e-12 to 0.1, as for `displacement`.

    Returns
    -------
    Response
        Displacement, error and work.

    Raises
    ------
    ValueError
        As for `displacement`.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> scene = Scene(strip=strip, loads=(PointForce(x_m=0.0, y_m=0.0125),),
    ...               points_m=((0.0, 0.0125),))
    >>> at_300_hz = response(scene, [300.0], rtol=1e-10)
    >>> true_m = 1.35672670270450974e-05
    >>> error_m = abs(at_300_hz.displacement_m[0, 0, 0] - true_m)
    >>> bool(error_m < 1e-10 * true_m), bool(error_m < at_300_hz.error_m[0, 0, 0])
    (True, True)
    """
    instance("scene", scene, Scene, "a Scene")
    frequencies, rtol = scene.checked(frequencies_hz, rtol)
    jobs = scene.jobs()
    _refuse_cutoffs(scene, frequencies, jobs)
    tally = _Tally()
    table, bands = _swept(scene, frequencies, rtol, jobs, tally=tally)
    found = _assembled(scene, frequencies.astype(np.complex128), jobs, table)
    work = scene.counted(frequencies.size, rtol, jobs, bands, reflections=tally.reflections)
    return Response(displacement_m=found.value, error_m=found.error, work=work)


def _swept(
    scene: Scene,
    frequencies_hz: Real,
    rtol: float,
    jobs: tuple[Job, ...],
    *,
    tally: _Tally,
    rational: bool = True,
) -> tuple[Answered, tuple[Band, ...]]:
    """Return D U of all jobs' pairs, and the bands with the frequencies that were solved."""
    shape = (frequencies_hz.size, sum(job.n_pairs for job in jobs))
    value, error = np.zeros(shape, dtype=np.complex128), np.zeros(shape)
    done = []
    for band in scene.bands(frequencies_hz, rtol, jobs, rational=rational):
        if band.parted is not None:
            asked_hz = frequencies_hz[band.rows]
            part, solved_hz = _without_waves(scene, asked_hz, band.parted, rtol, jobs)
            done.append(replace(band, solved_hz=solved_hz))
        elif band.rational is None:
            try:
                part = _between(band, _tabled(scene, band.solved_hz, rtol, jobs, tally))
            except ResonanceError:
                _refuse_resonances(scene, band.solved_hz, rtol, jobs)
                raise
            done.append(band)
        else:
            found = _quotients(scene, band.solved_hz, band.rational, rtol, jobs, tally=tally)
            part, solved = found
            done.append(replace(band, solved_hz=band.solved_hz[solved]))
        value[band.rows], error[band.rows] = part.value, part.error
    return Answered(value=value, error=error), tuple(done)


def _without_waves(
    scene: Scene, frequencies_hz: Real, way: Parted, rtol: float, jobs: tuple[Job, ...]
) -> tuple[Answered, Real]:
    """Return D U of all jobs' pairs with the first waves taken out, and what was solved."""

    def alone(rows: NDArray[np.bool_]) -> Answered:
        return _tabled(scene, frequencies_hz[rows], rtol, jobs, _Tally())

    found, nodes_hz, poor = without_waves(way, rtol, jobs, alone)
    return found, np.append(nodes_hz, frequencies_hz[poor])


def _quotients(
    scene: Scene,
    frequencies_hz: Real,
    way: Rational,
    rtol: float,
    jobs: tuple[Job, ...],
    *,
    tally: _Tally,
) -> tuple[Answered, NDArray[np.intp]]:
    """Return D U of all jobs' pairs by quotients, and which frequencies were solved."""
    finer = max(_STEADY * rtol, LEAST_RTOL)
    place, at, back = np.unique(way.place, return_index=True, return_inverse=True)
    least = int(np.searchsorted(at, way.least))

    def some(rows: NDArray[np.intp]) -> Answered:
        if np.any(rows < least):
            hz = frequencies_hz[at[rows]]
            return _swept(scene, hz, finer, jobs, rational=False, tally=tally)[0]
        return _tabled(scene, frequencies_hz[at[rows]], finer, jobs, tally)

    ends = np.cumsum([0, *(job.n_pairs for job in jobs)]).tolist()
    groups = tuple(slice(*pair) for pair in pairwise(ends))
    found, solved = swept(place, some, rtol, first=way.first, least=least, groups=groups)
    return Answered(value=found.value[back], error=found.error[back]), at[solved]


def solve(
    scene: Scene, frequencies_hz: Complex, rtol: float, jobs: tuple[Job, ...] | None = None
) -> Answered:
    """Return the displacement, metres per unit load, and its error, frequency by frequency.

    Frequencies are omega / (2 pi), not 0 and no cut-off, Im >= 0 and, but for viscous loss, Re >=
    0; the answer has the shape (n_frequencies, n_loads, n_points). `jobs` are those of the scene,
    if known.

    With a growing time factor the field is that of a strip with loss:

    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> scene = Scene(strip=strip, loads=(PointForce(x_m=0.0, y_m=0.0125),),
    ...               points_m=((0.0, 0.0125),))
    >>> value = solve(scene, np.array([2500, 2500 + 1j]), 1e-9).value
    >>> bool(abs(value[1] - value[0]) < 1e-2 * abs(value[0]))
    True
    """
    jobs = scene.jobs() if jobs is None else jobs
    table = _tabled(scene, frequencies_hz, rtol, jobs, _Tally())
    return _assembled(scene, frequencies_hz, jobs, table)


def _tabled(
    scene: Scene,
    frequencies_hz: Complex | Real,
    rtol: float,
    jobs: tuple[Job, ...],
    tally: _Tally,
) -> Answered:
    """Return D U of all jobs' pairs in units of the width, side by side."""
    complex_hz = frequencies_hz.astype(np.complex128)
    parts = [_solved_at(scene, job, complex_hz, rtol, tally) for job in jobs]
    empty = np.zeros((frequencies_hz.size, 0))
    return Answered(
        value=np.concatenate([empty + 0j, *(part.value for part in parts)], axis=1),
        error=np.concatenate([empty, *(part.error for part in parts)], axis=1),
    )


def _assembled(
    scene: Scene, frequencies_hz: Complex, jobs: tuple[Job, ...], table: Answered
) -> Answered:
    """Return metres per unit load of every load at every point from what the jobs found."""
    shape = (frequencies_hz.size, len(scene.loads), len(scene.points_m))
    value, error = np.zeros(shape, dtype=np.complex128), np.zeros(shape)
    stiffness = scene.strip.bending_stiffness_n_m * stiffness_factors(scene.strip, frequencies_hz)
    first = 0
    for job in jobs:
        for load, places in zip(job.loads, job.places, strict=True):
            scales = (unit_scale(scene.loads[load], scene.strip.width_m) / stiffness)[:, np.newaxis]
            value[:, load] = table.value[:, first + places] * scales
            error[:, load] = table.error[:, first + places] * np.abs(scales)
        first += job.n_pairs
    if scene.driven is not None:
        driven = np.array(scene.driven, dtype=np.float64)[:, np.newaxis]
        value, error = value * driven, error * driven
    return Answered(value=value, error=error)


def _between(band: Band, part: Answered) -> Answered:
    """Return what the solved frequencies give at the asked ones, equation (53)."""
    if band.matrix is None or band.last is None or band.rest is None:
        return part
    value, error = part.value, part.error
    last = np.abs(band.last @ value)
    older, newer = np.max(last[:2], axis=0), np.max(last[2:], axis=0)
    fall = np.clip(np.sqrt(newer / np.maximum(older, _TINIEST)), _LEAST_FALL, 1.0)
    left_out = np.outer(band.rest, np.maximum(last[3], last[2] * fall) * fall)
    error = np.sqrt(band.matrix**2 @ error**2) + _CAUTION * left_out
    return Answered(value=band.matrix @ value, error=error)


def _solved_at(
    scene: Scene, job: Job, frequencies_hz: Complex, rtol: float, tally: _Tally
) -> Answered:
    """Return D U in units of the width for a job, in portions that fit the cache."""
    k, hold = dimensionless(scene.strip, frequencies_hz, skip=scene.skip)
    size = (frequencies_hz.size, job.distance.size)
    value, error = np.zeros(size, dtype=np.complex128), np.zeros(size)
    order = np.argsort(frequencies_hz.real)
    question = job.question(k, hold, rtol)
    waves = None
    if job.ends is not None:
        waves = end_waves(question.at(job.ends.direct), job.ends, job.signs)
    for places in np.array_split(np.arange(size[1]), -(-size[1] // _CHUNK)):
        n_rows = max(1, _CHUNK // places.size)
        for rows in np.array_split(order, -(-size[0] // n_rows)):
            some = replace(question.at(places), exact_k=k[rows], exact_hold=hold[rows])
            if waves is not None and waves[0].p.shape[1] <= n_waves(some.k) + _SHARED:
                known = [Waves.driven(some, one.at(rows)) for one in waves]
                part = summed(some, known, skip=scene.skip)
            else:
                part = solved(some, job.signs, skip=scene.skip)
            value[np.ix_(rows, places)] = part.value
            error[np.ix_(rows, places)] = part.error
    endless = Answered(value=value, error=error)
    if job.ends is None or waves is None:
        return endless
    found, n_reflecting = with_ends(
        question.at(job.ends.direct), job.ends, waves, endless, skip=scene.skip
    )
    tally.reflections += job.n_pairs * n_reflecting
    return found


def _refuse_resonances(
    scene: Scene, frequencies_hz: Real, rtol: float, jobs: tuple[Job, ...]
) -> None:
    """Refuse the first frequency at which the ends of a strip without loss have no answer."""
    for frequency_hz in frequencies_hz:
        try:
            solve(scene, np.array([complex(frequency_hz)]), rtol, jobs)
        except ResonanceError as error:
            raise ValueError(
                "frequencies_hz must not hold a resonance of a finite strip without loss: the "
                f"field is infinite there, got {float(frequency_hz)!r}"
            ) from error


def _refuse_cutoffs(scene: Scene, frequencies_hz: Real, jobs: tuple[Job, ...]) -> None:
    """Refuse frequencies at which a wave without loss neither propagates nor decays."""
    strip, material = scene.strip, scene.strip.material
    if material.loss_factor or material.viscous_time_s or not frequencies_hz.size:
        return
    even = any(-1 in job.signs for job in jobs)
    mode, highest_hz = 1, float(np.max(frequencies_hz))
    if highest_hz < 0.9 * supported_cutoff_hz(material, strip.width_m, strip.thickness_m):
        return  # below the first cut-off of every edge
    while (cutoff_hz := strip.cutoff_hz(mode)) <= highest_hz * (1 + 1e-9):
        at = np.abs(frequencies_hz - cutoff_hz) <= _AT_CUTOFF * cutoff_hz
        if np.any(at) and (even or mode % 2):
            raise ValueError(
                "frequencies_hz must not hold a cut-off of a strip without loss: the field is "
                f"infinite at {cutoff_hz!r} Hz, the cut-off of mode {mode}, got "
                f"{float(frequencies_hz[at][0])!r}"
            )
        mode += 1
