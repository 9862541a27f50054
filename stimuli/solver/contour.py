"""A path in the plane of s = p W that passes above some guided waves and below all others.

    s(t) = i lowest + reach sinh(t + i tilt)

opens upwards, so that exp(i s |x|) dies along it, and maps a strip |Im t| < tilt onto a region free
of poles: the trapezoidal rule converges exponentially in the number of its nodes, equation (48).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_REACH: Final = 0.6
"""Reach as a part of the gap between the waves below and above the path."""

_STRETCH: Final = 0.7
"""Scale of the double exponential, in nepers of the wanted error, for integrands that fall as 1/s
before `finest`: poles may come nearer as their terms fall. Half of it would do; with it all, what
the waves do not explain of the error is small against what they do."""

_SPARE: Final = 7.0
"""Nepers beyond the wanted error, for values that are small against the terms of their sum."""

_NEIGHBOURS: Final = 4
"""Waves above a path that may be the nearest to it."""

_LEAST_GAP: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contour:
    """One path per frequency; arrays are (n_frequencies, n_nodes) or (n_frequencies,)."""

    s: Complex
    # ds / (2 pi) of the trapezoidal rule; every second node alone, doubled, is that of twice the
    # step
    weight: Complex
    # one half of the path, with doubled weights: without loss the other half has the conjugates, so
    # that the real part of the sum is the integral
    mirrored: bool
    n_below: NDArray[np.int_]  # how many waves, slowest decay first, lie below the path
    lowest: Real
    reach: Real
    tilt: Real
    step: Real
    stretch: float  # of the double exponential
    rise: Real  # how far the path stays above the flat line up to which only waves are crossed
    ceiling: Real  # decay of the first wave above the path

    def leak(self, p: Complex) -> Complex:
        """Return the error of the rule as a part of each wave's own term, equation (52).

        A wave is met at two places, at equal distances from the middle of the path.
        """
        low, reach, tilt, step = (
            a[:, np.newaxis] for a in (self.lowest, self.reach, self.tilt, self.step)
        )
        place = np.arcsinh((p - 1j * low) / reach)
        turns = np.stack([place, 1j * np.pi - place])
        t = self.stretch * np.arcsinh((turns - 1j * tilt) / self.stretch)
        side = np.where(t.imag > 0, 1, -1)
        fall = np.exp(2j * np.pi * side * t / step)
        total: Complex = (side * fall / (1 - fall)).sum(axis=0)
        return total


def contour(
    p: Complex,
    rtol: float,
    *,
    finest: float,
    nearest: float,
    mirrored: bool = False,
    fall: int = 1,
) -> Contour:
    """Return the paths that need the fewest nodes for a relative error `rtol` of the integral.

    Of the waves p, (n_frequencies, n_modes), slowest decay first, at least two stay above. The
    integrand falls as s^-fall, beyond s = 1 / finest (smallest size of the load, in widths) as
    s^-3; at the least distance asked, `nearest`, far from the load, the path ends early.
    `mirrored`: no loss.

    The integral of exp(i s x) / (s^2 + a^2) above i a is empty, below it the residue's:

    >>> p = np.array([[1j, 3j, 5j]])
    >>> path = contour(p, 1e-12, finest=1.0, nearest=0.5)
    >>> part = (path.weight * np.exp(0.5j * path.s) / (path.s**2 + 9)).sum()
    >>> bool(path.n_below[0] == 1 and abs(part - np.exp(-1.5) / 6) < 1e-12)
    True
    """
    lowest, reach, tilt, n_below = _chosen(p)
    digits = np.log(1 / rtol) + _SPARE
    step = 2 * np.pi * tilt / digits
    far = np.log(2 / (finest * reach) + 2) + 0.5 * digits
    if nearest > 0:
        far = np.minimum(far, np.arccosh(1 + digits / (nearest * reach * np.sin(tilt))))
    stretch = _STRETCH * digits / fall
    end = stretch * np.arcsinh(far / stretch)
    n_half = math.ceil(np.max(end / step))
    step = end / n_half
    number = np.arange(0 if mirrored else -n_half, n_half + 1)
    scaled = step[:, np.newaxis] / stretch * number
    turned = stretch * np.sinh(scaled) + 1j * tilt[:, np.newaxis]
    s = 1j * lowest[:, np.newaxis] + reach[:, np.newaxis] * np.sinh(turned)
    weight = (step * reach)[:, np.newaxis] / (2 * np.pi) * np.cosh(turned) * np.cosh(scaled)
    if mirrored:
        weight[:, 1:] *= 2
    ceiling = np.take_along_axis(p.imag, n_below[:, np.newaxis], axis=1)[:, 0]
    return Contour(
        s=s,
        weight=weight,
        mirrored=mirrored,
        n_below=n_below,
        lowest=lowest,
        reach=reach,
        tilt=tilt,
        step=step,
        stretch=float(stretch),
        rise=reach * np.sin(tilt),
        ceiling=ceiling,
    )


def _chosen(p: Complex) -> tuple[Real, Real, Real, NDArray[np.int_]]:
    """Return lowest point, reach, tilt and the number of waves below, for each frequency."""
    n_modes = p.shape[1]
    low = p.imag[:, : n_modes - 2]
    gap = np.maximum(p.imag[:, 1 : n_modes - 1] - low, 0.0)
    reach = _REACH * np.maximum(gap, _LEAST_GAP)
    nearest = np.arange(1, n_modes - 1)[:, np.newaxis] + np.arange(_NEIGHBOURS)
    above = p[:, np.minimum(nearest, n_modes - 1)] - 1j * low[..., np.newaxis]
    tilt = np.min(np.arcsinh(above / reach[..., np.newaxis]).imag, axis=2) / 2
    merit = np.where(gap > _LEAST_GAP, tilt / (12 + np.log(1 + 1 / reach)), 0.0)
    best, row = np.argmax(merit, axis=1), np.arange(p.shape[0])
    return low[row, best], reach[row, best], tilt[row, best], best + 1
