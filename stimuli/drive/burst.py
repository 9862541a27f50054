"""Sine bursts: what they are and their samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev

from stimuli.checks import finite, finite_array, whole
from stimuli.drive.energy import energy_above
from stimuli.drive.windows import MOST_Y, WINDOWS, Window, taper, transform

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real


LEAST_SAMPLES_PER_CYCLE: Final = 4
"""Twice Nyquist's rate: the carrier and the upper half of its main lobe stay below rate / 2."""

MOST_SAMPLES: Final = 10_000_000
_FINE_PER_CYCLE: Final = 600
_ALIKE_CYCLES: Final = 1000
"""Of more cycles the share of the energy differs by less than 1e-6."""

_WHOLE: Final = 1e-12
"""A number of samples this near to a whole one, relative to it, is whole but for rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Burst:
    """A whole number of sine cycles under a window, from t = 0, of unit amplitude.

    Attributes
    ----------
    frequency_hz : float
        Frequency f0 of the sine.
    cycles : int
        Number N of cycles, at least 1.
    window : {"none", "hann", "tukey", "gaussian"}
        Window over the whole burst; tukey has alpha = 0.5, gaussian sigma = duration / 6 about
        the middle.

    Raises
    ------
    ValueError
        If the frequency is not from 1e-6 to 1e9 Hz, the cycles are not a whole number from 1 to
        1e6, or the window is none of the four.

    Notes
    -----
    Source: paper, section IV-A (one cycle of 500 Hz, no window).

    Examples
    --------
    A window that hides the ends keeps the energy below the cut-off:

    >>> plain = Burst(frequency_hz=500.0, cycles=2, window="none")
    >>> smooth = Burst(frequency_hz=500.0, cycles=2, window="hann")
    >>> bool(smooth.energy_above(2900.0) < 1e-3 * plain.energy_above(2900.0))
    True
    """

    frequency_hz: float
    cycles: int = 1
    window: Window = "none"

    def __post_init__(self) -> None:
        frequency_hz = finite("frequency_hz", self.frequency_hz, least=1e-6, most=1e9)
        object.__setattr__(self, "frequency_hz", frequency_hz)
        cycles = whole("cycles", self.cycles, least=1, most=1_000_000)
        object.__setattr__(self, "cycles", cycles)
        if self.window not in WINDOWS:
            raise ValueError(f"window must be one of {', '.join(WINDOWS)}, got {self.window!r}")

    @property
    def duration_s(self) -> float:
        """Duration T = N / f0."""
        return self.cycles / self.frequency_hz

    @property
    def energy_duration_s(self) -> float:
        """Duration of a sine without window of the same frequency, greatest value and energy.

        Examples
        --------
        Of many cycles under Hann's window it is 3/8 of theirs, of one cycle 20/27:

        >>> one, many = (Burst(frequency_hz=250.0, cycles=n, window="hann") for n in (1, 1000))
        >>> round(one.energy_duration_s / one.duration_s * 27, 4)
        20.0
        >>> round(many.energy_duration_s / many.duration_s, 6)
        0.375
        """
        return self.duration_s * _energy_share(min(self.cycles, _ALIKE_CYCLES), self.window)

    def samples(self, sample_rate_hz: float) -> Real:
        """Return the burst at t = k / rate, k = 0 ... ceil(duration x rate).

        Parameters
        ----------
        sample_rate_hz : float
            Sample rate, at least 4 samples a cycle: the carrier and its main lobe need room
            below half the rate.

        Returns
        -------
        ndarray of float64, shape (ceil(duration x rate) + 1,)
            Values from -1 to 1. The first and the last are exactly 0; the last lies at the end
            of the burst or, where the burst is no whole number of samples, after it. Where it is,
            the samples are exactly antisymmetric about the middle.

        Raises
        ------
        ValueError
            If the rate is too low, or the burst would have more than 1e7 samples.

        Examples
        --------
        >>> Burst(frequency_hz=500.0, cycles=1, window="none").samples(4000.0).round(4).tolist()
        [0.0, 0.7071, 1.0, 0.7071, 0.0, -0.7071, -1.0, -0.7071, 0.0]
        """
        length = self._length_in_samples(sample_rate_hz)
        last = math.ceil(length)
        k = np.arange(last + 1, dtype=np.float64)
        # counted from the nearer end: the second half is the first one, backwards and negative
        near = np.clip(np.minimum(k, length - k), 0.0, None)
        cycle = np.fmod(near * self.cycles, length) / length
        values = taper(self.window, near / length) * _sine_of_cycles(cycle)
        values[k > length - k] *= -1.0
        values[[0, last]] = 0.0
        return values + 0.0

    def at(self, times_s: ArrayLike) -> Real:
        """Return the burst at some times.

        Parameters
        ----------
        times_s : array_like of float

        Returns
        -------
        ndarray of float64, shape of `times_s`
            From -1 to 1; 0 before and after the burst.

        Examples
        --------
        >>> Burst(frequency_hz=500.0).at([-0.001, 0.0, 0.0005, 0.0015, 0.01]).tolist()
        [0.0, 0.0, 1.0, -1.0, 0.0]
        """
        place = finite_array("times_s", times_s) / self.duration_s
        near = np.clip(np.minimum(place, 1 - place), 0.0, None)
        values = taper(self.window, near) * _sine_of_cycles(np.fmod(near * self.cycles, 1.0))
        return np.asarray(np.where(place > 1 / 2, -values, values) + 0.0)

    def spectrum(self, frequencies_hz: ArrayLike) -> Complex:
        """Return the exact spectrum int s(t) exp(+i omega t) dt, equation (20).

        Parameters
        ----------
        frequencies_hz : array_like of float
            Frequencies; S(-f) is the conjugate of S(f).

        Returns
        -------
        ndarray of complex128, shape of `frequencies_hz`
            Spectrum of the burst of unit amplitude, in seconds.

        Raises
        ------
        ValueError
            If the frequencies are not finite or reach beyond 1e15 / T.

        Examples
        --------
        A burst of sine cycles has no mean, and its spectrum at the carrier is i T / 2:

        >>> Burst(frequency_hz=500.0, cycles=1, window="none").spectrum([0.0, 500.0]).round(9)
        array([0.+0.j   , 0.+0.001j])
        """
        return burst_spectrum(self, frequencies_hz)

    def peak_hz(self) -> float:
        """Return the frequency of the largest absolute value of the spectrum.

        Returns
        -------
        float
            In Hz.

        Examples
        --------
        The fewer the cycles, the further the peak lies from the carrier:

        >>> [round(Burst(frequency_hz=500.0, cycles=n, window="none").peak_hz(), 3)
        ...  for n in (1, 2, 3)]
        [418.736, 480.705, 491.499]
        """
        return peak_hz(self)

    def band_hz(self) -> tuple[float, float]:
        """Return the half-power band about the peak.

        Returns
        -------
        tuple of float
            Lower and upper edge in Hz.

        Examples
        --------
        >>> lower, upper = Burst(frequency_hz=500.0, cycles=1, window="none").band_hz()
        >>> round(lower, 3), round(upper, 3)
        (205.634, 654.393)
        """
        return band_hz(self)

    def energy_above(self, frequency_hz: float) -> float:
        """Return the fraction of the one-sided energy above a frequency, equation (24).

        Parameters
        ----------
        frequency_hz : float
            Frequency, at least 0.

        Returns
        -------
        float
            Fraction from 0 to 1. Its relative error stays below 1e-12 up to 1000
            cycles however small it is; the rounding of f T adds about 1e-15 per cycle.

        Raises
        ------
        ValueError
            If the frequency is negative, not finite or beyond 1e15 / T.

        Examples
        --------
        >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
        >>> burst.energy_above(0.0), round(burst.energy_above(1900.0), 9)
        (1.0, 0.001168723)
        """
        most_hz = MOST_Y / self.duration_s
        frequency_hz = finite("frequency_hz", frequency_hz, least=0.0, most=most_hz)
        shape = transform(self.window, self.cycles)
        return energy_above(shape, self.cycles, frequency_hz * self.duration_s)

    def _length_in_samples(self, sample_rate_hz: float) -> float:
        """Return duration x rate, whole where it differs from a whole number by rounding."""
        least_hz = LEAST_SAMPLES_PER_CYCLE * self.frequency_hz
        rate_hz = finite("sample_rate_hz", sample_rate_hz, least=least_hz)
        length = self.cycles * rate_hz / self.frequency_hz
        if length + 1 > MOST_SAMPLES:
            raise ValueError(
                f"sample_rate_hz must give at most {MOST_SAMPLES} samples for a burst of "
                f"{self.duration_s:g} s, got {sample_rate_hz!r}"
            )
        nearest = float(round(length))
        return nearest if abs(length - nearest) <= _WHOLE * nearest else length


@lru_cache(maxsize=64)
def _energy_share(cycles: int, window: Window) -> float:
    """Return twice the mean square of a burst over the square of its greatest value."""
    length = cycles * _FINE_PER_CYCLE
    values = Burst(frequency_hz=1.0, cycles=cycles, window=window).samples(float(_FINE_PER_CYCLE))
    return 2 * float(values @ values) / length / float(np.max(np.abs(values))) ** 2


def _sine_of_cycles(cycle: Real) -> Real:
    """Return sin(2 pi cycle) for 0 <= cycle < 1, exactly 0 at every half cycle."""
    halves = np.floor(2 * cycle)
    rest = cycle - halves / 2
    values: Real = (1 - 2 * halves) * np.sin(2 * np.pi * np.minimum(rest, 0.5 - rest))
    return values


_LOBE_DEGREE: Final = 60
"""The lobe is 4 wide in y and its fastest oscillation has period 1: 60 leaves 1e-16."""

_REAL: Final = 1e-9
"""A root of the lobe's series is real if its imaginary part is smaller."""


