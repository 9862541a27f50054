"""Draws of what tables of a group tell of it, to plan another study with."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from analysis.groups.difference import drawn_spreads
from analysis.groups.hierarchy import hierarchy
from analysis.thresholds.density import Ruler

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from analysis.groups.hierarchy import PeopleTables

    Floats = NDArray[np.float64]


def group_draws(
    tables: PeopleTables, number: int, rng: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Draw the middle and the spread of a group on a logarithmic axis, and S of ln(sigma).

    From their posterior, anywhere between its nodes; in log10 units.
    """
    ruler = Ruler.of(tables.x[tables.presented > 0], "log10")
    middle, spread, log_sigma = hierarchy(tables.surfaces(ruler), ruler).drawn(number, rng)
    return middle * ruler.step, spread * ruler.step, log_sigma + math.log(ruler.step)


def difference_spread_draws(
    a: PeopleTables, b: PeopleTables, number: int, rng: np.random.Generator
) -> Floats:
    """Draw how much the same people's difference of two conditions differs, in dB.

    From its posterior, on a logarithmic axis.
    """
    ruler = a.ruler_with(b)
    return drawn_spreads((a.surfaces(ruler), b.surfaces(ruler)), ruler, number, rng)
