"""Fingertips that press on a plate: a mass, a spring and a damper each, which couple its modes."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial.legendre import leggauss

from stimuli.errors import FingertipLoadError
from stimuli.fingers.dampers import Lossy, Ties, coupled_poles
from stimuli.load import PointForce, PressureDisc
from stimuli.motion.motion import (
    Motion,
    bare_of,
    enough_of,
    is_enough,
    multiples_of,
    reference_of,
    springs_lose,
    without_loss,
)
from stimuli.motion.multiples import first_known, upwards
from stimuli.motion.oscillators import Oscillators
from stimuli.motion.peaks import patched_peaks, peaks_of, wait_of
from stimuli.motion.section import ECHOED, echoless, repeated

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.fingers.impedance import Pressed
    from stimuli.motion.motion import Bare
    from stimuli.motion.multiples import Upwards
    from stimuli.motion.peaks import Peaks
    from stimuli.strip.strip import Strip

_RINGS, _ANGLES = 6, 12
"""Rings, and places on each, of the mean over a contact area of a static field, which is smooth:
within 1e-8 of it, or 3e-4 where a small disc ends under the finger."""

_DIGITS: Final = 12
"""Places are rounded to a picometre, so that mirrored ones are equal."""

_APART: Final = 1e-6
"""Areas whose means differ by less, as a part of what the upper modes give, are the same."""

_MORE: Final = 1.4
"""Up to so much higher a frequency modes are kept, which fingers couple, and in the end once more,
as nobody else can be asked."""

_QUIET: Final = 3e-3
"""What a finger feels at less than this part of another one is known to `rtol` of that part only,
0.4 dB at -70."""

MOST_COUPLED: Final = 800
"""Modes that fingers may couple: their poles take a few seconds then."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plate:
    """A plate as q'' + damping q' + squared q = pushed s(t), and what follows at once.

    Attributes
    ----------
    squared : ndarray of float64, shape (n_modes,)
    damping : ndarray of float64, shape (n_modes, n_modes), or (n_modes,)
        Where each mode loses its own only, that.
    moved : ndarray of float64, shape (n_points, n_modes)
    pushed : ndarray of float64, shape (n_loads, n_modes)
    rest_m : ndarray of float64, shape (n_loads, n_points)
    """

    squared: Real
    damping: Real
    moved: Real
    pushed: Real
    rest_m: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loaded:
    """The same with fingers on it, whose loss is a matrix or a few ties beside each mode's own."""

    squared: Real
    damping: Real | Lossy
    moved: Real
    pushed: Real
    rest_m: Real


def pressed_peaks(
    scene: Scene,
    groups: Sequence[NDArray[np.intp]],
    drive: Drive,
    pressed: tuple[Pressed, ...],
    *,
    rtol: float,
    far_m: float,
) -> tuple[Peaks, Motion, Scene]:
    """Return the largest displacements with fingers on a plate, and what gives them of which part.

    ValueError where they are not known to `rtol`, or the plate is not one for fingers: only modes
    know them.
    """
    if scene.strip.patches:
        found, wait_s = list(pressed_motions(scene, drive, pressed)), wait_of(scene.strip, far_m)
        return patched_peaks(scene.strip, found, groups, drive, wait_s=wait_s), found[-1], scene

    def quickly(section: Scene) -> Real | None:
        reference_hz = reference_of(section, drive)
        if not is_enough(section.strip, ECHOED * reference_hz):
            return None
        there, wait_s = _moved_to(section, scene, pressed), wait_of(section.strip, far_m)
        endless, period_m = repeated(section, scene)
        motion = pressed_motion(endless, reference_hz, ECHOED, there, period_m=period_m)
        return peaks_of(motion, groups, drive, wait_s=wait_s, with_error=False).peak_m

    section = echoless(scene, quickly, rtol, _QUIET)
    there, wait_s = _moved_to(section, scene, pressed), wait_of(section.strip, far_m)

    def look(motion: Motion) -> tuple[Peaks, float]:
        peaks = peaks_of(motion, groups, drive, wait_s=wait_s)
        counts_m = np.maximum(peaks.peak_m, _QUIET * np.max(peaks.peak_m, axis=0))
        return peaks, float(np.max(peaks.error_m / counts_m)) / rtol

    known = first_known(pressed_motions(section, drive, there, repeated(section, scene)), look)
    if known is not None:
        return *known, section
    raise FingertipLoadError(
        f"fingertips must have no impedance where the plate's modes do not give rtol = {rtol:g}, "
        f"got {pressed!r}"
    )


def _moved_to(section: Scene, scene: Scene, pressed: tuple[Pressed, ...]) -> tuple[Pressed, ...]:
    """Return what presses on a scene where it does on a section of it."""
    by_m, moved = section.points_m[0][0] - scene.points_m[0][0], dataclasses.replace
    return tuple(moved(one, over=moved(one.over, x_m=one.over.x_m + by_m)) for one in pressed)


