"""The benchmarks: their reference solvers have known values, and the smallest case of each runs."""

from __future__ import annotations

import dataclasses
import importlib
from typing import TYPE_CHECKING, Any

import pytest

from benchmarks import calibration, field
from benchmarks.hard_cases import strip_on
from stimuli import CLAMPED, SIMPLY_SUPPORTED, MomentRectangle, PointForce
from tests.reference.exact import exact

if TYPE_CHECKING:
    from collections.abc import Callable

    from stimuli import Load, Strip

W = 0.025
FORCE = PointForce(x_m=0.0, y_m=W / 2)
PATCH = MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=0.005, length_y_m=0.015)


@pytest.mark.parametrize(
    ("strip", "load", "at", "known_m", "rel"),
    [
        # contour integrals and modal sums, 16 digits
        (strip_on(SIMPLY_SUPPORTED), FORCE, (0.0, W / 2, 300.0), 1.35672670270450974e-05, 1e-15),
        (strip_on(CLAMPED), FORCE, (0.07, W / 2, 300.0), 3.70695978412616636e-11, 1e-15),
        # with free ends: polynomials and finite elements, 12 digits
        (
            dataclasses.replace(strip_on(SIMPLY_SUPPORTED, loss_factor=0.01), length_m=0.2),
            PATCH,
            (0.02, 0.0075, 500.0),
            -1.9807964221232675e-06 - 2.2596465628158454e-08j,
            1e-12,
        ),
    ],
)
def test_the_evaluator_gives_values_known_from_other_methods(
    strip: Strip, load: Load, at: tuple[float, float, float], known_m: complex, rel: float
) -> None:
    assert float(abs(exact(strip, load, *at) / known_m - 1)) < rel


@pytest.mark.parametrize("problem", [field.frequency_response, field.gain_matrix, field.field_map])
def test_errors_beside_finite_elements_are_told(
    problem: Callable[[], field.Problem], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(field, "REPEATS", 1)
    monkeypatch.setattr(field, "FINEST_M", 2e-3)
    ours, coarse, fine = problem().runs((4e-3, 3e-3))
    assert ours.error < ours.told
    assert ours.error < coarse.error < 0.1
    assert fine.seconds > coarse.seconds > ours.seconds


def test_statsmodels_agrees_where_there_are_neither_guesses_nor_lapses() -> None:
    scenario = calibration.Scenario(
        levels_vpp=calibration.PAPER, threshold_vpp=100, guess_rate=0, lapse_rate=0, presented=400
    )
    (counts,) = scenario.counts(1)
    (limits,) = calibration.ours(scenario, counts[None])
    assert 20 * calibration.by_statsmodels(scenario, counts) == pytest.approx(20 * limits, abs=0.1)


@pytest.mark.parametrize(
    ("name", "small"),
    [
        ("analysis", {"SIZES": (2,)}),
        ("calibration", {"STUDIES": 20, "BESIDE": 0, "SCENARIOS": calibration.SCENARIOS[:2]}),
        ("groups", {"STUDIES": 1, "PEOPLE": (3,)}),
        ("gains", {"STUDIES": {}, "REPEATS": 1, "N_DRAWN": 2}),
        ("people", {"SESSIONS": 3}),
    ],
)
def test_the_smallest_case_of_a_benchmark_gives_a_table(
    name: str, small: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    benchmark = importlib.import_module(f"benchmarks.{name}")
    for constant, size in small.items():
        monkeypatch.setattr(benchmark, constant, size)
    assert benchmark.section().count("\n|") > 2
