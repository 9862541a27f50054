"""What is told of random plates with patches, beside finite elements and runs that are finer."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from benchmarks.plate_fem import in_modes, model
from stimuli import (
    CLAMPED,
    SIMPLY_SUPPORTED,
    BondedPatch,
    Burst,
    ElasticEdge,
    Fingertip,
    Layer,
    MomentDisc,
    MomentRectangle,
    Strip,
    causal,
    felt,
)
from stimuli.fingers.fingertip import asked
from stimuli.fingers.work import felt_known
from stimuli.motion.motion import motion_of, reference_of
from stimuli.motion.patches import around, functions, matrices
from stimuli.motion.peaks import peaks_of, wait_of
from stimuli.strip.material import MATERIALS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from stimuli.arrays import Real

CERAMIC = Layer(
    thickness_m=0.2e-3, youngs_modulus_pa=62e9, poisson_ratio=0.31, density_kg_m3=7800.0
)
BRASS = Layer(thickness_m=0.1e-3, youngs_modulus_pa=105e9, poisson_ratio=0.35, density_kg_m3=8530.0)

Plate = tuple[Strip, list[Any], list[Fingertip], Burst]


def drawn(seed: int, *, round_ones: bool) -> Plate:
    """A plate of any material, size and edge, with two patches that are not mirror images."""
    rng = np.random.default_rng((7, seed))
    width_m, thickness_m = rng.uniform(0.015, 0.03), float(rng.choice([0.3e-3, 0.5e-3, 0.8e-3]))
    material = MATERIALS[str(rng.choice(["steel", "glass", "brass", "pmma"]))].material
    strip = Strip(
        width_m=width_m, thickness_m=thickness_m, length_m=width_m * rng.uniform(4.5, 6),
        material=dataclasses.replace(material, loss_factor=float(rng.choice([0.005, 0.01, 0.02]))),
        edge=(CLAMPED, SIMPLY_SUPPORTED)[seed % 2],
    )  # fmt: skip
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
                x_m=x_m, y_m=y_m, length_x_m=along_m, length_y_m=across_m, layers=layers,
                is_disc=round_ones,
            )
        )  # fmt: skip
        load: Any = MomentDisc(x_m=x_m, y_m=y_m, radius_m=along_m / 2)
        if not round_ones:
            load = MomentRectangle(x_m=x_m, y_m=y_m, length_x_m=along_m, length_y_m=across_m)
        loads.append(load)
        tips.append(Fingertip(x_m=x_m, y_m=y_m, radius_m=0.003))
    burst = Burst(
        frequency_hz=float(rng.choice([0.1, 0.25])) * strip.cutoff_hz(), cycles=1,
        window=("none", "tukey", "hann")[rng.integers(3)],
    )  # fmt: skip
    return dataclasses.replace(strip, patches=tuple(patches)), loads, tips, burst


def by_elements(plate: Plate, size_m: float) -> Real:
    """What each finger feels of each load, by the modes of finite elements."""
    strip, loads, tips, burst = plate
    areas = [tip.points_m(strip) for tip in tips]
    points_m = [point for area in areas for point in area]
    rate_hz = 64 * max(strip.cutoff_hz(), burst.band_hz()[1])
    far_m = abs(tips[1].x_m - tips[0].x_m) + tips[0].radius_m
    samples = np.append(
        burst.samples(rate_hz), np.zeros(round(2 * wait_of(strip, far_m) * rate_hz))
    )
    viscous_s = causal(strip, burst).material.viscous_time_s
    found = []
    for load in loads:
        elements = model(strip, load, points_m, size_m)
        moved_m = in_modes(100, elements, samples, 1 / rate_hz, viscous_s)
        peaks_m = np.split(np.max(np.abs(moved_m), axis=1), [len(areas[0])])
        found.append([np.max(one) for one in peaks_m])
    return np.array(found).T


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_rectangles_are_known_as_well_as_told_by_finite_elements(seed: int) -> None:
    plate = drawn(seed, round_ones=False)
    found, told = felt(*plate), felt_known(*plate).error_m
    assert told is not None
    true = by_elements(plate, plate[0].width_m / 20)
    assert np.all(abs(found - true) <= told)
    assert np.all(np.diag(told) <= 0.01 * np.diag(found))


@pytest.fixture
def finer(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Twice as many functions of each patch, more waves, more nodes."""
    for module, name, value in (
        (around, "_HUMPS", 3), (around, "_MORE_HUMPS", 6), (around, "_FINEST", 4),
        (around, "_POWERS", 18), (functions, "_DIGITS", 6.0), (functions, "_DEGREE", 5),
        (matrices, "_NODES", 8),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    caches = (around._hump_series, around._side_series, around._pairs)
    for cache in caches:
        cache.cache_clear()
    yield
    for cache in caches:
        cache.cache_clear()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3, 7])
def test_discs_are_known_as_well_as_told(seed: int, request: pytest.FixtureRequest) -> None:
    plate = drawn(seed, round_ones=True)
    strip, _, _, burst = plate
    found, told = felt(*plate), felt_known(*plate).error_m
    assert told is not None
    request.getfixturevalue("finer")
    scene, places, far_m = asked(*plate)
    motion = motion_of(scene, reference_of(scene, burst), 11.0)
    true = peaks_of(motion, places, burst, wait_s=wait_of(strip, far_m), with_error=False).peak_m
    assert np.all(abs(found - true) <= told)
    assert np.all(np.diag(abs(found - true)) <= 2e-3 * np.diag(true))


WIDE: tuple[Plate, ...] = tuple(
    (
        Strip(
            width_m=width_m, thickness_m=0.5e-3, length_m=length_m, edge=SIMPLY_SUPPORTED,
            material=dataclasses.replace(MATERIALS[name].material, loss_factor=loss_factor),
            patches=tuple(
                BondedPatch(
                    x_m=x_m, y_m=y_m, length_x_m=9e-3, length_y_m=9e-3, layers=(CERAMIC,),
                    is_disc=True,
                )
                for x_m, y_m in places_m
            ),
        ),
        [MomentDisc(x_m=x_m, y_m=y_m, radius_m=4.5e-3) for x_m, y_m in places_m],
        [Fingertip(x_m=x_m, y_m=y_m, radius_m=3e-3) for x_m, y_m in places_m],
        Burst(frequency_hz=frequency_hz, cycles=1, window="hann"),
    )
    for name, width_m, length_m, loss_factor, frequency_hz, places_m in (
        ("glass", 0.034, 0.47, 0.003, 144.0, ((-0.022, 0.017), (0.025, 0.017))),
        ("brass", 0.0325, 0.298, 0.01, 104.0, ((-0.007, 0.018), (0.048, 0.015))),
    )
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("plate", WIDE, ids=["glass", "brass"])
def test_discs_a_quarter_as_wide_as_the_plate(plate: Plate, request: pytest.FixtureRequest) -> None:
    """Functions that reach 0.3 widths beyond them leave up to 0.3 dB here."""
    strip, _, _, burst = plate
    known = felt_known(*plate)
    request.getfixturevalue("finer")
    scene, places, far_m = asked(*plate)
    motion = motion_of(scene, reference_of(scene, burst), 12.0)
    true = peaks_of(motion, places, burst, wait_s=wait_of(strip, far_m), with_error=False).peak_m
    assert known.error_m is not None
    assert np.all(abs(known.peak_m - true) <= known.error_m)
    assert np.max(abs(20 * np.log10(known.peak_m / true))) < 0.1
