"""The spectrum of a burst, its half-power band, and the check of a burst against a strip."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev

from stimuli.checks import finite, finite_array, instance
from stimuli.energy import staircase_energy_above
from stimuli.windows import MOST_Y, transform

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from stimuli.burst import Burst
    from stimuli.drive import Drive
    from stimuli.strip import Strip

_LOBE_DEGREE: Final = 60
"""The lobe is 4 wide in y and its fastest oscillation has period 1: 60 leaves 1e-16."""

_REAL: Final = 1e-9
"""A root of the lobe's series is real if its imaginary part is smaller."""


def burst_spectrum(burst: Burst, frequencies_hz: ArrayLike) -> NDArray[np.complex128]:
    """Return the exact spectrum of a burst; see `Burst.spectrum`, equation (20)."""
    frequencies = upper_half_plane("frequencies_hz", frequencies_hz)
    most_hz = MOST_Y / burst.duration_s
    if np.any(np.abs(frequencies) > most_hz):
        raise ValueError(f"frequencies_hz must lie within +-{most_hz:g}, got {frequencies_hz!r}")
    off_axis = frequencies.imag > 0
    values = np.empty(frequencies.shape, dtype=np.complex128)
    values[~off_axis] = _real_spectrum(burst, frequencies[~off_axis].real)
    values[off_axis] = _complex_spectrum(burst, frequencies[off_axis])
    return values


def upper_half_plane(name: str, values: ArrayLike) -> NDArray[np.complex128]:
    """Return numbers as an array of complex128 of the same shape, or refuse them.

    Raises
    ------
    ValueError
        If they are not numbers, not all finite, or one of them lies below the real axis.

    Examples
    --------
    >>> upper_half_plane("frequencies_hz", [0.0, 1.0 - 1.0j])
    Traceback (most recent call last):
    ValueError: frequencies_hz must hold finite numbers with imaginary parts >= 0,
    got [0.0, (1-1j)]
    """
    numbers = np.asarray(values)
    if numbers.dtype.kind != "c":
        return finite_array(name, numbers).astype(np.complex128)
    if not np.all(np.isfinite(numbers)) or np.any(numbers.imag < 0):
        raise ValueError(
            f"{name} must hold finite numbers with imaginary parts >= 0, got {values!r}"
        )
    return numbers.astype(np.complex128)


