"""Modes of a plate held along its long edges, its ends free: by Rayleigh's and Ritz's method.

Sought are they in standing waves that are level at the ends, as those of a strip that repeats
itself after twice the length are, and in a few functions that fall off from the ends. The waves
are modes already but for the ends, so that as few of them are enough as there are modes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.standing_waves import Waves, strip_waves, wavenumber_rad_m
from stimuli.strip.edge import ElasticEdge

if TYPE_CHECKING:
    from stimuli.arrays import Real
    from stimuli.motion.basis import Polynomials
    from stimuli.strip.strip import Strip


_ABOVE: Final = 1.5
"""Waves are taken up to so many times the highest mode's frequency."""

_RATES: Final = 6
_SLOWEST, _FASTEST = 0.5, 4.0
"""What falls off from the ends does so at rates between so many times pi / width and so many times
the largest wavenumber, each by the same factor faster than the one before."""

_COUPLED: Final = 120
"""With more modes of one symmetry, what springs take from one and give to another is left out: a
long plate is an endless strip but for its ends, where that is of second order in the loss."""

_INDEPENDENT: Final = 1e-8
"""Of what falls off a combination is left out if the waves and the others give it but for this."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Modes:
    """Modes of one symmetry, with the mass 1 each.

    Attributes
    ----------
    squared : ndarray of float64, shape (n_modes,)
        Squares of their angular frequencies without loss.
    bent : ndarray of float64, shape (n_modes, n_modes) or (n_modes,)
        What of them the plate's own stiffness gives, without springs along the edges: it has loss
        where those may have none. Of many modes each one's own.
    waves : Waves
        Standing waves of the same symmetry.
    ends : Ends
        What falls off from the ends.
    of_waves, of_ends : ndarray of float64, shapes (n_waves, n_modes) and (n_ends, n_modes)
        The modes in those.
    """

    squared: Real
    bent: Real
    waves: Waves
    ends: Ends
    of_waves: Real
    of_ends: Real

    def at(self, points_m: Real, *, laplacian: bool = False) -> Real:
        """Return the modes at points (n_points, 2), or their Laplacians: (1, n_points, n_modes)."""
        along, across = self.ends.at(points_m[:, 0]), self.waves.across
        place = points_m[:, 1] / across.half_m - 1
        fallen = along[:, :, np.newaxis] * across.values(place)[:, np.newaxis]
        if laplacian:
            bent = along[:, :, np.newaxis] * across.values(place, 2)[:, np.newaxis]
            fallen = bent + self.ends.rates_rad_m[:, np.newaxis] ** 2 * fallen
        (waves,) = self.waves.at(points_m, laplacian=laplacian, odd=self.ends.odd)
        n_points = len(points_m)
        both = waves @ self.of_waves + fallen.reshape(n_points, -1) @ self.of_ends
        return np.asarray(both[np.newaxis])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ends:
    """Functions along the plate that are 1 at its end and fall off from there: cosh a x, sinh a x.

    Attributes
    ----------
    rates_rad_m : ndarray of float64, shape (n_rates,)
        How fast, a.
    half_m : float
        Half the length.
    odd : bool
        Whether they are -1 at the other end.
    """

    rates_rad_m: Real
    half_m: float
    odd: bool

    def at(self, x_m: Real) -> Real:
        """Return them at places: (n_places, n_rates)."""
        sign, rates = -1 if self.odd else 1, self.rates_rad_m
        near = np.exp(np.multiply.outer(x_m - self.half_m, rates))
        far = np.exp(-np.multiply.outer(x_m + self.half_m, rates))
        return np.asarray((near + sign * far) / (1 + sign * np.exp(-2 * self.half_m * rates)))

    def with_waves(self, wavenumbers_rad_m: Real) -> Along:
        """Return their integrals with waves that are level at the ends: (n_waves, n_rates)."""
        angle = wavenumbers_rad_m[:, np.newaxis] * self.half_m
        top = np.sin(angle) if self.odd else np.cos(angle)
        s2, a2 = wavenumbers_rad_m[:, np.newaxis] ** 2, self.rates_rad_m**2
        plain = 2 * self.rates_rad_m * self._slopes * top / (a2 + s2)
        return Along(
            plain=plain,
            bent=-s2 * plain,
            other=a2 * plain,
            both=-s2 * a2 * plain,
            sloped=s2 * plain,
        )

    def with_each_other(self) -> Along:
        """Return their integrals with each other: (n_rates, n_rates)."""
        a, b = self.rates_rad_m[:, np.newaxis], self.rates_rad_m
        of_a, of_b = self._slopes[:, np.newaxis], self._slopes
        same = np.eye(b.size, dtype=bool)
        apart = np.where(same, 1.0, a**2 - b**2)
        left = self.half_m * (1 - of_a**2)
        plain = np.where(same, of_a / a + left, 2 * (a * of_a - b * of_b) / apart)
        sloped = a * b * np.where(same, of_a / a - left, 2 * (a * of_b - b * of_a) / apart)
        return Along(
            plain=plain,
            bent=a**2 * plain,
            other=b**2 * plain,
            both=(a * b) ** 2 * plain,
            sloped=sloped,
        )

    @property
    def _slopes(self) -> Real:
        """Their slopes at the end, as parts of the rates."""
        flat = np.tanh(self.rates_rad_m * self.half_m)
        return np.asarray(1 / flat if self.odd else flat)


class Along(NamedTuple):
    """Integrals along the plate of some functions with others, and of their derivatives."""

    plain: Real
    bent: Real  # the second derivative of the first
    other: Real  # the second derivative of the other
    both: Real
    sloped: Real  # both first derivatives


def n_waves(strip: Strip, highest_hz: float) -> int:
    """Return in about how many waves the modes of each symmetry are sought; endless strips: 0."""
    turns = wavenumber_rad_m(strip, _ABOVE * highest_hz) / (2 * math.pi)
    return math.ceil(turns * (strip.length_m or 0.0) * (turns * strip.width_m + 1))


def plate_modes(strip: Strip, highest_hz: float, *, centred: bool) -> list[Modes]:
    """Return the modes of a finite plate up to a frequency, a group for each symmetry, (78).

    Parameters
    ----------
    strip : Strip
        The plate; its loss does not count here.
    highest_hz : float
        How far.
    centred : bool
        Whether only modes that are even across the strip are asked for.
    """
    length_m = strip.length_m or 0.0
    slowest = _SLOWEST * math.pi / strip.width_m
    fastest = _FASTEST * wavenumber_rad_m(strip, highest_hz)
    rates = np.geomspace(slowest, fastest, _RATES)
    return [
        _modes(
            strip,
            waves.level(odd=odd),
            Ends(rates_rad_m=rates, half_m=length_m / 2, odd=odd),
            highest_hz,
        )
        for waves in strip_waves(strip, _ABOVE * highest_hz, 2 * length_m, centred=centred)
        for odd in (False, True)
    ]


class AboveFirstModeError(ValueError):
    """A frequency from which on a plate's ends and loss count as much as what drives it.

    >>> AboveFirstModeError(2950.0, 2891.118).first_hz
    2891.118
    """

    def __init__(self, frequency_hz: float, first_hz: float) -> None:
        super().__init__(
            f"frequency_hz must lie below the strip's first mode, {first_hz:.6g} Hz (without ends "
            f"its first cut-off), got {frequency_hz!r}"
        )
        self.first_hz = first_hz


def refuse_above_first_mode(strip: Strip, frequency_hz: float) -> None:
    """Refuse a frequency that is not below the first mode of a strip without patches.

    Below sqrt(1 - nu^2) of the first cut-off there is none, (59), and none is sought.
    """
    if frequency_hz < math.sqrt(1 - strip.material.poisson_ratio**2) * strip.cutoff_hz():
        return
    first_hz = _first_mode_hz(strip)
    if frequency_hz >= first_hz:
        raise AboveFirstModeError(frequency_hz, first_hz)


_FAR: Final = 40.0
"""Ends so many widths apart hardly see each other: 5e-6 of the first mode on the paper's plate."""


