"""The plate of a study for its field: strip, loads, drive, fingertips and their outlines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from experiment.study.physics import field_strip, fingertips_of, loads_of, loads_per_volt
from stimuli import Burst, Fingertip, Load, Strip
from stimuli.plate.response import response
from stimuli.plate.scene import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch
    from numpy.typing import ArrayLike, NDArray

    from experiment.study.study import Study

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]


_DASHES: Final = (0, (3, 2))


@dataclass(frozen=True)
class PlatePreview:
    """The plate of a study with its loads, and a fingertip above each actuator.

    Each actuator is driven at the highest level, or by a unit load if a displacement is not known.

    Examples
    --------
    >>> from experiment.study.files import paper_study
    >>> plate = PlatePreview(paper_study())
    >>> plate.names, plate.load
    (('left', 'right'), 'at 200 Vpp')
    """

    study: Study

    @cached_property
    def strip(self) -> Strip:
        """The strip with the patches that count."""
        return field_strip(self.study)

    @cached_property
    def loads(self) -> tuple[Load, ...]:
        """The load of each actuator."""
        return loads_of(self.study)

    @cached_property
    def fingertips(self) -> tuple[Fingertip, ...]:
        """The fingertip above each actuator."""
        return fingertips_of(self.study)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the actuators."""
        return tuple(actuator.label for actuator in self.study.actuators)

    @cached_property
    def loads_per_volt(self) -> dict[str, float]:
        """The load per volt of each actuator whose displacement is known, by its name."""
        per_volt = loads_per_volt(self.study, self.strip)
        return {name: load for name, (load, _) in zip(self.names, per_volt, strict=True) if load}

    @property
    def level_vpp(self) -> float | None:
        """The level that displacements are for; None for unit loads."""
        is_known = len(self.loads_per_volt) == len(self.names)
        return max(self.study.design.levels_vpp) if is_known else None

    @property
    def load(self) -> str:
        """What displacements are for: the level, or a unit load."""
        if self.level_vpp is not None:
            return f"at {self.level_vpp:g} Vpp"
        return f"per {self.load_units}"

    @property
    def load_units(self) -> str:
        """The units of the loads."""
        return " or ".join(dict.fromkeys(load.unit for load in self.loads))

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """The amplitude of each load, in its unit."""
        level_vpp = self.level_vpp
        if level_vpp is None:
            return tuple(1.0 for _ in self.names)
        return tuple(load * level_vpp / 2 for load in self.loads_per_volt.values())

    @property
    def scene(self) -> Scene:
        """The loads and the centres of the fingertips."""
        points_m = tuple((finger.x_m, finger.y_m) for finger in self.fingertips)
        return Scene(strip=self.strip, loads=self.loads, points_m=points_m)

    @property
    def masking_threshold_db(self) -> float:
        """The limit of crosstalk, below the level at the driven finger, equation (29)."""
        return self.study.burst.masking_threshold_db

    @property
    def drive_hz(self) -> float:
        """Frequency of the first condition's burst; the peak of its spectrum for another drive."""
        drive = self.study.conditions[0].drive
        return drive.frequency_hz if isinstance(drive, Burst) else drive.peak_hz()

    @property
    def is_lossless(self) -> bool:
        """Whether nothing limits the field at a cut-off frequency."""
        material = self.strip.material
        return not (material.loss_factor or material.viscous_time_s)

    @property
    def loss_basis(self) -> str:
        """Whether the study sets the loss, or it is assumed."""
        return "set" if self.study.plate.has_loss_factor else "assumed"

    @cached_property
    def burst_levels_db(self) -> tuple[tuple[float | None, float | None], ...]:
        """Crosstalk of the first condition's burst and its error, of each driven actuator.

        As in the check; empty where the study cannot be checked.
        """
        from experiment.check.check import check_study

        try:
            check = check_study(self.study).conditions[0]
        except ValueError:  # tactstrip check reports it
            return ()
        return tuple(map(check.crosstalk_of, range(len(self.fingers))))

    @property
    def fingers(self) -> tuple[Fingertip, ...]:
        """The participant's fingertips."""
        return self.fingertips[: len(self.study.driven)]

    def others_of(self, driven: int) -> tuple[int, ...]:
        """Return the fingers that are not above a driven actuator."""
        return tuple(finger for finger in range(len(self.fingers)) if finger != driven)

    def scaled(self, per_load_m: Complex) -> Complex:
        """Return displacements for the drive, metres, from those per unit load, (n_loads, ...)."""
        amplitudes = np.array(self.amplitudes)
        return np.asarray(per_load_m * amplitudes.reshape(-1, *[1] * (per_load_m.ndim - 1)))

    def at_fingers_m(self, frequencies_hz: ArrayLike) -> tuple[Complex, Real]:
        """Return amplitudes at the fingertips, and their errors.

        Both have the shape (n_driven, n_fingertips, n_frequencies).
        """
        per_load = response(self.scene, frequencies_hz)
        value_m = self.scaled(np.moveaxis(per_load.value, 0, -1))
        error_m = self.scaled(np.moveaxis(per_load.error.astype(np.complex128), 0, -1))
        return value_m, np.abs(error_m)


def draw_outlines(axes: Axes, plate: PlatePreview) -> None:
    """Draw the outlines of actuators and fingertips into a map in millimetres."""
    from matplotlib.patches import Circle, Rectangle

    style = {"fill": False, "edgecolor": "white", **_outline()}
    for actuator in plate.study.actuators:
        outline: Patch
        if actuator.diameter_m is not None:
            centre_mm = (actuator.x_m * 1e3, actuator.y_m * 1e3)
            outline = Circle(centre_mm, actuator.diameter_m / 2 * 1e3, **style)
        else:
            (left_m, right_m), (lower_m, upper_m) = actuator.span_x_m, actuator.span_y_m
            corner_mm, width_mm = (left_m * 1e3, lower_m * 1e3), (right_m - left_m) * 1e3
            outline = Rectangle(corner_mm, width_mm, (upper_m - lower_m) * 1e3, **style)
        axes.add_patch(outline)
    for finger in plate.fingers:
        centre_mm = (finger.x_m * 1e3, finger.y_m * 1e3)
        axes.add_patch(Circle(centre_mm, finger.radius_m * 1e3, linestyle=_DASHES, **style))


def _outline() -> dict[str, Any]:
    """Return the style of a line that is visible on light and dark backgrounds."""
    from matplotlib.patheffects import withStroke

    return {"linewidth": 1.2, "path_effects": [withStroke(linewidth=2.4, foreground="black")]}


def outline_keys(plate: PlatePreview) -> list[Line2D]:
    """Return their legend; a contact that is hidden by the edge of a disc has no line."""
    from matplotlib.lines import Line2D

    style = {"color": "white", **_outline()}
    edges = {(one.x_m, one.y_m, (one.diameter_m or 0.0) / 2) for one in plate.study.actuators}
    if edges >= {(one.x_m, one.y_m, one.radius_m) for one in plate.fingers}:
        return [Line2D([], [], label="actuator and fingertip", **style)]
    return [
        Line2D([], [], label="actuator", **style),
        Line2D([], [], label="fingertip", linestyle=_DASHES, **style),
    ]
