"""Plates with bonded patches: thicker plates, mirror images, triangles at rims, moments."""

from __future__ import annotations

import dataclasses

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
    Material,
    MeasuredDisplacement,
    MomentDisc,
    MomentRectangle,
    PiezoLayers,
    PressureDisc,
    Scene,
    Strip,
    causal,
    displacement,
    felt,
    level_db,
    load_per_volt,
    response,
    transient_response,
)
from stimuli.errors import PlateError, Rule
from stimuli.plate.patch import laminate, layer_of
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


SHORT = on(CLAMPED, LENGTH_M, loss=0.01)
TIMES_S = np.linspace(0.0, 0.004, 41)


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


@pytest.mark.parametrize("edge", [SIMPLY_SUPPORTED, pytest.param(CLAMPED, marks=pytest.mark.slow)])
def test_patches_over_the_whole_plate_make_another_plate(edge: Edge) -> None:
    """Over frequency and over time, however the patches are divided."""
    strip = on(edge, LENGTH_M, viscous_s=1e-6)
    halves = [rectangle(side * LENGTH_M / 4, SAME, size_m=(LENGTH_M / 2, W)) for side in (-1, 1)]
    whole = rectangle(0.0, SAME, size_m=(LENGTH_M, W))
    plates = (
        dataclasses.replace(strip, thickness_m=0.75e-3),
        bearing(strip, whole),
        bearing(strip, *halves),
    )
    load = ForceRectangle(x_m=-0.02, y_m=0.011, length_x_m=0.012, length_y_m=0.008)
    points_m = (-0.02, 0.011), (0.01, 0.014), (0.055, 0.02)
    thick, *covered = (Scene(strip=one, loads=(load,), points_m=points_m) for one in plates)
    frequencies_hz = 0.999 * strip.cutoff_hz() * np.array([0.0, 0.5, 1.2])
    tones, motion = response(thick, frequencies_hz), transient_response(thick, CYCLE, TIMES_S)
    for scene in covered:
        difference_m = abs(displacement(scene, frequencies_hz) - tones.value)
        assert np.all(difference_m < 2e-3 * abs(tones.value).max(axis=2, keepdims=True))
        covered_motion = transient_response(scene, CYCLE, TIMES_S)
        difference_m = abs(covered_motion.value - motion.value)
        assert np.all(difference_m <= covered_motion.error + motion.error)


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


@pytest.mark.slow
@pytest.mark.parametrize("patch", [disc(), rectangle()], ids=["disc", "rectangle"])
def test_a_patch_of_no_stiffness_changes_nothing_and_a_stiff_one_stiffens(
    patch: BondedPatch,
) -> None:
    place = patch.x_m + 0.002, patch.y_m + 0.001
    nothing = Layer(thickness_m=1e-9, youngs_modulus_pa=1.0, poisson_ratio=0.31)
    bare, without, stiffened = (
        response(Scene(strip=strip, loads=(force(*place),), points_m=(place,)), [0.0, 800.0])
        for strip in (
            SHORT,
            bearing(SHORT, dataclasses.replace(patch, layers=(nothing,))),
            bearing(SHORT, patch),
        )
    )
    assert np.all(abs(without.value - bare.value) <= without.error + bare.error)
    assert np.all(abs(stiffened.value) < 0.8 * abs(bare.value))


def test_tiny_loads_beside_an_edge_have_a_field_on_springs_without_loss() -> None:
    """Their sharp functions leave a stiffness matrix that loses all digits if it is inverted."""
    width_m = 0.0099780149976227
    strip = Strip(
        width_m=width_m,
        thickness_m=2.8333588296125198e-05,
        material=Material(
            youngs_modulus_pa=53731222910.32074,
            poisson_ratio=0.3,
            density_kg_m3=11986.920650580796,
            loss_factor=0.01,
        ),
        edge=ElasticEdge(stiffness_n=7.687056685121855e-06),
        length_m=4 * width_m,
        patches=(
            BondedPatch(
                x_m=-0.0037200061309770934,
                y_m=width_m / 2,
                length_x_m=0.004649983166716977,
                length_y_m=0.004649983166716977,
                layers=(
                    Layer(
                        thickness_m=3.2437214763315447e-06,
                        youngs_modulus_pa=2002178911.0728176,
                        poisson_ratio=0.28358481754643583,
                        density_kg_m3=4067.218856959804,
                    ),
                ),
                is_disc=True,
            ),
        ),
    )
    y_m, radius_m = 0.021 * width_m, 2.1e-5 * width_m
    loads = (
        MomentDisc(x_m=-1.404 * width_m, y_m=y_m, radius_m=radius_m),
        PressureDisc(x_m=0.0, y_m=y_m, radius_m=radius_m),
    )
    found = response(Scene(strip=strip, loads=loads, points_m=((0.0, y_m),)), [0.0])
    assert np.all(np.isfinite(found.value))