@lru_cache(maxsize=8)
def _first_mode_hz(strip: Strip) -> float:
    """Return the first mode's frequency, at most the first cut-off, which an endless strip has."""
    cutoff_hz = strip.cutoff_hz()
    if strip.length_m is None:
        return cutoff_hz
    length_m = min(strip.length_m, _FAR * strip.width_m)
    modes = plate_modes(replace(strip, length_m=length_m), cutoff_hz, centred=True)
    found_hz = [np.sqrt(group.squared) / (2 * math.pi) for group in modes]
    return float(np.min(np.concatenate(found_hz), initial=cutoff_hz))


def _modes(strip: Strip, waves: Waves, ends: Ends, highest_hz: float) -> Modes:
    """Return the modes of one symmetry.

    What falls off from the ends is made orthogonal to the waves first. The matrix then has the
    squares of the waves on its diagonal, and no second matrix is left.
    """
    tied, alone = ends.with_waves(waves.wavenumbers_rad_m), ends.with_each_other()
    one = np.eye(waves.across.series.shape[0])
    areal = strip.material.density_kg_m3 * strip.thickness_m
    shared, mass = _wide(tied.plain, waves, areal * one), np.kron(alone.plain, areal * one)
    stiff, own = np.zeros_like(shared), np.zeros_like(mass)
    for x, y in _energies(strip, tied, waves.across):
        stiff += _wide(x, waves, y)
    for x, y in _energies(strip, alone, waves.across):
        own += np.kron(x, y)
    size = 1 / np.sqrt(np.diag(mass))
    shares, turned = np.linalg.eigh(size[:, np.newaxis] * (mass - shared.T @ shared) * size)
    kept = shares > _INDEPENDENT
    basis = size[:, np.newaxis] * turned[:, kept] / np.sqrt(shares[kept])
    weighed = waves.squared[:, np.newaxis] * shared
    bare = own - shared.T @ stiff - stiff.T @ shared + shared.T @ weighed
    off = (stiff - weighed) @ basis
    squared, vectors = np.linalg.eigh(
        np.block([[np.diag(waves.squared), off], [off.T, basis.T @ bare @ basis]])
    )
    n_modes = int(np.searchsorted(squared, (2 * math.pi * highest_hz) ** 2, side="right"))
    squared, vectors = squared[:n_modes], vectors[:, :n_modes]
    of_ends = basis @ vectors[waves.squared.size :]
    of_waves = vectors[: waves.squared.size] - shared @ of_ends
    held = np.zeros_like(squared)
    springs = _springs(strip, waves.across)
    if np.any(springs):
        mixed = of_waves.T @ _wide(tied.plain, waves, springs) @ of_ends
        held = (
            of_waves.T @ _exchanged(waves, springs / areal) @ of_waves
            + mixed
            + mixed.T
            + of_ends.T @ np.kron(alone.plain, springs) @ of_ends
        )
    bent = np.diag(squared) - held
    return Modes(
        squared=squared,
        bent=bent if squared.size <= _COUPLED else np.diag(bent),
        waves=waves,
        ends=ends,
        of_waves=of_waves,
        of_ends=of_ends,
    )


