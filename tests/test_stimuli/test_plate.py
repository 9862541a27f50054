"""One basis for waves and modes, beside closed forms and values of another solver."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import quad

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    ElasticEdge,
    MomentDisc,
    Strip,
)
from stimuli.plate.area import local_field
from stimuli.plate.line import EVEN, FREE, ODD, SUPPORTED, LineEnd, Margins, make_line
from stimuli.plate.modes import Resolution, plate_bases
from stimuli.plate.waveguide import (
    endless_displacement,
    make_cross_section,
    plate_wavenumber,
)
from stimuli.strip.patch import layer_of
from tests.test_stimuli.scenes import load_of, reference_rows, strip_of

if TYPE_CHECKING:
    from stimuli import Load
    from stimuli.arrays import Complex, Real
    from stimuli.strip.strip import Symmetry

EDGES = (SIMPLY_SUPPORTED, CLAMPED, ElasticEdge(stiffness_n=140.0))


def strip_with(edge: Any, **changes: Any) -> Strip:
    sizes = {"width_m": 0.025, "thickness_m": 0.0005, "material": ALUMINIUM, **changes}
    return Strip(**sizes, edge=edge)


@pytest.mark.parametrize(("end", "parity"), [(FREE, 0), (EVEN, 1), (ODD, -1)])
def test_functions_of_a_line_agree_with_their_integrals_and_slopes(
    end: LineEnd, parity: int
) -> None:
    line = make_line([0.0, 0.3, 0.55, 1.0], 20.0, (SUPPORTED, end), Margins(2, 3), parity)
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
    coarse = make_line([0.0, 0.3, 0.55, 1.0], 20.0, (SUPPORTED, end), Margins(2, 2), parity)
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
        found = section.waves(np.array([500.0])).wavenumbers_rad_m[0]
        for expected in lossy.wavenumbers_rad_m(500.0, 4, symmetry):
            assert np.abs(found / expected - 1).min() < 1e-9


def endless(strip: Strip, load: Load, points_m: Real, frequency_hz: float) -> Complex:
    """Return the displacement per unit load on a strip without ends."""
    hz = np.array([frequency_hz])
    return np.asarray(endless_displacement(strip, load, points_m, hz, Margins(4, 6))[0])


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
    for basis in plate_bases(strip, 6000.0, Resolution(), excites_odd=True):
        fine, _ = basis.modes(np.arange(basis.is_coarse.size))
        coarse, shapes = basis.modes(np.flatnonzero(basis.is_coarse))
        assert (fine[: coarse.size] <= coarse * (1 + 1e-9)).all()
        assert coarse[:3] == pytest.approx(fine[:3], rel=3e-3)
        mass = basis.matrices[2][np.ix_(basis.is_coarse, basis.is_coarse)]
        assert shapes.T @ mass @ shapes == pytest.approx(np.eye(coarse.size), abs=1e-9)


def test_a_long_plate_rests_as_an_endless_strip() -> None:
    strip = strip_with(CLAMPED, length_m=0.2)
    disc = MomentDisc(x_m=0.01, y_m=0.0125, radius_m=0.0064)
    points_m = np.array([(0.01, 0.0125), (0.013, 0.01), (0.022, 0.0125), (0.035, 0.008)])
    resolution = Resolution(margins=Margins(6, 8))
    rest_m = local_field(disc, points_m) / strip.bending_stiffness_n_m
    for basis in plate_bases(strip, 2000.0, resolution, [disc], excites_odd=False):
        stiffness, springs, _ = basis.matrices
        amplitudes = np.linalg.solve(stiffness + springs, basis.remaining_work(disc))
        rest_m += basis.values(points_m) @ amplitudes
    expected_m = endless(dataclasses.replace(strip, length_m=None), disc, points_m, 0.0).real
    assert rest_m == pytest.approx(expected_m, abs=2e-4 * np.abs(expected_m).max())


def patch_on(strip: Strip, **sizes: Any) -> BondedPatch:
    """Return a patch in the middle of a plate, 0.2 mm of its own material."""
    layer = layer_of(strip.material, 0.0002)
    return BondedPatch(x_m=0.0, y_m=strip.width_m / 2, layers=(layer,), **sizes)


def frequencies_of(strip: Strip, resolution: Resolution) -> Real:
    """Return the lowest squared frequencies that are even along and across."""
    basis = plate_bases(strip, strip.cutoff_hz() * 2, resolution, excites_odd=True)[0]
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
