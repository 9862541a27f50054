"""Where a field is hard to compute: the sweeps of the stability benchmark."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    MomentDisc,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
    Strip,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from stimuli import IdealEdge, Load

_W: Final = 0.025
_PLATE: Final = Strip(width_m=_W, thickness_m=0.0005, material=ALUMINIUM, edge=SIMPLY_SUPPORTED)
_K2900: Final = ElasticEdge(stiffness_n=141.72083994908)
_EDGES: Final = ((SIMPLY_SUPPORTED, "supported"), (_K2900, "spring"), (CLAMPED, "clamped"))
FORCE: Final = PointForce(x_m=0.0, y_m=0.4 * _W)
_BEAM: Final = MomentRectangle(x_m=0.0, y_m=_W / 2, length_x_m=0.006, length_y_m=0.018)
PLACE: Final = (0.01, 0.6 * _W)
_DETUNINGS: Final = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One field value of a sweep."""

    curve: str
    label: str
    abscissa: float
    strip: Strip
    load: Load
    place_m: tuple[float, float]
    frequency_hz: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Cases along one axis."""

    name: str
    axis: str
    cases: tuple[Case, ...]


def strip_on(edge: IdealEdge | ElasticEdge, **material: float) -> Strip:
    """Return the paper's plate on other edges, with loss or without."""
    return dataclasses.replace(
        _PLATE, edge=edge, material=dataclasses.replace(ALUMINIUM, **material)
    )


def _frequencies() -> Iterator[Case]:
    for edge, name in _EDGES:
        for f in (0.0, 1e-6, 1.0, 57.0, 59.0, 1000.0, 2600.0, 15_000.0, 100_000.0):
            yield Case(
                curve=name,
                label=f"{f:g} Hz",
                abscissa=f,
                strip=strip_on(edge),
                load=FORCE,
                place_m=PLACE,
                frequency_hz=f,
            )


def _detuned(centre_hz: Callable[[Strip], float], edges: Iterable[Any]) -> Iterator[Case]:
    for edge, name in edges:
        strip = strip_on(edge)
        for side in (-1, 1):
            for detuning in _DETUNINGS:
                yield Case(
                    curve=f"{name}, {'above' if side > 0 else 'below'}",
                    label=f"{side * detuning:+.0e}",
                    abscissa=detuning,
                    strip=strip,
                    load=FORCE,
                    place_m=PLACE,
                    frequency_hz=centre_hz(strip) * (1 + side * detuning),
                )


def _losses() -> Iterator[Case]:
    at_cutoff = strip_on(CLAMPED).cutoff_hz()
    for f, name in ((500.0, "500 Hz"), (at_cutoff, "at the cut-off")):
        for loss in (1e-12, 1e-6, 1e-3, 1e-2, 0.1, 0.5):
            viscous = {"viscous_time_s": loss / (2 * np.pi * f)}
            for kind, material in (("constant", {"loss_factor": loss}), ("viscous", viscous)):
                yield Case(
                    curve=f"{kind}, {name}",
                    label=f"{loss:g}",
                    abscissa=loss,
                    strip=strip_on(CLAMPED, **material),
                    load=FORCE,
                    place_m=PLACE,
                    frequency_hz=f,
                )


def _distances() -> Iterator[Case]:
    for edge, name, f in (
        (SIMPLY_SUPPORTED, "supported, 3 kHz", 3000.0),
        (CLAMPED, "clamped, 500 Hz", 500.0),
        (CLAMPED, "clamped, 5 kHz", 5000.0),
    ):
        for x in (0.0, 1e-12, 1e-6, 1e-3, 0.0375, 0.1, 1.0, 10.0):
            yield Case(
                curve=name,
                label=f"{x:g} m",
                abscissa=x,
                strip=strip_on(edge),
                load=FORCE,
                place_m=(x, PLACE[1]),
                frequency_hz=f,
            )


def _springs() -> Iterator[Case]:
    for f in (500.0, 6000.0):
        for stiffness in (1e-4, 1e-2, 1.0, 30.0, 1e3, 1e5, 1e8):
            yield Case(
                curve=f"{f:g} Hz",
                label=f"{stiffness:g} N",
                abscissa=stiffness,
                strip=strip_on(ElasticEdge(stiffness_n=stiffness)),
                load=FORCE,
                place_m=PLACE,
                frequency_hz=f,
            )


