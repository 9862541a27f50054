"""Guided waves of a strip between any edges, and the field of a load on a strip without ends.

The displacement is a sum of functions across the strip, u = sum of q_j(x) Y_j(y). Held edges do not
move, so that Poisson's ratio drops out of the bending energy, and what is left is

    q'''' - 2 A q'' + (B - k^4) q = f / D,

with the integrals A of products of slopes, B of curvatures and the work of the edge springs, and
the wavenumber k of a plate without edges. Waves q = phi exp(i p x) solve a quadratic eigenproblem
of z = p^2. It has twice as many waves as there are functions, and these are all: the field is their
sum, at any distance from a load (the semi-analytical finite element method).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.plate.area import chord_work, local_field, slice_area
from stimuli.plate.edge import ElasticEdge, edge_compliance
from stimuli.plate.line import CLAMPED_END, EVEN, ODD, SUPPORTED, make_line, place_breaks

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from stimuli.arrays import Complex, Real
    from stimuli.load import Load
    from stimuli.plate.line import Line, LineEnd, Margins
    from stimuli.plate.strip import Strip

MIN_FREQUENCY: Final = 1e-3
"""Of the first cut-off. Below it a strip moves as at this frequency, within 1e-6; nearer to 0 the
waves of one order approach each other and cancel."""
_MIN_CELL: Final = 0.03
"""Of the width: shorter cells gain nothing, and make the eigenproblem larger."""
_MIN_HALF_WAVES: Final = 3e-5
"""Of a wave over the width: at a cut-off, of slower waves rounding is all that is known."""
_MIN_COMPLIANCE: Final = 2e-7
"""Of springs, 2 D / (K W): the waves between stiffer ones are those between clamps within 4e-7."""
_MIN_NODES: Final = 3
"""Of Gauss's rule along a part of a disc, and of the whole disc beyond interior functions."""
_BACKWARD_ERROR: Final = 0.03
"""Of the largest stiffness times the machine epsilon: what eigenvalues of a fine basis miss of
omega^2, in terms of the coarse one. In drawn cross sections with cells of any width it was at most
0.022."""
_DISTANCE_DIGITS: Final = 13
"""Of distances along in metres: nearer ones are one."""
_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class CrossSection:
    """Functions across a strip, even or odd about its centre line: energies of equation (32)."""

    strip: Strip
    line: Line
    slopes: Real  # A: integrals of products of slopes
    curvatures: Real  # B without springs
    springs: Real  # work of edge springs over D

    @property
    def inertia(self) -> float:
        """Mass per area over bending stiffness: k^4 over the angular frequency squared."""
        return plate_inertia(self.strip)

    def perturb(self, omega: Complex | Real) -> Complex | Real:
        """Return angular frequencies that are lower by the backward error of the waves.

        A wave at rest changes with the root of it, so that near a cut-off without loss the field at
        these frequencies shows how much rounding changes it. A basis has too high cut-offs: what
        that changes has the same sign.
        """
        largest = np.linalg.norm(self.curvatures + self.springs, 2) / self.inertia
        missed = _BACKWARD_ERROR * np.finfo(np.float64).eps * largest
        return np.asarray(omega**2 / np.sqrt(omega**2 + missed))

    def cutoffs_hz(self) -> Real:
        """Return the cut-off frequencies of this symmetry without loss, as many as functions."""
        # The largest eigenvalues of the inverse give the lowest cut-offs to all digits. As smallest
        # eigenvalues of the matrix itself they would lose some to the largest.
        inverse = np.linalg.eigvalsh(np.linalg.inv(self.curvatures + self.springs))[::-1]
        return np.asarray(1 / np.sqrt(inverse * self.inertia) / (2 * math.pi))

    def mode_shapes(self, y_m: Real) -> Real:
        """Return the shapes at cut-offs, by frequency, whose squares have an integral of 1.

        They are (n_places, n_functions), and positive near the edge y = 0.
        """
        _, shapes = np.linalg.eigh(self.curvatures + self.springs)
        near_m = self.strip.width_m / (4 * np.arange(2, 2 * shapes.shape[1] + 1, 2))
        first = self.line.derivatives(near_m, (0,))[0]
        signs = np.sign(np.einsum("mf,fm->m", first, shapes))
        return np.asarray(self.line.derivatives(y_m, (0,))[0] @ (signs * shapes))

    def waves(self, omega: Complex | Real) -> Waves:
        """Return all waves that go or decay to the right at angular frequencies, equation (33)."""
        strip, n = self.strip, len(self.slopes)
        lossy = stiffness_factors(strip, omega)
        # Real eigenproblems take a quarter of the time.
        factor: Complex | Real = lossy if np.any(lossy.imag) else lossy.real
        fourth = self.inertia * omega**2 / factor
        relative = 1 / factor if has_lossless_springs(strip) else np.ones_like(factor)
        # A size of z makes both halves of the matrix alike.
        size = 30 * (math.pi / strip.width_m) ** 2
        matrix = np.zeros((omega.size, 2 * n, 2 * n), dtype=fourth.dtype)
        matrix[:, :n, n:] = size * np.eye(n)
        matrix[:, n:, :n] = (
            fourth[:, np.newaxis, np.newaxis] * np.eye(n)
            - self.curvatures
            - relative[:, np.newaxis, np.newaxis] * self.springs
        ) / size
        matrix[:, n:, n:] = -2 * self.slopes
        squared, vectors = np.linalg.eig(matrix)
        # Where waves meet, vectors of the problem and of the transposed one are no longer alike.
        excitations = np.linalg.inv(vectors.swapaxes(1, 2))[:, n:] / size
        wavenumbers = np.sqrt(squared.astype(np.complex128))
        outgoing = np.where(wavenumbers.imag < 0, -wavenumbers, wavenumbers)
        return Waves(outgoing, vectors[:, :n], excitations.astype(np.complex128))


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """All waves of a cross section at some frequencies.

    Attributes
    ----------
    wavenumbers_rad_m : ndarray of complex128, shape (n_frequencies, n_waves)
        p of exp(i p x), with Im p >= 0.
    shapes : ndarray, shape (n_frequencies, n_functions, n_waves)
    excitations : ndarray, same shape
        What loads on the functions excite of each wave: shapes over phi^T (2 z + 2 A) phi.
    """

    wavenumbers_rad_m: Complex
    shapes: Complex
    excitations: Complex


