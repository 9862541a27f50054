"""The field of a study's actuators as a CSV table, and its headline in words."""

from __future__ import annotations

import csv
import io
import math
import textwrap
from typing import TYPE_CHECKING, Final

import numpy as np

from experiment.check.check_report import burst_words
from experiment.check.displacements import tell_ideal
from experiment.check.field import PlateBand, PlateMap, PlateMotion
from experiment.check.findings import Findings
from experiment.study.sources import cutoff_source, in_short

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from experiment.check.plate import PlatePreview


_TONE: Final = "tone: at the other finger's centre re above the driven actuator, of"
_SHOWN: Final = (
    "shown: of the peaks at the fingers' centres in this time, of one loss factor, to 1e-5 of the "
    "own finger's"
)
_PREFIXES: Final = (("mm", 1e-3), ("um", 1e-6), ("nm", 1e-9), ("pm", 1e-12))

_PLATEAU_DB: Final = 0.1
"""The first frequency within so much of the largest level is named: a plateau has no top."""


def field_csv(field: PlateMap | PlateBand) -> str:
    """Write a field as CSV: a row for each place of a map, or for each frequency of a band.

    Parameters
    ----------
    field : PlateMap or PlateBand
        The field.

    Returns
    -------
    str
        Numbers in full precision; displacements are amplitudes with the time factor
        exp(-i omega t), as real part, imaginary part and magnitude.

    Examples
    --------
    >>> from experiment.check.plate import plate_of
    >>> from experiment.check.field import plate_band
    >>> from experiment.study.files import paper_study
    >>> found = plate_band(plate_of(paper_study()), (100.0, 500.0), n_frequencies=9)
    >>> head, first, *_ = field_csv(found).splitlines()
    >>> head.split(",")[:2]
    ['frequency_hz', 'left_driven_at_left_re_um']
    >>> first.split(",")[0], "per volt: measured by the paper; loss factor" in first
    ('100.0', True)
    """
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    rows = _map_rows(field) if isinstance(field, PlateMap) else _band_rows(field)
    writer.writerows(rows)
    return table.getvalue()


def _map_rows(field: PlateMap) -> Iterable[list[str]]:
    plate = field.plate
    names = [f"{name}_driven" for name in plate.drive.names]
    yield ["frequency_hz", "x_mm", "y_mm", *_columns(plate, names), "basis"]
    for i, x_m in enumerate(field.x_m):
        for j, y_m in enumerate(field.y_m):
            places = [field.frequency_hz, x_m * 1e3, y_m * 1e3]
            yield [*_numbers(places, field.displacement_m[:, i, j]), plate.basis]


def _band_rows(field: PlateBand) -> Iterable[list[str]]:
    plate = field.plate
    names = [f"{name}_driven_at_{at}" for name in plate.drive.names for at in plate.drive.names]
    yield ["frequency_hz", *_columns(plate, names), "basis"]
    for k, frequency_hz in enumerate(field.frequencies_hz):
        yield [*_numbers([frequency_hz], field.at_fingers_m[..., k].ravel()), plate.basis]


def _columns(plate: PlatePreview, names: list[str]) -> list[str]:
    unit = "um_per_unit_load" if plate.drive.level_vpp is None else "um"
    return [f"{name}_{part}_{unit}" for name in names for part in ("re", "im", "abs")]


def _numbers(places: list[float], values_m: NDArray[np.complex128]) -> list[str]:
    parts = [part for u in values_m * 1e6 for part in (u.real, u.imag, abs(u))]
    return [repr(float(number)) for number in (*places, *parts)]


def field_text(field: PlateMap | PlateBand | PlateMotion, file_name: str) -> str:
    """Say in a few lines what a field shows.

    Parameters
    ----------
    field : PlateMap, PlateBand or PlateMotion
        The field.
    file_name : str
        Where the study was read from.

    Examples
    --------
    >>> from experiment.check.plate import plate_of
    >>> from experiment.check.field import plate_map
    >>> from experiment.study.files import study_from_text
    >>> endless = study_from_text('strip = {length_mm = "endless"}', "study.toml")
    >>> told = field_text(plate_map(plate_of(endless), 500.0), "study.toml")
    >>> print(told.splitlines()[-1].removesuffix(" of the map's grid"))
    right driven   left finger: tone -90.8 dB; at most 5.25 um, at x = 35, y = 12.5 mm
    """
    plate = field.plate
    found = Findings()
    found.tell("study", f"{plate.study.name} ({file_name})")
    found.tell("strip", strip_text(plate))
    found.tell("basis", plate.remark)
    if plate.drive.doubt:
        found.tell("", plate.drive.doubt)
    if isinstance(field, PlateMap):
        _tell_map(found, field)
    elif isinstance(field, PlateMotion):
        _tell_motion(found, field)
    else:
        _tell_band(found, field)
    return found.text


