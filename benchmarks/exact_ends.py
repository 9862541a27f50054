"""What the free ends of a strip between simple supports add, to many digits: one sine at a time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from mpmath import mp

if TYPE_CHECKING:
    from benchmarks.exact import Problem
    from stimuli import Load, Strip

_DIGITS: Final = 48


def reflected(problem: Problem, strip: Strip, load: Load, x_m: float) -> Any:
    """Return what two free ends add between simple supports: four waves for each sine."""
    if not mp.isinf(problem.hold):
        raise ValueError("strip must have simply supported edges if it is finite")
    width = mp.mpf(strip.width_m)
    end, there = mp.mpf(strip.length_m) / (2 * width), mp.mpf(load.x_m) / width
    x, nu = mp.mpf(x_m) / width, mp.mpf(strip.material.poisson_ratio)
    one, two = problem.branch_weights()
    total, n = mp.mpf(0), 0
    while True:
        n += 1
        q = n * mp.pi
        a, b = mp.sqrt(q * q - problem.k**2), mp.sqrt(q * q + problem.k**2)
        if not mp.im(problem.k) and problem.k > q:
            a = -1j * mp.sqrt(problem.k**2 - q * q)
        part = _ends_of_one_sine(problem, (a, b), (one, -two), q, (end, there, x, nu))
        total += part
        nearest = 2 * end - abs(x) - abs(there) - problem.half_length
        if q > problem.k.real and mp.exp(-q * nearest) < mp.mpf(10) ** -_DIGITS:
            return total


def _ends_of_one_sine(
    problem: Problem, decays: tuple[Any, Any], weights: tuple[Any, Any], q: Any, places: Any
) -> Any:
    end, there, x, nu = places
    half, c = mp.mpf(1) / 2, problem.half_length
    load = mp.sin(q * (problem.centre + half))
    load *= 2 * mp.sin(q * problem.span / 2) / q if problem.span else 1
    shape = mp.sin(q * (problem.y + half))
    matrix, right = mp.matrix(4, 4), mp.matrix(4, 1)
    for row, side in enumerate((1, -1)):
        for j, (g, weight) in enumerate(zip(decays, weights, strict=True)):
            moment, shear = g * g - nu * q * q, g * (g * g - (2 - nu) * q * q)
            size = weight * load / (2 * problem.k**2 * g) * (2 * mp.sinh(g * c) / g if c else 1)
            size *= mp.exp(-g * (end - side * there))
            right[2 * row] -= moment * size
            right[2 * row + 1] += side * shear * size
            for column, from_end in ((j, 1), (j + 2, -1)):
                reach = mp.mpf(1) if from_end == side else mp.exp(-2 * g * end)
                matrix[2 * row, column] = moment * reach
                matrix[2 * row + 1, column] = from_end * shear * reach
    waves = mp.lu_solve(matrix, right)
    reach = [mp.exp(-g * (end - side * x)) for side in (1, -1) for g in decays]
    return shape * mp.fsum(w * r for w, r in zip(waves, reach, strict=True))
