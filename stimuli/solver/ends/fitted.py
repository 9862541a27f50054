"""What free ends add between edges that are held: fields fitted to the ends by least squares.

Every field used solves the plate equation and keeps the edges, equations (56) and (58). Only
the ends are fitted: as much bending moment and shear force as the load's own waves leave there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.ends.corners import EndFunctions, end_functions
from stimuli.solver.ends.images import Arriving, Images, images, is_near
from stimuli.solver.source import Answered, Question

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real
    from stimuli.solver.guided import Guided
    from stimuli.solver.source import Ends


_EPS: Final = float(np.finfo(np.float64).eps)
_ALONE: Final = 40.0
"""Decay of the slowest wave over the length, in nepers, beyond which an end knows of no other."""

_LEAST: Final = 2e-3
"""Distance of a load from an end, in widths, below which it is extrapolated from greater ones."""

_STEPS: Final = np.arange(1.0, 6.0)
_RIDGE: Final = 1e-12
"""Regularisation: what of a function's own size its coefficient costs."""

_CAUTION: Final = 12.0
"""What the difference from a model with fewer sources is multiplied with."""

_IMAGES_ERROR: Final = 1e-10
"""Relative error of what the images of loads near an end leave out."""

_DROPPED: Final = 0.25
"""Part of the sources, the nearest to the corner, that the model with fewer of them lacks."""

_SOURCES: Final = (6, 40)
"""Least and largest number of places beyond an end."""

_SOFT: Final = 1e15
"""1 / (kappa W) above which the corners are not singular to be seen."""

_PANEL: Final = 5
_HALF: Final = 0.5
_PLACES: Final = 256
"""Pairs that are evaluated at once."""


def fitted(question: Question, ends: Ends, waves: Guided) -> Answered:
    """Return what the ends add to D U / W^2 of one symmetry, equation (57).

    Of the shape (n_frequencies, n_pairs). The question's distances are not used: `ends` has where
    the pairs are along the strip.
    """
    count = _n_sources(question.rtol, float(np.max(np.abs(question.k))))
    if np.all(np.abs(question.hold) > _SOFT):
        count = _SOURCES[0]
    functions = end_functions(question.k, question.hold, waves, ends.poisson_ratio, count)
    value = np.zeros((question.k.size, question.across.size), dtype=np.complex128)
    error = np.zeros(value.shape)
    room = ends.length / 2 - np.abs(ends.load) - question.source.half_length
    near = np.array([is_near(a) for a in room])
    groups = [~near, *(near & (ends.load == load) for load in np.unique(ends.load[near]))]
    for some in groups:
        if np.any(some):
            part = _approached(
                question.at(some), ends.at(some), functions, float(np.min(room[some]))
            )
            value[:, some], error[:, some] = part.value, part.error
    return Answered(value=value, error=error)


def _approached(question: Question, ends: Ends, functions: EndFunctions, room: float) -> Answered:
    """Return what the ends add; for loads at an end, from loads a little way off, (58)."""
    if room >= _LEAST:
        return _fitted(question, ends, functions, 0.0)
    parts = [_fitted(question, ends, functions, gap) for gap in _LEAST * _STEPS]
    values = np.array([part.value for part in parts])
    value, coarse = (
        np.tensordot(_extrapolation(n, room / _LEAST), values[:n], 1)
        for n in (_STEPS.size, _STEPS.size - 1)
    )
    error = 2 * np.max([part.error for part in parts], axis=0)
    return Answered(value=value, error=error + np.abs(value - coarse))


def _extrapolation(count: int, place: float) -> Real:
    """Return what the polynomial through values at 1, 2 ... takes from each at a place."""
    steps = _STEPS[:count]
    others = [np.delete(steps, i) for i in range(count)]
    return np.array(
        [np.prod((place - o) / (step - o)) for step, o in zip(steps, others, strict=True)]
    )


