"""Modes of a plate without its patches, to seek those with them in."""

from __future__ import annotations

import dataclasses
from itertools import product
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

_MANY, _MANY_ON_SPRINGS = 80, 300
"""Fewer polynomials of one symmetry take no longer than waves, and are known better: with 200 on
springs a level of -26 dB was wrong by 0.03 dB."""

_AT_ENDS: Final = 2
"""What is free at the ends: to turn and to move. Without both, levels of plates on springs that
are 13 widths long were wrong by 0.03 dB, with them by less than 0.01; they count at all sizes."""


def in_modes(strip: Strip, functions: Functions, highest_hz: float) -> Functions:
    """Return functions with waves of the plate instead of its polynomials, if discs have room.

    Beside the functions of discs a quarter of them does what the polynomials do. What bends next to
    an edge, as rectangles and discs that nearly touch it, no few waves do: that keeps polynomials.
    Each wave is one across the strip, at rest along it, times what it is along the plate without
    the others: the plate's own modes, but for what they exchange.
    """
    rings = [ring for one in functions.around for pair in one.rings for ring in pair]
    has_room = all(bool(ring.reach >= _ROOM * strip.width_m) for ring in rings)
    are_discs = all(patch.is_disc for patch in strip.patches)
    many = _MANY_ON_SPRINGS if isinstance(strip.edge, ElasticEdge) else _MANY
    if functions.n_plate < many or not are_discs or not has_room:
        return functions
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    acrosses: list[Polynomials] = []
    alongs, numbers, found = [], [], []
    for across in functions.halves(1):
        slopes = across.values(np.array([-1.0, 1.0]), 1)
        bent = across.products(2, 2) + held / strip.bending_stiffness_n_m * slopes.T @ slopes
        fourth, turn = np.linalg.eigh(bent)
        turned = across.combined(turn)
        bends, slants = (np.diag(turned.products(*one)) for one in ((0, 2), (1, 1)))
        first = sum(len(one.series) for one in acrosses)
        acrosses.append(turned)
        for along, number in product(functions.halves(0), range(fourth.size)):
            wave = _Across(fourth[number], bends[number], slants[number])
            some = _along(along, wave, strip, highest_hz)
            if some is not None:
                alongs.append(some[0])
                found.append(some[1])
                numbers.append(np.full(some[1].size, first + number))
    across_of = np.concatenate(numbers)
    return dataclasses.replace(
        functions,
        along=joined(alongs),
        across=joined(acrosses),
        pairs=(np.arange(across_of.size), across_of),
        wavenumbers_rad_m=np.concatenate(found),
    )


class _Across(NamedTuple):
    """Integrals over a wave across the strip: its curvature, with its curvature, and its slope."""

    fourth: float  # springs along the edges included, 1/m^4
    bends: float  # 1/m^2
    slants: float


def _along(
    along: Polynomials, wave: _Across, strip: Strip, highest_hz: float
) -> tuple[Polynomials, Real] | None:
    """Return what a wave across the strip is along it, up to a frequency, and wavenumbers.

    With what ends that are free to turn and to move make of it, of all that is above together: one
    wave across takes that from another there, however short it is. None where nothing is left.
    """
    poisson, bends = strip.material.poisson_ratio, along.products(0, 2)
    own = along.products(2, 2) + poisson * wave.bends * (bends + bends.T)
    own += 2 * (1 - poisson) * wave.slants * along.products(1, 1)
    fourth, vectors = np.linalg.eigh(own)
    fourth += wave.fourth
    kept = fourth <= wavenumber_rad_m(strip, highest_held_hz(highest_hz)) ** 4
    finer = vectors[:, ~kept]
    series, wavenumbers = vectors[:, kept], np.sqrt(np.sqrt(fourth[kept]))
    if finer.shape[1] > _AT_ENDS:
        ends = np.stack([along.values(np.ones(1), order)[0] for order in (0, 1)], axis=1)
        yields, _ = np.linalg.qr(finer @ ((finer.T @ ends) / fourth[~kept, np.newaxis]))
        series = np.append(series, yields, axis=1)
        wavenumbers = np.append(wavenumbers, np.zeros(_AT_ENDS))
    return (along.combined(series), wavenumbers) if wavenumbers.size else None
