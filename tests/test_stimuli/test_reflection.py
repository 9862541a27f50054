"""What an end turns back: two methods agree, no power is lost, the estimate covers the error."""

from __future__ import annotations

import dataclasses
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from stimuli import (
    ALUMINIUM,
    CLAMPED,
    SIMPLY_SUPPORTED,
    ElasticEdge,
    MomentDisc,
    PointForce,
    Scene,
    Strip,
)
from stimuli.field.field import solve
from stimuli.solver.ends import ends
from stimuli.solver.ends.reflection import corner_powers, reflections
from stimuli.solver.guided import guided

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.solver.source import Answered, Question
    from tests.test_stimuli.plates import Edge

PLATE = Strip(
    width_m=0.025,
    thickness_m=0.0005,
    material=ALUMINIUM,
    edge=CLAMPED,
    length_m=0.2,
)
SPRINGS = {"soft": 1.0, "measured": 141.72, "stiff": 3e3, "stiffest": 1e7}
EDGES: dict[str, Edge] = {
    "clamped": CLAMPED,
    **{name: ElasticEdge(stiffness_n=k) for name, k in SPRINGS.items()},
}


def fitted_and_turned_back(
    scene: Scene, frequency_hz: float, rtol: float, monkeypatch: pytest.MonkeyPatch
) -> tuple[Answered, Answered] | None:
    """Return the field with fitted ends at 1e-10 and that by waves, if waves are enough."""
    counts: list[NDArray[np.intp]] = []
    count_of = ends._felt

    def counted(question: Question, *given: Any) -> NDArray[np.intp]:
        counts.append(count_of(question, *given))
        return counts[-1]

    def never(question: Question, *_: object) -> NDArray[np.intp]:
        return np.zeros(question.across.size, dtype=np.intp)

    at_hz = np.array([complex(frequency_hz)])
    monkeypatch.setattr(ends, "_felt", counted)
    waves = solve(scene, at_hz, rtol)
    monkeypatch.setattr(ends, "_felt", never)
    fitted = solve(scene, at_hz, 1e-10)
    monkeypatch.setattr(ends, "_felt", count_of)
    return (fitted, waves) if any(np.any(count) for count in counts) else None


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.0, 0.01])
@pytest.mark.parametrize("edge", EDGES)
def test_waves_turned_back_agree_with_fitted_ends(
    edge: str, loss: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    material = dataclasses.replace(ALUMINIUM, loss_factor=loss)
    strip = dataclasses.replace(PLATE, material=material, edge=EDGES[edge])
    scene = Scene(
        strip=strip,
        loads=(MomentDisc(x_m=0.035, y_m=0.0125, radius_m=0.0064),),
        points_m=((0.035, 0.0125), (-0.035, 0.0125), (0.0, 0.006)),
    )
    both = fitted_and_turned_back(scene, 5100.0, 1e-6, monkeypatch)
    assert both is not None
    fitted, waves = both
    apart = np.abs(waves.value - fitted.value) / np.abs(fitted.value)
    assert np.max(apart) < 1e-7
    assert np.all(np.abs(waves.value - fitted.value) <= waves.error + fitted.error)


@pytest.mark.parametrize("to_clamped", [0.3, 0.9, 0.97, 0.99999])
@pytest.mark.parametrize("nu", [-0.2, 0.0, 1e-12, 1e-6, 0.02, 0.0355, 0.499999])
@pytest.mark.slow
def test_powers_that_meet_in_a_corner_leave_a_finite_field(
    nu: float, to_clamped: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # at 0 and towards 0.5 a clamp and a spring share powers; at 0.0355 two of a clamp's meet
    material = dataclasses.replace(ALUMINIUM, poisson_ratio=nu)
    clamped = dataclasses.replace(PLATE, material=material)
    least = dataclasses.replace(clamped, edge=SIMPLY_SUPPORTED).cutoff_hz()
    strip = clamped.with_cutoff(least + (clamped.cutoff_hz() - least) * to_clamped)
    scene = Scene(
        strip=strip,
        loads=(MomentDisc(x_m=-0.035, y_m=0.0125, radius_m=0.006),),
        points_m=((0.0, 0.0125), (0.035, 0.0125)),
    )
    for part in (1.001, 1.125, 2.0):
        both = fitted_and_turned_back(scene, strip.cutoff_hz(2) * part, 1e-6, monkeypatch)
        assert both is not None
        fitted, waves = both
        assert np.all(np.isfinite(waves.value))
        assert np.all(waves.error < 1e-4 * np.max(np.abs(fitted.value)))
        assert np.all(np.abs(waves.value - fitted.value) <= waves.error + fitted.error)


def test_fields_that_depend_on_each_other_are_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    def twice(*_: object, **__: object) -> None:
        raise np.linalg.LinAlgError("Singular matrix")

    scene = Scene(
        strip=PLATE,
        loads=(MomentDisc(x_m=-0.035, y_m=0.0125, radius_m=0.006),),
        points_m=((0.035, 0.0125),),
    )
    at_hz = np.array([complex(5100.0)])
    waves = solve(scene, at_hz, 1e-6)
    monkeypatch.setattr(ends, "reflections", twice)
    fitted = solve(scene, at_hz, 1e-6)
    assert np.all(np.abs(waves.value - fitted.value) <= waves.error + fitted.error)


@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("sign", [1, -1])
def test_without_loss_waves_that_propagate_come_back_whole(edge: str, sign: int) -> None:
    k, compliance = np.array([16.0 + 0j]), 0.0
    if edge != "clamped":
        compliance = PLATE.bending_stiffness_n_m / (SPRINGS[edge] * PLATE.width_m)
    hold = np.array([complex(compliance)])
    waves = guided(k, hold, 12, sign)
    running = np.flatnonzero(waves.p[0].imag == 0)
    (found,) = reflections(k, hold, (waves,), 0.346, rtol=1e-6, count=6)
    back = -found.arriving[0]
    back = back[np.ix_(running, running)]
    assert running.size > 1
    assert np.abs(back @ back.conj().T - np.eye(running.size)).max() < 1e-6


@pytest.mark.parametrize("nu", [0.0, 0.03, 0.2, 0.346, 0.49, 0.5])
def test_powers_of_the_corner_are_all_roots_below_seven(nu: float) -> None:
    def defect(z: complex) -> complex:
        side = 4 - (1 - nu) ** 2 * z * z
        return complex((3 + nu) * (1 - nu) * np.sin(np.pi * z / 2) ** 2 - side)

    found = np.array(corner_powers(nu))
    assert max(abs(defect(z)) for z in found) < 1e-8
    # the argument of the function turns once for each root, those below the axis included
    corners = np.array([0.3 - 2.5j, 7.0 - 2.5j, 7.0 + 2.5j, 0.3 + 2.5j, 0.3 - 2.5j])
    path = np.concatenate([np.linspace(*pair, 2000) for pair in pairwise(corners)])
    turns = np.sum(np.diff(np.unwrap(np.angle([defect(z) for z in path])))) / (2 * np.pi)
    assert found.size + np.count_nonzero(found.imag) == round(turns)


@pytest.mark.slow
def test_the_estimate_covers_the_error_of_random_plates(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(12)
    ratios: list[float] = []
    while len(ratios) < 20:
        scene, rtol = random_plate(rng)
        frequency_hz = float(scene.strip.cutoff_hz() * 10 ** rng.uniform(-1, 1))
        both = fitted_and_turned_back(scene, frequency_hz, rtol, monkeypatch)
        if both is None:
            continue
        fitted, waves = both
        size = np.max(np.abs(fitted.value))
        assert np.all(np.isfinite(waves.value))
        allowed = waves.error + fitted.error + 1e-12 * size
        ratios.append(float(np.max(np.abs(waves.value - fitted.value) / allowed)))
    assert np.count_nonzero(np.array(ratios) > 1) <= 1


def random_plate(rng: np.random.Generator) -> tuple[Scene, float]:
    """Return a plate of any material, size, edge and length, with a load and three points."""
    width_m = float(rng.uniform(0.01, 0.04))
    length_m = float(width_m * rng.uniform(2, 12))
    material = dataclasses.replace(
        ALUMINIUM,
        youngs_modulus_pa=float(rng.uniform(3e9, 2.1e11)),
        poisson_ratio=float(rng.uniform(0, 0.499)),
        loss_factor=float(rng.choice([0, 0.002, 0.01, 0.05])),
    )
    strip = Strip(
        width_m=width_m,
        thickness_m=float(rng.uniform(0.0003, 0.002)),
        material=material,
        edge=SIMPLY_SUPPORTED,
        length_m=length_m,
    )
    hold = strip.bending_stiffness_n_m / width_m * 10 ** rng.uniform(-1, 4)
    spring = ElasticEdge(stiffness_n=float(hold), lossless=bool(rng.integers(2)))
    strip = dataclasses.replace(strip, edge=spring if rng.integers(4) else CLAMPED)
    load = PointForce(
        x_m=float(rng.uniform(-0.4, 0.4) * length_m), y_m=float(rng.uniform(0.2, 0.8) * width_m)
    )
    points_m = tuple(
        (float(rng.uniform(-0.45, 0.45) * length_m), float(rng.uniform(0.1, 0.9) * width_m))
        for _ in range(3)
    )
    return Scene(strip=strip, loads=(load,), points_m=points_m), float(10 ** rng.uniform(-9, -3))
