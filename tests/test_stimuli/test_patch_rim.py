"""Discs bonded to a plate, against triangles whose mesh follows their rims."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import BondedPatch, ElasticEdge, Layer, MomentDisc, Scene, Strip
from stimuli.motion.motion import steady
from stimuli.motion.patches.patched import patched_modes
from stimuli.strip.patch import laminate, layer_of
from tests.test_stimuli.plates import FIRM, W, on

if TYPE_CHECKING:
    from stimuli.arrays import Real

LAYERS = (
    Layer(thickness_m=0.1e-3, youngs_modulus_pa=105e9, poisson_ratio=0.35, density_kg_m3=8530.0),
    Layer(thickness_m=0.11e-3, youngs_modulus_pa=63e9, poisson_ratio=0.31, density_kg_m3=7800.0),
)


def plate_with(x_m: float, y_m: float, radius_m: float) -> Strip:
    disc = BondedPatch(
        x_m=x_m, y_m=y_m, length_x_m=2 * radius_m, length_y_m=2 * radius_m, layers=LAYERS,
        is_disc=True,
    )  # fmt: skip
    return dataclasses.replace(on(FIRM, 0.1), patches=(disc,))


def mesh(strip: Strip, size_m: float) -> Any:
    """Triangles on rings about the disc, whose polygon has its area, and on a grid elsewhere."""
    import skfem
    from scipy.spatial import Delaunay

    (disc,), end_m = strip.patches, (strip.length_m or 0.0) / 2
    radius_m = disc.half_size_m[0]
    rings = round(radius_m / size_m)
    centre = np.array([disc.x_m, disc.y_m])
    points = [centre[np.newaxis]]
    for ring in range(1, rings + 2):
        sides = max(6, round(2 * math.pi * ring))
        swell = math.sqrt(2 * math.pi / sides / math.sin(2 * math.pi / sides))
        reach_m = radius_m * ring / rings * (swell if ring == rings else 1.0)
        angle = 2 * math.pi * (np.arange(sides) + 0.5 * (ring % 2)) / sides
        points.append(centre + reach_m * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    lines = [
        np.linspace(low, high, round((high - low) / size_m) + 1)
        for low, high in ((-end_m, end_m), (0.0, W))
    ]
    grid = np.stack([one.ravel() for one in np.meshgrid(*lines, indexing="ij")], axis=1)
    away = np.hypot(*(grid - centre).T) > radius_m * (1 + 1.6 / rings)
    every = np.concatenate([*points, grid[away]])
    return skfem.MeshTri(every.T.copy(), Delaunay(every).simplices.T.copy())


def by_elements(strip: Strip, size_m: float) -> tuple[float, Real]:
    """Return the displacement of the disc's centre at rest and the lowest frequencies."""
    import skfem
    from scipy.sparse.linalg import LinearOperator, eigsh, splu
    from skfem.helpers import dd, ddot, trace

    triangles = mesh(strip, size_m)
    basis = skfem.Basis(triangles, skfem.ElementTriMorley(), intorder=4)
    (disc,), plate = strip.patches, layer_of(strip.material, strip.thickness_m)
    middle = triangles.p[:, triangles.t].mean(axis=1)
    inside = np.hypot(middle[0] - disc.x_m, middle[1] - disc.y_m) < disc.half_size_m[0]
    flat = skfem.Basis(triangles, skfem.ElementTriP0(), intorder=4)
    both, bare = laminate([plate, *disc.layers]), laminate([plate])
    given = {
        name: flat.interpolate(np.where(inside, getattr(both, name), getattr(bare, name)))
        for name in ("biaxial_n_m", "opposed_n_m", "mass_kg_m2")
    }
    bilinear: Any = skfem.BilinearForm

    def bends(u: Any, v: Any, w: Any) -> Any:
        mixed = (w["biaxial_n_m"] - w["opposed_n_m"]) / 2
        return w["opposed_n_m"] * ddot(dd(u), dd(v)) + mixed * trace(dd(u)) * trace(dd(v))

    def moves(u: Any, v: Any, w: Any) -> Any:
        return w["mass_kg_m2"] * u * v

    def turns(u: Any, v: Any, _: Any) -> Any:
        return u.grad[1] * v.grad[1]

    linear: Any = skfem.LinearForm
    load = linear(lambda v, w: w["on"] * trace(dd(v))).assemble(
        basis, on=flat.interpolate(inside.astype(float))
    )
    held = triangles.facets_satisfying(lambda x: np.minimum(x[1], W - x[1]) < 1e-9)
    assert isinstance(strip.edge, ElasticEdge)
    springs = strip.edge.stiffness_n * bilinear(turns).assemble(basis.boundary(held))
    free = basis.complement_dofs(basis.get_dofs(held).all(["u"]))
    stiffness = (bilinear(bends).assemble(basis, **given) + springs)[free][:, free].tocsc()
    mass = bilinear(moves).assemble(basis, **given)[free][:, free].tocsc()
    factored = splu(stiffness)
    moved = np.zeros(basis.N)
    moved[free] = factored.solve(load[free])
    inverse = LinearOperator(stiffness.shape, matvec=factored.solve, dtype=np.float64)
    squares = eigsh(stiffness, 4, mass, sigma=0, OPinv=inverse, return_eigenvectors=False)
    return float(moved[basis.nodal_dofs[0, 0]]), np.sqrt(np.sort(squares)) / (2 * math.pi)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("x_m", "y_m", "radius_m"), [(0.012, W / 2, 0.0064), (-0.02, 0.010, 0.0045)]
)
def test_discs_are_as_in_triangles_that_follow_their_rim(
    x_m: float, y_m: float, radius_m: float
) -> None:
    """Morley's triangles converge as the square of their size; two sizes tell the limit."""
    strip = plate_with(x_m, y_m, radius_m)
    (coarse_m, coarse_hz), (fine_m, fine_hz) = (by_elements(strip, h) for h in (1e-3, 0.5e-3))
    groups = patched_modes(strip, 30e3, centred=False)
    squared = np.sort(np.concatenate([group.squared for group in groups]))[:4]
    found_hz = np.sqrt(squared) / (2 * math.pi)
    assert found_hz == pytest.approx(fine_hz + (fine_hz - coarse_hz) / 3, rel=3e-4)
    load = MomentDisc(x_m=x_m, y_m=y_m, radius_m=radius_m)
    scene = Scene(strip=strip, loads=(load,), points_m=((x_m, y_m),))
    at_rest_m = abs(steady(scene, 1.0)[0, 0])
    assert at_rest_m == pytest.approx(abs(fine_m + (fine_m - coarse_m) / 3), rel=3e-3)


@pytest.mark.slow
def test_a_disc_that_nearly_touches_an_edge_does_what_one_that_touches_it_does() -> None:
    """It must not turn freely at its rim, where it is neither held nor at the edge."""
    found = []
    for gap in (0.0, 2e-5, 2e-3, 0.01):
        radius_m = 0.3 * W
        strip = plate_with(0.0, radius_m + gap * W, radius_m)
        (disc,) = strip.patches
        load = MomentDisc(x_m=0.0, y_m=disc.y_m, radius_m=radius_m)
        scene = Scene(strip=strip, loads=(load,), points_m=((0.0, disc.y_m),))
        found.append(float(abs(steady(scene, 300.0)[0, 0])))
    assert found == pytest.approx([found[0]] * 4, rel=0.05)
    assert found[0] != pytest.approx(found[3], rel=1e-3)
