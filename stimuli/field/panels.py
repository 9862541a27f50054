"""The spectrum of a displacement along a line above the real axis, by adaptive panels.

What is wanted at the bins of a fine uniform grid is solved at a few Chebyshev nodes of panels that
are as wide as the field is smooth. A round solves all pending panels; one whose series has not
converged is halved, one without drive energy is left out, and the range grows until what lies
above it no longer counts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.errors import SpectrumTailError
from stimuli.field.field import solve
from stimuli.field.tail import Tail, limits_hz, probes, tail
from stimuli.solver.source import LEAST_RTOL

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.jobs import Job
    from stimuli.field.scene import Scene

    Panel = tuple[int, int]


_ALIAS: Final = 0.125
"""Part of rtol that is left to the next periods."""

_RISE: Final = 4.0
"""Logarithm of what exp(sigma t) grows to over the span: more makes the field smoother along the
line, but its errors grow as much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComplexLine:
    """The line omega + i sigma and the grid on it, equation (64).

    >>> line = ComplexLine(span_s=0.01, period_s=0.04, decay_per_s=400.0)
    >>> line.step_hz, round(line.rise, 3)
    (25.0, 54.598)
    """

    span_s: float  # times up to this one are wanted
    period_s: float  # T of the sum over the grid, whose step is 1 / T
    decay_per_s: float  # sigma, which keeps the next periods out

    @property
    def step_hz(self) -> float:
        """Distance of two bins."""
        return 1 / self.period_s

    @property
    def rise(self) -> float:
        """What errors grow by up to the end of the span."""
        return math.exp(self.decay_per_s * self.span_s)

    def at(self, bins: Real | NDArray[np.intp]) -> Complex:
        """Return the complex frequencies of bins."""
        return np.asarray(bins * self.step_hz + 1j * self.decay_per_s / (2 * np.pi))


def line_for(span_s: float, rtol: float, further: float = 0.0) -> ComplexLine:
    """Return the line on which times up to a span are found to a relative error.

    `further` is the logarithm by which the next periods must be smaller than rtol asks for.

    Examples
    --------
    >>> found = line_for(0.01, 1e-6)
    >>> round(found.period_s, 3), round(found.decay_per_s)
    (0.04, 400)
    """
    turns = math.log(1 / (_ALIAS * rtol)) + further
    period_s = span_s * max(turns / _RISE, 1.05)
    return ComplexLine(span_s=span_s, period_s=period_s, decay_per_s=turns / period_s)


_NODES: Final = 16
"""Chebyshev nodes of a panel; one with no more bins is solved at its bins."""

_SHARE: Final = 0.2
"""Part of rtol for the series of one panel; few reach it."""

_IDLE: Final = 1e-2
"""Part of rtol below which a panel is left out, by the field at the probes next to it."""

_TAIL: Final = 0.8
"""Part of rtol for all above the range; what is really left out is about a third of its bound."""

_SOLVER: Final = 0.03
"""Part of rtol that is asked of every solution."""

_NOISE: Final = 4.0
"""Times the estimated error of the solutions, below which a series counts as converged."""

_MOST_GROWTH: Final = 4
"""Factor by which the range may grow in a round: the peaks are not well known before."""

_MOST_RESPONSE: Final = 8.0
"""First cut-offs up to which a response has all that makes its peak."""

_PAIRS_AT_ONCE: Final = 16
_ANGLES: Final = np.pi * (np.arange(_NODES) + 0.5) / _NODES
_ORDERS: Final = np.arange(_NODES)
_TO_SERIES: Final = (
    np.cos(_ORDERS[:, np.newaxis] * _ANGLES) * np.where(_ORDERS, 2.0, 1.0)[:, np.newaxis] / _NODES
)


