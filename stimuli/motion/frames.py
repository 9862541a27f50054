"""Places of a plate at equal steps of time while it is driven: what an animation shows."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.motion import is_enough, motion_of, reference_of
from stimuli.motion.oscillators import moved
from stimuli.motion.peaks import Course
from stimuli.motion.section import sections

if TYPE_CHECKING:
    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene


_MULTIPLES: Final = (4.0, 2.0)
"""Modes are kept up to the largest of these multiples of the reference for which there is room, on
the longest section of the plate for which there is."""


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
