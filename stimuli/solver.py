"""The field of one load in an endless strip at given bending wavenumbers, in units of its width."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.contour import Contour, contour
from stimuli.disc import inside_excess
from stimuli.guided import Guided, guided
from stimuli.transform import Source, transformed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]

_LEAST_DISTANCE: Final = 1e-8
"""Distances from a disc's centre are kept above this part of its radius: the two logarithms that
cancel there differ by less than rounding."""

_CIRCLE_NODES: Final = 32
_EPS: Final = float(np.finfo(np.float64).eps)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """Values with an estimate of their error, both of shape (n_frequencies, n_points)."""

    value: Complex
    error: Real


def solved(
    k: Complex,
    hold: Complex,
    source: Source,
    distance: Real,
    across: Real,
    *,
    rtol: float,
    signs: tuple[int, ...] = (1, -1),
) -> Part:
    """Return D U / W^2 of a load at points, equations (40) to (43).

    Parameters
    ----------
    k : ndarray of complex128, shape (n_frequencies,)
        Bending wavenumber times the width, not small.
    hold : ndarray of complex128, shape (n_frequencies,)
        1 / (kappa W).
    source : Source
        The load.
    distance, across : ndarray of float64, shape (n_points,)
        |x| from the load's centre and Y of each point.
    rtol : float
        Wanted relative error.
    signs : tuple of int
        Symmetries to compute.

    Returns
    -------
    Part

    Examples
    --------
    A point force and a point of the strip may be exchanged:

    >>> from stimuli.transverse import Span
    >>> def at(y0, y):
    ...     source = Source(span=Span(low=y0, high=y0))
    ...     place = np.array([0.4]), np.array([y])
    ...     return solved(np.array([2 + 0j]), np.array([0j]), source, *place, rtol=1e-10).value
    >>> bool(abs(at(0.1, -0.3) / at(-0.3, 0.1) - 1) < 1e-10)
    True
    """
    value = np.zeros((k.size, distance.size), dtype=np.complex128)
    error = np.zeros(value.shape)
    for sign in signs:
        part = _one_symmetry(k, hold, source, distance, across, rtol, sign)
        value, error = value + part.value, error + part.error
    if source.radius:
        apart = _clipped(source, np.hypot(distance, across - source.span.low))
        excess = inside_excess(k, source.radius, apart, moment=source.moment)
        value, error = value + excess, error + 8 * _EPS * np.abs(excess)
    return Part(value=value, error=error)


def _one_symmetry(
    k: Complex, hold: Complex, source: Source, distance: Real, across: Real, rtol: float, sign: int
) -> Part:
    n_modes = int(np.max(k.real) / (2 * np.pi)) + 6
    modes = guided(k, hold, n_modes, sign)
    finest = min(x for x in (2 * source.half_length, source.span.length, source.radius, 1.0) if x)
    nearest = max(float(np.min(distance)) - source.half_length, 0.0)
    path = contour(modes.p, rtol, finest, 0.0 if source.radius else nearest)
    waves = _waves(modes, path.n_below, k, hold, source, distance, across, sign)
    rest = _integral(path, k, hold, source, distance, across, sign)
    return Part(value=waves.value + rest.value, error=waves.error + rest.error)


def _waves(
    modes: Guided,
    n_below: NDArray[np.int_],
    k: Complex,
    hold: Complex,
    source: Source,
    distance: Real,
    across: Real,
    sign: int,
) -> Part:
    """Return the guided waves below the path, equation (40)."""
    most = int(np.max(n_below))
    p = modes.p[:, :most]
    used = np.arange(most) < n_below[:, np.newaxis]
    weight = 1j * modes.excited(k[:, np.newaxis], source)[:, :most] / modes.norms()[:, :most]
    weight = np.where(used, weight, 0.0)[..., np.newaxis]
    along = source.along(p[..., np.newaxis], distance)
    terms = weight * modes.shapes(across)[:, :most] * along
    size = 1 + np.abs(p[..., np.newaxis]) * distance
    error = 4 * _EPS * (np.abs(terms) * size).sum(axis=1)
    return Part(value=terms.sum(axis=1), error=error)


def _integral(
    path: Contour,
    k: Complex,
    hold: Complex,
    source: Source,
    distance: Real,
    across: Real,
    sign: int,
) -> Part:
    """Return the integral along the path, equation (41)."""
    s = path.s[..., np.newaxis]
    k3, hold3 = k[:, np.newaxis, np.newaxis], hold[:, np.newaxis, np.newaxis]
    kernel = transformed(s, k3, hold3, source, across, sign)
    logarithm = np.zeros((k.size, distance.size), dtype=np.complex128)
    if source.radius:
        kernel, logarithm = _without_logarithm(kernel, path, k, source, distance, across, sign)
    terms = kernel * source.along(s, distance) * path.weight[..., np.newaxis]
    fine, coarse = terms.sum(axis=1), 2 * terms[:, 1::2].sum(axis=1)
    size = np.abs(terms).sum(axis=1)
    step_error = np.abs(fine - coarse) ** 2 / np.maximum(size, 1e-300)
    error = step_error + 4 * _EPS * size * (1 + 1 / np.abs(k[:, np.newaxis]) ** 2)
    return Part(value=fine + logarithm, error=error + 4 * _EPS * np.abs(logarithm))


def _without_logarithm(
    kernel: Complex,
    path: Contour,
    k: Complex,
    source: Source,
    distance: Real,
    across: Real,
    sign: int,
) -> tuple[Complex, Complex]:
    """Take the logarithm at a disc's centre out of the kernel, equation (42)."""
    from scipy.special import kv

    one, two = source.branch_weights(k)
    strength = ((one - two) / (4 * k * k))[:, np.newaxis]
    m = path.ceiling[:, np.newaxis]
    root = np.sqrt(path.s**2 + m * m)[..., np.newaxis]
    logarithm = np.zeros((k.size, distance.size), dtype=np.complex128)
    for part, apart in ((1, across - source.span.low), (sign, across + source.span.low)):
        spread = np.exp(-root * np.abs(apart)) / (2 * root)
        kernel = kernel - part * strength[..., np.newaxis] * spread
        r = _clipped(source, np.hypot(distance, apart))
        logarithm += part * strength * kv(0, m * r) / (2 * np.pi)
    return kernel, logarithm


def _clipped(source: Source, apart: Real) -> Real:
    return np.maximum(apart, _LEAST_DISTANCE * source.radius)
