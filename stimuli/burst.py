"""Sine bursts: what they are and their samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli import energy, spectrum
from stimuli.checks import finite, whole
from stimuli.windows import WINDOWS, Window, taper

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

LEAST_SAMPLES_PER_CYCLE: Final = 4
"""Twice Nyquist's rate: the carrier and the upper half of its main lobe stay below rate / 2."""

MOST_SAMPLES: Final = 10_000_000

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

    def samples(self, sample_rate_hz: float) -> NDArray[np.float64]:
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

    def spectrum(self, frequencies_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the exact spectrum int s(t) exp(+i omega t) dt, equations (20) and (60).

        Parameters
        ----------
        frequencies_hz : array_like of float or complex
            Frequencies, real or above the real axis; S(-conj f) is the conjugate of S(f).

        Returns
        -------
        ndarray of complex128, shape of `frequencies_hz`
            Spectrum of the burst of unit amplitude, in seconds.

        Raises
        ------
        ValueError
            If the frequencies are not finite, lie below the real axis or reach beyond 1e15 / T.

        Examples
        --------
        A burst of sine cycles has no mean, and its spectrum at the carrier is i T / 2:

        >>> Burst(frequency_hz=500.0, cycles=1, window="none").spectrum([0.0, 500.0]).round(9)
        array([0.+0.j   , 0.+0.001j])
        """
        return spectrum.burst_spectrum(self, frequencies_hz)

    def peak_hz(self) -> float:
        """Return the frequency of the largest absolute value of the spectrum.

        Examples
        --------
        The fewer the cycles, the further the peak lies from the carrier:

        >>> [round(Burst(frequency_hz=500.0, cycles=n, window="none").peak_hz(), 3)
        ...  for n in (1, 2, 3)]
        [418.736, 480.705, 491.499]
        """
        return spectrum.peak_hz(self)

    def band_hz(self) -> tuple[float, float]:
        """Return the half-power band: lower and upper edge about the peak.

        Examples
        --------
        >>> lower, upper = Burst(frequency_hz=500.0, cycles=1, window="none").band_hz()
        >>> round(lower, 3), round(upper, 3)
        (205.634, 654.393)
        """
        return spectrum.band_hz(self)

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
        return energy.energy_above(self, frequency_hz)

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


def _sine_of_cycles(cycle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sin(2 pi cycle) for 0 <= cycle < 1, exactly 0 at every half cycle."""
    halves = np.floor(2 * cycle)
    rest = cycle - halves / 2
    return (1 - 2 * halves) * np.sin(2 * np.pi * np.minimum(rest, 0.5 - rest))
