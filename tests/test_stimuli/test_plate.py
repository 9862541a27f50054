"""One basis for waves and modes, beside closed forms and values of another solver."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import quad

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    ElasticEdge,
    MomentDisc,
    PointForce,
    Scene,
    Strip,
)
from stimuli.errors import PlateError, Rule
from stimuli.fingers.peaks import fingertip_peaks
from stimuli.plate.line import EVEN, FREE, ODD, SUPPORTED, LineEnd, Margins, make_line
from stimuli.plate.modes import Resolution, plate_bases
from stimuli.plate.patch import layer_of
from stimuli.plate.response import ACCURACIES, response, solve_scene
from stimuli.plate.rest import rest_displacement
from stimuli.plate.waveguide import (
    endless_displacement,
    make_cross_section,
    plate_wavenumber,
)
from tests.test_stimuli.scenes import fingertip_of, load_of, reference_rows, strip_of

if TYPE_CHECKING:
    from stimuli import Load
    from stimuli.arrays import Complex, Real
    from stimuli.plate.strip import Symmetry

EDGES = (SIMPLY_SUPPORTED, CLAMPED, ElasticEdge(stiffness_n=140.0))


def strip_with(edge: Any, **changes: Any) -> Strip:
    sizes = {"width_m": 0.025, "thickness_m": 0.0005, "material": ALUMINIUM, **changes}
    return Strip(**sizes, edge=edge)


@pytest.mark.parametrize(("end", "parity"), [(FREE, 0), (EVEN, 1), (ODD, -1)])
def test_functions_of_a_line_agree_with_their_integrals_and_slopes(
    end: LineEnd, parity: int
) -> None:
    line = make_line([0.0, 0.3, 0.55, 1.0], (20.0, 20.0), (SUPPORTED, end), Margins(2, 3), parity)
    places = np.array([0.1, 0.3, 0.7, 1.0, *([1.3, 1.9] if parity else [])])

    def value(x: float, number: int) -> float:
        return float(line.derivatives([x], (0,))[0][0, number])

    (integrals,) = line.derivatives(places, (-1,))
    kinks = line.kinks_m[1:-1].tolist()
    for row, place in zip(integrals, places, strict=True):
        for number in (0, 7, line.size - 1):
            inner = [kink for kink in kinks if kink < place] or None
            expected = quad(value, 0.0, place, args=(number,), points=inner)[0]
            assert row[number] == pytest.approx(expected, abs=1e-10)
    inside, step = places[:-1] - 0.013, 1e-6
    for order in (0, 1):
        upper, lower = (line.derivatives(inside + h, (order,))[0] for h in (step, -step))
        (slope,) = line.derivatives(inside, (order + 1,))
        assert (upper - lower) / (2 * step) == pytest.approx(slope, rel=1e-6, abs=1e-3)
    assert line.products((0, 0))[0] == pytest.approx(np.eye(line.size), abs=1e-12)
    coarse = make_line([0.0, 0.3, 0.55, 1.0], (20.0, 20.0), (SUPPORTED, end), Margins(2, 2), parity)
    x = np.linspace(0.0, 1.0, 60)
    first = line.derivatives(x, (0,))[0][:, : line.n_coarse]
    (basis,) = coarse.derivatives(x, (0,))
    assert basis @ np.linalg.lstsq(basis, first, rcond=None)[0] == pytest.approx(first, abs=1e-11)


@pytest.mark.parametrize("edge", EDGES)
def test_cut_offs_and_wavenumbers_are_those_of_the_edges(edge: Any) -> None:
    strip = strip_with(edge)
    wavenumber = plate_wavenumber(strip, strip.cutoff_hz(4))
    cutoffs_hz = [
        make_cross_section(strip, wavenumber, parity, Margins(8, 12)).cutoffs_hz()[:2]
        for parity in (1, -1)
    ]
    expected_hz = [
        [strip.cutoff_hz(1), strip.cutoff_hz(3)],
        [strip.cutoff_hz(2), strip.cutoff_hz(4)],
    ]
    assert np.array(cutoffs_hz) == pytest.approx(np.array(expected_hz), rel=1e-11)
    lossy = dataclasses.replace(strip, material=dataclasses.replace(ALUMINIUM, loss_factor=0.02))
    symmetries: list[tuple[int, Symmetry]] = [(1, "symmetric"), (-1, "antisymmetric")]
    for parity, symmetry in symmetries:
        section = make_cross_section(lossy, wavenumber, parity, Margins(8, 12))
        found = section.waves(np.array([1000.0 * math.pi])).wavenumbers_rad_m[0]
        for expected in lossy.wavenumbers_rad_m(500.0, 4, symmetry):
            assert np.abs(found / expected - 1).min() < 1e-9


def endless(strip: Strip, load: Load, points_m: Real, frequency_hz: float) -> Complex:
    """Return the displacement per unit load on a strip without ends."""
    hz = np.array([frequency_hz])
    return np.asarray(
        endless_displacement(strip, [load], points_m, 2 * math.pi * hz, Margins(4, 6))[0, 0]
    )


@pytest.mark.slow
def test_fields_of_endless_strips_are_those_of_another_solver() -> None:
    """The first two points lie at the load, where the field is least smooth; the others do not."""
    at_load: dict[str, list[float]] = {}
    elsewhere = []
    for row in reference_rows("displacements.json"):
        strip, load = strip_of(row), load_of(row["load"])
        if strip.length_m is not None:
            continue
        found = endless(strip, load, np.array(row["points_m"]), row["frequency_hz"])
        expected = np.array([complex(*value) for value in row["value_m"]])
        error = np.abs(found - expected) / row["largest_m"]
        at_load.setdefault(row["load"]["kind"], []).append(float(error[:2].max()))
        elsewhere.append(float(error[2:].max()))
    assert len(elsewhere) == 170
    assert max(elsewhere) < 1e-5
    largest = {kind: max(errors) for kind, errors in at_load.items()}
    assert largest.pop("PointForce") < 2e-3
    assert max(largest.values()) < 6e-4
    assert {kind: np.median(errors) < 2e-5 for kind, errors in at_load.items()} == {
        kind: kind != "PointForce" for kind in at_load
    }


@pytest.mark.parametrize("edge", EDGES)
def test_a_finer_basis_lowers_every_frequency(edge: Any) -> None:
    """By Rayleigh and Ritz frequencies are never too low."""
    strip = strip_with(edge, length_m=0.1)
    force = PointForce(x_m=0.01, y_m=0.01)
    for basis in plate_bases(strip, 6000.0, Resolution(), [force]):
        fine, _ = basis.modes(np.arange(basis.is_coarse.size))
        coarse, shapes = basis.modes(np.flatnonzero(basis.is_coarse))
        assert (fine[: coarse.size] <= coarse * (1 + 1e-9)).all()
        assert coarse[:3] == pytest.approx(fine[:3], rel=3e-3)
        mass = basis.matrices[1][np.ix_(basis.is_coarse, basis.is_coarse)]
        assert shapes.T @ mass @ shapes == pytest.approx(np.eye(coarse.size), abs=1e-9)


def test_a_long_plate_rests_as_an_endless_strip() -> None:
    """Two methods for one field: all waves of the strip, or functions around the load."""
    strip = strip_with(CLAMPED, length_m=0.2)
    disc = MomentDisc(x_m=0.01, y_m=0.0125, radius_m=0.0064)
    points_m = np.array([(0.01, 0.0125), (0.013, 0.01), (0.022, 0.0125), (0.035, 0.008)])
    field = rest_displacement(
        strip,
        [disc],
        points_m,
        np.ones(1, dtype=np.complex128),
        max_hz=2000.0,
        resolution=ACCURACIES[0].rest,
    )
    expected_m = endless(dataclasses.replace(strip, length_m=None), disc, points_m, 0.0).real
    rest_m = field[1, 0, 0, 0].real
    assert rest_m == pytest.approx(expected_m, abs=2e-4 * np.abs(expected_m).max())


@pytest.mark.parametrize(
    "step", [pytest.param(20, id="some"), pytest.param(1, id="all", marks=pytest.mark.slow)]
)
def test_displacements_are_those_of_another_solver_within_their_error(step: int) -> None:
    errors: dict[tuple[bool, str], list[float]] = {}
    for row in reference_rows("displacements.json")[::step]:
        strip, load = strip_of(row), load_of(row["load"])
        scene = Scene(strip=strip, loads=(load,), points_m=tuple(row["points_m"]))
        expected = np.array([complex(*value) for value in row["value_m"]])
        for accuracy in ACCURACIES:
            answer, _ = solve_scene(scene, np.array([row["frequency_hz"]]), accuracy)
            error = np.abs(answer.value[0, 0] - expected)
            assert (error <= answer.error[0, 0]).all(), row
        kind = strip.length_m is None, row["load"]["kind"]
        errors.setdefault(kind, []).append(float(error.max() / row["largest_m"]))
    for (_, load_kind), values in errors.items():
        assert np.median(values) < (1e-3 if load_kind == "PointForce" else 3e-5), load_kind


def test_a_tolerance_is_kept_or_refused_with_the_one_that_can_be_kept() -> None:
    strip = strip_with(CLAMPED, length_m=0.2)
    disc = MomentDisc(x_m=0.01, y_m=0.0125, radius_m=0.0064)
    scene = Scene(strip=strip, loads=(disc,), points_m=((0.01, 0.0125), (0.03, 0.0125)))
    for rtol in (1e-2, 2e-3):
        answer = response(scene, [300.0], rtol)
        assert (answer.error <= rtol * np.abs(answer.value)).all()
    with pytest.raises(PlateError) as refusal:
        response(scene, [300.0], rtol=1e-9)
    assert refusal.value.rule is Rule.TOLERANCE
    min_rtol = float(refusal.value.values["min_rtol"])
    assert response(scene, [300.0], min_rtol * 1.001).error.shape == (1, 1, 2)


def test_weak_fields_of_endless_strips_keep_a_tolerance() -> None:
    disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    points_m = ((0.0, 0.0125), (0.07, 0.0125))
    scene = Scene(strip=strip_with(CLAMPED), loads=(disc,), points_m=points_m)
    own, weak = response(scene, [300.0], rtol=1e-4).value[0, 0]
    assert abs(weak) < 1e-4 * abs(own)


@pytest.mark.parametrize(
    "step",
    [
        pytest.param(107, id="two", marks=pytest.mark.slow),
        pytest.param(5, id="more", marks=pytest.mark.slow),
    ],
)
def test_peaks_at_fingertips_are_those_of_another_solver_within_their_error(step: int) -> None:
    for row in reference_rows("peaks.json")[::step]:
        loads = [load_of(load) for load in row["loads"]]
        fingertips = [fingertip_of(fingertip) for fingertip in row["fingertips"]]
        estimate = fingertip_peaks(strip_of(row), loads, fingertips, Burst(**row["burst"]))
        expected_m, driven_m = np.array(row["peak_m"]), np.max(row["peak_m"], axis=0)
        difference_m = np.abs(estimate.value - expected_m)
        assert (difference_m <= estimate.error).all(), row
        has_patches = row["kind"] == "patches"
        is_driven = expected_m == driven_m
        relative = difference_m / expected_m
        assert relative[is_driven].max() < (4e-3 if has_patches else 1e-3)
        is_loud = expected_m > 10 ** (-50 / 20) * driven_m
        assert relative[is_loud].max() < 10 ** ((0.15 if has_patches else 0.05) / 20) - 1


def patch_on(strip: Strip, **sizes: Any) -> BondedPatch:
    """Return a patch in the middle of a plate, 0.2 mm of its own material."""
    layer = layer_of(strip.material, 0.0002)
    return BondedPatch(x_m=0.0, y_m=strip.width_m / 2, layers=(layer,), **sizes)


def frequencies_of(strip: Strip, resolution: Resolution) -> Real:
    """Return the lowest squared frequencies that are even along and across."""
    centred = PointForce(x_m=0.0, y_m=strip.width_m / 2)
    (basis,) = plate_bases(strip, strip.cutoff_hz() * 2, resolution, [centred])
    squared, _ = basis.modes(np.arange(basis.is_coarse.size))
    return squared[:4]


@pytest.mark.parametrize("edge", EDGES[:2])
def test_a_patch_of_the_plates_own_material_makes_it_thicker(edge: Any) -> None:
    strip = strip_with(edge, length_m=0.1)
    patch = patch_on(strip, length_x_m=0.1, length_y_m=0.025)
    covered = dataclasses.replace(strip, patches=(patch,))
    thicker = dataclasses.replace(strip, thickness_m=0.0007)
    fine = Resolution(margins=Margins(4, 6))
    assert frequencies_of(covered, fine) == pytest.approx(frequencies_of(thicker, fine), rel=1e-4)


@pytest.mark.slow
def test_functions_at_the_rim_of_a_patch_only_speed_up_convergence() -> None:
    strip = strip_with(CLAMPED, length_m=0.08)
    disc = patch_on(strip, length_x_m=0.013, length_y_m=0.013, is_disc=True)
    covered = dataclasses.replace(strip, patches=(disc,))
    limit = frequencies_of(covered, Resolution(margins=Margins(8, 10), rim_degrees=(5, 6)))
    without, with_rim = (
        frequencies_of(covered, Resolution(margins=Margins(6, 8), rim_degrees=degrees)) / limit - 1
        for degrees in ((0, 0), (4, 4))
    )
    assert np.all(with_rim > 0)  # a basis stiffens a plate
    assert np.all(with_rim < 0.6 * without)
    assert np.all(without < 2e-4)


@pytest.mark.parametrize("length_m", [None, 0.2])
def test_a_field_without_bounds_is_refused(length_m: float | None) -> None:
    """Without loss the field is infinite at a cut-off, and at a resonance."""
    strip = strip_with(SIMPLY_SUPPORTED, length_m=length_m)
    frequency_hz = strip.cutoff_hz()
    force = PointForce(x_m=0.01, y_m=0.01)
    if length_m:
        (basis,) = plate_bases(strip, frequency_hz, Resolution(), [PointForce(x_m=0.0, y_m=0.0125)])
        frequency_hz = math.sqrt(basis.modes(basis.resolutions()[1])[0][0]) / (2 * math.pi)
    with pytest.raises(PlateError) as refusal:
        response(Scene(strip=strip, loads=(force,), points_m=((0.0, 0.01),)), [frequency_hz])
    assert refusal.value.rule is Rule.INFINITE
    assert refusal.value.values == {"frequency_hz": frequency_hz}
