"""The displacement of a strip over time, for a drive that begins at t = 0."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite, finite_array, instance
from stimuli.drive.sampled import Drive
from stimuli.drive.sums import exponential_sums
from stimuli.errors import PeakOutOfRangeError
from stimuli.field.panels import PanelSweep, line_for, swept
from stimuli.field.scene import Scene
from stimuli.field.tail import limits_hz

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Real


LEAST_RTOL: Final = 1e-10
MOST_RTOL: Final = 0.1
MOST_TIME_S: Final = 1.0

_MOST_PEAK: Final = 0.1
"""Peak of a drive as a part of the highest frequency of the field."""

_LATE: Final = 4.0
"""A response after the span that is so much larger than within it is kept out by a longer line."""

_MARGIN: Final = 2.0
"""What the line then adds to the logarithm of that size, for what comes after the first period."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TransientWork:
    """What a field over time asks for and what of it is computed.

    Attributes
    ----------
    bins_asked : int
        Bins of the grid up to the highest frequency of the field.
    bins_skipped : int
        Those left out because drive and field have nothing there that counts.
    frequencies_solved : int
        Frequencies at which the field was solved, those of refined panels and of the first look
        at the whole range included.
    pairs_asked, pairs_solved : int
        Pairs of a load and a point; the others are the same but for symmetry, or not driven.
    step_hz, highest_hz : float
        Distance of the bins, and the end of the range that counts.
    period_s, decay_per_s : float
        Period T and decay sigma of the sum.
    skipped : tuple of str
        What is left out and why.
    modes : int
        How many modes of the plate took the place of all bins; 0 where none did.

    Examples
    --------
    `transient_work` gives one; where no great precision is asked for, modes take the place of bins:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Strip, transient_work
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    >>> work = transient_work(scene, burst, [0.004], rtol=1e-2)
    >>> work.modes > 0, work.bins_asked
    (True, 0)
    """

    bins_asked: int
    bins_skipped: int
    frequencies_solved: int
    pairs_asked: int
    pairs_solved: int
    step_hz: float
    highest_hz: float
    period_s: float
    decay_per_s: float
    skipped: tuple[str, ...]
    modes: int = 0


def synthesized(scene: Scene, burst: Drive, times_s: ArrayLike, rtol: float) -> Real:
    """Return the displacement over time under a drive by its spectrum, equations (63) to (66).

    Arguments and value are those of `stimuli.transient`.
    """
    times, rtol = checked_times(scene, burst, times_s, rtol)
    found = _found(scene, burst, times, rtol)
    line, values = found.line, found.values.copy()
    values[:1] /= 2
    sums = exponential_sums(values, -times / line.period_s).real
    growth = 2 * line.step_hz * np.exp(line.decay_per_s * times)
    size = times.size, len(scene.loads), len(scene.points_m)
    return np.asarray((growth[:, np.newaxis] * sums).reshape(size))


def synthesis_work(scene: Scene, burst: Drive, times_s: ArrayLike, rtol: float) -> TransientWork:
    """Return what `synthesized` computes and what it leaves out, with the reason."""
    times, rtol = checked_times(scene, burst, times_s, rtol)
    found = _found(scene, burst, times, rtol)
    n_bins = found.values.shape[0]
    asked = max(n_bins, math.ceil(float(np.max(limits_hz(scene))) * found.line.period_s))
    of_scene = scene.work([scene.strip.cutoff_hz() / 2], rtol)
    return TransientWork(
        bins_asked=asked,
        bins_skipped=asked - n_bins + found.n_idle,
        frequencies_solved=found.n_solved,
        pairs_asked=of_scene.pairs_asked,
        pairs_solved=of_scene.pairs_solved,
        step_hz=found.line.step_hz,
        highest_hz=n_bins * found.line.step_hz,
        period_s=found.line.period_s,
        decay_per_s=found.line.decay_per_s,
        skipped=(*_reasons(found, asked), *of_scene.skipped),
    )


def _reasons(found: PanelSweep, asked: int) -> list[str]:
    """Say which bins are left out and why."""
    n_bins = found.values.shape[0]
    reasons = []
    if n_bins < asked:
        reasons.append(
            f"{asked - n_bins} of {asked} bins: above {n_bins * found.line.step_hz:.6g} Hz drive "
            "and field have too little left"
        )
    if found.n_idle:
        reasons.append(f"{found.n_idle} of {asked} bins: the drive has no energy there")
    if found.n_solved < n_bins - found.n_idle:
        reasons.append(
            f"{n_bins - found.n_idle} bins follow from {found.n_solved} frequencies: the field is "
            "smooth above the real axis"
        )
    return reasons


def _found(scene: Scene, drive: Drive, times: Real, rtol: float) -> PanelSweep:
    """Return all bins that count, on a line that keeps later responses out."""
    span_s = max(float(np.max(times, initial=0.0)), drive.duration_s)
    found = swept(scene, drive, line_for(span_s, rtol), rtol)
    if found.late > _LATE:
        further = math.log(found.late) + _MARGIN
        found = swept(scene, drive, line_for(span_s, rtol, further), rtol)
    return found


def checked_times(
    scene: Scene, drive: Drive, times_s: ArrayLike, rtol: float
) -> tuple[Real, float]:
    """Return times and tolerance, or refuse the arguments of a field over time."""
    instance("scene", scene, Scene, "a Scene")
    instance("burst", drive, Drive, "a Burst or another Drive")
    times = finite_array("times_s", times_s)
    if times.ndim != 1 or np.any(np.abs(times) > MOST_TIME_S):
        raise ValueError(
            f"times_s must be a one-dimensional array of times from -{MOST_TIME_S:g} to "
            f"{MOST_TIME_S:g} s, got {times_s!r}"
        )
    if drive.duration_s > MOST_TIME_S:
        raise ValueError(
            f"burst must last at most {MOST_TIME_S:g} s, got one of {drive.duration_s:g} s"
        )
    most_hz = _MOST_PEAK * float(np.min(limits_hz(scene)))
    if drive.peak_hz() > most_hz:
        raise PeakOutOfRangeError(drive.peak_hz(), most_hz)
    _refuse_constant_loss(scene, drive)
    return times, finite("rtol", rtol, least=LEAST_RTOL, most=MOST_RTOL)


def _refuse_constant_loss(scene: Scene, drive: Drive) -> None:
    """Refuse a loss that would act before its cause."""
    material = scene.strip.material
    if material.loss_factor == 0:
        return
    peak_hz = drive.peak_hz() or drive.band_hz()[1]
    same_s = material.loss_factor / (2 * math.pi * peak_hz) + material.viscous_time_s
    raise ValueError(
        "loss_factor must be 0 for a field over time: a constant loss is not causal; "
        f"viscous_time_s={same_s:.4g} has the same loss at the drive's peak of {peak_hz:.6g} Hz, "
        f"got loss_factor={material.loss_factor!r}"
    )
