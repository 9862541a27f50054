"""The response of a plate over frequency, in a coarse and a fine basis.

A plate with ends follows each load at rest and by its inertia (`rest`), and beyond that each of its
modes swings. Where patches stiffen the plate, its own basis follows every load, and modes do all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, Generic, NamedTuple, TypeVar

import numpy as np
import scipy.linalg

from stimuli.checks import finite, finite_array, instance
from stimuli.errors import PlateError, Rule
from stimuli.load import PointForce
from stimuli.plate.line import Margins
from stimuli.plate.modes import Resolution, Selection, plate_bases
from stimuli.plate.rest import rest_displacement
from stimuli.plate.scene import Scene, check_loads, cut_section
from stimuli.plate.waveguide import endless_displacement, stiffness_factors
from stimuli.threads import single_threaded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.load import Load
    from stimuli.plate.modes import Basis
    from stimuli.plate.strip import Strip

Values = TypeVar("Values", bound="NDArray[Any]")

_EXCHANGE: Final = 5.0
"""Springs without loss make modes exchange their loss, up to this multiple of the highest
frequency; what faster modes exchange has no effect."""
_FAR: Final = 40.0
"""Ends so many widths apart do not interact: 5e-6 of the first mode on the paper's plate."""
_DECAY: Final = 9.0
"""Nepers by which a field decays to where a plate is cut: exp(-18) = 2e-8 of it comes back."""
_PUSHED, _BENT = 0.005, 0.05
"""Of `typical_displacement`: a point force in the middle of a clamped strip has 0.007."""
_FLOOR, _TINIEST = 1e-3, 1e-300
_SAFETY: Final = 3.0
"""What the coarse basis differs by is multiplied with; it may agree with the fine one by chance."""
_BESIDE: Final = 0.03
"""Widths from a point to its neighbours, where both bases are compared too."""
_RESOLVED: Final = 0.03
"""Size of a load, in widths, that both bases follow."""


class Accuracy(NamedTuple):
    """How fine a scene is solved, and what both bases miss then.

    To the difference of the bases comes `relative` of each displacement, at corners and rims, and
    on plates with ends `missed` of the largest displacement, as of the upper modes. Margins of
    endless strips differ by 4, so that each cell gets two more functions: one alone is odd about
    the middle of its cell, and no load there excites it.
    """

    modes: Resolution
    rest: Resolution
    endless: tuple[Margins, Margins]
    relative: float
    missed: float