def _tell_map(found: Findings, field: PlateMap) -> None:
    drive = field.plate.drive
    ends_mm = (field.x_m[[0, -1]] * 1e3).tolist()
    found.tell("map", f"{hertz(field.frequency_hz)}, x from {ends_mm[0]:g} to {ends_mm[1]:g} mm")
    _tell_levels(found, field, f"{_TONE} {hertz(field.frequency_hz)}")
    for driven, name in enumerate(drive.names):
        peak_m, x_m, y_m = field.peak_of(driven)
        place = f"x = {x_m * 1e3:.3g}, y = {y_m * 1e3:.3g} mm of the map's grid"
        most = f"at most {metres(peak_m)}{drive.per_load(driven)}, at {place}"
        levels = [
            f"{field.plate.places[other]}: {_burst(field, driven)}"
            f"tone {decibels(field.level_db(driven, other))}"
            for other in field.plate.others_of(driven)
        ]
        found.tell(f"{name} driven", "; ".join([*levels, most]))


def _tell_levels(found: Findings, field: PlateMap | PlateBand | PlateMotion, beside: str) -> None:
    """Say which levels are told, first those that decide."""
    if not field.bursts_db:
        found.tell("levels", f"{beside}; of the burst: check")
        return
    decides = f"as check has it, which decides; the limit is -{field.plate.masking_limit_db:g} dB"
    found.tell("levels", f"{burst_name(field.plate)}: at the other finger, {decides}")
    found.tell("", beside)
    tell_ideal(found, field.bursts_db)


def _burst(field: PlateMap | PlateBand | PlateMotion, driven: int) -> str:
    """Say the level of the burst, before another one."""
    return "".join(f"burst {decibels(one)}, " for one in field.bursts_db[driven : driven + 1])


def burst_name(plate: PlatePreview) -> str:
    """Name the first condition's burst."""
    first, *others = plate.study.conditions
    return f"burst of {first.name}" if others else "burst"


def map_title(field: PlateMap, driven: int) -> list[str]:
    """Say above a panel how far the plate moves, and what the other finger gets of it."""
    plate, levels = field.plate, levels_text(field, driven)
    largest = f"{metres(field.peak_of(driven)[0])}{plate.drive.per_load(driven)}"
    name = plate.drive.names[driven]
    told = [f"{name} actuator driven: largest {largest}; {levels} re above the actuator (tone)"]
    if driven < len(field.bursts_db):
        (other,) = plate.others_of(driven)
        level = f"{plate.places[other]} {decibels(field.bursts_db[driven])}"
        limit = f"limit -{plate.masking_limit_db:g} dB"
        told.append(f"{burst_name(plate)}, which decides: {level} (as in check; {limit})")
    return [one.replace("um", "µm").replace(" -", " −") for one in told]


def in_lines(text: str, width_in: float, letters_per_in: float) -> str:
    """Break a text that is too long for a figure.

    >>> in_lines("measured by the paper", 2.0, 7.0).splitlines()
    ['measured by', 'the paper']
    """
    return textwrap.fill(text, int(width_in * letters_per_in))


def _tell_motion(found: Findings, field: PlateMotion) -> None:
    plate, largest_m = field.plate, np.max(np.abs(field.at_fingers_m), axis=2)
    found.tell("burst", burst_words(plate.study.conditions[0]))
    found.tell(
        "shown",
        f"0 to {field.times_s[-1] * 1e3:g} ms in steps of {field.step_s * 1e3:g} ms, "
        f"slowed {slowed(field):g} times",
    )
    _tell_levels(found, field, _SHOWN)
    for driven, own_m in enumerate(np.diag(largest_m)):
        unit = plate.drive.per_load(driven)
        (other,) = plate.others_of(driven)
        other_m = float(largest_m[driven, other])
        level_db = 20 * math.log10(other_m / own_m) if other_m else -math.inf
        found.tell(
            f"{plate.drive.names[driven]} driven",
            f"{plate.places[other]}: {_burst(field, driven)}shown {decibels(level_db)}; at most "
            f"{metres(float(own_m))}{unit} above the actuator, {metres(other_m)}{unit} at the "
            "finger",
        )


FRAMES_PER_S: Final = 20
"""Of an animation."""


def slowed(field: PlateMotion) -> float:
    """Return how much longer an animation takes than what it shows."""
    return float(f"{1 / (FRAMES_PER_S * field.step_s):.3g}")


def levels_text(field: PlateMap, driven: int) -> str:
    """Say how much the fingers get that are not above a driven actuator."""
    others = field.plate.others_of(driven)
    return ", ".join(
        f"{field.plate.places[other]} {decibels(field.level_db(driven, other))}" for other in others
    )


