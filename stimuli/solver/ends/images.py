"""Images of a load near a free end, and what its waves do there: equation (58).

The moment and the shear that arrive are what the end must take back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.solver.across import lag, shape, shape_integral, supported_kernel
from stimuli.solver.contour import Contour, contour
from stimuli.solver.ends.corners import RING, close_pairs, ring
from stimuli.solver.source import far_clearance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.solver.ends.corners import EndFunctions
    from stimuli.solver.source import Source


_NEAR: Final = 0.5
"""Distance of a load from an end in widths below which its images are used."""

_RATIO: Final = 1.5
"""Each image is so much further beyond the end than the one before."""

_REACH: Final = 0.5
"""Distance of the last image, at the least."""

_IMAGE_ERROR: Final = 1e-14
"""Error of the integrals along s."""

_EVERY: Final = slice(None)


def is_near(distance: float) -> bool:
    """Return whether a load so far from an end, in widths, needs images."""
    return distance < _NEAR


def load_kernels(
    functions: EndFunctions,
    source: Source,
    s: Complex,
    across: Real,
    *,
    rows: slice = _EVERY,
    kinds: int = 3,
    both: bool = False,
) -> list[list[Complex]]:
    """Return the transforms of displacement, moment and shear of a load, or the first of these.

    Each is (n_frequencies, n_places, n_s). With `both`, those of a force and of a moment that act
    where the load does, else those of the load.
    """
    sign, nu = functions.waves.sign, functions.poisson_ratio
    k, hold = functions.k[rows], functions.hold[rows]
    k2 = k * k
    g1, g2 = np.sqrt(s * s - k2), np.sqrt(s * s + k2)
    half = np.array(0.5)
    end1, end2 = shape(g1, half, sign), shape(g2, half, sign)
    load1 = shape_integral(g1, source.span, sign) / end1
    load2 = shape_integral(g2, source.span, sign) / end2
    grip = 2 * k2 / (g1 + g2) - sign * (lag(g2, sign) - lag(g1, sign))
    turned = 2 * (2 * k2 * hold + grip)
    places = across[:, np.newaxis]
    first, second = g1[:, np.newaxis], g2[:, np.newaxis]
    free1 = supported_kernel(first, places, source.span, sign)
    free2 = supported_kernel(second, places, source.span, sign)
    wall1 = shape(first, places, sign) / end1[:, np.newaxis]
    wall2 = shape(second, places, sign) / end2[:, np.newaxis]
    s, square = s[:, np.newaxis], s[:, np.newaxis] ** 2
    sources = [replace(source, moment=moment) for moment in (False, True)] if both else [source]
    found = []
    for one, two in (a.branch_weights(k) for a in sources):
        turn = ((two * load2 - one * load1) / turned)[:, np.newaxis]
        branch1 = one[:, np.newaxis] * free1 + turn * wall1
        branch2 = two[:, np.newaxis] * free2 + turn * wall2
        change = (branch1 - branch2) / (2 * k2[:, np.newaxis])
        # (branch1 op1 - branch2 op2) / (2 k^2) with op1 - op2 taken as such
        mean = (branch1 + branch2) / 2 if kinds > 1 else change
        kernels = [change, (nu - 1) * square * change - nu * mean]
        kernels.append(1j * s * ((1 - nu) * square * change - (2 - nu) * mean))
        found.append(kernels[:kinds])
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Images:
    """Forces and moments like a load's, beyond an end where its image is and further out."""

    functions: EndFunctions
    source: Source  # what acts across the strip; a rectangle's end face
    beyond: Real  # distances beyond the end: (n_images,)
    path: Contour

    def at(self, across: Real, aways: tuple[Real, ...], kinds: int) -> list[list[Complex]]:
        """Return displacement, moment and shear, or the first, for some distances from the end."""
        s, weight = self.path.s, self.path.weight[:, np.newaxis]
        reach = np.exp(1j * s[..., np.newaxis] * self.beyond)
        first = reach[..., :1] * (1j * s * self.beyond[0])[..., np.newaxis]
        second = first * (1j * s * self.beyond[0])[..., np.newaxis]
        reach = np.concatenate([reach, first, second], axis=2)
        kernels = load_kernels(self.functions, self.source, s, across, kinds=kinds, both=True)
        found = []
        for away in aways:
            decay = np.exp(1j * s[:, np.newaxis] * away[:, np.newaxis]) * weight
            traces = [
                np.concatenate([(kernel * decay) @ reach for kernel in pair], axis=2)
                for pair in zip(*kernels, strict=True)
            ]
            found.append([a.real + 0j if self.path.mirrored else a for a in traces])
        return found


