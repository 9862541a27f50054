"""A study's plate as its field needs it: strip, loads, drive, fingertips and their outlines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from experiment.study.physics import (
    ASSUMED_LOSS,
    bare_strip,
    fingertips_of,
    loads_of,
    loads_per_volt,
)
from experiment.study.sources import displacement_source, in_short
from stimuli import Burst, Fingertip, Load, Scene, Strip, displacement

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from numpy.typing import ArrayLike, NDArray

    from experiment.study.actuator import Actuator
    from experiment.study.study import Study

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLevels:
    """How strongly each actuator of a study is driven, in the study's order.

    >>> DriveLevels(names=("left", "right"), units=("N m/m", "N m/m"), amplitudes=(0.09, 0.08),
    ...       bases=("your measurement", "predicted"), level_vpp=200.0).basis
    'computed for 200 Vpp; displacement per volt: left your measurement, right predicted'
    """

    names: tuple[str, ...]
    units: tuple[str, ...]  # of each one's load
    amplitudes: tuple[float, ...]  # in that unit; unit loads where no level is stated
    bases: tuple[str, ...]  # who measured each, or that it is predicted; empty for unit loads
    level_vpp: float | None  # none for unit loads
    unused: tuple[str, ...] = ()  # whose displacement is known, but not all others'

    @property
    def basis(self) -> str:
        """What the displacements rest on, in words."""
        if self.level_vpp is None:
            units = [f"1 {unit}" for unit in dict.fromkeys(self.units)]
            return f"per unit load of {' or '.join(units)}"
        each = [f"{name} {basis}" for name, basis in zip(self.names, self.bases, strict=True)]
        words = ", ".join(each) if len(set(self.bases)) > 1 else self.bases[0]
        return f"computed for {self.level_vpp:g} Vpp; displacement per volt: {words}"

    @property
    def doubt(self) -> str:
        """What to say of displacements that are known in vain; empty where there are none."""
        missing = ", ".join(name for name in self.names if name not in self.unused)
        known = ", ".join(self.unused)
        told = f"no displacement is stated of {missing}, so that of {known} is not used"
        return f"{told}: docs/plate.md; {ALIKE}" if known else ""

    def per_load(self, driven: int) -> str:
        """Return what follows the unit of a displacement: the unit of the load, for unit loads."""
        return "" if self.level_vpp is not None else f" per {self.units[driven]}"

    @property
    def per_any_load(self) -> str:
        """The same for displacements of all actuators."""
        same = len(set(self.units)) == 1 or self.level_vpp is not None
        return self.per_load(0) if same else " per unit load"


def drive_of(study: Study) -> DriveLevels:
    """Return the drive of a study's highest level; unit loads if a displacement is not known.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> drive_of(paper_study()).basis
    'computed for 200 Vpp; displacement per volt: measured by the paper'
    """
    units = tuple(load.unit for load in loads_of(study))
    names = tuple(actuator.label for actuator in study.actuators)
    strip = bare_strip(study)
    per_volt = [load for load, _ in loads_per_volt(study, strip)]
    known = [load for load in per_volt if load]
    sources = [displacement_source(study, place) for place in range(len(units))]
    if len(known) < len(units):
        return DriveLevels(
            names=names,
            units=units,
            amplitudes=tuple(1.0 for _ in units),
            bases=(),
            level_vpp=None,
            unused=tuple(name for name, load in zip(names, per_volt, strict=True) if load),
        )
    level_vpp = max(study.design.levels_vpp)
    return DriveLevels(
        names=names,
        units=units,
        amplitudes=tuple(load_per_v * level_vpp / 2 for load_per_v in known),
        bases=tuple(
            in_short(source, actuator)
            for source, actuator in zip(sources, study.actuators, strict=True)
            if source is not None
        ),
        level_vpp=level_vpp,
    )


ALIKE: Final = 'measured_as = "as-left" or "as-right" assumes two like actuators to move alike'
"""What can be stated where one of two was measured."""

RTOL: Final = 1e-4
"""Relative error wanted of what is shown."""

_DASHES: Final = (0, (3, 2))
_FINGERS: Final = 2
"""The first actuators have a finger above them, left and right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlatePreview:
    """A study's plate with what bends it, and a fingertip above each actuator."""

    study: Study
    strip: Strip  # whose field is computed
    loads: tuple[Load, ...]
    drive: DriveLevels
    fingertips: tuple[Fingertip, ...]

    @property
    def scene(self) -> Scene:
        """The loads and the centres of the fingertips."""
        points_m = tuple((finger.x_m, finger.y_m) for finger in self.fingertips)
        return Scene(strip=self.strip, loads=self.loads, points_m=points_m)

    @property
    def basis(self) -> str:
        """What the displacements rest on."""
        words = self.drive.basis
        if not self.study.plate.is_loss_stated:
            words += f"; loss factor {ASSUMED_LOSS:g} assumed"
        if any(actuator.patch_counts for actuator in self.study.actuators):
            words += "; patch_counts is left out: patches do not stiffen or load the plate here"
        if self.study.finger_load.impedance is not None:
            words += "; without the finger load"
        return words

    @property
    def remark(self) -> str:
        """The same, said to a reader."""
        return f"{self.basis}; amplitudes, each actuator driven alone"

    @property
    def masking_limit_db(self) -> float:
        """Level below a finger's own from which another one feels nothing, equation (29)."""
        return self.study.burst.masking_limit_db

    @property
    def drive_hz(self) -> float:
        """Frequency of the first condition's burst; the peak of its spectrum for another drive."""
        drive = self.study.conditions[0].drive
        return drive.frequency_hz if isinstance(drive, Burst) else drive.peak_hz()

    @property
    def fingers(self) -> tuple[Fingertip, ...]:
        """The participant's two fingertips."""
        return self.fingertips[:_FINGERS]

    @property
    def places(self) -> tuple[str, ...]:
        """What is above each actuator, in words."""
        names = self.drive.names
        fingers = tuple(f"{name} finger" for name in names[:_FINGERS])
        return fingers + tuple(f"place above {name}" for name in names[_FINGERS:])

    def others_of(self, driven: int) -> tuple[int, ...]:
        """Return the fingers that are not above a driven actuator."""
        return tuple(finger for finger in range(_FINGERS) if finger != driven)

    def scaled(self, per_load_m: Complex) -> Complex:
        """Return displacements for the drive, metres, from those per unit load, (n_loads, ...)."""
        amplitudes = np.array(self.drive.amplitudes)
        return np.asarray(per_load_m * amplitudes.reshape(-1, *[1] * (per_load_m.ndim - 1)))

    def at_fingers_m(self, frequencies_hz: ArrayLike) -> Complex:
        """Return amplitudes at the fingertips, shape (n_driven, n_fingertips, n_frequencies)."""
        found = displacement(self.scene, frequencies_hz, RTOL)
        return self.scaled(np.moveaxis(found, 0, -1))