def burst_spectrum(burst: Burst, frequencies_hz: ArrayLike) -> Complex:
    """Return the exact spectrum of a burst; see `Burst.spectrum`, equation (20)."""
    frequencies = finite_array("frequencies_hz", frequencies_hz)
    most_hz = MOST_Y / burst.duration_s
    if np.any(np.abs(frequencies) > most_hz):
        raise ValueError(f"frequencies_hz must lie within +-{most_hz:g}, got {frequencies_hz!r}")
    nearest, rest = _split(np.abs(frequencies), burst)
    amplitude = transform(burst.window, burst.cycles).amplitude(nearest, rest)
    sign = 1 - 2 * np.mod(nearest - burst.cycles, 2.0)
    # B is odd: no rounding is left at f = 0
    phase = np.where(frequencies == 0, 0.0, sign) * np.exp(1j * np.pi * rest)
    values = 1j * burst.duration_s * amplitude * phase
    return np.asarray(np.where(frequencies < 0, np.conj(values), values), dtype=np.complex128) + 0


def _split(frequencies_hz: Real, burst: Burst) -> tuple[Real, Real]:
    """Return y = f T as the nearest whole number and a rest that is exact in all its digits."""
    nearest = np.rint(frequencies_hz * burst.cycles / burst.frequency_hz)
    high, low = _product(frequencies_hz, float(burst.cycles))
    whole_high, whole_low = _product(nearest, burst.frequency_hz)
    return nearest, ((high - whole_high) + (low - whole_low)) / burst.frequency_hz