def images(functions: EndFunctions, source: Source, distance: float) -> Images:
    """Return the images of a load at a distance from an end."""
    count = max(int(np.ceil(np.log(_REACH / distance) / np.log(_RATIO))) + 1, 2)
    path = contour(
        functions.waves.p,
        _IMAGE_ERROR,
        finest=1e-30,
        nearest=distance,
        mirrored=functions.path.mirrored,
    )
    return Images(
        functions=functions,
        source=replace(source, half_length=0.0),
        beyond=np.asarray(distance * _RATIO ** np.arange(count)),
        path=path,
    )


_PATH: Final = 1e-13


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arriving:
    """The field of a load where it passes an end, on a strip that does not end."""

    functions: EndFunctions
    source: Source
    across: Real  # places on the end: (n_places,)
    rtol: float

    def at(self, distance: Real) -> tuple[Complex, Complex]:
        """Return moment and shear at the end for loads at distances from it.

        Each has the shape (n_frequencies, n_places, n_distances).
        """
        shape = (self.functions.k.size, self.across.size, distance.size)
        moment, shear = (np.zeros(shape, dtype=np.complex128) for _ in range(2))
        clearance = distance - self.source.half_length - self.source.radius
        far = clearance >= far_clearance(self.rtol)
        for some, method in ((far, self._waves), (~far, self._integral)):
            if np.any(some):
                moment[..., some], shear[..., some] = method(distance[some])
        return moment, shear

    def _waves(self, distance: Real) -> tuple[Complex, Complex]:
        """Return the sum over the guided waves."""
        every = np.full(self.functions.k.size, self.functions.waves.p.shape[1])
        return self._below(distance, every)

    def _integral(self, distance: Real) -> tuple[Complex, Complex]:
        """Return the waves below a path and the integral along it, (48)."""
        functions, source = self.functions, self.source
        nearest = float(np.min(distance)) - source.half_length
        path = contour(
            functions.waves.p,
            _PATH,
            finest=1e-30,
            nearest=nearest,
            mirrored=functions.path.mirrored,
        )
        along = source.along(path.s[..., np.newaxis], distance) * path.weight[..., np.newaxis]
        kernels = load_kernels(functions, source, path.s, self.across)[0]
        found = self._below(distance, path.n_below)
        parts: list[Complex] = [kernel @ along for kernel in kernels[1:]]
        if path.mirrored:
            parts = [np.asarray(part.real + 0j) for part in parts]
        return found[0] + parts[0], found[1] + parts[1]

    def _below(self, distance: Real, count: NDArray[np.int_]) -> tuple[Complex, Complex]:
        """Return the sum over the first waves of each frequency, (47), pairs as in (51)."""
        functions, waves = self.functions, self.functions.waves
        strength = waves.strengths(functions.k, self.source)[..., 0]
        strength[np.arange(waves.p.shape[1]) >= count[:, np.newaxis]] = 0.0
        pairs = close_pairs(waves)
        for row, pair in pairs:
            strength[row, pair : pair + 2] = 0.0
        along = strength[..., np.newaxis] * self.source.along(waves.p[..., np.newaxis], distance)
        seen = functions.guided(self.across, np.zeros_like(self.across))
        moment, shear = seen[1] @ along, seen[2] @ along
        for row, pair in pairs:
            if pair < count[row]:
                m, v = self._merged(distance, row, pair)
                moment[row], shear[row] = moment[row] + m, shear[row] + v
        return moment, shear

    def _merged(self, distance: Real, row: int, pair: int) -> tuple[Complex, Complex]:
        functions = self.functions
        centre, radius = ring(functions.waves, row, pair)
        turn = radius * RING
        s = (centre + turn)[np.newaxis]
        some = slice(row, row + 1)
        along = self.source.along(s[0, :, np.newaxis], distance) * (1j / turn.size) * turn[:, None]
        _, moment, shear = load_kernels(functions, self.source, s, self.across, rows=some)[0]
        return moment[0] @ along, shear[0] @ along
