"""The finite plate in scikit-fem: Bogner-Fox-Schmit rectangles, four unknowns per node.

It shares with the product the values that state a problem, and no equation.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from stimuli import CLAMPED, BondedPatch, ElasticEdge, MomentRectangle, Strip

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from stimuli.arrays import Complex, Real


MODES: Final = (40, 120)
_SYMMETRIC: Final[dict[str, Any]] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}
"""How SuperLU factors a symmetric matrix: up to eight times faster than by default."""

_ON_AN_EDGE: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """Matrices of the free unknowns, in SI units.

    Attributes
    ----------
    stiffness, mass : sparse array, shape (n, n)
        Without loss; the loss multiplies the stiffness.
    load : ndarray of float64, shape (n,)
        Virtual work of the unit load.
    points : sparse array, shape (n_points, n)
        What takes unknowns to displacements at points.
    loss_factor : float
        Constant loss factor.
    """

    stiffness: Any
    mass: Any
    load: Real
    points: Any
    loss_factor: float

    @property
    def unknowns(self) -> int:
        """How many unknowns there are."""
        return int(self.load.size)


def model(
    strip: Strip, load: MomentRectangle, points_m: Sequence[tuple[float, float]], size_m: float
) -> Model:
    """Return the model of a finite strip on a grid whose lines run along all patches.

    The short ends are free: nothing is demanded there, and the natural conditions hold with
    Poisson's ratio in the bilinear form. Patches of the strip are rectangles.
    """
    import skfem
    from skfem.helpers import dd, ddot, trace

    bilinear: Callable[[Any], Any] = skfem.BilinearForm
    linear: Callable[[Any], Any] = skfem.LinearForm
    width = strip.width_m
    half_x, half_y = load.half_size_m
    end = (strip.length_m or 0.0) / 2
    x_m, y_m = {-end, end}, {0.0, width}
    grid: list[MomentRectangle | BondedPatch] = [load, *strip.patches]
    for one in grid:
        x_m |= {one.x_m - one.half_size_m[0], one.x_m + one.half_size_m[0]}
        y_m |= {one.y_m - one.half_size_m[1], one.y_m + one.half_size_m[1]}
    mesh = skfem.MeshQuad.init_tensor(_lines(sorted(x_m), size_m), _lines(sorted(y_m), size_m))
    basis = skfem.Basis(mesh, skfem.ElementQuadBFS(), intorder=6)

    bare, covered = _laminate(strip), [_laminate(strip, patch) for patch in strip.patches]

    def properties(w: Any) -> Any:
        """Return what the plate, or where a patch is the laminate, has at some places."""
        (x, y), values = w.x, [np.full_like(w.x[0], value) for value in bare]
        for patch, laminate in zip(strip.patches, covered, strict=True):
            reach_x, reach_y = patch.half_size_m
            inside = (abs(x - patch.x_m) < reach_x) & (abs(y - patch.y_m) < reach_y)
            values = [np.where(inside, new, old) for new, old in zip(laminate, values, strict=True)]
        return values

    @bilinear
    def bending(u: Any, v: Any, w: Any) -> Any:
        (d11, d12, _), curvature, virtual = properties(w), dd(u), dd(v)
        return (d11 - d12) * ddot(curvature, virtual) + d12 * trace(curvature) * trace(virtual)

    @bilinear
    def product(u: Any, v: Any, w: Any) -> Any:
        return properties(w)[2] * u * v

    @bilinear
    def spring(u: Any, v: Any, _: Any) -> Any:
        return u.grad[1] * v.grad[1]

    @linear
    def patch(v: Any, w: Any) -> Any:
        on_patch = (abs(w.x[0] - load.x_m) < half_x) & (abs(w.x[1] - load.y_m) < half_y)
        return on_patch * trace(dd(v))

    edges = basis.get_dofs(lambda x: (x[1] < _ON_AN_EDGE) | (x[1] > width - _ON_AN_EDGE))
    supported = strip.edge is not CLAMPED
    free = basis.complement_dofs(edges.all(["u", "u_x"]) if supported else edges.all())
    stiffness = bending.assemble(basis)
    if isinstance(strip.edge, ElasticEdge):
        held = mesh.facets_satisfying(lambda x: np.minimum(x[1], width - x[1]) < _ON_AN_EDGE)
        stiffness += strip.edge.stiffness_n * spring.assemble(basis.boundary(held))
    return Model(
        stiffness=stiffness[free][:, free].tocsc(),
        mass=product.assemble(basis)[free][:, free].tocsc(),
        load=patch.assemble(basis)[free],
        points=basis.probes(np.array(points_m).T).tocsr()[:, free],
        loss_factor=strip.material.loss_factor,
    )


def _laminate(strip: Strip, patch: BondedPatch | None = None) -> tuple[float, float, float]:
    """Return D11, D12 and the mass per area of the plate with a patch, by classical lamination.

    With the stiffnesses A, B and D per unit width about the plate's lower face, curvature without
    a force in the plane meets D - B A^-1 B.
    """
    layers: list[Any] = [strip.material, *(patch.layers if patch else ())]
    thicknesses_m = [strip.thickness_m, *(layer.thickness_m for layer in layers[1:])]
    faces_m = np.cumsum([0.0, *thicknesses_m])
    stretch, couple, bend = np.zeros((3, 2, 2))
    for layer, low_m, high_m in zip(layers, faces_m, faces_m[1:], strict=False):
        nu = layer.poisson_ratio
        plane = layer.youngs_modulus_pa / (1 - nu**2) * np.array([[1, nu], [nu, 1]])
        stretch += plane * (high_m - low_m)
        couple += plane * (high_m**2 - low_m**2) / 2
        bend += plane * (high_m**3 - low_m**3) / 3
    relaxed = bend - couple @ np.linalg.solve(stretch, couple)
    mass = sum(layer.density_kg_m3 * h for layer, h in zip(layers, thicknesses_m, strict=True))
    return float(relaxed[0, 0]), float(relaxed[0, 1]), float(mass)


def _lines(breaks_m: Sequence[float], size_m: float) -> Real:
    """Return grid lines through all breaks, none farther apart than a size."""
    parts = [
        np.linspace(low, high, max(1, int(np.ceil((high - low) / size_m - 1e-9))) + 1)
        for low, high in itertools.pairwise(breaks_m)
    ]
    return np.unique(np.concatenate(parts).round(12))


def direct(plate: Model, frequencies_hz: Real) -> Complex:
    """Return the displacement per unit load, (n_frequencies, n_points): one system for each."""
    from scipy.sparse.linalg import splu

    found = []
    for omega in 2 * np.pi * frequencies_hz:
        whole = plate.stiffness * (1 - 1j * plate.loss_factor) - omega**2 * plate.mass
        found.append(plate.points @ splu(whole.tocsc(), **_SYMMETRIC).solve(plate.load + 0j))
    return np.array(found)


def modal(n_modes: int, plate: Model, frequencies_hz: Real) -> Complex:
    """Return the same from the lowest modes and what the others do at rest."""
    squares, seen, others = _modes(n_modes, plate)
    lossy = 1 - 1j * plate.loss_factor
    omega2 = (2 * np.pi * frequencies_hz) ** 2
    value: Complex = (1 / (squares * lossy - omega2[:, np.newaxis])) @ seen.T + others / lossy
    return value


def _modes(n_modes: int, plate: Model) -> tuple[Real, Real, Real]:
    """Return the lowest modes' squares, what each moves of the points, and the others at rest."""
    from scipy.sparse.linalg import LinearOperator, eigsh, splu

    at_rest = splu(plate.stiffness, **_SYMMETRIC)
    inverse = LinearOperator(plate.stiffness.shape, matvec=at_rest.solve, dtype=np.float64)
    start = np.ones(plate.unknowns)
    squares, shapes = eigsh(
        plate.stiffness, n_modes, plate.mass, sigma=0, OPinv=inverse, v0=start, tol=1e-9
    )
    driven = shapes.T @ plate.load
    seen = (plate.points @ shapes) * driven
    return squares, seen, plate.points @ at_rest.solve(plate.load) - (seen / squares).sum(axis=1)


