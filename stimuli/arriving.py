"""What the waves of a load do at an end: the moment and the shear that the end must take back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.contour import contour
from stimuli.corners import RING, close_pairs, ring
from stimuli.images import load_kernels
from stimuli.task import far_clearance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.corners import EndFunctions
    from stimuli.transform import Source

    Complex = NDArray[np.complex128]
    Real = NDArray[np.float64]

_PATH: Final = 1e-13


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arriving:
    """The field of a load where it passes an end, on a strip that does not end.

    Attributes
    ----------
    functions : EndFunctions
        Wavenumbers, edges and guided waves.
    source : Source
        The load.
    across : ndarray of float64, shape (n_places,)
        Places on the end.
    rtol : float
        Wanted relative error.
    """

    functions: EndFunctions
    source: Source
    across: Real
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
        strength = 1j * waves.excited(functions.k, self.source) / waves.norms()
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
