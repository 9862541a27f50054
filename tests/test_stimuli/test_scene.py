"""Scenes: what is computed, and what is left out without a trace."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from stimuli import PressureRectangle, response
from stimuli.solver.guided import guided
from tests.test_stimuli.plates import (
    DISCS,
    FIRM,
    PLATE,
    SUPPORTED,
    Edge,
    W,
    disc,
    each_edge,
    force,
    on,
    patch,
    scene_of,
    within,
)

FINGERS = ((-0.035, W / 2), (0.035, W / 2))
COUNTS = ("frequencies", "pairs", "symmetries", "integrals")


def test_two_discs_and_two_fingers_are_two_distances() -> None:
    work = scene_of(PLATE, DISCS, *FINGERS).work([300.0])
    assert (work.pairs_asked, work.pairs_solved) == (4, 2)
    assert (work.symmetries_asked, work.symmetries_solved) == (4, 1)
    assert (work.integrals_asked, work.integrals_solved) == (8, 1)


def test_every_skip_is_told_with_its_reason() -> None:
    told = scene_of(SUPPORTED, DISCS, *FINGERS).work(np.linspace(1.0, 1500.0, 200)).skipped
    for what in (
        "200 frequencies follow from",
        "2 of 4 pairs: they are repeated or mirror images",
        "3 of 4 symmetries: zero on the centre line",
        "7 of 8 integrals: far from the load",
        "the wall correction: the edges are simply supported",
    ):
        assert what in " / ".join(told)


def test_nothing_is_skipped_unless_told() -> None:
    work = scene_of(PLATE, DISCS, *FINGERS, skip=False).work(np.linspace(100.0, 1500.0, 200))
    assert work.skipped == ()
    for name in COUNTS:
        assert getattr(work, f"{name}_asked") == getattr(work, f"{name}_solved")
    assert work.wall_correction


BESIDE = ((-0.06, 0.0075), (-0.02, 0.0105), (0.03, 0.016), (0.06, W / 2))
"""Off the centre line at three distances, and on it."""


@each_edge
@pytest.mark.parametrize("length_m", [None, 0.2])
@pytest.mark.parametrize("across_m", [0.0, 0.006])
def test_loads_in_different_places_across_give_what_each_gives_alone(
    edge: Edge, length_m: float | None, across_m: float
) -> None:
    last = BESIDE[-1] if length_m is None else (0.092, 0.006)  # too near the end for waves alone
    loads = tuple(
        patch(0.005, across_m, x_m=x_m, y_m=y_m) if across_m else disc(0.004, x_m=x_m, y_m=y_m)
        for x_m, y_m in (*BESIDE[:3], last)
    )
    points = (-0.06, 0.0075), (0.03, W / 2), (0.045, 0.005)
    scene = scene_of(on(edge, length_m, loss=0.01), loads, *points)
    found = response(scene, [1700.0], rtol := 1e-5)
    for number, load in enumerate(loads):
        alone = response(dataclasses.replace(scene, loads=(load,)), [1700.0], rtol)
        apart = np.abs(found.displacement_m[:, number] - alone.displacement_m[:, 0])
        assert np.all(apart <= found.error_m[:, number] + alone.error_m[:, 0])
        assert within(found.displacement_m[:, number], alone.displacement_m[:, 0], rtol)


def test_loads_in_different_places_across_share_the_waves(monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[int] = []

    def counted(k: Any, hold: Any, count: int, sign: int, rtol: float) -> Any:
        solved.append(sign)
        return guided(k, hold, count, sign, rtol)

    monkeypatch.setattr("stimuli.solver.ends.ends.guided", counted)
    loads = tuple(disc(0.004, x_m=x_m, y_m=y_m) for x_m, y_m in BESIDE)
    work = response(scene_of(on(FIRM, 0.2, loss=0.01), loads, *BESIDE), [3000.0]).work
    assert solved == [1, -1]
    assert work.symmetries_solved == 7


@pytest.mark.slow
@each_edge
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_skipping_changes_the_counts_and_no_result(edge: Edge, rtol: float) -> None:
    loads = (
        *DISCS,
        force(0.01, 0.006),
        patch(0.01, 0.01, kind=PressureRectangle),
        patch(0.006, 0.009, x_m=-0.02, y_m=0.017),
    )
    quick = scene_of(on(edge), loads, *FINGERS, (0.0, 0.004), (0.0, 0.021))
    frequencies_hz = np.append(np.linspace(0.0, 1500.0, 40), [6000.0, 14000.0])
    careful = dataclasses.replace(quick, skip=False)
    full, some = (response(scene, frequencies_hz, rtol) for scene in (careful, quick))
    for name in COUNTS:
        assert getattr(some.work, f"{name}_solved") < getattr(full.work, f"{name}_solved")
    assert within(some.displacement_m, full.displacement_m, rtol, axis=(1, 2))


def test_far_points_need_waves_only_and_a_smaller_tolerance_moves_the_border() -> None:
    scene = scene_of(PLATE, force(), *((0.001 * x, W / 2) for x in range(80)))
    counts = [scene.work([300.0], rtol).integrals_solved for rtol in (1e-2, 1e-6, 1e-12)]
    assert counts == sorted(counts)
    assert 0 < counts[0] < counts[2] < 80


@each_edge
def test_both_sides_of_that_border_agree(edge: Edge) -> None:
    rtol = 1e-9
    border_m = W * (math.log(1 / rtol) + 4) / 12
    scene = scene_of(on(edge), force(), *((border_m * (1 + d), 0.01) for d in (-1e-9, 1e-9)))
    assert scene.work([300.0], rtol).integrals_solved == 1
    near, far = response(scene, [300.0], rtol).displacement_m[0, 0]
    assert abs(near - far) < 1e-7 * abs(far)
    middle = dataclasses.replace(scene, points_m=((border_m, 0.01),))
    tight = response(middle, [300.0], 1e-12).displacement_m[0, 0, 0]
    assert abs((near + far) / 2 - tight) < rtol * abs(tight)


def test_the_border_of_the_sweep_does_not_show() -> None:
    scene = scene_of(on(FIRM), force(), (0.0, W / 2), (0.05, 0.01))
    border_hz = 0.9 * scene.strip.cutoff_hz()
    sweep_hz = np.append(np.linspace(0.0, border_hz, 100), border_hz * (1 + 1e-9))
    assert scene.work(sweep_hz, 1e-9).frequencies_solved < 60
    u = response(scene, sweep_hz, 1e-9).displacement_m
    np.testing.assert_allclose(u[-1], u[-2], rtol=5e-8)
    alone = response(scene, sweep_hz[-2:-1], 1e-12).displacement_m
    np.testing.assert_allclose(u[-2:-1], alone, rtol=1e-9)
