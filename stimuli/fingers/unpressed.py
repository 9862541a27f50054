"""The peaks of a plate that no finger presses on, by its modes or by those of an endless strip."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.motion import is_enough, motion_of, motions, reference_of
from stimuli.motion.multiples import first_known
from stimuli.motion.peaks import patched_peaks, peaks_of, wait_of
from stimuli.motion.section import ECHOED, echoless, repeated, sections

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.motion.motion import Motion
    from stimuli.motion.peaks import Peaks


_QUIET: Final = 1e-3
"""What a finger feels at less than this part of another one is known to `rtol` of that part only,
0.4 dB at -80."""

_WORTH: Final = 2.0
"""A plate that is not so many times as long as the shortest section is sooner computed as a whole:
two sections have to agree before the shorter one is taken."""

_ECHO_POINTS: Final = 5
"""Every so many points of an area tell whether an echo counts."""


def by_modes(
    scene: Scene, places: Sequence[NDArray[np.intp]], drive: Drive, rtol: float, far_m: float
) -> tuple[Peaks, Motion, Scene] | None:
    """Return the greatest absolute values and whose modes they are of; none if none are enough."""
    section = heard(scene, places, drive, rtol, far_m)
    wait_s = wait_of(section.strip, far_m)
    endless, period_m = repeated(section, scene)

    def look(motion: Motion) -> tuple[Peaks, float]:
        found = peaks_of(motion, places, drive, wait_s=wait_s)
        counts_m = np.maximum(found.peak_m, _QUIET * np.max(found.peak_m, axis=0))
        # what comes round does not count, as a longer section told
        error_m = found.error_m - (found.around_m if period_m else 0.0)
        return found, float(np.max(error_m / counts_m)) / rtol

    found = first_known(motions(endless, drive, period_m), look)
    return None if found is None else (*found, section)


def by_patched_modes(
    scene: Scene, places: Sequence[NDArray[np.intp]], drive: Drive, far_m: float
) -> tuple[Peaks, Motion]:
    """Return the same of a plate with patches; ValueError if their modes are too many."""
    found, wait_s = list(motions(scene, drive)), wait_of(scene.strip, far_m)
    return patched_peaks(scene.strip, found, places, drive, wait_s=wait_s), found[-1]


def heard(
    scene: Scene, places: Sequence[NDArray[np.intp]], drive: Drive, rtol: float, far_m: float
) -> Scene:
    """Return the part of a plate whose echoes count, or all of a plate that is hardly longer."""
    shortest = next(sections(scene))
    if (scene.strip.length_m or math.inf) < _WORTH * (shortest.strip.length_m or 0.0):
        return scene
    some, numbers = np.unique(
        np.concatenate([place[::_ECHO_POINTS] for place in places]), return_inverse=True
    )
    groups = np.split(numbers, np.cumsum([len(place[::_ECHO_POINTS]) for place in places])[:-1])

    def quickly(section: Scene) -> Real | None:
        reference_hz = reference_of(section, drive)
        if not is_enough(section.strip, ECHOED * reference_hz):
            return None
        endless, period_m = repeated(section, scene)
        motion = motion_of(_at(endless, some), reference_hz, ECHOED, period_m=period_m)
        wait_s = wait_of(section.strip, far_m)
        return peaks_of(motion, groups, drive, wait_s=wait_s, with_error=False).peak_m

    return echoless(scene, quickly, rtol, _QUIET)


def _at(scene: Scene, some: NDArray[np.intp]) -> Scene:
    """Return a scene with some of its points only."""
    return dataclasses.replace(scene, points_m=tuple(scene.points_m[one] for one in some))
