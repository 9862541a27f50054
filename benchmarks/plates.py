"""Finite plates over frequency: processor time of a sweep, and its error."""

from __future__ import annotations

import dataclasses
import time
from typing import TYPE_CHECKING, Final

import numpy as np

from benchmarks.timing import duration
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    Material,
    MomentDisc,
    Scene,
    Strip,
    displacement,
    response,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from stimuli import IdealEdge

    Edge = IdealEdge | ElasticEdge

_RTOL, _EXACT = 1e-6, 1e-10
_SWEEP_HZ: Final = (4.0, 6000.0, 500)
_EVERY: Final = 20
"""Of the frequencies swept, one is solved by itself for the error."""

_DISC_M: Final = 0.0064
_STEEL: Final = Material(youngs_modulus_pa=2.0e11, poisson_ratio=0.29, density_kg_m3=7850.0)
_GLASS: Final = Material(youngs_modulus_pa=7.0e10, poisson_ratio=0.22, density_kg_m3=2500.0)
_MEASURED: Final = ElasticEdge(stiffness_n=141.72)


def _plate(strip: Strip, loss_factor: float, x_m: tuple[float, float] = (-0.035, 0.035)) -> Scene:
    material = dataclasses.replace(strip.material, loss_factor=loss_factor)
    middle_m = strip.width_m / 2
    return Scene(
        strip=dataclasses.replace(strip, material=material),
        loads=tuple(MomentDisc(x_m=x, y_m=middle_m, radius_m=_DISC_M) for x in x_m),
        points_m=tuple((x, middle_m) for x in x_m),
    )


def plates() -> Iterator[tuple[str, Scene]]:
    """Yield what is measured: the usual plate on three edges, and two that are not usual."""
    usual = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED, length_m=0.2)
    edges: dict[str, Edge] = {
        "supported": SIMPLY_SUPPORTED,
        "2900 Hz edge": _MEASURED,
        "clamped": CLAMPED,
    }
    for name, edge in edges.items():
        strip = dataclasses.replace(usual, edge=edge)
        yield f"aluminium, 200 mm, {name}, loss 0.01", _plate(strip, 0.01)
    steel = Strip(width_m=0.02, thickness_m=0.0003, material=_STEEL, edge=_MEASURED, length_m=0.16)
    yield (
        "steel, 160 x 20 x 0.3 mm, springs, discs off the middle, loss 0.005",
        _plate(steel, 0.005, (-0.045, 0.02)),
    )
    glass = Strip(width_m=0.03, thickness_m=0.001, material=_GLASS, edge=CLAMPED, length_m=0.12)
    yield "glass, 120 x 30 x 1 mm, clamped, loss 0.005", _plate(glass, 0.005)


def best_s(run: Callable[[int], object], repeats: int) -> float:
    """Return the least processor time of `run(number of the repeat)`, the first left out."""
    times = []
    for number in range(repeats + 1):
        start = time.process_time()
        run(number)
        times.append(time.process_time() - start)
    return min(times[1:])


def row(name: str, scene: Scene) -> tuple[str, float, float]:
    """Return a plate's line of the table, its largest error, and the largest it tells."""
    low_hz, high_hz, count = _SWEEP_HZ
    sweep_s = best_s(
        lambda n: displacement(scene, np.linspace(low_hz, high_hz - n, count), _RTOL), 4
    )
    asked_hz = np.linspace(low_hz, high_hz, count)
    swept = response(scene, asked_hz, _RTOL)
    size = np.abs(swept.displacement_m)
    size = np.maximum(size, 1e-3 * np.max(size, axis=(1, 2), keepdims=True))
    told = float(np.max(swept.error_m / size))
    true_m = displacement(dataclasses.replace(scene, skip=False), asked_hz[::_EVERY], _EXACT)
    error = float(np.max(np.abs(swept.displacement_m[::_EVERY] - true_m) / size[::_EVERY]))
    return f"| {name} | {duration(sweep_s)} | {swept.work.frequencies_solved} |", error, told


def table() -> list[str]:
    """Return the lines of docs/benchmarks.md about finite plates over frequency."""
    low_hz, high_hz, count = _SWEEP_HZ
    rows, errors, told = zip(*(row(name, scene) for name, scene in plates()), strict=True)
    return [
        (
            "**Two discs on a finite plate**: 12.8 mm, at x = -35 and 35 mm unless told, receivers "
            f"at their centres, rtol {_RTOL:g}, {count} frequencies from {low_hz:g} to "
            f"{high_hz:g} Hz, least processor time (0.15 s was wanted). Errors of every "
            f"{_EVERY}th against the same solved by itself at {_EXACT:g}, relative to each value "
            f"or to 1e-3 of the largest at the frequency, are {min(errors):.1e} to "
            f"{max(errors):.1e}, and told as {min(told):.1e} to {max(told):.1e}."
        ),
        "",
        "| plate | time | solved |",
        "|---|---|---|",
        *rows,
        "",
    ]
