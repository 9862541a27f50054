"""Fingers on a plate by the field solver: their pressures as loads, their areas as receivers."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np

from stimuli import Load, PointForce, PressureDisc, Scene, displacement

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli import Fingertip
    from stimuli.arrays import Complex, Real


def area_of(tip: Fingertip) -> PressureDisc | PointForce:
    """Return the contact area as a load."""
    if not tip.radius_m:
        return PointForce(x_m=tip.x_m, y_m=tip.y_m)
    return PressureDisc(x_m=tip.x_m, y_m=tip.y_m, radius_m=tip.radius_m)


def nodes_of(over: Load, n: int = 8) -> tuple[list[Any], Real]:
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
