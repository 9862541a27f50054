"""Modes of a plate without its patches, to seek those with them in."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.basis import joined
from stimuli.motion.patches.functions import highest_held_hz
from stimuli.strip.edge import ElasticEdge

if TYPE_CHECKING:
    from stimuli.motion.patches.functions import Functions
    from stimuli.strip.strip import Strip

_ROOM: Final = 0.05
"""How far, in widths, the functions of each disc reach at least: of discs 0.005 from an edge levels
were wrong by 0.3 dB, of those 0.09 from it by 0.01."""

_MANY, _MANY_ON_SPRINGS = 80, 300
"""Fewer polynomials of one symmetry take no longer than waves, and are known better: with 200 on
springs a level of -26 dB was wrong by 0.03 dB."""

_END: Final = np.ones(1)


def in_modes(strip: Strip, functions: Functions, highest_hz: float) -> Functions:
    """Return functions with waves of the plate instead of its polynomials, if discs have room.

    Beside the functions of discs a quarter of them does what the polynomials do. What bends next to
    an edge, as rectangles and discs that nearly touch it, no few waves do: that keeps polynomials.
    Each wave is one across the strip, at rest along it, times what it is along the plate without
    the others: the plate's own modes, but for what they exchange.
    """
    rings = [ring for one in functions.around for pair in one.rings for ring in pair]
    has_room = all(ring.reach >= _ROOM * strip.width_m for ring in rings)
    are_discs = all(patch.is_disc for patch in strip.patches)
    many = _MANY_ON_SPRINGS if isinstance(strip.edge, ElasticEdge) else _MANY
    if functions.n_plate < many or not are_discs or not has_room:
        return functions
    areal_kg_m2 = strip.material.density_kg_m3 * strip.thickness_m
    highest = (2 * math.pi * highest_held_hz(highest_hz)) ** 2 * areal_kg_m2
    held = strip.edge.stiffness_n if isinstance(strip.edge, ElasticEdge) else 0.0
    poisson, stiffness = strip.material.poisson_ratio, strip.bending_stiffness_n_m
    alongs, acrosses, numbers, found = [], [], [], []
    for across in functions.halves(1):
        slopes = across.values(np.array([-1.0, 1.0]), 1)
        bent = stiffness * across.products(2, 2) + held * slopes.T @ slopes
        rest, turn = np.linalg.eigh(bent)
        turned = across.combined(turn)
        mixed, sloped = (np.diag(turned.products(*one)) for one in ((0, 2), (1, 1)))
        first = sum(len(one.series) for one in acrosses)
        acrosses.append(turned)
        for along in functions.halves(0):
            both, one = along.products(2, 2), along.products(1, 1)
            bends = along.products(0, 2)
            at_end = np.stack([along.values(_END, order)[0] for order in (0, 1)], axis=1)
            for number, squared in enumerate(rest):
                own = both + poisson * mixed[number] * (bends + bends.T)
                own += 2 * (1 - poisson) * sloped[number] * one
                squares, vectors = np.linalg.eigh(stiffness * own)
                kept = squares + squared <= highest
                if not np.any(kept):
                    break
                finer = vectors[:, ~kept]
                yields = finer @ ((finer.T @ at_end) / (squares + squared)[~kept, np.newaxis])
                at_ends, _ = np.linalg.qr(yields)
                alongs.append(along.combined(np.append(vectors[:, kept], at_ends, axis=1)))
                numbers.append(np.full(len(alongs[-1].series), first + number))
                slowest = np.full(at_ends.shape[1], np.min(squares) + squared)
                found.append(np.append(squares[kept] + squared, slowest))
    across_of = np.concatenate(numbers)
    return dataclasses.replace(
        functions,
        along=joined(alongs),
        across=joined(acrosses),
        pairs=(np.arange(across_of.size), across_of),
        wavenumbers_rad_m=np.sqrt(np.sqrt(np.concatenate(found) / stiffness)),
    )
