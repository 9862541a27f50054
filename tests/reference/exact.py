"""The field of one load to forty digits: an evaluator in mpmath to measure errors against.

It shares with the product the values that state a problem, and no equation: the transform along the
strip is written with plain hyperbolic functions, residues are taken as means over small circles,
and the rest is a tanh-sinh integral along two rays that open upwards. Digits that cancel are paid
for with working precision. Lengths are in widths.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import mpmath
import numpy as np
from mpmath import mp
from numpy.polynomial import Legendre

from stimuli import SIMPLY_SUPPORTED, ElasticEdge, ForceRectangle, PressureDisc, PressureRectangle
from stimuli.load import DISCS

if TYPE_CHECKING:
    from collections.abc import Callable

    from stimuli import Load, Strip

DIGITS: Final = 40
_GUARD: Final = 22
_FAR: Final = 3.0
"""Clearance in widths beyond which the residues are the whole field."""

_EXTRA_WAVES: Final = 9
_EXTRA_POLYNOMIALS: Final = 20
_STEPS: Final = 40
"""Nodes per unit of the integration variable."""

_NEGLIGIBLE: Final = mpmath.mpf(10) ** -(DIGITS + 4)
_SMALL_TERMS: Final = 4
_HALF: Final = mpmath.mpf(1) / 2
_ASIDE: Final = mpmath.mpf(10) ** -17
"""How far along the strip from a disc's centre its field is taken: it is even there, its parts
are infinite."""

_STEEP: Final = mpmath.mpf(10) ** 16
"""|s| beyond which g2 T(g2/2) - g1 T(g1/2) is k^2 / s to all digits that count."""

_MOST_STEPS: Final = 40
_END_DIGITS: Final = 48
_ASTRAY: Final = mpmath.mpf(10) ** -6
_REST_HZ: Final = "1e-20"
"""Frequency that stands for 0 Hz: the field is even in the frequency."""


_Piece = tuple[Any, Any, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """k, 1 / kappa, the load and the point."""

    k: Any
    hold: Any
    moment: bool
    centre: Any
    span: Any
    half_length: Any
    radius: Any
    x: Any
    y: Any

    @property
    def lossless(self) -> bool:
        """Whether the field is real but for propagating waves."""
        return not (mp.im(self.k) or (mp.isfinite(self.hold) and mp.im(self.hold)))

    def branch_weights(self) -> tuple[Any, Any]:
        """Return what the load makes of plane waves of either branch.

        A moment multiplies them by their Laplacians, -k^2 and k^2. A disc acts like its centre
        times the mean of a plane wave over it: 2 pi R J1(k R) / k and 2 pi R I1(k R) / k.
        """
        k, radius = self.k, self.radius
        one = two = mp.mpf(1)
        if radius:
            one = 2 * mp.pi * radius * mp.besselj(1, k * radius) / k
            two = 2 * mp.pi * radius * mp.besseli(1, k * radius) / k
        return (-k * k * one, k * k * two) if self.moment else (one, two)

    def along(self, s: Any) -> Any:
        """Return exp(i s |x - x'|) integrated over the load's length."""
        c, x = self.half_length, self.x
        if not c:
            return mp.exp(1j * s * x)
        if x >= c:
            return (mp.exp(1j * s * (x + c)) - mp.exp(1j * s * (x - c))) / (1j * s)
        return (mp.exp(1j * s * (c - x)) + mp.exp(1j * s * (c + x)) - 2) / (1j * s)


def exact(strip: Strip, load: Load, x_m: float, y_m: float, frequency_hz: float) -> Any:
    """Return the displacement of a strip at a point to forty digits, metres per unit load.

    Parameters
    ----------
    strip : Strip
        Endless, or with simply supported long edges and any length.
    load : Load
        Load.
    x_m, y_m : float
        Place.
    frequency_hz : float
        Frequency, taken as it is, like all the other numbers: no rounding of inputs counts.

    Returns
    -------
    mpmath.mpc
    """
    frequency = frequency_hz or mp.mpf(_REST_HZ)
    lost = max(0, 2 * int(mp.log10(2000 / mp.mpf(frequency))))
    with mp.workdps(DIGITS + _GUARD + lost):
        problem, scale = _state(strip, load, x_m, y_m, mp.mpf(frequency))
        if problem.radius and not problem.x and problem.y == problem.centre:
            aside = {name: getattr(problem, name) for name in problem.__slots__}
            problem = Problem(**{**aside, "x": _ASIDE})
        signs = (1,) if problem.y == 0 or problem.centre == 0 else (1, -1)
        value = mp.fsum(_one_symmetry(problem, sign) for sign in signs)
        if problem.radius:
            value += _inside_disc(problem)
        if strip.length_m is not None:
            value += _reflected(problem, strip, load, x_m)
        return +(value * scale)


def _state(strip: Strip, load: Load, x_m: float, y_m: float, frequency: Any) -> tuple[Problem, Any]:
    """Return the problem in widths and what its D U is multiplied with."""
    material, width, thickness = strip.material, mp.mpf(strip.width_m), mp.mpf(strip.thickness_m)
    nu, omega = mp.mpf(material.poisson_ratio), 2 * mp.pi * frequency
    real = mp.mpf(material.youngs_modulus_pa) * thickness**3 / (12 * (1 - nu * nu))
    stiffness = real * mp.mpc(
        1, -(mp.mpf(material.loss_factor) + omega * mp.mpf(material.viscous_time_s))
    )
    k = mp.root(material.density_kg_m3 * thickness * omega**2 / stiffness, 4) * width
    hold: Any = mp.mpf(0)
    if isinstance(strip.edge, ElasticEdge):
        spring = mp.mpf(strip.edge.stiffness_n) * width
        loss = stiffness if strip.edge.lossless else real
        hold = loss / spring if spring else mp.inf
    elif strip.edge is SIMPLY_SUPPORTED:
        hold = mp.inf
    round_load = isinstance(load, DISCS)
    size_x, size_y = (2 * mp.mpf(size) / width for size in load.half_size_m)
    power = 4 if isinstance(load, (PressureDisc, PressureRectangle, ForceRectangle)) else 2
    scale = width**power / stiffness
    if isinstance(load, ForceRectangle):
        scale /= mp.mpf(load.length_x_m) * mp.mpf(load.length_y_m)
    problem = Problem(
        k=k,
        hold=hold,
        moment=load.is_moment,
        centre=mp.mpf(load.y_m) / width - _HALF,
        span=mp.mpf(0) if round_load else size_y,
        half_length=mp.mpf(0) if round_load else size_x / 2,
        radius=size_x / 2 if round_load else mp.mpf(0),
        x=abs(mp.mpf(x_m) - mp.mpf(load.x_m)) / width,
        y=mp.mpf(y_m) / width - _HALF,
    )
    return problem, scale


def _one_symmetry(problem: Problem, sign: int) -> Any:
    """Return residues of the waves below two rays, and the integral along these."""
    waves = _waves(problem, sign)
    weights = problem.branch_weights()
    pieces = _pieces(problem, sign)

    def field(s: Any) -> Any:
        return _transform(problem, weights, pieces, s, sign) * problem.along(s)

    clearance = problem.x - problem.half_length - problem.radius
    if clearance > _FAR:
        return 1j * mp.fsum(_residue(field, p, waves) for p in waves)
    height, slope = _gap(waves)
    turned = mp.expj(slope)
    below = [p for p in waves if p.imag - mp.tan(slope) * abs(p.real) < height]
    right = _along_ray(lambda r: field(1j * height + turned * r)) * turned
    if problem.lossless:
        integral = 2 * mp.re(right)
    else:
        left = _along_ray(lambda r: field(1j * height - mp.conj(turned) * r))
        integral = right + left * mp.conj(turned)
    return 1j * mp.fsum(_residue(field, p, waves) for p in below) + integral / (2 * mp.pi)


def _gap(waves: list[Any]) -> tuple[Any, Any]:
    """Return from where and how steeply two rays pass all waves, at a large angle and distance."""
    best = (mp.mpf(-1), mp.mpf(0), mp.mpf(0))
    for slope in (mp.mpf("0.35"), mp.mpf("0.55"), mp.mpf("0.75")):
        heights = sorted(p.imag - mp.tan(slope) * abs(p.real) for p in waves)
        for low, high in itertools.pairwise(heights[:-2]):
            height = (max(low, 0) + high) / 2
            seen = [mp.mpc(abs(p.real), p.imag - height) for p in waves]
            angle = min([slope] + [abs(mp.arg(q) - slope) for q in seen])
            if height > 0:
                best = max(best, (angle * min(*map(abs, seen), 1), height, slope))
    return best[1], best[2]


def _along_ray(field: Callable[[Any], Any]) -> Any:
    """Return the integral from 0 to infinity: the trapezoidal rule in u, r = exp(u - exp(-u))."""
    total, largest = mp.mpc(0), mp.mpf(0)
    step = mp.mpf(1) / _STEPS
    for direction in (1, -1):
        number, small = int(direction < 0), 0
        while small < _SMALL_TERMS:
            u = direction * number * step
            fall = mp.exp(-u)
            r = mp.exp(u - fall)
            term = field(r) * r * (1 + fall)
            total += term
            largest = max(largest, abs(term))
            small = small + 1 if abs(term) < largest * _NEGLIGIBLE else 0
            number += 1
    return total * step


def _residue(field: Callable[[Any], Any], p: Any, waves: list[Any]) -> Any:
    """Return the residue as the mean over eight places of a circle about a simple pole."""
    others = [abs(p - q) for q in waves if q is not p] + [abs(p + q) for q in waves]
    radius = min(others) * mp.mpf(10) ** (-mp.dps // 9)
    turns = [radius * mp.expjpi(mp.mpf(2 * j + 1) / 8) for j in range(8)]
    return mp.fsum(field(p + turn) * turn for turn in turns) / 8


def _transform(
    problem: Problem, weights: tuple[Any, Any], pieces: list[_Piece], s: Any, sign: int
) -> Any:
    """Return D U^(s) of one symmetry.

    lap^2 - k^4 is (lap + k^2)(lap - k^2), so that a strip on simple supports has the difference
    of two Green's functions, of g = sqrt(s^2 -+ k^2), over 2 k^2. What springs add is the field
    psi of a rotated edge, by as much as the moments at the edges demand.
    """
    k2 = problem.k**2
    near, far = (_Across(mp.sqrt(s * s + k2), sign), _Across(mp.sqrt(s * s - k2), sign))
    one, two = weights
    value = one * _supported(far, problem.y, pieces) - two * _supported(near, problem.y, pieces)
    if not mp.isinf(problem.hold):
        end1, end2 = far.shape(_HALF), near.shape(_HALF)
        psi = near.shape(problem.y) / end2 - far.shape(problem.y) / end1
        load = two * _loaded(near, pieces) / end2 - one * _loaded(far, pieces) / end1
        slope = k2 / s
        if abs(s) < _STEEP:
            slope = near.g * near.other(_HALF) / end2 - far.g * far.other(_HALF) / end1
        value -= psi * load / (2 * (2 * k2 * problem.hold + slope))
    return value / (2 * k2)


class _Across:
    """cosh and sinh of g Y, each exponential once."""

    def __init__(self, g: Any, sign: int) -> None:
        self.g, self.sign = g, sign
        self._known: dict[Any, tuple[Any, Any]] = {}

    def shape(self, y: Any) -> Any:
        """Return cosh for symmetric, sinh for antisymmetric waves."""
        up, down = self._exponentials(y)
        return (up + self.sign * down) / 2

    def other(self, y: Any) -> Any:
        """Return sinh for symmetric, cosh for antisymmetric waves."""
        up, down = self._exponentials(y)
        return (up - self.sign * down) / 2

    def _exponentials(self, y: Any) -> tuple[Any, Any]:
        if y not in self._known:
            up = mp.exp(self.g * y)
            self._known[y] = (up, 1 / up)
        return self._known[y]

    def from_edge(self, y: Any, sign: int) -> Any:
        """Return cosh (+1) or sinh (-1) of g (1/2 - y)."""
        end, here = self._exponentials(_HALF), self._exponentials(y)
        return (end[0] * here[1] + sign * end[1] * here[0]) / 2


def _pieces(problem: Problem, sign: int) -> list[_Piece]:
    """Return the load folded onto one half of the strip: from, to, factor."""
    low, high = problem.centre - problem.span / 2, problem.centre + problem.span / 2
    if low >= 0:
        return [(low, high, 1)]
    if high <= 0:
        return [(-high, -low, sign)]
    return [(mp.mpf(0), high, 1), (mp.mpf(0), -low, sign)]


def _loaded(across: _Across, pieces: list[_Piece]) -> Any:
    """Return the shape at the load, or integrated over it."""
    total = mp.mpf(0)
    for low, high, factor in pieces:
        if low == high:
            return factor * across.shape(low)
        total += factor * (across.other(high) - across.other(low)) / across.g
    return total


def _supported(across: _Across, y: Any, pieces: list[_Piece]) -> Any:
    """Return s(Y<) sinh(g (1/2 - Y>)) / (2 g s(1/2)) on one half, at or over the load."""
    here, g, total = abs(y), across.g, mp.mpf(0)
    for low, high, factor in pieces:
        if low == high:
            first, last = min(here, low), max(here, low)
            total += factor * across.shape(first) * across.from_edge(last, -1)
            continue
        split = min(max(here, low), high)
        rise = (across.other(split) - across.other(low)) / g
        fall = (across.from_edge(split, 1) - across.from_edge(high, 1)) / g
        total += factor * (rise * across.from_edge(here, -1) + fall * across.shape(here))
    side = across.sign if y < 0 else 1
    return side * total / (2 * g * across.shape(_HALF))


def _waves(problem: Problem, sign: int) -> list[Any]:
    """Return outgoing wavenumbers of one symmetry: all that propagate and some more."""
    count = int(abs(problem.k) / (2 * mp.pi)) + _EXTRA_WAVES
    if mp.isinf(problem.hold):
        q = [mp.pi * n for n in range(1 if sign > 0 else 2, 2 * count + 2, 2)]
        squares = [branch * problem.k**2 - a * a for a in q for branch in (1, -1)]
        return sorted((_outgoing(mp.mpc(z)) for z in squares), key=_decay)[: count + 1]
    found: list[Any] = []
    for start in _rough_squares(problem, sign, count):
        found.append(_polished(problem, mp.mpc(start), found, sign))
    waves = [_outgoing(z) for z in found]
    return [p for i, p in enumerate(waves) if all(abs(p - q) > mp.eps**0.5 for q in waves[:i])]


def _rough_squares(problem: Problem, sign: int, count: int) -> list[complex]:
    """Return p^2 of the waves that decay least to some digits: of a model in polynomials across."""
    bubble = Legendre([2 / 3, 0, -2 / 3]) ** (1 if problem.hold else 2)
    first, n = int(sign < 0), count + _EXTRA_POLYNOMIALS
    shapes = [bubble * Legendre.basis(first + 2 * j) for j in range(n)]
    nodes, weights = np.polynomial.legendre.leggauss(2 * n + 6)
    mass, slope, bend = (
        (values * weights / 2) @ values.T
        for order in (0, 1, 2)
        for values in [np.array([2**order * shape.deriv(order)(nodes) for shape in shapes])]
    )
    ends = np.array([2 * shape.deriv()(1.0) for shape in shapes])
    springs = 2 / complex(problem.hold) * np.outer(ends, ends) if problem.hold else 0.0
    root = np.linalg.inv(np.linalg.cholesky(mass))
    slope, bend = root @ slope @ root.T, root @ (bend + springs) @ root.T
    unit = np.eye(n)
    lower = complex(problem.k) ** 4 * unit - bend
    squares: Any = np.linalg.eigvals(np.block([[0 * unit, unit], [lower, -2 * slope]]))
    by_decay = sorted(squares.tolist(), key=lambda square: _decay(_outgoing(mp.mpc(square))))
    return by_decay[:count]


def _decay(p: Any) -> Any:
    return p.imag, -p.real


def _outgoing(z: Any) -> Any:
    p = mp.mpc(mp.sqrt(z))
    if p.imag < 0 or (p.imag == 0 and p.real < 0):
        p = -p
    return p


def _polished(problem: Problem, start: Any, found: list[Any], sign: int) -> Any:
    """Return p^2 of a wave from one good to a few digits, apart from those found before."""
    k2 = problem.k**2

    def relation(z: Any) -> Any:
        g1, g2 = mp.sqrt(z - k2), mp.sqrt(z + k2)
        far, near = _Across(g1, sign), _Across(g2, sign)
        s1, s2 = far.shape(_HALF), near.shape(_HALF)
        t1, t2 = g1 * far.other(_HALF), g2 * near.other(_HALF)
        if sign < 0:
            s1, s2, t1, t2 = s1 / g1, s2 / g2, t1 / g1, t2 / g2
        value = 2 * k2 * problem.hold * s1 * s2 + t2 * s1 - t1 * s2
        return value / mp.fprod(z - other for other in found)

    size = 1 + abs(start)
    before, z = start, start + mp.mpf(10) ** -9 * size
    value = relation(before)
    for _ in range(_MOST_STEPS):
        here = relation(z)
        step = here * (z - before) / (here - value)
        before, value, z = z, here, z - step
        if abs(step) < mp.eps**0.75 * size:
            break
    else:
        raise ArithmeticError(f"no wave near p^2 = {mpmath.nstr(start, 8)}")
    if abs(z - start) > _ASTRAY * size:
        raise ArithmeticError(f"another wave than that near p^2 = {mpmath.nstr(start, 8)}")
    real = problem.lossless and abs(mp.im(z)) < mp.eps**0.7 * size
    return mp.mpc(z.real, 0) if real else mp.mpc(z)


def _inside_disc(problem: Problem) -> Any:
    """Return what a disc's field has over that of its replacement at its centre.

    Each branch adds w with (lap +- k^2) w = -1 inside, and w = w' = 0 at the rim.
    """
    k, radius = problem.k, problem.radius
    r = mp.sqrt(problem.x**2 + (problem.y - problem.centre) ** 2)
    if r >= radius:
        return mp.mpf(0)
    z, zr = k * radius, k * r
    one = mp.hankel1(1, z) * mp.besselj(0, zr) - mp.besselj(1, z) * mp.hankel1(0, zr)
    one = -1 / k**2 + 1j * mp.pi * radius / (2 * k) * one
    two = mp.besselk(1, z) * mp.besseli(0, zr) + mp.besseli(1, z) * mp.besselk(0, zr)
    two = 1 / k**2 - radius / k * two
    return -(one + two) / 2 if problem.moment else (one - two) / (2 * k**2)


def _reflected(problem: Problem, strip: Strip, load: Load, x_m: float) -> Any:
    """Return what two free ends add between simple supports: four waves for each sine."""
    if not mp.isinf(problem.hold):
        raise ValueError("strip must have simply supported edges if it is finite")
    width = mp.mpf(strip.width_m)
    end, there = mp.mpf(strip.length_m) / (2 * width), mp.mpf(load.x_m) / width
    x, nu = mp.mpf(x_m) / width, mp.mpf(strip.material.poisson_ratio)
    one, two = problem.branch_weights()
    total, n = mp.mpf(0), 0
    while True:
        n += 1
        q = n * mp.pi
        a, b = mp.sqrt(q * q - problem.k**2), mp.sqrt(q * q + problem.k**2)
        if not mp.im(problem.k) and problem.k.real > q:
            a = -1j * mp.sqrt(problem.k**2 - q * q)
        part = _ends_of_one_sine(problem, (a, b), (one, -two), q, (end, there, x, nu))
        total += part
        nearest = 2 * end - abs(x) - abs(there) - problem.half_length
        if q > problem.k.real and mp.exp(-q * nearest) < mp.mpf(10) ** -_END_DIGITS:
            return total


def _ends_of_one_sine(
    problem: Problem, decays: tuple[Any, Any], weights: tuple[Any, Any], q: Any, places: Any
) -> Any:
    end, there, x, nu = places
    half, c = mp.mpf(1) / 2, problem.half_length
    load = mp.sin(q * (problem.centre + half))
    load *= 2 * mp.sin(q * problem.span / 2) / q if problem.span else 1
    shape = mp.sin(q * (problem.y + half))
    matrix, right = mp.matrix(4, 4), mp.matrix(4, 1)
    for row, side in enumerate((1, -1)):
        for j, (g, weight) in enumerate(zip(decays, weights, strict=True)):
            moment, shear = g * g - nu * q * q, g * (g * g - (2 - nu) * q * q)
            size = weight * load / (2 * problem.k**2 * g) * (2 * mp.sinh(g * c) / g if c else 1)
            size *= mp.exp(-g * (end - side * there))
            right[2 * row] -= moment * size
            right[2 * row + 1] += side * shear * size
            for column, from_end in ((j, 1), (j + 2, -1)):
                reach = mp.mpf(1) if from_end == side else mp.exp(-2 * g * end)
                matrix[2 * row, column] = moment * reach
                matrix[2 * row + 1, column] = from_end * shear * reach
    waves = mp.lu_solve(matrix, right)
    reach = [mp.exp(-g * (end - side * x)) for side in (1, -1) for g in decays]
    return shape * mp.fsum(w * r for w, r in zip(waves, reach, strict=True))
