"""Plates with bonded patches: thicker plates, mirror images, finite elements, known errors."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    ElasticEdge,
    Fingertip,
    ForceRectangle,
    Layer,
    MeasuredDisplacement,
    MomentDisc,
    MomentRectangle,
    PiezoLayers,
    Scene,
    Strip,
    causal,
    displacement,
    felt,
    level_db,
    load_per_volt,
    transient,
)
from stimuli.plate.patch import laminate, layer_of
from stimuli.plate.response import displacement as displacement_by_modes
from stimuli.plate.scene import Scene as PlateScene
from tests.reference.plate_fem import model
from tests.test_stimuli.modes import (
    natural_frequencies_hz,
    peaks_up_to,
    peaks_with_error,
    steady_motion,
)
from tests.test_stimuli.plates import CYCLE, FIRM, PLATE, SUPPORTED, Edge, W, force, on

LENGTH_M = 0.12
CERAMIC = Layer(
    thickness_m=0.2e-3, youngs_modulus_pa=62e9, poisson_ratio=0.31, density_kg_m3=7800.0
)
BRASS = Layer(thickness_m=0.1e-3, youngs_modulus_pa=105e9, poisson_ratio=0.35, density_kg_m3=8530.0)
SAME = Layer(
    thickness_m=0.25e-3,
    youngs_modulus_pa=ALUMINIUM.youngs_modulus_pa,
    poisson_ratio=ALUMINIUM.poisson_ratio,
    density_kg_m3=ALUMINIUM.density_kg_m3,
)


def disc(
    x_m: float = 0.02, *layers: Layer, y_m: float = W / 2, size_m: float = 0.012
) -> BondedPatch:
    return BondedPatch(
        x_m=x_m,
        y_m=y_m,
        length_x_m=size_m,
        length_y_m=size_m,
        layers=layers or (BRASS, CERAMIC),
        is_disc=True,
    )


def rectangle(
    x_m: float = 0.02,
    *layers: Layer,
    y_m: float = W / 2,
    size_m: tuple[float, float] = (0.006, 0.018),
) -> BondedPatch:
    return BondedPatch(
        x_m=x_m, y_m=y_m, length_x_m=size_m[0], length_y_m=size_m[1], layers=layers or (CERAMIC,)
    )


def moment(patch: BondedPatch) -> MomentDisc | MomentRectangle:
    half_x_m, half_y_m = patch.half_size_m
    if patch.is_disc:
        return MomentDisc(x_m=patch.x_m, y_m=patch.y_m, radius_m=half_x_m)
    return MomentRectangle(
        x_m=patch.x_m, y_m=patch.y_m, length_x_m=2 * half_x_m, length_y_m=2 * half_y_m
    )


def bearing(strip: Strip, *patches: BondedPatch) -> Strip:
    return dataclasses.replace(strip, patches=patches)


SHORT = on(CLAMPED, LENGTH_M)


# --- layers and other plates ---------------------------------------------------------------------


def test_layers_of_the_plates_material_thicken_it_however_they_are_divided() -> None:
    plate, half = layer_of(ALUMINIUM, 0.5e-3), dataclasses.replace(CERAMIC, thickness_m=0.1e-3)
    bare, both = laminate([plate]), laminate([plate, SAME])
    assert both.biaxial_n_m == pytest.approx(1.5**3 * bare.biaxial_n_m, rel=1e-12)
    assert both.opposed_n_m == pytest.approx(1.5**3 * bare.opposed_n_m, rel=1e-12)
    assert both.mass_kg_m2 == pytest.approx(1.5 * bare.mass_kg_m2, rel=1e-12)
    whole, divided = laminate([plate, CERAMIC]), laminate([plate, half, half])
    assert divided.biaxial_n_m == pytest.approx(whole.biaxial_n_m, rel=1e-12)
    assert divided.opposed_n_m == pytest.approx(whole.opposed_n_m, rel=1e-12)


@pytest.mark.parametrize("strip", [SHORT, on(SUPPORTED.edge, LENGTH_M), on(FIRM, LENGTH_M)])
def test_patches_over_the_whole_plate_make_another_plate(strip: Strip) -> None:
    halves = [rectangle(side * LENGTH_M / 4, SAME, size_m=(LENGTH_M / 2, W)) for side in (-1, 1)]
    thicker = dataclasses.replace(strip, thickness_m=0.75e-3)
    found = natural_frequencies_hz(bearing(strip, *halves), 8, 12e3)
    assert found == pytest.approx(natural_frequencies_hz(thicker, 8, 23e3), rel=5e-5)


@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED])
def test_fingers_on_a_covered_plate_are_those_on_a_thicker_one(edge: Edge) -> None:
    # 0.3 mm of the plate's own brass on 0.5 mm: a plate of 0.8 mm with the same constant loss
    brass = dataclasses.replace(MATERIALS["brass"].material, loss_factor=0.01)
    bare = Strip(width_m=0.024, thickness_m=0.5e-3, material=brass, edge=edge, length_m=0.14)
    layer = layer_of(brass, 0.3e-3)
    whole = BondedPatch(x_m=0.0, y_m=0.012, length_x_m=0.14, length_y_m=0.024, layers=(layer,))
    loads = [
        ForceRectangle(x_m=x_m, y_m=0.012, length_x_m=0.012, length_y_m=0.016)
        for x_m in (-0.033, 0.033)
    ]
    tips = [Fingertip(x_m=load.x_m, y_m=load.y_m) for load in loads]
    covered, thick = bearing(bare, whole), dataclasses.replace(bare, thickness_m=0.8e-3)
    times = [causal(strip, CYCLE).material.viscous_time_s for strip in (covered, thick)]
    assert times[0] == pytest.approx(times[1], rel=1e-9)
    first, second = (felt(strip, loads, tips, CYCLE) for strip in (covered, thick))
    np.testing.assert_allclose(np.diag(first), np.diag(second), rtol=5e-3)
    assert level_db(first, 0, 1) == pytest.approx(level_db(second, 0, 1), abs=0.2)


@pytest.mark.parametrize("patch", [disc(), rectangle()], ids=["disc", "rectangle"])
def test_a_patch_of_no_thickness_changes_nothing(patch: BondedPatch) -> None:
    layer = dataclasses.replace(CERAMIC, thickness_m=1e-9, youngs_modulus_pa=1.0)
    thin = dataclasses.replace(patch, layers=(layer,))
    expected = natural_frequencies_hz(SHORT, 10, 23e3)
    rel = 2e-4 if patch.is_disc else 5e-5
    assert natural_frequencies_hz(bearing(SHORT, thin), 10, 12e3) == pytest.approx(
        expected, rel=rel
    )


@pytest.mark.parametrize("patch", [disc(), rectangle()], ids=["disc", "rectangle"])
def test_frequencies_fall_as_more_functions_are_taken(patch: BondedPatch) -> None:
    strip = bearing(SHORT, patch)
    few, more = (natural_frequencies_hz(strip, 8, hz, 40e3) for hz in (23e3, 40e3))
    assert np.all(more <= few * (1 + 1e-9))
    assert natural_frequencies_hz(strip, 8, 23e3) == pytest.approx(more, rel=1e-3)
    assert more == pytest.approx(few, rel=1e-3)


@pytest.mark.slow
def test_load_and_point_may_be_exchanged() -> None:
    strip = bearing(on(CLAMPED, LENGTH_M, viscous_s=1e-7), disc(0.02, y_m=0.011), rectangle(-0.03))
    places = [(0.021, 0.009), (-0.028, 0.016)]
    loads = tuple(force(*place) for place in places)
    scene = Scene(strip=strip, loads=loads, points_m=tuple(places))
    found = steady_motion(scene, 700.0, multiple=6.0)
    assert found[0, 1] == pytest.approx(found[1, 0], rel=1e-9)


def test_mirrored_patches_have_mirrored_fields() -> None:
    """So they have where they are not quite mirrored, but for waves instead of polynomials."""
    pair = [disc(-0.03), disc(0.03)]
    nearly = [pair[0], dataclasses.replace(pair[1], x_m=0.03 + 1e-12)]
    tips = [Fingertip(x_m=x, y_m=W / 2) for x in (-0.03, 0.03)]
    loads = [moment(one) for one in pair]
    strip = on(FIRM, LENGTH_M, viscous_s=1e-7)
    by_halves, whole = (felt(bearing(strip, *both), loads, tips, CYCLE) for both in (pair, nearly))
    assert by_halves == pytest.approx(by_halves[::-1, ::-1], rel=1e-6)
    assert whole == pytest.approx(by_halves, rel=3e-4)


def test_both_ways_to_predict_a_moment_bend_a_wholly_covered_plate_alike() -> None:
    """The bare plate and the laminate, each with its moment of (45)."""
    layers = PiezoLayers(
        thickness_m=0.2e-3, youngs_modulus_pa=62e9, poisson_ratio=0.31, d31_m_v=-180e-12
    )
    free = on(SUPPORTED.edge, LENGTH_M)
    load = MomentRectangle(x_m=0.0, y_m=W / 2, length_x_m=LENGTH_M, length_y_m=W)
    whole = rectangle(0.0, *layers.layers, size_m=(LENGTH_M, W))
    alone, held = (
        load_per_volt(one, load, layers).load_per_v for one in (free, bearing(free, whole))
    )
    plate = layer_of(ALUMINIUM, free.thickness_m)
    curvature = alone / laminate([plate]).biaxial_n_m
    assert held / laminate([plate, *layers.layers]).biaxial_n_m == pytest.approx(curvature)
    assert held > 2 * alone


def test_a_measured_displacement_comes_back() -> None:
    strip = bearing(on(FIRM, LENGTH_M, loss=0.01), disc(-0.03), disc(0.03))
    measured = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    load = moment(disc(0.03))
    per_v = load_per_volt(strip, load, measured).load_per_v
    tone = Burst(frequency_hz=300.0, cycles=6, window="hann")
    scene = PlateScene(strip=strip, loads=(load,), points_m=((0.03, W / 2),))
    assert 50 * per_v * abs(displacement_by_modes(scene, [300.0])[0, 0, 0]) == pytest.approx(2.6e-6)
    (peak_m,) = felt(strip, [load], [Fingertip(x_m=0.03, y_m=W / 2, radius_m=0.0)], tone)[0]
    assert 50 * per_v * peak_m == pytest.approx(2.6e-6, rel=0.02)


# --- finite elements -----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("size_m", [(0.006, 0.018), (0.010, 0.003), (0.012, W)], ids=str)
def test_rectangles_are_as_in_finite_elements(size_m: tuple[float, float]) -> None:
    from scipy.sparse.linalg import eigsh, splu

    across_m = 0.0125 if size_m[1] == W else 0.011
    patches = [rectangle(-0.025, size_m=size_m), rectangle(0.03, y_m=across_m, size_m=size_m)]
    strip, load = bearing(on(FIRM, LENGTH_M, viscous_s=1e-9), *patches), moment(patches[1])
    assert isinstance(load, MomentRectangle)
    points_m = ((0.03, across_m), (0.033, 0.013))
    plate = model(strip, load, points_m, 1e-3)
    squares = eigsh(plate.stiffness, 6, plate.mass, sigma=0, return_eigenvectors=False)
    expected_hz = np.sqrt(np.sort(squares)) / (2 * math.pi)
    found_hz = natural_frequencies_hz(strip, 6, 23e3)
    assert found_hz == pytest.approx(expected_hz, rel=3e-4)
    at_rest_m = plate.points @ splu(plate.stiffness).solve(plate.load)
    scene = Scene(strip=strip, loads=(load,), points_m=points_m)
    assert abs(steady_motion(scene, 1.0)[0]) == pytest.approx(abs(at_rest_m), rel=5e-3)


# Morley triangles on rings that follow the rim, extrapolated from sizes of 1 mm and 0.5 mm
BY_TRIANGLES = [
    (0.012, W / 2, 0.0064, [2825.250633, 2940.447900, 3120.350679, 3532.546980], 9.68965280e-06),
    (-0.02, 0.010, 0.0045, [2836.210545, 2933.531593, 3172.493316, 3516.707718], 5.94691748e-06),
]


@pytest.mark.slow
@pytest.mark.parametrize(("x_m", "y_m", "radius_m", "expected_hz", "expected_m"), BY_TRIANGLES)
def test_discs_are_as_in_triangles_that_follow_their_rim(
    x_m: float, y_m: float, radius_m: float, expected_hz: list[float], expected_m: float
) -> None:
    patch = disc(x_m, y_m=y_m, size_m=2 * radius_m)
    strip = bearing(on(FIRM, 0.1, viscous_s=1e-9), patch)
    assert natural_frequencies_hz(strip, 4, 30e3) == pytest.approx(expected_hz, rel=3e-4)
    scene = Scene(strip=strip, loads=(moment(patch),), points_m=((x_m, y_m),))
    assert abs(steady_motion(scene, 1.0)[0, 0]) == pytest.approx(expected_m, rel=3e-3)


@pytest.mark.slow
def test_a_disc_that_nearly_touches_an_edge_does_what_one_that_touches_it_does() -> None:
    """It must not rotate freely at its rim, where it is neither held nor at the edge."""
    found = []
    for gap in (0.0, 2e-5, 2e-3, 0.01):
        patch = disc(0.0, y_m=0.3 * W + gap * W, size_m=0.6 * W)
        strip = bearing(on(FIRM, 0.1, viscous_s=1e-9), patch)
        scene = Scene(strip=strip, loads=(moment(patch),), points_m=((0.0, patch.y_m),))
        found.append(float(abs(steady_motion(scene, 300.0)[0, 0])))
    assert found == pytest.approx([found[0]] * 4, rel=0.05)
    assert found[0] != pytest.approx(found[3], rel=1e-3)


# --- known errors --------------------------------------------------------------------------------


Given = tuple[Strip, list[Any], list[Fingertip], Burst]


def drawn(seed: int, *, round_ones: bool) -> Given:
    """A plate of any material, size and edge, with two patches that are not mirror images."""
    rng = np.random.default_rng((7, seed))
    width_m, thickness_m = rng.uniform(0.015, 0.03), float(rng.choice([0.3e-3, 0.5e-3, 0.8e-3]))
    material = MATERIALS[str(rng.choice(["steel", "glass", "brass", "pmma"]))].material
    strip = Strip(
        width_m=width_m,
        thickness_m=thickness_m,
        length_m=width_m * rng.uniform(4.5, 6),
        material=dataclasses.replace(material, loss_factor=float(rng.choice([0.005, 0.01, 0.02]))),
        edge=(CLAMPED, SIMPLY_SUPPORTED)[seed % 2],
    )
    if seed % 3 == 0:
        held_n = strip.bending_stiffness_n_m / width_m * 10 ** rng.uniform(0, 2)
        strip = dataclasses.replace(strip, edge=ElasticEdge(stiffness_n=held_n, lossless=False))
    patches, loads, tips = [], [], []
    for side in (-1, 1):
        along_m, across_m = width_m * rng.uniform(0.2, 0.5), width_m * rng.uniform(0.2, 0.7)
        across_m = along_m if round_ones else across_m
        x_m = side * float(rng.uniform(0.9, 1.4)) * width_m
        y_m = float(rng.uniform(across_m / 2, width_m - across_m / 2))
        layers = ((CERAMIC,), (BRASS, CERAMIC))[rng.integers(2)]
        patches.append(
            BondedPatch(
                x_m=x_m,
                y_m=y_m,
                length_x_m=along_m,
                length_y_m=across_m,
                layers=layers,
                is_disc=round_ones,
            )
        )
        load: Any = MomentDisc(x_m=x_m, y_m=y_m, radius_m=along_m / 2)
        if not round_ones:
            load = MomentRectangle(x_m=x_m, y_m=y_m, length_x_m=along_m, length_y_m=across_m)
        loads.append(load)
        tips.append(Fingertip(x_m=x_m, y_m=y_m, radius_m=0.003))
    burst = Burst(
        frequency_hz=float(rng.choice([0.1, 0.25])) * strip.cutoff_hz(),
        cycles=1,
        window=("none", "tukey", "hann")[rng.integers(3)],
    )
    return dataclasses.replace(strip, patches=tuple(patches)), loads, tips, burst


def wide(
    name: str, width_m: float, length_m: float, loss: float, frequency_hz: float, *places_m: Any
) -> Given:
    """A plate four times as wide as its discs: functions must reach beyond them."""
    patches = tuple(disc(x_m, CERAMIC, y_m=y_m, size_m=9e-3) for x_m, y_m in places_m)
    material = dataclasses.replace(MATERIALS[name].material, loss_factor=loss)
    strip = Strip(
        width_m=width_m,
        thickness_m=0.5e-3,
        length_m=length_m,
        edge=SIMPLY_SUPPORTED,
        material=material,
        patches=patches,
    )
    tips = [Fingertip(x_m=patch.x_m, y_m=patch.y_m, radius_m=3e-3) for patch in patches]
    loads: list[Any] = [moment(patch) for patch in patches]
    return strip, loads, tips, Burst(frequency_hz=frequency_hz, cycles=1, window="hann")


# Of rectangles by the modes of finite elements a twentieth of the width in size; of discs with
# twice as many functions of each disc, more waves and more nodes, up to 11 cut-offs
FINER: list[tuple[Given, list[float]]] = [
    (drawn(0, round_ones=False), [1.6690075e-05, 1.1303277e-07, 6.2987920e-08, 1.8514468e-05]),
    (drawn(1, round_ones=False), [2.4033163e-06, 2.1837960e-07, 2.9069182e-07, 1.8219154e-06]),
    (drawn(2, round_ones=False), [9.4744934e-06, 6.0384528e-07, 5.1410688e-07, 9.7717828e-06]),
    (drawn(1, round_ones=True), [1.5943380e-06, 8.3774792e-08, 1.4522440e-07, 9.3380466e-07]),
    (drawn(2, round_ones=True), [6.4650928e-06, 8.5687345e-08, 2.7024850e-07, 3.2130671e-06]),
    (drawn(3, round_ones=True), [4.0158689e-05, 9.2505904e-08, 4.7647545e-08, 5.5526868e-05]),
    (drawn(7, round_ones=True), [2.2029584e-06, 2.4200798e-07, 2.5055694e-07, 2.0867503e-06]),
    (
        wide("glass", 0.034, 0.47, 0.003, 144.0, (-0.022, 0.017), (0.025, 0.017)),
        [8.7802097e-06, 1.5656277e-07, 1.5645308e-07, 8.7800791e-06],
    ),
    (
        wide("brass", 0.0325, 0.298, 0.01, 104.0, (-0.007, 0.018), (0.048, 0.015)),
        [5.9794549e-06, 4.1891796e-08, 4.1538334e-08, 6.0048947e-06],
    ),
]


@pytest.mark.parametrize(
    ("plate", "finer_m"),
    [FINER[5], *(pytest.param(*case, marks=pytest.mark.slow) for case in FINER[:5] + FINER[6:])],
)
def test_the_estimate_lies_above_the_error(plate: Given, finer_m: list[float]) -> None:
    (peak_m, error_m), true_m = peaks_with_error(*plate), np.reshape(finer_m, (2, 2))
    np.testing.assert_allclose(peak_m, felt(*plate), rtol=1e-9)
    assert np.all(abs(peak_m - true_m) <= error_m)
    if plate[0].patches[0].is_disc:
        assert np.all(np.diag(abs(peak_m - true_m)) <= 2e-3 * np.diag(true_m))
    else:
        assert np.all(np.diag(error_m) <= 0.01 * np.diag(peak_m))


@pytest.mark.slow
@pytest.mark.parametrize(
    "patches",
    [(disc(-0.03), disc(0.03)), (disc(-0.025, size_m=0.008), rectangle(0.03))],
    ids=["mirrored", "different"],
)
def test_the_estimate_holds_against_twice_as_many_modes(patches: tuple[BondedPatch, ...]) -> None:
    strip = bearing(on(FIRM, LENGTH_M, viscous_s=5e-7), *patches)
    loads = [moment(patch) for patch in patches]
    tips = [Fingertip(x_m=patch.x_m, y_m=patch.y_m) for patch in patches]
    peak_m, error_m = peaks_with_error(strip, loads, tips, CYCLE)
    finer_m = peaks_up_to(22.0, strip, loads, tips, CYCLE).peak_m
    assert np.all(abs(peak_m - finer_m) <= error_m)
    assert np.all(np.diag(abs(peak_m - finer_m)) < 2e-3 * np.diag(peak_m))
    assert np.all(error_m < 0.02 * peak_m)


# --- refusals ------------------------------------------------------------------------------------


def test_what_knows_no_patches_refuses_them() -> None:
    scene = Scene(strip=bearing(SHORT, disc()), loads=(moment(disc()),), points_m=((0.02, W / 2),))
    with pytest.raises(ValueError, match=r"^strip .*patches"):
        displacement(scene, [300.0])
    with pytest.raises(ValueError, match=r"^rtol .*patches.* 1e-06$"):
        transient(scene, CYCLE, [1e-3], rtol=1e-6)


def test_patches_whose_effect_is_not_known_well_are_refused() -> None:
    small = [rectangle(x_m, size_m=(0.0008, 0.0008)) for x_m in (-0.03, 0.03)]
    tips = [Fingertip(x_m=patch.x_m, y_m=W / 2) for patch in small]
    strip = bearing(on(FIRM, LENGTH_M, viscous_s=5e-7), *small)
    with pytest.raises(ValueError, match=r"^loads\[0\]: .*5\.8 %.*3 %"):
        felt(strip, [moment(patch) for patch in small], tips, CYCLE)


@pytest.mark.parametrize(
    ("strip", "patches", "key"),
    [
        (PLATE, (disc(),), "length_m"),
        (SHORT, (disc(0.055),), "strip"),
        (SHORT, (disc(0.0, y_m=0.005),), "strip"),
        (SHORT, (disc(0.0), disc(0.011)), "overlap"),
    ],
)
def test_patches_without_ends_off_the_strip_or_on_each_other_are_refused(
    strip: Strip, patches: tuple[BondedPatch, ...], key: str
) -> None:
    with pytest.raises(ValueError, match=f"^patches .*{key}"):
        bearing(strip, *patches)
