"""Modes of a plate without its patches, to seek those with them in."""

from __future__ import annotations

import dataclasses
import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.motion.patches.functions import PlateModes, highest_held_hz
from stimuli.motion.patches.matrices import alone

if TYPE_CHECKING:
    from stimuli.motion.patches.functions import Functions
    from stimuli.strip.strip import Strip

_ROOM: Final = 0.05
"""How far, in widths, the functions of each disc reach at least: of discs 0.005 from an edge levels
were wrong by 0.3 dB, of those 0.09 from it by 0.01."""

_MANY: Final = 300
"""Fewer polynomials of one symmetry take no longer than their modes, and are known better."""


def in_modes(strip: Strip, functions: Functions, highest_hz: float) -> Functions:
    """Return functions with the plate's own modes instead of its polynomials, if discs have room.

    Beside the functions of discs a quarter of them does what the polynomials do. What bends next to
    an edge, as rectangles and discs that nearly touch it, no few modes do: that keeps polynomials.
    """
    from scipy.linalg import eigh

    rings = [ring for one in functions.around for pair in one.rings for ring in pair]
    has_room = all(ring.reach >= _ROOM * strip.width_m for ring in rings)
    are_discs = all(patch.is_disc for patch in strip.patches)
    if functions.n_plate < _MANY or not are_discs or not has_room:
        return functions
    areal_kg_m2 = strip.material.density_kg_m3 * strip.thickness_m
    highest = 2 * math.pi * highest_held_hz(highest_hz)
    found, squares = [], []
    for some, alike in functions.alike():
        stiffness, springs = alone(strip, alike)
        squared, vectors = eigh(
            (stiffness + springs) / areal_kg_m2,
            subset_by_value=(-math.inf, highest**2),
            overwrite_a=True,
            check_finite=False,
        )
        found.append((some, vectors))
        squares.append(squared)
    every = np.concatenate(squares)
    fourth = every * areal_kg_m2 / strip.bending_stiffness_n_m
    modes = PlateModes(tuple(found), every, np.sqrt(np.sqrt(fourth)))
    return dataclasses.replace(functions, modes=modes)
