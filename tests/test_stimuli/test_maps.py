"""Maps: the field point by point, the plate's symmetries and its scaling."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stimuli import ALUMINIUM, ElasticEdge, Strip, displacement, displacement_map
from tests.test_stimuli.plates import (
    EDGES,
    FIRM,
    PLATE,
    Edge,
    W,
    disc,
    each_edge,
    force,
    on,
    patch,
    scene_of,
)

LEFT, RIGHT = disc(x_m=-0.035), disc(x_m=0.035)
PATCH = patch(0.006, 0.012, x_m=0.01, y_m=0.009)
ALONG, ACROSS = 0.005 * np.arange(-20, 21), np.linspace(0.0, W, 11)


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize("frequency_hz", [0.0, 500.0, 7000.0])
def test_a_map_is_the_displacement_point_by_point(edge: Edge, frequency_hz: float) -> None:
    loads, x_m, y_m = (LEFT, PATCH, force(0.0, 0.004)), ALONG[::8], ACROSS[1:-1:3]
    found = displacement_map(on(edge), loads, frequency_hz, x_m=x_m, y_m=y_m, rtol=1e-9)
    assert found.displacement_m.shape == (len(loads), x_m.size, y_m.size)
    largest = float(np.max(np.abs(found.displacement_m)))
    for i, x in enumerate(x_m):
        for j, y in enumerate(y_m):
            scene = scene_of(on(edge), loads, (float(x), float(y)))
            alone = displacement(scene, [frequency_hz], rtol=1e-9)[0, :, 0]
            np.testing.assert_allclose(
                found.displacement_m[:, i, j], alone, rtol=1e-8, atol=1e-11 * largest
            )


@each_edge
def test_the_held_edges_rest_exactly(edge: Edge) -> None:
    found = displacement_map(on(edge), (LEFT, PATCH), 500.0, x_m=ALONG, y_m=ACROSS)
    assert not found.displacement_m[:, :, [0, -1]].any()
    assert np.all(found.displacement_m[:, :, 1:-1] != 0)


@each_edge
def test_maps_are_mirrored_about_their_load_and_about_the_centre_line(edge: Edge) -> None:
    loads = (LEFT, RIGHT, PATCH, dataclasses.replace(PATCH, y_m=W - PATCH.y_m))
    found = displacement_map(on(edge), loads, 5000.0, x_m=ALONG, y_m=ACROSS)
    left, right, one, turned = found.displacement_m
    assert np.array_equal(left, right[::-1])
    assert np.array_equal(left, left[:, ::-1])
    assert np.array_equal(one, turned[:, ::-1])


@settings(deadline=None, max_examples=10)
@given(
    larger=st.floats(0.2, 5.0),
    thicker=st.floats(0.3, 3.0),
    stiffer=st.floats(0.1, 10.0),
    edge=st.sampled_from(EDGES),
)
def test_a_map_in_widths_depends_on_k_times_the_width_only(
    larger: float, thicker: float, stiffer: float, edge: Edge
) -> None:
    """k^4 = rho h omega^2 / D, so that omega goes with h sqrt(E) / W^2; U D / W^2 is the same."""
    first = on(edge)
    if isinstance(edge, ElasticEdge):
        edge = ElasticEdge(stiffness_n=FIRM.stiffness_n * stiffer * thicker**3 / larger)
    modulus_pa = ALUMINIUM.youngs_modulus_pa * stiffer
    scaled = Strip(
        width_m=W * larger,
        thickness_m=PLATE.thickness_m * thicker,
        material=dataclasses.replace(ALUMINIUM, youngs_modulus_pa=modulus_pa),
        edge=edge,
    )
    wide = disc(0.0064 * larger, y_m=W / 2 * larger)
    x_m, y_m = ALONG[15:26], ACROSS[2:9]
    one = displacement_map(first, disc(), 1200.0, x_m=x_m, y_m=y_m, rtol=1e-9).displacement_m
    same_hz = 1200.0 * thicker * math.sqrt(stiffer) / larger**2
    places_m = {"x_m": x_m * larger, "y_m": y_m * larger}
    two = displacement_map(scaled, wide, same_hz, **places_m, rtol=1e-9).displacement_m
    factor = scaled.bending_stiffness_n_m / first.bending_stiffness_n_m / larger**2
    assert np.abs(two * factor - one).max() < 1e-8 * np.abs(one).max()


def test_only_places_that_differ_are_solved() -> None:
    scene = scene_of(PLATE, (LEFT, RIGHT), *((float(x), float(y)) for x in ALONG for y in ACROSS))
    work = scene.work([500.0], rtol=1e-4)
    assert work.pairs_asked == 2 * ALONG.size * ACROSS.size
    assert work.pairs_solved < work.pairs_asked / 4
