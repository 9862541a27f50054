"""The displacement of a strip on a grid of places at one frequency."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

from stimuli.checks import finite, finite_array
from stimuli.field.field import displacement
from stimuli.field.scene import Scene
from stimuli.load import LOADS, Load
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Complex, Real
    from stimuli.strip.strip import Strip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DisplacementMap:
    """The displacement of a strip on a grid of places.

    Attributes
    ----------
    frequency_hz : float
        Frequency of the loads.
    x_m : ndarray of float64, shape (n_x,)
        Places along the strip.
    y_m : ndarray of float64, shape (n_y,)
        Places across it, from one edge.
    displacement_m : ndarray of complex128, shape (n_loads, n_x, n_y)
        Metres per unit load (1 N, 1 Pa, 1 N m/m), time factor exp(-i omega t); exactly 0 on the
        held edges.

    Examples
    --------
    `displacement_map` gives one, also far from the load, where it is smaller:

    >>> from stimuli import ALUMINIUM, CLAMPED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> found = displacement_map(strip, PointForce(x_m=0.0, y_m=0.0125), 500.0, x_m=[0.0, 0.07],
    ...                          y_m=[0.0125])
    >>> near_m, far_m = abs(found.displacement_m[0, :, 0])
    >>> bool(far_m < 1e-2 * near_m)
    True
    """

    frequency_hz: float
    x_m: Real
    y_m: Real
    displacement_m: Complex


@tuned
def displacement_map(
    strip: Strip,
    loads: Load | tuple[Load, ...],
    frequency_hz: float,
    *,
    x_m: ArrayLike,
    y_m: ArrayLike,
    rtol: float = 1e-4,
) -> DisplacementMap:
    """Return the displacement of a strip on a grid, equations (37) to (53).

    Repeated and mirrored pairs of a load and a place are solved once; the time grows linearly
    with those that are left.

    Parameters
    ----------
    strip : Strip
        The strip.
    loads : Load or tuple of Load
        One load, or several of which each is looked at by itself.
    frequency_hz : float
        Frequency from 0.
    x_m : array_like of float, shape (n_x,)
        Places along the strip, at least one.
    y_m : array_like of float, shape (n_y,)
        Places across it, from one edge, at least one; none off the strip.
    rtol : float
        Wanted relative error, as for `stimuli.displacement`.

    Returns
    -------
    DisplacementMap
        Places, and the displacement at each for each load.

    Raises
    ------
    ValueError
        If an argument is out of its range, or the frequency is a cut-off of a strip without
        loss, where the field is infinite.

    Examples
    --------
    The held edges rest, and both sides of a load move alike:

    >>> from stimuli import ALUMINIUM, CLAMPED, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> found = displacement_map(strip, disc, 500.0, x_m=[-0.01, 0.0, 0.01],
    ...                          y_m=[0.0, 0.005, 0.02, 0.025])
    >>> found.displacement_m.shape, bool(found.displacement_m[:, :, [0, 3]].any())
    ((1, 3, 4), False)
    >>> bool((found.displacement_m[:, 0] == found.displacement_m[:, 2]).all())
    True
    """
    frequency_hz = finite("frequency_hz", frequency_hz, least=0)
    x, y = _grid("x_m", x_m), _grid("y_m", y_m)
    scene = Scene(
        strip=strip,
        loads=(loads,) if isinstance(loads, LOADS) else loads,
        points_m=tuple(product(x.tolist(), y.tolist())),
    )
    value = displacement(scene, [frequency_hz], rtol)[0].reshape(-1, x.size, y.size)
    value[:, :, (y == 0) | (y == strip.width_m)] = 0
    return DisplacementMap(frequency_hz=frequency_hz, x_m=x, y_m=y, displacement_m=value)


def _grid(name: str, values: ArrayLike) -> Real:
    places = finite_array(name, values)
    if places.ndim != 1 or not places.size:
        raise ValueError(f"{name} must be a one-dimensional array, not empty, got {values!r}")
    return places