def pressed_motions(
    scene: Scene,
    drive: Drive,
    pressed: tuple[Pressed, ...],
    endless: tuple[Scene, float | None] | None = None,
) -> Upwards[Motion]:
    """Yield a scene with fingers as oscillators for a drive, then with more of them.

    `endless` is the same without ends and its period, where no echo counts.
    """
    alike, period_m = endless or (scene, None)
    reference_hz = reference_of(scene, drive)
    first, second = multiples_of(drive, reference_hz, scene.strip)
    more = [_MORE * first, _MORE * second, _MORE * second**2 / first]
    asked = [first, second] if scene.strip.patches else more
    return upwards(
        enough_of(scene.strip, reference_hz, asked),
        lambda multiple, most: pressed_motion(
            alike, reference_hz, multiple, pressed, most=most, period_m=period_m
        ),
    )


@lru_cache(maxsize=4)
def pressed_motion(
    scene: Scene,
    reference_hz: float,
    multiple: float,
    pressed: tuple[Pressed, ...],
    *,
    most: float | None = None,
    period_m: float | None = None,
) -> Motion:
    """Return a scene with fingers as oscillators, whatever the symmetry of its modes, (90), (91).

    Parameters
    ----------
    scene : Scene
        A plate with ends, loads and points; a loss must be viscous.
    reference_hz : float
        The first cut-off, or the upper edge of the drive's band if that is higher.
    multiple : float
        Modes above so many times that frequency follow their load at once.
    pressed : tuple of Pressed
        The fingers, all at once.
    most : float, optional
        The largest multiple that is going to be asked for.
    period_m : float, optional
        After which length an endless strip is taken to repeat itself.

    Raises
    ------
    ValueError
        If the strip is endless without a period or has too many modes, or two fingers press on one
        place.
    """
    strip, highest_hz = scene.strip, multiple * reference_hz
    if strip.length_m is None and period_m is None:
        raise ValueError(f"length_m must be a number where fingers press, got {strip!r}")
    lossless = dataclasses.replace(scene, strip=without_loss(strip))
    sought = with_areas(lossless, pressed), highest_hz, (most or multiple) * reference_hz
    bare = bare_of(*sought, period_m)
    n_modes = sum(moved.shape[0] * moved.shape[2] for moved in bare.moved)
    if n_modes > MOST_COUPLED:
        raise FingertipLoadError(
            f"length_m must be one whose modes below {highest_hz:.6g} Hz are at most "
            f"{MOST_COUPLED} where fingers press, got {strip.length_m or period_m!r} and "
            f"{n_modes} modes"
        )

    def up_to(upper_hz: float, *coarser: Callable[[], Motion]) -> Motion:
        oscillators = _coupled(bare, strip, pressed, upper_hz)
        return Motion(
            oscillators=oscillators,
            late=np.abs(oscillators.poles) > 2 * math.pi * upper_hz / math.sqrt(2),
            turned=None,
            reference_hz=reference_hz,
            highest_hz=upper_hz,
            viscous_s=strip.material.viscous_time_s,
            coarser=coarser,
        )

    coarser = (partial(up_to, highest_hz / part) for part in (math.sqrt(2), 2.0))
    return up_to(highest_hz, *coarser)


def _coupled(
    bare: Bare, strip: Strip, pressed: tuple[Pressed, ...], highest_hz: float
) -> Oscillators:
    """Return the oscillators that the modes up to a frequency are with fingers on the plate."""
    from scipy.linalg import block_diag

    squared, bents, moved, pushed = bare.alone()
    kept = squared <= (2 * math.pi * highest_hz) ** 2
    viscous_s = strip.material.viscous_time_s
    damping = viscous_s * squared[kept]
    if not springs_lose(strip) and all(one.ndim == 1 for one in bents):
        damping = viscous_s * np.concatenate(bents)[kept]
    elif not springs_lose(strip):
        squares = [np.diag(one) if one.ndim == 1 else one for one in bents]
        damping = viscous_s * block_diag(*squares)[np.ix_(kept, kept)]
    moved, pushed = moved[:, kept], pushed[:, kept]
    plate = Plate(
        squared=squared[kept],
        damping=damping,
        moved=moved,
        pushed=pushed,
        rest_m=bare.static_m - (pushed / squared[kept]) @ moved.T,
    )
    loaded = pressed_on(plate, pressed, viscous_s)
    rows = loaded.moved, loaded.pushed
    found, moving, driven = coupled_poles(loaded.squared, loaded.damping, rows)
    return Oscillators(
        poles=found,
        at_points=moving[np.newaxis],
        of_loads=driven[np.newaxis],
        rest_m=loaded.rest_m,
    )


def with_areas(scene: Scene, pressed: tuple[Pressed, ...]) -> Scene:
    """Return a scene with the fingers' pressures as more loads, and nodes of their areas."""
    nodes_m = [node for one in pressed for node in _nodes(one.over)]
    driven = None if scene.driven is None else scene.driven + (True,) * len(pressed)
    loads = scene.loads + tuple(one.over for one in pressed)
    points_m = scene.points_m + tuple(nodes_m)
    return dataclasses.replace(scene, loads=loads, points_m=points_m, driven=driven)


