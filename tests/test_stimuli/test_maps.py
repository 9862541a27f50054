"""Maps: the field point by point, the plate's symmetries and scaling, and what is refused."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    IdealEdge,
    Load,
    MomentDisc,
    MomentRectangle,
    PointForce,
    Scene,
    Strip,
    displacement,
    displacement_map,
)

W = 0.025
PLATE = Strip(width_m=W, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
STIFFNESS_N = 141.72083994908
EDGES: list[IdealEdge | ElasticEdge] = [
    SIMPLY_SUPPORTED,
    ElasticEdge(stiffness_n=STIFFNESS_N),
    CLAMPED,
]
LEFT, RIGHT = (MomentDisc(x_m=x, y_m=W / 2, radius_m=0.0064) for x in (-0.035, 0.035))
PATCH = MomentRectangle(x_m=0.01, y_m=0.009, length_x_m=0.006, length_y_m=0.012)
ALONG, ACROSS = 0.005 * np.arange(-20, 21), np.linspace(0.0, W, 11)

edges = pytest.mark.parametrize("edge", EDGES, ids=["supported", "elastic", "clamped"])


def on(edge: IdealEdge | ElasticEdge) -> Strip:
    return dataclasses.replace(PLATE, edge=edge)


@pytest.mark.slow
@edges
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 7000.0])
def test_a_map_is_the_displacement_point_by_point(
    edge: IdealEdge | ElasticEdge, frequency_hz: float
) -> None:
    loads: tuple[Load, ...] = (LEFT, PATCH, PointForce(x_m=0.0, y_m=0.004))
    x_m, y_m = ALONG[::8], ACROSS[1:-1:3]
    found = displacement_map(on(edge), loads, frequency_hz, x_m=x_m, y_m=y_m, rtol=1e-9)
    assert found.displacement_m.shape == (len(loads), x_m.size, y_m.size)
    for i, x in enumerate(x_m):
        for j, y in enumerate(y_m):
            scene = Scene(strip=on(edge), loads=loads, points_m=((float(x), float(y)),))
            alone = displacement(scene, [frequency_hz], rtol=1e-9)[0, :, 0]
            largest = np.max(np.abs(found.displacement_m), axis=(1, 2))
            assert found.displacement_m[:, i, j] == pytest.approx(
                alone, rel=1e-8, abs=1e-11 * float(largest.max())
            )


@edges
def test_the_held_edges_rest_exactly(edge: IdealEdge | ElasticEdge) -> None:
    found = displacement_map(on(edge), (LEFT, PATCH), 500.0, x_m=ALONG, y_m=ACROSS)
    assert not found.displacement_m[:, :, [0, -1]].any()
    assert np.all(found.displacement_m[:, :, 1:-1] != 0)


@edges
def test_a_map_is_mirrored_about_its_load_and_about_the_centre_line(
    edge: IdealEdge | ElasticEdge,
) -> None:
    found = displacement_map(on(edge), (LEFT, RIGHT), 5000.0, x_m=ALONG, y_m=ACROSS)
    left, right = found.displacement_m
    assert np.array_equal(left, right[::-1])
    assert np.array_equal(left, left[:, ::-1])


@edges
def test_a_load_off_the_centre_line_and_its_mirror_image_have_mirrored_maps(
    edge: IdealEdge | ElasticEdge,
) -> None:
    turned = dataclasses.replace(PATCH, y_m=W - PATCH.y_m)
    found = displacement_map(on(edge), (PATCH, turned), 500.0, x_m=ALONG, y_m=ACROSS)
    one, two = found.displacement_m
    assert np.array_equal(one, two[:, ::-1])


@settings(deadline=None, max_examples=10)
@given(
    larger=st.floats(0.2, 5.0),
    thicker=st.floats(0.3, 3.0),
    stiffer=st.floats(0.1, 10.0),
    edge=st.sampled_from(EDGES),
)
def test_a_map_in_widths_depends_on_k_times_the_width_only(
    larger: float, thicker: float, stiffer: float, edge: IdealEdge | ElasticEdge
) -> None:
    """k^4 = rho h omega^2 / D, so that omega goes with h sqrt(E) / W^2; U D / W^2 is the same."""
    if isinstance(edge, ElasticEdge):
        edge = ElasticEdge(stiffness_n=STIFFNESS_N * stiffer * thicker**3 / larger)
    modulus_pa = ALUMINIUM.youngs_modulus_pa * stiffer
    scaled = Strip(
        width_m=W * larger,
        thickness_m=PLATE.thickness_m * thicker,
        material=dataclasses.replace(ALUMINIUM, youngs_modulus_pa=modulus_pa),
        edge=edge,
    )
    first = on(ElasticEdge(stiffness_n=STIFFNESS_N) if isinstance(edge, ElasticEdge) else edge)
    disc = MomentDisc(x_m=0.0, y_m=W / 2, radius_m=0.0064)
    wide = MomentDisc(x_m=0.0, y_m=W / 2 * larger, radius_m=0.0064 * larger)
    x_m, y_m = ALONG[15:26], ACROSS[2:9]
    one = displacement_map(first, disc, 1200.0, x_m=x_m, y_m=y_m, rtol=1e-9)
    two = displacement_map(
        scaled,
        wide,
        1200.0 * thicker * math.sqrt(stiffer) / larger**2,
        x_m=x_m * larger,
        y_m=y_m * larger,
        rtol=1e-9,
    )
    factor = scaled.bending_stiffness_n_m / first.bending_stiffness_n_m / larger**2
    largest = float(np.abs(one.displacement_m).max())
    assert np.abs(two.displacement_m * factor - one.displacement_m).max() < 1e-8 * largest


def test_only_places_that_differ_are_solved() -> None:
    grid = tuple((float(x), float(y)) for x in ALONG for y in ACROSS)
    work = Scene(strip=PLATE, loads=(LEFT, RIGHT), points_m=grid).work([500.0], rtol=1e-4)
    assert work.pairs_asked == 2 * ALONG.size * ACROSS.size
    assert work.pairs_solved < work.pairs_asked / 4
