"""An endless strip over many frequencies: its first waves at each of them, the rest from a few.

A field is not smooth in frequency where a wave begins to propagate, nor where two waves meet. The
squares p^2 of waves that meet only one another are roots of a polynomial whose coefficients are
smooth, and so is the numerator whose residues are theirs: from both at a few frequencies follow the
waves at all others. What is left when they are taken out has its nearest singularity where the next
ones meet or begin to propagate, and hardly varies below.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli.solver.endless import Waves, summed
from stimuli.solver.guided import supported
from stimuli.solver.source import Answered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.solver.source import Question, Source

    _Numbers = NDArray[np.inexact[Any]]


_CLOSE: Final = 0.1
"""Half distance of p^2 of two waves, as a part of the radius of a circle about both on which their
sum is taken: either of them is infinite where they meet."""

_WITHIN, _TURNS = 0.1, 1.0
"""Radius of the circle, as a part of p^2, and the most that it may change p x by."""

_CIRCLE: Final = np.exp(2j * np.pi * np.arange(16) / 16)

_TOUCHING: Final = 1e-8
"""Distance of two of more roots, as a part of that of all, below which they are not told apart."""

_APART: Final = 0.1
"""Distance, likewise, from which roots do not feel one another."""

_STILL: Final = 1e-12
"""p^2 that counts as none."""

_BACKWARD: Final = 0.01
"""Im p below minus this part of Re p is no rounding: the other root is the outgoing one."""

_FEW: Final = 8
"""Places among which equal distances are not looked for."""

_CAUTION: Final = 3.0
"""What the first coefficient left out is multiplied with."""

_LOOSER: Final = 6.0
"""Times the wanted error that is asked of the rest: what it errs by lies a hundredfold below."""

_MOST_RTOL: Final = 0.1
_TINIEST: Final = 1e-300
_EVERY_OTHER: Final = slice(None, None, 2)
_EPS: Final = 8 * float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Grid:
    """Nodes of which every other one has all solved, the others the waves, and what follows."""

    counts: dict[int, int]  # how many pairs of waves are taken out of each symmetry
    ratio: float  # of successive coefficients
    fine: _Numbers  # from values at all nodes to the asked places: (n, n_nodes)
    coarse: _Numbers  # the same from every other node
    fine_last: Real  # from values to the last two Chebyshev coefficients: (2, n_nodes)
    coarse_last: Real  # the same for every other node, to the last two or three: (2 or 3, n_other)
    rest: Real  # the first term left out, over its coefficient: (n,)
    # what series grow by off the axis, of the first term that all nodes leave out: (n,) or (1,)
    growth: Real

    @classmethod
    def over(cls, places: _Numbers, count: int, *, counts: dict[int, int], ratio: float) -> Grid:
        """Return the grid for places near -1 to 1."""
        series: _Numbers = np.empty((2 * count - 1, places.size), dtype=places.dtype)
        series[0], series[1], twice = 1.0, places, 2 * places
        for order in range(2, len(series)):
            np.multiply(twice, series[order - 1], out=series[order])
            series[order] -= series[order - 2]
        fine, coarse = _to_series(len(series)), _to_series(count)
        growth = np.ones(1)
        if np.iscomplexobj(places):
            growth = np.maximum(np.abs(series[-1]), 1.0) ** (1 + 1 / (2 * count - 2))
        return cls(
            counts=counts,
            ratio=ratio,
            fine=np.asarray(series.T @ fine),
            coarse=np.asarray(series[:count].T @ coarse),
            fine_last=fine[-2:],
            coarse_last=coarse[max(count - 3, 1) :],
            rest=_CAUTION * (np.abs(series[count] - series[count - 2]) + ratio),
            growth=growth,
        )

    def left_out(self, values: _Numbers) -> Real:
        """Return the size of what all nodes do not tell: (n or 1, n_values)."""
        older, newer = np.abs(self.fine_last @ values)
        missing = _CAUTION * self.ratio * np.maximum(newer, older * self.ratio)
        return np.asarray(np.multiply.outer(self.growth, missing))


def grid_nodes(count: int) -> Real:
    """Return the places of the nodes of a grid, so many with all solved.

    >>> grid_nodes(3).round(3).tolist()
    [1.0, 0.707, 0.0, -0.707, -1.0]
    """
    return np.asarray(np.sin(np.pi * np.arange(count - 1, -count, -1) / (2 * count - 2)))


@lru_cache(maxsize=64)
def _to_series(count: int) -> Real:
    """Return what makes Chebyshev coefficients of values at the extrema of the last of them."""
    order = np.arange(count)
    half = np.where((order == 0) | (order == count - 1), 0.5, 1.0)
    turns = np.cos(np.pi * np.outer(order, order) / (count - 1))
    return np.asarray(2 / (count - 1) * turns * half * half[:, np.newaxis])


def over_frequency(question: Question, signs: tuple[int, ...], grid: Grid) -> Answered:
    """Return D U / W^2 at the places of a grid, equations (86) and (87); nodes are asked for."""
    k, hold = question.exact_k[_EVERY_OTHER], question.exact_hold[_EVERY_OTHER]
    found = [Waves.of(question, sign, 2 * grid.counts[sign]) for sign in signs]
    solved = summed(
        replace(
            question, exact_k=k, exact_hold=hold, rtol=min(_LOOSER * question.rtol, _MOST_RTOL)
        ),
        [waves.at(_EVERY_OTHER) for waves in found],
    )
    value, error = solved.value, np.sqrt(np.abs(grid.coarse) ** 2 @ solved.error**2)
    parts = []
    for waves in found:
        count = grid.counts[waves.known.sign]
        if count:
            p, residues = _taken(question, waves, count)
            carried = residues * _carried(question.source, p, question.distance)
            value = value - carried[_EVERY_OTHER].sum(axis=1)
            way = _pairs if count == 1 or waves.known.branch is not None else _block
            parts.append(way(question, p, residues, grid, waves.known.lack))
    last = np.abs(grid.coarse_last @ value)
    fall = np.max(last[1:] / np.maximum(last[:-1], _TINIEST), axis=0)
    fall = np.clip(fall, grid.ratio, 1.0)
    error += np.outer(grid.rest, np.maximum(last[-1], last[-2] * fall) * fall)
    value = grid.coarse @ value
    for part in parts:
        value += part.value
        error += part.error
    return Answered(value=value, error=error)


def _taken(question: Question, waves: Waves, count: int) -> tuple[Complex, Complex]:
    """Return p of the waves taken out, the pairs' firsts first, and p times their amplitudes.

    Between simple supports a pair are both branches of one order.
    """
    known = waves.known
    if known.branch is None:
        p, strength = known.p[:, : 2 * count], waves.strength[:, : 2 * count]
    else:
        first = supported(question.exact_k, count, known.sign)
        p = first.p
        strength = first.moved(question.k[:, np.newaxis], question.source, question.across)
    return p, p[..., np.newaxis] * strength


def _pairs(question: Question, p: Complex, residues: Complex, grid: Grid, lack: float) -> Answered:
    """Return the sum of pairs of waves at all places, each pair by its quadratic, (87)."""
    count = p.shape[1] // 2
    z, shape = p * p, (-1, count, question.distance.size)
    half = (z[:, :count] - z[:, count:]) / 2
    squares: _Numbers = np.concatenate([(z[:, :count] + z[:, count:]) / 2, half * half], axis=1)
    squares = squares.real if question.lossless else squares
    one, two = residues[:, :count], residues[:, count:]
    weights = np.concatenate([one + two, (one - two) * half[..., np.newaxis]], axis=1)
    flat = weights.reshape(len(z), -1)

    found = grid.fine @ squares
    middle, square = found[:, :count], found[:, count:]
    half = np.sqrt(square.astype(np.complex128))
    p = _outgoing(np.concatenate([middle + half, middle - half], axis=1))
    mean, slope = _both(question, p, middle, half)
    found = grid.fine @ flat
    width = flat.shape[1] // 2
    first = found[:, :width].reshape(shape) * mean
    second = found[:, width:].reshape(shape) * slope

    size = np.abs(p)
    amount = np.abs(first) + np.abs(second)
    steep = _steepness(question, np.minimum(size[:, :count], size[:, count:]))
    missing, size = grid.left_out(squares), 1 + np.abs(middle)
    rounding = _EPS * size + lack
    about = (missing[:, :count] + rounding)[..., np.newaxis]
    about = about + (missing[:, count:] + rounding * size)[..., np.newaxis] * steep
    missing = grid.left_out(flat)
    error = amount * steep * about + np.abs(mean) * missing[:, :width].reshape(shape)
    error += np.abs(slope) * missing[:, width:].reshape(shape)
    return Answered(value=(first + second).sum(axis=1), error=error.sum(axis=1))


def _both(
    question: Question, p: Complex, middle: _Numbers, half: Complex
) -> tuple[Complex, Complex]:
    """Return the mean of two waves and their difference over that of p^2, for all pairs."""
    source, distance, count = question.source, question.distance, half.shape[1]
    reach = float(np.max(distance)) + source.half_length
    size = np.abs(middle)
    radius = np.minimum(_WITHIN * size, 2 * _TURNS / (reach + 1e-9) * np.sqrt(size))
    rows, pairs = np.nonzero(np.abs(half) < _CLOSE * radius)
    apart = half
    if rows.size:
        apart = half.copy()
        apart[rows, pairs] = 1.0
    wave = _carried(source, p, distance)
    mean = (wave[:, :count] + wave[:, count:]) / 2
    slope = (wave[:, :count] - wave[:, count:]) / (2 * apart[..., np.newaxis])
    if rows.size:
        place = middle[rows, pairs, np.newaxis].astype(np.complex128)
        part = half[rows, pairs, np.newaxis] / (radius[rows, pairs, np.newaxis] * _CIRCLE)
        ring = radius[rows, pairs, np.newaxis] * _CIRCLE / place
        ring = _outgoing(place) * np.sqrt(1 + ring)
        ring = _carried(source, ring, distance)
        even = 1 / (1 - part * part) / _CIRCLE.size
        odd = even / (radius[rows, pairs, np.newaxis] * _CIRCLE)
        mean[rows, pairs] = (even[..., np.newaxis] * ring).sum(axis=1)
        slope[rows, pairs] = (odd[..., np.newaxis] * ring).sum(axis=1)
    return mean, slope


def _block(question: Question, p: Complex, residues: Complex, grid: Grid, lack: float) -> Answered:
    """Return the sum of more waves at all places, as roots of one polynomial, (87)."""
    z = p * p
    n, count = z.shape
    centre = float(np.mean(z.real))
    scale = float(np.max(np.abs(z - centre)))
    root = (z - centre) / scale
    whole = np.zeros((n, count + 1), dtype=np.complex128)
    whole[:, 0] = 1.0
    for i in range(count):
        whole[:, 1:] -= root[:, i : i + 1] * whole[:, :-1]
    others = np.empty((n, count, count), dtype=np.complex128)
    others[..., 0] = 1.0
    for i in range(1, count):
        others[..., i] = whole[:, i : i + 1] + root * others[..., i - 1]
    numerators = np.einsum("nij,nip->njp", others, residues).reshape(n, -1)
    whole = whole[:, 1:]
    coefficients: _Numbers = whole.real if question.lossless else whole

    found = grid.fine @ coefficients
    matrix = np.zeros((len(found), count, count), dtype=found.dtype)
    matrix[:, 0] = -found
    matrix[:, np.arange(1, count), np.arange(count - 1)] = 1.0
    root = np.linalg.eigvals(matrix).astype(np.complex128)
    p = _outgoing(centre + scale * root)
    apart = root[:, :, np.newaxis] - root[:, np.newaxis]
    apart[:, np.arange(count), np.arange(count)] = 1.0
    nearest = np.min(np.abs(apart), axis=2)
    apart = np.where(np.abs(apart) < _TOUCHING, _TOUCHING, apart)
    slope = np.prod(apart, axis=2)[..., np.newaxis]
    parts = (grid.fine @ numerators).reshape(-1, count, question.distance.size)
    residue = parts[:, :1]
    for i in range(1, count):
        residue = residue * root[..., np.newaxis] + parts[:, i : i + 1]
    wave = _carried(question.source, p, question.distance) / slope
    terms = residue * wave

    amount = np.abs(terms)
    alone = (nearest / (nearest + _APART))[..., np.newaxis]
    moved = grid.left_out(coefficients).sum(axis=1)[:, np.newaxis, np.newaxis]
    moved = moved + count * (_EPS + lack / scale)
    missing = grid.left_out(numerators).reshape(-1, count, question.distance.size)
    missing = missing.sum(axis=1, keepdims=True)
    error = amount * alone**2 * scale * moved / np.abs(slope) * _steepness(question, np.abs(p))
    error += np.abs(wave) * alone * missing + _EPS * amount
    error[np.any(nearest < _TOUCHING, axis=1)] = np.inf
    return Answered(value=terms.sum(axis=1), error=error.sum(axis=1))


def _outgoing(z: Complex) -> Complex:
    """Return the roots that leave the load, though z is known to some digits only."""
    p = np.sqrt(np.where(np.abs(z) < _STILL, _STILL, z))
    return np.where(p.imag < -_BACKWARD * p.real, -p, p)


def _steepness(question: Question, size: Real) -> Real:
    """Return how much waves of some |p| vary with p^2, relative to themselves."""
    size = size[..., np.newaxis]
    reach = question.distance + question.source.half_length
    return np.asarray(0.5 * (reach + 1 / size) / size)


def _carried(source: Source, p: Complex, distance: Real) -> Complex:
    """Return `Source.along` over p, with fewer exponentials where no digit is lost by it."""
    if distance.size > _FEW:
        different, places = np.unique(distance, return_inverse=True)
        if 2 * different.size < distance.size:
            return _carried(source, p, different)[..., places]
    p = p[..., np.newaxis]
    return np.asarray(source.along_fast(p, distance) / p)
