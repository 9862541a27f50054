"""Scenes: what is computed, what is left out without a trace, and what is refused."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

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
    PressureRectangle,
    Scene,
    Strip,
    response,
)

W = 0.025
PLATE = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
MIDDLE = PointForce(x_m=0.0, y_m=0.0125)
DISCS = tuple(MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035))
FINGERS = ((-0.035, 0.0125), (0.035, 0.0125))
EDGES = [SIMPLY_SUPPORTED, ElasticEdge(stiffness_n=141.7), CLAMPED]


def on(edge: IdealEdge | ElasticEdge) -> Strip:
    return dataclasses.replace(PLATE, edge=edge)


def test_two_discs_and_two_fingers_are_two_distances() -> None:
    work = Scene(strip=PLATE, loads=DISCS, points_m=FINGERS).work([300.0])
    assert (work.pairs_asked, work.pairs_solved) == (4, 2)
    assert (work.symmetries_asked, work.symmetries_solved) == (4, 1)
    assert (work.integrals_asked, work.integrals_solved) == (8, 1)


def test_every_skip_is_told_with_its_reason() -> None:
    scene = Scene(strip=on(SIMPLY_SUPPORTED), loads=DISCS, points_m=FINGERS)
    told = " / ".join(scene.work(np.linspace(1.0, 1500.0, 200)).skipped)
    for what in (
        "200 frequencies follow from",
        "2 of 4 pairs: they are repeated or mirror images",
        "3 of 4 symmetries: zero on the centre line",
        "7 of 8 integrals: far from the load",
        "the wall correction: the edges are simply supported",
    ):
        assert what in told


def test_nothing_is_skipped_unless_told() -> None:
    scene = Scene(strip=PLATE, loads=DISCS, points_m=FINGERS, skip=False)
    work = scene.work(np.linspace(100.0, 1500.0, 200))
    assert work.skipped == ()
    for name in ("frequencies", "pairs", "symmetries", "integrals"):
        assert getattr(work, f"{name}_asked") == getattr(work, f"{name}_solved")
    assert work.wall_correction


@pytest.mark.slow
@pytest.mark.parametrize("edge", EDGES, ids=["supported", "elastic", "clamped"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_skipping_changes_the_counts_and_no_result(
    edge: IdealEdge | ElasticEdge, rtol: float
) -> None:
    loads: tuple[Load, ...] = (
        *DISCS,
        PointForce(x_m=0.01, y_m=0.006),
        PressureRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.01, length_y_m=0.01),
        MomentRectangle(x_m=-0.02, y_m=0.017, length_x_m=0.006, length_y_m=0.009),
    )
    points_m = (*FINGERS, (0.0, 0.004), (0.0, 0.021))
    frequencies_hz = np.append(np.linspace(0.0, 1500.0, 40), [6000.0, 14000.0])
    careful = Scene(strip=on(edge), loads=loads, points_m=points_m, skip=False)
    quick = dataclasses.replace(careful, skip=True)
    full, some = (response(scene, frequencies_hz, rtol) for scene in (careful, quick))
    assert some.work.frequencies_solved < full.work.frequencies_solved
    assert some.work.pairs_solved < full.work.pairs_solved
    assert some.work.symmetries_solved < full.work.symmetries_solved
    assert some.work.integrals_solved < full.work.integrals_solved
    size_m = np.abs(full.displacement_m)
    change_m = np.abs(some.displacement_m - full.displacement_m)
    largest_m = np.max(size_m, axis=(1, 2), keepdims=True)
    assert np.all(change_m <= rtol * np.maximum(size_m, 1e-3 * largest_m))


def test_far_points_need_waves_only_and_a_smaller_tolerance_moves_the_border() -> None:
    points_m = tuple((0.001 * x, 0.0125) for x in range(80))
    scene = Scene(strip=PLATE, loads=(MIDDLE,), points_m=points_m)
    counts = [scene.work([300.0], rtol).integrals_solved for rtol in (1e-2, 1e-6, 1e-12)]
    assert counts == sorted(counts)
    assert 0 < counts[0] < counts[2] < len(points_m)


@pytest.mark.parametrize("edge", EDGES, ids=["supported", "elastic", "clamped"])
def test_both_sides_of_that_border_agree(edge: IdealEdge | ElasticEdge) -> None:
    rtol = 1e-9
    border_m = 0.025 * (math.log(1 / rtol) + 4) / 12
    points_m = tuple((border_m * (1 + d), 0.01) for d in (-1e-9, 1e-9))
    scene = Scene(strip=on(edge), loads=(MIDDLE,), points_m=points_m)
    assert scene.work([300.0], rtol).integrals_solved == 1
    near, far = response(scene, [300.0], rtol).displacement_m[0, 0]
    assert abs(near - far) < 1e-7 * abs(far)
    middle = Scene(strip=on(edge), loads=(MIDDLE,), points_m=((border_m, 0.01),))
    tight = response(middle, [300.0], 1e-12).displacement_m[0, 0, 0]
    assert abs((near + far) / 2 - tight) < rtol * abs(tight)


def test_the_border_of_the_sweep_does_not_show() -> None:
    strip = on(ElasticEdge(stiffness_n=141.72083994908))
    scene = Scene(strip=strip, loads=(MIDDLE,), points_m=((0.0, 0.0125), (0.05, 0.01)))
    border_hz = 0.9 * strip.cutoff_hz()
    sweep_hz = np.append(np.linspace(0.0, border_hz, 100), border_hz * (1 + 1e-9))
    work = scene.work(sweep_hz, 1e-9)
    assert work.frequencies_solved < 60
    u = response(scene, sweep_hz, 1e-9).displacement_m
    np.testing.assert_allclose(u[-1], u[-2], rtol=5e-8)
    alone = response(scene, sweep_hz[-2:-1], 1e-12).displacement_m
    np.testing.assert_allclose(u[-2:-1], alone, rtol=1e-9)
