"""The field where it is hard to compute: values to twenty digits, and no place without one."""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.exact import exact
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    ForceRectangle,
    Load,
    Material,
    PressureDisc,
    PressureRectangle,
    Strip,
    response,
)
from tests.test_stimuli.plates import SUPPORTED, Edge, W, disc, force, on, patch, scene_of

if TYPE_CHECKING:
    from stimuli import Response

FORCE = force(0.0, 0.01)
FREE, HELD = SIMPLY_SUPPORTED, CLAMPED
SHORT, LONG = on(FREE, 0.01, loss=0.01), on(FREE, 10.0, loss=0.01)
EXTREME = [
    FORCE,
    force(0.0, 0.0),
    *(patch(), patch(0.006, W), patch(2.5e-8, 2.5e-8, y_m=1.25e-8)),
    patch(2.0, 2.5e-8, y_m=0.01, kind=PressureRectangle),
    *(disc(0.0064, y_m=0.0064), disc(W / 2, kind=PressureDisc), disc(2.5e-8, y_m=0.01)),
]
LONG_EPS = float(np.finfo(np.longdouble).eps)


def strict(
    strip: Strip,
    load: Load,
    x_m: float,
    y_m: float,
    frequency_hz: float,
    rtol: float = 1e-10,
    *,
    skip: bool = True,
) -> Response:
    with warnings.catch_warnings(), np.errstate(over="raise", divide="raise", invalid="raise"):
        warnings.simplefilter("error")
        return response(scene_of(strip, load, (x_m, y_m), skip=skip), [frequency_hz], rtol)


def soft(stiffness_n: float) -> Strip:
    return on(ElasticEdge(stiffness_n=stiffness_n))


# Residues and tanh-sinh-like integrals in 62-digit arithmetic (benchmarks/exact.py), each number
# of the problem taken as the double it is: strip, load, x, y, frequency, metres per unit load.
Values = list[tuple[Strip, Load, float, float, float, complex]]
HARD: Values = [
    (on(HELD), FORCE, 0.01, 0.015, 0.0, 1.6904412068608964242e-6),
    (soft(1e-4), FORCE, 0.01, 0.015, 1e-6, 7.2391972273326210703e-6),
    (soft(1e8), FORCE, 0.0, 0.015, 1e5, 8.497039984380899035e-8 - 7.9273733993805836335e-8j),
    (on(HELD), FORCE, 0.01, 0.015, 3618.11525, 5.4581277488687939328e-6),
    (on(HELD, loss=0.5), FORCE, 0.01, 0.015, 4366.0969428735,
     2.5888117786604936491e-7 + 3.9291263800908521082e-6j),
    (on(HELD, viscous_s=3.2e-5), FORCE, 0.0, 0.015, 500.0,
     3.9089503433567754074e-6 + 3.9686083383083072187e-7j),
    (SUPPORTED, FORCE, 10.0, 0.015, 3000.0, -8.1349364434035836957e-6 - 5.6170414961127034781e-6j),
    (on(HELD), FORCE, 1.0, 0.015, 500.0, 8.9851645770779736739e-79),
    (on(HELD), disc(0.0064, y_m=0.0064), 0.0, 0.0064, 700.0, -8.4751262849790307475e-6),
    (on(HELD), disc(W / 2, kind=PressureDisc), 0.002, 0.02, 700.0, 4.5303113454787106829e-10),
    (on(HELD), patch(0.006, W), 0.0, 0.01, 700.0, -8.0691595450099391246e-6),
    (SUPPORTED, patch(2.5e-8, 2.5e-8, y_m=0.01), 0.0, 0.01, 700.0, -1.816160797659631069e-15),
    (SHORT, patch(), 0.004, 0.015, 500.0, -4.1306146150527622365e-5 - 4.5014899995927912738e-7j),
    (SHORT, patch(), 0.005, 0.015, 2600.0, 4.9621004125186861011e-5 - 3.2650021382847260967e-7j),
    (LONG, patch(), 0.004, 0.015, 2600.0, 3.0409424711759035913e-6 - 2.6368168791971843586e-5j),
]  # fmt: skip
BESIDE_CUTOFF: Values = [
    (SUPPORTED, FORCE, 0.01, 0.015, 1926.031369109,
     -1.5982634424519265753e-5 + 1.3964632583329088172e1j),
    (on(HELD), FORCE, 0.01, 0.015, 4366.096942878,
     -1.4597161205161774087e-5 + 5.2234602199071480351j),
]  # fmt: skip


@pytest.mark.parametrize("case", [*HARD, *BESIDE_CUTOFF])
def test_hard_values_are_right_and_beside_a_cutoff_the_estimate_tells_the_digits_that_are_lost(
    case: tuple[Strip, Load, float, float, float, complex],
) -> None:
    true_m = case[-1]
    found = strict(*case[:-1])
    error_m, estimate_m = abs(found.displacement_m[0, 0, 0] - true_m), found.error_m[0, 0, 0]
    assert error_m < estimate_m
    if case in HARD:
        assert error_m < 1e-10 * abs(true_m)
    else:
        # at a detuning of 1e-12 the field is known to the rounding of a long double over that
        assert estimate_m < 20 * LONG_EPS / 1e-12 * abs(true_m)


