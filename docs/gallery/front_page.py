"""The picture of the first page: a burst that stays on its disc, and the detection it leads to
============================================================================================

Left, the plate of the paper with its measured cut-off of 2.9 kHz, moved by one cycle of 500 Hz
under a Hann window: computed with both free ends and an assumed loss factor of 0.01, from the
displacement that the paper measured above its disc. Right, where twenty simulated people said that
they felt such bursts: the means of all, and the function that is fitted to the group.

Usage: python docs/gallery/front_page.py [OUT.png], which draws docs/front_page.png
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator
from paper_plate import BLUE, LENGTH_M, ORANGE, outline, save

from analysis.reading.trials import read_inputs
from analysis.results.analysis import analyse
from analysis.results.figures.curves import group_curves
from experiment import simulate_study
from experiment.check.plate import PlatePreview
from experiment.study.files import read_study
from experiment.study.physics import study_gains
from experiment.study.stimulus import unscaled_peak
from stimuli import Scene, causal, transient

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import SubFigure
    from matplotlib.image import AxesImage
    from numpy.typing import NDArray

    from analysis.thresholds.band import Function
    from experiment import Study
    from stimuli import Load

    Real = NDArray[np.float64]

PEOPLE: Final = 20
SEED: Final = 7
SHOWN_VPP: Final = 59.0
"""The level of the burst on the left, one of the levels on the right."""
MOMENTS_S: Final = (0.4e-3, 0.7e-3, 1.3e-3, 2.5e-3)
"""The burst is over after 2 ms."""

STUDY: Final = Path(__file__).parents[1] / "examples" / "first-study.toml"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrontPage:
    """What both halves show.

    Attributes
    ----------
    study : Study
        Whose plate and protocol it is.
    loads : tuple of Load
        Its discs, the left one first.
    x_mm, y_mm : ndarray of float64, shape (n_x,) and (n_y,)
        Places along the plate, from its middle, and across it, from one edge.
    moved_um : ndarray of float64, shape (n_moments, n_x, n_y)
        Displacement at each of `MOMENTS_S` with the left disc driven at `SHOWN_VPP`.
    um_per_vpp : (float, float)
        Largest displacement over the contact of the driven and of the other finger, per level.
    levels_vpp, means : ndarray of float64, shape (n_levels,)
        Detection at each level: mean of the people.
    each : ndarray of float64, shape (n_levels, n_people)
        Detection of everybody.
    function : Function
        Fitted to the group.
    threshold_vpp : float
        Of the group.
    """

    study: Study
    loads: tuple[Load, ...]
    x_mm: Real
    y_mm: Real
    moved_um: Real
    um_per_vpp: tuple[float, float]
    levels_vpp: Real
    means: Real
    each: Real
    function: Function
    threshold_vpp: float

    @property
    def shown_um(self) -> tuple[float, float]:
        """What the driven and the other finger get of the burst on the left."""
        own, other = self.um_per_vpp
        return own * SHOWN_VPP, other * SHOWN_VPP

    @property
    def level_db(self) -> float:
        """Level at the other finger re the driven one's."""
        own, other = self.um_per_vpp
        return float(20 * np.log10(other / own))


def numbers() -> FrontPage:
    """Compute the burst on the plate, simulate the people and analyse their answers."""
    study = read_study(STUDY)
    x_m, y_m, moved_m = _motion(study)
    gains = study_gains(study)
    own, other = gains[0].per_vpp[0][0], gains[0].per_vpp[1][0]
    with TemporaryDirectory() as place:
        for _ in simulate_study(study, Path(place), participants=PEOPLE, seed=SEED, gains=gains):
            pass
        found = analyse(read_inputs([place]), seed=SEED)
    (curve,) = group_curves(found).values()
    if curve.function is None:
        raise RuntimeError("the people's answers tell no function; choose other levels")
    each = found.participants.pivot_table(index="level_vpp", columns="participant", values="p")
    return FrontPage(
        study=study,
        loads=PlatePreview(study).loads,
        x_mm=x_m * 1e3,
        y_mm=y_m * 1e3,
        moved_um=moved_m * 1e6,
        um_per_vpp=(own, other),
        levels_vpp=curve.level_vpp,
        means=curve.p,
        each=each.to_numpy(),
        function=curve.function,
        threshold_vpp=curve.threshold_vpp,
    )


