"""The displacement of a plate over time, from its response on a line above the real frequencies.

On w + i s every response is smooth, without loss too, and one inverse Fourier transform gives
exp(-s t) u(t) over a period, of which the first half is kept: what comes round from later times has
faded by then. What follows the drive at once is taken out before and added after, as its spectrum
does not fall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

import numpy as np

from stimuli.checks import finite_array, instance
from stimuli.drive.sampled import Drive, SampledDrive
from stimuli.errors import PlateError, Rule
from stimuli.plate.line import Margins
from stimuli.plate.modes import Resolution, plate_bases
from stimuli.plate.response import (
    describe_modes,
    describe_waves,
    estimate,
    relative_error,
    safety_factors,
)
from stimuli.plate.rest import rest_displacement
from stimuli.plate.scene import Scene, cut_section
from stimuli.plate.strip import MAX_CUTOFFS
from stimuli.plate.waveguide import endless_displacement, has_lossless_springs
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real
    from stimuli.load import Load
    from stimuli.plate.response import Estimate
    from stimuli.plate.scene import Section
    from stimuli.plate.strip import Strip

_MAX_TIME_S: Final = 1.0
_SLOW: Final = 100.0
"""Cut-offs in a drive's band: its corners make modes ring with 1e-3 of what it does at rest."""
_FADING: Final = 9.0
"""Nepers by which a period fades before it comes round: exp(-9) = 1e-4 of what is left then."""
_FINER: Final = 8
"""Samples of the drive for each time at which the plate is looked at."""
LOOKS: Final = 32
"""Times in a period of the highest of cut-off and drive's band at which the plate is looked at."""
_BETWEEN_LOOKS: Final = 3e-4
"""Part of the largest displacement that a spline between the looks misses at corners of a drive."""
AT_JUMPS: Final = 0.04
"""Part of the displacement that is missed where a drive jumps by its amplitude."""
_OVER_TIME: Final = 0.2
"""Part of the loss factor that is missed of a displacement over time where modes exchange loss."""
BEYOND, _BEYOND_LOSSLESS = (15.0, 20.0), (30.0, 40.0)
"""Widths of a long plate that are kept beyond loads and points, coarse and fine: echoes from
farther away are too late, and with loss too faint."""
_MODES: Final = Resolution(multiples=(5.5, 8.0), margins=Margins(2.0, 3.0))
_WAVES: Final = Margins(2, 2), Margins(4, 4)
_REST: Final = Resolution(multiples=(1.0, 2.0), margins=Margins(4.0, 6.0))


@dataclass(frozen=True, eq=False)
class TimeLine:
    """Times at which a plate is looked at, and the complex frequencies that give them.

    Attributes
    ----------
    step_s : float
    omega : ndarray of complex128, shape (n_frequencies,)
    spectrum : ndarray of complex128, same shape
        That of the drive, in samples.
    drive : ndarray of float64, shape (n_times,)
        Its means about each time, as the fastest modes do not follow a jump at once.
    jump : float
        Largest change of the drive at once, or from one of its samples to the next.
    bend_per_s : float
        Largest change of its slope.
    """

    step_s: float
    omega: Complex
    spectrum: Complex
    drive: Real
    jump: float
    bend_per_s: float

    @property
    def growth(self) -> Real:
        """What undoes the fading at each time."""
        return np.asarray(np.exp(self.omega[0].imag * self.step_s * np.arange(self.drive.size)))

    def history(self, response: Complex) -> Real:
        """Return what a response does over time, equation (41), along the last axis."""
        n_times, at_once = self.drive.size, response[..., -1:].real
        swinging = np.conj((response - at_once) * self.spectrum)
        history = np.fft.irfft(swinging, 2 * n_times)[..., :n_times]
        return np.asarray(history * self.growth + at_once * self.drive)


