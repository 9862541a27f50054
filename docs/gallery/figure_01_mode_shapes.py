"""Figure 1: the shapes across the plate of its first five propagation modes
=========================================================================

The paper shows sin(n pi y / W) on simple supports, equation (7); it says "index 0 to 5", but mode 0
is zero everywhere. Ours are `Strip.mode_shape` on the same edges, with their cut-offs, and beside
them those of the plate with the measured first cut-off of 2.9 kHz, which is what was built.

The number: the first mode begins to propagate at 1926 Hz (the paper: 1.9 kHz), mode n at n^2 times
that.

Usage: python docs/gallery/figure_01_mode_shapes.py [OUT.png]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from paper_plate import FIRST, SUPPORTED, WIDTH_M, save

if TYPE_CHECKING:
    from numpy.typing import NDArray

MODES = range(1, 6)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Numbers:
    """Cut-offs of modes 1 to 5, and their shapes: one row per mode."""

    y_m: NDArray[np.float64]
    supported_hz: tuple[float, ...]
    built_hz: tuple[float, ...]
    supported: NDArray[np.float64]
    built: NDArray[np.float64]


def numbers() -> Numbers:
    """Compute the figure."""
    y_m = np.linspace(0.0, WIDTH_M, 301)
    return Numbers(
        y_m=y_m,
        supported_hz=tuple(SUPPORTED.cutoff_hz(mode) for mode in MODES),
        built_hz=tuple(FIRST.cutoff_hz(mode) for mode in MODES),
        supported=np.stack([SUPPORTED.mode_shape(mode, y_m) for mode in MODES]),
        built=np.stack([FIRST.mode_shape(mode, y_m) for mode in MODES]),
    )


def draw(found: Numbers) -> Figure:
    """Draw one panel per mode."""
    figure = Figure(figsize=(9.0, 3.2), layout="constrained")
    panels = figure.subplots(1, len(MODES), sharey=True)
    for row, (panel, mode) in enumerate(zip(panels, MODES, strict=True)):
        panel.plot(found.supported[row], found.y_m * 1e3, color="#0072B2", label="simple supports")
        panel.plot(found.built[row], found.y_m * 1e3, "--", color="#E69F00", label="2.9 kHz edge")
        panel.axvline(0, color="#7F7F7F", linewidth=0.8)
        cutoffs = f"{found.supported_hz[row] / 1e3:.1f} / {found.built_hz[row] / 1e3:.1f} kHz"
        panel.set(title=f"n = {mode}\n{cutoffs}", xlim=(-1.35, 1.35), ylim=(0, WIDTH_M * 1e3))
    panels[0].set_ylabel("Across the plate, y (mm)")
    note = "above: cut-off on simple supports / on the 2.9 kHz edge"
    figure.supxlabel(f"Displacement (arbitrary scale); {note}", fontsize="medium")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, frameon=False)
    return figure


def main() -> None:
    """Compute, draw and save."""
    save(draw(numbers()), "figure_01.png")


if __name__ == "__main__":
    main()
