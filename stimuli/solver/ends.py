"""What the two free short ends of a finite strip add to the field, in units of its width.

Each end turns the waves of a load back: those that leave it and those that arrive leave no bending
moment and no shear force there. Between simple supports the guided waves are enough, each order
across the strip by itself; between edges that are held the corners need more, see
`stimuli.solver.fitted`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.endless import n_waves
from stimuli.solver.fitted import fitted
from stimuli.solver.guided import Guided, guided
from stimuli.solver.source import Answered, Ends, Question

if TYPE_CHECKING:
    from stimuli.arrays import Complex, Real


_EPS: Final = float(np.finfo(np.float64).eps)
_MOST_WAVES: Final = 48
"""Most waves of one symmetry that decay and are summed; nearer to an end they are not used."""

_STEP: Final = math.pi
"""Least mean increase of the decay from one wave of a symmetry to the next."""

_SPARE: Final = 6.0
_SOFTEST: Final = 1e18
"""1 / (kappa W) that stands for a simple support where the guided waves are not enough."""

_HELD_WAVES: Final = 2
"""Guided waves between held edges beyond those of the endless strip."""

_STRONGEST: Final = 30.0
"""Bound of what the ends make of a wave that decays, relative to it."""

_NO_NULL: Final = 0.3
"""Distance from a load in widths below which the field has no nulls."""


class ResonanceError(ValueError):
    """A strip without loss has no finite field, to the last digit of its frequency."""


def reflected(question: Question, ends: Ends, signs: tuple[int, ...]) -> Answered:
    """Return what the ends add to D U / W^2, equations (54) to (58).

    Parameters
    ----------
    question : Question
        Load, places across, wavenumbers and wanted error; its distances are not used.
    ends : Ends
        The ends, and where the pairs are along the strip.
    signs : tuple of int
        Symmetries about the centre line that are computed.

    Returns
    -------
    Answered
        Shape (n_frequencies, n_pairs).

    Examples
    --------
    A load and a point may be exchanged:

    >>> from stimuli.solver.source import Source
    >>> from stimuli.solver.across import Span
    >>> def at(y0, y, x0, x):
    ...     question = Question(exact_k=np.array([2 + 0j]), exact_hold=np.array([0j]), rtol=1e-8,
    ...                 source=Source(span=Span(centre=y0)), distance=np.array([abs(x - x0)]),
    ...                 across=np.array([y]))
    ...     ends = Ends(length=2.0, poisson_ratio=0.3, load=np.array([x0]), point=np.array([x]),
    ...                 direct=np.array([0]))
    ...     return reflected(question, ends, (1, -1)).value
    >>> bool(abs(at(0.1, -0.3, 0.2, 0.7) / at(-0.3, 0.1, 0.7, 0.2) - 1) < 1e-6)
    True
    """
    value = np.zeros((question.k.size, question.across.size), dtype=np.complex128)
    error = np.zeros(value.shape)
    supported = bool(np.all(np.isinf(question.hold)))
    wanted = _wanted(question, ends) if supported else 0
    enough = supported and wanted <= _MOST_WAVES
    count = n_waves(question.k) + (wanted if enough else _HELD_WAVES)
    soft = replace(question, exact_hold=np.full_like(question.exact_hold, _SOFTEST))
    for sign in signs:
        waves = guided(question.exact_k, question.exact_hold, count, sign)
        if enough:
            part = _turned_back(question, ends, waves)
        else:
            part = fitted(soft if supported else question, ends, waves)
        value, error = value + part.value, error + part.error
    return Answered(value=value, error=error)


def faintness(question: Question, ends: Ends, signs: tuple[int, ...]) -> Real:
    """Return how much the ends can add to the field as a part of it.

    Section 7 of docs/model.md: 30 exp(-d), d the decay of the slowest wave over the detour.

    Parameters
    ----------
    question : Question
        As for `reflected`, with the distance of each pair.
    ends : Ends
        The ends, and where the pairs are along the strip.
    signs : tuple of int
        Symmetries about the centre line that are computed.

    Returns
    -------
    ndarray of float64, shape (n_frequencies, n_pairs)
        Where waves propagate without loss, at least 30.

    Examples
    --------
    Waves that decay over several widths to either end are not worth the trouble:

    >>> from stimuli.solver.source import Source
    >>> from stimuli.solver.across import Span
    >>> middle, source = np.array([0.0]), Source(span=Span(centre=0.0))
    >>> question = Question(exact_k=np.array([1 + 0j]), exact_hold=np.array([0j]), rtol=1e-6,
    ...                     source=source, distance=middle, across=middle)
    >>> def faint(length):
    ...     ends = Ends(length=length, poisson_ratio=0.3, load=middle, point=middle,
    ...                 direct=np.array([0]))
    ...     return faintness(question, ends, (1,))
    >>> bool(faint(1.0) > 0.1), bool(faint(5.0) < 1e-6)
    (True, True)
    """
    detour = ends.detours(question.source.half_length + question.source.radius)
    decay = np.full(question.k.size, np.inf)
    for sign in signs:
        waves = guided(question.exact_k, question.exact_hold, n_waves(question.k), sign)
        decay = np.minimum(decay, waves.p.imag[:, 0])
    nulls = np.maximum(math.log(1e3) - decay[:, np.newaxis] * question.distance, 0.0)
    nulls[:, question.distance < _NO_NULL] = 0.0
    return np.asarray(_STRONGEST * np.exp(nulls - decay[:, np.newaxis] * detour))


def _wanted(question: Question, ends: Ends) -> int:
    """Return how many waves that decay reach the wanted error between supported edges."""
    source = question.source
    way = float(np.min(ends.length - np.abs(ends.load + ends.point)))
    way = max(way - source.half_length, 1e-9)
    return int(min((math.log(1 / question.rtol) + _SPARE) / (_STEP * way), 1e6))


def _turned_back(question: Question, ends: Ends, waves: Guided) -> Answered:
    """Return the waves that the ends turn back, at the points, of one symmetry."""
    leaving, arriving, scale = _works(waves, ends.poisson_ratio)
    loads, which = np.unique(ends.load, return_inverse=True)
    p = waves.p[..., np.newaxis]
    k = question.k[:, np.newaxis]
    strength = 1j * waves.excited(k, question.source) / waves.norms(k) / scale
    right, left = (
        strength[..., np.newaxis] * question.source.along(p, ends.length / 2 + side * loads)
        for side in (-1, 1)
    )
    across = waves.shapes(question.across) * scale[..., np.newaxis]
    passed = np.exp(1j * p * ends.length)
    towards = np.exp(1j * p * (ends.length / 2 - ends.point))
    away = np.exp(1j * p * (ends.length / 2 + ends.point))
    n_fewer = _fewer(waves.p.shape[1])
    value = np.zeros((question.k.size, question.across.size), dtype=np.complex128)
    fewer, size, lost = value.copy(), np.zeros(value.shape), np.zeros(value.shape)
    rounded = np.abs(arriving * np.swapaxes(passed, 1, 2)) * (1 + np.abs(p) * ends.length)
    for mirror in (1, -1):
        matrix = leaving + mirror * arriving * np.swapaxes(passed, 1, 2)
        pushed = -arriving @ ((right + mirror * left) / 2)
        seen = across * (towards + mirror * away)
        inverse, strengths = _solved(matrix, pushed)
        terms = strengths[..., which] * seen
        value += terms.sum(axis=1)
        size += np.abs(terms).sum(axis=1)
        shaken = np.abs(inverse) @ ((np.abs(leaving) + rounded) @ np.abs(strengths))
        lost += (shaken[..., which] * np.abs(seen)).sum(axis=1)
        _, some = _solved(matrix[:, :n_fewer, :n_fewer], pushed[:, :n_fewer])
        fewer += (some[..., which] * seen[:, :n_fewer]).sum(axis=1)
    # beside a resonance without loss what rounding makes of the matrix counts, not the sum's own
    error = np.abs(value - fewer) + _EPS * (1e2 * size + 4 * lost)
    return Answered(value=value, error=error)


def _solved(matrix: Complex, pushed: Complex) -> tuple[Complex, Complex]:
    """Return the inverses of matrices and the solutions, or tell that there is none."""
    try:
        inverse: Complex = np.linalg.inv(matrix).astype(np.complex128)
        return inverse, np.linalg.solve(matrix, pushed).astype(np.complex128)
    except np.linalg.LinAlgError as error:
        raise ResonanceError("the ends turn back as much as arrives") from error


def _fewer(count: int) -> int:
    """Return the number of waves of the coarser model: even, not to part a pair."""
    return 2 * max(int(0.375 * count), 1)


def _works(waves: Guided, poisson_ratio: float) -> tuple[Complex, Complex, Real]:
    """Return the virtual works of leaving and arriving waves on leaving ones, and the scale.

    Row n, column m: int (V_m phi_n + i p_n M_m phi_n) dY at an end, equation (55).
    """
    p = waves.p
    nodes, weights = np.polynomial.legendre.leggauss(2 * (p.shape[1] + 12) + 16)
    across, weights = (nodes + 1) / 4, weights / 2
    shapes, slopes = waves.shapes(across), waves.slopes(across)
    scale = 1 / np.sqrt(np.abs(shapes) ** 2 @ weights)
    shapes, slopes = shapes * scale[..., np.newaxis], slopes * scale[..., np.newaxis]
    mass = (shapes * weights) @ np.swapaxes(shapes, 1, 2)
    bent = -(slopes * weights) @ np.swapaxes(slopes, 1, 2)
    row, column = p[..., np.newaxis], p[:, np.newaxis]
    shear = 1j * column * ((2 - poisson_ratio) * bent - column**2 * mass)
    moment = poisson_ratio * bent - column**2 * mass
    return 1j * row * moment - shear, 1j * row * moment + shear, scale
