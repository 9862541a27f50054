"""What drives a load over time: the protocol of a drive, and drives given by samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol, runtime_checkable

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev

from stimuli.checks import finite, finite_array, instance
from stimuli.drive.energy import panels

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real


MOST_SAMPLES: Final = 1_000_000

_FINER: Final = 8
"""Frequencies of the search for the peak per 1 / duration."""

_ROUNDING: Final = 1e-9
"""Of a place among the samples."""
_CELL_DEGREE: Final = 16
_PERIODS_A_PANEL: Final = 4
_REAL: Final = 1e-6
"""A root of a cell's series is real if its imaginary part is a smaller part of the cell."""


@runtime_checkable
class Drive(Protocol):
    """What a load may be driven with: a signal of unit amplitude that begins at t = 0 and ends.

    `stimuli.Burst` and `SampledDrive` are drives, and whatever else has these methods.

    Examples
    --------
    >>> from stimuli import Burst, Drive
    >>> isinstance(Burst(frequency_hz=500.0), Drive)
    True
    """

    @property
    def duration_s(self) -> float:
        """Time after which the signal is 0."""

    def at(self, times_s: ArrayLike) -> Real:
        """Return the signal at some times.

        Parameters
        ----------
        times_s : array_like of float

        Returns
        -------
        ndarray of float64, shape of `times_s`
            In units of the load's amplitude; 0 before and after the drive.
        """

    def spectrum(self, frequencies_hz: ArrayLike) -> Complex:
        """Return int s(t) exp(+i omega t) dt, in seconds.

        Parameters
        ----------
        frequencies_hz : array_like of float

        Returns
        -------
        ndarray of complex128, shape of `frequencies_hz`
        """

    def peak_hz(self) -> float:
        """Return the frequency of the largest absolute value of the spectrum, in Hz.

        Returns
        -------
        float
        """

    def band_hz(self) -> tuple[float, float]:
        """Return the half-power band about the peak.

        Returns
        -------
        tuple of float
            Lower and upper edge in Hz.
        """

    def energy_above(self, frequency_hz: float) -> float:
        """Return the fraction, from 0 to 1, of the one-sided energy above a frequency.

        Parameters
        ----------
        frequency_hz : float
            Frequency, at least 0.

        Returns
        -------
        float
        """

    def samples(self, sample_rate_hz: float) -> Real:
        """Return the samples that a converter of this rate is given.

        Parameters
        ----------
        sample_rate_hz : float
            Its rate.

        Returns
        -------
        ndarray of float64, shape (n_samples,)
            In units of the load; a burst's lie from -1 to 1.
        """


