"""The estimate of the error against the error, every wave found, and borders that do not show."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from stimuli import (
    ElasticEdge,
    ForceRectangle,
    Load,
    MomentDisc,
    MomentRectangle,
    PressureDisc,
    PressureRectangle,
    Scene,
    displacement,
    response,
)
from stimuli.solver.guided import guided
from stimuli.strip.roots import decays_squared
from stimuli.strip.waves import Section, outgoing_root
from tests.test_stimuli.plates import (
    EDGES,
    FIRM,
    PLATE,
    SUPPORTED,
    Edge,
    W,
    disc,
    each_edge,
    force,
    on,
    patch,
    scene_of,
    within,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli import Response
    from stimuli.arrays import Complex

TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8)


def drawn_scene(rng: np.random.Generator) -> Scene:
    edge = EDGES[rng.integers(3)]
    if edge is FIRM:
        edge = ElasticEdge(stiffness_n=10.0 ** rng.uniform(-4, 8), lossless=rng.random() < 0.5)
    loss = float(rng.choice([0.0, 0.5, 10.0 ** rng.uniform(-4, -0.3)]))
    y = float(rng.choice([W / 2, rng.uniform(0.05, 0.95) * W]))
    room = float(min(y, W - y) * 10.0 ** rng.uniform(-1.5, 0) * 0.999)
    along = W * 10.0 ** rng.uniform(-2, 0.5)
    loads: list[Load] = [force(0.0, y)]
    loads += [disc(room, y_m=y, kind=kind) for kind in (PressureDisc, MomentDisc)]
    kinds = (PressureRectangle, MomentRectangle, ForceRectangle)
    loads += [patch(along, 2 * room, y_m=y, kind=kind) for kind in kinds]
    distances_m = np.array([0.0, 0.3 * rng.random(), 0.3 * 10.0 ** rng.uniform(-3, 0)])
    points = ((float(x), float(rng.uniform(0.02, 0.98) * W)) for x in distances_m)
    return scene_of(on(edge, loss=loss), loads[rng.integers(6)], *points)


class Tally:
    """How often the error keeps to the tolerance and to its estimate."""

    def __init__(self) -> None:
        self.kept: list[bool] = []
        self.covered: list[NDArray[np.bool_]] = []
        self.narrow: list[NDArray[np.bool_]] = []

    def add(self, found: Response, true_m: Complex, rtol: float, least_hz: float) -> None:
        """Compare, all but what rounding alone may leave: more of it at low frequencies."""
        size_m = np.max(np.abs(true_m), axis=(1, 2), keepdims=True)
        k2 = math.pi**2 * least_hz / SUPPORTED.cutoff_hz()
        floor_m = 1e-14 * (1 + 10 / k2) * np.max(size_m)
        rows = slice(len(true_m))
        error_m = np.abs(found.displacement_m[rows] - true_m)
        self.kept.append(within(found.displacement_m[rows], true_m, rtol, axis=(1, 2)))
        # the reference rounds as well
        told_m = found.error_m[rows]
        self.covered.append(told_m + 1e-12 * np.abs(true_m) + floor_m >= error_m)
        self.narrow.append(told_m <= 100 * np.maximum(error_m, floor_m))

    def check(self) -> None:
        """The estimate is no less than the error and at most a hundred times it."""
        assert all(self.kept)
        assert np.mean(self.covered) >= 0.99
        assert np.mean(self.narrow) >= 0.99


@pytest.mark.parametrize("loss", [0.0, 1e-6, 0.009])
@pytest.mark.parametrize("sign", [1, -1])
def test_waves_between_clamps_from_the_table_lack_no_more_than_they_say(
    sign: int, loss: float
) -> None:
    k = (np.linspace(0.05, 7.1, 500) * (1 - 0.25j * loss)).astype(np.complex128)
    found, sought = (guided(k, np.zeros_like(k), 4, sign, rtol) for rtol in (1e-6, 0.0))
    assert found.lack > sought.lack == 0.0
    apart = np.abs(np.diff(sought.p, axis=1, prepend=np.inf, append=np.inf))
    pairing = 1 + np.abs(sought.p) / np.minimum(apart[:, 1:], apart[:, :-1])
    # two waves of a pair may come in either order
    missing = np.abs(found.p[:, :, np.newaxis] ** 2 - sought.p[:, np.newaxis] ** 2).min(axis=1)
    assert np.all(missing <= found.lack * pairing)


@pytest.mark.slow
def test_the_estimate_is_no_less_than_the_error_and_at_most_a_hundred_times_it() -> None:
    rng, tally = np.random.default_rng(21), Tally()
    for _ in range(150):
        scene, f = drawn_scene(rng), float(10.0 ** rng.uniform(0, math.log10(2e4)))
        true_m = displacement(scene, [f], 1e-12)
        for rtol in TOLERANCES:
            tally.add(response(scene, [f], rtol), true_m, rtol, f)
    tally.check()


@pytest.mark.slow
def test_so_it_is_between_the_frequencies_that_are_solved() -> None:
    rng, tally = np.random.default_rng(22), Tally()
    for _ in range(40):
        scene = drawn_scene(rng)
        top_hz = scene.strip.cutoff_hz() * rng.uniform(0.05, 0.9)
        some_hz = np.sort(rng.uniform(0.01, 1.0, 4)) * top_hz
        true_m = np.array([displacement(scene, [f], 1e-12)[0] for f in some_hz])
        for rtol in TOLERANCES:
            found = response(scene, np.append(some_hz, np.linspace(4.0, top_hz, 60)), rtol)
            if found.work.frequencies_solved < 64:
                tally.add(found, true_m, rtol, float(some_hz[0]))
    assert np.size(tally.covered) > 1000
    tally.check()


def test_the_number_of_solved_frequencies_does_not_grow_with_those_asked() -> None:
    scene = scene_of(PLATE, disc(), (0.0, W / 2), (0.02, W / 2))
    for rtol in (1e-2, 1e-6, 1e-12):
        sweeps_hz = (np.linspace(4.0, 1500.0, n) for n in (50, 500, 50_000))
        (solved,) = {scene.work(sweep_hz, rtol).frequencies_solved for sweep_hz in sweeps_hz}
        assert solved < 20


@pytest.mark.slow
@pytest.mark.parametrize("sign", [1, -1])
def test_no_wave_is_lost_nor_found_twice(sign: int) -> None:
    rng = np.random.default_rng(23)
    for _ in range(60):
        k = 10.0 ** rng.uniform(-0.7, 1.5) * np.exp(1j * rng.choice([0.0, 0.1, 0.5]))
        hold = rng.choice([0.0, 10.0 ** rng.uniform(-6, 6)]) + 0j
        n = int(k.real / (2 * np.pi)) + 6
        section = Section(bending=complex(k / 2) ** 2, compliance=2 * hold, symmetric=sign > 0)
        other = 2 * outgoing_root(-decays_squared(section, n + 2))
        p = guided(np.array([k]), np.array([hold]), n, sign).p[0]
        apart = np.abs(p[:, np.newaxis] ** 2 - other**2)
        assert np.all(np.min(apart, axis=1) < 1e-9 * (np.abs(p) ** 2 + np.abs(k) ** 2))
        assert len(set(np.argmin(apart, axis=1))) == n
        assert p[-1].imag <= other[n - 1].imag * (1 + 1e-9) + 1e-9


# --- borders -------------------------------------------------------------------------------------

POINTS = ((0.0, 0.01), (0.004, 0.02), (0.08, 0.012))
K_W_IS_1 = 1 / math.pi
K_R_IS_3 = 3.0 / (0.4 * math.pi)


@pytest.mark.parametrize(
    ("load", "k"),
    [
        (force(0.0, 0.011), K_W_IS_1),
        (disc(0.005, y_m=0.011), K_W_IS_1),
        (disc(0.4 * W, kind=PressureDisc), K_R_IS_3),
        (disc(0.4 * W), K_R_IS_3),
    ],
)
@each_edge
def test_the_way_a_norm_or_a_disc_is_taken_does_not_show(edge: Edge, load: Load, k: float) -> None:
    border_hz = SUPPORTED.cutoff_hz() * k**2
    scene = scene_of(on(edge), load, *POINTS)
    below, above = displacement(scene, [border_hz * (1 - 1e-10), border_hz * (1 + 1e-10)], 1e-12)
    np.testing.assert_allclose(below, above, rtol=1e-8 if k > 1 else 1e-9)


@pytest.mark.parametrize("rtol", TOLERANCES)
def test_close_waves_are_summed_to_the_tolerance_wherever_they_are_taken_together(
    rtol: float,
) -> None:
    detuning = np.concatenate([[0.0], 10.0 ** -np.arange(1.0, 13.0), -(10.0 ** -np.arange(2, 13))])
    scene = scene_of(PLATE, force(0.0, 0.011), (0.0, 0.01), (0.02, 0.009), (0.1, 0.012))
    frequencies_hz = PLATE.exceptional_point_hz() * (1 + detuning)
    rough, exact = (displacement(scene, frequencies_hz, tol)[:, 0] for tol in (rtol, 1e-12))
    assert within(rough, exact, rtol, axis=1)
