"""What a free end between held edges makes of each wave that comes to it.

Guided waves that leave the end and a few fields with the singularity of its corner, without moment
and shear on each of them, equation (89). What is left of the error is its square.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.across import shape
from stimuli.solver.contour import contour
from stimuli.solver.ends.corners import edge_shapes, grips

if TYPE_CHECKING:
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

_SPANNED: Final = 4.0
"""Half of the phase of a wave across a panel of nodes, at most."""

_NODES: Final = 8
_RATIO: Final = 4.0
"""Nodes of a panel, and how much longer each is than the one nearer to the corner."""

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
    least: float  # length of the panel at the corner
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


def reflection(
    k: Complex, hold: Complex, waves: Guided, poisson_ratio: float, *, rtol: float, count: int
) -> Reflection:
    """Return what an end makes of the first waves, equation (89).

    Parameters
    ----------
    k, hold : ndarray of complex128, shape (n_frequencies,)
        Bending wavenumber times the width and 1 / (kappa W), not infinite.
    waves : Guided
        Waves of one symmetry, some more than `count`; no two of them coalesce.
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
    >>> back = reflection(k, hold, waves, 0.3, rtol=1e-6, count=2).arriving[0, 0, 0]
    >>> bool(abs(abs(back) - 1) < 1e-7)
    True
    """
    corner = _corner(float(np.max(np.abs(hold))), poisson_ratio, fine=rtol < FINE)
    depth, weights = _rule(corner.least, math.ceil(np.max(np.abs(waves.g2)) / _SPANNED))
    norms = waves.norms(k[:, np.newaxis])
    scale = 1 / np.sqrt(np.abs(norms))
    leaving = _guided(waves, 0.5 - depth, scale, poisson_ratio)
    singular = _singular(k, hold, waves, poisson_ratio, corner=corner, across=0.5 - depth)
    traces = np.concatenate([leaving, singular], axis=3)
    value, coarse, error = _balanced(traces, depth, weights, norms * scale**2, count)
    same = np.broadcast_to(np.eye(count, dtype=np.complex128), value.shape)
    n = count - 1
    return Reflection(
        leaving=same,
        arriving=-value,
        coarse=(same[:, :n, :n], -coarse[:, :n, :n]),
        error=error,
        scale=scale[:, :count],
    )


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
    k: Complex, hold: Complex, waves: Guided, nu: float, *, corner: _Corner, across: Real
) -> Complex:
    """Return the same of the fields with the corner's singularity, those of (56) with powers."""
    lossless = not (np.any(k.imag) or np.any(hold.imag))
    path = contour(
        waves.p, corner.path_rtol, finest=1e-30, nearest=corner.nearest, mirrored=lossless
    )
    s, k2 = path.s, (k * k)[:, np.newaxis]
    g1, g2 = np.sqrt(s * s - k2), np.sqrt(s * s + k2)
    one, change = edge_shapes(g1, g2, 2 * k2 / (g1 + g2), across, waves.sign)
    grip, pull = grips(g1, g2, k2, hold[:, np.newaxis], waves.sign)
    fade = np.log(_FADE / (_FADE - 1j * s))
    turned = _powers(fade, corner.turned) * (path.weight / grip)[..., np.newaxis]
    displaced = _powers(fade, corner.displaced) * path.weight[..., np.newaxis]
    ratio = (pull / grip)[..., np.newaxis]
    square = (nu - 1) * s * s + nu * k2
    # of the second branch, and what it is more than of the first
    operators = (
        (np.ones_like(s), np.zeros_like(s)),
        (1j * s, np.zeros_like(s)),
        (square, 2 * nu * k2 + 0 * s),
        (1j * s * ((1 - nu) * s * s + (2 - nu) * k2), 2j * s * (2 - nu) * k2),
    )
    of_one, of_change = [], []
    for second, more in operators:
        op, gain = second[..., np.newaxis], more[..., np.newaxis]
        of_one += [turned * gain, displaced * (op - ratio * gain)]
        of_change += [turned * op, displaced * (op - ratio * op)]
    strengths = np.concatenate(
        [np.concatenate(of_one, axis=2), np.concatenate(of_change, axis=2)], axis=1
    )
    found = np.concatenate([one, change], axis=2) @ strengths
    if lossless:
        found = found.real + 0j
    return np.moveaxis(found.reshape(*found.shape[:2], 4, -1), 2, 1)


def _powers(fade: Complex, powers: tuple[complex, ...]) -> Complex:
    """Return the transforms of powers of the distance times exp(-2 d), real for s = i t each."""
    found = []
    for power in powers:
        if not power.imag:
            found.append(np.exp((power.real + 1) * fade))
            continue
        size, turn = np.exp((power.real + 1) * fade), power.imag * fade
        found += [size * np.cos(turn), size * np.sin(turn)]
    return np.stack(found, axis=2)


@lru_cache(maxsize=8)
def _corner(hold: float, poisson_ratio: float, *, fine: bool) -> _Corner:
    """Return what the corner of an edge needs; `hold` is the greatest 1 / (kappa W)."""
    path_rtol = 1e-14 if fine else 1e-10
    if hold >= _STIFF:
        count = 6 if fine else 4
        return _Corner(
            turned=tuple(complex(n) for n in range(count)),
            displaced=tuple(complex(n) for n in range(2, count + 2)),
            least=1e-4 if fine else 1e-3,
            nearest=1e-6 if fine else 2e-5,
            path_rtol=path_rtol,
        )
    roots = [z for z in corner_powers(poisson_ratio) if z.real < (_FINE_POWER if fine else _POWER)]
    springs = (2 + 2 * fine) * (hold > _RIGID)
    return _Corner(
        turned=_apart(roots, range(springs)),
        displaced=_apart([z + 1 for z in roots], range(2, springs + 2)),
        least=1e-5 if springs else 1e-4 if fine else 1e-3,
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


@lru_cache(maxsize=8)
def _rule(least: float, n_panels: int) -> tuple[Real, Real]:
    """Return distances from the corner on half of the end and weights, crowded at the corner."""
    shrunk = 0.5 * _RATIO ** -np.arange(math.ceil(math.log(0.5 / least) / math.log(_RATIO)) + 1.0)
    borders = np.append(0.0, shrunk[::-1])
    cuts = [np.linspace(a, b, math.ceil((b - a) * n_panels) + 1)[:-1] for a, b in pairwise(borders)]
    borders = np.concatenate([*cuts, [0.5]])
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    lengths = np.diff(borders)[:, np.newaxis]
    return (borders[:-1, np.newaxis] + lengths * (nodes + 1) / 2).ravel(), (
        lengths * weights / 2
    ).ravel()