@dataclass(frozen=True, slots=True, init=False)
class SampledDrive:
    """A signal given by its samples: any click or recording; from t = 0, and 0 before and after.

    Parameters
    ----------
    samples : array_like of float, shape (n_samples,)
        Samples in units of the load's amplitude, from 1 (straight lines: 3) to 1e6 of them, not
        all 0. For straight lines the first and the last must be 0: add a 0 where they are not.
    sample_rate_hz : float
        Sample rate, from 1e-3 to 1e9 Hz.
    held : bool
        Whether each sample is held for 1 / rate, as by a converter (zero-order hold): then the
        signal lasts n_samples / rate. Else straight lines join the samples, and it lasts
        (n_samples - 1) / rate.

    Attributes
    ----------
    values : tuple of float
        The samples.

    Raises
    ------
    ValueError
        If an argument is out of its range, or straight lines would begin or end with a jump.

    Examples
    --------
    A staircase of many steps has the spectrum of the burst it was taken from, half a step later:

    >>> from stimuli import Burst
    >>> burst = Burst(frequency_hz=500.0, cycles=2, window="hann")
    >>> drive = SampledDrive(samples=burst.samples(48e3), sample_rate_hz=48e3, held=True)
    >>> late = np.exp(1j * np.pi * 500.0 / 48e3)
    >>> bool(abs(drive.spectrum(500.0) / (burst.spectrum(500.0) * late) - 1) < 1e-3)
    True
    """

    values: tuple[float, ...]
    sample_rate_hz: float
    held: bool

    def __init__(self, *, samples: ArrayLike, sample_rate_hz: float, held: bool = False) -> None:
        instance("held", held, bool, "True or False")
        values = finite_array("samples", samples)
        least = 1 if held else 3
        if values.ndim != 1 or not least <= values.size <= MOST_SAMPLES or not np.any(values):
            raise ValueError(
                f"samples must be a one-dimensional array of {least} to {MOST_SAMPLES} numbers, "
                f"not all 0, got shape {values.shape}"
            )
        if not held and (values[0] or values[-1]):
            raise ValueError(
                "samples must begin and end with 0 for straight lines (held=False), "
                f"got {float(values[0])!r} and {float(values[-1])!r}"
            )
        rate_hz = finite("sample_rate_hz", sample_rate_hz, least=1e-3, most=1e9)
        object.__setattr__(self, "values", tuple(values.tolist()))
        object.__setattr__(self, "sample_rate_hz", rate_hz)
        object.__setattr__(self, "held", held)

    @property
    def duration_s(self) -> float:
        """Duration: a step for each sample if held, else one for each straight line."""
        return (len(self.values) - (0 if self.held else 1)) / self.sample_rate_hz

    def samples(self, sample_rate_hz: float) -> Real:
        """Return the samples that a converter of this rate is given.

        Parameters
        ----------
        sample_rate_hz : float
            The drive's own sample rate: nothing is resampled.

        Returns
        -------
        ndarray of float64, shape (n_samples,)

        Raises
        ------
        ValueError
            If the rate is another one.

        Examples
        --------
        >>> SampledDrive(samples=[0, 1, 0], sample_rate_hz=8e3).samples(8e3).tolist()
        [0.0, 1.0, 0.0]
        """
        rate_hz = finite("sample_rate_hz", sample_rate_hz, above=0.0)
        if rate_hz != self.sample_rate_hz:
            raise ValueError(
                f"sample_rate_hz must be the drive's own {self.sample_rate_hz!r} Hz: samples are "
                f"not resampled, got {sample_rate_hz!r}"
            )
        return np.array(self.values)

    def at(self, times_s: ArrayLike) -> Real:
        """Return the signal at some times.

        Parameters
        ----------
        times_s : array_like of float

        Returns
        -------
        ndarray of float64, shape of `times_s`
            Straight lines between samples, or the sample that is held; 0 before and after.

        Examples
        --------
        >>> for held in (False, True):
        ...     drive = SampledDrive(samples=[0, 1, 0], sample_rate_hz=1e3, held=held)
        ...     print(drive.at([-1.0, 0.0, 0.0005, 0.001, 0.0015, 0.003]).tolist())
        [0.0, 0.0, 0.5, 1.0, 0.5, 0.0]
        [0.0, 0.0, 0.0, 1.0, 1.0, 0.0]
        """
        place = finite_array("times_s", times_s) * self.sample_rate_hz
        if self.held:
            number = np.floor(place + _ROUNDING).astype(np.intp) + 1
            padded = np.array([0.0, *self.values, 0.0])
            return np.asarray(padded[np.clip(number, 0, padded.size - 1)])
        return np.interp(place, np.arange(len(self.values)), self.values)

    def spectrum(self, frequencies_hz: ArrayLike) -> Complex:
        """Return the exact spectrum int s(t) exp(+i omega t) dt, equation (26).

        Parameters
        ----------
        frequencies_hz : array_like of float

        Returns
        -------
        ndarray of complex128, shape of `frequencies_hz`
            In seconds; the images at the multiples of the sample rate are part of it.

        Raises
        ------
        ValueError
            If the frequencies are not finite.

        Examples
        --------
        At 0 Hz it is the area:

        >>> drive = SampledDrive(samples=[0, 1, 1, 0], sample_rate_hz=8e3)
        >>> drive.spectrum([0.0]).round(9)
        array([0.00025+0.j])
        """
        frequencies = finite_array("frequencies_hz", frequencies_hz)
        steps = frequencies.ravel() / self.sample_rate_hz
        one = _held_step(np.asarray(2j * np.pi * steps, dtype=np.complex128))
        values = np.array(self.values)
        if not self.held:
            # the triangle about a sample begins a step earlier; the first sample is 0
            one, values = one * one, values[1:]
        sums = _exponential_sums(values, steps - np.floor(steps))
        return (sums * one / self.sample_rate_hz).reshape(frequencies.shape)

    def peak_hz(self) -> float:
        """Return the frequency of the largest absolute value of the spectrum, in Hz.

        Returns
        -------
        float

        Examples
        --------
        A signal of one sign has its peak at 0 Hz:

        >>> SampledDrive(samples=[0, 1, 0], sample_rate_hz=8e3).peak_hz()
        0.0
        """
        return self._peak()[0]

    def band_hz(self) -> tuple[float, float]:
        """Return the half-power band about the peak.

        Returns
        -------
        tuple of float
            Lower and upper edge in Hz; the lower is 0 where the band reaches down to 0 Hz.

        Examples
        --------
        >>> lower, upper = SampledDrive(samples=[1.0], sample_rate_hz=1e3, held=True).band_hz()
        >>> lower, round(upper, 3)
        (0.0, 442.946)
        """
        peak_hz, power = self._peak()
        frequencies, powers = self._grid()
        at = int(np.searchsorted(frequencies, peak_hz))
        weak = powers < power / 2
        below, above = np.flatnonzero(weak[:at]), np.flatnonzero(weak[at:])
        lower = self._crossing(int(below[-1]), frequencies, power) if below.size else 0.0
        return lower, self._crossing(int(above[0]) + at - 1, frequencies, power)

    def energy_above(self, frequency_hz: float) -> float:
        """Return the fraction of the one-sided energy above a frequency, equation (27).

        Parameters
        ----------
        frequency_hz : float
            Frequency, from 0 to 1e12 sample rates.

        Returns
        -------
        float
            Fraction from 0 to 1, images at the multiples of the sample rate included.

        Raises
        ------
        ValueError
            If the frequency is negative or not finite.

        Examples
        --------
        The same energy as by the steps of the staircase:

        >>> from stimuli import Burst, staircase_energy_above
        >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
        >>> drive = SampledDrive(samples=burst.samples(8e3), sample_rate_hz=8e3, held=True)
        >>> by_steps = staircase_energy_above(drive.values, sample_rate_hz=8e3,
        ...                                   frequency_hz=1900.0)
        >>> round(drive.energy_above(1900.0) / by_steps, 9)
        1.0
        """
        most_hz = 1e12 * self.sample_rate_hz
        first = finite("frequency_hz", frequency_hz, least=0.0, most=most_hz) / self.sample_rate_hz
        if first == 0:
            return 1.0
        above = 2 * sum(
            float(
                weights @ (square * (self._images(place, first) + self._images(1 - place, first)))
            )
            for place, weights, square in self._squares(abs(first - round(first)))
        )
        return min(max(above / self._square_sum(), 0.0), 1.0)

    def _squares(self, border: float) -> Iterator[tuple[Real, Real, Real]]:
        """Yield nodes, weights and |sum of s_k exp(2 pi i k node)|^2 from 0 to 1/2, split there.

        Panels of equal length have their nodes on as many uniform grids as a panel has nodes: each
        grid is a fast transform. The two parts of the panel at the border are summed directly.
        """
        values = np.array(self.values)
        n_panels = 1 + values.size // (2 * _PERIODS_A_PANEL)
        width, split = 0.5 / n_panels, min(int(2 * n_panels * border), n_panels - 1)
        first, weights = panels(np.array([0.0, width]))
        folded = np.zeros(-(-values.size // (2 * n_panels)) * 2 * n_panels, dtype=np.complex128)
        others = np.arange(n_panels) != split
        for node, weight in zip(first, weights, strict=True):
            folded[: values.size] = values * np.exp(2j * np.pi * node * np.arange(values.size))
            grid = np.fft.ifft(folded.reshape(-1, 2 * n_panels).sum(axis=0), norm="forward")
            place = node + width * np.arange(n_panels)
            square = np.abs(grid[:n_panels]) ** 2
            yield place[others], weight * others[others], square[others]
        edges = np.unique([split * width, border, (split + 1) * width])
        place, rest = panels(edges)
        yield place, rest, np.abs(_exponential_sums(values, place)) ** 2

    def _images(self, place: Real, first: float) -> Real:
        """Return the sum of |spectrum of one sample|^2 over place + 0, 1, 2, ... beyond first."""
        from scipy.special import zeta

        power = 2 if self.held else 4
        start = place + np.maximum(0.0, np.ceil(first - place))
        return np.asarray((np.sin(np.pi * place) / np.pi) ** power * zeta(float(power), start))

    def _square_sum(self) -> float:
        """Return the energy times the sample rate."""
        values = np.array(self.values)
        if self.held:
            return float(values @ values)
        return float(2 * (values @ values) + values[1:] @ values[:-1]) / 3

    def _grid(self) -> tuple[Real, Real]:
        """Return frequencies up to the sample rate and |S|^2 there."""
        n = 2 ** (_FINER * len(self.values)).bit_length()
        half = np.abs(np.fft.rfft(self.values, n)) ** 2
        place = np.arange(n + 1) / n
        sums = np.append(half, half[-2::-1])
        return place * self.sample_rate_hz, self._power(sums, place)

    def _power(self, square_of_sums: Real, place: Real) -> Real:
        return np.asarray(square_of_sums * np.sinc(place) ** (2 if self.held else 4))

    def _series(self, low_hz: float, high_hz: float) -> Chebyshev:
        """Return |S|^2, in squared samples, between two frequencies that lie close together."""
        return Chebyshev.interpolate(self._at, _CELL_DEGREE, [low_hz, high_hz])

    def _at(self, frequencies_hz: Real) -> Real:
        return np.asarray(np.abs(self.spectrum(frequencies_hz) * self.sample_rate_hz) ** 2)

    def _peak(self) -> tuple[float, float]:
        """Return the peak's frequency and |S|^2, in squared samples."""
        frequencies, powers = self._grid()
        at = int(np.argmax(powers))
        low, high = frequencies[max(at - 1, 0)], frequencies[at + 1]
        series = self._series(float(low), float(high))
        roots = np.atleast_1d(series.deriv().roots())
        real = roots[np.abs(roots.imag) < _REAL * (high - low)].real
        places = np.append(np.clip(real, low, high), frequencies[at])
        best = float(places[np.argmax(self._at(places))])
        best = 0.0 if best < _REAL * (high - low) else best
        return best, float(self._at(np.array([best]))[0])

    def _crossing(self, cell: int, frequencies: Real, power: float) -> float:
        """Return where |S|^2 passes half of the peak's in a cell of the grid."""
        low, high = float(frequencies[cell]), float(frequencies[cell + 1])
        roots = np.atleast_1d((self._series(low, high) - power / 2).roots())
        inside = roots[np.abs(roots.imag) < _REAL * (high - low)].real
        middle = (low + high) / 2
        return float(np.clip(inside[np.argmin(np.abs(inside - middle))], low, high))


_MOST_TERMS: Final = 2_000_000
"""Exponentials that are held at once."""
_TINY = 1e-20
"""Below it, the spectrum of a step is 1 to double precision; a quotient of subnormals overflows."""


def _held_step(z: Complex) -> Complex:
    """Return (exp(z) - 1) / z, the spectrum of a step of length 1 and height 1."""
    tiny = np.abs(z) < _TINY
    return np.asarray(np.where(tiny, 1.0, np.expm1(z) / np.where(tiny, 1.0, z)))


def _exponential_sums(coefficients: Real, turns: Real) -> Complex:
    """Return the sums over k of c_k exp(2 pi i k turns), one for each angle in turns.

    With k = j B + b the exponentials are those of the b and of the j alone: n values of k and m
    places need m sqrt(n) exponentials, not m n, and two products of matrices.

    >>> _exponential_sums(np.array([1.0, 1.0, 1.0]), np.array([0.25])).round(9)
    array([0.+1.j])
    """
    length = max(1, math.isqrt(coefficients.size))
    n_blocks = -(-coefficients.size // length)
    padded = np.zeros(n_blocks * length)
    padded[: coefficients.size] = coefficients
    blocks = padded.reshape(n_blocks, length).T
    sums = np.empty(turns.size, dtype=np.complex128)
    n_at_once = max(1, _MOST_TERMS // (n_blocks + length))
    for start in range(0, turns.size, n_at_once):
        some = turns[start : start + n_at_once, np.newaxis]
        within = np.exp(2j * np.pi * some * np.arange(length)) @ blocks
        across = np.exp(2j * np.pi * some * (length * np.arange(n_blocks)))
        sums[start : start + n_at_once] = (across * within).sum(axis=1)
    return sums
