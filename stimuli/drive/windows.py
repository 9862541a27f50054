"""Windows of a sine burst: their values in time and the exact transforms of the burst.

A burst of N cycles lasts T. With y = f T, the frequency in units of 1 / T, its spectrum is
S = i T exp(i pi (y - N)) B(y) with a real amplitude B, equation (20) of docs/model.md. Each window
has its B, and B^2 split into a smooth mean and a ripple far from the carrier y = N.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, Protocol, get_args

import numpy as np
from numpy.polynomial import polynomial

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real


Window = Literal["none", "hann", "tukey", "gaussian"]
WINDOWS: Final[tuple[str, ...]] = get_args(Window)

MOST_Y: Final = 1e15
"""Beyond this y = f T a float has no fraction left to hold the phase."""

FAR: Final = 10.0
"""From this distance |y - N| on, `smooth` and `ripple` hold."""

_SHARPNESS: Final = 18.0
"""The gaussian is exp(-18 s^2), s = t / T from the centre: sigma = T / 6."""

_FADDEEVA_RULE: Final = tuple(
    (0.3 * j, 0.3j / math.pi * math.exp(-((0.3 * j) ** 2))) for j in range(-20, 21)
)
"""Nodes and weights of w(z) = sum of weight / (z - node), to 1e-15 where Im z >= 2.1.

The trapezoidal rule for w(z) = (i / pi) int exp(-t^2) / (z - t) dt, whose error falls as
exp(-2 pi Im z / step). It makes the difference of two values a sum without cancellation.
"""


def taper(window: Window, position: Real) -> Real:
    """Return the values of a window.

    `position` is the distance from the nearer end of the burst in units of its duration, 0 to 1/2;
    the values are 1 in the middle.

    Examples
    --------
    >>> middle = np.array([0.5])
    >>> [float(taper(window, middle)[0]) for window in ("none", "hann", "tukey", "gaussian")]
    [1.0, 1.0, 1.0, 1.0]
    """
    if window == "hann":
        return np.sin(np.pi * position) ** 2
    if window == "tukey":
        return np.sin(2 * np.pi * np.minimum(position, 0.25)) ** 2
    if window == "gaussian":
        return np.exp(-_SHARPNESS * (0.5 - position) ** 2)
    return np.ones_like(position)


class Transform(Protocol):
    """The amplitude B(y) of a burst's spectrum, and its square far from the carrier."""

    @property
    def mean_square(self) -> float:
        """Mean of the squared burst over its duration, equation (23)."""

    def amplitude(self, nearest: Real, rest: Real) -> Real:
        """Return B at y = nearest + rest >= 0, with `nearest` the whole number next to y."""

    def smooth(self, y: Real) -> Real:
        """Return the part of B^2 that does not oscillate."""

    def ripple(self, y: Complex) -> Complex:
        """Return the function that decays for Im y > 0 and whose real part is B^2 - smooth."""


def transform(window: Window, cycles: int) -> Transform:
    """Return the transform of a windowed burst, equations (21) and (22), as a function of y = f T.

    At the carrier a burst of many cycles has half the area of its window:

    >>> carrier = np.array([90.0])
    >>> transform("none", 90).amplitude(carrier, 0 * carrier).round(9)
    array([0.5])
    >>> transform("hann", 90).amplitude(carrier, 0 * carrier).round(9)
    array([0.25])
    """
    if window == "gaussian":
        return _GaussianTransform(cycles=cycles)
    if window == "none":
        first = (cycles / math.pi,)
        return _RationalTransform(
            cycles=cycles, poles=(cycles, -cycles), first=first, mean_square=0.5
        )
    return _hann(cycles) if window == "hann" else _tukey(cycles)


def _hann(n: int) -> _RationalTransform:
    """Return Hann's transform; what numerator and poles have in common is taken out."""
    if n == 1:
        first: tuple[float, ...] = (-1.5 / math.pi,)
        return _RationalTransform(cycles=n, poles=(1, 2, -1, -2), first=first, mean_square=5 / 32)
    scale = n / (2 * math.pi)
    first = (scale * (1 - n * n), 0.0, -3 * scale)
    poles = (n, n - 1, n + 1, -n, 1 - n, -1 - n)
    return _RationalTransform(cycles=n, poles=poles, first=first, mean_square=3 / 16)