def pressed_on(bare: Plate, pressed: tuple[Pressed, ...], viscous_s: float) -> Loaded:
    """Return a plate with fingers on it, equations (90) and (91).

    Parameters
    ----------
    bare : Plate
        The plate without them, of a scene `with_areas`; `squared` are those of its modes.
    pressed : tuple of Pressed
        The fingers.
    viscous_s : float
        Relaxation time of the plate.

    Raises
    ------
    ValueError
        If two fingers press on the same place.
    """
    n = len(pressed)
    n_loads, n_points = len(bare.rest_m) - n, bare.moved.shape[0] - n * _RINGS * _ANGLES
    areas_m2 = np.array([one.area_m2 for one in pressed])
    shares = np.concatenate([_shares(one.over) for one in pressed]).reshape(n, -1)
    rest_m = bare.rest_m.copy()
    rest_m[n_loads:] /= areas_m2[:, np.newaxis]
    at_nodes = rest_m[:, n_points:].reshape(len(rest_m), n, -1)
    of_fingers_m, of_points_m = np.einsum("lfn,fn->lf", at_nodes, shares), rest_m[:, :n_points]
    own = bare.pushed[n_loads:] / areas_m2[:, np.newaxis]  # the modes' means over the areas
    flexible = (of_fingers_m[n_loads:] + of_fingers_m[n_loads:].T) / 2
    least, most = np.linalg.eigvalsh(flexible)[[0, -1]]
    if not least > _APART * most:
        raise ValueError(f"fingertips must press on places apart, got {pressed!r}")
    stiff = np.linalg.inv(flexible)
    # the coordinates are the modes and the areas' means, these times the root of their masses
    root = np.sqrt([one.impedance.mass_kg for one in pressed])
    springs = np.array([one.impedance.stiffness_n_m for one in pressed]) / root**2
    dampers = np.array([one.impedance.damping_n_s_m for one in pressed]) / root**2
    stretch = np.concatenate([-own, np.diag(1 / root)], axis=1)  # of what bends beside the modes
    squared = np.append(bare.squared, springs)
    carried = stiff @ of_points_m[n_loads:]  # how points follow the stretch
    drawn = of_fingers_m[:n_loads] @ stiff
    pad = [(0, 0), (0, n)]
    moved = np.pad(bare.moved[:n_points], pad) + carried.T @ stretch
    pushed = np.pad(bare.pushed[:n_loads], pad) + drawn @ stretch
    rest_m = of_points_m[:n_loads] - of_fingers_m[:n_loads] @ carried
    if bare.damping.ndim == 1 and np.any(bare.damping != viscous_s * bare.squared):
        ties = Ties(np.linalg.cholesky(stiff).T @ stretch, np.ones(n), (1.0, viscous_s))
        alone = Lossy(np.append(bare.damping, dampers), ties)
        return Loaded(squared=squared, damping=alone, moved=moved, pushed=pushed, rest_m=rest_m)
    beside = stretch.T @ stiff @ stretch
    squared, turn = np.linalg.eigh(np.diag(squared) + beside)
    if bare.damping.ndim == 1:
        ties = Ties(turn[-n:], dampers - viscous_s * springs)
        damping: Real | Lossy = Lossy(viscous_s * squared, ties)
    else:
        lost = viscous_s * beside + np.pad(bare.damping, [(0, n), (0, n)])
        lost[-n:, -n:] += np.diag(dampers)
        damping = np.asarray(turn.T @ lost @ turn)
    return Loaded(
        squared=squared,
        damping=damping,
        moved=moved @ turn,
        pushed=pushed @ turn,
        rest_m=rest_m,
    )


def _nodes(over: PressureDisc | PointForce) -> list[tuple[float, float]]:
    """Return places that stand for an area; for a point as many, all the same."""
    radius_m = 0.0 if isinstance(over, PointForce) else over.radius_m
    nodes, _ = leggauss(_RINGS)
    reach = radius_m * (nodes + 1) / 2
    angle = 2 * math.pi / _ANGLES * (np.arange(_ANGLES) + 0.5)
    x = over.x_m + np.multiply.outer(reach, np.cos(angle))
    y = over.y_m + np.multiply.outer(reach, np.sin(angle))
    return [
        (round(float(a), _DIGITS), round(float(b), _DIGITS))
        for a, b in zip(x.ravel(), y.ravel(), strict=True)
    ]


def _shares(over: PressureDisc | PointForce) -> Real:
    """Return the parts of the mean that the nodes have."""
    nodes, weights = leggauss(_RINGS)
    rings = weights * (nodes + 1) / 2 if isinstance(over, PressureDisc) else weights / 2
    return np.repeat(rings / _ANGLES, _ANGLES)
