"""What a free end between held edges makes of each wave that comes to it.

Guided waves that leave the end and a few fields with the singularity of its corner, without moment
and shear on each of them, equation (89). What is left of the error is its square.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.across import shape
from stimuli.solver.contour import contour
from stimuli.solver.ends.corners import edge_shapes, grips

if TYPE_CHECKING:
    from collections.abc import Iterable

    from stimuli.arrays import Complex, Real
    from stimuli.solver.guided import Guided


_FADE: Final = 2.0
"""Decay per width of an edge's turn and displacement beyond the end."""

_RIGID, _STIFF = 1e-7, 0.03
"""1 / (kappa W) up to which an edge's corner is that of clamps, and from which it is a spring's."""

FINE: Final = 5e-8
"""Wanted error below which more fields are taken."""

_POWER, _FINE_POWER = 4.5, 7.0
"""Powers of the distance up to which the corner of a clamp is held."""

_STEPS, _MET, _ALIKE = 30, 1e-9, 1e-6
"""Newton's steps to those powers; what counts as met, and as the same."""

_DISTINCT: Final = 0.1
"""Difference between powers of a clamp and of a spring below which the first serves for both."""

_FALL: Final = 3
"""Power with which the integrals along s are taken to fall: with 4 those of springs err by more."""

_OUTER: Final = 0.08
"""Distance from the corner from which the nodes are even and up to which their logarithms are."""

_NODES, _FINE_NODES = (6, 2.4, 8), (12, 3.4, 12)
"""Even nodes, those of each neper, and those next to the corner."""

_PER_DECAY: Final = 0.4
"""Even nodes more for each unit of the fastest decay across."""

_SKEW: Final = 4.0
"""What counts as an error of the integrals, times what the works of two fields on each other
differ by."""

_EPS: Final = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Corner:
    """The fields that hold the singularity of a corner, and what integrates them."""

    # powers of the distance beyond the end with which the edge is turned there, of either kind: a
    # complex one stands for itself and its conjugate
    turned: tuple[complex, ...]
    displaced: tuple[complex, ...]
    least: float  # distance from the corner up to which nodes are even again
    nearest: float  # distance from the corner up to which the fields are known
    path_rtol: float  # of the integrals along s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reflection:
    """How the waves a that leave an end follow from those that come, c: leaving a = -arriving c.

    Rows: (n_frequencies, n, n), waves times their scale.
    """

    leaving: Complex
    arriving: Complex
    coarse: tuple[Complex, Complex]  # both, of a model with fewer waves
    error: Real  # of the matrices, times what leaves or comes
    scale: Real  # (n_frequencies, n)
    norms: Complex  # of the waves as they are: (n_frequencies, n)