def _tukey(n: int) -> _RationalTransform:
    """Return Tukey's transform; what numerator and poles have in common is taken out."""
    scale = 2 / math.pi
    poles: tuple[int, ...] = (n, n - 2, n + 2, -n, 2 - n, -2 - n)
    odd: tuple[float, ...] = (0.0, (4 - 3 * n * n) * scale, 0.0, -scale)
    second: tuple[float, ...] = (n * (4 - n * n) * scale, 0.0, -3 * n * scale)
    match n:
        case 1:
            poles, odd, second = (1, 3, -1, -3), (0.0, -scale), (-3 * scale,)
        case 2:
            poles, second = (2, 4, -2, -4), (-6 * scale,)
    first = odd if n % 2 else second
    mean = {1: 13 / 32, 2: 21 / 64}.get(n, 11 / 32)
    return _RationalTransform(
        cycles=n, poles=poles, first=first, second=second, stretch=2, mean_square=mean
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _RationalTransform:
    """B = (first sin(theta) + second sin(2 theta)) / prod(y - pole), theta = pi (y - N) / stretch.

    Every pole is a zero of sin(theta). `first` and `second` are polynomials in y, lowest power
    first.
    """

    cycles: int
    poles: tuple[int, ...]
    first: tuple[float, ...]
    mean_square: float
    second: tuple[float, ...] = (0.0,)
    stretch: int = 1

    def amplitude(self, nearest: Real, rest: Real) -> Real:
        sine, cosine = self._sine_and_cosine(nearest, rest)
        # of the whole number: half way to the next, rounding may take the cosine past 0
        sign = self._sine_and_cosine(nearest, np.zeros_like(rest))[1]
        slope = sign * (np.pi / self.stretch) * np.sinc(rest / self.stretch)
        ratio = np.where(np.isin(nearest, self.poles), slope, sine)
        for pole in self.poles:
            ratio = ratio / np.where(nearest == pole, 1.0, nearest - pole + rest)
        y = nearest + rest
        second = polynomial.polyval(y, self.second)
        return ratio * (polynomial.polyval(y, self.first) + 2 * cosine * second)

    def smooth(self, y: Real) -> Real:
        first, second = self._fractions(y.astype(np.complex128))
        return (first.real**2 + second.real**2) / 2

    def ripple(self, y: Complex) -> Complex:
        first, second = self._fractions(y)
        turn = np.exp(1j * np.pi / self.stretch * (y - self.cycles))
        square: Complex = turn * turn
        lines = first * first * square + second * second * square * square
        values: Complex = first * second * turn * (1 - square) - lines / 2
        return values

    def _sine_and_cosine(self, nearest: Real, rest: Real) -> tuple[Real, Real]:
        """Return those of theta as a whole number of quarter turns and a rest: exact zeros."""
        quarters = np.mod((nearest - self.cycles) * (2 // self.stretch), 4.0)
        sine, cosine = np.sin(np.pi / self.stretch * rest), np.cos(np.pi / self.stretch * rest)
        circle = [sine, cosine, -sine, -cosine]
        places = [quarters == quarter for quarter in range(4)]
        return np.select(places, circle), np.select(places, circle[1:] + circle[:1])

    def _fractions(self, y: Complex) -> tuple[Complex, Complex]:
        """Return `first` and `second` over the poles."""
        weight = np.ones_like(y)
        for pole in self.poles:
            weight = weight / (y - pole)
        first, second = polynomial.polyval(y, self.first), polynomial.polyval(y, self.second)
        return weight * first, weight * second


@dataclass(frozen=True, slots=True, kw_only=True)
class _GaussianTransform:
    """B = (sqrt(pi / 18) / 2) (bell - exp(-9/2) Re[exp(i theta) steps]), theta = pi (y - N).

    `bell` is the transform of the endless gaussian, `steps` that of the two cut ends.
    """

    cycles: int

    @property
    def mean_square(self) -> float:
        steady = _gaussian_cosine(2 * _SHARPNESS, 0.0)
        return (steady - _gaussian_cosine(2 * _SHARPNESS, 2.0 * self.cycles)) / 2

    def amplitude(self, nearest: Real, rest: Real) -> Real:
        y = nearest + rest
        spread = np.pi**2 / _SHARPNESS
        bell = -np.expm1(-4 * spread * self.cycles * y)
        bell = bell * np.exp(-spread * (nearest - self.cycles + rest) ** 2)
        sign = 1 - 2 * np.mod(nearest - self.cycles, 2.0)
        turned = sign * np.exp(1j * np.pi * rest) * self._steps(y.astype(np.complex128))
        ends: Real = math.exp(-_SHARPNESS / 4) * np.real(turned)
        values: Real = math.sqrt(math.pi / _SHARPNESS) / 2 * (bell - ends)
        return values

    def smooth(self, y: Real) -> Real:
        steps = self._steps(y.astype(np.complex128))
        return self._end_energy() * (steps.real**2 + steps.imag**2)

    def ripple(self, y: Complex) -> Complex:
        turn = np.exp(1j * np.pi * (y - self.cycles))
        return self._end_energy() * (turn * self._steps(y)) ** 2

    def _steps(self, y: Complex) -> Complex:
        """Return w(z_minus) - w(z_plus), z = pi (y -+ N) / sqrt(18) + i sqrt(18) / 2."""
        root = math.sqrt(_SHARPNESS)
        gap = 2 * math.pi * self.cycles / root
        z = np.pi / root * (y - self.cycles) + 0.5j * root
        total = np.zeros_like(z)
        for node, weight in _FADDEEVA_RULE:
            total += gap * weight / ((z - node) * (z - node + gap))
        return total

    def _end_energy(self) -> float:
        """Return the half of the squared factor before the ends' part of B."""
        return math.pi / _SHARPNESS / 8 * math.exp(-_SHARPNESS / 2)


def _gaussian_cosine(sharpness: float, x: float) -> float:
    """Return the integral of exp(-sharpness s^2) cos(2 pi x s) over s from -1/2 to 1/2."""
    root = math.sqrt(sharpness)
    shift = math.pi * x / root
    faddeeva = sum(weight / (complex(shift, root / 2) - node) for node, weight in _FADDEEVA_RULE)
    # exp(i pi x) is 1: x is 0 or twice the number of cycles
    ends = math.exp(-sharpness / 4) * faddeeva.real
    return math.sqrt(math.pi) / root * (math.exp(-shift * shift) - ends)
