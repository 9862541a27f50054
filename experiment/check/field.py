"""The field of a study's actuators: over the plate at one frequency or in time, and over a band."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import count, takewhile
from typing import TYPE_CHECKING, Final, TypeVar

import numpy as np

from experiment.check.plate import RTOL
from experiment.study.stimulus import unscaled_peak
from stimuli import Scene, causal, displacement_map
from stimuli.motion.history import frames_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from experiment.check.plate import Complex, PlatePreview, Real


BAND_FREQUENCIES: Final = 500
"""Frequencies of a band unless told otherwise."""

_CELLS_ACROSS: Final = 50
_CELLS_ACROSS_MOVING: Final = 12
_LOOKS: Final = 16
_MOST_LOOKS: Final = 240
_FINER: Final = 8
"""An animation has so many looks in a period, and at most so many for each actuator."""

_MOST_CELLS_ALONG: Final = 1200
_MARGIN_WIDTHS: Final = 4.0
"""A map ends with the plate, or so many widths beyond the outermost actuators."""

_NEAR_CUTOFF: Final = 0.01
"""Frequencies so near to a cut-off, in steps, are left out: the field is infinite there."""

_LEAST: Final = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlateMap:
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
    bursts_db : tuple of float
        Level of the first condition's burst at the other finger, of the left and of the right
        actuator, as the check has it; empty where that is not known. So for any field.
    """

    plate: PlatePreview
    frequency_hz: float
    x_m: Real
    y_m: Real
    displacement_m: Complex
    at_fingers_m: Complex
    bursts_db: tuple[float, ...] = ()

    def level_db(self, driven: int, other: int) -> float:
        """Return the level at another finger re above the driven actuator, see `level_db`."""
        return float(level_db(self.at_fingers_m[driven, driven], self.at_fingers_m[driven, other]))

    def peak_of(self, driven: int) -> tuple[float, float, float]:
        """Return the largest displacement of a driven actuator and its place: metres, x, y."""
        size = np.abs(self.displacement_m[driven])
        along, across = divmod(int(np.argmax(size)), self.y_m.size)
        return float(np.max(size)), float(self.x_m[along]), float(self.y_m[across])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlateBand:
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
    cutoffs_hz : tuple of float
        Cut-offs in the band of the waves that go from the actuators to the fingers.
    left_out_hz : tuple of float
        Frequencies at such a cut-off, where the field of a plate without loss is infinite.
    """

    plate: PlatePreview
    band_hz: tuple[float, float]
    frequencies_hz: Real
    at_fingers_m: Complex
    cutoffs_hz: tuple[float, ...]
    left_out_hz: tuple[float, ...]
    bursts_db: tuple[float, ...] = ()

    def level_db(self, driven: int, other: int) -> Real:
        """Return the level at another finger re above the driven actuator, at each frequency."""
        return level_db(self.at_fingers_m[driven, driven], self.at_fingers_m[driven, other])


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
    bursts_db: tuple[float, ...] = ()

    @property
    def step_s(self) -> float:
        """Time between two looks."""
        return float(self.times_s[1])


def level_db(own_m: ArrayLike, other_m: ArrayLike) -> Real:
    """Return the level at another finger re above the driven actuator, 20 log10 of the amplitudes.

    Examples
    --------
    >>> float(level_db(1e-6, 1e-7j))
    -20.0
    """
    own, other = (np.maximum(np.abs(np.asarray(m)), _LEAST) for m in (own_m, other_m))
    return np.asarray(20 * (np.log10(other) - np.log10(own)))


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

    >>> from experiment.check.plate import plate_of
    >>> from experiment.study.files import study_from_text
    >>> endless = study_from_text('strip = {length_mm = "endless"}', "study.toml")
    >>> found = plate_map(plate_of(endless), 500.0)
    >>> [round(1e3 * place_m, 6) for place_m in found.peak_of(0)[1:]]
    [-35.0, 12.5]
    """
    x_m, y_m = _grid(plate)
    found = displacement_map(plate.strip, plate.loads, frequency_hz, x_m=x_m, y_m=y_m, rtol=RTOL)
    return PlateMap(
        plate=plate,
        frequency_hz=found.frequency_hz,
        x_m=found.x_m,
        y_m=found.y_m,
        displacement_m=plate.scaled(found.displacement_m),
        at_fingers_m=plate.at_fingers_m([found.frequency_hz])[..., 0],
    )


