"""Frequencies at which waves meet: the hardest places of a field."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import brentq

from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    Load,
    PressureDisc,
    PressureRectangle,
    Scene,
    Strip,
    response,
)
from tests.reference.exact import exact
from tests.test_stimuli.plates import disc, drawn_strip, force, patch, scene_of, spring

if TYPE_CHECKING:
    from stimuli import Response

FREE, HELD = SIMPLY_SUPPORTED, CLAMPED

PLACES = ((0.0, 0.41), (0.05, 0.3), (0.0, 0.5), (0.3, 0.9), (0.95, 0.22), (2.5, 0.4))
"""Inside the patches, at an edge of some, beside them and far from them, in widths."""
DETUNINGS = (0.0, 1e-15, -1e-15, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6)


def loads_on(width_m: float, y: float = 0.41) -> tuple[Load, ...]:
    """One load of each kind, at a place across the strip in widths."""
    place: dict[str, Any] = {"y_m": y * width_m}
    size = 0.2 * width_m, 0.4 * width_m
    return (
        force(0.0, y * width_m),
        disc(size[0], **place),
        disc(0.3 * width_m, kind=PressureDisc, **place),
        patch(*size, **place),
        patch(*size, kind=PressureRectangle, **place),
        patch(*size, kind=ForceRectangle, **place),
    )


def points_on(width_m: float) -> tuple[tuple[float, float], ...]:
    return tuple((x * width_m, y * width_m) for x, y in PLACES)


def finite_response(scene: Scene, frequency_hz: float, rtol: float = 1e-6) -> Response | None:
    """The response, without a warning, or none where it is refused as infinite."""
    try:
        with np.errstate(divide="raise", invalid="raise"):
            return response(scene, [frequency_hz], rtol)
    except ValueError as error:
        if re.search("cut-off|resonance", str(error)):
            return None
        raise


def meetings(strip: Strip) -> list[float]:
    """Frequencies at which a wave of the strip has a flat branch, p^2 = -k^2."""
    grip = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    hold = strip.bending_stiffness_n_m / (grip * strip.width_m) if grip else 0.0

    def symmetric(t: float) -> float:
        return 2 * t * hold * math.cos(t) + math.sin(t)

    def antisymmetric(t: float) -> float:
        return (2 * t * t * hold + 1) * math.sin(t) - t * math.cos(t)

    places = []
    for relation in (symmetric, antisymmetric):
        t = np.linspace(0.2, 7.0, 300)
        values = [relation(a) for a in t]
        for low, high, before, after in zip(t, t[1:], values, values[1:], strict=False):
            if before * after < 0:
                places.append(float(brentq(relation, low, high, xtol=1e-15)))
    supported_hz = dataclasses.replace(strip, edge=FREE).cutoff_hz()
    return [2 * (t / math.pi) ** 2 * supported_hz for t in places]


def check_estimates_at_meetings(seed: int, strips: int) -> None:
    """Compare with forty digits: endless strips of any edge, and supported ones with ends."""
    rng = np.random.default_rng(seed)
    for _ in range(strips):
        strip = drawn_strip(rng, loss=float(rng.choice([0.0, 0.0, 1e-6, 0.02])))
        f1_hz, width_m = strip.cutoff_hz(), strip.width_m
        kind = rng.integers(5)
        edge = (FREE, FREE, HELD, spring(strip, 10 ** rng.uniform(-9, 2)), HELD)[kind]
        length_m = float(rng.uniform(2.5, 6)) * width_m if kind == 0 else None
        strip = dataclasses.replace(strip, edge=edge, length_m=length_m)
        flat_hz = [] if edge is FREE else meetings(strip)
        f_hz = float(rng.choice(flat_hz or [n * f1_hz for n in (0.5, 2, 4.5, 6, 8)]))
        f_hz *= 1 + float(rng.choice([0, *DETUNINGS, 1e-4]))
        load = loads_on(width_m, float(rng.choice([0.41, 0.5])))[rng.integers(6)]
        x_m, y_m = points_on(width_m)[rng.integers(5)]
        answer = finite_response(
            scene_of(strip, load, (x_m, y_m)), f_hz, float(rng.choice([1e-3, 1e-6]))
        )
        if answer:
            true_m = complex(exact(strip, load, x_m, y_m, f_hz))
            assert abs(answer.displacement_m[0, 0, 0] - true_m) < answer.error_m[0, 0, 0]
