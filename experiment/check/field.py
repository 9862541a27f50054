"""The field of a study's actuators: over the plate at one frequency or in time, and over a band.

`report_field` returns what `tactstrip field` prints, `field_csv` its table.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import count, takewhile, zip_longest
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from experiment.check.report import burst_text
from experiment.study.stimulus import unscaled_peak
from stimuli import causal
from stimuli.plate.response import displacement_map
from stimuli.plate.scene import Scene
from stimuli.plate.transient import transient_response

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from experiment.check.plate import Complex, PlatePreview, Real


BAND_FREQUENCIES: Final = 500
"""Default number of frequencies of a band."""

_CELLS_ACROSS: Final = 50
_CELLS_ACROSS_MOVING: Final = 12
_LOOKS: Final = 16
_MAX_LOOKS: Final = 240
_FINER: Final = 8
"""An animation has so many looks in a period, and at most so many for each actuator."""

_MAX_CELLS_ALONG: Final = 1200
_MARGIN_WIDTHS: Final = 4.0
"""A map ends with the plate, or so many widths beyond the outermost actuators."""

_NEAR_CUTOFF: Final = 0.01
"""Frequencies so near to a cut-off, in steps, are left out: the field is infinite there."""

_LEAST: Final = 1e-300


@dataclass(frozen=True, kw_only=True, eq=False)
class _Field:
    """A field of a plate, with its amplitudes at the fingertips: driven, fingertip, frequency."""

    plate: PlatePreview
    at_fingers_m: Complex
    finger_errors_m: Real

    def level_db(self, driven: int, finger: int) -> Real:
        """Return the crosstalk at a finger, see `level_db`."""
        return level_db(self.at_fingers_m[driven, driven], self.at_fingers_m[driven, finger])

    def level_error_db(self, driven: int, finger: int) -> Real:
        """Return the error of that level."""
        size_m = np.maximum(np.abs(self.at_fingers_m[driven]), _LEAST)
        factor = 1 + self.finger_errors_m[driven] / size_m
        return np.asarray(20 * np.log10(factor[driven] * factor[finger]))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateMap(_Field):
    """The displacement over the plate at one frequency, each actuator driven by itself.

    Attributes
    ----------
    plate : PlatePreview
        Whose field it is.
    frequency_hz : float
        Frequency of the drive.
    x_m, y_m : ndarray of float64, shape (n_x,) and (n_y,)
        Places along the plate, from its middle, and across it, from one edge.
    displacement_m : ndarray of complex128, shape (n_driven, n_x, n_y)
        Amplitude in metres, for the drive of the plate.
    at_fingers_m : ndarray of complex128, shape (n_driven, n_fingertips)
        The same at the centres of the fingertips.
    finger_errors_m : ndarray of float64, same shape
        Its errors.
    """

    frequency_hz: float
    x_m: Real
    y_m: Real
    displacement_m: Complex

    def peak_of(self, driven: int) -> tuple[float, float, float]:
        """Return the largest displacement of a driven actuator and its place: metres, x, y."""
        size = np.abs(self.displacement_m[driven])
        along, across = divmod(int(np.argmax(size)), self.y_m.size)
        return float(np.max(size)), float(self.x_m[along]), float(self.y_m[across])


@dataclass(frozen=True, kw_only=True, eq=False)
class PlateBand(_Field):
    """The displacement at the fingers over a band, each actuator driven by itself.

    Attributes
    ----------
    plate : PlatePreview
        Whose field it is.
    band_hz : (float, float)
        Lower and upper end.
    frequencies_hz : ndarray of float64, shape (n_frequencies,)
        Frequencies, increasing.
    at_fingers_m : ndarray of complex128, shape (n_driven, n_fingertips, n_frequencies)
        Amplitude in metres at the centres of the fingertips, for the drive of the plate.
    finger_errors_m : ndarray of float64, same shape
        Its errors.
    cutoffs_hz : tuple of float
        Cut-offs in the band of the waves that go from the actuators to the fingers.
    left_out_hz : tuple of float
        Frequencies at such a cut-off, where the field of a plate without loss is infinite.
    """

    band_hz: tuple[float, float]
    frequencies_hz: Real
    cutoffs_hz: tuple[float, ...]
    left_out_hz: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlateMotion:
    """The displacement over the plate in time, under the first condition's burst.

    Attributes
    ----------
    plate : PlatePreview
        Whose motion it is.
    times_s : ndarray of float64, shape (n_times,)
        Times in equal steps, from the beginning of the burst.
    x_m, y_m : ndarray of float64, shape (n_x,) and (n_y,)
        Places along the plate, from its middle, and across it, from one edge.
    displacement_m : ndarray of float64, shape (2, n_times, n_x, n_y)
        With the left actuator driven, then with the right one.
    finger_times_s : ndarray of float64, shape (n_finger_times,)
        Times in finer steps over the same length.
    at_fingers_m : ndarray of float64, shape (2, 2, n_finger_times)
        The same at the centres of the left and the right fingertip, at those times.
    """

    plate: PlatePreview
    times_s: Real
    x_m: Real
    y_m: Real
    displacement_m: Real
    finger_times_s: Real
    at_fingers_m: Real

    @property
    def step_s(self) -> float:
        """Time between two looks."""
        return float(self.times_s[1])


def level_db(driven_m: ArrayLike, undriven_m: ArrayLike) -> Real:
    """Return the crosstalk at an undriven finger, 20 log10 of the amplitudes.

    Examples
    --------
    >>> float(level_db(1e-6, 1e-7j))
    -20.0
    """
    driven, undriven = (np.maximum(np.abs(np.asarray(m)), _LEAST) for m in (driven_m, undriven_m))
    return np.asarray(20 * (np.log10(undriven) - np.log10(driven)))


def plate_map(plate: PlatePreview, frequency_hz: float) -> PlateMap:
    """Compute the displacement over a plate at one frequency, each actuator driven alone.

    Parameters
    ----------
    plate : PlatePreview
        The plate.
    frequency_hz : float
        Frequency from 0.

    Raises
    ------
    ValueError
        If the frequency is out of its range, or a cut-off of a plate without loss.

    Examples
    --------
    Below the cut-off the plate moves most above the driven actuator:

    >>> from experiment.check.plate import PlatePreview
    >>> from experiment.study.files import paper_study
    >>> paper = paper_study()
    >>> endless = paper.changed(strip=paper.plate.changed(length_mm="endless"))
    >>> field = plate_map(PlatePreview(endless), 500.0)
    >>> [round(1e3 * place_m, 6) for place_m in field.peak_of(0)[1:]]
    [-35.0, 12.5]
    """
    x_m, y_m = _grid(plate)
    field = displacement_map(plate.strip, plate.loads, frequency_hz, x_m=x_m, y_m=y_m)
    at_fingers_m, errors_m = plate.at_fingers_m([frequency_hz])
    return PlateMap(
        plate=plate,
        frequency_hz=frequency_hz,
        x_m=x_m,
        y_m=y_m,
        displacement_m=plate.scaled(field.value),
        at_fingers_m=at_fingers_m[..., 0],
        finger_errors_m=errors_m[..., 0],
    )


def plate_motion(plate: PlatePreview) -> PlateMotion:
    """Compute the displacement over a plate in time, one actuator driven after the other.

    The time shown is that of the first condition's burst and half as much after it, at least a
    period, in steps of 1, 2 or 5 times a power of ten that are a sixteenth of a period or less.

    Parameters
    ----------
    plate : PlatePreview
        The plate.

    Raises
    ------
    ValueError
        If the plate has too many modes for that.

    Examples
    --------
    The burst stays above the driven actuator:

    >>> from experiment.check.plate import PlatePreview
    >>> from experiment.study.files import paper_study
    >>> field = plate_motion(PlatePreview(paper_study()))
    >>> own_m, other_m = abs(field.at_fingers_m[0]).max(axis=1)
    >>> field.step_s, field.times_s.size, bool(other_m < 0.1 * own_m)
    (0.0001, 41, True)
    """
    condition = plate.study.conditions[0]
    drive, loads = condition.drive, plate.loads[: len(plate.fingers)]
    x_m, y_m = _grid(plate, _CELLS_ACROSS_MOVING)
    points_m = [(x, y) for x in x_m.tolist() for y in y_m.tolist()]
    points_m += [(finger.x_m, finger.y_m) for finger in plate.fingers]
    scene = Scene(strip=causal(plate.strip, drive), loads=loads, points_m=tuple(points_m))
    step_s = _round_down(1 / (_LOOKS * max(plate.drive_hz, drive.band_hz()[1] / 2)))
    after_s = max(drive.duration_s / 2, 1 / plate.drive_hz)
    end_s = min(drive.duration_s + after_s, _MAX_LOOKS * step_s)
    n_times = math.floor(_FINER * end_s / step_s + 1e-9) + 1
    times_s = (step_s / _FINER * np.arange(n_times)).astype(np.float64)
    moved_m = np.moveaxis(transient_response(scene, drive, times_s).value, 0, -1)
    amplitudes = np.array(plate.amplitudes[: len(loads)])
    moved_m *= amplitudes[:, np.newaxis, np.newaxis] / unscaled_peak(condition, plate.study.device)
    over_m = moved_m[:, : x_m.size * y_m.size, ::_FINER]
    return PlateMotion(
        plate=plate,
        times_s=times_s[::_FINER],
        x_m=x_m,
        y_m=y_m,
        displacement_m=np.moveaxis(over_m, 2, 1).reshape(len(loads), -1, x_m.size, y_m.size),
        finger_times_s=times_s,
        at_fingers_m=moved_m[:, x_m.size * y_m.size :],
    )


def _round_down(step_s: float) -> float:
    """Return the largest number of 1, 2 or 5 times a power of ten that is not larger.

    >>> _round_down(1.25e-4), _round_down(6e-5)
    (0.0001, 5e-05)
    """
    power = math.floor(math.log10(step_s))
    return max(
        float(f"{digit}e{power}") for digit in (1, 2, 5) if float(f"{digit}e{power}") <= step_s
    )


def _grid(plate: PlatePreview, cells_across: int = _CELLS_ACROSS) -> tuple[Real, Real]:
    """Return the places of a map; the middle, the ends and both edges are among them."""
    width_m, length_m = plate.strip.width_m, plate.study.strip.length_m
    step_m = width_m / cells_across
    reach_m = max(abs(load.x_m) + load.half_size_m[0] for load in plate.loads)
    cells = math.ceil((reach_m + _MARGIN_WIDTHS * width_m) / step_m)
    if length_m is not None and length_m / 2 <= cells * step_m:
        cells = max(1, round(length_m / 2 / step_m))
        step_m = length_m / 2 / cells
    kept = min(cells, _MAX_CELLS_ALONG // 2)
    x_m = step_m * cells / kept * np.arange(-kept, kept + 1)
    return x_m.astype(np.float64), np.linspace(0.0, width_m, cells_across + 1)


def plate_band(
    plate: PlatePreview, band_hz: tuple[float, float], *, n_frequencies: int = BAND_FREQUENCIES
) -> PlateBand:
    r"""Compute the displacement at the fingers over a band, each actuator driven alone.

    Parameters
    ----------
    plate : PlatePreview
        The plate.
    band_hz : (float, float)
        Lower and upper end, both in the band.
    n_frequencies : int
        Frequencies in equal steps, at least two; those at a cut-off of a plate without loss
        are left out.

    Raises
    ------
    ValueError
        If the band is not increasing or leaves the range of the field.

    Examples
    --------
    Without ends and loss the plate's own cut-off is left out, where the field is infinite:

    >>> from experiment.check.plate import PlatePreview
    >>> from experiment.study.files import paper_study
    >>> paper = paper_study()
    >>> study = paper.changed(strip=paper.plate.changed(length_mm="endless"))
    >>> field = plate_band(PlatePreview(study), (400.0, 2900.0), n_frequencies=6)
    >>> field.frequencies_hz.tolist(), len(field.left_out_hz)
    ([400.0, 900.0, 1400.0, 1900.0, 2400.0], 1)
    """
    lower_hz, upper_hz = band_hz
    if not (0 <= lower_hz < upper_hz < math.inf):
        raise ValueError(
            "band must be two frequencies LO < HI in Hz, LO >= 0; "
            f"got {lower_hz:.12g} {upper_hz:.12g}"
        )
    plate.scene.check_frequencies([lower_hz, upper_hz])
    frequencies_hz = np.linspace(lower_hz, upper_hz, n_frequencies)
    # Loads off the centre line alone excite the waves of even order.
    middle_m = plate.strip.width_m / 2
    antisymmetric = any(load.y_m != middle_m for load in plate.loads)
    every_cutoff_hz = map(plate.strip.cutoff_hz, count(1, 1 if antisymmetric else 2))
    cutoffs_hz = tuple(takewhile(lambda cutoff_hz: cutoff_hz <= upper_hz, every_cutoff_hz))
    steps = (frequencies_hz[:, np.newaxis] - cutoffs_hz) / (frequencies_hz[1] - frequencies_hz[0])
    near = np.any(np.abs(steps) < _NEAR_CUTOFF, axis=1) & plate.is_lossless
    at_fingers_m, errors_m = plate.at_fingers_m(frequencies_hz[~near])
    return PlateBand(
        plate=plate,
        band_hz=band_hz,
        frequencies_hz=frequencies_hz[~near],
        at_fingers_m=at_fingers_m,
        finger_errors_m=errors_m,
        cutoffs_hz=tuple(cutoff_hz for cutoff_hz in cutoffs_hz if cutoff_hz >= lower_hz),
        left_out_hz=tuple(frequencies_hz[near].tolist()),
    )


# --- its report and its table ---------------------------------------------------------------------

FRAMES_PER_S: Final = 20
"""Of an animation."""

_PLATEAU_DB: Final = 0.1
"""The first frequency within this of the largest level is reported: a plateau has no top."""


def report_field(field: PlateMap | PlateBand | PlateMotion, file_name: str) -> dict[str, Any]:
    """Report what a field shows; see `_report_driven` for each actuator.

    Examples
    --------
    >>> from experiment.check.plate import PlatePreview
    >>> from experiment.study.files import paper_study
    >>> paper = paper_study()
    >>> endless = paper.changed(strip=paper.plate.changed(length_mm="endless"))
    >>> _, right = report_field(plate_map(PlatePreview(endless), 500.0), "study.toml")["driven"]
    >>> [round(value, 2) for value in (*right["shown_db"], right["peak_um"])]
    [-90.85, 5.25]
    """
    plate = field.plate
    study = plate.study
    condition = study.conditions[0]
    return {
        "kind": {PlateMap: "map", PlateBand: "band", PlateMotion: "motion"}[type(field)],
        "file": file_name,
        "study": study.name,
        "condition": condition.name,
        "burst": burst_text(condition),
        "cutoff_hz": plate.strip.cutoff_hz(),
        "edge": study.plate.edge,
        "load": plate.load,
        "loss_factor": plate.strip.material.loss_factor,
        "loss_basis": plate.loss_basis,
        "omits_finger_load": study.finger_load.impedance is not None,
        "unused": [] if plate.level_vpp else [*plate.loads_per_volt],
        "limit_db": -plate.masking_threshold_db,
        "driven": [
            {
                "name": name,
                "burst_db": level_db,
                "burst_error_db": error_db,
                **_report_driven(field, driven),
            }
            for driven, (name, (level_db, error_db)) in enumerate(
                zip_longest(
                    plate.names[: len(field.at_fingers_m)],
                    plate.burst_levels_db,
                    fillvalue=(None, None),
                )
            )
        ],
        **_extent(field),
    }


def _extent(field: PlateMap | PlateBand | PlateMotion) -> dict[str, Any]:
    """Return at which places, frequencies or times a field is."""
    if isinstance(field, PlateMap):
        return {"frequency_hz": field.frequency_hz, "x_mm": (field.x_m[[0, -1]] * 1e3).tolist()}
    if isinstance(field, PlateMotion):
        end_s = float(field.times_s[-1])
        return {"end_s": end_s, "step_s": field.step_s, "slowdown": slowdown(field)}
    infinite_hz = field.cutoffs_hz if field.plate.is_lossless else ()
    return {
        "band_hz": field.band_hz,
        "frequencies": field.frequencies_hz.size,
        "left_out_hz": field.left_out_hz,
        "infinite_at_hz": [hz for hz in infinite_hz if hz not in field.left_out_hz],
    }


def _report_driven(field: PlateMap | PlateBand | PlateMotion, driven: int) -> dict[str, Any]:
    """Return what is shown of one driven actuator.

    `shown_db` is the crosstalk at each undriven finger: of the tone, the largest over the band (at
    `shown_hz`), or that of the peaks in the animation. `peak_um` is the largest displacement over
    the map or at the driven finger. Over a band, `crossings_hz` are the frequencies from which on
    tones exceed the limit, None if they do not.
    """
    others = field.plate.others_of(driven)
    names = {"fingers": [field.plate.names[other] for other in others]}
    return names | _report_fingers(field, driven, others)


def _report_fingers(
    field: PlateMap | PlateBand | PlateMotion, driven: int, others: tuple[int, ...]
) -> dict[str, Any]:
    """Return what is shown at the driven finger and at each of the others."""
    if isinstance(field, PlateMap):
        peak_m, x_m, y_m = field.peak_of(driven)
        return {
            "shown_db": [float(field.level_db(driven, other)) for other in others],
            "shown_error_db": [float(field.level_error_db(driven, other)) for other in others],
            "peak_um": peak_m * 1e6,
            "peak_x_mm": x_m * 1e3,
            "peak_y_mm": y_m * 1e3,
        }
    if isinstance(field, PlateMotion):
        peaks_m = np.max(np.abs(field.at_fingers_m[driven]), axis=1)
        return {
            "shown_db": [float(level_db(peaks_m[driven], peaks_m[other])) for other in others],
            "shown_error_db": [None for _ in others],
            "peak_um": float(peaks_m[driven]) * 1e6,
        }
    frequencies_hz, limit_db = field.frequencies_hz, -field.plate.masking_threshold_db
    size_m = np.abs(field.at_fingers_m[driven, driven])
    largest = int(np.argmax(size_m))
    levels_db = [field.level_db(driven, other) for other in others]
    tops = [int(np.argmax(level > np.max(level) - _PLATEAU_DB)) for level in levels_db]
    errors_db = [field.level_error_db(driven, other) for other in others]
    return {
        "shown_db": [float(level[top]) for level, top in zip(levels_db, tops, strict=True)],
        "shown_error_db": [float(error[top]) for error, top in zip(errors_db, tops, strict=True)],
        "shown_hz": frequencies_hz[tops].tolist(),
        "crossings_hz": [_crossing_hz(frequencies_hz, level, limit_db) for level in levels_db],
        "peak_um": float(size_m[largest]) * 1e6,
        "peak_hz": float(frequencies_hz[largest]),
    }


def _crossing_hz(frequencies_hz: Real, levels_db: Real, limit_db: float) -> float | None:
    """Return where a level first exceeds a limit, on the line between two frequencies.

    >>> round(_crossing_hz(np.array([100.0, 110.0]), np.array([-24.0, -19.0]), -20.0), 1)
    108.0
    """
    above = np.flatnonzero(levels_db > limit_db)
    if not above.size:
        return None
    after = int(above[0])
    if not after:
        return float(frequencies_hz[0])
    ends = slice(after - 1, after + 1)
    return float(np.round(np.interp(limit_db, levels_db[ends], frequencies_hz[ends]), 1))


def slowdown(field: PlateMotion) -> float:
    """Return how much longer an animation takes than the motion that it shows."""
    return float(f"{1 / (FRAMES_PER_S * field.step_s):.3g}")


def field_csv(field: PlateMap | PlateBand) -> str:
    """Write a field as CSV: a row for each place of a map, or for each frequency of a band.

    Numbers are in full precision; displacements are amplitudes with the time factor
    exp(-i omega t), as real part, imaginary part and magnitude.

    Examples
    --------
    >>> from experiment.check.plate import PlatePreview
    >>> from experiment.study.files import paper_study
    >>> band = plate_band(PlatePreview(paper_study()), (100.0, 500.0), n_frequencies=9)
    >>> head, first, *_ = field_csv(band).splitlines()
    >>> head.split(",")[:2], first.split(",")[0]
    (['frequency_hz', 'left_driven_at_left_re_um'], '100.0')
    """
    import pandas as pd

    plate = field.plate
    names = [f"{name}_driven" for name in plate.names]
    where: Sequence[Real]
    if isinstance(field, PlateMap):
        columns = ["frequency_hz", "x_mm", "y_mm"]
        where = np.meshgrid(field.frequency_hz, field.x_m * 1e3, field.y_m * 1e3, indexing="ij")
        values_m = field.displacement_m.reshape(len(names), -1)
    else:
        columns, where = ["frequency_hz"], [field.frequencies_hz]
        names = [f"{name}_at_{finger}" for name in names for finger in plate.names]
        values_m = field.at_fingers_m.reshape(len(names), -1)
    unit = "um_per_unit_load" if plate.level_vpp is None else "um"
    columns += [f"{name}_{value}_{unit}" for name in names for value in ("re", "im", "abs")]
    constants = {
        "level_vpp": "n/a" if plate.level_vpp is None else f"{plate.level_vpp:g}",
        "load_unit": plate.load_units,
        "loss_factor": f"{plate.strip.material.loss_factor:g}",
        "loss_basis": plate.loss_basis,
    }
    numbers = [axis.ravel() for axis in where]
    for value in values_m * 1e6:
        numbers += [value.real, value.imag, np.abs(value)]
    table = pd.DataFrame(np.transpose(numbers), columns=columns).assign(**constants)
    return table.to_csv(index=False, lineterminator="\n")