def make_time_line(drive: Drive, step_s: float, span_s: float) -> TimeLine:
    """Return times from the drive's begin on, in about such steps, over at least a span.

    Jumps between held samples fall on the fine times. Elsewhere they would come a little early or
    late, which adds noise at all frequencies: 8 dB to the crosstalk of a slow burst at 48 kHz.
    """
    has_jumps = False
    if isinstance(drive, SampledDrive) and step_s * drive.sample_rate_hz < _FINER:
        has_jumps = drive.held
        n_fine = math.ceil(_FINER / (step_s * drive.sample_rate_hz))
        step_s = _FINER / (n_fine * drive.sample_rate_hz)
    n_times = _fast_length(span_s / step_s)
    n = 2 * n_times
    fading = _FADING / (n * step_s)
    fine_s = np.asarray(step_s / _FINER * np.arange(n * _FINER), dtype=np.float64)
    values = drive.at(fine_s)
    jump = float(np.abs(np.diff(values)).max())
    bend_per_s = float(np.abs(np.diff(values, 2)).max()) * _FINER / step_s
    if has_jumps:
        values = (values + np.concatenate([[0.0], values[:-1]])) / 2  # between before and after
    omega = 2 * math.pi * np.fft.rfftfreq(n, step_s) + 1j * fading
    faded = np.fft.rfft(values * np.exp(-fading * fine_s))[: omega.size]
    spectrum = np.asarray(np.conj(faded) / _FINER, dtype=np.complex128)
    before = np.concatenate([np.zeros(_FINER // 2), values])[: n_times * _FINER + 1]
    means = (before[:-1] + before[1:]).reshape(n_times, -1).mean(axis=1) / 2
    return TimeLine(step_s, np.asarray(omega), spectrum, means, jump, bend_per_s)


def _fast_length(least: float) -> int:
    """Return a number with small factors, of which Fourier transforms are fast.

    >>> _fast_length(1000), _fast_length(1300)
    (1024, 1536)
    """
    return min(int(odd * 2.0 ** math.ceil(math.log2(least / odd))) for odd in (1, 3, 5, 9, 15))


class Receptance(Protocol):
    """The displacement of a plate per unit load, for any complex frequency.

    It is a sum of shapes with amplitudes, and `gains` is what both follow from at frequencies.
    """

    @property
    def work(self) -> tuple[str, ...]:
        """What is solved."""

    def averaged(self, weights: Real) -> Receptance:
        """Return it on averages over points: weights (n_averages, n_points)."""

    def gains(self, omega: Complex) -> Complex:
        """Return what depends on frequency alone: (..., n_frequencies)."""

    def response(self, gains: Complex, points: slice) -> Complex:
        """Return the displacement at some points: (n_loads, n_points, n_frequencies)."""

    def motion(
        self, line: TimeLine, gains: Complex, load: int, forces: Complex
    ) -> tuple[Real, Real]:
        """Return amplitudes over time and the shapes that they belong to, equation (42).

        They are (n_shapes, n_times) and (n_shapes, n_points), under a load with forces in terms of
        the last loads, (n_forces, n_frequencies).
        """


@dataclass(frozen=True, eq=False)
class WaveReceptance:
    """That of an endless strip, by its waves up to a frequency."""

    strip: Strip
    loads: Sequence[Load]
    points_m: Real
    max_hz: float
    margins: Margins
    weights: Real

    @property
    def work(self) -> tuple[str, ...]:
        """What is solved."""
        return describe_waves(self.strip, self.loads)

    def averaged(self, weights: Real) -> WaveReceptance:
        """Return it on averages over points: weights (n_averages, n_points)."""
        return replace(self, weights=weights @ self.weights)

    def gains(self, omega: Complex) -> Complex:
        """Return the displacement at all points: (n_loads, n_points, n_frequencies)."""
        is_slow = omega.real <= 2 * math.pi * self.max_hz
        response = np.zeros((omega.size, len(self.loads), len(self.points_m)), np.complex128)
        response[is_slow] = endless_displacement(
            self.strip, self.loads, self.points_m, omega[is_slow], self.margins
        )
        return np.moveaxis(response @ self.weights.T, 0, -1)

    def response(self, gains: Complex, points: slice) -> Complex:
        """Return the displacement at some points: (n_loads, n_points, n_frequencies)."""
        return gains[:, points]

    def motion(
        self, line: TimeLine, gains: Complex, load: int, forces: Complex
    ) -> tuple[Real, Real]:
        """Return amplitudes over time, each of the shape that moves one point."""
        by_forces = gains[len(gains) - len(forces) :]
        moved = gains[load] + (forces[:, np.newaxis] * by_forces).sum(axis=0)
        return line.history(moved), np.eye(gains.shape[1])


@dataclass(frozen=True, eq=False)
class ModeReceptance:
    """That of a plate with ends, by its slow modes.

    What faster modes do follows the load at once, but for the viscous loss.

    Attributes
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of the slow modes' angular frequencies without loss.
    held : ndarray of float64, shape (n_modes,)
        What springs without loss add to them.
    excitation : ndarray of float64, shape (n_loads, n_modes)
    shapes : ndarray of float64, shape (n_modes, n_points)
    rest_m : ndarray of float64, shape (n_loads, n_points)
        Displacement at rest of all faster modes.
    viscous_time_s : float
    work : tuple of str
        What is solved.
    """

    squared: Real
    held: Real
    excitation: Real
    shapes: Real
    rest_m: Real
    viscous_time_s: float
    work: tuple[str, ...]

    def averaged(self, weights: Real) -> ModeReceptance:
        """Return it on averages over points: weights (n_averages, n_points)."""
        return replace(self, shapes=self.shapes @ weights.T, rest_m=self.rest_m @ weights.T)

    def gains(self, omega: Complex) -> Complex:
        """Return amplitudes per unit work, at last of what is at rest: (n + 1, n_frequencies)."""
        factors, held = 1 - 1j * omega * self.viscous_time_s, self.held[:, np.newaxis]
        lossy = held + (self.squared[:, np.newaxis] - held) * factors
        return np.concatenate([1 / (lossy - omega**2), 1 / factors[np.newaxis]])

    def response(self, gains: Complex, points: slice) -> Complex:
        """Return the displacement at some points: (n_loads, n_points, n_frequencies)."""
        by_mode = self.excitation[:, :, np.newaxis] * self.shapes[:, points]
        parts = np.concatenate([by_mode, self.rest_m[:, np.newaxis, points]], axis=1)
        return np.asarray(parts.swapaxes(1, 2) @ gains)

    def motion(
        self, line: TimeLine, gains: Complex, load: int, forces: Complex
    ) -> tuple[Real, Real]:
        """Return amplitudes over time and the shapes that they belong to."""
        first, (slow, rest) = len(self.excitation) - len(forces), (gains[:-1], gains[-1:])
        work = self.excitation[load][:, np.newaxis] + self.excitation[first:].T @ forces
        amplitudes = line.history(np.concatenate([work * slow, rest, rest * forces]))
        shapes = np.concatenate([self.shapes, self.rest_m[[load]], self.rest_m[first:]])
        return amplitudes, shapes


class _SlowModes(NamedTuple):
    """Those of one symmetry, along the last axis: under loads and at points."""

    squared: Real
    held: Real
    excitation: Real
    received: Real


def receptances(
    strip: Strip, loads: Sequence[Load], points_m: Real, max_hz: float, n_driven: int
) -> tuple[Receptance, Receptance]:
    """Return the receptance of a plate in the coarse and in the fine basis.

    The first loads are driven; the others are forces of fingertips, whose own places need not be
    followed as sharply. Of a long plate only a section is kept, a longer one in the fine basis.
    """
    if strip.length_m is None:
        coarse, fine = (
            WaveReceptance(
                strip, loads, points_m, multiple * max_hz, margins, np.eye(len(points_m))
            )
            for multiple, margins in zip(_MODES.multiples, _WAVES, strict=True)
        )
        return coarse, fine
    viscous_time_s = strip.material.viscous_time_s
    lossless = replace(strip, material=replace(strip.material, viscous_time_s=0.0))
    beyond = BEYOND if viscous_time_s else _BEYOND_LOSSLESS
    points = tuple((x, y) for x, y in points_m.tolist())
    coarse_modes, fine_modes = _lossless_receptances(
        lossless, tuple(loads), points, max_hz, n_driven=n_driven, beyond=beyond
    )
    return (
        replace(coarse_modes, viscous_time_s=viscous_time_s),
        replace(fine_modes, viscous_time_s=viscous_time_s),
    )


def clear_receptances() -> None:
    """Forget the plates of earlier calls, as for measurements of time."""
    _lossless_receptances.cache_clear()


@lru_cache(maxsize=4)  # a check asks for the same plate with several losses and drives
def _lossless_receptances(
    strip: Strip,
    loads: tuple[Load, ...],
    points: tuple[tuple[float, float], ...],
    max_hz: float,
    *,
    n_driven: int,
    beyond: tuple[float, float],
) -> tuple[ModeReceptance, ...]:
    coarse, fine = (
        cut_section(strip, loads, np.array(points), widths * strip.width_m) for widths in beyond
    )
    if coarse.strip == fine.strip:
        return _receptances(strip, fine, max_hz, n_driven, (0, 1))
    return (
        *_receptances(strip, coarse, max_hz, n_driven, (0,)),
        *_receptances(strip, fine, max_hz, n_driven, (1,)),
    )


def _receptances(
    whole: Strip, section: Section, max_hz: float, n_driven: int, numbers: tuple[int, ...]
) -> tuple[ModeReceptance, ...]:
    """Return the receptance of a section of a plate, in the coarse (0) and the fine (1) basis."""
    plate, loads, points_m = section
    rest_m = np.zeros((2, len(loads), len(points_m)))
    if not plate.patches:
        rest_m += rest_displacement(
            plate,
            loads,
            points_m,
            np.ones(1, dtype=np.complex128),
            max_hz=max_hz,
            resolution=_REST,
        ).real[:, 0, 0]
    slow: tuple[list[_SlowModes], list[_SlowModes]] = [], []
    followed = loads[:n_driven] if plate.patches else ()
    for basis in plate_bases(plate, max_hz, _MODES, loads, followed):
        values, work = basis.values(points_m), np.stack([basis.work(load) for load in loads])
        for number in numbers:
            select, limit_hz = basis.resolutions()[number], _MODES.multiples[number] * max_hz
            squared, vectors = basis.modes(select, limit_hz)
            excitation, received = (each[:, select] @ vectors for each in (work, values))
            held = basis.held(select, vectors)
            slow[number].append(_SlowModes(squared, held, excitation, received))
            rest_m[number] -= excitation / squared @ received.T
            if plate.patches:
                rest_m[number] += basis.at_rest(select, work[:, select]) @ values[:, select].T
    receptances = []
    for number in numbers:
        squared, held, excitation, received = (
            np.concatenate(arrays, axis=-1) for arrays in zip(*slow[number], strict=True)
        )
        work_done = describe_modes([modes.squared for modes in slow[number]], whole, plate)
        receptances.append(
            ModeReceptance(squared, held, excitation, received.T, rest_m[number], 0.0, work_done)
        )
    return tuple(receptances)


def transient(scene: Scene, drive: Drive, times_s: ArrayLike, rtol: float | None = None) -> Real:
    """Return the value of `transient_response` alone.

    Parameters
    ----------
    scene, drive, times_s, rtol
        As for `transient_response`.

    Returns
    -------
    ndarray of float64, shape (n_times, n_loads, n_points)
        Metres per unit load amplitude.

    Examples
    --------
    Far below its cut-off a strip follows a slow burst as a spring:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> burst = Burst(frequency_hz=250.0, cycles=2, window="hann")
    >>> rise_m, fall_m = transient(scene, burst, [0.003, 0.005])[:, 0, 0]
    >>> bool(abs(rise_m + fall_m) < 0.01 * abs(rise_m))
    True
    """
    return transient_response(scene, drive, times_s, rtol).value


@single_threaded
def transient_response(
    scene: Scene, drive: Drive, times_s: ArrayLike, rtol: float | None = None
) -> Estimate[Real]:
    """Return the displacement of a strip over time.

    Parameters
    ----------
    scene : Scene
        The loss of its strip must be viscous, as `causal` makes it.
    drive : Drive
        It begins at time 0.
    times_s : array_like of float, shape (n_times,)
    rtol : float, optional
        Largest error, relative to the largest displacement under each load; refused where it is
        not kept.

    Returns
    -------
    Estimate
        Metres per unit load amplitude, of the shape (n_times, n_loads, n_points).

    Raises
    ------
    ValueError
        If an argument is out of its range, or the strip has a constant loss factor.
    PlateError
        If the plate needs too many functions, or `rtol` is not kept.

    Examples
    --------
    A plate that is not driven yet is at rest:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="hann")
    >>> times_s = [-1e-4, 0.0, 1e-3]
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> motion = transient_response(scene, burst, times_s)
    >>> motion.value.shape, bool(motion.value[:2].any())
    ((3, 1, 1), False)
    """
    from scipy.interpolate import CubicSpline

    instance("scene", scene, Scene, "a Scene")
    strip, loads, times = scene.strip, scene.loads, finite_array("times_s", times_s)
    if times.ndim != 1 or not times.size or np.abs(times).max() > _MAX_TIME_S:
        raise ValueError(
            f"times_s must be a one-dimensional array of times within {_MAX_TIME_S:g} s of 0, "
            f"got {times_s!r}"
        )
    if strip.material.loss_factor:
        raise ValueError(
            "strip must have no constant loss factor, which is not causal: take "
            f"causal(strip, drive), got loss_factor = {strip.material.loss_factor!r}"
        )
    max_hz = reference_hz(strip, drive)
    plates = receptances(strip, loads, scene.points, max_hz, len(loads))
    line = make_time_line(drive, 1 / (LOOKS * max_hz), max(times.max(), drive.duration_s))
    looks_s = line.step_s * np.arange(line.drive.size)
    is_driven = times > 0
    histories = np.zeros((2, times.size, len(loads), len(scene.points_m)))
    for history, plate in zip(histories, plates, strict=True):
        gains = plate.gains(line.omega)
        no_forces = np.zeros((0, line.omega.size), dtype=np.complex128)
        for load in range(len(loads)):
            amplitudes, shapes = plate.motion(line, gains, load, no_forces)
            looks = CubicSpline(looks_s, amplitudes, axis=1)
            history[is_driven, load] = looks(times[is_driven]).T @ shapes
    coarse, fine = histories
    scale = np.abs(fine).max(axis=(0, 2), keepdims=True, initial=0.0)
    safety, loss = safety_factors(strip, loads), unexchanged_loss(strip, max_hz)
    exchanged = loss * (_OVER_TIME + loss) * np.abs(fine).max(axis=0, initial=0.0)
    ringing = unfollowed_ringing(strip, max_hz, line)
    missed = (_BETWEEN_LOOKS + AT_JUMPS * line.jump + ringing) * scale + exchanged
    motion = estimate(coarse, fine, missed, plates[1].work, relative_error(strip), safety=safety)
    return motion.kept(rtol, scale)


def unexchanged_loss(strip: Strip, max_hz: float) -> float:
    """Return the loss factor that modes exchange on a plate, where its springs have no loss.

    Over time each mode keeps its own part of it. At the largest displacement that misses a small
    part of the loss factor, elsewhere about its square.
    """
    if strip.length_m is None or not has_lossless_springs(strip):
        return 0.0
    return 2 * math.pi * max_hz * strip.material.viscous_time_s


def unfollowed_ringing(strip: Strip, max_hz: float, line: TimeLine) -> float:
    """Return how far modes ring, over the largest displacement, where not even one is followed.

    A corner of a drive makes a mode ring with the change of slope over its angular frequency.
    """
    cutoff_hz = strip.cutoff_hz()
    is_followed = cutoff_hz <= min(_MODES.multiples) * max_hz
    return 0.0 if is_followed else line.bend_per_s / (2 * math.pi * cutoff_hz)


def reference_hz(strip: Strip, drive: Drive) -> float:
    """Return the highest of the first cut-off and the drive's band at half power.

    A much slower drive without jumps makes modes ring so little that not all are followed.
    PlateError where the drive is too long, or too fast for the strip.
    """
    instance("drive", drive, Drive, "a burst or a sampled drive")
    max_hz, cutoff_hz = drive.band_hz()[1], strip.cutoff_hz()
    highest_hz = MAX_CUTOFFS * cutoff_hz
    if drive.duration_s > _MAX_TIME_S or max_hz > highest_hz:
        raise PlateError(
            Rule.DRIVE_OUT_OF_RANGE,
            max_s=_MAX_TIME_S,
            max_hz=highest_hz,
            duration_s=drive.duration_s,
            band_hz=max_hz,
        )
    has_jumps = isinstance(drive, SampledDrive) and drive.held
    return max(max_hz, cutoff_hz if has_jumps else min(cutoff_hz, _SLOW * max_hz))
