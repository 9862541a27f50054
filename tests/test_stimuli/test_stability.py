"""The field where it is hard to compute: values to twenty digits, and no place without one."""

from __future__ import annotations

import dataclasses
import warnings

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
    PressureDisc,
    Response,
    Scene,
    Strip,
    response,
)

W = 0.025
PLATE = Strip(width_m=W, thickness_m=0.0005, material=ALUMINIUM, edge=SIMPLY_SUPPORTED)
FORCE = PointForce(x_m=0.0, y_m=0.01)
LONG_EPS = float(np.finfo(np.longdouble).eps)


def on(
    edge: IdealEdge | ElasticEdge,
    length_m: float | None = None,
    *,
    loss_factor: float = 0.0,
    viscous_time_s: float = 0.0,
) -> Strip:
    material = dataclasses.replace(
        ALUMINIUM, loss_factor=loss_factor, viscous_time_s=viscous_time_s
    )
    return dataclasses.replace(PLATE, edge=edge, material=material, length_m=length_m)


def patch(along_m: float = 0.006, across_m: float = 0.018, y_m: float = W / 2) -> MomentRectangle:
    return MomentRectangle(x_m=0.0, y_m=y_m, length_x_m=along_m, length_y_m=across_m)


def strict(
    strip: Strip, load: Load, x_m: float, y_m: float, frequency_hz: float, rtol: float = 1e-10
) -> Response:
    scene = Scene(strip=strip, loads=(load,), points_m=((x_m, y_m),))
    with warnings.catch_warnings(), np.errstate(over="raise", divide="raise", invalid="raise"):
        warnings.simplefilter("error")
        return response(scene, [frequency_hz], rtol)


# Residues and tanh-sinh-like integrals in 62-digit arithmetic (benchmarks/exact.py), each number
# of the problem taken as the double it is: strip, load, x, y, frequency, metres per unit load.
HARD: list[tuple[Strip, Load, float, float, float, complex]] = [
    (on(CLAMPED), FORCE, 0.01, 0.015, 0.0, 1.6904412068608964242e-6),
    (on(ElasticEdge(stiffness_n=1e-4)), FORCE, 0.01, 0.015, 1e-6, 7.2391972273326210703e-6),
    (
        on(ElasticEdge(stiffness_n=1e8)),
        FORCE,
        0.0,
        0.015,
        100000.0,
        8.497039984380899035e-8 - 7.9273733993805836335e-8j,
    ),
    (on(CLAMPED), FORCE, 0.01, 0.015, 3618.11525, 5.4581277488687939328e-6),
    (
        on(CLAMPED, loss_factor=0.5),
        FORCE,
        0.01,
        0.015,
        4366.0969428735,
        2.5888117786604936491e-7 + 3.9291263800908521082e-6j,
    ),
    (
        on(CLAMPED, viscous_time_s=3.2e-5),
        FORCE,
        0.0,
        0.015,
        500.0,
        3.9089503433567754074e-6 + 3.9686083383083072187e-7j,
    ),
    (
        on(SIMPLY_SUPPORTED),
        FORCE,
        10.0,
        0.015,
        3000.0,
        -8.1349364434035836957e-6 - 5.6170414961127034781e-6j,
    ),
    (on(CLAMPED), FORCE, 1.0, 0.015, 500.0, 8.9851645770779736739e-79),
    (
        on(CLAMPED),
        MomentDisc(x_m=0.0, y_m=0.0064, radius_m=0.0064),
        0.0,
        0.0064,
        700.0,
        -8.4751262849790307475e-6,
    ),
    (
        on(CLAMPED),
        PressureDisc(x_m=0.0, y_m=W / 2, radius_m=W / 2),
        0.002,
        0.02,
        700.0,
        4.5303113454787106829e-10,
    ),
    (on(CLAMPED), patch(0.006, W), 0.0, 0.01, 700.0, -8.0691595450099391246e-6),
    (
        on(SIMPLY_SUPPORTED),
        patch(2.5e-8, 2.5e-8, 0.01),
        0.0,
        0.01,
        700.0,
        -1.816160797659631069e-15,
    ),
    (
        on(SIMPLY_SUPPORTED, 0.01, loss_factor=0.01),
        patch(),
        0.004,
        0.015,
        500.0,
        -4.1306146150527622365e-5 - 4.5014899995927912738e-7j,
    ),
    (
        on(SIMPLY_SUPPORTED, 0.01, loss_factor=0.01),
        patch(),
        0.005,
        0.015,
        2600.0,
        4.9621004125186861011e-5 - 3.2650021382847260967e-7j,
    ),
    (
        on(SIMPLY_SUPPORTED, 10.0, loss_factor=0.01),
        patch(),
        0.004,
        0.015,
        2600.0,
        3.0409424711759035913e-6 - 2.6368168791971843586e-5j,
    ),
]
BESIDE_CUTOFF: list[tuple[Strip, Load, float, float, float, complex]] = [
    (
        on(SIMPLY_SUPPORTED),
        FORCE,
        0.01,
        0.015,
        1926.031369109,
        -1.5982634424519265753e-5 + 1.3964632583329088172e1j,
    ),
    (
        on(CLAMPED),
        FORCE,
        0.01,
        0.015,
        4366.096942878,
        -1.4597161205161774087e-5 + 5.2234602199071480351j,
    ),
]


