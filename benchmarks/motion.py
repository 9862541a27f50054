"""Plates over time by their modes: beside the spectra on random plates, and error against time."""

from __future__ import annotations

import dataclasses
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from unittest.mock import patch

import numpy as np

from benchmarks.timing import duration
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    Burst,
    ElasticEdge,
    Fingertip,
    Load,
    Material,
    MomentDisc,
    MomentRectangle,
    Strip,
    felt,
    level_db,
)
from stimuli.fingers import fingertip
from stimuli.fingers.fingertip import causal
from stimuli.motion.motion import motion_of
from tests.reference.plate_fem import in_modes, model, newmark

if TYPE_CHECKING:
    from stimuli.arrays import Real

PLATES: Final = 200
FIGURE: Final = Path(__file__).parent.parent / "docs" / "motion.png"
GRIDS_MM: Final = (6.0, 4.0, 3.0, 2.0)
MULTIPLES: Final = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0)
TOLD: Final = (2.0, 4.0, 24.0)
GRIDS_TOLD_MM: Final = (6.0, 4.0, 2.0)
"""Of these, those in the table; the figure has all."""

MATERIALS: Final = tuple(
    Material(youngs_modulus_pa=1e9 * modulus, poisson_ratio=ratio, density_kg_m3=density)
    for modulus, ratio, density in (
        (67, 0.346, 2700),
        (200, 0.29, 7850),
        (70, 0.22, 2500),
        (105, 0.35, 8500),
        (3.2, 0.37, 1180),
    )
)

Scene = tuple[Strip, list[Load], list[Fingertip], Burst]


def drawn(rng: np.random.Generator) -> Scene:
    """Draw a plate with two patches, a finger on each, and a burst below its cut-off."""
    width_m, thickness_m = rng.uniform(0.015, 0.03), rng.uniform(0.0003, 0.0008)
    material = MATERIALS[rng.integers(len(MATERIALS))]
    lossy = dataclasses.replace(material, loss_factor=float(rng.choice([0.005, 0.01, 0.02, 0.05])))
    strip = Strip(
        width_m=width_m,
        thickness_m=thickness_m,
        material=lossy,
        edge=SIMPLY_SUPPORTED,
        length_m=rng.uniform(0.12, 0.2),
    )
    firm = ElasticEdge(
        stiffness_n=strip.bending_stiffness_n_m / width_m * 10 ** rng.uniform(0, 2),
        lossless=bool(rng.integers(2)),
    )
    # held edges keep the spectra busy for minutes: one plate in eight has them
    edge: list[Any] = [SIMPLY_SUPPORTED] * 14 + [CLAMPED, firm]
    strip = dataclasses.replace(strip, edge=edge[rng.integers(16)])
    radius_m = rng.uniform(0.15, 0.4) * width_m
    y_m = width_m / 2 if rng.random() < 0.5 else rng.uniform(radius_m, width_m - radius_m)
    room_m = (strip.length_m or 0.0) / 2 - radius_m
    places = (-rng.uniform(0.3, 0.8) * room_m, rng.uniform(0.3, 0.8) * room_m)
    sizes: Any = {"radius_m": radius_m}
    kind: Any = MomentDisc
    if rng.random() < 0.5:
        kind, sizes = MomentRectangle, {"length_x_m": radius_m, "length_y_m": 1.5 * radius_m}
    return (
        strip,
        [kind(x_m=x_m, y_m=y_m, **sizes) for x_m in places],
        [Fingertip(x_m=x_m, y_m=y_m, radius_m=0.004) for x_m in places],
        Burst(
            frequency_hz=float(rng.uniform(0.15, 0.6) * strip.cutoff_hz()),
            cycles=int(rng.integers(1, 3)),
            window=rng.choice(["none", "tukey", "hann"]),
        ),
    )


def by_spectra(scene: Scene, rtol: float) -> tuple[Real, float]:
    """Return what is felt by the other solver, and its processor time."""
    began_s = time.process_time()
    with patch.object(fingertip, "by_modes", lambda *_: None):
        return felt(*scene, rtol=rtol), time.process_time() - began_s