def _energies(strip: Strip, along: Along, across: Polynomials) -> list[tuple[Real, Real]]:
    """Return the terms of plate and springs, each a factor along the strip and one across it."""
    poisson, stiffness = strip.material.poisson_ratio, strip.bending_stiffness_n_m
    coupled = poisson * across.products(0, 2)
    terms = [
        (along.both, np.eye(coupled.shape[0])),
        (along.plain, across.products(2, 2)),
        (along.bent, coupled),
        (along.other, coupled.T),
        (along.sloped, 2 * (1 - poisson) * across.products(1, 1)),
    ]
    plate = [(x, stiffness * y) for x, y in terms]
    return [*plate, (along.plain, _springs(strip, across))]


def _springs(strip: Strip, across: Polynomials) -> Real:
    """Return what the springs along both edges give across the strip, per length."""
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    slopes = across.values(np.array([-1.0, 1.0]), 1)
    return np.asarray(held * slopes.T @ slopes)


def _exchanged(waves: Waves, springs: Real) -> Real:
    """Return what springs give to pairs of waves of the mass 1: equally long ones only."""
    across = waves.series / np.linalg.norm(waves.series, axis=0)
    equal = waves.wavenumbers_rad_m[:, np.newaxis] == waves.wavenumbers_rad_m
    return np.asarray(np.where(equal, across.T @ springs @ across, 0.0))


def _wide(along: Real, waves: Waves, across: Real) -> Real:
    """Return a term of the waves with all that falls off: (n_waves, n_rates * n_across)."""
    both = along[:, :, np.newaxis] * (waves.series.T @ across)[:, np.newaxis]
    return np.asarray(both.reshape(len(along), -1))