def make_cross_section(
    strip: Strip,
    max_wavenumber_rad_m: float,
    parity: int,
    margins: Margins,
    places_m: Iterable[float] = (),
) -> CrossSection:
    """Return functions across a strip with breaks at places, where loads begin and end.

    Polynomials follow many half waves with pi / 2 functions for each, few with one and a margin.
    """
    middle_m = strip.width_m / 2
    folded = (min(y_m, strip.width_m - y_m) for y_m in places_m)
    breaks_m = place_breaks(
        folded, 0.0, middle_m, min_cell_m=_MIN_CELL * strip.width_m, max_cell_m=middle_m
    )
    ends = edge_end(strip), EVEN if parity > 0 else ODD
    half_waves = max_wavenumber_rad_m * middle_m / math.pi
    wavenumber_rad_m = max_wavenumber_rad_m * max(1.0, math.pi / 2 - 1 / half_waves)
    line = make_line(breaks_m, (wavenumber_rad_m, wavenumber_rad_m), ends, margins, parity)
    slopes, curvatures = line.products((1, 1), (2, 2))
    held = edge_slopes(strip, line)
    springs = held.T @ held / strip.bending_stiffness_n_m
    return CrossSection(strip, line, slopes, curvatures, springs)


def edge_end(strip: Strip) -> LineEnd:
    """Return what functions across may have at an edge."""
    return CLAMPED_END if _is_clamped(strip) else SUPPORTED


