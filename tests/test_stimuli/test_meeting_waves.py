"""Where a wave meets a branch, a wave or a resonance: finite values, and errors that are told."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp
from scipy.optimize import brentq

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
    Scene,
    Strip,
    response,
)
from stimuli.solver.across import Span, lag, shape, shape_integral, supported_kernel
from tests.long.test_fuzz import rounds
from tests.test_stimuli.plates import Edge, disc, force, patch, scene_of

if TYPE_CHECKING:
    from stimuli import Response
    from stimuli.arrays import Complex
    from stimuli.solver.ends.reflection import Reflection
    from stimuli.solver.guided import Guided

FREE, HELD = SIMPLY_SUPPORTED, CLAMPED
STEEL = Strip(
    width_m=0.02,
    thickness_m=0.0003,
    material=Material(youngs_modulus_pa=2e11, poisson_ratio=0.29, density_kg_m3=7850.0),
    edge=FREE,
)
F1_HZ = STEEL.cutoff_hz()
POINTS = ((0.0, 0.41), (0.05, 0.3), (0.0, 0.5), (0.3, 0.9), (0.95, 0.22), (2.5, 0.4))
"""Inside the patches, at an edge of some, beside them and far from them, in widths."""

MEETINGS = (0.5, 1.0, 2.0, 2.5, 3.0, 4.0, 4.091446734, 4.5, 6.0, 8.0, 12.0)
"""First cut-offs of the supported strip at which a branch is flat, n^2 / 2 and 2 n^2, two orders
meet, (n^2 - m^2) / 2, or a wave is at rest, n^2."""

DETUNINGS = (0.0, 1e-15, -1e-15, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6)
REFUSED = r"must not hold a (cut-off|resonance) of a"


def on_width(width_m: float, y: float = 0.41) -> tuple[Load, ...]:
    """One load of each kind, at a place across the strip in widths."""
    place: dict[str, Any] = {"y_m": y * width_m}
    size = 0.2 * width_m, 0.4 * width_m
    return (
        force(0.0, y * width_m),
        disc(size[0], **place),
        disc(0.3 * width_m, kind=PressureDisc, **place),
        patch(*size, **place),
        patch(*size, kind=PressureRectangle, **place),
        patch(*size, kind=ForceRectangle, **place),
    )


def points(width_m: float) -> tuple[tuple[float, float], ...]:
    return tuple((x * width_m, y * width_m) for x, y in POINTS)


def drawn(rng: np.random.Generator, **changed: Any) -> Strip:
    """A strip of a material and size that no default has."""
    material = Material(
        youngs_modulus_pa=float(np.round(10 ** rng.uniform(9.3, 11.6), -6)),
        poisson_ratio=float(np.round(rng.uniform(0, 0.45), 3)),
        density_kg_m3=float(np.round(rng.uniform(900, 9000))),
        loss_factor=changed.pop("loss", 0.0),
    )
    width_m = float(np.round(rng.uniform(0.01, 0.06), 4))
    thickness_m = float(np.round(width_m * rng.uniform(0.005, 0.05), 5))
    strip = Strip(width_m=width_m, thickness_m=thickness_m, material=material, edge=FREE)
    return dataclasses.replace(strip, **changed)


def sprung(strip: Strip, grip: float) -> ElasticEdge:
    """An edge with kappa W = grip."""
    return ElasticEdge(stiffness_n=grip * strip.bending_stiffness_n_m / strip.width_m)


def found(scene: Scene, frequency_hz: float, rtol: float = 1e-6) -> Response | None:
    """The response, without a warning, or none where it is refused as infinite."""
    try:
        with np.errstate(divide="raise", invalid="raise"):
            return response(scene, [frequency_hz], rtol)
    except ValueError as error:
        if re.search(REFUSED, str(error)):
            return None
        raise


def is_finite(answer: Response | None) -> bool:
    return answer is None or bool(
        np.all(np.isfinite(answer.displacement_m)) and np.all(np.isfinite(answer.error_m))
    )


@pytest.mark.slow
@pytest.mark.parametrize("meeting", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("edge", [FREE, HELD], ids=["supported", "clamped"])
def test_no_material_gives_nan_at_and_beside_a_meeting(edge: Edge, meeting: float) -> None:
    rng, loads = np.random.default_rng(31), len(on_width(1.0))
    for number in range(24):
        strip = drawn(rng)
        f_hz = meeting * strip.cutoff_hz() * (1 + DETUNINGS[number % 9 if number % 2 else 0])
        strip, width_m = dataclasses.replace(strip, edge=edge), strip.width_m
        load = on_width(width_m)[number % loads]
        answer = found(scene_of(strip, load, *points(width_m)), f_hz)
        assert is_finite(answer)
        assert answer or (edge is FREE and meeting == 1.0)


@pytest.mark.parametrize("meeting", [0.5, 1.0 + 1e-6, 2.0, 4.5, 6.0])
def test_nor_does_one_of_a_strip_with_ends(meeting: float) -> None:
    rng = np.random.default_rng(32)
    for number in range(8):
        strip = drawn(rng, loss=0.02 * (number % 2))
        f_hz = meeting * strip.cutoff_hz()
        width_m = strip.width_m
        strip = dataclasses.replace(strip, length_m=float(rng.uniform(2.5, 7)) * width_m)
        scene = scene_of(strip, on_width(width_m)[number % 6], *points(width_m)[:5])
        assert is_finite(found(scene, f_hz))


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    seed=st.integers(0, 2**32),
    edge=st.one_of(st.sampled_from([FREE, HELD]), st.floats(-15, 4)),
    loss=st.sampled_from([0.0, 0.0, 1e-12, 1e-6, 0.02]),
    length=st.sampled_from([None, None, None, 2.7, 6.1]),
    meeting=st.one_of(st.sampled_from(MEETINGS), st.sampled_from(["cut-off", "exceptional"])),
    detuning=st.one_of(st.sampled_from(DETUNINGS), st.floats(-15, -3).map(lambda e: 10**e)),
    y=st.sampled_from([0.41, 0.5]),
    rtol=st.sampled_from([1e-3, 1e-6, 1e-10]),
)
def test_no_strip_gives_nan_at_or_beside_any_meeting(
    seed: int,
    edge: Any,
    loss: float,
    length: float | None,
    meeting: float | str,
    detuning: float,
    y: float,
    rtol: float,
) -> None:
    rng = np.random.default_rng(seed)
    strip = drawn(rng, loss=loss)
    f_hz, width_m = strip.cutoff_hz(), strip.width_m
    edge = sprung(strip, 10**edge) if isinstance(edge, float) else edge
    strip = dataclasses.replace(strip, edge=edge)
    if meeting == "cut-off":
        f_hz = strip.cutoff_hz(int(rng.integers(1, 5)))
    elif meeting == "exceptional":
        f_hz = strip.exceptional_point_hz() or f_hz / 2
    else:
        f_hz *= float(meeting)
    strip = dataclasses.replace(strip, length_m=length and length * width_m)
    loads, places = on_width(width_m, y), points(width_m)
    if length:
        loads, places = (loads[rng.integers(6)],), places[:5]
    assert is_finite(found(scene_of(strip, loads, *places), f_hz * (1 + detuning), rtol))


def meetings(strip: Strip) -> list[float]:
    """Frequencies at which a wave of the strip has a flat branch, p^2 = -k^2."""
    grip = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    hold = strip.bending_stiffness_n_m / (grip * strip.width_m) if grip else 0.0

    def symmetric(t: float) -> float:
        return 2 * t * hold * math.cos(t) + math.sin(t)

    def antisymmetric(t: float) -> float:
        return (2 * t * t * hold + 1) * math.sin(t) - t * math.cos(t)

    places = []
    for relation in (symmetric, antisymmetric):
        t = np.linspace(0.2, 7.0, 300)
        values = [relation(a) for a in t]
        for low, high, before, after in zip(t, t[1:], values, values[1:], strict=False):
            if before * after < 0:
                places.append(float(brentq(relation, low, high, xtol=1e-15)))
    supported_hz = dataclasses.replace(strip, edge=FREE).cutoff_hz()
    return [2 * (t / math.pi) ** 2 * supported_hz for t in places]


@pytest.mark.parametrize(
    ("seed", "strips"),
    [
        pytest.param(34, 4, marks=pytest.mark.slow),
        pytest.param(33, rounds(40), marks=pytest.mark.long),
    ],
)
def test_the_estimate_is_above_the_error_at_and_beside_a_meeting(seed: int, strips: int) -> None:
    """Against forty digits: endless strips of any edge, and supported ones with ends."""
    rng = np.random.default_rng(seed)
    for _ in range(strips):
        strip = drawn(rng, loss=float(rng.choice([0.0, 0.0, 1e-6, 0.02])))
        f1_hz, width_m = strip.cutoff_hz(), strip.width_m
        kind = rng.integers(5)
        edge = (FREE, FREE, HELD, sprung(strip, 10 ** rng.uniform(-9, 2)), HELD)[kind]
        length_m = float(rng.uniform(2.5, 6)) * width_m if kind == 0 else None
        strip = dataclasses.replace(strip, edge=edge, length_m=length_m)
        flat_hz = [] if edge is FREE else meetings(strip)
        f_hz = float(rng.choice(flat_hz or [n * f1_hz for n in (0.5, 2, 4.5, 6, 8)]))
        f_hz *= 1 + float(rng.choice([0, *DETUNINGS, 1e-4]))
        load = on_width(width_m, float(rng.choice([0.41, 0.5])))[rng.integers(6)]
        x_m, y_m = points(width_m)[rng.integers(5)]
        answer = found(scene_of(strip, load, (x_m, y_m)), f_hz, float(rng.choice([1e-3, 1e-6])))
        if answer:
            true_m = complex(exact(strip, load, x_m, y_m, f_hz))
            assert abs(answer.displacement_m[0, 0, 0] - true_m) < answer.error_m[0, 0, 0]


HALF_HZ = 896.8434934076143
"""f_1 / 2 of the steel strip to the last digit: there p^2 + k^2 rounds to 0 exactly."""

# Residues and integrals in 62-digit arithmetic (benchmarks/exact.py), of the doubles as they are.
VALUES: list[tuple[Edge, float | None, float, Load, complex]] = [
    (FREE, None, HALF_HZ, force(0.0, 0.008), 0.000013383171464953033861),
    (
        FREE,
        None,
        4 * HALF_HZ,
        disc(0.005, y_m=0.008),
        3.6833555743293389811e-6 - 0.000016502133208074983419j,
    ),
    (
        FREE,
        None,
        9 * HALF_HZ,
        disc(0.006, y_m=0.008, kind=PressureDisc),
        -1.5685938807682004574e-10 + 8.0965755708646196299e-11j,
    ),
    (
        FREE,
        None,
        6 * F1_HZ,
        patch(0.005, 0.009, y_m=0.008),
        3.8814808193818823633e-6 - 1.596897146503200222e-6j,
    ),
    (FREE, 0.09, HALF_HZ, force(0.0, 0.008), 0.00001338698332957479581),
    (
        FREE,
        0.09,
        6 * F1_HZ,
        patch(0.005, 0.009, y_m=0.008, kind=PressureRectangle),
        -5.4241522476190042981e-11,
    ),
    (HELD, None, 2 * F1_HZ, force(0.0, 0.008), 0.00001135519753983808272),
    (
        HELD,
        None,
        2 * F1_HZ,
        patch(0.009, 0.009, y_m=0.008, kind=PressureRectangle),
        7.8251211266606120683e-10,
    ),
    (
        HELD,
        None,
        4.091446734 * F1_HZ,
        disc(0.005, y_m=0.008),
        5.4926707843431572599e-6 - 7.7049229250667392381e-6j,
    ),
    (
        sprung(STEEL, 1e-6),
        None,
        4 * HALF_HZ,
        force(0.0, 0.008),
        -4.4253315881490253395e-6 + 4.9884989581818799423e-6j,
    ),
]


@pytest.mark.parametrize("case", VALUES)
def test_values_at_a_meeting_are_right_to_the_tolerance(
    case: tuple[Edge, float | None, float, Load, complex],
) -> None:
    edge, length_m, f_hz, load, true_m = case
    strip = dataclasses.replace(STEEL, edge=edge, length_m=length_m)
    answer = found(scene_of(strip, load, (0.004, 0.009)), f_hz, 1e-10)
    assert answer
    error_m = abs(answer.displacement_m[0, 0, 0] - true_m)
    assert error_m < 1e-10 * abs(true_m)
    assert error_m < answer.error_m[0, 0, 0] < 1e-9 * abs(true_m)


RESONANCES: list[tuple[float, float]] = [
    (1855.3717637737934, -1786540.5855058897),
    (1855.3717639591453, -1783.6933425155413),
    (1855.3736191453718, -0.17840305856308455),
    (2102.0117685912232, -6501685.7015048337),
    (2102.011768801214, -6496.5916632397499),
    (2102.0138706027815, -0.64966897905757652),
]


@pytest.mark.parametrize("case", RESONANCES)
def test_beside_a_resonance_without_loss_the_estimate_tells_the_digits_that_are_lost(
    case: tuple[float, float],
) -> None:
    f_hz, true_m = case
    strip = dataclasses.replace(STEEL, length_m=0.09)
    answer = found(scene_of(strip, force(0.003, 0.008), (0.02, 0.009)), f_hz, 1e-8)
    assert answer
    error_m, told_m = abs(answer.displacement_m[0, 0, 0] - true_m), answer.error_m[0, 0, 0]
    assert error_m < told_m < 1e4 * max(error_m, 1e-12 * abs(true_m))


def test_a_resonance_without_loss_is_refused_where_the_field_is_infinite(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """To the last digit no resonance is met by a number: one is put in."""
    import stimuli.solver.ends.ends

    inside, k = stimuli.solver.ends.ends._works, math.pi * math.sqrt(1.1)

    def resonant(at_k: Complex, waves: Guided, poisson_ratio: float) -> Reflection:
        found = inside(at_k, waves, poisson_ratio)
        here = np.abs(waves.g2**2 - waves.g1**2 - 2 * k * k)[:, :1, np.newaxis] < 1e-6
        return dataclasses.replace(
            found,
            leaving=np.where(here, 0, found.leaving),
            arriving=np.where(here, 0, found.arriving),
        )

    monkeypatch.setattr(stimuli.solver.ends.ends, "_works", resonant)
    scene = scene_of(dataclasses.replace(STEEL, length_m=0.09), force(0.003, 0.008), (0.02, 0.009))
    f_hz = 1.1 * F1_HZ
    with pytest.raises(ValueError, match=f"{REFUSED} finite strip without loss.*{f_hz!r}"):
        response(scene, [F1_HZ / 3, f_hz, 1.2 * F1_HZ])


def own(g: Any, y: Any, sign: int) -> Any:
    """cosh(g y) or sinh(g y) / g, (73)."""
    return mp.cosh(g * y) if sign > 0 else mp.sinh(g * y) / g


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("span", [Span(centre=-0.09), Span(centre=-0.09, length=0.4)])
def test_a_branch_keeps_its_digits_however_flat_it_is(span: Span, sign: int) -> None:
    """Against hyperbolic functions of many digits, (73) and (74), from flat to steep."""
    across, turns = np.array([-0.5, -0.31, 0.0, 0.05, 0.37]), (1, 1j, 0.6 + 0.8j)
    for g in [
        0j,
        *(size * turn for size in (1e-12, 1e-6, 1e-3, 0.29, 0.31, 2.0) for turn in turns),
    ]:
        with mp.workdps(90):
            fine, scale = mp.mpc(g or 1e-30), mp.exp(-mp.mpc(g) / 2)
            middle, half = mp.mpf(span.low + span.high) / 2, mp.mpf(span.high - span.low) / 2
            load, end = own(fine, middle, sign), own(fine, mp.mpf(0.5), sign)
            if span.length:
                load *= 2 * own(fine, half, -1)
            steep = own(fine, mp.mpf(0.5), -sign) / end * (fine**2 if sign > 0 else 1)
            shapes = [complex(own(fine, mp.mpf(float(y)), sign) * scale) for y in across]
            told = complex(load * scale), complex(sign * (fine - steep))
        here = np.array([g])
        np.testing.assert_allclose(shape(here[:, None], across, sign)[0], shapes, 1e-14, 1e-16)
        np.testing.assert_allclose(shape_integral(here, span, sign)[0], told[0], 1e-14)
        np.testing.assert_allclose(lag(here, sign)[0], told[1], 2e-15 / min(abs(g) or 1, 1), 1e-15)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("span", [Span(centre=-0.09), Span(centre=-0.09, length=0.4)])
def test_the_kernel_is_smooth_where_its_form_changes(span: Span, sign: int) -> None:
    across = np.array([-0.31, 0.05, 0.37])
    below, above = (
        supported_kernel(np.array([[0.3 * (1 + d) * 1j]]), across, span, sign)
        for d in (-1e-13, 1e-13)
    )
    np.testing.assert_allclose(below, above, 3e-12)
    flat = supported_kernel(np.array([[0j], [1e-9 + 0j]]), across, span, sign)
    np.testing.assert_allclose(flat[0], flat[1], 1e-14)