def newmark(plate: Model, samples: Real, step_s: float, viscous_s: float) -> Real:
    """Return the displacement over time under a drive, (n_points, n_samples), by Newmark's method.

    Its constant mean acceleration adds no loss; the plate's is viscous.
    """
    from scipy.sparse.linalg import splu

    damping = viscous_s * plate.stiffness
    whole = plate.mass + step_s / 2 * damping + step_s**2 / 4 * plate.stiffness
    solved = splu(whole.tocsc(), **_SYMMETRIC)
    place_m, speed, push = (np.zeros(plate.unknowns) for _ in range(3))
    found = np.zeros((plate.points.shape[0], samples.size))
    for n in range(1, samples.size):
        ahead = place_m + step_s * speed + step_s**2 / 4 * push
        halfway = speed + step_s / 2 * push
        forces = samples[n] * plate.load - plate.stiffness @ ahead - damping @ halfway
        push = solved.solve(forces)
        place_m, speed = ahead + step_s**2 / 4 * push, halfway + step_s / 2 * push
        found[:, n] = plate.points @ place_m
    return found


def in_modes(n_modes: int, plate: Model, samples: Real, step_s: float, viscous_s: float) -> Real:
    """Return the same by the lowest modes, each exactly, and what the others do at rest."""
    from scipy.signal import cont2discrete, lfilter

    squares, driven_points, others = _modes(n_modes, plate)
    swings = []
    for square in squares:
        # Between samples the drive is a straight line.
        system = np.ones(1), np.array([1.0, viscous_s * square, square])
        numerator, denominator, _ = cont2discrete(system, step_s, method="foh")
        swings.append(lfilter(numerator.ravel(), denominator, samples))
    return np.asarray(
        driven_points @ np.array(swings, dtype=np.float64) + np.outer(others, samples)
    )