def _is_clamped(strip: Strip) -> bool:
    """Return whether the edges hold as clamps do: such stiff springs would take all digits."""
    compliance = edge_compliance(strip.edge, strip.bending_stiffness_n_m, strip.width_m)
    return compliance < _MIN_COMPLIANCE


def edge_slopes(strip: Strip, line: Line) -> Real:
    """Return edge slopes of functions across in terms of springs: (n_edges, n_functions).

    The work of the springs is the sum of their squares.
    """
    if not isinstance(strip.edge, ElasticEdge) or _is_clamped(strip):
        return np.zeros((0, line.size))
    (slopes,) = line.derivatives([0.0, strip.width_m], (1,))
    return np.asarray(math.sqrt(strip.edge.stiffness_n) * slopes)


def has_lossless_springs(strip: Strip) -> bool:
    """Return whether the edges keep their stiffness where the plate has loss."""
    return isinstance(strip.edge, ElasticEdge) and strip.edge.lossless


def plate_inertia(strip: Strip) -> float:
    """Return mass per area over bending stiffness, in s^2 / m^4."""
    return strip.material.density_kg_m3 * strip.thickness_m / strip.bending_stiffness_n_m


def plate_wavenumber(strip: Strip, frequency_hz: float) -> float:
    """Return the wavenumber of bending waves in a plate without edges, equation (4)."""
    return math.sqrt(2 * math.pi * frequency_hz * math.sqrt(plate_inertia(strip)))


def stiffness_factors(strip: Strip, omega: Complex | Real) -> Complex:
    """Return what loss multiplies the bending stiffness with, at each angular frequency."""
    material = strip.material
    loss = material.loss_factor + omega * material.viscous_time_s
    return np.asarray(1 - 1j * loss, dtype=np.complex128)


def endless_displacement(
    strip: Strip,
    loads: Sequence[Load],
    points_m: Real,
    omega: Complex | Real,
    margins: Margins,
    *,
    is_perturbed: bool = False,
) -> Complex:
    """Return the displacement of an endless strip per unit load, equation (34).

    The shape is (n_frequencies, n_loads, n_points). Angular frequencies may be complex; lower ones
    than `MIN_FREQUENCY` cut-offs are taken for that. Loads on the centre line excite no odd waves,
    which are left out. A perturbed field is that of `CrossSection.perturb`.
    """
    min_omega = 2 * math.pi * MIN_FREQUENCY * strip.cutoff_hz()
    omega = np.where(np.abs(omega) < min_omega, min_omega, omega)
    fields = np.zeros((omega.size, len(loads), len(points_m)), dtype=np.complex128)
    fields += np.stack([local_field(load, points_m) for load in loads])
    wavenumber = plate_wavenumber(strip, float(np.abs(omega).max()) / (2 * math.pi))
    places_m = [load.y_m + side * load.half_size_m[1] for load in loads for side in (-1, 1)]
    is_centred = all(
        abs(load.y_m - strip.width_m / 2) < _ROUNDING * strip.width_m for load in loads
    )
    for parity in (1,) if is_centred else (1, -1):
        section = make_cross_section(strip, wavenumber, parity, margins, places_m)
        at_omega = section.perturb(omega) if is_perturbed else omega
        fields += _wave_fields(section, loads, points_m, at_omega)
    stiffness = strip.bending_stiffness_n_m * stiffness_factors(strip, omega)
    return np.asarray(fields / stiffness[:, np.newaxis, np.newaxis])