def drawn_plate(rng: np.random.Generator, edge: Edge, loss: float) -> Strip:
    width_m = rng.uniform(0.005, 0.1)
    material = Material(
        youngs_modulus_pa=10 ** rng.uniform(9, 11.5),
        poisson_ratio=rng.uniform(0.05, 0.45),
        density_kg_m3=rng.uniform(900, 9000),
        loss_factor=loss,
    )
    thickness_m = width_m * rng.uniform(0.005, 0.05)
    return Strip(width_m=width_m, thickness_m=thickness_m, material=material, edge=edge)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_on_drawn_plates_the_estimate_lies_above_the_error(seed: int) -> None:
    """Next to a cut-off, many widths away, and under a load of next to no size."""
    rng = np.random.default_rng(seed)
    edge, kind = (HELD, HELD, FREE)[seed // 4], seed % 4
    strip = drawn_plate(rng, edge, 10 ** rng.uniform(-13, -2) if kind == 1 else 0.0)
    width_m, lossless = strip.width_m, replace(strip.material, loss_factor=0.0)
    cutoff_hz = replace(strip, material=lossless).cutoff_hz()
    y_m, place_m = rng.uniform(0.15, 0.85, 2) * width_m
    load, frequency_hz, x_m = force(0.0, y_m), cutoff_hz * rng.uniform(0.05, 5), 3 * width_m
    if kind < 2:
        frequency_hz = cutoff_hz * (1 + rng.choice([-1, 1]) * 10 ** rng.uniform(-13, -8))
    elif kind == 2:
        x_m = width_m * 10 ** rng.uniform(-1, 3)
    else:
        size_m, x_m = width_m * 10 ** rng.uniform(-7, -4), width_m * rng.uniform(0, 1)
        load = patch(size_m, size_m, y_m=y_m, kind=ForceRectangle)
    true_m = complex(exact(strip, load, x_m, place_m, frequency_hz))
    for rtol in (1e-6, 1e-10):
        found = strict(strip, load, x_m, place_m, frequency_hz, rtol)
        assert abs(found.displacement_m[0, 0, 0] - true_m) <= found.error_m[0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("part", [1e-3, 1e-4])
@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED], ids=["clamped", "supported"])
@pytest.mark.parametrize("touches", [False, True])
def test_the_tolerance_holds_next_to_an_edge(edge: Edge, part: float, *, touches: bool) -> None:
    """Of a force, and of a disc that touches the edge, where sums cancel: against forty digits."""
    y_m = part * W / 2
    load = disc(y_m, y_m=y_m) if touches else force(0.0, y_m)
    true_m = complex(exact(on(edge), load, 0.0, y_m, 700.0))
    for rtol in (1e-1, 1e-2, 1e-4, 1e-6):
        found_m = strict(on(edge), load, 0.0, y_m, 700.0, rtol).displacement_m[0, 0, 0]
        assert abs(found_m - true_m) < rtol * abs(true_m)


@pytest.mark.slow
@settings(deadline=None, max_examples=150)
@given(
    edge=st.one_of(
        st.sampled_from([SIMPLY_SUPPORTED, CLAMPED]),
        st.floats(-4, 8).map(lambda power: ElasticEdge(stiffness_n=10**power)),
    ),
    loss=st.one_of(st.just(0.0), st.floats(1e-12, 0.5)),
    viscous=st.booleans(),
    load=st.sampled_from(EXTREME),
    x_m=st.one_of(st.just(0.0), st.floats(-12, 1).map(lambda power: 10**power)),
    y_m=st.one_of(st.sampled_from([0.0, W / 2, W]), st.floats(0.0, W)),
    frequency_hz=st.one_of(
        st.just(0.0),
        st.floats(-6, 5).map(lambda power: 10**power),
        st.sampled_from([-1e-6, -1e-12, 1e-12, 1e-6]),
    ),
    rtol=st.sampled_from([1e-2, 1e-6, 1e-12]),
    skip=st.booleans(),
)
def test_no_strip_load_place_or_frequency_gives_nan_or_a_warning(
    edge: Edge,
    loss: float,
    viscous: bool,  # noqa: FBT001  hypothesis passes it by name
    load: Load,
    x_m: float,
    y_m: float,
    frequency_hz: float,
    rtol: float,
    skip: bool,  # noqa: FBT001
) -> None:
    if 0 < abs(frequency_hz) <= 1e-6:  # a detuning
        frequency_hz = (1 + frequency_hz) * on(edge).cutoff_hz()
    time_s = loss / (2 * np.pi * max(frequency_hz, 1.0)) if viscous else 0.0
    strip = on(edge, loss=0.0 if viscous else loss, viscous_s=time_s)
    found = strict(strip, load, x_m, y_m, frequency_hz, rtol, skip=skip)
    assert np.all(np.isfinite(found.displacement_m))
    assert np.all(np.isfinite(found.error_m))
