"""The paper's plates and actuators, and how the figures of this gallery are computed and drawn."""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    ForceRectangle,
    Load,
    MomentDisc,
    MomentRectangle,
    PiezoLayers,
    Scene,
    Strip,
    displacement,
    displacement_map,
    load_per_volt,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]

WIDTH_M: Final = 0.025
LENGTH_M: Final = 0.2
MIDDLE_M: Final = WIDTH_M / 2

# Section II-B: aluminium, 25 x 0.5 mm. Section III: the same plate on edges that gave it a first
# cut-off of 2.9 kHz, and built again 2.5 kHz. Endless here; the real ones are 200 mm long.
SUPPORTED: Final = Strip(
    width_m=WIDTH_M, thickness_m=0.0005, material=ALUMINIUM, edge=SIMPLY_SUPPORTED
)
HELD_FAST: Final = replace(SUPPORTED, edge=CLAMPED)
FIRST: Final = SUPPORTED.with_cutoff(2900.0)
SECOND: Final = SUPPORTED.with_cutoff(2500.0)

# Sections III-A and III-C. Of the muRata 7BB-20-3 only the electrode bends the plate.
DISC: Final = MomentDisc(x_m=0.0, y_m=MIDDLE_M, radius_m=0.0064)
UPRIGHT_PATCH: Final = MomentRectangle(x_m=0.0, y_m=MIDDLE_M, length_x_m=0.006, length_y_m=0.018)
FLAT_PATCH: Final = MomentRectangle(x_m=0.0, y_m=MIDDLE_M, length_x_m=0.010, length_y_m=0.003)
MOTOR: Final = ForceRectangle(x_m=0.0, y_m=MIDDLE_M, length_x_m=0.010, length_y_m=0.010)

# PI Ceramic, "Piezo Material Data": d31 = -180 pm/V, S11E = 16.1e-12 m2/N, Poisson's ratio 0.34,
# 7.80 g/cm3.
PIC255: Final = PiezoLayers(
    thickness_m=0.25e-3,
    youngs_modulus_pa=1 / 16.1e-12,
    poisson_ratio=0.34,
    d31_m_v=-180e-12,
    density_kg_m3=7800.0,
)
# muRata 7BB-20-3, thicknesses of section III-A. No data of its ceramic are published; those of a
# usual soft PZT stand for it: an assumption that moves the prediction by a tenth or two.
BUZZER: Final = PiezoLayers(
    thickness_m=0.11e-3,
    youngs_modulus_pa=63e9,
    poisson_ratio=0.31,
    d31_m_v=-200e-12,
    carrier_thickness_m=0.10e-3,
    density_kg_m3=7800.0,
    carrier_density_kg_m3=8530.0,
)

LOSS_FACTOR: Final = 0.01
"""Assumed where a figure shows the cut-off: without loss the field is infinite there."""

