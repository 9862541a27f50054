"""Modes of an endless strip: of a section of it that repeats, too long for a wave to come round."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial.legendre import leggauss

from stimuli.load import DISCS
from stimuli.motion.basis import Polynomials, disc_rings, half_waves, held_basis
from stimuli.strip.edge import CLAMPED, ElasticEdge

if TYPE_CHECKING:
    from stimuli.arrays import Real
    from stimuli.load import Load
    from stimuli.strip.strip import Strip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waves:
    """Standing waves of one symmetry across the strip, with the mass 1 each.

    Attributes
    ----------
    squared : ndarray of float64, shape (n_waves,)
        Squares of their angular frequencies without loss.
    bent : ndarray of float64, shape (n_waves,)
        What of them the plate's own stiffness gives. Waves of equal length exchange a little of
        it where the springs have no loss: a second order of the loss, left out.
    wavenumbers_rad_m : ndarray of float64, shape (n_waves,)
    turned : ndarray of float64, shape (n_waves,)
        1 for an even number of waves in the period, -1 for an odd one.
    across : Polynomials
        Functions across the strip.
    series : ndarray of float64, shape (n_across, n_waves)
    """

    squared: Real
    bent: Real
    wavenumbers_rad_m: Real
    turned: Real
    across: Polynomials
    series: Real

    def at(self, points_m: Real, *, laplacian: bool = False, odd: bool | None = None) -> Real:
        """Return cosines and sines at points (n_points, 2): (2, n_points, n_waves).

        If `odd` is given, the cosines or the sines only: (1, n_points, n_waves).
        """
        across = self.across.values(points_m[:, 1] / self.across.half_m - 1) @ self.series
        if laplacian:
            bent = self.across.values(points_m[:, 1] / self.across.half_m - 1, 2) @ self.series
            across = bent - self.wavenumbers_rad_m**2 * across
        # waves that differ across only are equally long
        lengths, of_each = np.unique(self.wavenumbers_rad_m, return_inverse=True)
        angle = points_m[:, :1] * lengths
        some = (np.cos, np.sin) if odd is None else (np.sin if odd else np.cos,)
        return np.stack([wave(angle)[:, of_each] * across for wave in some])

    def level(self, *, odd: bool) -> Waves:
        """Return those that are level at the ends of half the period, even or odd along it.

        Their mass is 1 there: they are the modes of that section, were it led at its ends.
        """
        some = self.turned == (-1 if odd else 1)
        return dataclasses.replace(
            self,
            squared=self.squared[some],
            bent=self.bent[some],
            wavenumbers_rad_m=self.wavenumbers_rad_m[some],
            turned=self.turned[some],
            series=math.sqrt(2) * self.series[:, some],
        )


def wavenumber_rad_m(strip: Strip, frequency_hz: float) -> float:
    """Return that of a bending wave in a plate without edges."""
    mass = strip.material.density_kg_m3 * strip.thickness_m
    return math.sqrt(2 * math.pi * frequency_hz * math.sqrt(mass / strip.bending_stiffness_n_m))


def strip_waves(strip: Strip, highest_hz: float, period_m: float, *, centred: bool) -> list[Waves]:
    """Return the standing waves of a strip that repeats itself, up to a frequency.

    Parameters
    ----------
    strip : Strip
        The strip; its loss does not count here, nor its length.
    highest_hz : float
        How far.
    period_m : float
        After which length it repeats.
    centred : bool
        Whether only waves that are even across the strip are asked for.
    """
    material, stiffness = strip.material, strip.bending_stiffness_n_m
    mass = material.density_kg_m3 * strip.thickness_m
    highest = 2 * math.pi * highest_hz
    most = wavenumber_rad_m(strip, highest_hz)
    turns = np.arange(math.ceil(most * period_m / (2 * math.pi)) + 1)
    s = 2 * math.pi / period_m * turns
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    n_across = half_waves(most, strip.width_m / 2)
    found = []
    for odd in (False,) if centred else (False, True):
        across = held_basis(n_across, strip.width_m, clamped=strip.edge is CLAMPED, odd=odd)
        poisson, one = material.poisson_ratio, np.eye(n_across)
        coupled = across.products(0, 2)
        square = (s**2)[:, np.newaxis, np.newaxis]
        plate = stiffness * (
            square**2 * one
            + across.products(2, 2)
            - poisson * square * (coupled + coupled.T)
            + 2 * (1 - poisson) * square * across.products(1, 1)
        )
        slopes = across.values(np.array([-1.0, 1.0]), 1)
        squared, vectors = np.linalg.eigh((plate + held * slopes.T @ slopes) / mass)
        bent = np.einsum("sim,sij,sjm->sm", vectors, plate / mass, vectors, optimize=True)
        kept = squared <= highest**2
        share = np.where(s == 0, 1.0, 2.0) / (period_m * mass)
        found.append(
            Waves(
                squared=squared[kept],
                bent=bent[kept],
                wavenumbers_rad_m=np.repeat(s, kept.sum(axis=1)),
                turned=np.repeat((-1.0) ** turns, kept.sum(axis=1)),
                across=across,
                series=(vectors * np.sqrt(share)[:, np.newaxis, np.newaxis]).transpose(1, 0, 2)[
                    :, kept
                ],
            )
        )
    return found


def nodes_of(load: Load, most_rad_m: float) -> tuple[Real, Real]:
    """Return places and weights that sum waves over a load: (n, 2) and (n,)."""
    half_x_m, half_y_m = load.half_size_m
    if not half_x_m:
        return np.array([[load.x_m, load.y_m]]), np.ones(1)
    n = 10 + math.ceil(most_rad_m * max(half_x_m, half_y_m))
    if isinstance(load, DISCS):
        rings, weights = disc_rings(n)
        angle, reach = 2 * math.pi / (2 * n) * np.arange(2 * n), half_x_m * rings
        x, y = np.multiply.outer(reach, np.cos(angle)), np.multiply.outer(reach, np.sin(angle))
        share = np.multiply.outer(weights * half_x_m**2, np.full(2 * n, math.pi / n))
    else:
        nodes, weights = leggauss(n)
        x, y = np.meshgrid(half_x_m * nodes, half_y_m * nodes)
        share = np.multiply.outer(weights, weights) * half_x_m * half_y_m / load.area_m2
    return np.stack([load.x_m + x.ravel(), load.y_m + y.ravel()], axis=1), share.ravel()


def rim_of(load: Load, most_rad_m: float) -> tuple[Real, Real, Real]:
    """Return places on a load's rim, (n, 2), and what sums slopes there, along and across.

    Their sum is that of the Laplacian over what the load covers, here of x^2 + y^2:

    >>> from stimuli.load import MomentDisc
    >>> disc = MomentDisc(x_m=0.01, y_m=0.02, radius_m=0.005)
    >>> rim_m, along_m, across_m = rim_of(disc, 100.0)
    >>> bent = 2 * (along_m @ rim_m[:, 0] + across_m @ rim_m[:, 1])
    >>> bool(np.isclose(bent, 4 * math.pi * disc.radius_m**2))
    True
    """
    half_x_m, half_y_m = load.half_size_m
    n = 10 + math.ceil(most_rad_m * max(half_x_m, half_y_m))
    if isinstance(load, DISCS):
        angle = math.pi / n * (np.arange(n) + 0.5)
        cosine, sine = np.tile(np.cos(angle), 2), np.outer((1.0, -1.0), np.sin(angle)).ravel()
        share_m = math.pi / n * half_x_m
        rim_m = np.stack([load.x_m + half_x_m * cosine, load.y_m + half_x_m * sine], axis=1)
        return rim_m, share_m * cosine, share_m * sine
    nodes, weights = leggauss(n)
    one, none = np.ones(n), np.zeros(n)
    x = np.concatenate([one, -one, nodes, nodes])
    y = np.concatenate([nodes, nodes, one, -one])
    along_m = half_y_m * np.concatenate([weights, -weights, none, none])
    across_m = half_x_m * np.concatenate([none, none, weights, -weights])
    return np.stack([load.x_m + half_x_m * x, load.y_m + half_y_m * y], axis=1), along_m, across_m