def reflections(
    k: Complex,
    hold: Complex,
    waves: tuple[Guided, ...],
    poisson_ratio: float,
    *,
    rtol: float,
    count: int,
) -> list[Reflection]:
    """Return what an end makes of the first waves of each symmetry, equation (89).

    Parameters
    ----------
    k, hold : ndarray of complex128, shape (n_frequencies,)
        Bending wavenumber times the width and 1 / (kappa W), not infinite.
    waves : tuple of Guided
        Waves of each symmetry, some more than `count`, as many of each; no two of them coalesce.
    poisson_ratio : float
        Poisson's ratio.
    rtol : float
        Wanted error.
    count : int
        Number of waves that come, and that leave, from 2; the coarse model has one less.

    Examples
    --------
    Without loss a wave that propagates alone comes back whole:

    >>> from stimuli.solver.guided import guided
    >>> k, hold = np.array([5.0 + 0j]), np.array([0j])
    >>> waves = guided(k, hold, 8, 1)
    >>> found = reflections(k, hold, (waves,), 0.3, rtol=1e-6, count=2)[0].arriving[0, 0, 0]
    >>> bool(abs(abs(found) - 1) < 1e-7)
    True
    """
    fine = rtol < FINE
    corner = _corner(float(np.max(np.abs(hold))), poisson_ratio, fine=fine)
    fastest = max(float(np.max(np.abs(some.g2))) for some in waves)
    depth, weights = _rule(corner.least, math.ceil(_PER_DECAY * fastest), fine=fine)
    norms = [some.norms(k[:, np.newaxis]) for some in waves]
    scales = [1 / np.sqrt(np.abs(some)) for some in norms]
    leaving = _stacked(
        _guided(some, 0.5 - depth, scale, poisson_ratio)
        for some, scale in zip(waves, scales, strict=True)
    )
    singular = _singular(k, hold, waves, poisson_ratio, corner=corner, across=0.5 - depth)
    turns = _stacked(norm * scale**2 for norm, scale in zip(norms, scales, strict=True))
    traces = np.concatenate([leaving, singular], axis=3)
    value, coarse, error = _balanced(traces, depth, weights, turns, count)
    n = count - 1
    found = []
    for number, (scale, norm) in enumerate(zip(scales, norms, strict=True)):
        rows = slice(number * k.size, (number + 1) * k.size)
        same = np.broadcast_to(np.eye(count, dtype=np.complex128), value[rows].shape)
        found.append(
            Reflection(
                leaving=same,
                arriving=-value[rows],
                coarse=(same[:, :n, :n], -coarse[rows, :n, :n]),
                error=error[rows],
                scale=scale[:, :count],
                norms=norm[:, :count],
            )
        )
    return found


def _stacked(parts: Iterable[Complex]) -> Complex:
    """Return the frequencies of each symmetry, one after the other."""
    rows = list(parts)
    return rows[0] if len(rows) == 1 else np.concatenate(rows)


def _balanced(
    traces: Complex, depth: Real, weights: Real, norms: Complex, count: int
) -> tuple[Complex, Complex, Real]:
    """Return what leaves from the traces of all fields, waves first, by virtual work, (89).

    Beside it stand the same with fewer fields and the error of rounding and integrals.

    `traces` are displacement, slope, moment and shear, (n_frequencies, 4, n_places, n_fields),
    `norms` those of the waves, of size 1.
    """
    n_fields, turns = traces.shape[3], norms[:, :count]
    coming = traces[..., :count] * np.array([1, -1, 1, -1])[:, np.newaxis, np.newaxis]
    every = np.concatenate([traces, coming], axis=3)
    displacement, slope, moment, shear = np.moveaxis(every, 1, 0)
    across = 2 * weights[:, np.newaxis]
    works = np.swapaxes(shear * across, 1, 2) @ displacement
    works -= np.swapaxes(moment * across, 1, 2) @ slope
    sizes = (np.abs(moment) ** 2 * (depth * weights)[:, np.newaxis]).sum(axis=1)
    sizes += (np.abs(shear) ** 2 * (depth**3 * weights)[:, np.newaxis]).sum(axis=1)
    each = np.sqrt(sizes[:, :n_fields])
    matrix = works[:, :n_fields, :n_fields] / (each[:, :, np.newaxis] * each[:, np.newaxis])
    skew = (matrix - np.swapaxes(matrix, 1, 2)) / 2
    pushed = np.swapaxes(works[:, n_fields:, :n_fields], 1, 2) / each[..., np.newaxis]
    own = works[:, n_fields:, n_fields:]
    found = []
    for n in (n_fields, n_fields - 2):
        answer = np.linalg.solve((matrix - skew)[:, :n, :n], pushed[:, :n])
        found.append(np.swapaxes(pushed[:, :n], 1, 2) @ answer - own)
        if n == n_fields:
            turned = np.swapaxes(answer, 1, 2)
            error = _SKEW * np.max(np.abs(turned @ skew @ answer), axis=2, keepdims=True)
            error = error + _EPS * np.abs(turned) @ np.abs(matrix) @ np.abs(answer)
    value, coarse = (1j * a / turns[..., np.newaxis] for a in found)
    return value, coarse, error


