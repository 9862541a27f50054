"""Functions that solve the plate equation near a free end, singular corners included.

Every one holds on the strip that goes on beyond its end and keeps the edges of the strip itself:
a guided wave that leaves the end, or the field of an edge that is displaced or turned at one place
beyond the end, equation (56). Such places crowd exponentially at the corner of edge and
end. Lengths are in widths; xi is the distance from the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.across import lag, shape, slope
from stimuli.solver.contour import Contour, contour

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.solver.guided import Guided


_TAPER: Final = 3.0
"""Crowding of the sources: the distances fall as exp(-3 (sqrt J - sqrt j))."""

_SPREAD: Final = 2
"""Densities d^j exp(-2 d) at the distance d beyond the end that are sources too, of either kind."""

_FADE: Final = 2.0
"""Decay of these densities per width."""

_GONE: Final = 38.0
"""Nepers over which what the path holds of a source dies out beside what it is at the end."""

_PATH: Final = 1e-14
"""Error of the integrals along s, whatever is wanted of the field: the fit makes 1e4 times it."""

_PAIR: Final = 1e-2
"""Relative distance of two waves below which they are replaced by integrals about both."""

_FLAT: Final = 0.3
"""|g| of a branch so flat that it is taken by itself and not as what it is more than the other."""

_LONE: Final = (80.0, 800.0, 8000.0)
"""Decay per width beyond which an edge is not seen from the other, exp(-40) at the middle, and
beyond which nothing is seen from a tenth and a hundredth of that."""

_DEAD: Final = 40.0
"""Nepers over which a branch dies out."""

_SHORT: Final = 0.03
"""Size of exponents up to which few terms of the series are enough."""

_EPS: Final = 1e-17

_EDGE: Final = np.array(0.5)

RING: Final = np.exp(2j * np.pi * (np.arange(32) + 0.5) / 32)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EndFunctions:
    """The functions of one symmetry at some frequencies."""

    k: Complex  # bending wavenumber times the width: (n_frequencies, 1)
    hold: Complex  # 1 / (kappa W): (n_frequencies, 1)
    poisson_ratio: float
    waves: Guided
    path: Contour  # for the part of the sources' fields that is no wave below it
    beyond: Real  # distances of the sources beyond the end, the largest first: (n_sources,)

    def at(self, across: Real, aways: tuple[Real, ...], kinds: int = 3) -> list[list[Complex]]:
        """Return all functions at places, for some distances from the end.

        For each: displacement, moment u'' + nu u_YY and shear u''' + (2 - nu) u_YY', or the first
        of these, (n_frequencies, n_places, n_functions). Columns: the guided waves, then the edge
        turned or displaced in turns, everywhere beyond the end first, at one place then.
        """
        sources = self._sources(across, aways, kinds)
        return [
            [np.concatenate(pair, axis=2) for pair in zip(guided, some, strict=True)]
            for guided, some in zip(
                (self.guided(across, away, kinds) for away in aways), sources, strict=True
            )
        ]

    def _operators(self, s: Complex, square: Complex) -> tuple[Complex, Complex, Complex]:
        """Return what makes displacement, moment and shear of exp(i s xi + g Y)."""
        nu = self.poisson_ratio
        return 1 + 0 * s, nu * square - s * s, 1j * s * ((2 - nu) * square - s * s)

    def guided(self, across: Real, away: Real, kinds: int = 3) -> list[Complex]:
        """Return displacement, moment and shear of the guided waves, or the first of these."""
        waves, sign = self.waves, self.waves.sign
        p, g1, g2 = (a[:, np.newaxis] for a in (waves.p, waves.g1, waves.g2))
        places, weights = across[:, np.newaxis], [w[:, np.newaxis] for w in waves.weights]
        first, second = (w * shape(g, places, sign) for w, g in zip(weights, (g1, g2), strict=True))
        decay = np.exp(1j * p * away[:, np.newaxis])
        operators = zip(self._operators(p, g1 * g1), self._operators(p, g2 * g2), strict=True)
        found = [(first * one + second * two) * decay for one, two in operators][:kinds]
        for row, pair in close_pairs(waves):
            self._merge(found, row, pair, across, away)
        return found

    def _merge(self, found: list[Complex], row: int, pair: int, across: Real, away: Real) -> None:
        """Put two integrals about two close waves in their place, equation (56)."""
        centre, radius = ring(self.waves, row, pair)
        turn = radius * RING
        s = (centre + turn)[np.newaxis]
        k, hold = self.k[row : row + 1], self.hold[row : row + 1]
        kernels = self._kernels(s, k, hold, across)[0]
        decay = np.exp(1j * s * away[:, np.newaxis])
        for trace, kernel in zip(found, kernels, strict=False):
            for column, weight in ((pair, turn), (pair + 1, turn * turn / radius)):
                trace[row, :, column] = np.mean(kernel[0] * decay * weight, axis=1)

    def _kernels(
        self, s: Complex, k: Complex, hold: Complex, across: Real, kinds: int = 3
    ) -> tuple[list[Complex], list[Complex]]:
        """Return the transforms of a turned and of a displaced edge.

        Each (n_frequencies, n_places, n_s). Differences of the two branches, which nearly agree
        far out in s, are taken as such.
        """
        sign, nu = self.waves.sign, self.poisson_ratio
        k2 = k * k
        g1, g2 = np.sqrt(s * s - k2), np.sqrt(s * s + k2)
        one, change = edge_shapes(g1, g2, 2 * k2 / (g1 + g2), across, sign)
        grip, pull = grips(g1, g2, k2, hold, sign)
        more = (0 * s, 2 * nu * k2 + 0 * s, 2j * s * (2 - nu) * k2)
        turned, displaced = [], []
        for op, gain in zip(self._operators(s, s * s + k2)[:kinds], more, strict=False):
            both = change * op[:, np.newaxis] + one * gain[:, np.newaxis]
            turned.append(both / grip[:, np.newaxis])
            second = (one + change) * op[:, np.newaxis]
            displaced.append(second - both * (pull / grip)[:, np.newaxis])
        return turned, displaced

    def _sources(self, across: Real, aways: tuple[Real, ...], kinds: int) -> list[list[Complex]]:
        s = self.path.s
        spread = _FADE / (_FADE - 1j * s[..., np.newaxis])
        places = np.exp(1j * s[..., np.newaxis] * self.beyond)
        powers = 1 + np.arange(_SPREAD)
        turned = np.concatenate([spread**powers, places], axis=2)
        displaced = np.concatenate([spread ** (powers + 2), places], axis=2)
        rows, which = np.unique(across, return_inverse=True)
        kernels = self._kernels(s, self.k, self.hold, rows, kinds)
        found: list[list[Complex]] = []
        for away in aways:
            columns = [
                self._passed(pair, (turned, displaced), which, away)
                for pair in zip(*kernels, strict=True)
            ]
            found.append([np.asarray(a.real + 0j) if self.path.mirrored else a for a in columns])
        return found

    def _passed(
        self,
        kernels: tuple[Complex, Complex],
        strengths: tuple[Complex, Complex],
        which: NDArray[np.intp],
        away: Real,
    ) -> Complex:
        """Return what the sources leave at distances, turned and displaced edges in turns.

        Only where it is not gone: at the other end, as a rule, it is.
        """
        s, weight = self.path.s, self.path.weight
        found = np.zeros((*s.shape[:1], away.size, strengths[0].shape[2], 2), dtype=np.complex128)
        near = np.flatnonzero(np.min(self.path.lowest) * away < _GONE)
        if not near.size:
            return found.reshape(*found.shape[:2], -1)
        same = bool(np.all(away == away[0]))
        if same:  # as on an end: each of its places but once
            decay = (np.exp(1j * s * away[0]) * weight)[..., np.newaxis]
        else:
            decay = np.exp(1j * s[:, np.newaxis] * away[near, np.newaxis]) * weight[:, np.newaxis]
        for n, (kernel, strength) in enumerate(zip(kernels, strengths, strict=True)):
            if same:
                found[..., n] = (kernel @ (decay * strength))[:, which]
            else:
                found[..., n][:, near] = (kernel[:, which[near]] * decay) @ strength
        return found.reshape(*found.shape[:2], -1)


def end_functions(
    k: Complex, hold: Complex, waves: Guided, poisson_ratio: float, n_sources: int
) -> EndFunctions:
    """Return guided waves and sources beyond an end.

    Of `waves` at least two decay; `n_sources` is the number of places beyond the end.
    """
    number = np.arange(n_sources, 0, -1)
    beyond = np.exp(-_TAPER * (np.sqrt(n_sources) - np.sqrt(number)))
    lossless = not (k.imag.any() or hold.imag.any())
    path = contour(waves.p, _PATH, finest=1e-30, nearest=float(beyond[-1]), mirrored=lossless)
    return EndFunctions(
        k=k[:, np.newaxis],
        hold=hold[:, np.newaxis],
        poisson_ratio=poisson_ratio,
        waves=waves,
        path=path,
        beyond=beyond,
    )


def close_pairs(waves: Guided) -> list[tuple[int, int]]:
    """Return frequency and number of the waves that nearly coalesce with the next one.

    Simple supports have none: waves that meet are sines of different orders there.
    """
    if waves.branch is not None:
        return []
    apart = np.abs(np.diff(waves.p, axis=1))
    rows, firsts = np.nonzero(apart < _PAIR * np.abs(waves.p[:, 1:]))
    return [(int(row), int(first)) for row, first in zip(rows, firsts, strict=True)]


def ring(waves: Guided, row: int, pair: int) -> tuple[complex, float]:
    """Return centre and radius of a circle about two close waves and no other."""
    p = waves.p[row]
    centre = complex(p[pair] + p[pair + 1]) / 2
    others = np.concatenate([np.delete(p, [pair, pair + 1]), -p])
    return centre, 0.25 * float(np.min(np.abs(others - centre)))


def edge_shapes(
    g1: Complex, g2: Complex, apart: Complex, across: Real, sign: int
) -> tuple[Complex, Complex]:
    """Return branch 1 at places, 1 at the edge, and what branch 2 is more than it.

    `apart` is g2 - g1. The change is a sum without cancellation: far out in s the branches are
    nearly the same. Where they have died out before a place nothing is computed.
    """
    places = 0.5 - np.abs(across)
    one = np.zeros((g1.shape[0], across.size, g1.shape[1]), dtype=np.complex128)
    change = np.zeros_like(one)
    decay = np.min(g1.real, axis=0)
    for least, most in pairwise((-1.0, *_LONE, np.inf)):
        nodes = np.flatnonzero((decay > least) & (decay <= most))
        rows = np.flatnonzero(places * least < _DEAD)
        if not nodes.size or not rows.size:
            continue
        first, second, more = (a[:, np.newaxis, nodes] for a in (g1, g2, apart))
        here = places[rows, np.newaxis]
        some = np.ix_(np.arange(g1.shape[0]), rows, nodes)
        if least > 0:
            one[some] = alone = np.exp(-first * here)
            change[some] = alone * _less_one(-more * here)
        else:
            one[some], change[some] = _both_edges(first, second, more, here, sign)
    if sign < 0 and np.any(across < 0):
        side = np.where(across < 0, -1, 1)[:, np.newaxis]
        return side * one, side * change
    return one, change


def _both_edges(
    g1: Complex, g2: Complex, apart: Complex, places: Real, sign: int
) -> tuple[Complex, Complex]:
    """Return what `edge_shapes` does where either edge is seen from the other."""
    flat = np.minimum(np.abs(g1), np.abs(g2)) < _FLAT
    through = sign * np.exp(-g1)
    near = np.exp(-g1 * places)
    far = through / near
    one = np.asarray((near + far) / np.where(flat, 1, 1 + through), dtype=np.complex128)
    here, whole = _less_one(-apart * places), np.expm1(-apart)
    change = near * here + far * ((whole - here) / (1 + here)) - one * (through * whole)
    change = change / np.where(flat, 1, 1 + sign * np.exp(-g2))
    if flat.any():  # there the two differ by much, and each is a safe quotient, (73)
        first, second = (shape(g, 0.5 - places, sign) / shape(g, _EDGE, sign) for g in (g1, g2))
        return np.where(flat, first, one), np.where(flat, second - first, change)
    return one, change


def _less_one(z: Complex) -> Complex:
    """Return exp(z) - 1; near 0 a few products are three times as fast."""
    most = float(np.max(np.abs(z), initial=0.0))
    if most > _SHORT:
        return np.asarray(np.expm1(z))
    n_terms = 2 if most < _EPS else math.ceil(math.log(_EPS) / math.log(most)) + 1
    total = z * (1 / math.factorial(n_terms))
    for n in range(n_terms - 1, 0, -1):
        total += 1 / math.factorial(n)
        total *= z
    return total


def grips(
    g1: Complex, g2: Complex, k2: Complex, hold: Complex, sign: int
) -> tuple[Complex, Complex]:
    """Return g2 T2 - g1 T1 + 2 k^2 / kappa, free of cancellation, and g2 T2 + g2^2 / kappa."""
    grip = 2 * k2 / (g1 + g2) - sign * (lag(g2, sign) - lag(g1, sign))
    steep: Complex = slope(g2, _EDGE, sign) / shape(g2, _EDGE, sign)
    return 2 * k2 * hold + grip, steep + hold * g2 * g2
