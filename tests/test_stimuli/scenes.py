"""Scenes of the reference values, and drawn ones."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import stimuli
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    ElasticEdge,
    Fingertip,
    ForceRectangle,
    Impedance,
    Layer,
    Load,
    Material,
    MomentDisc,
    MomentRectangle,
    PressureDisc,
    PressureRectangle,
    Scene,
    Strip,
    response,
)
from stimuli.errors import PlateError, Rule
from tests.test_stimuli.plates import force, scene_of, spring

if TYPE_CHECKING:
    from stimuli import Estimate
    from stimuli.arrays import Complex

REFERENCE = Path(__file__).with_name("reference")
_EDGES = {"simply supported": SIMPLY_SUPPORTED, "clamped": CLAMPED}


def reference_rows(name: str) -> list[dict[str, Any]]:
    """Return the scenes of a file with their answers."""
    rows: list[dict[str, Any]] = json.loads((REFERENCE / name).read_text("utf-8"))
    return rows


def strip_of(row: dict[str, Any]) -> Strip:
    """Return the strip of a scene."""
    data = {**row["strip"]}
    edge = {**data.pop("edge")}
    kind = edge.pop("kind")
    patches = [
        BondedPatch(**{**patch, "layers": tuple(Layer(**layer) for layer in patch["layers"])})
        for patch in data.pop("patches", ())
    ]
    return Strip(
        **{**data, "material": Material(**data["material"])},
        edge=_EDGES.get(kind) or ElasticEdge(**edge),
        patches=tuple(patches),
    )


def load_of(data: dict[str, Any]) -> Load:
    """Return a load of a scene."""
    values = {**data}
    load: Load = getattr(stimuli, values.pop("kind"))(**values)
    return load


def fingertip_of(data: dict[str, Any]) -> Fingertip:
    """Return a fingertip of a scene."""
    impedance = data["impedance"] and Impedance(**data["impedance"])
    return Fingertip(**{**data, "impedance": impedance})


DETUNINGS = (0.0, 1e-15, -1e-15, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6, 1e-3)
MEETINGS = (0.5, 1.0, 2.0, 2.5, 3.0, 4.0, 4.091446734, 4.5, 6.0, 8.0, 12.0)
"""First cut-offs of the supported strip at which a branch of its waves is flat, n^2 / 2 and 2 n^2,
two orders meet, (n^2 - m^2) / 2, or a wave is at rest, n^2: where waves are hardest to tell apart.
"""


def drawn_strip(rng: np.random.Generator) -> Strip:
    """Draw a strip of any material, size, edge and loss, endless in two of three cases."""
    material = Material(
        youngs_modulus_pa=10 ** rng.uniform(9.3, 11.6),
        poisson_ratio=float(rng.choice([0.0, rng.uniform(0, 0.45), 0.499])),
        density_kg_m3=rng.uniform(900, 9000),
        loss_factor=float(rng.choice([0.0, 1e-6, 10 ** rng.uniform(-3, -0.7)])),
    )
    width_m = 10 ** rng.uniform(-2.7, -1)
    strip = Strip(
        width_m=width_m,
        thickness_m=width_m * rng.uniform(0.005, 0.05),
        material=material,
        edge=(SIMPLY_SUPPORTED, CLAMPED)[rng.integers(2)],
        length_m=width_m * 10 ** rng.uniform(-0.3, 1) if rng.random() < 1 / 3 else None,
    )
    if rng.random() < 0.5:
        grip = spring(strip, 10 ** rng.uniform(-9, 5))
        edge = dataclasses.replace(grip, lossless=bool(rng.random() < 0.5))
        strip = dataclasses.replace(strip, edge=edge)
    return strip


def drawn_frequency_hz(rng: np.random.Generator, strip: Strip) -> float:
    """Draw a frequency: at rest, anywhere, or at and beside those where waves meet."""
    first_hz = dataclasses.replace(strip, edge=SIMPLY_SUPPORTED).cutoff_hz()
    special_hz = [
        strip.cutoff_hz(int(rng.integers(1, 5))),
        strip.exceptional_point_hz(),
        first_hz * rng.choice(MEETINGS),
    ]
    if rng.random() < 0.5:
        return float(special_hz[rng.integers(3)] * (1 + rng.choice(DETUNINGS)))
    top = 6 if strip.length_m else 40
    return float(rng.choice([0.0, 1e-6, rng.uniform(0, 1), rng.uniform(0, top)]) * first_hz)


def drawn_load(rng: np.random.Generator, strip: Strip) -> Load:
    """Draw a load of any kind, on or off the centre line, which may touch the edges and ends."""
    width_m = strip.width_m
    y_m = width_m * float(rng.choice([0.5, rng.uniform(0.03, 0.97)]))
    end_m = strip.length_m / 2 if strip.length_m else 3 * width_m
    x_m = end_m * float(rng.choice([0.0, rng.uniform(-1, 1)]))
    across_m = 2 * min(y_m, width_m - y_m) * float(rng.choice([1.0, rng.uniform(0.05, 0.9)]))
    along_m = min(2 * (end_m - abs(x_m)), width_m * 10 ** rng.uniform(-1.5, 0.3))
    kind = rng.integers(6)
    if kind == 0 or along_m < 0.03 * width_m:
        return force(x_m, y_m)
    if kind < 3:
        round_kind = (PressureDisc, MomentDisc)[kind - 1]
        return round_kind(x_m=x_m, y_m=y_m, radius_m=min(along_m, across_m) / 2)
    rectangle = (PressureRectangle, MomentRectangle, ForceRectangle)[kind - 3]
    return rectangle(x_m=x_m, y_m=y_m, length_x_m=along_m, length_y_m=across_m)


def drawn_scene(rng: np.random.Generator) -> tuple[Scene, float]:
    """Draw a scene of one or two loads, seen at, beside and far from them, and a frequency."""
    strip = drawn_strip(rng)
    loads = tuple(drawn_load(rng, strip) for _ in range(rng.integers(1, 3)))
    width_m, first = strip.width_m, loads[0]
    end_m = strip.length_m / 2 if strip.length_m else 10 * width_m
    points_m = [
        (first.x_m, first.y_m),
        (float(np.clip(first.x_m + first.half_size_m[0], -end_m, end_m)), first.y_m),
        (end_m * rng.uniform(-1, 1), width_m * rng.uniform()),
        (end_m, width_m / 2),
        (0.0, width_m),
    ]
    return scene_of(strip, loads, *points_m), drawn_frequency_hz(rng, strip)


def finite_response(scene: Scene, frequency_hz: float) -> Estimate[Complex] | None:
    """Return the response without a warning or NaN, or None where it is refused as infinite."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            answer = response(scene, [frequency_hz])
        except PlateError as error:
            if error.rule is Rule.INFINITE:
                return None
            raise
    assert np.all(np.isfinite(answer.value)), (scene, frequency_hz)
    assert np.all(np.isfinite(answer.error)), (scene, frequency_hz)
    assert np.all(answer.error > 0), (scene, frequency_hz)
    return answer


def mirrored(scene: Scene) -> Scene:
    """Return the mirror image of a scene about its centre line and its middle."""
    width_m = scene.strip.width_m
    loads = tuple(
        dataclasses.replace(load, x_m=-load.x_m, y_m=width_m - load.y_m) for load in scene.loads
    )
    return scene_of(scene.strip, loads, *((-x_m, width_m - y_m) for x_m, y_m in scene.points_m))


def check_drawn_scene(seed: int) -> bool:
    """Check a drawn scene: finite or refused, and as its image; returns whether it is finite."""
    scene, frequency_hz = drawn_scene(np.random.default_rng(seed))
    answer = finite_response(scene, frequency_hz)
    image = finite_response(mirrored(scene), frequency_hz)
    assert (answer is None) == (image is None), (seed, scene, frequency_hz)
    if answer is None or image is None:
        return False
    apart_m = np.abs(answer.value - image.value)
    assert np.all(apart_m <= answer.error + image.error), (seed, scene, frequency_hz)
    return True