RELATIVE, MISSED = 3e-4, 2e-5
"""Of the first accuracy, and of answers over time."""
_MISSED_WAVES: Final = 1e-9
"""The same of endless strips, of which no wave is left out."""
_AT_RIMS: Final = 10.0
"""Times as much is missed where patches stiffen the plate."""
ACCURACIES: Final = (
    Accuracy(
        modes=Resolution(),
        rest=Resolution(multiples=(2.0, 3.0), margins=Margins(4.0, 6.0)),
        endless=(Margins(3, 3), Margins(7, 7)),
        relative=RELATIVE,
        missed=MISSED,
    ),
    Accuracy(
        modes=Resolution(multiples=(4.0, 6.0), margins=Margins(4.0, 6.0), rim_degrees=(4, 6)),
        rest=Resolution(multiples=(3.0, 4.0), margins=Margins(6.0, 9.0)),
        endless=(Margins(6, 6), Margins(10, 10)),
        relative=3e-5,
        missed=1e-6,
    ),
)
"""The first serves unless a tolerance asks for more."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Estimate(Generic[Values]):
    """A result, its error, and what was solved for it.

    Attributes
    ----------
    value : ndarray
    error : ndarray of float64, same shape
        Estimate of the error, which is not below the true one.
    work : tuple of str
        What was solved, and what was left out and why.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> scene = Scene(strip=strip, loads=(PointForce(x_m=0.0, y_m=0.0125),),
    ...               points_m=((0.0, 0.0125),))
    >>> at_300_hz = response(scene, [300.0])
    >>> true_m = 1.35672670270450974e-05
    >>> bool(abs(at_300_hz.value[0, 0, 0] - true_m) < at_300_hz.error[0, 0, 0] < 0.01 * true_m)
    True
    """

    value: Values
    error: Real
    work: tuple[str, ...]

    def kept(self, rtol: float | None, scale: Real) -> Estimate[Values]:
        """Return the result if its error is at most `rtol` of a scale, or refuse it.

        PlateError where it is not, ValueError where `rtol` is not from 0 to 0.1.
        """
        if rtol is None:
            return self
        rtol = check_tolerance(rtol)
        relative = float((self.error / np.maximum(scale, _TINIEST)).max())
        if relative > rtol:
            raise PlateError(Rule.TOLERANCE, rtol=rtol, min_rtol=relative)
        return self


def check_tolerance(rtol: float) -> float:
    """Return a tolerance, or refuse it with a ValueError."""
    return finite("rtol", rtol, above=0.0, most=0.1)


def estimate(
    coarse: Values,
    fine: Values,
    missed: Real,
    work: tuple[str, ...],
    relative: float,
    *,
    safety: Real | float = _SAFETY,
) -> Estimate[Values]:
    """Return the fine result, with its error by what the coarse one differs, equation (47).

    `missed` is what both resolutions miss of the largest value, and `relative` a part of each.
    """
    error = safety * np.abs(fine - coarse) + relative * np.abs(fine) + missed
    return Estimate(value=fine, error=np.asarray(error), work=work)


def safety_factors(strip: Strip, loads: Sequence[Load]) -> Real:
    """Return what the difference of both bases is multiplied with, for each load: (n_loads, 1).

    At its own place a small load that bends the plate moves it by the logarithm of its size, of
    which each basis gives what it resolves.
    """
    sizes = [2 * min(load.half_size_m) / strip.width_m for load in loads]
    factors = [
        1 + math.log(_RESOLVED / size) if load.is_moment and size < _RESOLVED else 1.0
        for load, size in zip(loads, sizes, strict=True)
    ]
    return _SAFETY * np.array(factors)[:, np.newaxis]


@single_threaded
def response(
    scene: Scene, frequencies_hz: ArrayLike, rtol: float | None = None
) -> Estimate[Complex]:
    """Return the displacement of a scene over frequency.

    Parameters
    ----------
    scene : Scene
    frequencies_hz : array_like of float, shape (n_frequencies,)
        From 0 to 400 first cut-offs.
    rtol : float, optional
        Largest relative error. It holds for every value down to a floor of 1e-3 rtol of the
        largest one at its frequency; where waves cancel, a null is not resolved further. Less than
        3e-5 cannot be kept, and on plates with ends at best 3e-5 + 1e-6 / r of a value that is a
        part r of the largest; a point force moves its own place by 2e-3 to 5e-4. None takes what
        one solution gives, usually better than 1e-3 near the load.

    Returns
    -------
    Estimate
        Complex displacement in metres per unit load (1 N, 1 Pa, 1 N m/m) with the time factor
        exp(-i w t), of the shape (n_frequencies, n_loads, n_points).

    Raises
    ------
    ValueError
        If an argument is out of its range.
    PlateError
        If the field is infinite, at a cut-off or a resonance of a strip without loss, or not known
        to `rtol`.

    Examples
    --------
    A load and a point may be exchanged:

    >>> from stimuli import ALUMINIUM, CLAMPED, PointForce, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> there, back = (
    ...     response(
    ...         Scene(strip=strip, loads=(PointForce(x_m=x, y_m=y),), points_m=(place,)), [5000.0]
    ...     )
    ...     for x, y, place in ((0.0, 0.005, (0.02, 0.015)), (0.02, 0.015, (0.0, 0.005)))
    ... )
    >>> bool(abs(there.value - back.value).max() < there.error.max())
    True
    """
    instance("scene", scene, Scene, "a Scene")
    at_hz = scene.check_frequencies(frequencies_hz)
    if rtol is None:
        return solve_scene(scene, at_hz, ACCURACIES[0])[0]
    rtol, best = check_tolerance(rtol), math.inf
    for accuracy in ACCURACIES:
        answer, scale = solve_scene(scene, at_hz, accuracy)
        floor = np.maximum(np.abs(answer.value), _FLOOR * rtol * scale)
        best = min(best, float((answer.error / np.maximum(floor, _TINIEST)).max()))
        if best <= rtol:
            return answer
    raise PlateError(Rule.TOLERANCE, rtol=rtol, min_rtol=best)


def displacement(scene: Scene, frequencies_hz: ArrayLike, rtol: float | None = None) -> Complex:
    """Return the value of `response` alone.

    Parameters
    ----------
    scene, frequencies_hz, rtol
        As for `response`.

    Returns
    -------
    ndarray of complex128, shape (n_frequencies, n_loads, n_points)
        Metres per unit load.

    Examples
    --------
    Places on both sides of a load move alike:

    >>> from stimuli import ALUMINIUM, CLAMPED, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((-0.01, 0.01), (0.01, 0.01)))
    >>> left, right = displacement(scene, [500.0])[0, 0]
    >>> bool(abs(left - right) < 1e-12 * abs(left))
    True
    """
    return np.asarray(response(scene, frequencies_hz, rtol).value)


def solve_scene(scene: Scene, at_hz: Real, accuracy: Accuracy) -> tuple[Estimate[Complex], Real]:
    """Return the displacement, and the largest one for each frequency and load."""
    # The field is largest near a load's centre: that sets the scale of the error.
    centres_m = np.array([(load.x_m, load.y_m) for load in scene.loads])
    points_m = np.concatenate([scene.points, centres_m])
    solve = _endless_response if scene.strip.length_m is None else _finite_response
    with np.errstate(all="ignore"):  # what is infinite is refused below
        both, difference, work = solve(scene.strip, scene.loads, points_m, at_hz, accuracy)
        typical_m = [[typical_displacement(scene.strip, load)] for load in scene.loads]
        scale = np.maximum(np.abs(both[1]).max(axis=-1, keepdims=True), typical_m)
        doubt = _SAFETY * difference.max(axis=-1, keepdims=True)
        is_known = (doubt < scale).all(axis=(1, 2))
    if not is_known.all():
        raise PlateError(Rule.INFINITE, frequency_hz=float(at_hz[~is_known][0]))
    n_points = len(scene.points_m)
    fine = both[1][..., :n_points]
    error = safety_factors(scene.strip, scene.loads) * difference[..., :n_points]
    error += relative_error(scene.strip, accuracy.relative) * np.abs(fine)
    error += (_MISSED_WAVES if scene.strip.length_m is None else accuracy.missed) * scale
    return Estimate(value=fine, error=error, work=work), scale


def relative_error(strip: Strip, relative: float = RELATIVE) -> float:
    """Return the part of each displacement that both bases miss, more where patches have rims."""
    return relative * (_AT_RIMS if strip.patches else 1.0)


def typical_displacement(strip: Strip, load: Load) -> float:
    """Return about how far a load away from the edges moves a strip at rest, in metres per unit.

    Near an edge it moves it much less, and both bases miss a part of what it would do elsewhere.
    """
    area_m2 = 4 * math.prod(load.half_size_m)
    if load.is_moment:
        return _BENT * area_m2 / strip.bending_stiffness_n_m
    force_n = area_m2 if load.unit == "Pa" else 1.0
    return _PUSHED * force_n * strip.width_m**2 / strip.bending_stiffness_n_m


def displacement_map(
    strip: Strip,
    loads: Sequence[Load],
    frequency_hz: float,
    *,
    x_m: ArrayLike,
    y_m: ArrayLike,
    rtol: float | None = None,
) -> Estimate[Complex]:
    """Return the displacement of a strip on a grid at one frequency.

    Parameters
    ----------
    strip : Strip
    loads : sequence of Load
    frequency_hz : float
    x_m : array_like of float, shape (n_x,)
        Places along the strip.
    y_m : array_like of float, shape (n_y,)
        Places across it, from one edge.
    rtol : float, optional
        As for `response`.

    Returns
    -------
    Estimate
        As of `response`, of the shape (n_loads, n_x, n_y).

    Examples
    --------
    The held edges rest:

    >>> from stimuli import ALUMINIUM, CLAMPED, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> field = displacement_map(strip, [disc], 500.0, x_m=[0.0, 0.01], y_m=[0.0, 0.005, 0.025])
    >>> field.value.shape, bool(field.value[:, :, [0, 2]].any())
    ((1, 2, 3), False)
    """
    frequency_hz = finite("frequency_hz", frequency_hz, least=0.0)
    x, y = finite_array("x_m", x_m), finite_array("y_m", y_m)
    points_m = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    scene = Scene(
        strip=strip,
        loads=check_loads(strip, loads),
        points_m=tuple((x, y) for x, y in points_m.tolist()),
    )
    field = response(scene, [frequency_hz], rtol)
    value, error = (each[0].reshape(-1, x.size, y.size) for each in (field.value, field.error))
    value[:, :, (y == 0) | (y == strip.width_m)] = 0
    return Estimate(value=value, error=error, work=field.work)


def _endless_response(
    strip: Strip, loads: Sequence[Load], points_m: Real, at_hz: Real, accuracy: Accuracy
) -> tuple[Complex, Real, tuple[str, ...]]:
    """Return the displacement of an endless strip, and differences, as `_finite_response`.

    Near a cut-off without loss rounding decides, by which both bases may be wrong alike. So the
    coarse one is solved at a frequency that differs by it.
    """
    n_points = len(points_m)
    points_m = _with_neighbours_across(strip, points_m)
    omega = 2 * math.pi * at_hz
    both = np.stack(
        [
            endless_displacement(strip, loads, points_m, omega, margins, is_perturbed=is_coarse)
            for margins, is_coarse in zip(accuracy.endless, (True, False), strict=True)
        ]
    )
    difference = _largest_difference(both, n_points)
    return both[..., :n_points], difference, describe_waves(strip, loads)


def describe_waves(strip: Strip, loads: Sequence[Load]) -> tuple[str, ...]:
    """Return in words which waves were solved."""
    is_centred = all(load.y_m == strip.width_m / 2 for load in loads)
    return (f"all even {'waves; no load excites odd ones' if is_centred else 'and odd waves'}",)


def _finite_response(
    strip: Strip, loads: Sequence[Load], points_m: Real, at_hz: Real, accuracy: Accuracy
) -> tuple[Complex, Real, tuple[str, ...]]:
    """Return the displacement of a plate with ends: (2, n_frequencies, n_loads, n_points).

    The second is by how much both bases differ at each point or next to it: at a point the
    difference may pass through zero by chance.
    """
    n_points = len(points_m)
    points_m = _with_neighbours(strip, points_m)
    plate, decay_m = strip, _decay_length_m(strip, float(at_hz.max()))
    strip, loads, points_m = cut_section(plate, loads, points_m, decay_m)
    omega = 2 * math.pi * at_hz
    factors = stiffness_factors(strip, omega)
    max_hz = max(float(at_hz.max()), strip.cutoff_hz())
    n_terms = 0 if strip.patches else 2
    modes = plate_modes(strip, loads, points_m, max_hz, accuracy.modes)
    both = np.stack(
        [sum(part.response(omega, factors, max_hz, n_terms) for part in parts) for parts in modes]
    )
    if n_terms:
        rest = rest_displacement(
            strip, loads, points_m, factors, max_hz=max_hz, resolution=accuracy.rest
        )
        both += rest[:, 0] + omega[:, np.newaxis, np.newaxis] ** 2 * rest[:, 1]
    difference = _largest_difference(both, n_points)
    work = describe_modes([part.squared for part in modes[1]], plate, strip)
    return both[..., :n_points], difference, work


def _with_neighbours(strip: Strip, points_m: Real) -> Real:
    """Return points on a plate, and after them those next to each in four directions."""
    steps = _BESIDE * strip.width_m * np.array([[0, 0], [-1, 0], [1, 0], [0, -1], [0, 1]])
    neighbours_m = points_m + steps[:, np.newaxis]
    ends_m = np.array([float(strip.length_m or math.inf) / 2, strip.width_m])
    return np.clip(neighbours_m, [-ends_m[0], 0.0], ends_m).reshape(-1, 2)


def _with_neighbours_across(strip: Strip, points_m: Real) -> Real:
    """Return points on an endless strip, and after them those next to each towards both edges.

    Along it both bases are exact. At the edges, which rest, there is nothing to compare.
    """
    x_m, y_m = points_m.T
    step_m = np.minimum(_BESIDE * strip.width_m, np.minimum(y_m, strip.width_m - y_m) / 2)
    places_m = [np.stack([x_m, y_m + side * step_m], axis=1) for side in (0, -1, 1)]
    return np.concatenate(places_m)


def _largest_difference(both: Complex, n_points: int) -> Real:
    """Return by how much two bases differ at each point or at its neighbours, listed after all."""
    apart = np.abs(both[1] - both[0])
    return np.asarray(apart.reshape(*apart.shape[:2], -1, n_points).max(axis=2))


def _decay_length_m(strip: Strip, max_hz: float) -> float:
    """Return the length over which every wave has decayed, below the first cut-off."""
    if max_hz >= strip.cutoff_hz():
        return math.inf
    endless = replace(strip, length_m=None, patches=())
    even = endless.wavenumbers_rad_m(max_hz, 1, "symmetric")
    odd = endless.wavenumbers_rad_m(max_hz, 1, "antisymmetric")
    return _DECAY / float(min(even.imag.min(), odd.imag.min()))


def describe_modes(squared: Sequence[Real], plate: Strip, section: Strip) -> tuple[str, ...]:
    """Return in words which modes were solved, by symmetry, and of which section of the plate."""
    squares = np.concatenate(squared)
    max_hz = float(f"{math.sqrt(squares.max(initial=0.0)) / (2 * math.pi):.3g}")
    work = [f"{squares.size} modes up to {max_hz:.0f} Hz in {len(squared)} of 4 symmetries"]
    if section != plate:
        lengths_mm = (1e3 * float(strip.length_m or 0.0) for strip in (section, plate))
        work.append("a section of {:.0f} mm of the {:.0f} mm long plate".format(*lengths_mm))
    return tuple(work)


def plate_modes(
    strip: Strip,
    loads: Sequence[Load],
    points_m: Real,
    max_hz: float,
    resolution: Resolution,
) -> tuple[list[Modes], list[Modes]]:
    """Return the modes that loads excite, by symmetry, in the coarse and in the fine basis."""
    coarse: list[Modes] = []
    fine: list[Modes] = []
    for basis in plate_bases(strip, max_hz, resolution, loads, loads if strip.patches else ()):
        values, work = basis.values(points_m), np.stack([basis.work(load) for load in loads])
        for modes, select in zip((coarse, fine), basis.resolutions(), strict=True):
            modes.append(Modes(basis, select, values[:, select], work[:, select]))
    return coarse, fine


class Modes:
    """Modes of one symmetry in one basis, at points and under loads.

    Attributes
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of their angular frequencies without loss.
    shapes : ndarray of float64, shape (n_functions, n_modes)
    values : ndarray of float64, shape (n_points, n_functions)
    work : ndarray of float64, shape (n_loads, n_functions)
    """

    def __init__(self, basis: Basis, select: Selection, values: Real, work: Real) -> None:
        self.squared, self.shapes = basis.modes(select)
        self.values, self.work = values, work
        self.held = basis.held(select, self.shapes)
        self._basis, self._select = basis, select

    def response(
        self, omega: Complex | Real, factors: Complex, exchange_hz: float, n_terms: int
    ) -> Complex:
        """Return the sum over modes, equation (38), without the first terms in powers of w^2.

        Up to a multiple of `exchange_hz` modes exchange loss where their springs have none.
        """
        squared, shapes = self.squared[:, np.newaxis], self.shapes
        held = self.held[:, np.newaxis]
        is_slow = self.squared <= (_EXCHANGE * 2 * math.pi * exchange_hz) ** 2
        is_slow &= bool(np.any(held)) and bool(np.any(factors.imag))
        lossy, square = held + (squared - held) * factors, omega**2
        gains = np.asarray(1 / (lossy - square), dtype=np.complex128)
        if n_terms:
            gains *= (square / lossy) ** n_terms
        gains[is_slow] = 0.0
        received, excitation = self.values @ shapes, self.work @ shapes
        # Real and imaginary parts are summed alike: received is real.
        sums = [(received * row) @ gains.view(np.float64) for row in excitation]
        response = np.stack(sums).view(np.complex128).transpose(2, 0, 1)
        if is_slow.any():
            response = response + self._exchanging(shapes[:, is_slow], omega, factors, n_terms)
        return np.asarray(response)

    def _exchanging(
        self, shapes: Real, omega: Complex | Real, factors: Complex, n_terms: int
    ) -> Complex:
        """Return the same of modes that exchange loss, as their springs have none.

        One step of inverse iteration with a lossy stiffness takes the modes near to those of the
        lossy plate, and what remains of the exchange is solved at each frequency.
        """
        stiffness, mass = self._basis.selected(self._select)
        slopes = self._basis.edge_slopes[:, self._select]
        # As a sum of modes of unit stiffness, which keep the digits that sharp functions would lose
        unit = self.shapes / np.sqrt(self.squared)
        factor = factors[factors.size // 2]
        unit_slopes = slopes @ unit
        lossy = factor * np.eye(self.squared.size) + (1 - factor) * (unit_slopes.T @ unit_slopes)
        vectors = unit @ scipy.linalg.solve(
            lossy, unit.T @ mass @ shapes, assume_a="sym", check_finite=False
        )
        vectors /= np.linalg.norm(vectors, axis=0)
        whole, moved = (vectors.T @ matrix @ vectors for matrix in (stiffness, mass))
        held = (slopes @ vectors).T @ (slopes @ vectors)
        square = omega[:, np.newaxis, np.newaxis] ** 2
        # A loss factor is the same at all frequencies, and so is the plate at rest.
        unique, back = np.unique(factors, return_inverse=True)
        at_rest = held + unique[:, np.newaxis, np.newaxis] * (whole - held)
        amplitudes: NDArray[Any] = np.broadcast_to(
            vectors.T @ self.work.T, (unique.size, held.shape[0], len(self.work))
        )
        for _ in range(n_terms):
            amplitudes = moved @ np.linalg.solve(at_rest, amplitudes)
        amplitudes = np.linalg.solve(
            at_rest[back] - square * moved, square**n_terms * amplitudes[back]
        )
        return np.asarray((self.values @ vectors @ amplitudes).swapaxes(1, 2))


def first_mode_hz(strip: Strip) -> float:
    """Return the first mode's frequency without loss, at most the first cut-off.

    An endless strip has its first cut-off.
    """
    cutoff_hz = strip.cutoff_hz()
    if strip.length_m is None:
        return cutoff_hz
    plate = replace(strip, length_m=min(strip.length_m, _FAR * strip.width_m), patches=())
    centre = PointForce(x_m=0.0, y_m=strip.width_m / 2)
    resolution = ACCURACIES[0].modes
    (basis,) = plate_bases(plate, cutoff_hz, resolution, [centre])
    squared, _ = basis.modes(basis.resolutions()[1])
    return min(cutoff_hz, math.sqrt(squared[0]) / (2 * math.pi))
