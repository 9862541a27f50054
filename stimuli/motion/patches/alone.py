"""Waves of a plate without its patches, to seek its modes with them in."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from stimuli.motion.basis import joined
from stimuli.motion.patches.functions import highest_held_hz
from stimuli.motion.standing_waves import wavenumber_rad_m
from stimuli.strip.edge import ElasticEdge

if TYPE_CHECKING:
    from stimuli.arrays import Real
    from stimuli.motion.basis import Polynomials
    from stimuli.motion.patches.functions import Functions
    from stimuli.strip.strip import Strip

_ROOM: Final = 0.05
"""How far, in widths, the functions of each disc reach at least: of discs 0.005 from an edge levels
were wrong by 0.3 dB, of those 0.09 from it by 0.01."""

_MANY: Final = 80
"""Fewer polynomials of one symmetry take no longer than waves, and are known better."""

_AT_ENDS: Final = 2
"""What is free at the ends: to turn and to move. Without both, levels of plates on springs that
are 13 widths long were wrong by 0.03 dB; without those of waves that are too fast to be among the
others, first frequencies by 1e-3."""


def in_waves(strip: Strip, functions: Functions, highest_hz: float) -> Functions:
    """Return functions with waves of the plate instead of its polynomials, if discs have room.

    Each is a wave across the strip times what that is along it without the others. Beside the
    functions of discs a quarter as many do what polynomials do. What bends next to an edge, as
    rectangles and discs that nearly touch it, no few waves do: that keeps polynomials.
    """
    rings = [ring for one in functions.around for pair in one.rings for ring in pair]
    has_room = all(bool(ring.reach >= _ROOM * strip.width_m) for ring in rings)
    are_discs = all(patch.is_disc for patch in strip.patches)
    if functions.n_plate < _MANY or not are_discs or not has_room:
        return functions
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    found: list[_Waves] = []
    kinds: list[int] = []
    for across in functions.halves(1):
        slopes = across.values(np.array([-1.0, 1.0]), 1)
        bent = across.products(2, 2) + held / strip.bending_stiffness_n_m * slopes.T @ slopes
        fourth, turn = np.linalg.eigh(bent)
        section = _Section(across.combined(turn), fourth, strip)
        for along in functions.halves(0):
            ends = np.stack([along.values(np.ones(1), order)[0] for order in (0, 1)], axis=1)
            kind = kinds[-1] + 1 if kinds else 0
            for number in range(fourth.size):
                some = section.waves(along, ends, number, highest_hz)
                found += some
                kinds += [kind] * sum(one.wavenumbers_rad_m.size for one in some)
    wavenumbers_rad_m = np.concatenate([one.wavenumbers_rad_m for one in found])
    order = np.argsort(wavenumbers_rad_m, kind="stable")
    alike = np.array(kinds)[order]
    return dataclasses.replace(
        functions,
        along=joined([one.along for one in found]).part(order),
        across=joined([one.across for one in found]).part(order),
        pairs=(np.arange(order.size), np.arange(order.size)),
        wavenumbers_rad_m=wavenumbers_rad_m[order],
        alike=tuple(np.flatnonzero(alike == kind) for kind in np.unique(alike)),
    )


class _Waves(NamedTuple):
    """Products, each of one function along and one across."""

    along: Polynomials
    across: Polynomials
    wavenumbers_rad_m: Real


class _Section:
    """The waves across a strip that are at rest along it, and what they are at other lengths."""

    def __init__(self, across: Polynomials, fourth: Real, strip: Strip) -> None:
        self._across, self._fourth, self._strip = across, fourth, strip
        self._bends, self._slants = (across.products(*one) for one in ((0, 2), (1, 1)))
        self._poisson = strip.material.poisson_ratio

    def waves(self, along: Polynomials, ends: Real, number: int, highest_hz: float) -> list[_Waves]:
        """Return what one of them is along the strip, up to a frequency.

        `ends` are values and slopes of `along` at an end: (n_along, 2).

        With what ends that are free to turn and to move make of it, of all that is above together:
        one wave across takes that from another there, however short it is.
        """
        rest = np.zeros((self._fourth.size, 1))
        rest[number] = 1.0
        slant, bends = along.products(1, 1), along.products(0, 2)
        own = along.products(2, 2)
        own += self._poisson * self._bends[number, number] * (bends + bends.T)
        own += 2 * (1 - self._poisson) * self._slants[number, number] * slant
        most = wavenumber_rad_m(self._strip, highest_held_hz(highest_hz)) ** 4
        swung, fourth = np.zeros((len(own), 0)), np.zeros(0)
        if self._fourth[number] < most:
            fourth, vectors = np.linalg.eigh(own)
            n_kept = int(np.searchsorted(fourth, most - self._fourth[number], side="right"))
            fourth, swung = fourth[:n_kept] + self._fourth[number], vectors[:, :n_kept]
        found = []
        if fourth.size:
            square = np.einsum("ik,ij,jk->k", swung, slant, swung, optimize=True)
            across = self._across.combined(self._shapes(square, number))
            found = [_Waves(along.combined(swung), across, np.sqrt(np.sqrt(fourth)))]
        if len(own) - fourth.size > _AT_ENDS:
            # all that these leave of what the ends do at rest
            own[np.diag_indices_from(own)] += self._fourth[number]
            at_rest = np.linalg.solve(own, ends) - swung @ (
                (swung.T @ ends) / fourth[:, np.newaxis]
            )
            yields, _ = np.linalg.qr(at_rest)
            resting = self._across.combined(np.repeat(rest, _AT_ENDS, axis=1))
            found.append(_Waves(along.combined(yields), resting, np.zeros(_AT_ENDS)))
        return found

    def _shapes(self, square: Real, number: int) -> Real:
        """Return a wave across, of some lengths along, in those at rest: (n_across, n_lengths).

        `square` are the squares of the wavenumbers along.
        """
        mixed = 2 * (1 - self._poisson) * self._slants
        mixed -= self._poisson * (self._bends + self._bends.T)
        every = np.diag(self._fourth) + square[:, np.newaxis, np.newaxis] * mixed
        _, vectors = np.linalg.eigh(every)
        return np.asarray(vectors[:, :, number].T)