def _tell_band(found: Findings, field: PlateBand) -> None:
    drive, asked_hz = field.plate.drive, field.frequencies_hz
    ends = f"{hertz(field.band_hz[0])} to {hertz(field.band_hz[1])}"
    found.tell("band", f"{ends}, {asked_hz.size} frequencies")
    for cutoff_hz in field.left_out_hz:
        found.tell("left out", f"{hertz(cutoff_hz)}, a cut-off: infinite without loss")
    material = field.plate.strip.material
    between = [f for f in field.cutoffs_hz if f not in field.left_out_hz]
    if between and not (material.loss_factor or material.viscous_time_s):
        told = ", ".join(hertz(cutoff_hz) for cutoff_hz in between)
        found.tell("not shown", f"without loss the field grows without end towards {told}")
    _tell_levels(found, field, f"{_TONE} each frequency")
    for driven, name in enumerate(drive.names):
        size_m = np.abs(field.at_fingers_m[driven, driven])
        largest = int(np.argmax(size_m))
        told = f"{metres(float(size_m[largest]))}{drive.per_load(driven)} above the actuator"
        for other in field.plate.others_of(driven):
            found.tell(f"{name} driven", _loudest(field, driven, other))
        found.tell("", f"largest {told}, at {hertz(asked_hz[largest])}")


def _loudest(field: PlateBand, driven: int, other: int) -> str:
    """Say where another finger gets most, and from where on it gets more than it may."""
    asked_hz, level = field.frequencies_hz, field.level_db(driven, other)
    limit_db = field.plate.masking_limit_db
    loudest = int(np.argmax(level > np.max(level) - _PLATEAU_DB))
    above = np.flatnonzero(level > -limit_db)
    first = (
        f"first at {hertz(_crossing_hz(asked_hz, level, -limit_db))}" if above.size else "nowhere"
    )
    most = f"tone largest {decibels(level[loudest])}, at {hertz(asked_hz[loudest])}"
    levels = f"{_burst(field, driven)}{most}; above -{limit_db:g} dB {first}"
    return f"{field.plate.places[other]}: {levels}"


def _crossing_hz(
    asked_hz: NDArray[np.float64], level_db: NDArray[np.float64], limit_db: float
) -> float:
    """Return where a level first comes above a limit, on the line between two frequencies.

    >>> round(_crossing_hz(np.array([100.0, 110.0]), np.array([-24.0, -19.0]), -20.0), 1)
    108.0
    """
    after = int(np.argmax(level_db > limit_db))
    if not after:
        return float(asked_hz[0])
    ends = slice(after - 1, after + 1)
    return float(np.round(np.interp(limit_db, level_db[ends], asked_hz[ends]), 1))


def strip_text(plate: PlatePreview) -> str:
    """Name the first cut-off of a plate and its edges.

    Examples
    --------
    >>> from experiment.check.plate import plate_of
    >>> from experiment.study.files import paper_study
    >>> strip_text(plate_of(paper_study()))
    'cut-off 2900 Hz (measured by the paper), elastic edges'
    """
    cutoff = f"cut-off {plate.strip.cutoff_hz():.5g} Hz"
    basis = plate.study.plate.edge
    if basis == "measured-cutoff":
        told = in_short(cutoff_source(plate.study.plate), plate.study.plate)
        return f"{cutoff} ({told}), elastic edges"
    return f"{cutoff}, {basis} edges".replace("simply-", "simply ")


def hertz(frequency_hz: float) -> str:
    """Write a frequency with up to six digits.

    Examples
    --------
    >>> hertz(2900.0000000000005), hertz(1926.03136910769)
    ('2900 Hz', '1926.03 Hz')
    """
    return f"{frequency_hz:.6g} Hz"


def decibels(level: float) -> str:
    """Write a level to a tenth of a decibel; one that nothing can measure by a bound.

    Examples
    --------
    >>> decibels(-90.845), decibels(-0.01), decibels(-934.5)
    ('-90.8 dB', '0.0 dB', 'below -200 dB')
    """
    if level < _NOTHING_DB:
        return f"below {_NOTHING_DB:g} dB"
    return f"{round(level, 1) + 0.0:.1f} dB"


_NOTHING_DB: Final = -200.0


def metres(size_m: float) -> str:
    """Write a displacement with three digits and a prefix that suits it.

    Examples
    --------
    >>> metres(2.6e-6), metres(7.962e-10), metres(0.0)
    ('2.6 um', '796 pm', '0 pm')
    """
    unit, factor = prefixed(size_m)
    return f"{size_m / factor:.3g} {unit}"


def prefixed(size_m: float) -> tuple[str, float]:
    """Return the unit that suits a displacement, and its size in metres.

    Examples
    --------
    >>> prefixed(2.6e-6)
    ('um', 1e-06)
    """
    return next((pair for pair in _PREFIXES if abs(size_m) >= pair[1]), _PREFIXES[-1])