@dataclass(slots=True, kw_only=True, eq=False)
class PanelSweep:
    """The product of field and drive at the bins, as far as it is known."""

    scene: Scene
    drive: Drive
    line: ComplexLine
    rtol: float  # relative to the peak of each pair of a load and a point
    # displacement times the drive's spectrum, m s: (n_bins, n_pairs)
    values: Complex = field(init=False)
    peaks_m: Real = field(init=False)  # largest |u| over the span: (n_pairs,)
    late: float = 0.0  # largest |u| from the span to the period, relative to the pair's peak
    n_solved: int = 0
    n_idle: int = 0  # bins within the range without drive energy
    _limits_hz: Real = field(init=False)
    _jobs: tuple[Job, ...] = field(init=False)
    _spectrum: Complex = field(init=False)
    _tail: Tail = field(init=False)

    def run(self) -> None:
        """Find all bins that count, or refuse; see `swept`."""
        n_pairs = len(self.scene.loads) * len(self.scene.points_m)
        self.values, self.peaks_m = np.zeros((0, n_pairs), dtype=np.complex128), np.zeros(n_pairs)
        self._spectrum = np.zeros(0, dtype=np.complex128)
        self._jobs, self._limits_hz = self.scene.jobs(), limits_hz(self.scene)
        self._probe()
        scale = self._bin_above(float(self._tail.frequencies_hz[0]))
        self._extend(scale)
        pending = [(0, scale), *self._above(4 * scale)]
        while pending:
            rough = self._fill(pending)
            self._refuse_if_short()
            pending = [half for panel in rough for half in self._halves(panel)]
            end_hz = self._tail.end_hz(_TAIL * self.rtol * self.peaks_m)
            most = min(self._bin_above(end_hz), _MOST_GROWTH * self._spectrum.size)
            pending += self._above(most)

    def solve_every_bin(self, scene: Scene) -> None:
        """Replace what was interpolated or left out by a solution for every bin of the range."""
        self._jobs = scene.jobs()
        bins = np.arange(self.values.shape[0])
        field_m, _ = self._solved(scene, self.line.at(bins))
        limits = [self._bin_above(float(limit_hz)) for limit_hz in self._limits_hz]
        field_m[bins[:, np.newaxis] >= limits] = 0.0
        self.values = field_m * self._spectrum[:, np.newaxis]
        self.n_solved, self.n_idle = bins.size, 0
        self._measure()

    def _probe(self) -> None:
        """Solve the probes."""
        places_hz = probes(self.drive, self._limits_hz)
        field_m, error_m = self._solved(self.scene, self.line.at(places_hz / self.line.step_hz))
        certain_m = np.maximum(np.abs(field_m) - _NOISE * error_m, 0.0)
        self._tail = tail(self.drive, places_hz, certain_m, self._limits_hz)

    def _solved(self, scene: Scene, frequencies_hz: Complex) -> tuple[Complex, Real]:
        """Return field and error, shape (n_frequencies, n_pairs).

        Each two octaves are solved by themselves: high frequencies have many waves.
        """
        size = frequencies_hz.size, self.peaks_m.size
        value, error = np.zeros(size, dtype=np.complex128), np.zeros(size)
        octaves = np.log2(np.maximum(frequencies_hz.real / scene.strip.cutoff_hz(), 1.0)) // 2
        for octave in np.unique(octaves):
            rows = octaves == octave
            rtol = max(_SOLVER * self.rtol, LEAST_RTOL)
            part = solve(scene, frequencies_hz[rows], rtol, self._jobs)
            value[rows] = part.value.reshape(-1, size[1])
            error[rows] = part.error.reshape(-1, size[1])
        self.n_solved += size[0]
        return value, error

    def _bin_above(self, frequency_hz: float) -> int:
        return math.ceil(frequency_hz / self.line.step_hz)

    def _extend(self, n_bins: int) -> None:
        """Make room for more bins, with the drive's spectrum there."""
        known = self._spectrum.size
        if n_bins <= known:
            return
        more = self.drive.spectrum(self.line.at(np.arange(known, n_bins)))
        self._spectrum = np.append(self._spectrum, more)
        self.values = np.pad(self.values, ((0, n_bins - known), (0, 0)))

    def _fill(self, pending: list[Panel]) -> list[Panel]:
        """Solve panels and set their bins; return those whose series has not converged."""
        nodes = [_nodes(panel) for panel in pending]
        field_m, error_m = self._solved(self.scene, self.line.at(np.concatenate(nodes)))
        ends = np.cumsum([node.size for node in nodes])[:-1]
        parts = zip(pending, np.split(field_m, ends), np.split(error_m, ends), strict=True)
        left_m = []
        for (first, stop), value, error in parts:
            bins, rest_m = value, np.zeros(value.shape[1])
            if stop - first > _NODES:
                bins, rest_m = _interpolated(first, stop, value)
            drive = self._spectrum[first:stop, np.newaxis]
            self.values[first:stop] = bins * drive
            beyond = self._limits_hz <= first * self.line.step_hz
            self.values[first:stop, beyond] = rest_m[beyond] = 0.0
            rest_m = np.where(rest_m <= _NOISE * np.max(error, axis=0), 0.0, rest_m)
            left_m.append(2 * rest_m * self._drive_within(first, stop))
        self._measure()
        allowed = _SHARE * self.rtol / math.sqrt(self.line.rise)
        return [
            panel
            for panel, left in zip(pending, left_m, strict=True)
            if np.any(left > allowed * self.peaks_m)
        ]

    def _drive_within(self, first: int, stop: int) -> float:
        """Return the integral of |S| over a panel."""
        return float(np.sum(np.abs(self._spectrum[first:stop]))) * self.line.step_hz

    def _measure(self) -> None:
        """Find the peaks over the span and after it from a fast transform."""
        n_times = 2 ** (2 * self.values.shape[0]).bit_length()
        t = np.arange(n_times) * (self.line.period_s / n_times)
        early, growth = t <= self.line.span_s, np.exp(self.line.decay_per_s * t)[:, np.newaxis]
        later = np.zeros_like(self.peaks_m)
        for start in range(0, later.size, _PAIRS_AT_ONCE):
            some = slice(start, start + _PAIRS_AT_ONCE)
            waves = np.fft.irfft(np.conj(self.values[:, some]), n_times, axis=0, norm="forward")
            size = np.abs(waves) * growth * self.line.step_hz
            self.peaks_m[some] = np.max(size[early], axis=0)
            later[some] = np.max(size[~early], axis=0)
        moved = self.peaks_m > 0
        self.late = float(np.max(later[moved] / self.peaks_m[moved], initial=0.0))

    def _halves(self, panel: Panel) -> list[Panel]:
        """Return the halves of a panel that have energy; the others are set to 0."""
        first, stop = panel
        middle = (first + stop) // 2
        return [half for half in ((first, middle), (middle, stop)) if not self._zero_if_idle(half)]

    def _zero_if_idle(self, panel: Panel) -> bool:
        """Set the bins of a panel to 0 if it cannot count; return whether it was so."""
        first, stop = panel
        near_m = self._tail.near(first * self.line.step_hz, stop * self.line.step_hz)
        most_m = 2 * near_m * self._drive_within(first, stop) * self.line.rise
        if np.any(most_m > _IDLE * self.rtol * self.peaks_m):
            return False
        self.values[first:stop] = 0.0
        self.n_idle += stop - first
        return True

    def _above(self, end: int) -> list[Panel]:
        """Return the octaves by which the range grows; it ends at limits of pairs in between."""
        found: list[Panel] = []
        top = self._spectrum.size
        limits = {self._bin_above(float(limit_hz)) for limit_hz in self._limits_hz}
        while top < end:
            found.append((top, min(2 * top, end, *(one for one in limits if one > top))))
            top = found[-1][1]
        self._extend(top)
        return [panel for panel in found if not self._zero_if_idle(panel)]

    def _refuse_if_short(self) -> None:
        """Refuse what is out of reach, as soon as the range holds most of the response."""
        if self._spectrum.size < self._bin_above(_MOST_RESPONSE * self.scene.strip.cutoff_hz()):
            return
        moved = self.peaks_m > 0
        least = self._tail.least_m[moved] / (_TAIL * self.peaks_m[moved])
        worst = float(np.max(least, initial=0.0))
        if worst > self.rtol:
            raise SpectrumTailError(
                rtol=self.rtol, min_rtol=1.2 * worst, highest_hz=float(np.min(self._limits_hz))
            )


