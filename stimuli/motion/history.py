"""The displacement over time by modes, if they reach the wanted error; frames; peaks by spectra."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.field.synthesis import (
    MOST_TIME_S,
    TransientWork,
    checked_times,
    synthesis_work,
    synthesized,
)
from stimuli.motion.course import LOOKS, Course, crests
from stimuli.motion.motion import is_enough, motion_of, motions, reference_of
from stimuli.motion.oscillators import moved
from stimuli.motion.peaks import INTERPOLATED, doubts_of, wait_of
from stimuli.motion.section import AGREED, sections, unpatched
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.motion.motion import Motion


_FINEST: Final = 1e-3
"""Wanted errors below are not tried: the steps of the drive alone cost a fifth of it."""

_STILL: Final = 1e-9
_CAUTION: Final = 2.0
"""What the inertia of the upper modes is multiplied with: at single times the others had more."""

_LATE: Final = 0.75
"""A largest value beyond this part of the time after the drive asks for twice that time."""

_MOST_DOUBLINGS: Final = 3
_ECHOED: Final = 2
"""So many times is that doubled at once where ends send echoes on and on: they may add up late."""

_MULTIPLES: Final = (4.0, 2.0)
"""Modes are kept up to the largest of these multiples of the reference for which there is room, on
the longest section of the plate for which there is."""


@tuned
def transient(scene: Scene, burst: Drive, times_s: ArrayLike, rtol: float = 1e-6) -> Real:
    """Return the displacement over time under a drive, equations (63) to (66), (78) to (82).

    Parameters
    ----------
    scene : Scene
        Strip, loads and points. Its loss must be causal: viscous or none.
    burst : Drive
        What each load is driven with, from t = 0: a `Burst` or a `SampledDrive`.
    times_s : array_like of float, shape (n_times,)
        Times in any order, from -1 to 1 s; by spectra those before 0 are computed like the others.
    rtol : float
        Wanted error, from 1e-10 to 0.1, relative to the largest ``|u|`` of each pair of a load
        and a point up to the last time, or to the end of the drive if that is later.

    Returns
    -------
    ndarray of float64, shape (n_times, n_loads, n_points)
        Metres per unit amplitude of each load (1 N, 1 Pa, 1 N m/m), driven alone.

    Raises
    ------
    ValueError
        If an argument is out of its range, the loss is not causal, or the drive has corners so
        sharp that `rtol` needs frequencies beyond those of the field.

    Examples
    --------
    Nothing moves before the drive begins:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    >>> u = transient(scene, burst, [-1e-3, -1e-4, 1.5e-3], rtol=1e-4)[:, 0, 0]
    >>> bool(np.max(np.abs(u[:2])) < 1e-4 * np.abs(u[2]))
    True
    """
    times, rtol = checked_times(scene, burst, times_s, rtol)
    found = _by_modes(scene, burst, times, rtol)
    if found is None and scene.strip.patches:
        raise ValueError(
            f"rtol must be larger where the strip has patches, which only modes know, got {rtol!r}"
        )
    return synthesized(scene, burst, times, rtol) if found is None else found[0]


def transient_work(
    scene: Scene, burst: Drive, times_s: ArrayLike, rtol: float = 1e-6
) -> TransientWork:
    """Return what `transient` computes and what it leaves out, with the reason.

    The range and its panels follow from the field itself, so this takes as long as `transient`.

    Parameters
    ----------
    scene : Scene
        Strip, loads and points.
    burst : Drive
        What each load is driven with, from t = 0.
    times_s : array_like of float, shape (n_times,)
        Times from -1 to 1 s.
    rtol : float
        Wanted error, from 1e-10 to 0.1, as for `transient`.

    Returns
    -------
    TransientWork
        Bins and frequencies, or modes, and the reasons.

    Raises
    ------
    ValueError
        As for `transient`.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    >>> work = transient_work(scene, burst, [0.01], rtol=1e-5)
    >>> work.frequencies_solved < work.bins_asked - work.bins_skipped < 0.1 * work.bins_asked
    True
    """
    times, rtol = checked_times(scene, burst, times_s, rtol)
    found = _by_modes(scene, burst, times, rtol)
    if found is None:
        return synthesis_work(scene, burst, times, rtol)
    _, motion = found
    of_scene = unpatched(scene).work([scene.strip.cutoff_hz() / 2], rtol)
    modes = motion.oscillators.poles.size
    reason = f"all bins: {modes} modes up to {motion.highest_hz:.6g} Hz are enough"
    return TransientWork(
        bins_asked=0,
        bins_skipped=0,
        frequencies_solved=1,  # for 0 Hz
        pairs_asked=of_scene.pairs_asked,
        pairs_solved=of_scene.pairs_solved,
        step_hz=0.0,
        highest_hz=motion.highest_hz,
        period_s=0.0,
        decay_per_s=0.0,
        skipped=(reason, *of_scene.skipped),
        modes=modes,
    )


def _by_modes(scene: Scene, drive: Drive, times_s: Real, rtol: float) -> tuple[Real, Motion] | None:
    """Return displacements and the motion that gives them; none if no modes are enough."""
    if rtol < _FINEST or not times_s.size:
        return None
    shorter: Real | None = None
    for section in sections(scene):
        for motion in motions(section, drive):
            moved_m, error_m, largest_m = history_of(motion, drive, times_s)
            if np.all(error_m <= rtol * largest_m):
                break
        else:
            return None
        if section is scene:
            return moved_m, motion
        if shorter is not None:
            apart_m = np.max(np.abs(moved_m - shorter), axis=0)
            if np.all(apart_m <= AGREED * rtol * largest_m):
                return moved_m, motion
        shorter = moved_m
    return None


def history_of(motion: Motion, drive: Drive, times_s: Real) -> tuple[Real, Real, Real]:
    """Return the displacement at times (n_times, n_loads, n_points), its error, and the largest.

    Both, (n_loads, n_points), are of all times up to the last one or to the end of the drive.
    """
    every = np.arange(motion.oscillators.rest_m.shape[1])
    oscillators = motion.oscillators
    loads = range(oscillators.rest_m.shape[0])
    weights = [oscillators.weights(load) for load in loads]
    doubts = [doubts_of(motion, load, every) for load in loads]
    shape = len(loads), every.size
    course = Course(motion, drive)
    end_s = max(float(np.max(times_s)), drive.duration_s)
    looks_s = np.arange(0.0, end_s, course.look_s, dtype=np.float64)
    largest, doubt = np.zeros(shape), np.zeros(shape)
    for answers, samples, _ in course.at(looks_s):
        for load in loads:
            size = np.abs(moved(weights[load], oscillators.rest_m[load], answers, samples))
            largest[load] = np.maximum(largest[load], np.max(size, axis=1, initial=0.0))
            all_doubts = sum(np.abs(moved(*one, answers, samples)) for one in doubts[load])
            most = np.max(all_doubts, axis=1, initial=0.0)
            doubt[load] = np.maximum(doubt[load], most)
    found = np.empty((times_s.size, *shape))
    for answers, samples, which in course.at(times_s):
        for load in loads:
            rest_m = oscillators.rest_m[load]
            found[which, load] = moved(weights[load], rest_m, answers, samples).T
    # where nothing moves, as at an edge, an error counts beside what moves elsewhere
    least = max(_STILL * float(np.max(largest)), float(np.finfo(np.float64).tiny))
    largest = np.maximum(largest, least)
    return found, _CAUTION * doubt + INTERPOLATED * largest, largest


def by_spectra(
    scene: Scene, places: Sequence[NDArray[np.intp]], drive: Drive, rtol: float, far_m: float
) -> Real:
    """Return the greatest absolute values over time at the places of each fingertip."""
    wait_s = wait_of(scene.strip, far_m)
    step_s = 1 / (LOOKS * reference_of(scene, drive))
    first = 0 if scene.strip.length_m is None else _ECHOED
    for doubling in range(first, _MOST_DOUBLINGS + 1):
        late_s = wait_s * 2**doubling
        end_s = min(drive.duration_s + late_s, MOST_TIME_S)
        times_s = np.append(np.arange(0.0, end_s, step_s), end_s)
        size_m = np.abs(synthesized(scene, drive, times_s, rtol))
        latest = max(np.max(np.argmax(_over(size_m, place), axis=0)) for place in places)
        if times_s[latest] <= drive.duration_s + _LATE * late_s or end_s == MOST_TIME_S:
            break
    crests_m = crests(size_m.T).T
    return np.stack([_over(crests_m, place) for place in places])


def _over(size_m: Real, place: NDArray[np.intp]) -> Real:
    """Return the largest value over some points, the last axis."""
    largest: Real = np.max(size_m[..., place], axis=-1)
    return largest


def frames_of(scene: Scene, drive: Drive, *, step_s: float, end_s: float) -> tuple[Real, Real]:
    """Return the times of frames, and the displacement of a scene's points in each.

    Parameters
    ----------
    scene : Scene
        Strip, loads, each driven by itself, and points; a loss must be viscous.
    drive : Drive
        What drives the loads, from t = 0.
    step_s : float
        Time from frame to frame.
    end_s : float
        No frame is later.

    Returns
    -------
    times_s : ndarray of float64, shape (n_frames,)
    displacement_m : ndarray of float64, shape (n_loads, n_points, n_frames)
        In metres per unit load amplitude.

    Raises
    ------
    ValueError
        If what lies between loads and points has too many modes below twice the reference: its
        first cut-off, or the upper edge of the drive's band if that is higher.

    Examples
    --------
    A plate that is not driven yet is at rest, and ends above the load's centre where it began:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125), (0.07, 0.0125)))
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="hann")
    >>> times_s, moved_m = frames_of(scene, burst, step_s=1e-4, end_s=4e-3)
    >>> times_s.size, float(abs(moved_m[0, :, 0]).max())
    (41, 0.0)
    >>> own_m, far_m = abs(moved_m[0]).max(axis=1)
    >>> bool(far_m < 1e-2 * own_m), bool(abs(moved_m[0, 0, -1]) < 1e-2 * own_m)
    (True, True)
    """
    reference_hz = reference_of(scene, drive)
    room = (
        (section, multiple)
        for multiple in _MULTIPLES
        for section in reversed(list(sections(scene)))
        if is_enough(section.strip, multiple * reference_hz)
    )
    longest = next(room, None)
    if longest is None:
        raise ValueError(
            "loads and points are too far apart for the modes up to "
            f"{_MULTIPLES[-1] * reference_hz:.6g} Hz; got width_m = {scene.strip.width_m:g}"
        )
    section, multiple = longest
    motion = motion_of(section, reference_hz, multiple)
    oscillators, loads = motion.oscillators, range(len(scene.loads))
    times_s = (step_s * np.arange(math.floor(end_s / step_s + 1e-9) + 1)).astype(np.float64)
    moved_m = np.zeros((len(loads), len(scene.points_m), times_s.size))
    for answers, late, which in Course(motion, drive).at(times_s):
        for load in loads:
            weights, rest_m = oscillators.weights(load), oscillators.rest_m[load]
            moved_m[load][:, which] = moved(weights, rest_m, answers, late)
    return times_s, moved_m