def _patches() -> Iterator[Case]:
    tiny = 1e-6 * _W
    loads: tuple[tuple[str, Load, tuple[float, float]], ...] = (
        (
            "rectangle touching an edge, at its middle",
            MomentRectangle(x_m=0.0, y_m=0.003, length_x_m=0.006, length_y_m=0.006),
            (0.0, 0.003),
        ),
        (
            "rectangle touching an edge, at its corner",
            PressureRectangle(x_m=0.0, y_m=0.003, length_x_m=0.006, length_y_m=0.006),
            (0.003, 0.006),
        ),
        (
            "disc touching an edge, at its centre",
            MomentDisc(x_m=0.0, y_m=0.0064, radius_m=0.0064),
            (0.0, 0.0064),
        ),
        (
            "disc touching an edge, at its rim",
            PressureDisc(x_m=0.0, y_m=0.0064, radius_m=0.0064),
            (0.0, 0.0128),
        ),
        (
            "rectangle of 1e-6 W, at its middle",
            MomentRectangle(x_m=0.0, y_m=0.01, length_x_m=tiny, length_y_m=tiny),
            (0.0, 0.01),
        ),
        (
            "motor on 1e-6 W, beside it",
            ForceRectangle(x_m=0.0, y_m=0.01, length_x_m=tiny, length_y_m=tiny),
            (0.005, 0.01),
        ),
        (
            "disc of 1e-6 W, at its centre",
            PressureDisc(x_m=0.0, y_m=0.01, radius_m=tiny),
            (0.0, 0.01),
        ),
        (
            "disc of 1e-6 W, beside it",
            MomentDisc(x_m=0.0, y_m=0.01, radius_m=tiny),
            (0.0, 0.01 + 2 * tiny),
        ),
        (
            "rectangle as wide as the strip",
            MomentRectangle(x_m=0.0, y_m=_W / 2, length_x_m=0.006, length_y_m=_W),
            (0.0, 0.01),
        ),
        (
            "disc as wide as the strip",
            MomentDisc(x_m=0.0, y_m=_W / 2, radius_m=_W / 2),
            (0.002, 0.02),
        ),
    )
    for edge, name in (_EDGES[0], _EDGES[2]):
        for number, (label, load, place) in enumerate(loads):
            yield Case(
                curve=name,
                label=label,
                abscissa=float(number + 1),
                strip=strip_on(edge),
                load=load,
                place_m=place,
                frequency_hz=700.0,
            )


def _lengths() -> Iterator[Case]:
    """Yield finite strips: those between simple supports have an exact solution."""
    for f in (500.0, 2600.0):
        for length in (0.01, 0.02, 0.05, 0.2, 1.0, 10.0):
            yield Case(
                curve=f"{f:g} Hz",
                label=f"{length:g} m",
                abscissa=length,
                strip=dataclasses.replace(
                    strip_on(SIMPLY_SUPPORTED, loss_factor=0.01), length_m=length
                ),
                load=dataclasses.replace(_BEAM, x_m=1e-4),
                place_m=(0.004, PLACE[1]),
                frequency_hz=f,
            )


def sweeps() -> tuple[Sweep, ...]:
    """Return everything that is measured."""
    return (
        Sweep(name="Frequency", axis="frequency (Hz)", cases=tuple(_frequencies())),
        Sweep(
            name="Cut-off",
            axis="relative detuning",
            cases=tuple(_detuned(Strip.cutoff_hz, (_EDGES[0], _EDGES[2]))),
        ),
        Sweep(
            name="Exceptional point",
            axis="relative detuning",
            cases=tuple(_detuned(Strip.exceptional_point_hz, _EDGES[1:])),
        ),
        Sweep(name="Loss", axis="loss factor", cases=tuple(_losses())),
        Sweep(name="Distance", axis="|x| (m)", cases=tuple(_distances())),
        Sweep(name="Spring", axis="K (N)", cases=tuple(_springs())),
        Sweep(name="Patch", axis="number in the table", cases=tuple(_patches())),
        Sweep(name="Length", axis="length of the strip (m)", cases=tuple(_lengths())),
    )