def _motion(study: Study) -> tuple[Real, Real, Real]:
    """Return places along and across the plate, and its displacement at the moments: metres."""
    plate, condition = PlatePreview(study), study.conditions[0]
    half_m = (plate.strip.length_m or LENGTH_M) / 2
    x_m, y_m = np.linspace(-half_m, half_m, 121), np.linspace(0.0, plate.strip.width_m, 16)
    points_m = tuple((x, y) for x in x_m.tolist() for y in y_m.tolist())
    strip = causal(plate.strip, condition.drive)
    scene = Scene(strip=strip, loads=plate.loads[:1], points_m=points_m)
    moved_m = transient(scene, condition.drive, MOMENTS_S, rtol=1e-2)[:, 0]
    moved_m *= plate.amplitudes[0] / unscaled_peak(condition, study.device)
    moved_m *= SHOWN_VPP / max(study.design.levels_vpp)
    return x_m, y_m, moved_m.reshape(len(MOMENTS_S), x_m.size, y_m.size)


def draw(found: FrontPage) -> Figure:
    """Draw the plate at some moments, and the detection beside it."""
    figure = Figure(figsize=(10.0, 4.3), layout="constrained")
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1.2, 1))[0]
    _draw_motion(left, found)
    _draw_detection(right, found)
    return figure


def _draw_motion(figure: SubFigure, found: FrontPage) -> None:
    panels = list(figure.subplots(len(MOMENTS_S), 1, sharex=True).flat)
    most_um = float(np.abs(found.moved_um).max())
    for axes, moment_s, moved_um in zip(panels, MOMENTS_S, found.moved_um, strict=True):
        image = _draw_moment(axes, found, moved_um, most_um)
        axes.annotate(
            f"{moment_s * 1e3:.1f} ms", (0.99, 0.9), xycoords="axes fraction", ha="right", va="top"
        )
    panels[-1].set_xlabel("Along the plate (mm)")
    figure.supylabel("Across the plate (mm)", fontsize=10)
    own_um, other_um = found.shown_um
    for load, words in zip(
        found.loads,
        (
            f"left finger:\nup to {own_um:.1f} µm",
            f"right finger:\n{other_um * 1e3:.0f} nm, {-found.level_db:.0f} dB less",
        ),
        strict=True,
    ):
        place = (load.x_m * 1e3, 1.15)
        panels[0].annotate(words, place, xycoords=("data", "axes fraction"), ha="center")
    figure.colorbar(image, ax=panels, label="Displacement (µm)", aspect=25, pad=0.02)
    figure.suptitle(f"Computed: a burst of {SHOWN_VPP:.0f} V on the left disc stays there")


def _draw_moment(axes: Axes, found: FrontPage, moved_um: Real, most_um: float) -> AxesImage:
    image = axes.imshow(
        moved_um.T,
        extent=(found.x_mm[0], found.x_mm[-1], found.y_mm[0], found.y_mm[-1]),
        origin="lower",
        cmap="PuOr",
        vmin=-most_um,
        vmax=most_um,
        interpolation="bicubic",
    )
    for load in found.loads:
        outline(axes, load, colour="#404040")
    axes.set_yticks((0, 25))
    return image


def _draw_detection(figure: SubFigure, found: FrontPage) -> None:
    axes, (own, _), function = figure.subplots(), found.um_per_vpp, found.function
    um = own * found.levels_vpp
    line_vpp = np.geomspace(float(found.levels_vpp[0]), float(found.levels_vpp[-1]), 200)
    axes.axvline(found.shown_um[0], color=ORANGE, lw=6, alpha=0.6, zorder=0)
    words = "the burst\non the left"
    axes.annotate(words, (found.shown_um[0], 0.03), xytext=(7, 0), textcoords="offset points")
    dots: dict[str, Any] = {"ls": "", "marker": "o", "color": BLUE}
    axes.plot(um, found.each, ms=3, alpha=0.35, mew=0, **dots)
    axes.plot([], [], ms=4, alpha=0.5, mew=0, label=f"each of {PEOPLE}", **dots)
    axes.plot(um, found.means, mfc="white", ms=6, label="mean", **dots)
    axes.plot(own * line_vpp, function.at(line_vpp), color=BLUE, lw=2, label="fit, 95 %")
    band_um = own * function.level_vpp
    axes.fill_between(band_um, function.low, function.high, color=BLUE, alpha=0.2, lw=0)
    axes.set_xscale("log")
    axes.set_xticks(um, [f"{one:.1f}" for one in um])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.set(
        xlabel="Largest displacement at the driven finger (µm)",
        ylabel="Detection probability",
        ylim=(0, 1.02),
    )
    axes.grid(color="#E5E5E5")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="upper left")
    figure.suptitle(f"Simulated: how often {PEOPLE} people detect such bursts")


def main() -> None:
    """Compute, draw and save."""
    save(draw(numbers()), "front_page.png")


if __name__ == "__main__":
    main()
