"""What field and drive have above a frequency: how far a field over time has to be computed.

No range could end without a bound on what lies above it; probes two to an octave and the drive's
exact energy between them give one before the field is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.field.scene import MOST_CUTOFFS
from stimuli.load import DISCS
from stimuli.strip.edge import SIMPLY_SUPPORTED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene


_WIDEST_DISC: Final = 24.0
"""Largest k R at which a point inside a disc has digits left, few but enough for a tail."""

_MOST_WITH_ENDS: Final = 400.0
"""First cut-offs of the supported strip up to which the free ends of a finite one are computed."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tail:
    """What field and drive have at and above a row of probes, equation (66)."""

    frequencies_hz: Real  # the probes, increasing; the last is the highest frequency of the field
    field_m: Real  # |U| there: (n_probes, n_pairs)
    bound_m: Real  # what all above each probe can add to |u|: (n_probes, n_pairs)
    # whether the field is computed above each probe; if not, `field_m` is taken to fall as
    # f^(-3/4), the slowest that any load does
    known: NDArray[np.bool_]

    def near(self, low_hz: float, high_hz: float) -> Real:
        """Return the largest |U| at the probes of a range and its neighbours."""
        f = self.frequencies_hz
        first = max(int(np.searchsorted(f, low_hz)) - 2, 0)
        return np.asarray(
            np.max(self.field_m[first : int(np.searchsorted(f, high_hz)) + 2], axis=0)
        )

    def end_hz(self, allowed_m: Real) -> float:
        """Return the first probe above which no pair that is known has more than is allowed."""
        fits = np.all((self.bound_m <= allowed_m) | ~self.known, axis=1)
        return float(self.frequencies_hz[np.argmax(fits)])

    @property
    def least_m(self) -> Real:
        """What must be left out of each pair."""
        first = np.argmin(self.known, axis=0)
        return np.asarray(self.bound_m[first, np.arange(first.size)])


def limits_hz(scene: Scene) -> Real:
    """Return the highest frequency that is computed for each pair of a load and a point."""
    width_m = scene.strip.width_m
    supported_hz = replace(scene.strip, edge=SIMPLY_SUPPORTED).cutoff_hz()
    most = MOST_CUTOFFS if scene.strip.length_m is None else _MOST_WITH_ENDS
    limits = np.full((len(scene.loads), len(scene.points_m)), most)
    x, y = np.array(scene.points_m).T
    for load, row in zip(scene.loads, limits, strict=True):
        if isinstance(load, DISCS):
            widest = (_WIDEST_DISC * width_m / (math.pi * load.radius_m)) ** 2
            inside = np.hypot(x - load.x_m, y - load.y_m) < load.radius_m
            row[inside] = min(widest, MOST_CUTOFFS)
    return limits.ravel() * supported_hz


def probes(drive: Drive, limits_hz: Real) -> Real:
    """Return the places of the probes: two per octave from the drive's peak, and the limits."""
    least_hz, most_hz = float(np.min(limits_hz)), float(np.max(limits_hz))
    scale_hz = min(max(drive.peak_hz(), 1 / drive.duration_s), least_hz / 2)
    octaves = np.arange(0.0, math.log2(most_hz / scale_hz), 0.5)
    return np.union1d(scale_hz * 2.0**octaves, limits_hz)


def tail(drive: Drive, frequencies_hz: Real, field_m: Real, limits_hz: Real) -> Tail:
    """Return what field and drive have above probes, by the inequality of Schwarz.

    The drive's energy in each interval is exact, the field is the larger of both ends.
    """
    f = frequencies_hz
    fall = np.minimum(limits_hz / f[:, np.newaxis], 1.0) ** 0.75
    at_limit = field_m[np.searchsorted(f, limits_hz), np.arange(limits_hz.size)]
    known = f[:, np.newaxis] < limits_hz
    field_m = np.where(known, field_m, at_limit * fall)
    share = np.array([drive.energy_above(float(frequency)) for frequency in f])
    energy = _energy(drive, float(4 * f[0])) / (1 - drive.energy_above(float(4 * f[0])))
    within = np.sqrt(np.diff(f) * energy * np.clip(share[:-1] - share[1:], 0.0, None))
    larger = np.maximum(field_m[:-1], field_m[1:])
    beyond = math.sqrt(2 * f[-1] * energy * share[-1]) * field_m[-1]
    parts = 2 * np.vstack([larger * within[:, np.newaxis], beyond])
    bound_m = np.cumsum(parts[::-1], axis=0)[::-1]
    return Tail(frequencies_hz=f, field_m=field_m, bound_m=bound_m, known=known)


def _energy(drive: Drive, most_hz: float) -> float:
    """Return the integral of |S|^2 up to a frequency by a rule fine enough for the duration."""
    f = np.linspace(0.0, most_hz, 2 + int(8 * most_hz * drive.duration_s))
    square = np.abs(drive.spectrum(f)) ** 2
    return float(np.sum(square) - (square[0] + square[-1]) / 2) * float(f[1])
