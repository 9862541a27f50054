"""What fingertips feel of each actuator: peak displacements over their contact areas.

A fingertip that presses on the plate adds forces. With the receptance H of the plate, on means of
the displacement over contact areas, and the impedance Z of each fingertip, those means are
w = (1 + H_ff Z)^-1 H_fl under the loads, and the forces are -Z w: exact for any linear impedance.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np
import scipy.linalg

from stimuli.checks import instance
from stimuli.drive.sampled import Drive
from stimuli.errors import PlateError, Rule
from stimuli.fingers.fingertip import causal, checked_fingertips
from stimuli.load import PointForce, PressureDisc
from stimuli.plate.line import gauss_rule
from stimuli.plate.response import MISSED, Estimate, estimate, relative_error
from stimuli.plate.scene import check_loads
from stimuli.plate.transient import (
    AT_JUMPS,
    BEYOND,
    LOOKS,
    make_time_line,
    receptances,
    reference_hz,
    unexchanged_loss,
    unfollowed_ringing,
)
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.fingers.fingertip import Fingertip, Impedance
    from stimuli.load import Load
    from stimuli.plate.strip import Strip
    from stimuli.plate.transient import Receptance, TimeLine

MAX_ERROR: Final = 0.03
"""Part of the peak at the driven finger that has to be known."""
_TINIEST_M: Final = 1e-300
_AT_LARGEST: Final = 0.03
"""Part of the loss factor that is missed of the largest peak where modes exchange loss."""
_LATE: Final = 0.7
"""The plate is looked at for longer where in the second half of the time it moves by more than this
part of its peak: waves of one speed may still add up."""
_NOW_AND_THEN: Final = 4
"""Looks: 8 in a period of the highest of cut-off and drive's band still show 0.92 of a crest."""
_NEAR_PEAK: Final = 0.8
_LONGEST_S: Final = 0.1
_SLOWEST: Final = 0.1
"""Speed of the slowest waves that are waited for, in that of waves with a wavelength of W."""
_RADII: Final = 8
"""Radii of the nodes over which a contact area is averaged, with twice as many angles."""
_ROUNDING_DIGITS: Final = 12


@single_threaded
def fingertip_peaks(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
    rtol: float | None = None,
) -> Estimate[Real]:
    """Return the peak displacement at fingertips under each load, equation (43), with its error.

    Parameters
    ----------
    strip : Strip
        One with a constant loss factor is replaced by `causal(strip, drive)`.
    loads : sequence of Load
        Loads, each driven by itself.
    fingertips : sequence of Fingertip
        Those with an impedance that holds for the drive press on the plate.
    drive : Drive
    rtol : float, optional
        Largest error, relative to the largest peak of each load; refused where it is not kept.

    Returns
    -------
    Estimate
        Metres per unit load, of the shape (n_fingertips, n_loads).

    Raises
    ------
    ValueError
        If an argument is not what it should be, a load or fingertip is not on the strip, or one
        with an impedance not wholly.
    PlateError
        If the plate needs too many functions, a peak at a driven finger is not known to 3 %, or
        `rtol` is not kept.

    Examples
    --------
    Two equal actuators with a finger on each feel alike, and little of the other one:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, Fingertip, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> discs = [MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035)]
    >>> fingers = [Fingertip(x_m=x, y_m=0.0125) for x in (-0.035, 0.035)]
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="hann")
    >>> peaks = fingertip_peaks(strip, discs, fingers, burst)
    >>> bool((abs(peaks.value - peaks.value.T) < peaks.error).all())
    True
    >>> bool(peaks.value[1, 0] < 1e-3 * peaks.value[0, 0])
    True
    """
    loads = check_loads(strip, loads)
    fingertips = checked_fingertips(fingertips)
    instance("drive", drive, Drive, "a burst or a sampled drive")
    strip = causal(strip, drive)
    max_hz = reference_hz(strip, drive)
    pressing = [tip for tip in fingertips if tip.impedance and tip.impedance.holds_for(drive)]
    areas_m = [_area_points(tip, strip, loads) for tip in fingertips]
    if all(area.y_m == strip.width_m / 2 for area in (*loads, *strip.patches, *fingertips)):
        areas_m = [_lower_half(area_m, strip.width_m) for area_m in areas_m]
    means = [_mean_nodes(tip) for tip in pressing]
    points_m = np.concatenate([*areas_m, *(nodes_m for nodes_m, _ in means)])
    ends = np.cumsum([0, *map(len, areas_m)])
    averages = scipy.linalg.block_diag(np.eye(ends[-1]), *(weights for _, weights in means))
    forces = [_contact_force(strip, tip) for tip in pressing]
    plates = [
        plate.averaged(averages)
        for plate in receptances(strip, [*loads, *forces], points_m, max_hz, len(loads))
    ]
    contact = _Contact(pressing, len(loads))
    span_s = 2 * drive.duration_s + _wait_s(strip, loads, fingertips)
    step_s = 1 / (LOOKS * max_hz)
    while True:
        line = make_time_line(drive, step_s, span_s)
        coarse_m, late_m = _peaks(plates[0], contact, ends, line)
        if np.all(late_m <= _LATE * coarse_m) or span_s > _LONGEST_S:
            break
        span_s *= 2
    fine_m, _ = _peaks(plates[1], contact, ends, line)
    largest_m, loss = np.maximum(fine_m.max(axis=0), _TINIEST_M), unexchanged_loss(strip, max_hz)
    exchanged = loss * (_AT_LARGEST + loss * (1 - fine_m / largest_m))
    missed = MISSED + unfollowed_ringing(strip, max_hz, line)
    missed_m = missed * largest_m + (exchanged + AT_JUMPS * line.jump) * fine_m
    peaks = estimate(coarse_m, fine_m, missed_m, plates[1].work, relative_error(strip))
    largest = (np.argmax(fine_m, axis=0), np.arange(len(loads)))
    errors = peaks.error[largest] / largest_m
    if errors.max() > MAX_ERROR:
        load = int(errors.argmax())
        data = {"error_percent": 100 * float(errors[load]), "max_percent": 100 * MAX_ERROR}
        raise PlateError(Rule.UNCERTAIN_PEAK, load=load, **data)
    return peaks.kept(rtol, largest_m)


