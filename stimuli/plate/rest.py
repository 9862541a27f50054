"""The local field of a load, at rest and by the plate's inertia, in addition to the modes.

Far below its resonances a mode follows a load with 1 / w_m^2 + w^2 / w_m^4. The sums of both over
all modes are the displacement u_0 at rest and w^2 u_1, where u_1 is the displacement at rest under
the inertia of u_0. Both are solved for each load by itself, in functions that may bend sharply
where it begins and ends, and only around it: they decay at least as exp(-pi x / W). What is left to
the modes then falls as 1 / w_m^6, so that few of them are needed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import scipy.linalg

from stimuli.plate.area import local_field
from stimuli.plate.modes import Resolution, plate_bases
from stimuli.plate.waveguide import has_lossless_springs

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.load import Load
    from stimuli.plate.modes import Basis
    from stimuli.plate.strip import Strip

_REACH: Final = 7.0
"""Widths of the plate that are solved on each side of a load: 3e-10 of its field lies beyond."""


@dataclass(frozen=True, eq=False)
class RestField:
    """Displacement at rest under a unit load and under its inertia, equation (37).

    Attributes
    ----------
    strip : Strip
        The section around the load, with the load at its place in it.
    load : Load
    factors : ndarray, shape (n_factors,)
        Complex stiffness over that without loss.
    bases : tuple of Basis
    amplitudes : tuple of ndarray, each of shape (2, 2, n_factors, n_functions)
        Coarse and fine; at rest and by inertia.
    """

    strip: Strip
    load: Load
    factors: Complex
    bases: tuple[Basis, ...]
    amplitudes: tuple[Complex, ...]

    def displacement(self, points_m: Real) -> Complex:
        """Return u_0 and u_1 at points of the section: (2, 2, n_factors, n_points)."""
        field = np.zeros((2, 2, self.factors.size, len(points_m)), dtype=np.complex128)
        half_length_m = float(self.strip.length_m or 0.0) / 2
        is_near = np.abs(points_m[:, 0]) <= half_length_m
        near_m = points_m[is_near]
        for basis, amplitudes in zip(self.bases, self.amplitudes, strict=True):
            x, y = (values[0] for values in basis.by_axis(near_m, ((0, 0),)))
            # Many points, few fields: one axis after the other, not all products at all points.
            by_axis = amplitudes.reshape(*field.shape[:3], x.shape[1], y.shape[1]) @ y.T
            field[..., is_near] += np.einsum("rofap,pa->rofp", by_axis, x)
        rigidity = self.strip.bending_stiffness_n_m * self.factors[:, np.newaxis]
        field[:, 0][..., is_near] += local_field(self.load, near_m) / rigidity
        return field


def _section(strip: Strip, load: Load) -> tuple[Strip, Load, float]:
    """Return the section around a load, the load in it, and where its middle is on the plate."""
    half_length_m, reach_m = float(strip.length_m or np.inf) / 2, _REACH * strip.width_m
    low_m, high_m = max(-half_length_m, load.x_m - reach_m), min(half_length_m, load.x_m + reach_m)
    is_cut = low_m > -half_length_m and high_m < half_length_m
    middle_m = load.x_m if is_cut else (low_m + high_m) / 2
    section = replace(strip, length_m=2 * reach_m if is_cut else high_m - low_m)
    return section, replace(load, x_m=load.x_m - middle_m), middle_m


def rest_field(
    section: Strip, load: Load, max_hz: float, factors: Complex, resolution: Resolution
) -> RestField:
    """Return the fields of a load on a section of a plate without patches."""
    bases = plate_bases(section, max_hz, resolution, [load], [load])
    amplitudes = tuple(_amplitudes(basis, load, factors) for basis in bases)
    return RestField(section, load, factors, tuple(bases), amplitudes)


def _amplitudes(basis: Basis, load: Load, factors: Complex) -> Complex:
    stiffness, slopes = basis.matrices[0], basis.edge_slopes
    work, local = basis.remaining_work(load)
    rigidity = basis.strip.bending_stiffness_n_m
    results = np.zeros((2, 2, factors.size, work.size), dtype=np.complex128)
    coarse_first = np.argsort(~basis.is_coarse, kind="stable")
    reorder = np.ix_(coarse_first, coarse_first)
    work, local = work[coarse_first], local[coarse_first]
    for number, factor in enumerate(factors):
        # Without loss all is real, which takes a quarter of the time.
        lossy = stiffness
        if factor.imag:
            lossy = factor * stiffness + (1 - factor) * (slopes.T @ slopes)
        sizes = int(np.count_nonzero(basis.is_coarse)), work.size
        for result, n, solve in zip(results, sizes, _solvers(lossy[reorder], sizes), strict=True):
            at_rest = solve(work[:n])
            inertia = basis.areal_kg_m2 * (at_rest + local[:n] / (rigidity * factor))
            inertia = inertia if factor.imag else inertia.real
            result[0, number, coarse_first[:n]] = at_rest
            result[1, number, coarse_first[:n]] = solve(inertia)
    return results


def _solvers(
    matrix: NDArray[Any], sizes: tuple[int, ...]
) -> Iterator[Callable[[NDArray[Any]], NDArray[Any]]]:
    """Yield what solves for work on the first functions alone, for so many of them."""
    if np.iscomplexobj(matrix):
        for n in sizes:
            yield partial(scipy.linalg.lu_solve, scipy.linalg.lu_factor(matrix[:n, :n]))
        return
    # The first rows and columns of the factor are the factor of those of the matrix.
    root, _ = scipy.linalg.cho_factor(matrix, lower=True, check_finite=False)
    for n in sizes:
        yield partial(scipy.linalg.cho_solve, (root[:n, :n], True), check_finite=False)


def rest_displacement(
    strip: Strip,
    loads: Sequence[Load],
    points_m: Real,
    factors: Complex,
    *,
    max_hz: float,
    resolution: Resolution,
) -> Complex:
    """Return u_0 and u_1 of each load: (2, 2, n_factors, n_loads, n_points), coarse and fine.

    Loads that differ only in where they are along the strip, away from its ends, share a solution,
    and so do mirror images.
    """
    if has_lossless_springs(strip) and np.any(factors.imag):
        nodes = np.unique(factors[np.linspace(0, factors.size - 1, 3).round().astype(int)])
        interpolation = _lagrange(nodes, factors)
    else:
        nodes = np.ones(1, dtype=np.complex128)
        interpolation = np.stack([1 / factors, 1 / factors**2])[:, np.newaxis]
    solved: dict[tuple[Strip, Load], RestField] = {}
    fields = []
    for load in loads:
        section, local_load, middle_m = _section(strip, load)
        side = -1.0 if local_load.x_m > 0 else 1.0
        image = replace(local_load, x_m=side * local_load.x_m)
        field = solved.get((section, image))
        if field is None:
            field = rest_field(section, image, max_hz, nodes, resolution)
            solved[section, image] = field
        fields.append(field.displacement((points_m - (middle_m, 0.0)) * (side, 1.0)))
    return np.asarray(np.einsum("rolnp,onf->roflp", np.stack(fields, axis=2), interpolation))


def _lagrange(nodes: Complex, factors: Complex) -> Complex:
    """Return the weights of a polynomial through nodes: (2, n_nodes, n_factors), twice the same."""
    weights = [
        np.prod([(factors - other) / (node - other) for other in nodes if other != node], axis=0)
        * np.ones_like(factors)
        for node in nodes
    ]
    return np.stack([weights, weights])