def _guided(waves: Guided, across: Real, scale: Real, poisson_ratio: float) -> Complex:
    """Return displacement, slope, moment and shear of leaving waves at the end."""
    p = waves.p[:, np.newaxis]
    squares, parts = [], []
    for weight, g in zip(waves.weights, (waves.g1, waves.g2), strict=True):
        wave = (weight * scale)[:, np.newaxis] * shape(
            g[:, np.newaxis], across[:, np.newaxis], waves.sign
        )
        parts.append(wave)
        squares.append(g[:, np.newaxis] ** 2 * wave)
    value, bent = parts[0] + parts[1], squares[0] + squares[1]
    moment = poisson_ratio * bent - p * p * value
    shear = 1j * p * ((2 - poisson_ratio) * bent - p * p * value)
    return np.stack([value, 1j * p * value, moment, shear], axis=1)


def _singular(
    k: Complex,
    hold: Complex,
    waves: tuple[Guided, ...],
    nu: float,
    *,
    corner: _Corner,
    across: Real,
) -> Complex:
    """Return the same of the fields with the corner's singularity, those of (56) with powers."""
    lossless = not (k.imag.any() or hold.imag.any())
    p = _stacked(some.p for some in waves)
    path = contour(
        p,
        corner.path_rtol,
        finest=1e-30,
        nearest=corner.nearest,
        mirrored=lossless,
        fall=_FALL,
    )
    s, k2 = path.s, np.tile(k * k, len(waves))[:, np.newaxis]
    g1, g2 = np.sqrt(s * s - k2), np.sqrt(s * s + k2)
    apart = 2 * k2 / (g1 + g2)
    shapes, grip, ratio = [], np.empty_like(s), np.empty_like(s)
    for number, some in enumerate(waves):
        rows = slice(number * k.size, (number + 1) * k.size)
        shapes.append(edge_shapes(g1[rows], g2[rows], apart[rows], across, some.sign))
        grip[rows], pull = grips(g1[rows], g2[rows], k2[rows], hold[:, np.newaxis], some.sign)
        ratio[rows] = pull / grip[rows]
    one, change = (_stacked(parts)[:, np.newaxis] for parts in zip(*shapes, strict=True))
    # of the second branch, and what it is more than the first; powers of the distance times
    # exp(-2 d) have transforms that are real for s = i t each
    exponents, combined = _transforms(corner.turned + corner.displaced)
    fade = np.log(_FADE / (_FADE - 1j * s))[..., np.newaxis]
    fields = (np.exp(fade * exponents) @ combined) * path.weight[..., np.newaxis]
    n_turned = _transforms(corner.turned)[0].size
    second, more = np.zeros_like(fields), fields
    second[..., n_turned:] = fields[..., n_turned:]
    more[..., :n_turned] /= grip[..., np.newaxis]
    more[..., n_turned:] *= -ratio[..., np.newaxis]
    second, more = second[:, np.newaxis], more[:, np.newaxis]
    square, turn = s * s, 1j * s
    bent, sheared = (nu - 1) * square + nu * k2, turn * ((1 - nu) * square + (2 - nu) * k2)
    op = np.stack([np.ones_like(s), turn, bent, sheared], axis=1)[..., np.newaxis]
    gain = np.stack([2 * nu * k2 + 0 * s, 2 * (2 - nu) * k2 * turn], axis=1)[..., np.newaxis]
    of_change = op * (second + more)
    of_one = op * second
    of_one[:, 2:] += gain * more
    found = one @ of_one
    found += change @ of_change
    return np.asarray(found.real + 0j if lossless else found, dtype=np.complex128)


@lru_cache(maxsize=32)
def _transforms(powers: tuple[complex, ...]) -> tuple[Complex, Complex]:
    """Return exponents of 2 / (2 - i s), and the sums of these powers that are real for s = i t."""
    exponents = [w + 1 for z in powers for w in ((z, z.conjugate()) if z.imag else (z,))]
    combined = np.eye(len(exponents), dtype=np.complex128)
    place = 0
    for z in powers:
        if z.imag:
            combined[place : place + 2, place : place + 2] = [[0.5, -0.5j], [0.5, 0.5j]]
        place += 2 if z.imag else 1
    return np.array(exponents), combined