BLUE, ORANGE, GREY = "#0072B2", "#E69F00", "#7F7F7F"
"""Colours of Okabe and Ito, for every kind of colour vision."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Frequencies:
    """Displacement per unit load over frequency, at the actuator's centre and beside it."""

    frequencies_hz: Real
    centre_m: Complex
    beside_m: Complex

    @property
    def level_db(self) -> Real:
        """Amplitude at the centre relative to the one beside."""
        return np.asarray(20 * np.log10(np.abs(self.centre_m / self.beside_m)))

    def level_at(self, frequency_hz: float) -> float:
        """Return the level at one frequency, in dB."""
        return float(np.interp(frequency_hz, self.frequencies_hz, self.level_db))

    def mean_level_db(self, below_hz: float) -> float:
        """Return the mean of the level over all frequencies below one."""
        return float(np.mean(self.level_db[self.frequencies_hz < below_hz]))

    def over_centre_at(self, frequency_hz: float) -> Frequencies:
        """Return both divided by the amplitude of the centre at one frequency."""
        unit_m = np.interp(frequency_hz, self.frequencies_hz, np.abs(self.centre_m))
        return replace(self, centre_m=self.centre_m / unit_m, beside_m=self.beside_m / unit_m)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Map:
    """Displacement over the plate: amplitudes in metres, shape (n_x, n_y)."""

    x_m: Real
    y_m: Real
    displacement_m: Complex
    loads: tuple[Load, ...]

    @property
    def along_m(self) -> Real:
        """Amplitude along the centre line."""
        return np.abs(self.displacement_m[:, self.y_m.size // 2])

    def at(self, x_m: float) -> float:
        """Return the amplitude at a place of the centre line, in metres."""
        return float(np.interp(x_m, self.x_m, self.along_m))

    @property
    def peak_place_m(self) -> tuple[float, float]:
        """Where the amplitude is largest: x, y."""
        row, column = np.unravel_index(
            int(np.argmax(np.abs(self.displacement_m))), self.displacement_m.shape
        )
        return float(self.x_m[row]), float(self.y_m[column])


def lossy(strip: Strip) -> Strip:
    """Return the strip with the assumed loss."""
    return replace(strip, material=replace(strip.material, loss_factor=LOSS_FACTOR))


def over_frequency(
    strip: Strip, load: Load, frequencies_hz: Real, beside_m: tuple[float, float]
) -> Frequencies:
    """Compute the field at the centre of a load and at a place beside it."""
    scene = Scene(strip=strip, loads=(load,), points_m=((load.x_m, load.y_m), beside_m))
    field_m = displacement(scene, frequencies_hz)[:, 0]
    return Frequencies(
        frequencies_hz=frequencies_hz, centre_m=field_m[:, 0], beside_m=field_m[:, 1]
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Confinement:
    """The cut-off of a built plate, and the responses over the centre's amplitude there."""

    cutoff_hz: float
    response: Frequencies


def confinement(strip: Strip, load: Load) -> Confinement:
    """Compute the field of a load at its centre and 20 mm along, up to 5 kHz, with loss."""
    frequencies_hz = np.linspace(10.0, 5000.0, 500)
    found = over_frequency(lossy(strip), load, frequencies_hz, (0.02, MIDDLE_M))
    cutoff_hz = strip.cutoff_hz()
    return Confinement(cutoff_hz=cutoff_hz, response=found.over_centre_at(cutoff_hz))


def over_plate(strip: Strip, driven: tuple[tuple[Load, float], ...], frequency_hz: float) -> Map:
    """Compute the field of loads with their amplitudes over 200 mm, in steps of 0.5 mm."""
    x_m, y_m = np.linspace(-0.1, 0.1, 401), np.linspace(0.0, strip.width_m, 51)
    loads, amplitudes = zip(*driven, strict=True)
    field = displacement_map(strip, loads, frequency_hz, x_m=x_m, y_m=y_m)
    total_m = np.asarray(np.tensordot(amplitudes, field.value, axes=1), dtype=np.complex128)
    return Map(x_m=x_m, y_m=y_m, displacement_m=total_m, loads=loads)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PatchMap:
    """The map of one patch, the amplitude at its centre, and the moment that drives it."""

    plate: Map
    centre_m: float
    moment_n: float


def patch_map(
    strip: Strip, load: Load, layers: PiezoLayers, *, frequency_hz: float, level_vpp: float
) -> PatchMap:
    """Compute the field of a patch on a strip, whose moment is predicted from its layers.

    Where the patch is one of the strip's own, the moment is that of its free laminate.
    """
    moment_n = predicted_moment_n(strip, load, layers, level_vpp)
    plate = over_plate(strip, ((load, moment_n),), frequency_hz)
    return PatchMap(plate=plate, centre_m=plate.at(load.x_m), moment_n=moment_n)


def predicted_moment_n(strip: Strip, load: Load, layers: PiezoLayers, level_vpp: float) -> float:
    """Return the amplitude of a patch's edge moment from catalogue data: N m/m."""
    return load_per_volt(strip, load, layers).load_per_v * level_vpp / 2


def bearing(strip: Strip, load: Load, layers: PiezoLayers) -> Strip:
    """Return 200 mm of a plate with the patch of a load, which stiffens and loads it."""
    half_x_m, half_y_m = load.half_size_m
    patch = BondedPatch(
        x_m=load.x_m,
        y_m=load.y_m,
        length_x_m=2 * half_x_m,
        length_y_m=2 * half_y_m,
        layers=layers.layers,
        is_disc=isinstance(load, MomentDisc),
    )
    return replace(strip, length_m=LENGTH_M, patches=(patch,))


def with_patch(
    strip: Strip, load: Load, layers: PiezoLayers, frequencies_hz: Real
) -> tuple[Real, Real]:
    """Compute amplitudes per volt at the centre of a load and 20 mm along, with its patch."""
    plate = bearing(strip, load, layers)
    per_v = load_per_volt(plate, load, layers).load_per_v
    points_m = ((load.x_m, load.y_m), (load.x_m + 0.02, load.y_m))
    scene = Scene(strip=plate, loads=(load,), points_m=points_m)
    amplitudes_m = per_v * np.abs(displacement(scene, frequencies_hz)[:, 0])
    return amplitudes_m[:, 0], amplitudes_m[:, 1]


def draw_frequencies(
    found: Frequencies, *, title: str, reference: str, beside: str, cutoff_hz: float
) -> Figure:
    """Draw both amplitudes over frequency, in dB."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    curves: tuple[tuple[Complex, dict[str, Any]], ...] = (
        (found.centre_m, {"color": BLUE, "label": "centre of the actuator"}),
        (found.beside_m, {"color": ORANGE, "linestyle": "--", "label": beside}),
    )
    for values, look in curves:
        level_db = 20 * np.log10(np.abs(values))
        axes.plot(found.frequencies_hz / 1e3, level_db, linewidth=2, **look)
    axes.axvline(cutoff_hz / 1e3, color=GREY, linewidth=1)
    axes.annotate(
        f"cut-off {cutoff_hz / 1e3:.3g} kHz",
        (cutoff_hz / 1e3, 0.02),
        xycoords=("data", "axes fraction"),
        xytext=(4, 0),
        textcoords="offset points",
        color="#4D4D4D",
    )
    axes.set(xlabel="Frequency (kHz)", ylabel=f"Displacement (dB re {reference})", title=title)
    axes.grid(color="#E5E5E5")
    axes.set_xlim(0, found.frequencies_hz[-1] / 1e3)
    axes.legend(frameon=False)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def draw_confinement(found: Confinement, *, actuator: str) -> Figure:
    """Draw both responses of a built plate."""
    told = f"{found.cutoff_hz / 1e3:.1f} kHz"
    return draw_frequencies(
        found.response,
        title=f"Plate with the measured cut-off of {told}, {actuator} (model)",
        reference=f"centre at {told}",
        beside="20 mm along",
        cutoff_hz=found.cutoff_hz,
    )


def draw_map(found: Map, *, title: str) -> Figure:
    """Draw the amplitude over the plate, and below it along the centre line."""
    figure = Figure(figsize=(8.0, 4.4), layout="constrained")
    plate, line = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.8))
    edges_mm = (-100.0, 100.0, 0.0, float(found.y_m[-1]) * 1e3)
    image = plate.imshow(
        np.abs(found.displacement_m.T) * 1e6,
        extent=edges_mm,
        origin="lower",
        aspect="equal",
        cmap="cividis",
        vmin=0,
        interpolation="bilinear",
    )
    figure.colorbar(image, ax=plate, label="Amplitude (µm)", location="top", fraction=0.15)
    plate.set_ylabel("Across, y (mm)")
    figure.suptitle(title)
    line.plot(found.x_m * 1e3, found.along_m * 1e6, color=BLUE, linewidth=2)
    line.set(xlabel="Along the plate, x (mm)", ylabel="On the centre line (µm)", xlim=(-100, 100))
    line.set_ylim(bottom=0)
    line.grid(color="#E5E5E5")
    line.spines[["top", "right"]].set_visible(False)
    for load in found.loads:
        outline(plate, load)
    return figure


def outline(axes: Axes, load: Load, colour: str = "white") -> None:
    """Draw where a load is."""
    x_mm, y_mm = load.x_m * 1e3, load.y_m * 1e3
    half_x_mm, half_y_mm = (1e3 * half_m for half_m in load.half_size_m)
    look: dict[str, Any] = {"fill": False, "edgecolor": colour, "linestyle": "--"}
    if isinstance(load, MomentDisc):
        axes.add_patch(Ellipse((x_mm, y_mm), 2 * half_x_mm, 2 * half_y_mm, **look))
    else:
        corner = (x_mm - half_x_mm, y_mm - half_y_mm)
        axes.add_patch(Rectangle(corner, 2 * half_x_mm, 2 * half_y_mm, **look))


def save(figure: Figure, name: str) -> None:
    """Save to the file named on the command line, else to this one in the current folder."""
    named = sys.argv[1:]
    figure.savefig(named[0] if named else name, dpi=150)
    if not named:
        sys.stdout.write(f"{name}\n")