def plate_of(study: Study) -> PlatePreview:
    """Return the plate of a study with its loads, its drive and the fingertips.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> len(plate_of(paper_study()).loads)
    2
    """
    return PlatePreview(
        study=study,
        strip=bare_strip(study),
        loads=loads_of(study),
        drive=drive_of(study),
        fingertips=fingertips_of(study),
    )


def draw_outlines(axes: Axes, plate: PlatePreview) -> None:
    """Draw the outlines of actuators and fingertips into a map in millimetres."""
    for actuator in plate.study.actuators:
        _outline(axes, _patch(actuator), dashed=False)
    for finger in plate.fingers:
        _outline(axes, _circle(finger.x_m, finger.y_m, finger.radius_m), dashed=True)


def _patch(actuator: Actuator) -> Patch:
    from matplotlib.patches import Rectangle

    if actuator.diameter_m is not None:
        return _circle(actuator.x_m, actuator.y_m, actuator.diameter_m / 2)
    (left_m, right_m), (lower_m, upper_m) = actuator.span_x_m, actuator.span_y_m
    corner_mm = (left_m * 1e3, lower_m * 1e3)
    return Rectangle(corner_mm, (right_m - left_m) * 1e3, (upper_m - lower_m) * 1e3)


def _circle(x_m: float, y_m: float, radius_m: float) -> Patch:
    from matplotlib.patches import Circle

    return Circle((x_m * 1e3, y_m * 1e3), radius_m * 1e3)


def _outline(axes: Axes, shape: Patch, *, dashed: bool) -> None:
    """Draw an outline that stands out on light and on dark ground."""
    from matplotlib.patheffects import withStroke

    shape.set(
        fill=False,
        edgecolor="white",
        linewidth=1.2,
        linestyle=_DASHES if dashed else "-",
        path_effects=[withStroke(linewidth=2.4, foreground="black")],
    )
    axes.add_patch(shape)


def outline_keys(plate: PlatePreview) -> list[Line2D]:
    """Return what explains them in a legend; a contact that a disc's edge hides has no line."""
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke

    style: Any = {
        "color": "white",
        "lw": 1.2,
        "path_effects": [withStroke(linewidth=2.4, foreground="black")],
    }
    edges = {(one.x_m, one.y_m, (one.diameter_m or 0.0) / 2) for one in plate.study.actuators}
    if edges >= {(one.x_m, one.y_m, one.radius_m) for one in plate.fingers}:
        return [Line2D([], [], label="actuator and fingertip's contact", **style)]
    return [
        Line2D([], [], label="actuator", **style),
        Line2D([], [], label="fingertip's contact", ls=_DASHES, **style),
    ]