@lru_cache(maxsize=8)
def _corner(hold: float, poisson_ratio: float, *, fine: bool) -> _Corner:
    """Return what the corner of an edge needs; `hold` is the greatest 1 / (kappa W)."""
    path_rtol = 1e-14 if fine else 1e-10
    if hold >= _STIFF:
        count = 6 if fine else 4
        return _Corner(
            turned=tuple(complex(n) for n in range(count)),
            displaced=tuple(complex(n) for n in range(2, count + 2)),
            least=1e-4 if fine else 5e-4,
            nearest=1e-6 if fine else 2e-5,
            path_rtol=path_rtol,
        )
    roots = [z for z in corner_powers(poisson_ratio) if z.real < (_FINE_POWER if fine else _POWER)]
    springs = (2 + 2 * fine) * (hold > _RIGID)
    return _Corner(
        turned=_apart(roots, range(springs)),
        displaced=_apart([z + 1 for z in roots], range(2, springs + 2)),
        least=1e-5 if springs else 1e-4 if fine else 5e-4,
        nearest=1e-7 if springs else 1e-6 if fine else 2e-5,
        path_rtol=path_rtol,
    )


def _apart(roots: list[complex], whole: range) -> tuple[complex, ...]:
    """Return the powers of a clamp and those of a spring that are not near one of them.

    A field taken twice makes the works singular: at nu = 0 a clamp has the powers 1 and 2 too,
    towards 0.5 also 3 and 4.
    """
    return (*roots, *(complex(n) for n in whole if all(abs(n - z) > _DISTINCT for z in roots)))


@lru_cache(maxsize=8)
def corner_powers(poisson_ratio: float) -> tuple[complex, ...]:
    """Return the first powers z of u ~ r^(1 + z) in the corner of a clamp and a free end.

    Roots of sin^2(pi z / 2) (3 + nu)(1 - nu) = 4 - (1 - nu)^2 z^2, Re z from 0 to 7, Im z >= 0.

    >>> complex(corner_powers(0.346)[0]).__format__(".4f")
    '1.0595+0.4766j'
    """
    nu, quarter = poisson_ratio, math.pi / 2
    z = (np.arange(0.5, 7.0, 0.25)[:, np.newaxis] + 1j * np.arange(0.0, 1.5, 0.25)).ravel()
    with np.errstate(all="ignore"):  # some starts lead nowhere
        for _ in range(_STEPS):
            value = (3 + nu) * (1 - nu) * np.sin(quarter * z) ** 2 - 4 + ((1 - nu) * z) ** 2
            slope = (3 + nu) * (1 - nu) * quarter * np.sin(2 * quarter * z) + 2 * (1 - nu) ** 2 * z
            z = z - value / slope
        met = (np.abs(value) < _MET) & (z.real > _MET) & (z.real < _FINE_POWER) & (z.imag > -_MET)
    found: list[complex] = []
    for root in sorted(z[met].tolist(), key=lambda root: root.real):
        if all(abs(root - other) > _ALIKE for other in found):
            found.append(complex(root) if root.imag > _ALIKE else complex(root.real))
    return tuple(found)


@lru_cache(maxsize=32)
def _rule(least: float, more: int, *, fine: bool) -> tuple[Real, Real]:
    """Return distances from the corner on half of the end and weights, crowded at the corner."""
    even, each, last = _FINE_NODES if fine else _NODES
    nepers = math.log(_OUTER / least)
    nodes, weights = np.polynomial.legendre.leggauss(math.ceil(each * nepers) + more // 4)
    middle = least * np.exp(nepers * (nodes + 1) / 2)
    parts = [(middle, middle * weights * nepers / 2)]
    for low, high, count in ((0.0, least, last), (_OUTER, 0.5, even + more)):
        nodes, weights = np.polynomial.legendre.leggauss(count)
        half = (high - low) / 2
        parts.append((low + half * (nodes + 1), half * weights))
    depth, weights = (np.concatenate(part) for part in zip(*parts, strict=True))
    return depth, weights