def _product(a: Real, b: float) -> tuple[Real, Real]:
    """Return the product of two numbers and its rounding error (Dekker's product)."""
    splitter = 2.0**27 + 1
    a_high = splitter * a - (splitter * a - a)
    b_high = splitter * b - (splitter * b - b)
    a_low, b_low = a - a_high, b - b_high
    high = a * b
    return high, a_low * b_low - (((high - a_high * b_high) - a_low * b_high) - a_high * b_low)


@lru_cache(maxsize=32)
def peak_hz(burst: Burst) -> float:
    """Return the peak of a burst's spectrum; see `Burst.peak_hz`."""
    return _peak_y(_main_lobe(burst)) / burst.duration_s


@lru_cache(maxsize=32)
def band_hz(burst: Burst) -> tuple[float, float]:
    """Return the half-power band of a burst; see `Burst.band_hz`."""
    lobe = _main_lobe(burst)
    peak = _peak_y(lobe)
    edges = _real_roots(lobe - lobe(peak) / math.sqrt(2))
    lower, upper = np.max(edges[edges < peak]), np.min(edges[edges > peak])
    return float(lower) / burst.duration_s, float(upper) / burst.duration_s


def _main_lobe(burst: Burst) -> Chebyshev:
    """Return B(y) about the carrier, y = N - 2 (or 0) to N + 2, to rounding."""
    shape = transform(burst.window, burst.cycles)
    domain = [max(0.0, burst.cycles - 2.0), burst.cycles + 2.0]
    return Chebyshev.interpolate(
        lambda y: shape.amplitude(np.rint(y), y - np.rint(y)), _LOBE_DEGREE, domain
    )


def _peak_y(lobe: Chebyshev) -> float:
    extrema = _real_roots(lobe.deriv())
    return float(extrema[np.argmax(np.abs(lobe(extrema)))])


def _real_roots(series: Chebyshev) -> Real:
    """Return the real roots in the domain of a series."""
    roots = np.atleast_1d(series.roots())
    low, high = series.domain
    real = roots[np.abs(roots.imag) < _REAL].real
    return np.sort(real[(real > low) & (real < high)])
