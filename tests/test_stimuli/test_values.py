"""Fields beside values of 11 to 17 digits from other methods, which also tell if errors are told.

Displacements keep to 1e-5 of the largest one on an endless strip, 2e-4 at a disc's own place and
2e-3 at a point force's own place, and nowhere differ by more than the error that is told.
"""

from __future__ import annotations

import contextlib
import dataclasses
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import stimuli
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    Estimate,
    Load,
    Material,
    MomentRectangle,
    PointForce,
    PressureDisc,
    PressureRectangle,
    Scene,
    Strip,
    causal,
    transient_response,
)
from stimuli.errors import PlateError
from tests.reference.exact import exact
from tests.test_stimuli.plates import (
    EDGES,
    FIRM,
    HANN,
    PLATE,
    SOFT,
    SUPPORTED,
    Edge,
    W,
    at,
    disc,
    force,
    on,
    patch,
    scene_of,
    spring,
)
from tests.test_stimuli.scenes import DETUNINGS, drawn_load, drawn_strip, finite_response

if TYPE_CHECKING:
    from stimuli.arrays import Complex

FREE, HELD = SIMPLY_SUPPORTED, CLAMPED
MIDDLE, FORCE, THIRD = force(), force(0.0, 0.01), W / 3


def strict(
    strip: Strip, load: Load, place_m: tuple[float, float], hz: float, rtol: float | None = None
) -> Estimate[Complex]:
    """Return the displacement at a place and at the load's own, without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return at(strip, load, [place_m, (load.x_m, load.y_m)], hz, rtol)


def check(
    strip: Strip, load: Load, x_m: float, y_m: float, hz: float, known_m: complex, rtol: float
) -> None:
    """Compare with a known displacement, by the largest one and by the error that is told."""
    found = strict(strip, load, (x_m, y_m), hz)
    error_m, largest_m = abs(found.value[0] - known_m), np.abs(found.value).max()
    assert error_m <= found.error[0]
    if abs(x_m - load.x_m) <= load.half_size_m[0] and abs(y_m - load.y_m) <= load.half_size_m[1]:
        rtol = max(rtol, 2e-4 if load.half_size_m[0] else 2e-3)
    assert error_m < rtol * largest_m


Case = tuple[Strip, Load, float, float, float, complex]
# contour integrals checked by modal sums, 11 to 16 digits: strip, load, x, y, frequency, metres
KNOWN: list[Case] = [
    (on(FREE), MIDDLE, 0.02, THIRD, 500, 3.41839995062261560e-6),
    (on(FREE), MIDDLE, 0.0, W / 2, 300, 0.0000135672670270450974),
    (on(FREE), MIDDLE, 0.07, W / 2, 1800, 5.60353703258938617e-6),
    (on(FREE), MIDDLE, 0.02, THIRD, 3000, -9.10503431765439757e-6 - 2.85083830546442905e-6j),
    (on(HELD), MIDDLE, 0.02, THIRD, 500, 2.45835029540878191e-7),
    (on(FIRM), MIDDLE, 0.02, W / 2, 500, 1.27498980958965968e-6),
    (on(HELD), MIDDLE, 0.07, W / 2, 300, 3.70695978412616636e-11),
    (on(FREE), patch(), 0.0, W / 2, 700, -0.0000299428005129164796),
    (on(FIRM), patch(), 0.0, W / 2, 700, -0.0000204732244928532289),
    (on(HELD), patch(), 0.02, THIRD, 700, 5.27460321776807840e-7),
    (on(SOFT), patch(0.010, 0.003), 0.02, W / 2, 700, -4.96422864218509787e-7),
    (on(HELD), patch(0.01, 0.01, kind=PressureRectangle), 0.0, W / 2, 90, 4.32387582593649594e-10),
    (on(FREE), disc(), 0.0, W / 2, 300, -0.0000368781929448345153),
    (on(HELD), disc(), 0.02, W / 2, 300, 4.87718756360166021e-7),
    (on(FIRM), disc(kind=PressureDisc), 0.015, THIRD, 1000, 2.85123274538040810e-10),
    (on(FIRM), disc(0.010), 0.07, W / 2, 500, 1.90256815636891394e-9),
]  # fmt: skip # rows of a table


STEEL = Strip(
    width_m=0.02,
    thickness_m=0.0003,
    material=Material(youngs_modulus_pa=2e11, poisson_ratio=0.29, density_kg_m3=7850.0),
    edge=FREE,
)
F1_HZ = STEEL.cutoff_hz()
HALF_HZ = 896.8434934076143
"""f_1 / 2 of the steel strip to the last digit: there p^2 + k^2 rounds to 0 exactly."""


def steel(edge: Edge) -> Strip:
    return dataclasses.replace(STEEL, edge=edge)


# Residues and integrals in 62-digit arithmetic (tests/reference/exact.py), of the doubles as they
# are, at frequencies where waves meet.
AT_MEETINGS: list[Case] = [
    (steel(FREE), force(0.0, 0.008), 0.004, 0.009, HALF_HZ, 0.000013383171464953033861),
    (steel(FREE), disc(0.005, y_m=0.008), 0.004, 0.009, 4 * HALF_HZ,
     3.6833555743293389811e-6 - 0.000016502133208074983419j),
    (steel(FREE), disc(0.006, y_m=0.008, kind=PressureDisc), 0.004, 0.009, 9 * HALF_HZ,
     -1.5685938807682004574e-10 + 8.0965755708646196299e-11j),
    (steel(FREE), patch(0.005, 0.009, y_m=0.008), 0.004, 0.009, 6 * F1_HZ,
     3.8814808193818823633e-6 - 1.596897146503200222e-6j),
    (steel(HELD), force(0.0, 0.008), 0.004, 0.009, 2 * F1_HZ, 0.00001135519753983808272),
    (steel(HELD), patch(0.009, 0.009, y_m=0.008, kind=PressureRectangle), 0.004, 0.009, 2 * F1_HZ,
     7.8251211266606120683e-10),
    (steel(HELD), disc(0.005, y_m=0.008), 0.004, 0.009, 4.091446734 * F1_HZ,
     5.4926707843431572599e-6 - 7.7049229250667392381e-6j),
    (steel(spring(STEEL, 1e-6)), force(0.0, 0.008), 0.004, 0.009, 4 * HALF_HZ,
     -4.4253315881490253395e-6 + 4.9884989581818799423e-6j),
]  # fmt: skip # rows of a table


def soft(stiffness_n: float) -> Strip:
    return on(ElasticEdge(stiffness_n=stiffness_n))


# The same at rest, at high and low frequencies, with much loss, far away, beside an edge.
HARD: list[Case] = [
    (on(HELD), FORCE, 0.01, 0.015, 0.0, 1.6904412068608964242e-6),
    (soft(1e-4), FORCE, 0.01, 0.015, 1e-6, 7.2391972273326210703e-6),
    (soft(1e8), FORCE, 0.0, 0.015, 1e5, 8.497039984380899035e-8 - 7.9273733993805836335e-8j),
    (on(HELD, loss=0.5), FORCE, 0.01, 0.015, 4366.0969428735,
     2.5888117786604936491e-7 + 3.9291263800908521082e-6j),
    (on(HELD, viscous_s=3.2e-5), FORCE, 0.0, 0.015, 500.0,
     3.9089503433567754074e-6 + 3.9686083383083072187e-7j),
    (SUPPORTED, FORCE, 10.0, 0.015, 3000.0, -8.1349364434035836957e-6 - 5.6170414961127034781e-6j),
    (on(HELD), FORCE, 1.0, 0.015, 500.0, 8.9851645770779736739e-79),
    (on(HELD), disc(0.0064, y_m=0.0064), 0.0, 0.0064, 700.0, -8.4751262849790307475e-6),
    (on(HELD), disc(W / 2, kind=PressureDisc), 0.002, 0.02, 700.0, 4.5303113454787106829e-10),
    (on(HELD), patch(0.006, W), 0.0, 0.01, 700.0, -8.0691595450099391246e-6),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize("case", [*KNOWN, *AT_MEETINGS, *HARD])
def test_endless_strips_have_their_known_displacements(case: Case) -> None:
    check(*case, rtol=1e-5)


# Residues and integrals in 62-digit arithmetic again: beside cut-offs without loss, where rounding
# decides, and at loads, where two bases may agree by chance.
UNCERTAIN: list[Case] = [
    (soft(1e-6), disc(0.0025, y_m=0.0118), 0.02, 0.012, 1926.03129239, -0.017993008504007875),
    (on(FIRM), patch(0.0044, 0.0009, y_m=0.0031), 0.02, 0.012, 2899.99995616,
     0.0006446884643704717),
    (soft(1e6), disc(0.0023, y_m=0.003), 0.02, 0.012, 12033.7881186,
     0.0006299052920120168 + 6.512780691997526e-9j),
    (soft(1e6), patch(0.0021, 0.0163, y_m=0.0093), 0.02, 0.012, 23591.0365294,
     -0.00157666669531885 + 6.14701385706971e-7j),
    (on(HELD), disc(0.0016, y_m=0.0038), 0.0016, 0.0038, 5900.0,
     -1.4266881540697591e-6 + 8.723070579366068e-8j),
    (soft(1e-6), disc(0.0015, y_m=0.0098), 0.0015, 0.0098, 7193.0,
     -2.081381853489769e-6 - 7.142739621704535e-7j),
    (on(HELD), patch(0.0073, 0.0114, y_m=0.0062), 0.00365, 0.0062, 19620.0,
     2.1800106782819377e-6 - 2.3773111148852866e-6j),
    (on(FREE), disc(0.0003, y_m=0.011), 0.0, 0.01115, 1157.0, -2.663810247567964e-7),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize("case", UNCERTAIN)
def test_errors_are_told_or_the_field_refused_whatever_the_tolerance(case: Case) -> None:
    strip, load, *place_m, hz, known_m = case
    scene = scene_of(strip, load, tuple(place_m))
    for rtol in (None, *(digit * 10.0**-n for n in (2, 3, 4) for digit in (5, 2, 1))):
        with contextlib.suppress(PlateError):
            found = stimuli.response(scene, [hz], rtol)
            assert abs(found.value[0, 0, 0] - known_m) <= found.error[0, 0, 0], rtol


# Galerkin models of 20 and of 13 polynomials along x, 12 digits, and closed forms between simple
# supports in 62-digit arithmetic.
SMALL, SIDE = patch(0.005, 0.015), patch(x_m=0.035)
BETWEEN, SHORT = on(FREE, 0.2, loss=0.01), on(FREE, 0.01, loss=0.01)
PIECE = dataclasses.replace(STEEL, length_m=0.09)
WITH_ENDS: list[Case] = [
    (BETWEEN, SMALL, 0.0, W / 2, 500, -2.3061331585288091e-05 - 2.3781071148572299e-07j),
    (BETWEEN, SMALL, 0.02, 0.0075, 500, -1.9807964221232675e-06 - 2.2596465628158454e-08j),
    (on(HELD, 0.2, loss=0.01), SMALL, 0.02, 0.0075, 500,
     2.9940554851240411e-07 + 2.9637063653468444e-09j),
    (BETWEEN, SIDE, 0.035, W / 2, 2600, -5.1185572302677408e-05 - 2.7009407165357262e-05j),
    (BETWEEN, SIDE, -0.035, W / 2, 2600, 2.6159621413215560e-05 + 2.4654961487232427e-05j),
    (PIECE, force(0.0, 0.008), 0.004, 0.009, HALF_HZ, 0.00001338698332957479581),
    (PIECE, patch(0.005, 0.009, y_m=0.008, kind=PressureRectangle), 0.004, 0.009, 6 * F1_HZ,
     -5.4241522476190042981e-11),
    (SHORT, patch(), 0.004, 0.015, 500.0, -4.1306146150527622365e-5 - 4.5014899995927912738e-7j),
    (SHORT, patch(), 0.005, 0.015, 2600.0, 4.9621004125186861011e-5 - 3.2650021382847260967e-7j),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize("case", WITH_ENDS)
def test_plates_with_ends_have_their_known_displacements(case: Case) -> None:
    check(*case, rtol=1e-4)


RESONANCES: list[tuple[float, float]] = [
    (1855.3717637737934, -1786540.5855058897),
    (1855.3736191453718, -0.17840305856308455),
    (2102.011768801214, -6496.5916632397499),
    (2102.0138706027815, -0.64966897905757652),
]


@pytest.mark.parametrize(("hz", "known_m"), RESONANCES)
def test_beside_a_resonance_without_loss_the_error_is_told_or_the_field_refused(
    hz: float, known_m: float
) -> None:
    scene = scene_of(PIECE, force(0.003, 0.008), (0.02, 0.009))
    found = finite_response(scene, hz)
    if found is None:
        assert abs(known_m) > 1e3
    else:
        assert abs(found.value[0, 0, 0] - known_m) <= found.error[0, 0, 0] < abs(known_m)


@pytest.mark.parametrize("edge", EDGES)
def test_a_small_load_that_bends_the_plate_tells_what_its_basis_does_not_resolve(
    edge: Edge,
) -> None:
    """Its own place moves by the logarithm of its size: compare a quarter of the size."""
    for length_m in (None, 0.1):
        strip = on(edge, length_m)
        for size_m in (1e-3, 1e-5, 1e-8):
            whole, parts = (
                at(strip, patch(a, a, y_m=0.01), [(0.0, 0.01)], 700.0) for a in (size_m, size_m / 4)
            )
            # In a free plane u grows as -a^2 / (2 pi D) times the logarithm of the size a.
            grown_m = whole.value[0] / size_m**2 - 16 * parts.value[0] / size_m**2
            true_m = np.log(4) / (2 * np.pi * strip.bending_stiffness_n_m)
            slack_m = (whole.error[0] + 16 * parts.error[0]) / size_m**2
            assert abs(grown_m - true_m) <= slack_m + 0.01 * true_m


# --- the evaluator of forty digits ---------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("part", [0.04, 0.05, 0.1])
@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED], ids=["clamped", "supported"])
@pytest.mark.parametrize("touches", [False, True])
def test_errors_are_told_next_to_an_edge(edge: Edge, part: float, *, touches: bool) -> None:
    """Of a force, and of a disc that touches the edge."""
    y_m = part * W / 2
    load = disc(y_m, y_m=y_m) if touches else force(0.0, y_m)
    found = stimuli.response(scene_of(on(edge), load, (0.0, y_m)), [700.0])
    true_m = complex(exact(on(edge), load, 0.0, y_m, 700.0))
    assert abs(found.value[0, 0, 0] - true_m) <= found.error[0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize("from_end_m", [0.0004, 0.0])
def test_loads_at_an_end_have_values_too(from_end_m: float) -> None:
    strip, load = on(FREE, 0.05), force(0.025 - from_end_m, 0.006)
    check(strip, load, 0.0, W / 2, 700.0, complex(exact(strip, load, 0.0, W / 2, 700.0)), 1e-4)


def check_told_errors(seed: int) -> None:
    """Compare a drawn scene with forty digits: any endless strip, or a supported one with ends."""
    rng = np.random.default_rng(seed)
    strip = drawn_strip(rng)
    if strip.length_m:
        strip = dataclasses.replace(strip, edge=FREE)
    load, kind = drawn_load(rng, strip), int(rng.integers(3))
    hz = (strip.exceptional_point_hz(), strip.cutoff_hz(2), strip.cutoff_hz())[kind]
    hz = hz * (1 + rng.choice(DETUNINGS)) if rng.random() < 0.5 else 5 * rng.random() * hz
    end_m = strip.length_m / 2 if strip.length_m else 3 * strip.width_m
    place_m = end_m * rng.uniform(-1, 1), strip.width_m * rng.uniform()
    scene = scene_of(strip, load, place_m, (load.x_m, load.y_m))
    found = finite_response(scene, float(hz))
    if found is None:
        return
    for number, (x_m, y_m) in enumerate(scene.points_m):
        true_m = complex(exact(strip, load, x_m, y_m, float(hz)))
        assert abs(found.value[0, 0, number] - true_m) <= found.error[0, 0, number], (seed, number)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_errors_are_told_of_drawn_strips_at_and_beside_meetings(seed: int) -> None:
    check_told_errors(seed)


# --- over time -----------------------------------------------------------------------------------

TAU = 8.264e-7
# time synthesis along two lines at two rates, 6 to 8 digits of the peak; the spring has the
# plate's loss
OVER_TIME = [
    (ElasticEdge(stiffness_n=178.752842326547 * PLATE.bending_stiffness_n_m, lossless=False), 0.0,
     1.760711e-05, (-1.72317486535442e-07, 5.57509787660388e-08)),
    (CLAMPED, 0.02, 5.766769e-07, (-8.88061820623136e-10, -1.36217266004044e-09)),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize(("edge", "x_m", "peak_m", "true_m"), OVER_TIME)
def test_a_patch_moves_as_known(
    edge: Any, x_m: float, peak_m: float, true_m: tuple[float, ...]
) -> None:
    scene = scene_of(on(edge, viscous_s=TAU), patch(), (x_m, W / 2))
    found = transient_response(scene, HANN, [0.001, 0.002])
    apart_m = np.abs(found.value[:, 0, 0] - true_m)
    assert np.all(apart_m <= found.error[:, 0, 0])
    assert np.all(apart_m < 1e-3 * peak_m)


def test_a_constant_loss_is_refused_over_time() -> None:
    scene = scene_of(on(CLAMPED, loss=0.01), patch(), (0.0, W / 2))
    with pytest.raises(ValueError, match="loss_factor"):
        transient_response(scene, HANN, [0.001])
    steady = dataclasses.replace(scene, strip=causal(scene.strip, HANN))
    assert transient_response(steady, HANN, [0.001]).value.any()


@pytest.mark.parametrize(
    ("width_m", "length_m", "edge", "load", "point_m", "frequency_hz", "known_m"),
    [
        (
            *(0.05, 0.1, SIMPLY_SUPPORTED),
            MomentRectangle(x_m=0.0, y_m=0.02, length_x_m=0.001, length_y_m=0.02),
            *((-0.004172123, 0.024638052), 500.0, 1.10001e-5),
        ),
        (
            *(0.025, 0.2, SIMPLY_SUPPORTED),
            PointForce(x_m=-0.035, y_m=0.005),
            *((-0.055749483, 0.001725602), 500.0, 4.90396e-7),
        ),
    ],
)
def test_errors_are_told_where_the_bases_agree_by_chance(
    width_m: float,
    length_m: float,
    edge: Edge,
    load: Load,
    point_m: tuple[float, float],
    frequency_hz: float,
    known_m: float,
) -> None:
    """Real parts by the 40-digit evaluator, at points between ripples of both bases."""
    material = Material(
        youngs_modulus_pa=67e9, poisson_ratio=0.346, density_kg_m3=2700.0, loss_factor=0.01
    )
    strip = Strip(
        width_m=width_m, thickness_m=0.5e-3, material=material, edge=edge, length_m=length_m
    )
    field = stimuli.response(Scene(strip=strip, loads=(load,), points_m=(point_m,)), [frequency_hz])
    assert abs(field.value[0, 0, 0].real - known_m) <= field.error[0, 0, 0] < 0.15 * known_m