def _wave_fields(
    section: CrossSection, loads: Sequence[Load], points_m: Real, omega: Complex | Real
) -> Complex:
    """Return D times the displacement by waves of one symmetry.

    Loads that differ only in where they are along the strip share the amplitudes of waves.
    """
    waves = section.waves(omega)
    fourth = section.inertia * omega**2 / stiffness_factors(section.strip, omega)
    x_m, y_m = points_m.T
    values = section.line.derivatives(y_m, (0,))[0] @ waves.shapes
    fields = np.zeros((omega.size, len(loads), len(points_m)), dtype=np.complex128)
    equal: dict[Load, list[int]] = {}
    for number, load in enumerate(loads):
        equal.setdefault(replace(load, x_m=0.0), []).append(number)
    for load, numbers in equal.items():
        centres_m = np.array([loads[number].x_m for number in numbers])
        away_m = np.round(np.abs(x_m - centres_m[:, np.newaxis]), _DISTANCE_DIGITS)
        distances_m, back = np.unique(away_m, return_inverse=True)
        amplitudes = _wave_amplitudes(load, distances_m, section, waves, fourth)
        for place, amplitude in enumerate(amplitudes):
            for number, point in np.argwhere(back.reshape(away_m.shape) == place):
                fields[:, numbers[number], point] = (values[:, point] * amplitude).sum(axis=-1)
    return fields


def _wave_amplitudes(
    load: Load, distances_m: Real, section: CrossSection, waves: Waves, fourth: Complex
) -> Iterator[Complex]:
    """Yield the amplitude of each wave at increasing distances along from a load's centre.

    A wave to the right gathers what each part of the load adds to it, and goes on alone beyond the
    load. Within the load the wave to the left comes to it, which at one place is the wave to the
    right at the opposite one, as loads are symmetric. `fourth` is k^4.
    """
    half_m, wavenumbers = load.half_size_m[0], waves.wavenumbers_rad_m
    within_m = distances_m[distances_m < half_m * (1 - _ROUNDING)]
    ends_m = np.array([-half_m, *np.unique([-within_m, within_m]), half_m])
    n_nodes = 1  # a rectangle's chords are alike: waves are integrated over its length as they are
    if load.is_disc:
        share = np.diff(ends_m).max() / (2 * half_m)
        n_nodes = _MIN_NODES + math.ceil(share * (_MIN_NODES + 2 * max(section.line.interior)))
    slices = slice_area(load, n_nodes, load.x_m + ends_m)
    parts = np.split(np.arange(slices.x_m.size), ends_m.size - 1)
    force, curvature, inertia = chord_work(load, slices, section.line)
    to_the_right = [np.zeros(wavenumbers.shape, dtype=np.complex128)]
    for start_m, end_m, part in zip(ends_m[:-1], ends_m[1:], parts, strict=True):
        work = (force[part] + fourth[:, np.newaxis, np.newaxis] * inertia[part]) @ waves.excitations
        if curvature.any():
            work -= (wavenumbers**2)[:, np.newaxis] * (curvature[part] @ waves.excitations)
        turn = 1j * wavenumbers * (end_m - start_m)
        if load.is_disc:
            ways_m = load.x_m + end_m - slices.x_m[part]
            phases = np.exp(1j * wavenumbers[:, np.newaxis] * ways_m[:, np.newaxis])
        else:
            mean = np.expm1(turn) / np.where(turn == 0, 1.0, turn)
            phases = np.where(turn == 0, 1.0, mean)[:, np.newaxis]
        added = np.einsum("n,fnm,fnm->fm", slices.weights_m[part], work, phases)
        come = to_the_right[-1] * np.exp(turn)
        to_the_right.append(come + added)
    is_cutoff = np.abs(wavenumbers) < _MIN_HALF_WAVES * math.pi / section.strip.width_m
    gains = np.where(is_cutoff, np.nan, 1j / (2 * wavenumbers))
    both_ways = [a + b for a, b in zip(to_the_right, to_the_right[::-1], strict=True)]
    yield from (gains * both for both in both_ways[-1 - within_m.size : -1])
    for distance_m in distances_m[within_m.size :]:
        yield gains * to_the_right[-1] * np.exp(1j * wavenumbers * (distance_m - half_m))