def felt(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
    rtol: float | None = None,
) -> Real:
    """Return the value of `fingertip_peaks` alone.

    Parameters
    ----------
    strip, loads, fingertips, drive, rtol
        As for `fingertip_peaks`.

    Returns
    -------
    ndarray of float64, shape (n_fingertips, n_loads)
        Metres per unit load.

    Examples
    --------
    A finger next to the actuator gets less than one above it:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, Fingertip, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> fingers = [Fingertip(x_m=x, y_m=0.0125, radius_m=0.0) for x in (0.0, 0.02)]
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="hann")
    >>> above_m, beside_m = felt(strip, [disc], fingers, burst)[:, 0]
    >>> bool(beside_m < 0.1 * above_m)
    True
    """
    return fingertip_peaks(strip, loads, fingertips, drive, rtol).value


def _peaks(
    plate: Receptance, contact: _Contact, ends: NDArray[np.intp], line: TimeLine
) -> tuple[Real, Real]:
    """Return the largest displacement of each group of points, and in the second half of the time.

    The shape of both is (n_groups, n_loads). Points that move nearly most of their group when all
    are looked at now and then are looked at every time.
    """
    gains = plate.gains(line.omega)
    forces = contact.forces(plate.response(gains, slice(ends[-1], None)), line.omega)
    peaks_m, late_m = np.zeros((2, ends.size - 1, contact.n_loads))
    for load in range(contact.n_loads):
        amplitudes, shapes = plate.motion(line, gains, load, forces[load])
        shapes = shapes[:, : ends[-1]]
        looks_m = np.abs(amplitudes[:, ::_NOW_AND_THEN].T @ shapes)
        largest_m = looks_m.max(axis=0)
        groups_m = np.maximum.reduceat(largest_m, ends[:-1])
        is_near = largest_m >= _NEAR_PEAK * np.repeat(groups_m, np.diff(ends))
        largest_m[is_near] = _crests(amplitudes.T @ shapes[:, is_near])
        peaks_m[:, load] = np.maximum.reduceat(largest_m, ends[:-1])
        late_looks_m = looks_m[len(looks_m) // 2 :].max(axis=0)
        late_m[:, load] = np.maximum.reduceat(late_looks_m, ends[:-1])
    return peaks_m, late_m


class _Contact:
    """Fingertips that press on the plate: their impedances on means of its displacement."""

    def __init__(self, fingertips: Sequence[Fingertip], n_loads: int) -> None:
        self.impedances = [tip.impedance for tip in fingertips if tip.impedance]
        self.areas_m2 = np.array([math.pi * tip.radius_m**2 or 1.0 for tip in fingertips])
        self.n_loads = n_loads

    def forces(self, means_m: Complex, omega: Complex) -> Complex:
        """Return what fingertips do under each load, in unit loads of their contact areas.

        That is -Z w over the area, equation (42), of the shape (n_loads, n_tips, n_frequencies).
        Means are over contact areas, (n_loads + n_tips, n_tips, n_frequencies).
        """
        n_tips = len(self.impedances)
        if not n_tips:
            return np.zeros((self.n_loads, 0, omega.size), dtype=np.complex128)
        free_m, by_force_m = np.split(np.transpose(means_m), [self.n_loads], axis=2)
        impedance = np.stack([_dynamic_stiffness(z, omega) for z in self.impedances], axis=1)
        mobility = by_force_m / self.areas_m2 * impedance[:, np.newaxis]
        held_m = np.linalg.solve(np.eye(n_tips) + mobility, free_m)
        return np.asarray(np.transpose(-(impedance / self.areas_m2)[:, :, np.newaxis] * held_m))


def _dynamic_stiffness(impedance: Impedance, omega: Complex) -> Complex:
    """Return the force on the fingertip over its displacement, k - i w c - w^2 m."""
    return (
        impedance.stiffness_n_m
        - 1j * omega * impedance.damping_n_s_m
        - omega**2 * impedance.mass_kg
    )


def _contact_force(strip: Strip, tip: Fingertip) -> Load:
    end_m = math.inf if strip.length_m is None else strip.length_m / 2
    room_m = min(end_m - abs(tip.x_m), tip.y_m, strip.width_m - tip.y_m)
    if tip.radius_m > room_m + 10.0**-_ROUNDING_DIGITS:
        raise ValueError(
            "fingertips with an impedance must lie wholly on the strip, radius_m at most "
            f"{room_m:g} at {tip.x_m, tip.y_m}, got {tip.radius_m!r}"
        )
    if not tip.radius_m:
        return PointForce(x_m=tip.x_m, y_m=tip.y_m)
    return PressureDisc(x_m=tip.x_m, y_m=tip.y_m, radius_m=tip.radius_m)


def _mean_nodes(tip: Fingertip) -> tuple[Real, Real]:
    """Return points over a contact area, and weights that give the mean over it."""
    if not tip.radius_m:
        return np.array([[tip.x_m, tip.y_m]]), np.ones(1)
    nodes, weights = gauss_rule(_RADII)
    angles = math.pi / _RADII * (np.arange(2 * _RADII) + 0.5)
    radii_m = tip.radius_m * np.sqrt((nodes + 1) / 2)
    x_m, y_m = (np.outer(radii_m, wave(angles)).ravel() for wave in (np.cos, np.sin))
    points_m = np.stack([tip.x_m + x_m, tip.y_m + y_m], axis=1)
    return points_m, np.repeat(weights, angles.size) / (2 * angles.size)


def _area_points(tip: Fingertip, strip: Strip, loads: Sequence[Load]) -> Real:
    """Return the points of a contact area, with the centres of loads under it.

    There a small load moves the plate most.
    """
    centres_m = [(load.x_m, load.y_m) for load in loads]
    near_m = (c for c in centres_m if math.dist(c, (tip.x_m, tip.y_m)) <= tip.radius_m)
    return np.array([*tip.points_m(strip), *near_m])


def _lower_half(points_m: Real, width_m: float) -> Real:
    """Return points without those that are mirror images about the centre line."""
    y_m = np.minimum(points_m[:, 1], width_m - points_m[:, 1])
    folded_m = np.stack([points_m[:, 0], y_m], axis=1).round(_ROUNDING_DIGITS)
    return np.unique(folded_m, axis=0)


def _wait_s(strip: Strip, loads: Sequence[Load], fingertips: Sequence[Fingertip]) -> float:
    """Return how long after the drive the slow waves just above a cut-off may bring the peak.

    They spread like heat: the longest waves have come when 2 sqrt(D / (rho h)) t is the square of
    the distance. Far away the faster ones count. Over an end of the plate the way is longer, unless
    the end is too far away.
    """
    spread_m2_s = math.sqrt(
        strip.bending_stiffness_n_m / (strip.material.density_kg_m3 * strip.thickness_m)
    )
    way_m = max(abs(tip.x_m - load.x_m) + tip.radius_m for tip in fingertips for load in loads)
    if strip.length_m is not None:
        way_m += min(strip.length_m, 2 * max(BEYOND) * strip.width_m)
    slowest_m_s = _SLOWEST * 4 * math.pi * spread_m2_s / strip.width_m
    return min(way_m**2 / (2 * spread_m2_s), way_m / slowest_m_s) + 1 / strip.cutoff_hz()


def _crests(history_m: Real) -> Real:
    """Return the largest absolute values over time, between looks by parabolas."""
    size_m = np.abs(history_m)
    at = np.clip(np.argmax(size_m, axis=0), 1, len(size_m) - 2)[np.newaxis]
    before, top, after = (np.take_along_axis(size_m, at + step, 0)[0] for step in (-1, 0, 1))
    bend = np.maximum(2 * top - before - after, np.finfo(np.float64).tiny)
    is_crest = (top >= before) & (top >= after)
    return np.where(is_crest, top + (after - before) ** 2 / (8 * bend), size_m.max(axis=0))
