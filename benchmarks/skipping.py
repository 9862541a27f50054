"""What a scene saves by leaving out what does not change its result, one thing at a time."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from benchmarks.hard_cases import FORCE, strip_on
from benchmarks.timing import duration, median_s
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    MomentDisc,
    PointForce,
    Scene,
    displacement,
)
from stimuli.field.synthesis import synthesis_work, synthesized

if TYPE_CHECKING:
    from collections.abc import Iterator

    from stimuli import Strip
    from stimuli.field.scene import Work

RTOL: Final = 1e-6
_REPEATS: Final = 9
_W: Final = FORCE.y_m / 0.4
_ROW: Final = tuple((0.001 * n, 0.3 * _W + 0.0001 * n) for n in range(1, 101))
"""A hundred places with nothing in common."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Saving:
    """A scene of which one thing is left out.

    Attributes
    ----------
    what : str
        What it is.
    counted : str
        The count of `Work` that shows it, without its ending.
    scene : Scene
        With skipping on.
    count : int
        How many frequencies are asked, from 200 to 1500 Hz, or 500 Hz.
    """

    what: str
    counted: str
    scene: Scene
    count: int = 1

    def run(self, repeat: int, *, skip: bool) -> object:
        """Return the displacement at frequencies that no other repeat asks."""
        fresh = 1 - 1e-5 * repeat
        asked = np.linspace(200.0, 1500.0, self.count) if self.count > 1 else np.array([500.0])
        return displacement(dataclasses.replace(self.scene, skip=skip), asked * fresh, RTOL)


def _beside(strip: Strip, from_m: float = 0.0, load: PointForce = FORCE) -> Scene:
    places = tuple((x + from_m, y) for x, y in _ROW)
    return Scene(strip=strip, loads=(load,), points_m=places)


def savings() -> Iterator[Saving]:
    """Yield one scene for each thing that is left out."""
    clamped, supported = strip_on(CLAMPED), strip_on(SIMPLY_SUPPORTED)
    at = np.linspace(-0.1, 0.1, 11)
    discs = tuple(MomentDisc(x_m=float(x), y_m=0.4 * _W, radius_m=0.0064) for x in at)
    above = tuple((float(x), 0.6 * _W) for x in at)
    yield Saving(
        what="repeated pairs: 11 discs in a row, a point above each",
        counted="pairs",
        scene=Scene(strip=clamped, loads=discs, points_m=above),
    )
    both = tuple((sign * x, y) for x, y in _ROW for sign in (-1, 1))
    yield Saving(
        what="mirrored pairs: 200 points about a force",
        counted="pairs",
        scene=Scene(strip=clamped, loads=(FORCE,), points_m=both),
    )
    yield Saving(
        what="antisymmetric waves: force on the centre line",
        counted="symmetries",
        scene=_beside(clamped, load=PointForce(x_m=0.0, y_m=_W / 2)),
    )
    yield Saving(
        what="wall correction: force, simple supports",
        counted="wall_correction",
        scene=_beside(supported),
    )
    yield Saving(
        what="integrals: 100 points over 60 mm away",
        counted="integrals",
        scene=_beside(clamped, from_m=0.06),
    )
    yield Saving(
        what="frequencies: 500 below the cut-off",
        counted="frequencies",
        scene=Scene(strip=clamped, loads=(FORCE,), points_m=_ROW[:2]),
        count=500,
    )
    yield Saving(
        what="loads never driven: 10 of 11 discs",
        counted="pairs",
        scene=Scene(
            strip=clamped,
            loads=tuple(
                dataclasses.replace(d, y_m=0.4 * _W + 1e-4 * i) for i, d in enumerate(discs)
            ),
            points_m=above,
            driven=(True, *[False] * 10),
        ),
    )
    yield Saving(
        what="far ends: strip of 1 m",
        counted="reflections",
        scene=_beside(dataclasses.replace(clamped, length_m=1.0)),
    )


def _counts(work: Work, counted: str) -> str:
    if counted == "wall_correction":
        return f"{counted.replace('_', ' ')}: {'yes' if work.wall_correction else 'no'}"
    asked, solved = getattr(work, f"{counted}_asked"), getattr(work, f"{counted}_solved")
    return f"{solved} of {asked} {counted}"


def row(saving: Saving) -> str:
    """Return one measured line of the table."""
    return measured(saving)[0]


def measured(saving: Saving) -> tuple[str, float]:
    """Return the line of a saving, and the largest difference between the two results."""
    asked = np.linspace(200.0, 1500.0, saving.count) if saving.count > 1 else [500.0]
    work = saving.scene.work(asked, RTOL)
    whole, less = (np.asarray(saving.run(0, skip=skip)) for skip in (False, True))
    largest = np.max(np.abs(whole), axis=(1, 2), keepdims=True)
    apart = np.max(np.abs(less - whole) / np.maximum(np.abs(whole), 1e-3 * largest))
    times = [
        # mypy cannot infer a lambda with a default
        median_s(lambda n, skip=skip: saving.run(n, skip=skip), _REPEATS)  # type: ignore[misc]
        for skip in (False, True)
    ]
    cells = (
        f"{saving.what} | {_counts(work, saving.counted)} | {duration(times[0])} | "
        f"{duration(times[1])}"
    )
    return f"| {cells} |", float(apart)


def measured_bins() -> tuple[str, float]:
    """Return the same of the bins of a transient: those without energy, those that follow."""
    strip = dataclasses.replace(
        strip_on(SIMPLY_SUPPORTED),
        material=dataclasses.replace(ALUMINIUM, viscous_time_s=8e-7),
    )
    burst, times_s = Burst(frequency_hz=500.0, cycles=2, window="hann"), np.linspace(0, 0.005, 50)
    scene = Scene(strip=strip, loads=(FORCE,), points_m=((0.0, 0.3 * _W), (0.02, 0.5 * _W)))
    whole_scene = dataclasses.replace(scene, skip=False)
    work = synthesis_work(scene, burst, times_s, 1e-3)
    less, whole = (synthesized(one, burst, times_s, 1e-3) for one in (scene, whole_scene))
    apart = np.max(np.abs(less - whole) / np.max(np.abs(whole), axis=0))
    times = [
        # mypy cannot infer a lambda with a default
        median_s(lambda _, one=one: synthesized(one, burst, times_s, 1e-3), 3)  # type: ignore[misc]
        for one in (whole_scene, scene)
    ]
    counts = f"{work.frequencies_solved} of {work.bins_asked} bins"
    cells = (
        f"bins: `transient` at rtol 1e-3, two cycles of 500 Hz | {counts} | {duration(times[0])} "
        f"| {duration(times[1])}"
    )
    return f"| {cells} |", float(apart)


def section() -> str:
    """Measure and return the section of docs/benchmarks.md."""
    rows, apart = zip(*map(measured, savings()), strict=True)
    of_bins, bins_apart = measured_bins()
    return "\n".join(
        [
            "## Skipping",
            "",
            (
                f"Time of `displacement` at rtol {RTOL:g} with `Scene(skip=False)` and with "
                "skipping, where only one thing can be left out. As rtol counts it, the "
                f"results differ by {max(apart):.0e} at most, those of bins by {bins_apart:.0e}."
            ),
            "",
            "| left out | counts of `scene.work` | everything | skipping |",
            "|---|---|---|---|",
            *rows,
            of_bins,
            "",
        ]
    )