def swept(scene: Scene, drive: Drive, line: ComplexLine, rtol: float) -> PanelSweep:
    """Return field times drive at all bins that count.

    `rtol` is relative to the peak of each pair of a load and a point. With `skip` False in the
    scene every bin up to the end of the range is solved.

    ValueError where the drive reaches so far beyond the frequencies of the field that `rtol` is out
    of reach.

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> from stimuli.field.panels import line_for
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125),))
    >>> burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    >>> found = swept(scene, burst, line_for(0.01, 1e-3), 1e-3)
    >>> found.n_solved < found.values.shape[0]
    True
    """
    sweep = PanelSweep(scene=replace(scene, skip=True), drive=drive, line=line, rtol=rtol)
    sweep.run()
    if not scene.skip:
        sweep.solve_every_bin(scene)
    return sweep


def _nodes(panel: Panel) -> Real:
    """Return the nodes of a panel in bins."""
    first, stop = panel
    if stop - first <= _NODES:
        return np.arange(first, stop, dtype=np.float64)
    return np.asarray((first + stop) / 2 + (stop - first) / 2 * np.cos(_ANGLES))


def _interpolated(first: int, stop: int, value: Complex) -> tuple[Complex, Real]:
    """Return a panel's series at its bins, and the size of its last two terms."""
    series = _TO_SERIES @ value
    place = (2 * np.arange(first, stop) - first - stop) / (stop - first)
    waves = np.cos(_ORDERS * np.arccos(place)[:, np.newaxis])
    return waves @ series, np.abs(series[-1]) + np.abs(series[-2])