Field = TypeVar("Field", PlateMap, PlateBand, PlateMotion)


def with_bursts(field: Field) -> Field:
    """Return a field with the levels of the burst; as it is, where the study cannot be checked."""
    from experiment.check.check import check_study

    try:
        found = check_study(field.plate.study).conditions[0]
        return replace(field, bursts_db=(found.level_db(1, 0), found.level_db(0, 1)))
    except ValueError:  # which the check tells
        return field


def plate_motion(plate: PlatePreview) -> PlateMotion:
    """Compute the displacement over a plate in time, the left actuator driven, then the right one.

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

    >>> from experiment.check.plate import plate_of
    >>> from experiment.study.files import paper_study
    >>> found = plate_motion(plate_of(paper_study()))
    >>> own_m, other_m = abs(found.at_fingers_m[0]).max(axis=1)
    >>> found.step_s, found.times_s.size, bool(other_m < 0.1 * own_m)
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
    end_s = min(drive.duration_s + after_s, _MOST_LOOKS * step_s)
    times_s, found_m = frames_of(scene, drive, step_s=step_s / _FINER, end_s=end_s)
    amplitudes = np.array(plate.drive.amplitudes[: len(loads)])
    found_m *= amplitudes[:, np.newaxis, np.newaxis] / unscaled_peak(condition, plate.study.device)
    over_m = found_m[:, : x_m.size * y_m.size, ::_FINER]
    return PlateMotion(
        plate=plate,
        times_s=times_s[::_FINER],
        x_m=x_m,
        y_m=y_m,
        displacement_m=np.moveaxis(over_m, 2, 1).reshape(len(loads), -1, x_m.size, y_m.size),
        finger_times_s=times_s,
        at_fingers_m=found_m[:, x_m.size * y_m.size :],
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
    kept = min(cells, _MOST_CELLS_ALONG // 2)
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

    >>> from experiment.check.plate import plate_of
    >>> from experiment.study.files import study_from_text
    >>> study = study_from_text('[strip]\nlength_mm = "endless"', "study.toml")
    >>> found = plate_band(plate_of(study), (400.0, 2900.0), n_frequencies=6)
    >>> found.frequencies_hz.tolist(), len(found.left_out_hz)
    ([400.0, 900.0, 1400.0, 1900.0, 2400.0], 1)
    """
    lower_hz, upper_hz = band_hz
    if not (0 <= lower_hz < upper_hz < math.inf):
        raise ValueError(
            "band must be two frequencies LO < HI in Hz, LO >= 0; "
            f"got {lower_hz:.12g} {upper_hz:.12g}"
        )
    plate.scene.checked([lower_hz, upper_hz], RTOL)
    asked_hz = np.linspace(lower_hz, upper_hz, n_frequencies)
    cutoffs_hz = _cutoffs_hz(plate, upper_hz)
    near = _near_cutoffs(plate, asked_hz, cutoffs_hz)
    return PlateBand(
        plate=plate,
        band_hz=band_hz,
        frequencies_hz=asked_hz[~near],
        at_fingers_m=plate.at_fingers_m(asked_hz[~near]),
        cutoffs_hz=tuple(cutoff_hz for cutoff_hz in cutoffs_hz if cutoff_hz >= lower_hz),
        left_out_hz=tuple(asked_hz[near].tolist()),
    )


def _cutoffs_hz(plate: PlatePreview, highest_hz: float) -> tuple[float, ...]:
    """Return the cut-offs of the waves that go from the loads to the fingers."""
    antisymmetric = any(-1 in job.signs for job in plate.scene.jobs())
    modes = count(1, 1 if antisymmetric else 2)
    return tuple(
        takewhile(lambda cutoff_hz: cutoff_hz <= highest_hz, map(plate.strip.cutoff_hz, modes))
    )


def _near_cutoffs(
    plate: PlatePreview, frequencies_hz: Real, cutoffs_hz: tuple[float, ...]
) -> NDArray[np.bool_]:
    """Tell which frequencies all but meet a cut-off where a plate without loss has no field."""
    material = plate.strip.material
    near = np.zeros(frequencies_hz.size, dtype=np.bool_)
    if material.loss_factor or material.viscous_time_s:
        return near
    step_hz = float(frequencies_hz[1] - frequencies_hz[0])
    for cutoff_hz in cutoffs_hz:
        near |= np.abs(frequencies_hz - cutoff_hz) < _NEAR_CUTOFF * step_hz
    return near
