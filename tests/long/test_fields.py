"""Fields of many random plates: where waves meet, and with fingers that rest on them."""

from __future__ import annotations

import dataclasses

import numpy as np

from stimuli import (
    CLAMPED,
    MATERIALS,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    Fingertip,
    Impedance,
    MomentDisc,
    Scene,
    Strip,
    causal,
)
from tests.long.test_fuzz import rounds
from tests.test_stimuli.meetings import check_estimates_at_meetings
from tests.test_stimuli.modes import steady_by_receptances, steady_motion
from tests.test_stimuli.plates import CYCLE, Edge


def test_the_estimate_is_above_the_error_at_and_beside_meetings() -> None:
    check_estimates_at_meetings(seed=33, strips=rounds(40))


def test_fingers_couple_the_modes_of_random_plates_as_receptances_do() -> None:
    rng = np.random.default_rng(12)
    errors: list[float] = []
    bare_errors: list[float] = []
    for _ in range(40):
        elastic = ElasticEdge(stiffness_n=10 ** rng.uniform(0.5, 3))
        edges: list[Edge] = [SIMPLY_SUPPORTED, CLAMPED, elastic]
        name = ["aluminium", "steel", "glass", "brass", "pmma"][rng.integers(5)]
        lossy = dataclasses.replace(MATERIALS[name].material, loss_factor=rng.uniform(0.005, 0.05))
        strip = Strip(
            width_m=rng.uniform(0.015, 0.03),
            thickness_m=rng.uniform(2e-4, 1e-3),
            length_m=rng.uniform(0.1, 0.2),
            material=lossy,
            edge=edges[rng.integers(3)],
        )
        strip = causal(strip, CYCLE)
        x_m, y_m = rng.uniform(0.015, 0.04, 2), strip.width_m * rng.uniform(0.45, 0.55, 2)
        tips = []
        for x, y in zip(x_m * [-1, 1], y_m, strict=True):
            radius_m = rng.uniform(0.002, 0.0065)
            mass_kg, stiffness_n_m, damping = 10 ** rng.uniform([-5, 1, -2], [-2.5, 4.5, 1.5])
            impedance = Impedance(
                mass_kg=mass_kg,
                stiffness_n_m=stiffness_n_m,
                damping_n_s_m=damping,
                holds_up_to_hz=5e3,
            )
            tips.append(Fingertip(x_m=x, y_m=y, radius_m=radius_m, impedance=impedance))
        loads = tuple(MomentDisc(x_m=tip.x_m, y_m=tip.y_m, radius_m=0.005) for tip in tips)
        points_m = tuple((tip.x_m, tip.y_m) for tip in tips)
        scene = Scene(strip=strip, loads=loads, points_m=points_m)
        for at_hz in strip.cutoff_hz() * rng.uniform(0.02, 1.5, 3):
            for fingers, found in ((tips, errors), ([], bare_errors)):
                exact = steady_by_receptances(scene, fingers, at_hz)
                ours = steady_motion(scene, at_hz, fingers)
                found.append(np.abs(ours - exact).max() / np.abs(exact).max())
    pressed, bare = ((np.median(some), max(some)) for some in (errors, bare_errors))
    assert pressed[0] < 2 * bare[0]
    assert pressed[1] < 3 * bare[1]
