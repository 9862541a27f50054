"""Where the two slowest symmetric waves of a strip coalesce, equation (35) of docs/model.md."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_STEPS: Final = 15
_SETTLED: Final = 1e-13


def exceptional_bending(compliance: float) -> float:
    """Return z where the two slowest symmetric waves coalesce, equation (35).

    Parameters
    ----------
    compliance : float
        c = 2 D / (K W) of the edges, 0 to infinite, without loss.

    Returns
    -------
    float
        z = (k W / 2)^2; 0 for simply supported edges, of which it is the limit.

    Examples
    --------
    It grows as the square root of the stiffness of a soft edge:

    >>> round(exceptional_bending(1e8) / exceptional_bending(1e10), 6)
    10.0
    """
    if math.isinf(compliance):
        return 0.0
    # the first mode alone, with the others as two constants
    z = math.sqrt(math.pi**2 / 2 / (compliance + 0.21727))
    y = 0.0131 * z**2 / (2 * compliance + 0.43454)
    for _ in range(_STEPS):
        step = 1e-6 * z
        here = _coalescence(compliance, y, z)
        by_y = (_coalescence(compliance, y + step, z) - here) / step
        by_z = (_coalescence(compliance, y, z + step) - here) / step
        change = np.linalg.solve(np.column_stack([by_y, by_z]), here)
        y, z = y - float(change[0]), z - float(change[1])
        if abs(change[1]) <= _SETTLED * z:
            break
    return z


def _coalescence(compliance: float, y: float, z: float) -> NDArray[np.float64]:
    """Return dispersion function and slope at x = (pi / 2)^2 + y, exact for small y and z too."""
    slack, grip = compliance / (1 + compliance), 1 / (1 + compliance)
    x, q = math.pi**2 / 4 + y, math.pi / 2
    a, b = cmath.sqrt(x + z), cmath.sqrt(x - z)
    cos_a, cos_b = -cmath.sin((y + z) / (a + q)), -cmath.sin((y - z) / (b + q))
    sinc_a, sinc_b, sinc_s, sinc_d = (
        cmath.sin(t) / t if t else 1.0 for t in (a, b, a + b, 2 * z / (a + b))
    )
    value = slack * cos_a * cos_b + grip * (sinc_s + sinc_d) / 2
    twist = (sinc_a * cos_b - sinc_b * cos_a) / (2 * z)
    slope = grip * (twist - sinc_a * sinc_b) - slack * (sinc_a * cos_b + cos_a * sinc_b)
    return np.array([value.real, slope.real / 2])