@pytest.mark.parametrize(("strip", "load", "x_m", "y_m", "frequency_hz", "true_m"), HARD)
def test_hard_values_are_right_to_ten_digits(
    strip: Strip, load: Load, x_m: float, y_m: float, frequency_hz: float, true_m: complex
) -> None:
    found = strict(strip, load, x_m, y_m, frequency_hz)
    error_m = abs(found.displacement_m[0, 0, 0] - true_m)
    assert error_m < 1e-10 * abs(true_m)
    assert error_m < found.error_m[0, 0, 0]


@pytest.mark.parametrize(("strip", "load", "x_m", "y_m", "frequency_hz", "true_m"), BESIDE_CUTOFF)
def test_beside_a_cutoff_the_estimate_tells_the_digits_that_are_lost(
    strip: Strip, load: Load, x_m: float, y_m: float, frequency_hz: float, true_m: complex
) -> None:
    # at a detuning of 1e-12 the field is known to the rounding of a long double over that
    found = strict(strip, load, x_m, y_m, frequency_hz)
    error_m = abs(found.displacement_m[0, 0, 0] - true_m)
    assert error_m < found.error_m[0, 0, 0] < 20 * LONG_EPS / 1e-12 * abs(true_m)


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(
    edge=st.one_of(
        st.sampled_from([SIMPLY_SUPPORTED, CLAMPED]),
        st.floats(-4, 8).map(lambda power: ElasticEdge(stiffness_n=10**power)),
    ),
    loss=st.one_of(st.just(0.0), st.floats(1e-12, 0.5)),
    viscous=st.booleans(),
    load=st.sampled_from(
        [
            FORCE,
            patch(),
            patch(0.006, W),
            patch(2.5e-8, 2.5e-8, 1.25e-8),
            MomentDisc(x_m=0.0, y_m=0.0064, radius_m=0.0064),
            PressureDisc(x_m=0.0, y_m=W / 2, radius_m=W / 2),
            MomentDisc(x_m=0.0, y_m=0.01, radius_m=2.5e-8),
        ]
    ),
    x_m=st.one_of(st.just(0.0), st.floats(-12, 1).map(lambda power: 10**power)),
    y_m=st.one_of(st.sampled_from([0.0, W / 2, W]), st.floats(0.0, W)),
    frequency_hz=st.one_of(st.just(0.0), st.floats(-6, 5).map(lambda power: 10**power)),
    rtol=st.sampled_from([1e-2, 1e-6, 1e-12]),
)
def test_no_strip_load_place_or_frequency_gives_nan_or_a_warning(
    edge: IdealEdge | ElasticEdge,
    loss: float,
    viscous: bool,  # noqa: FBT001  hypothesis passes it by name
    load: Load,
    x_m: float,
    y_m: float,
    frequency_hz: float,
    rtol: float,
) -> None:
    time_s = loss / (2 * np.pi * max(frequency_hz, 1.0)) if viscous else 0.0
    strip = on(edge, loss_factor=0.0 if viscous else loss, viscous_time_s=time_s)
    found = strict(strip, load, x_m, y_m, frequency_hz, rtol)
    assert np.all(np.isfinite(found.displacement_m))
    assert np.all(np.isfinite(found.error_m))


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, ElasticEdge(stiffness_n=30.0), CLAMPED])
def test_at_a_cutoff_without_loss_the_field_is_refused_and_with_any_loss_it_is_not(
    edge: IdealEdge | ElasticEdge,
) -> None:
    cutoff_hz = on(edge).cutoff_hz()
    with pytest.raises(ValueError, match="frequencies_hz must not hold a cut-off"):
        strict(on(edge), FORCE, 0.01, 0.015, cutoff_hz)
    found = strict(on(edge, loss_factor=1e-12), FORCE, 0.01, 0.015, cutoff_hz)
    assert np.isfinite(found.displacement_m[0, 0, 0])
