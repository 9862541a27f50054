"""The paper's plate with other edges, lengths and losses, and what moves it: for many tests."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    Estimate,
    Fingertip,
    IdealEdge,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    Scene,
    Strip,
    response,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from stimuli.arrays import Complex

Edge: TypeAlias = IdealEdge | ElasticEdge
Points: TypeAlias = tuple[tuple[float, float], ...]

W = 0.025
SOFT, FIRM = ElasticEdge(stiffness_n=63.9264884979218), ElasticEdge(stiffness_n=141.72083994908)
"""Of the first cut-offs that the paper measured: 2500 and 2900 Hz."""
PLATE = Strip(width_m=W, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
SUPPORTED = dataclasses.replace(PLATE, edge=SIMPLY_SUPPORTED)
EDGES: list[Edge] = [SIMPLY_SUPPORTED, FIRM, CLAMPED]
EVERY_EDGE: list[Edge] = [*EDGES, SOFT]
NAMES = ["supported", "firm", "clamped", "soft"]

each_edge = pytest.mark.parametrize("edge", EDGES, ids=NAMES[:3])
every_edge = pytest.mark.parametrize("edge", EVERY_EDGE, ids=NAMES)


def on(
    edge: Edge,
    length_m: float | None = None,
    *,
    loss: float = 0.0,
    viscous_s: float = 0.0,
    nu: float = ALUMINIUM.poisson_ratio,
) -> Strip:
    """The plate with this edge."""
    material = dataclasses.replace(
        ALUMINIUM, loss_factor=loss, viscous_time_s=viscous_s, poisson_ratio=nu
    )
    return dataclasses.replace(PLATE, edge=edge, length_m=length_m, material=material)


def force(x_m: float = 0.0, y_m: float = W / 2) -> PointForce:
    return PointForce(x_m=x_m, y_m=y_m)


def disc(
    radius_m: float = 0.0064, *, x_m: float = 0.0, y_m: float = W / 2, kind: Any = MomentDisc
) -> Any:
    """A disc, the paper's unless told otherwise."""
    return kind(x_m=x_m, y_m=y_m, radius_m=radius_m)


def patch(
    along_m: float = 0.006,
    across_m: float = 0.018,
    *,
    x_m: float = 0.0,
    y_m: float = W / 2,
    kind: Any = MomentRectangle,
) -> Any:
    """A rectangle, the paper's unless told otherwise."""
    return kind(x_m=x_m, y_m=y_m, length_x_m=along_m, length_y_m=across_m)


DISCS = disc(x_m=-0.035), disc(x_m=0.035)
TIPS = Fingertip(x_m=-0.035, y_m=W / 2), Fingertip(x_m=0.035, y_m=W / 2)
CYCLE = Burst(frequency_hz=500.0, cycles=1, window="none")
HANN = Burst(frequency_hz=500.0, cycles=2, window="hann")


def scene_of(strip: Strip, loads: Load | tuple[Load, ...], *points_m: Any, **more: Any) -> Scene:
    """A scene of one load or several."""
    loads = loads if isinstance(loads, tuple) else (loads,)
    return Scene(strip=strip, loads=loads, points_m=points_m, **more)


def at(
    strip: Strip,
    load: Load,
    points_m: Sequence[tuple[float, float]],
    frequency_hz: float,
    rtol: float | None = None,
) -> Estimate[Complex]:
    """Displacement at some points under one load of one frequency, with its error."""
    answer = response(scene_of(strip, load, *points_m), [frequency_hz], rtol)
    return Estimate(value=answer.value[0, 0], error=answer.error[0, 0], work=answer.work)


def bending_wavenumber_rad_m(strip: Strip, frequency_hz: float) -> complex:
    """Wavenumber of a plane bending wave on an infinite plate, with the material's loss."""
    inertia = strip.material.density_kg_m3 * strip.thickness_m / strip.bending_stiffness_n_m
    square = 2 * math.pi * frequency_hz * math.sqrt(inertia)
    return complex((square**2 / strip.material.stiffness_factor(frequency_hz)) ** 0.25)


def spring(strip: Strip, grip: float) -> ElasticEdge:
    """An edge whose stiffness is so many times the strip's bending stiffness over its width."""
    return ElasticEdge(stiffness_n=grip * strip.bending_stiffness_n_m / strip.width_m)
