"""How much energy lies above a frequency: of a burst's transform, and of samples held."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.polynomial.polynomial import polyval

from stimuli.checks import finite, finite_array
from stimuli.drive.windows import FAR, MOST_Y

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Real
    from stimuli.drive.windows import Transform


_PANEL_NODES: Final = 16

_COSINE_SERIES: Final = [
    (-1.0) ** (k + 1) / (math.factorial(2 * k) * (2 * k - 1)) for k in range(11)
]
_FRACTION_TERMS: Final = ((1.0, 4.0, 200), (4.0, math.inf, 60))
"""Terms that give the cosine tail to 2e-16 between two values of x."""


def energy_above(shape: Transform, cycles: int, y: float) -> float:
    """Return the energy fraction of a burst above y = f T, equation (24).

    The tail itself is integrated above the carrier y = N, the rest below it: whichever is not
    small is what the other would lose its digits against.

    Examples
    --------
    >>> from stimuli.drive.windows import transform
    >>> round(energy_above(transform("none", 1), 1, 3.8), 9)
    0.001168723
    """
    total = shape.mean_square / 2
    if y <= cycles:
        far = _energy_far(shape, cycles, 0.0, min(y, cycles - FAR))
        return 1.0 - (far + _energy_near(shape, max(0.0, cycles - FAR), y)) / total
    near = _energy_near(shape, y, cycles + FAR)
    return (near + _energy_far(shape, cycles, max(y, cycles + FAR), math.inf)) / total


def _energy_near(shape: Transform, low: float, high: float) -> float:
    """Return the integral of B^2 over a range near the carrier, 0 if the range is empty."""
    if low >= high:
        return 0.0
    y, weights = panels(np.linspace(low, high, 2 + math.floor(2 * (high - low))))
    values = shape.amplitude(np.rint(y), y - np.rint(y))
    return float(weights @ (values * values))


def _energy_far(shape: Transform, cycles: int, low: float, high: float) -> float:
    """Return the integral of B^2 over a range beyond `FAR` from the carrier, 0 if it is empty.

    The smooth part is summed over panels that double with the distance from the carrier. Each end
    of the ripple is integrated along Im y > 0, where it decays, equation (24).
    """
    if low >= high:
        return 0.0
    side = 1.0 if low > cycles else -1.0
    ends = [abs(low - cycles), abs(high - cycles)]
    if math.isinf(high):
        # twenty doublings beyond the mirror image at y = -N leave less than 1e-17
        ends[1] = 2.0**20 * max(ends[0], 2.0 * cycles)
    count = 2 + math.floor(abs(math.log2(ends[1] / ends[0])))
    r, weights = panels(np.geomspace(min(ends), max(ends), count))
    smooth = float(weights @ shape.smooth(cycles + side * r))
    return smooth + _ripple_end(shape, low) - _ripple_end(shape, high)


def _ripple_end(shape: Transform, y: float) -> float:
    """Return the integral of the ripple from y to infinity."""
    if math.isinf(y):
        return 0.0
    s, weights = panels(np.array([0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0]))
    path = y + 1j * s.astype(np.complex128)
    return -float(weights @ np.imag(shape.ripple(path)))


def panels(edges: Real) -> tuple[Real, Real]:
    """Return nodes and weights of Gauss's rule on every panel between two edges."""
    nodes, weights = _gauss_rule()
    half = np.diff(edges)[:, np.newaxis] / 2
    middle = (edges[:-1, np.newaxis] + edges[1:, np.newaxis]) / 2
    return (middle + half * nodes).ravel(), (half * weights).ravel()


@cache
def _gauss_rule() -> tuple[Real, Real]:
    return leggauss(_PANEL_NODES)


def staircase_energy_above(
    samples: ArrayLike, *, sample_rate_hz: float, frequency_hz: float
) -> float:
    """Return the energy fraction above a frequency of samples as a converter holds them.

    The samples, each held for 1 / rate (zero-order hold), make a staircase. Its steps give the
    spectrum exactly, images at all multiples of the rate included, equation (25); the total is
    Parseval's sum of the squared samples.

    Parameters
    ----------
    samples : array_like of float, shape (n_samples,)
        Samples of any unit, at least one, not all 0; before and after them is 0.
    sample_rate_hz : float
        Their sample rate.
    frequency_hz : float
        Frequency F, at least 0.

    Returns
    -------
    float
        Fraction of the one-sided energy, from 0 to 1. Its absolute error is near
        1e-16 (1 + N f0 / F) for N cycles of f0, so a fraction below 1e-12 has few digits left.

    Raises
    ------
    ValueError
        If the samples are none, all 0 or not finite, the rate is not above 0, or the frequency
        is negative, not finite or beyond 1e15 sample rates.

    Examples
    --------
    A finer staircase has less energy above the cut-off, but never less than the burst itself:

    >>> from stimuli import Burst
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
    >>> for rate_hz in (8e3, 48e3, 1e6):
    ...     samples = burst.samples(rate_hz)
    ...     share = staircase_energy_above(samples, sample_rate_hz=rate_hz, frequency_hz=1900.0)
    ...     print(round(share, 5))
    0.01453
    0.00154
    0.00117
    """
    values = finite_array("samples", samples)
    if values.ndim != 1 or not np.any(values):
        raise ValueError(
            f"samples must be a one-dimensional array of numbers, not all 0, got {samples!r}"
        )
    rate_hz = finite("sample_rate_hz", sample_rate_hz, above=0.0)
    frequency_hz = finite("frequency_hz", frequency_hz, least=0.0, most=MOST_Y * rate_hz)
    if frequency_hz == 0.0:
        return 1.0
    lags = _autocorrelation(_steps(values))
    turns = 2 * math.pi * frequency_hz / rate_hz * np.arange(lags.size, dtype=np.float64)
    lags[1:] *= 2.0
    energy = float(lags @ _cosine_tail(turns)) / (2 * math.pi**2 * frequency_hz / rate_hz)
    return min(max(energy / float(values @ values), 0.0), 1.0)


def _steps(samples: Real) -> Real:
    """Return the steps of the staircase, with those from 0 and to 0 where there are any."""
    first, last = samples[:1], samples[-1:]
    return np.diff(samples, prepend=0 * first[first != 0], append=0 * last[last != 0])


def _autocorrelation(steps: Real) -> Real:
    """Return the sums of steps[i] steps[i + lag] for the lags 0 ... size - 1."""
    line = np.fft.rfft(steps, 2 ** (2 * steps.size - 1).bit_length())
    return np.fft.irfft(line.real**2 + line.imag**2)[: steps.size]


def _cosine_tail(x: Real) -> Real:
    """Return x times the integral of cos(t) / t^2 from x to infinity, equation (25); 1 at x = 0.

    A power series up to x = 1; beyond, the real part of the exponential integral E_2(-i x) by
    its continued fraction, which needs the fewer terms the larger x is.
    """
    tail: Real = polyval(np.minimum(x, 1.0) ** 2, _COSINE_SERIES) - np.pi / 2 * x
    for low, high, terms in _FRACTION_TERMS:
        inside = (x > low) & (x <= high)
        z = -1j * x[inside]
        rest = np.zeros_like(z)
        for k in range(terms, 0, -1):
            rest = k * (k + 1) / (z + 2 * k + 2 - rest)
        tail[inside] = np.real(np.exp(-z) / (z + 2 - rest))
    return tail
