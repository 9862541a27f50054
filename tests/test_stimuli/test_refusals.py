"""What strip, loads, drives and fields do not take, refused by name, and the last they take."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    Burst,
    ElasticEdge,
    ForceRectangle,
    Impedance,
    MeasuredDisplacement,
    PiezoLayers,
    PointForce,
    PressureDisc,
    PressureRectangle,
    SampledDrive,
    Scene,
    causal,
    check_burst,
    displacement,
    displacement_map,
    felt,
    level_db,
    load_per_volt,
    response,
    shortest_window,
    staircase_energy_above,
    transient,
)
from stimuli.drive.noise import crest_factor, pink_loop
from stimuli.errors import PlateError, Rule
from tests.test_stimuli.plates import DISCS, PLATE, SUPPORTED, TIPS, W, disc, force, patch

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    Call = Callable[[Any], object]

change = dataclasses.replace
NONE: tuple[Any, ...] = (math.nan, math.inf, True, "1", None)
"""What is no number at all."""

BURST = Burst(frequency_hz=500.0)
SHORT = change(PLATE, length_m=0.2)
SCENE = Scene(strip=PLATE, loads=(force(),), points_m=((0.0, W / 2),))
FINITE = change(SCENE, strip=SHORT)
MOVING = change(SCENE, strip=SUPPORTED)
PRESSING = Impedance(mass_kg=3e-4, stiffness_n_m=600.0, damping_n_s_m=1.5, holds_up_to_hz=1000.0)
TIP = TIPS[1]
MEASURED = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
LAYERS = PiezoLayers(
    thickness_m=2.5e-4, youngs_modulus_pa=6.2e10, poisson_ratio=0.34, d31_m_v=-1.8e-10
)
LOADS = [
    force(),
    *(disc(), disc(kind=PressureDisc)),
    *(patch(), patch(kind=PressureRectangle), patch(kind=ForceRectangle)),
]
MATRIX_M = [[2e-6, 1e-7, 5e-7], [2e-7, 3e-6, 6e-7]]


def noise(**changed: Any) -> object:
    usual = {"sample_rate_hz": 48e3, "loop_s": 1.0, "level_dbfs": -30.0}
    return pink_loop(**{"rng": np.random.default_rng(1), **usual, **changed})


def plate_map(**changed: Any) -> object:
    usual = {"strip": PLATE, "loads": (force(),), "frequency_hz": 500.0, "x_m": [0], "y_m": [0.01]}
    return displacement_map(**{**usual, **changed})


def window(wanted_db: Any = -20.0, burst: Any = BURST, discs: Any = DISCS, tips: Any = TIPS) -> Any:
    return shortest_window(PLATE, discs, tips, burst, wanted_db=wanted_db)


def click(samples: Any = (0, 1, 0), rate_hz: Any = 1e3, *, held: Any = False) -> SampledDrive:
    return SampledDrive(samples=samples, sample_rate_hz=rate_hz, held=held)


def samples_of(values: Any, rate_hz: Any = 48e3, frequency_hz: Any = 1900.0) -> object:
    return staircase_energy_above(values, sample_rate_hz=rate_hz, frequency_hz=frequency_hz)


def fields(valid: Any, bounds: str, values: Iterable[Any]) -> list[tuple[Call, Iterable[Any], str]]:
    """A row for each field of a value."""
    names = [field.name for field in dataclasses.fields(valid)]

    def changed(name: str) -> Call:
        return lambda value: change(valid, **{name: value})

    return [(changed(name), values, f"{name} {bounds}") for name in names]


CLICK = click()
BESIDE_EDGES_M = 0.0, 0.019 * W, 0.981 * W, W

REFUSED: list[tuple[Call, Iterable[Any], str]] = [
    # strip, material, edge
    *fields(ALUMINIUM, "", (*NONE, -math.inf, 1j, np.array([1.0]), -1.0)),
    (lambda v: change(ALUMINIUM, poisson_ratio=v), (0.5,), "poisson_ratio"),
    (lambda v: change(PLATE, width_m=v), (*NONE, 0.0, -W), "width_m"),
    (lambda v: change(PLATE, thickness_m=v), (*NONE, 0.0, -W), "thickness_m"),
    (lambda v: change(PLATE, length_m=v), (*NONE[:4], 0.0, -W), "length_m"),
    (lambda v: change(PLATE, edge=v), ("clamped",), "edge"),
    (lambda v: change(PLATE, material=v), ("steel",), "material"),
    (lambda v: ElasticEdge(stiffness_n=v), (*NONE, -1e-9), "stiffness_n"),
    (lambda v: ElasticEdge(stiffness_n=1.0, lossless=v), ("no",), "lossless"),
    (PLATE.cutoff_hz, (0, -1, 1.0, 10_001, *NONE), "mode 1 10000"),
    (lambda v: PLATE.mode_shape(v, 0.01), (0, 1.0, True), "mode 1"),
    (SUPPORTED.with_cutoff, (SUPPORTED.cutoff_hz(), PLATE.cutoff_hz(), 100.0, 5000.0),
     "1926.031369 4366.096943"),
    (lambda v: PLATE.mode_shape(v, 0.01), (101,), "mode 1 100"),
    (lambda v: change(SCENE, loads=(force(0.0, v),)), BESIDE_EDGES_M, "loads 0.0005 edges"),
    (PLATE.wavenumbers_rad_m, (-1.0, 1e300, *NONE), "frequency_hz 0"),
    (lambda v: PLATE.wavenumbers_rad_m(5.0, symmetry=v), ("even",), "symmetry"),
    (lambda v: PLATE.wavenumbers_rad_m(5.0, v), (0, 101, 1.0, True), "n_modes 1 100"),
    (lambda v: PLATE.mode_shape(1, v), (-1e-6, 0.0251), "y_m 0 0.025"),
    (lambda v: PLATE.mode_shape(1, v), ([0.01, math.nan], "a", [True]), "y_m"),
    # loads
    *(row for load in LOADS for row in fields(load, "", (*NONE, 1e4))),
    *((lambda v, load=load: change(load, y_m=v), (-1e-9,), "y_m 0") for load in LOADS),
    *(row for load in LOADS for row in fields(load, "", (0.0,))[2:]),
    # drives
    (lambda v: Burst(frequency_hz=v), (0.0, -500.0, 1e12, *NONE), "frequency_hz"),
    (lambda v: change(BURST, cycles=v), (0, -1, 1.0, 1.5, 10**7, *NONE), "cycles 1 1000000"),
    (lambda v: change(BURST, window=v), ("Hann", "", None, 1, ["hann"]),
     "window hann tukey gaussian"),
    (BURST.samples, (1999.0, 0.0, -48e3, *NONE), "sample_rate_hz 2000"),
    (BURST.samples, (5e9,), "10000000 0.002"),
    (Burst(frequency_hz=1e-6, cycles=1_000_000).samples, (1e300,), "10000000"),
    (BURST.spectrum, ([1.0, math.nan], [math.inf], "500", [True], -1j, None), "frequencies_hz"),
    (BURST.spectrum, ([1e300], -1e18), "frequencies_hz 5e+17"),
    (BURST.energy_above, (-1.0, 1.01e15 / BURST.duration_s, *NONE), "frequency_hz 0 5e+17"),
    (click, ([], [0.0, 0.0], [0.0] * 3, [[0.0, 1.0, 0.0]]), "samples 3 1000000"),
    (click, ([0.0, math.nan, 0.0], "click", None, [1j]), "samples"),
    (click, ([1, 1, 0],), "samples 0 1.0 0.0"),
    (lambda v: click(rate_hz=v), (0.0, -1.0, *NONE), "sample_rate_hz"),
    (lambda v: click(held=v), (1,), "held"),
    (CLICK.samples, (48e3,), "sample_rate_hz 1000.0"),
    (CLICK.spectrum, ([1.0 - 1j], [math.nan], [complex(1, math.inf)], "5", None), "frequencies_hz"),
    (CLICK.energy_above, (-1.0, *NONE), "frequency_hz 0"),
    (samples_of, ([], [0.0, 0.0], [[1.0]]), "samples 0"),
    (samples_of, ([math.nan], "click", None), "samples"),
    (lambda v: samples_of([1.0], v), (0.0, -1.0, *NONE), "sample_rate_hz 0"),
    (lambda v: samples_of([1.0], 48e3, v), (-1.0, 1e300, *NONE), "frequency_hz 0 4.8e+19"),
    (lambda v: check_burst(v, PLATE), ("a burst", None), "burst"),
    (lambda v: check_burst(BURST, v), ("a plate", None), "strip"),
    (lambda v: check_burst(BURST, PLATE, sample_rate_hz=v), (1e3,), "sample_rate_hz 2000"),
    (lambda v: check_burst(CLICK, PLATE, sample_rate_hz=v), (48e3,), "1000"),
    (lambda v: check_burst(BURST, PLATE, max_energy_above_cutoff=v), (-0.1, 1.1, *NONE),
     "max_energy_above_cutoff 0 1"),
    (lambda v: noise(sample_rate_hz=v), (7_999.0, 193e3, *NONE), "sample_rate_hz 8000 192000"),
    (lambda v: noise(loop_s=v), (0.5, 601.0, *NONE), "loop_s 1"),
    (lambda v: noise(level_dbfs=v), (-71.0, 0.1, *NONE), "level_dbfs"),
    (lambda v: noise(rng=v), (1,), "rng"),
    (crest_factor, ([], [0.0, 0.0], [1.0, math.nan]), "samples"),
    # scenes and fields
    (lambda v: change(SCENE, strip=v), ("strip",), "strip"),
    (lambda v: change(SCENE, loads=v), ((), None, "ab", 1.0), "loads"),
    (lambda v: change(SCENE, loads=(v,)), ("load",), "loads"),
    (lambda v: change(SCENE, loads=(v,)),
     (force(0.0, 0.0251), disc(0.0064, y_m=0.005), patch(0.01, 0.011, y_m=0.02)), "loads"),
    (lambda v: change(SCENE, loads=(v,)), (disc(0.0126, kind=PressureDisc), patch(0.01, 0.026)),
     "loads"),
    (lambda v: change(FINITE, loads=(v,)),
     (force(0.1000001), disc(0.0051, x_m=-0.095), patch(0.021, 0.01, x_m=0.09)), "loads"),
    (lambda v: change(SCENE, points_m=v), ((), None, "ab", 1.0), "points_m"),
    (lambda v: change(SCENE, points_m=(v,)), ((0.0,), 3), "points_m"),
    (lambda v: change(SCENE, points_m=((0.0, v),)), (-1e-9, 0.0251, *NONE), "points_m"),
    (lambda v: change(FINITE, points_m=((v, W / 2),)), (0.1000001, -0.2, *NONE), "points_m"),
    (lambda v: response(SCENE, v), ([-1.0], [1e12], [[1.0]], 300.0, [math.nan], ["a"], [True]),
     "frequencies_hz"),
    (lambda v: response(SCENE, [300.0], v), (0.0, 0.11, -1e-6, *NONE[:4]), "rtol 0 0.1"),
    (lambda v: displacement(v, [100.0]), (PLATE,), "scene"),
    (lambda v: plate_map(frequency_hz=v), (-1.0, *NONE), "frequency_hz"),
    (lambda v: plate_map(frequency_hz=v), (1e12,), "0"),
    (lambda v: plate_map(frequency_hz=v), (PLATE.cutoff_hz(),), "cut-off"),
    (lambda v: plate_map(x_m=v), ([0.0, math.inf], "a"), "x_m"),
    (lambda v: plate_map(x_m=v), ([],), "points_m"),
    (lambda v: plate_map(y_m=v), ([0.0, 0.026],), "y 0 0.025"),
    (lambda v: plate_map(loads=v), ((), 1.0, None), "loads"),
    (lambda v: plate_map(strip=v), (0.025,), "strip"),
    (lambda v: plate_map(rtol=v), (0.0,), "rtol"),
    # fields over time
    (lambda v: transient(MOVING, BURST, v), ([1.5], [-2.0], 0.001, [[0.0]]), "times_s 1"),
    (lambda v: transient(MOVING, BURST, v), ([math.nan], [math.inf], "now", None, [1j], [True]),
     "times_s"),
    (lambda v: transient(MOVING, BURST, [0.001], rtol=v), (0.0, -1e-6, 0.2, *NONE[:4]),
     "rtol 0 0.1"),
    (lambda v: transient(MOVING, v, [0.001]), (None, 500.0, "hann", np.zeros(3), Scene), "drive"),
    (lambda v: transient(v, BURST, [0.001]), (PLATE,), "scene"),
    (lambda v: transient(MOVING, Burst(frequency_hz=v), [0.001]), (0.5,), "drive 1"),
    (lambda v: transient(MOVING, Burst(frequency_hz=v), [0.001]), (1e9,), "drive"),
    (lambda v: transient(MOVING, BURST, [0.001], rtol=v), (1e-9,), "rtol"),
    # fingers and actuators
    (lambda v: felt(PLATE, DISCS, TIPS, v), (500.0,), "drive"),
    (lambda v: causal(PLATE, v), (500.0,), "drive"),
    (lambda v: felt(PLATE, DISCS, v, BURST), ((), (500.0,)), "fingertips"),
    (lambda v: felt(PLATE, v, TIPS, BURST), ((), (500.0,)), "loads"),
    (lambda v: felt(v, DISCS, TIPS, BURST), (500.0,), "strip"),
    (lambda v: felt(PLATE, (v,), TIPS, BURST), (disc(y_m=0.004),), "y_m"),
    (lambda v: felt(PLATE, DISCS, (v,), BURST), (change(TIP, y_m=0.03),), "x_m y_m"),
    *fields(TIP, "", (*NONE, 1e4))[:-1],
    (lambda value: change(TIP, impedance=value), (1.0, "soft"), "impedance"),
    *fields(PRESSING, "", (*NONE, 1e16, -1.0)),
    (lambda v: change(TIP, radius_m=v), (-0.001,), "radius_m 0"),
    (lambda v: v.points_m(SHORT),
     [change(TIP, **one) for one in ({"x_m": 0.11}, {"x_m": -0.1001}, {"y_m": 0.026})],
     "x_m y_m 0.1 0.025"),
    (TIP.points_m, (0.025,), "strip"),
    (lambda v: level_db(v, own=0, other=1), ([1e-6, 1e-7], [[1e-6], [-1e-7]], [[1e-6], [math.nan]]),
     "felt_m"),
    (lambda v: level_db(v, own=0, other=1), ([[0.0], [1e-7]],), "felt_m 0"),
    (lambda v: level_db(MATRIX_M, own=v, other=1), (-1, 2, 0.0, True, None), "own 0 1"),
    (lambda v: level_db(MATRIX_M, own=1, other=v), (-1, 2, 0.0, True, None), "other 0 1"),
    (lambda v: window(discs=v), (DISCS[:1],), "fingertips"),
    (lambda v: window(tips=v), (TIPS[:1],), "fingertips"),
    (lambda v: window(discs=v, tips=TIPS[:1]), (DISCS[:1],), "fingertips"),
    (window, (1.0, *NONE), "wanted_db 0"),
    (lambda v: window(burst=v), (500.0,), "burst"),
    (lambda v: window(burst=v), (change(BURST, cycles=21),), "cycles 1 20 21"),
    *fields(MEASURED, "0", (*NONE, 1e16, -1.0, 0)),
    *fields(LAYERS, "", (*NONE, 1e16, -1.0)),
    (lambda v: change(LAYERS, d31_m_v=v), (0.0,), "d31_m_v 0"),
    (lambda v: load_per_volt(PLATE, disc(), change(MEASURED, frequency_hz=v)),
     (PLATE.cutoff_hz(), 5000.0), "frequency_hz 4366.1"),
    (lambda v: load_per_volt(PLATE, v, MEASURED), (force(0.0, 0.0), 2.6e-6), "load"),
    (lambda v: load_per_volt(PLATE, v, LAYERS), (force(),), "load"),
    (lambda v: load_per_volt(PLATE, v, LAYERS), (disc(0.005, y_m=0.001),), "y_m"),
    (lambda v: load_per_volt(PLATE, disc(), v), (2.6e-6,), "basis"),
    (lambda v: load_per_volt(v, disc(), LAYERS), (2.6e-6,), "strip"),
]  # fmt: skip # rows of a table


@pytest.mark.parametrize(
    ("call", "bad", "key_and_bounds"),
    [(call, bad, key_and_bounds) for call, some, key_and_bounds in REFUSED for bad in some],
)
def test_what_is_out_of_range_or_nonsense_is_refused_by_name(
    call: Call, bad: object, key_and_bounds: str
) -> None:
    with pytest.raises(ValueError, match=r"^[^\n]* got ") as refused:
        call(bad)
    assert [word for word in key_and_bounds.split() if word not in str(refused.value)] == []


TAKEN: list[tuple[Call, float, float]] = [
    (lambda v: change(PLATE, width_m=v), 1e-9, 1e3),
    (lambda v: change(PLATE, thickness_m=v), 1e-9, 1e3),
    (lambda v: change(PLATE, length_m=v), 1e-9, 1e3),
    (SUPPORTED.wavenumbers_rad_m, 0.0, 400 * SUPPORTED.cutoff_hz()),
    (lambda v: response(SCENE, [v]), 0.0, 400 * PLATE.cutoff_hz()),
    (lambda v: change(BURST, frequency_hz=v), 1e-6, 1e9),
    (BURST.energy_above, 0.0, 1e15 / BURST.duration_s),
    (lambda v: check_burst(BURST, PLATE, max_energy_above_cutoff=v), 0.0, 1.0),
    (lambda v: change(SCENE, points_m=((0.0, v),)), 0.0, W),
    (lambda v: change(FINITE, points_m=((v, 0.01),)), -0.1, 0.1),
]


@pytest.mark.parametrize(("call", "least", "most"), TAKEN)
def test_a_bound_is_taken_and_the_next_number_beyond_it_is_not(
    call: Call, least: float, most: float
) -> None:
    for bound, beyond in ((least, -math.inf), (most, math.inf)):
        call(bound)
        with pytest.raises(ValueError, match="got"):
            call(math.nextafter(bound, beyond))


def test_loads_and_points_that_touch_edges_and_ends_are_taken() -> None:
    loads = disc(W / 2, kind=PressureDisc), patch(0.01, W, x_m=-0.095), force(0.1)
    scene = change(FINITE, loads=loads, points_m=((-0.1, 0.0), (0.1, W)))
    assert (scene.loads, len(scene.points_m)) == (loads, 2)


def test_data_of_a_rule_are_its_values() -> None:
    with pytest.raises(PlateError) as refused:
        response(change(SCENE, strip=SUPPORTED), [500.0], 1e-12)
    assert refused.value.rule is Rule.TOLERANCE
    assert refused.value.values["rtol"] == 1e-12
    with pytest.raises(PlateError) as refused:
        response(change(FINITE, strip=change(SHORT, length_m=8.0)), [20_000.0])
    assert refused.value.rule is Rule.TOO_MANY_FUNCTIONS
    assert refused.value.values["max_functions"] == 4000


def test_a_plate_far_too_long_is_refused_before_its_functions_are_made() -> None:
    with pytest.raises(PlateError) as refused:
        response(change(FINITE, strip=change(SHORT, length_m=1000.0)), [50_000.0])
    assert refused.value.rule is Rule.TOO_MANY_FUNCTIONS


def test_numbers_are_kept_in_double_precision_and_values_are_equal_by_value() -> None:
    single: Any = np.float32(0.5)
    strip = change(PLATE, width_m=single, thickness_m=1)
    assert (type(strip.width_m), type(strip.thickness_m)) == (float, float)
    assert type(force(0).x_m) is float
    assert force(0) == PointForce(x_m=0.0, y_m=W / 2)
    assert click([0.0, 1.0, 0.0]) == CLICK
    assert hash(CLICK) == hash(click([0.0, 1.0, 0.0]))