def differences(count: int) -> tuple[Real, Real, Real]:
    """Return differences of levels (dB), of own fingers, and times (modes, spectra) of plates.

    A line for each plate goes to stderr at once: an hour's work that is stopped is not lost, and
    a plate that is off can be drawn again by its number alone.
    """
    levels, own, times = [], [], []
    for number in range(count):
        scene = drawn(np.random.default_rng((1, number)))
        began_s = time.process_time()
        modes = felt(*scene)
        took_s = time.process_time() - began_s
        spectra, slow_s = by_spectra(scene, 1e-3)
        is_smooth = scene[3].window == "hann"
        for here, there in ((0, 1), (1, 0)):
            level = [level_db(one, own=here, other=there) for one in (modes, spectra)]
            levels.append((abs(level[0] - level[1]), is_smooth))
            own.append(abs(modes[here, here] / spectra[here, here] - 1))
        times.append((took_s, slow_s))
        print(
            f"plate {number}: level {levels[-2][0]:.2g} and {levels[-1][0]:.2g} dB"
            f"{' (Hann)' if is_smooth else ''}, own finger {own[-2]:.2g} and {own[-1]:.2g}, "
            f"{took_s:.2g} s and {slow_s:.2g} s",
            file=sys.stderr,
            flush=True,
        )
    return np.array(levels), np.array(own), np.array(times)


def paper(edge: Any, loss: float, window: Any, *, square: bool = False) -> Scene:
    """Return the paper's plate with its discs, or squares, and one cycle of 500 Hz."""
    material = dataclasses.replace(ALUMINIUM, loss_factor=loss)
    strip = Strip(width_m=0.025, thickness_m=0.0005, length_m=0.2, material=material, edge=edge)
    places = (-0.035, 0.035)
    return (
        strip,
        [
            MomentRectangle(x_m=x_m, y_m=0.0125, length_x_m=0.012, length_y_m=0.012)
            if square
            else MomentDisc(x_m=x_m, y_m=0.0125, radius_m=0.0064)
            for x_m in places
        ],
        [Fingertip(x_m=x_m, y_m=0.0125) for x_m in places],
        Burst(frequency_hz=500.0, cycles=1, window=window),
    )


SQUARES: Final = "the same under squares of 12 mm"
"""The plate that finite elements are tried on: their grid runs along a rectangle, not a disc."""

PAPERS: Final = {
    "2900 Hz edge, loss 0.01": paper(ElasticEdge(stiffness_n=141.72083994908), 0.01, "none"),
    "simply supported, loss 0.01, Tukey": paper(SIMPLY_SUPPORTED, 0.01, "tukey"),
    SQUARES: paper(SIMPLY_SUPPORTED, 0.01, "tukey", square=True),
    "2500 Hz edge, loss 0.005": paper(ElasticEdge(stiffness_n=63.9264884979218), 0.005, "none"),
}


def against_time(scene: Scene) -> tuple[list[tuple[float, float]], float]:
    """Return processor time and error of the level (dB) for numbers of modes, and the level."""
    found = []
    for multiple in (40.0, *MULTIPLES):
        motion_of.cache_clear()
        began_s = time.process_time()
        with patch("stimuli.motion.motion.multiples_of", return_value=(multiple,)):
            level = level_db(felt(*scene, rtol=0.5), own=0, other=1)
        found.append((time.process_time() - began_s, level))
    (_, true), *others = found
    return [(took_s, abs(level - true)) for took_s, level in others], true


def by_elements(scene: Scene, true_db: float) -> dict[str, list[tuple[float, float]]]:
    """Return the same of finite elements in time, stepped and by their modes, on ever finer grids.

    One of the two loads is driven; the levels of both are the same.
    """
    strip, loads, tips, drive = scene
    load, _ = (one for one in loads if isinstance(one, MomentRectangle))
    viscous_s = causal(strip, drive).material.viscous_time_s
    areas = [tip.points_m(strip) for tip in tips]
    points_m = [point for area in areas for point in area]
    rows: dict[str, list[tuple[float, float]]] = {"Newmark": [], "120 modes": []}
    for size_mm in GRIDS_MM:
        rate_hz = 128 * strip.cutoff_hz() * GRIDS_MM[0] / size_mm
        # the largest value comes within 6 ms of the burst
        samples = np.append(drive.samples(rate_hz), np.zeros(round(6e-3 * rate_hz)))
        for name, row in rows.items():
            began_s = time.process_time()
            plate = model(strip, load, points_m, size_mm * 1e-3)
            if name == "Newmark":
                moved_m = newmark(plate, samples, 1 / rate_hz, viscous_s)
            else:
                moved_m = in_modes(120, plate, samples, 1 / rate_hz, viscous_s)
            took_s = time.process_time() - began_s
            peaks_m = np.max(np.abs(moved_m), axis=1)
            own, other = np.max(peaks_m[: len(areas[0])]), np.max(peaks_m[len(areas[0]) :])
            row.append((took_s, abs(20 * float(np.log10(other / own)) - true_db)))
    return rows


