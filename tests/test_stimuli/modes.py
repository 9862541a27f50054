"""A plate by its modes, and fingers on it by the field solver too: for laws over time."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from stimuli import Burst, PointForce, PressureDisc, Scene, displacement
from stimuli.fingers.fingertip import asked, pressed_of
from stimuli.fingers.pressed import pressed_motion
from stimuli.fingers.work import felt_known
from stimuli.motion.modes import plate_modes
from stimuli.motion.motion import motion_of, reference_of
from stimuli.motion.patches.patched import patched_modes
from stimuli.motion.peaks import peaks_of, wait_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli import Drive, Fingertip, Load, Strip
    from stimuli.arrays import Complex, Real
    from stimuli.motion.motion import Motion
    from stimuli.motion.peaks import Peaks

TONE = Burst(frequency_hz=1.0)
"""A drive that every fingertip's impedance holds for."""


def natural_frequencies_hz(
    strip: Strip, count: int, highest_hz: float, within_hz: float | None = None
) -> Real:
    """Return the lowest resonances of a plate with ends, with its patches if it has any."""
    if strip.patches:
        patched = patched_modes(strip, highest_hz, centred=False, within_hz=within_hz)
        squared = np.concatenate([group.squared for group in patched])
    else:
        bare = plate_modes(strip, highest_hz, centred=False)
        squared = np.concatenate([group.squared for group in bare])
    return np.asarray(np.sqrt(np.sort(squared)[:count]) / (2 * math.pi))


def oscillators_of(scene: Scene, multiple: float, fingertips: Sequence[Fingertip] = ()) -> Motion:
    """Return a scene as oscillators up to a multiple of the cut-off, with what presses on it."""
    reference_hz = scene.strip.cutoff_hz()
    pressed = pressed_of(scene.strip, fingertips, TONE)
    if pressed:
        return pressed_motion(scene, reference_hz, multiple, pressed)
    return motion_of(scene, reference_hz, multiple)


def steady_motion(
    scene: Scene, frequency_hz: float, fingertips: Sequence[Fingertip] = (), multiple: float = 8.0
) -> Complex:
    """Return the displacement under a tone, (n_loads, n_points), as `displacement` does."""
    motion = oscillators_of(scene, multiple, fingertips)
    found, s = motion.oscillators, -2j * math.pi * frequency_hz
    weights = np.stack([found.weights(load) for load in range(len(scene.loads))])
    both = weights / (s - found.poles) + weights.conj() / (s - found.poles.conj())
    return np.asarray(both.sum(axis=-1) / 2 + found.rest_m / (1 + s * motion.viscous_s))


def peaks_with_error(
    strip: Strip, loads: Sequence[Load], fingertips: Sequence[Fingertip], drive: Drive
) -> tuple[Real, Real]:
    """Return the peaks on a plate with patches, and how well they are known."""
    known = felt_known(strip, loads, fingertips, drive)
    assert known.error_m is not None
    return known.peak_m, known.error_m


def peaks_up_to(
    multiple: float,
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
) -> Peaks:
    """Return the peaks by all modes up to a multiple of the reference frequency, and no others."""
    scene, places, far_m = asked(strip, loads, fingertips, drive)
    pressed, reference_hz = pressed_of(scene.strip, fingertips, drive), reference_of(scene, drive)
    motion = (
        pressed_motion(scene, reference_hz, multiple, pressed)
        if pressed
        else motion_of(scene, reference_hz, multiple)
    )
    return peaks_of(motion, places, drive, wait_s=wait_of(strip, far_m))


def area_of(tip: Fingertip) -> PressureDisc | PointForce:
    """Return the contact area as a load."""
    if not tip.radius_m:
        return PointForce(x_m=tip.x_m, y_m=tip.y_m)
    return PressureDisc(x_m=tip.x_m, y_m=tip.y_m, radius_m=tip.radius_m)


def nodes_of(over: PressureDisc | PointForce, n: int = 8) -> tuple[list[Any], Real]:
    """Places and weights of the mean over a contact area, by Gauss and by equal angles."""
    if isinstance(over, PointForce):
        return [(over.x_m, over.y_m)], np.ones(1)
    gauss, weights = np.polynomial.legendre.leggauss(n)
    reach, angle = over.radius_m * (gauss + 1) / 2, math.pi / n * np.arange(2 * n)
    x = over.x_m + np.outer(reach, np.cos(angle))
    y = over.y_m + np.outer(reach, np.sin(angle))
    share = np.repeat(weights * (gauss + 1) / 2 / (2 * n), 2 * n)
    return list(zip(x.ravel().tolist(), y.ravel().tolist(), strict=True)), share


def steady_by_receptances(scene: Scene, tips: Sequence[Fingertip], frequency_hz: float) -> Complex:
    """Return the displacement under a tone, (n_loads, n_points), with fingers on the plate."""
    if not tips:
        return np.asarray(displacement(scene, [frequency_hz], 1e-8)[0])
    areas = [area_of(tip) for tip in tips]
    found = [nodes_of(area) for area in areas]
    n_loads, n_points = len(scene.loads), len(scene.points_m)
    whole = dataclasses.replace(
        scene,
        loads=scene.loads + tuple(areas),
        points_m=scene.points_m + tuple(node for nodes, _ in found for node in nodes),
    )
    moved_m = displacement(whole, [frequency_hz], 1e-8)[0]
    moved_m[n_loads:] /= np.array([[math.pi * tip.radius_m**2 or 1.0] for tip in tips])
    starts = n_points + np.cumsum([0] + [len(nodes) for nodes, _ in found[:-1]])
    means = np.stack(
        [
            moved_m[:, start : start + share.size] @ share
            for start, (_, share) in zip(starts, found, strict=True)
        ],
        axis=1,
    )
    omega, z = 2 * math.pi * frequency_hz, [tip.impedance for tip in tips if tip.impedance]
    back = np.diag(
        [f.stiffness_n_m - 1j * omega * f.damping_n_s_m - omega**2 * f.mass_kg for f in z]
    )
    # means = bare means - receptance (force of the fingers), force = back means
    force = back @ np.linalg.solve(np.eye(len(z)) + means[n_loads:].T @ back, means[:n_loads].T)
    return np.asarray(moved_m[:n_loads, :n_points] - force.T @ moved_m[n_loads:, :n_points])
