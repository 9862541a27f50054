"""Plates with bonded patches: thicker plates, Rayleigh's shift, mirror images, finite elements."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    Fingertip,
    ForceRectangle,
    Layer,
    MomentDisc,
    MomentRectangle,
    PiezoLayers,
    PointForce,
    Scene,
    Strip,
    causal,
    displacement,
    felt,
    level_db,
    load_per_volt,
    transient,
)
from stimuli.fingers.work import felt_known
from stimuli.motion.modes import plate_modes
from stimuli.motion.motion import motion_of, steady
from stimuli.motion.patches.patched import _patched_modes, patched_modes
from stimuli.strip.material import MATERIALS
from stimuli.strip.patch import laminate, layer_of
from tests.test_stimuli.plates import FIRM, PLATE, SUPPORTED, W, on

if TYPE_CHECKING:
    from stimuli import IdealEdge
    from stimuli.arrays import Real

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
BURST = Burst(frequency_hz=500.0, cycles=1, window="none")


def disc(
    x_m: float = 0.02, *layers: Layer, y_m: float = W / 2, size_m: float = 0.012
) -> BondedPatch:
    return BondedPatch(
        x_m=x_m, y_m=y_m, length_x_m=size_m, length_y_m=size_m, layers=layers or (BRASS, CERAMIC),
        is_disc=True,
    )  # fmt: skip


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


def first_hz(
    strip: Strip, n: int, highest_hz: float = 12e3, within_hz: float | None = None
) -> Real:
    groups = patched_modes(strip, highest_hz, centred=False, within_hz=within_hz)
    squared = np.sort(np.concatenate([group.squared for group in groups]))
    return np.asarray(np.sqrt(squared[:n]) / (2 * math.pi))


SHORT = on(CLAMPED, LENGTH_M)


def test_a_layer_of_the_same_material_makes_a_thicker_plate() -> None:
    plate = layer_of(ALUMINIUM, 0.5e-3)
    one, both = laminate([plate]), laminate([plate, SAME])
    assert both.biaxial_n_m == pytest.approx(1.5**3 * one.biaxial_n_m, rel=1e-12)
    assert both.opposed_n_m == pytest.approx(1.5**3 * one.opposed_n_m, rel=1e-12)
    assert both.mass_kg_m2 == pytest.approx(1.5 * one.mass_kg_m2, rel=1e-12)


def test_what_a_laminate_resists_does_not_depend_on_how_a_layer_is_divided() -> None:
    half = dataclasses.replace(CERAMIC, thickness_m=CERAMIC.thickness_m / 2)
    plate = layer_of(ALUMINIUM, 0.5e-3)
    whole, divided = laminate([plate, CERAMIC]), laminate([plate, half, half])
    assert divided.biaxial_n_m == pytest.approx(whole.biaxial_n_m, rel=1e-12)
    assert divided.opposed_n_m == pytest.approx(whole.opposed_n_m, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("strip", [SHORT, on(SUPPORTED.edge, LENGTH_M), on(FIRM, LENGTH_M)])
def test_patches_over_the_whole_plate_make_another_plate(strip: Strip) -> None:
    halves = [rectangle(side * LENGTH_M / 4, SAME, size_m=(LENGTH_M / 2, W)) for side in (-1, 1)]
    thicker = dataclasses.replace(strip, thickness_m=0.75e-3)
    modes = plate_modes(thicker, 23e3, centred=False)
    wanted = np.sort(np.concatenate([one.squared for one in modes])) ** 0.5 / (2 * math.pi)
    found = first_hz(bearing(strip, *halves), 8)
    assert found == pytest.approx(wanted[:8], rel=5e-5)


@pytest.mark.slow
def test_fingers_feel_that_other_plate() -> None:
    whole = rectangle(0.0, SAME, size_m=(LENGTH_M, W))
    tips = [Fingertip(x_m=x, y_m=W / 2) for x in (-0.03, 0.03)]
    loads = [ForceRectangle(x_m=-0.03, y_m=W / 2, length_x_m=0.01, length_y_m=0.01)]
    strip = on(CLAMPED, LENGTH_M, viscous_s=1e-7)
    thicker = dataclasses.replace(strip, thickness_m=0.75e-3)
    expected = felt(thicker, loads, tips, BURST)
    assert felt(bearing(strip, whole), loads, tips, BURST) == pytest.approx(expected, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("patch", [disc(), rectangle()], ids=["disc", "rectangle"])
def test_a_patch_of_no_thickness_changes_nothing(patch: BondedPatch) -> None:
    thin = dataclasses.replace(
        patch, layers=(dataclasses.replace(CERAMIC, thickness_m=1e-9, youngs_modulus_pa=1.0),)
    )
    modes = plate_modes(SHORT, 23e3, centred=False)
    wanted = np.sort(np.concatenate([one.squared for one in modes])) ** 0.5 / (2 * math.pi)
    assert first_hz(bearing(SHORT, thin), 10) == pytest.approx(
        wanted[:10], rel=2e-4 if patch.is_disc else 5e-5
    )


@pytest.mark.slow
@pytest.mark.parametrize("patch", [disc(0.01), rectangle(0.01)], ids=["disc", "rectangle"])
def test_a_light_patch_shifts_a_frequency_as_rayleigh_has_it(patch: BondedPatch) -> None:
    """Twice the relative shift is what the patch adds to energy, less what it adds to inertia."""
    layer = Layer(thickness_m=1e-7, youngs_modulus_pa=62e9, poisson_ratio=0.1, density_kg_m3=2e4)
    nothing = dataclasses.replace(layer, thickness_m=1e-9, youngs_modulus_pa=1.0, density_kg_m3=0.0)
    plate = layer_of(ALUMINIUM, SHORT.thickness_m)
    bare, whole = laminate([plate]), laminate([plate, layer])
    (even,) = [one for one in plate_modes(SHORT, 6e3, centred=True) if not one.ends.odd]
    area, points_m = _inside(patch)
    step = 1e-4

    def mode(shift_x: float, shift_y: float) -> Real:
        return np.asarray(even.at(points_m + step * np.array([shift_x, shift_y]))[0, :, 0])

    xx = (mode(1, 0) - 2 * mode(0, 0) + mode(-1, 0)) / step**2
    yy = (mode(0, 1) - 2 * mode(0, 0) + mode(0, -1)) / step**2
    xy = (mode(1, 1) - mode(1, -1) - mode(-1, 1) + mode(-1, -1)) / (4 * step**2)
    biaxial = whole.biaxial_n_m - bare.biaxial_n_m
    opposed = whole.opposed_n_m - bare.opposed_n_m
    energy = biaxial / 2 * (xx + yy) ** 2 + opposed / 2 * ((xx - yy) ** 2 + 4 * xy**2)
    inertia = (whole.mass_kg_m2 - bare.mass_kg_m2) * mode(0, 0) ** 2
    shift = area * np.mean(energy - even.squared[0] * inertia) / (2 * even.squared[0])
    bare_hz, found_hz = (
        first_hz(bearing(SHORT, dataclasses.replace(patch, layers=(one,))), 1, 6e3)[0]
        for one in (nothing, layer)
    )
    found = found_hz / bare_hz - 1
    assert found == pytest.approx(shift, rel=0.03)


def _inside(patch: BondedPatch) -> tuple[float, Real]:
    """Return the area of a patch and points that are spread evenly over it."""
    half_x_m, half_y_m = patch.half_size_m
    nodes = (np.arange(60) + 0.5) / 30 - 1
    x, y = (one.ravel() for one in np.meshgrid(nodes, nodes))
    inside = (x**2 + y**2 < 1) | (not patch.is_disc)
    area = half_x_m * half_y_m * (math.pi if patch.is_disc else 4)
    points_m = np.stack([patch.x_m + half_x_m * x, patch.y_m + half_y_m * y], axis=1)
    return area, points_m[inside]


@pytest.mark.slow
@pytest.mark.parametrize("patch", [disc(), rectangle()], ids=["disc", "rectangle"])
def test_frequencies_fall_as_more_functions_are_taken(patch: BondedPatch) -> None:
    strip = bearing(SHORT, patch)
    few, more = first_hz(strip, 8, 23e3, within_hz=40e3), first_hz(strip, 8, 40e3)
    assert np.all(more <= few * (1 + 1e-9))
    assert first_hz(strip, 8, 23e3) == pytest.approx(more, rel=1e-3)
    assert more == pytest.approx(few, rel=1e-3)


@pytest.mark.slow
def test_load_and_point_may_be_exchanged() -> None:
    strip = bearing(SHORT, disc(0.02, y_m=0.011), rectangle(-0.03, y_m=0.014))
    places = [(0.021, 0.009), (-0.028, 0.016)]
    loads = tuple(PointForce(x_m=x, y_m=y) for x, y in places)
    found = steady(Scene(strip=strip, loads=loads, points_m=tuple(places)), 700.0)
    assert found[0, 1] == pytest.approx(found[1, 0], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED])
@pytest.mark.parametrize("shape", ["discs", "squares"])
def test_few_combinations_of_fine_functions_do_what_all_do(
    edge: IdealEdge, shape: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    patches = [
        dataclasses.replace(disc(x_m), y_m=y_m, is_disc=shape == "discs")
        for x_m, y_m in ((-0.03, 0.014), (0.025, 0.012))
    ]
    strip = dataclasses.replace(bearing(on(FIRM, 0.2), *patches), edge=edge)
    highest_hz = 8 * strip.cutoff_hz()

    def modes() -> Real:
        _patched_modes.cache_clear()
        (group,) = patched_modes(strip, highest_hz, centred=False)
        return np.sqrt(group.squared)

    few = modes()
    for name in ("_OF_WAVES", "_OF_MODES"):
        monkeypatch.setattr(f"stimuli.motion.patches.patched.{name}", (0.0, 0.0))
    every = modes()
    _patched_modes.cache_clear()
    half = every.size // 2
    assert few[:half] == pytest.approx(every[:half], rel=2e-5)


@pytest.mark.slow
def test_mirrored_patches_have_mirrored_fields() -> None:
    """So they have where they are not quite mirrored, but for waves instead of polynomials."""
    pair = [disc(-0.03), disc(0.03)]
    nearly = [pair[0], dataclasses.replace(pair[1], x_m=0.03 + 1e-12)]
    tips = [Fingertip(x_m=x, y_m=W / 2) for x in (-0.03, 0.03)]
    loads = [moment(one) for one in pair]
    strip = on(FIRM, LENGTH_M, viscous_s=1e-7)
    by_halves, whole = (felt(bearing(strip, *both), loads, tips, BURST) for both in (pair, nearly))
    assert by_halves == pytest.approx(by_halves[::-1, ::-1], rel=1e-6)
    assert whole == pytest.approx(by_halves, rel=3e-4)


def test_a_plate_that_moves_slowly_moves_as_at_rest() -> None:
    bare = on(CLAMPED, LENGTH_M, loss=0.01)
    loads, points_m = (moment(disc()),), ((0.02, W / 2), (0.03, 0.01))
    scene = Scene(strip=bare, loads=loads, points_m=points_m)
    found = steady(scene, 300.0)
    assert found == pytest.approx(displacement(scene, [300.0])[0], rel=2e-4)


def test_both_ways_to_predict_a_moment_bend_a_wholly_covered_plate_alike() -> None:
    """The bare plate with the moment of (67), and the laminate with its own, (85)."""
    layers = PiezoLayers(
        thickness_m=0.2e-3, youngs_modulus_pa=62e9, poisson_ratio=0.31, d31_m_v=-180e-12,
    )  # fmt: skip
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


@pytest.mark.slow
def test_a_measured_displacement_comes_back() -> None:
    from stimuli import MeasuredDisplacement

    strip = bearing(on(FIRM, LENGTH_M, loss=0.01), disc(-0.03), disc(0.03))
    known = MeasuredDisplacement(displacement_m=2.6e-6, level_vpp=100.0, frequency_hz=300.0)
    load = moment(disc(0.03))
    per_v = load_per_volt(strip, load, known).load_per_v
    scene = Scene(strip=strip, loads=(load,), points_m=((0.03, W / 2),))
    assert 50 * per_v * abs(steady(scene, 300.0)[0, 0]) == pytest.approx(2.6e-6)
    tone = Burst(frequency_hz=300.0, cycles=6, window="hann")
    (peak_m,) = felt(strip, [load], [Fingertip(x_m=0.03, y_m=W / 2, radius_m=0.0)], tone)[0]
    assert 50 * per_v * peak_m == pytest.approx(2.6e-6, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("size_m", [(0.006, 0.018), (0.010, 0.003)], ids=["upright", "flat"])
def test_rectangles_are_as_in_finite_elements(size_m: tuple[float, float]) -> None:
    from scipy.sparse.linalg import eigsh, splu

    from benchmarks.plate_fem import model

    patches = [rectangle(-0.025, size_m=size_m), rectangle(0.03, y_m=0.011, size_m=size_m)]
    strip = bearing(on(FIRM, LENGTH_M), *patches)
    load = moment(patches[1])
    assert isinstance(load, MomentRectangle)
    points_m = ((0.03, 0.011), (0.033, 0.013))
    plate = model(strip, load, points_m, 1e-3)
    squares = eigsh(plate.stiffness, 6, plate.mass, sigma=0, return_eigenvectors=False)
    wanted_hz = np.sqrt(np.sort(squares)) / (2 * math.pi)
    found_hz = first_hz(strip, 6, 23e3)
    assert found_hz == pytest.approx(wanted_hz, rel=3e-4)
    at_rest_m = plate.points @ splu(plate.stiffness).solve(plate.load)
    scene = Scene(strip=strip, loads=(load,), points_m=points_m)
    assert abs(steady(scene, 1.0)[0]) == pytest.approx(abs(at_rest_m), rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "patches",
    [(disc(-0.03), disc(0.03)), (disc(-0.025, size_m=0.008), rectangle(0.03))],
    ids=["mirrored", "different"],
)
def test_the_estimate_is_above_the_error(patches: tuple[BondedPatch, ...]) -> None:
    from stimuli.fingers.fingertip import asked
    from stimuli.motion.peaks import peaks_of, wait_of

    strip = bearing(on(FIRM, LENGTH_M, viscous_s=5e-7), *patches)
    loads = [moment(one) for one in patches]
    tips = [Fingertip(x_m=one.x_m, y_m=one.y_m) for one in patches]
    found, error = felt(strip, loads, tips, BURST), felt_known(strip, loads, tips, BURST).error_m
    assert error is not None
    scene, places, far_m = asked(strip, loads, tips, BURST)
    wait_s = wait_of(strip, far_m)
    finer = peaks_of(motion_of(scene, 2900.0, 22.0), places, BURST, wait_s=wait_s).peak_m
    assert np.all(abs(found - finer) <= error)
    assert np.all(np.diag(abs(found - finer)) < 2e-3 * np.diag(found))
    assert np.all(error < 0.02 * found)


def test_what_knows_no_patches_refuses_them() -> None:
    strip = bearing(SHORT, disc())
    scene = Scene(strip=strip, loads=(moment(disc()),), points_m=((0.02, W / 2),))
    with pytest.raises(ValueError, match=r"strip must have no patches: they count over time only"):
        displacement(scene, [300.0])
    with pytest.raises(ValueError, match=r"rtol must be larger where the strip has patches"):
        transient(scene, BURST, [1e-3], rtol=1e-6)


@pytest.mark.slow
def test_patches_whose_effect_is_not_known_well_are_refused() -> None:
    small = [rectangle(x_m, size_m=(0.0008, 0.0008)) for x_m in (-0.03, 0.03)]
    tips = [Fingertip(x_m=one.x_m, y_m=W / 2) for one in small]
    strip = bearing(on(FIRM, LENGTH_M, viscous_s=5e-7), *small)
    with pytest.raises(ValueError, match=r"loads\[0\]: .* known to 5\.8% only, 3% is the most"):
        felt(strip, [moment(one) for one in small], tips, BURST)


@pytest.mark.slow
def test_a_patch_of_the_whole_width_is_as_in_finite_elements() -> None:
    from scipy.sparse.linalg import splu

    from benchmarks.plate_fem import model

    patch = rectangle(0.01, size_m=(0.012, W))
    strip = bearing(on(CLAMPED, LENGTH_M), patch)
    load, points_m = moment(patch), ((0.01, W / 2),)
    assert isinstance(load, MomentRectangle)
    plate = model(strip, load, points_m, 1e-3)
    at_rest_m = plate.points @ splu(plate.stiffness).solve(plate.load)
    scene = Scene(strip=strip, loads=(load,), points_m=points_m)
    assert abs(steady(scene, 1.0)[0]) == pytest.approx(abs(at_rest_m), rel=5e-3)


def test_an_endless_strip_has_no_patches() -> None:
    with pytest.raises(ValueError, match=r"patches need a strip with ends: length_m must be given"):
        bearing(PLATE, disc())


@pytest.mark.parametrize(
    ("patches", "said"),
    [
        ((disc(0.055),), "patches must lie on the strip"),
        ((disc(0.0, y_m=0.005),), "patches must lie on the strip"),
        ((disc(0.0), disc(0.011)), "patches must not overlap"),
    ],
)
def test_patches_off_the_strip_or_on_each_other_are_refused(
    patches: tuple[BondedPatch, ...], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        bearing(SHORT, *patches)


@pytest.mark.slow
@pytest.mark.parametrize("edge", [CLAMPED, SIMPLY_SUPPORTED])
def test_a_plate_that_a_patch_covers_loses_as_the_laminate(edge: IdealEdge) -> None:
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
    times = [causal(one, BURST).material.viscous_time_s for one in (covered, thick)]
    assert times[0] == pytest.approx(times[1], rel=1e-9)
    first, second = (level_db(felt(one, loads, tips, BURST), 0, 1) for one in (covered, thick))
    assert first == pytest.approx(second, abs=0.2)