Rows = dict[str, list[tuple[float, float]]]


def draw(rows: Rows, spectra_s: dict[str, float], elements: Rows) -> None:
    """Draw error against time."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with mpl.rc_context({"font.size": 9.0}):
        figure = Figure(figsize=(7.2, 4.8), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.add_subplot(
            xscale="log",
            yscale="log",
            xlabel="processor time (s)",
            ylabel="error of the level at the other finger (dB)",
            title="Modes kept up to 2, 3, 4, 6, 8, 12, 16 and 24 times the cut-off",
        )
        # Okabe and Ito's colours, told apart by the colour-blind too; the markers differ as well
        for (name, points), marker, colour in zip(
            rows.items(), "osDv", ("#0072b2", "#d55e00", "#cc79a7", "#009e73"), strict=True
        ):
            x, y = np.array(points).T
            axes.plot(x, np.maximum(y, 1e-4), marker=marker, color=colour, label=name)
            axes.axvline(spectra_s[name], color=colour, linestyle=":")
        grids = ", ".join(f"{size_mm:g}" for size_mm in GRIDS_MM)
        for (name, points), marker, line in zip(elements.items(), "x+", ("--", "-."), strict=True):
            x, y = np.array(points).T
            label = f"squares, finite elements of {grids} mm, {name}"
            axes.plot(
                x, np.maximum(y, 1e-4), marker=marker, color="black", linestyle=line, label=label
            )
        axes.plot([], [], color="0.3", linestyle=":", label="by spectra, at 1e-3")
        axes.axhline(0.1, color="0.6", linewidth=0.8)
        figure.legend(fontsize=8, loc="outside lower center", ncols=2)
        figure.savefig(FIGURE, dpi=110)


def section(count: int = PLATES) -> str:
    """Return the benchmark's section of the page, and draw its figure."""
    levels, own, times = differences(count)
    smooth = levels[:, 1] == 1
    lines = [
        "## Plates over time by their modes",
        "",
        f"{count} random plates with free ends (five materials, loss 0.005 to 0.05, discs and",
        "rectangles, on the centre line or beside it; seven in eight simply supported), level at",
        "the other finger beside that of the spectra at 1e-3:",
        "",
        "| | worst | 99 % | median |",
        "|---|---|---|---|",
    ]
    for name, some in (
        ("level, dB, no window or Tukey", levels[~smooth, 0]),
        ("level, dB, Hann", levels[smooth, 0]),
        ("own finger, part", own),
    ):
        most, high, middle = np.max(some), np.quantile(some, 0.99), np.median(some)
        lines.append(f"| {name} | {most:.2g} | {high:.2g} | {middle:.2g} |")
    modes_s, spectra_s = np.median(times, axis=0)
    lines += [
        "",
        f"Median processor time of a plate: {duration(modes_s)}, by spectra {duration(spectra_s)}.",
        "",
    ]
    found = {name: against_time(scene) for name, scene in PAPERS.items()}
    rows = {name: points for name, (points, _) in found.items()}
    slow_s = {name: by_spectra(scene, 1e-3)[1] for name, scene in PAPERS.items()}
    elements = by_elements(PAPERS[SQUARES], found[SQUARES][1])
    draw(rows, slow_s, elements)
    lines += [
        "The paper's plates by the modes up to so many first cut-offs: level beside that by modes",
        "up to forty, and processor time, in dB and ms ([figure](motion.png)):",
        "",
        f"| | {' | '.join(f'{m:g} x' for m in TOLD)} | spectra |",
        f"|---|{'---|' * (len(TOLD) + 1)}",
    ]
    for name, points in rows.items():
        some = [point for m, point in zip(MULTIPLES, points, strict=True) if m in TOLD]
        cells = " | ".join(f"{error:.2g}, {1e3 * took_s:.3g}" for took_s, error in some)
        lines.append(f"| {name} | {cells} | {1e3 * slow_s[name]:.0f} |")
    shown = [i for i, size_mm in enumerate(GRIDS_MM) if size_mm in GRIDS_TOLD_MM]
    grids = " | ".join(f"{GRIDS_MM[i]:g} mm" for i in shown)
    lines += [
        "",
        "Finite elements in time (scikit-fem, Bogner, Fox and Schmit) on the plate under squares:",
        "",
        f"| | {grids} |",
        f"|---|{'---|' * len(shown)}",
    ]
    for name, points in elements.items():
        cells = " | ".join(f"{points[i][1]:.2g}, {1e3 * points[i][0]:.0f}" for i in shown)
        lines.append(f"| {name} | {cells} |")
    return "\n".join([*lines, ""])