def _fitted(question: Question, ends: Ends, functions: EndFunctions, least: float) -> Answered:
    """Return what the ends add for loads that need the same functions and keep a distance."""
    loads, which = np.unique(ends.load, return_inverse=True)
    half, source = ends.length / 2, question.source
    right, left = (np.maximum(half + side * loads, least + source.half_length) for side in (-1, 1))
    gaps = [float(a[0]) - source.half_length for a in (right, left)]
    gaps = [gap for gap in gaps if is_near(gap)]
    basis = _Basis(functions=functions, mirrors=[images(functions, source, gap) for gap in gaps])
    across, weights = _collocation(functions, question, gaps)
    arriving = Arriving(functions=functions, source=source, across=across, rtol=question.rtol)
    moment, shear = arriving.at(np.concatenate([right, left]))
    pushed = np.concatenate([-weights[0] * moment, weights[1] * shear], axis=1)
    origin = np.zeros(across.size)
    traces = basis.at(across, (origin, origin + ends.length), 3)
    works = [[w * t for w, t in zip(weights, trace[1:], strict=True)] for trace in traces]
    dropped = 2 * max(int(_DROPPED * functions.beyond.size), 2)
    answers = _strengths(works, pushed, dropped, alone=basis.is_alone(ends.length))
    shape = (question.k.size, question.across.size)
    value, coarse, size = (np.zeros(shape, dtype=np.complex128) for _ in range(3))
    for some in np.array_split(np.arange(shape[1]), -(-shape[1] // _PLACES)):
        aways = (half - ends.point[some], half + ends.point[some])
        for trace, (fine, rough) in zip(
            basis.at(question.across[some], aways, 1), answers, strict=True
        ):
            seen, own = trace[0], which[some]
            value[:, some] += _summed(seen, fine[:, own])
            coarse[:, some] += _summed(seen[..., : rough.shape[2]], rough[:, own])
            size[:, some] += _summed(np.abs(seen), np.abs(fine[:, own]))
    error = _CAUTION * np.abs(value - coarse) + 50 * _EPS * size.real
    if gaps:
        error += _IMAGES_ERROR * np.abs(value)
    return Answered(value=value, error=error)


def _summed(seen: Complex | Real, strengths: Complex | Real) -> Complex:
    return np.asarray((seen * strengths).sum(axis=2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Basis:
    """All fields that are fitted."""

    functions: EndFunctions
    mirrors: list[Images]

    def at(self, across: Real, aways: tuple[Real, ...], kinds: int) -> list[list[Complex]]:
        """Return their traces, images first, the sources nearest to the corner last."""
        parts = [mirror.at(across, aways, kinds) for mirror in self.mirrors]
        parts.append(self.functions.at(across, aways, kinds))
        return [
            [np.concatenate(same, axis=2) for same in zip(*traces, strict=True)]
            for traces in zip(*parts, strict=True)
        ]

    def is_alone(self, length: float) -> bool:
        """Return whether no wave that an end turns back is felt at the other."""
        return float(np.min(self.functions.waves.p.imag[:, 0])) * length > _ALONE


def _strengths(
    works: list[list[Complex]], pushed: Complex, dropped: int, *, alone: bool
) -> list[tuple[Complex, Complex]]:
    """Return the strengths of the functions of the right and of the left end, (57).

    Each twice, with all and with fewer functions, (n_frequencies, n_loads, n_functions).
    """
    (moment, shear), (far_moment, far_shear) = works
    right, left = np.split(pushed, 2, axis=2)
    if alone:
        answers = _least_squares(np.concatenate([moment, shear], axis=1), pushed, dropped)
        halves = [np.split(np.swapaxes(a, 1, 2), 2, axis=1) for a in answers]
        return [(halves[0][0], halves[1][0]), (halves[0][1], halves[1][1])]
    found = []
    for mirror in (1, -1):
        rows = np.concatenate([moment + mirror * far_moment, shear - mirror * far_shear], axis=1)
        answers = _least_squares(rows, (right + mirror * left) / 2, dropped)
        found.append([np.swapaxes(a, 1, 2) for a in answers])
    even, odd = found
    return [
        (even[0] + odd[0], even[1] + odd[1]),
        (even[0] - odd[0], even[1] - odd[1]),
    ]


def _least_squares(matrix: Complex, pushed: Complex, dropped: int) -> tuple[Complex, Complex]:
    """Return the regularised solution in all columns, and that without the last ones."""
    scale = np.linalg.norm(matrix, axis=1)[..., np.newaxis]
    scale[scale == 0] = 1.0
    matrix = matrix / np.swapaxes(scale, 1, 2)
    count = matrix.shape[2]
    ridge = np.broadcast_to(_RIDGE * np.eye(count), (matrix.shape[0], count, count))
    q, r = np.linalg.qr(np.concatenate([matrix, ridge], axis=1))
    seen = np.conj(np.swapaxes(q[:, : matrix.shape[1]], 1, 2)) @ pushed
    fewer = count - dropped
    coarse = np.linalg.solve(r[:, :fewer, :fewer], seen[:, :fewer])
    return np.linalg.solve(r, seen) / scale, coarse / scale[:, :fewer]


def _n_sources(rtol: float, k: float) -> int:
    """Return how many places beyond an end reach the wanted error."""
    count = ((math.log(1 / rtol) + 3.1) / 4.35) ** 2 + 0.3 * k
    return int(np.clip(count, *_SOURCES)) + 1


def _collocation(
    functions: EndFunctions, question: Question, gaps: list[float]
) -> tuple[Real, tuple[Real, Real]]:
    """Return places on half of the end, crowded where it matters, weights of moment and shear."""
    span = question.source.span
    finest = min(gaps, default=1.0)
    borders = [0.5 * _halves(float(functions.beyond[-1]) / 2)]
    places = {0.5 - abs(float(span.low)), 0.5 - abs(float(span.high))}
    borders += [place + side * _halves(gap) for gap in gaps for place in places for side in (-1, 1)]
    borders.append(np.array(list(places)) if gaps else np.array([]))
    rough = np.concatenate(borders)
    rough = np.unique(rough[(rough > 0) & (rough <= _HALF)])
    apart = np.diff(rough, prepend=0.0) > 0.2 * np.minimum(rough, finest)
    rough = np.concatenate([[0.0], rough[apart]])
    longest = 1.5 / max(float(np.max(np.abs(question.k))), 10.0)
    cuts = [np.linspace(a, b, math.ceil((b - a) / longest) + 1)[:-1] for a, b in pairwise(rough)]
    ends = np.concatenate([*cuts, [0.5]])
    nodes, weights = np.polynomial.legendre.leggauss(_PANEL)
    lengths = np.diff(ends)[:, np.newaxis]
    depth = (ends[:-1, np.newaxis] + lengths * (nodes + 1) / 2).ravel()
    weights = (lengths * weights / 2).ravel()[:, np.newaxis]
    deep = depth[:, np.newaxis]
    return 0.5 - depth, (np.sqrt(weights * deep), np.sqrt(weights * deep**3))


def _halves(least: float) -> Real:
    """Return 1, 1/2, 1/4 ... down to a part of one, the smallest first."""
    return np.asarray(0.5 ** np.arange(math.ceil(math.log2(1 / least)), -1, -1))
