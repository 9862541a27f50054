"""Scenes: what is computed, what is left out without a trace, and what is refused."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

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
    PressureDisc,
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


# --- refusals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "load",
    [
        PointForce(x_m=0.0, y_m=0.0251),
        PressureDisc(x_m=0.0, y_m=0.0125, radius_m=0.0126),
        MomentDisc(x_m=0.0, y_m=0.005, radius_m=0.0064),
        MomentRectangle(x_m=0.0, y_m=0.02, length_x_m=0.01, length_y_m=0.011),
    ],
    ids=lambda load: type(load).__name__,
)
def test_loads_beyond_an_edge_are_refused(load: Any) -> None:
    with pytest.raises(ValueError, match=r"loads: (y_m must lie|sizes must be) .*got"):
        Scene(strip=PLATE, loads=(load,), points_m=((0.0, 0.0125),))


def test_loads_that_touch_the_edges_are_taken() -> None:
    loads = (
        PressureDisc(x_m=0.0, y_m=0.0125, radius_m=0.0125),
        MomentRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.01, length_y_m=0.025),
    )
    assert len(Scene(strip=PLATE, loads=loads, points_m=((0.0, 0.0),)).loads) == 2


@pytest.mark.parametrize(
    "point",
    [(0.0, -1e-9), (0.0, 0.0251), (math.nan, 0.01), (0.0, math.inf), (0.0, True), (0.0,), 3],
)
def test_points_beside_the_strip_are_refused(point: Any) -> None:
    with pytest.raises(ValueError, match=r"points_m.*got"):
        Scene(strip=PLATE, loads=(MIDDLE,), points_m=(point,))


@pytest.mark.parametrize("name", ["loads", "points_m"])
@pytest.mark.parametrize("bad", [(), None, "ab", 1.0])
def test_an_empty_scene_is_refused(name: str, bad: Any) -> None:
    scene = Scene(strip=PLATE, loads=(MIDDLE,), points_m=((0.0, 0.0125),))
    with pytest.raises(ValueError, match=f"{name} must"):
        dataclasses.replace(scene, **{name: bad})


def test_wrong_parts_are_refused_by_name() -> None:
    scene = Scene(strip=PLATE, loads=(MIDDLE,), points_m=((0.0, 0.0125),))
    wrong: Any = "strip"
    with pytest.raises(ValueError, match="strip must be a Strip"):
        dataclasses.replace(scene, strip=wrong)
    with pytest.raises(ValueError, match="loads must be a tuple of loads"):
        dataclasses.replace(scene, loads=(wrong,))
    with pytest.raises(ValueError, match="skip must be True or False"):
        dataclasses.replace(scene, skip=1)  # type: ignore[arg-type]  # wrong on purpose


SHORT = dataclasses.replace(PLATE, length_m=0.2)


@pytest.mark.parametrize(
    "load",
    [
        PointForce(x_m=0.1000001, y_m=0.0125),
        PressureDisc(x_m=-0.095, y_m=0.0125, radius_m=0.0051),
        MomentRectangle(x_m=0.09, y_m=0.0125, length_x_m=0.021, length_y_m=0.01),
    ],
    ids=lambda load: type(load).__name__,
)
def test_loads_beyond_an_end_are_refused(load: Any) -> None:
    with pytest.raises(ValueError, match=r"loads: x_m must lie from -.* to .*got"):
        Scene(strip=SHORT, loads=(load,), points_m=((0.0, 0.0125),))


@pytest.mark.parametrize("x_m", [0.1000001, -0.2, math.nan])
def test_points_beyond_an_end_are_refused(x_m: float) -> None:
    with pytest.raises(ValueError, match=r"points_m: x must be .*-0\.1 and <= 0\.1, got"):
        Scene(strip=SHORT, loads=(MIDDLE,), points_m=((x_m, 0.0125),))


def test_loads_and_points_at_an_end_are_taken() -> None:
    loads = (
        PointForce(x_m=0.1, y_m=0.0125),
        MomentRectangle(x_m=-0.095, y_m=0.0125, length_x_m=0.01, length_y_m=0.01),
    )
    assert len(Scene(strip=SHORT, loads=loads, points_m=((-0.1, 0.01), (0.1, 0.01))).loads) == 2


@pytest.mark.parametrize("bad", [[-1.0], [math.nan], [1e12], [[1.0]], 300.0, ["a"], [True]])
def test_frequencies_that_are_none_are_refused(bad: Any) -> None:
    scene = Scene(strip=PLATE, loads=(MIDDLE,), points_m=((0.0, 0.0125),))
    with pytest.raises(ValueError, match="frequencies_hz must"):
        scene.work(bad)
    with pytest.raises(ValueError, match="frequencies_hz must"):
        response(scene, bad)


def test_a_disc_too_wide_for_the_wave_is_refused() -> None:
    for radius_m, most_hz in ((W / 2, 199_818.0), (W / 4, 799_272.0)):
        disc = PressureDisc(x_m=0.0, y_m=W / 2, radius_m=radius_m)
        scene = Scene(strip=PLATE, loads=(disc,), points_m=((0.0, W / 2),))
        assert scene.work([0.999 * most_hz]).frequencies_solved == 1
        with pytest.raises(ValueError, match=r"frequencies_hz must be .* from 0 to"):
            scene.work([1.001 * most_hz])


@pytest.mark.parametrize("bad", [0.0, 1e-13, 0.2, -1e-6, math.nan, True, "1e-6"])
def test_a_tolerance_that_cannot_be_kept_is_refused(bad: Any) -> None:
    scene = Scene(strip=PLATE, loads=(MIDDLE,), points_m=((0.0, 0.0125),))
    with pytest.raises(ValueError, match="rtol must be"):
        response(scene, [300.0], bad)