def _real_spectrum(burst: Burst, frequencies: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the spectrum at real frequencies."""
    nearest, rest = _split(np.abs(frequencies), burst)
    amplitude = transform(burst.window, burst.cycles).amplitude(nearest, rest)
    sign = 1 - 2 * np.mod(nearest - burst.cycles, 2.0)
    # B is odd: no rounding is left at f = 0
    phase = np.where(frequencies == 0, 0.0, sign) * np.exp(1j * np.pi * rest)
    values = 1j * burst.duration_s * amplitude * phase
    return np.asarray(np.where(frequencies < 0, np.conj(values), values), dtype=np.complex128) + 0


def _complex_spectrum(burst: Burst, frequencies: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return the spectrum above the real axis, equation (60); S(-conj f) is conj S(f)."""
    nearest, rest = _split(np.abs(frequencies.real), burst)
    rise = 1j * (frequencies.imag * burst.duration_s)
    turned = transform(burst.window, burst.cycles).turned(nearest, rest + rise)
    values = 1j * burst.duration_s * turned
    return np.asarray(np.where(frequencies.real < 0, np.conj(values), values))


def _split(
    frequencies_hz: NDArray[np.float64], burst: Burst
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return y = f T as the nearest whole number and a rest that is exact in all its digits."""
    nearest = np.rint(frequencies_hz * burst.cycles / burst.frequency_hz)
    high, low = _product(frequencies_hz, float(burst.cycles))
    whole_high, whole_low = _product(nearest, burst.frequency_hz)
    return nearest, ((high - whole_high) + (low - whole_low)) / burst.frequency_hz


def _product(a: NDArray[np.float64], b: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the product of two numbers and its rounding error (Dekker's product)."""
    splitter = 2.0**27 + 1
    a_high = splitter * a - (splitter * a - a)
    b_high = splitter * b - (splitter * b - b)
    a_low, b_low = a - a_high, b - b_high
    high = a * b
    return high, a_low * b_low - (((high - a_high * b_high) - a_low * b_high) - a_high * b_low)


def peak_hz(burst: Burst) -> float:
    """Return the peak of a burst's spectrum; see `Burst.peak_hz`."""
    return _peak_y(_main_lobe(burst)) / burst.duration_s


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


def _real_roots(series: Chebyshev) -> NDArray[np.float64]:
    """Return the real roots in the domain of a series."""
    roots = np.atleast_1d(series.roots())
    low, high = series.domain
    real = roots[np.abs(roots.imag) < _REAL].real
    return np.sort(real[(real > low) & (real < high)])


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstCheck:
    """What the check of a burst against a strip found.

    The energies decide: the burst is fit if neither the ideal burst nor its staircase has more
    than `max_energy_above_cutoff` of its energy above the cut-off. A half-power band that reaches
    above the cut-off is a reason beside them, never the only one.

    Attributes
    ----------
    cutoff_hz : float
        First cut-off of the strip.
    peak_hz : float
        Peak of the burst's spectrum.
    band_hz : tuple of float
        Half-power band, lower and upper edge.
    energy_above_cutoff : float
        Fraction of the ideal burst's energy above the cut-off.
    staircase_energy_above_cutoff : float
        The same for the samples held at `sample_rate_hz`.
    max_energy_above_cutoff : float
        The largest fraction that is fit.
    sample_rate_hz : float
        Sample rate of the device.

    Examples
    --------
    >>> check = BurstCheck(cutoff_hz=2900.0, peak_hz=419.0, band_hz=(206.0, 654.0),
    ...     energy_above_cutoff=3e-4, staircase_energy_above_cutoff=1.3e-2,
    ...     max_energy_above_cutoff=1e-2, sample_rate_hz=8000.0)
    >>> check.fit, len(check.reasons)
    (False, 1)
    """

    cutoff_hz: float
    peak_hz: float
    band_hz: tuple[float, float]
    energy_above_cutoff: float
    staircase_energy_above_cutoff: float
    max_energy_above_cutoff: float
    sample_rate_hz: float

    def __post_init__(self) -> None:
        shares = ("energy_above_cutoff", "staircase_energy_above_cutoff", "max_energy_above_cutoff")
        for name in shares:
            finite(name, getattr(self, name), least=0.0, most=1.0)

    @property
    def fit(self) -> bool:
        """Whether both energies keep the limit."""
        return not self.reasons

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the burst is unfit, a sentence each; empty if it is fit."""
        shares = (
            ("the ideal burst", self.energy_above_cutoff),
            (f"its staircase at {self.sample_rate_hz:g} Hz", self.staircase_energy_above_cutoff),
        )
        reasons = [
            f"{what} has {share:.3g} of its energy above the strip's cut-off of "
            f"{self.cutoff_hz:.6g} Hz; the limit is {self.max_energy_above_cutoff:g}"
            for what, share in shares
            if share > self.max_energy_above_cutoff
        ]
        if reasons and self.band_hz[1] > self.cutoff_hz:
            reasons.append(
                f"the half-power band reaches to {self.band_hz[1]:.6g} Hz, above the cut-off"
            )
        return tuple(reasons)


def check_burst(
    burst: Drive,
    strip: Strip,
    sample_rate_hz: float = 48_000.0,
    max_energy_above_cutoff: float = 1e-2,
) -> BurstCheck:
    """Check that a burst, or another drive, stays below the cut-off of a strip.

    Parameters
    ----------
    burst : Drive
        The burst, or any other drive; a held `SampledDrive` is its own staircase.
    strip : Strip
        The strip; its first cut-off counts.
    sample_rate_hz : float
        Sample rate of the device that plays the burst.
    max_energy_above_cutoff : float
        The largest fraction of the energy, from 0 to 1, that may lie above the cut-off.

    Returns
    -------
    BurstCheck
        Cut-off, band and energies; whether the burst is fit, and why not.

    Raises
    ------
    ValueError
        If burst or strip is none, the limit is not from 0 to 1, or the drive's `samples` refuses
        the rate.

    Notes
    -----
    Source: paper, sections II-B and V (frequencies below the cut-off stay confined). The band
    alone misses the energy that carries furthest, so the energies decide.

    Examples
    --------
    The paper's burst is fit for a strip whose cut-off was measured as 2900 Hz, but not when it is
    played at 8 kHz:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, Strip
    >>> plate = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
    >>> check_burst(burst, plate.with_cutoff(2900.0)).fit
    True
    >>> check_burst(burst, plate.with_cutoff(2900.0), sample_rate_hz=8000.0).fit
    False
    """
    from stimuli.drive import Drive
    from stimuli.strip import Strip

    instance("burst", burst, Drive, "a Burst or another Drive")
    instance("strip", strip, Strip, "a Strip")
    limit = finite("max_energy_above_cutoff", max_energy_above_cutoff, least=0.0, most=1.0)
    cutoff_hz = strip.cutoff_hz()
    return BurstCheck(
        cutoff_hz=cutoff_hz,
        peak_hz=burst.peak_hz(),
        band_hz=burst.band_hz(),
        energy_above_cutoff=burst.energy_above(cutoff_hz),
        staircase_energy_above_cutoff=staircase_energy_above(burst, cutoff_hz, sample_rate_hz),
        max_energy_above_cutoff=limit,
        sample_rate_hz=float(sample_rate_hz),
    )