@pytest.mark.slow
def test_load_and_point_may_be_exchanged() -> None:
    strip = bearing(SHORT, disc(0.02, y_m=0.011), rectangle(-0.03))
    places = (0.021, 0.009), (-0.028, 0.016)
    scene = Scene(strip=strip, loads=tuple(force(*place) for place in places), points_m=places)
    for field in response(scene, [0.0, 700.0, 3300.0]).value:
        assert abs(field[0, 1] - field[1, 0]) < 1e-9 * abs(field).max()


def test_mirrored_patches_have_mirrored_fields() -> None:
    """So they have where they are not quite mirrored, but for waves instead of polynomials."""
    pair = [disc(-0.03), disc(0.03)]
    nearly = [pair[0], dataclasses.replace(pair[1], x_m=0.03 + 1e-12)]
    tips = [Fingertip(x_m=x, y_m=W / 2) for x in (-0.03, 0.03)]
    loads = [moment(patch) for patch in pair]
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
    scene = Scene(strip=strip, loads=(load,), points_m=((0.03, W / 2),))
    assert 50 * per_v * abs(displacement(scene, [300.0])[0, 0, 0]) == pytest.approx(2.6e-6)
    (peak_m,) = felt(strip, [load], [Fingertip(x_m=0.03, y_m=W / 2, radius_m=0.0)], tone)[0]
    assert 50 * per_v * peak_m == pytest.approx(2.6e-6, rel=0.02)


# --- finite elements -----------------------------------------------------------------------------


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
    """What is driven and seen at one place turns round at each resonance, and rests at 0 Hz."""
    patch = disc(x_m, y_m=y_m, size_m=2 * radius_m)
    strip, place = bearing(on(FIRM, 0.1, viscous_s=1e-9), patch), (0.037, 0.011)
    scene = Scene(strip=strip, loads=(force(*place),), points_m=(place,))
    beside_hz = np.outer(expected_hz, [1 - 2e-3, 1 + 2e-3])
    beside_m = displacement(scene, beside_hz.ravel()).real.reshape(beside_hz.shape)
    assert np.all(beside_m[:, 0] > 0)
    assert np.all(beside_m[:, 1] < 0)
    scene = Scene(strip=strip, loads=(moment(patch),), points_m=((x_m, y_m),))
    assert abs(displacement(scene, [0.0])[0, 0, 0]) == pytest.approx(expected_m, rel=3e-3)


@pytest.mark.slow
def test_a_disc_that_nearly_touches_an_edge_does_what_one_that_touches_it_does() -> None:
    """It must not rotate freely at its rim, where it is neither held nor at the edge."""
    moved_m = []
    for gap in (0.0, 2e-5, 2e-3, 0.01):
        patch = disc(0.0, y_m=0.3 * W + gap * W, size_m=0.6 * W)
        strip = bearing(on(FIRM, 0.1, viscous_s=1e-9), patch)
        scene = Scene(strip=strip, loads=(moment(patch),), points_m=((0.0, patch.y_m),))
        moved_m.append(float(abs(displacement(scene, [300.0])[0, 0, 0])))
    assert moved_m == pytest.approx([moved_m[0]] * 4, rel=0.05)
    assert moved_m[0] != pytest.approx(moved_m[3], rel=1e-3)


# --- refusals ------------------------------------------------------------------------------------


def test_patches_whose_effect_is_not_known_well_are_refused() -> None:
    small = [rectangle(x_m, size_m=(0.0008, 0.0008)) for x_m in (-0.03, 0.03)]
    tips = [Fingertip(x_m=patch.x_m, y_m=W / 2) for patch in small]
    with pytest.raises(PlateError) as refusal:
        felt(bearing(SHORT, *small), [moment(patch) for patch in small], tips, CYCLE)
    assert refusal.value.rule is Rule.UNCERTAIN_PEAK
    assert float(refusal.value.values["error_percent"]) > 3.0


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
