"""How a strip is held along its two long edges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

from stimuli.checks import finite, instance

_CONTRACTIONS: Final = 25
"""Steps of the fixed point of equation (17): each leaves less than 0.18 of the error."""


class IdealEdge(Enum):
    """The two limits of an elastic edge: no moment, and no slope.

    Notes
    -----
    Equation (16) with K = 0 and with K without bound; the paper's plate lies between them.

    Examples
    --------
    >>> IdealEdge("clamped") is CLAMPED
    True
    """

    SIMPLY_SUPPORTED = "simply-supported"
    """It cannot move, and turns freely."""
    CLAMPED = "clamped"
    """It can neither move nor turn."""


SIMPLY_SUPPORTED: Final = IdealEdge.SIMPLY_SUPPORTED
"""An edge that cannot move and turns freely: the lowest cut-offs of a strip.

>>> from stimuli import SIMPLY_SUPPORTED, ElasticEdge
>>> SIMPLY_SUPPORTED != ElasticEdge(stiffness_n=0.0)  # by another name, with the same cut-offs
True
"""
CLAMPED: Final = IdealEdge.CLAMPED
"""An edge that can neither move nor turn: the highest cut-offs of a strip.

>>> from stimuli import ALUMINIUM, CLAMPED, SIMPLY_SUPPORTED, Strip
>>> held, free = (Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=edge)
...               for edge in (CLAMPED, SIMPLY_SUPPORTED))
>>> round(held.cutoff_hz() / free.cutoff_hz(), 3)
2.267
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class ElasticEdge:
    """An edge that cannot move and whose rotation is held by a spring, equation (16).

    Attributes
    ----------
    stiffness_n : float
        Spring stiffness K in N m per rad per m of edge; 0 is the simply supported edge. For
        the clamped edge take `CLAMPED`.
    lossless : bool
        Whether the spring keeps its real stiffness where the plate has loss; if not, it has
        the plate's loss.

    Raises
    ------
    ValueError
        If the stiffness is negative or not finite, or `lossless` is not a bool.

    Examples
    --------
    A soft spring barely raises the cut-off of the simply supported strip:

    >>> from stimuli import ALUMINIUM, Strip
    >>> ends = [Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=edge)
    ...         for edge in (SIMPLY_SUPPORTED, ElasticEdge(stiffness_n=1e-3))]
    >>> round(ends[1].cutoff_hz() / ends[0].cutoff_hz(), 5)
    1.00001
    """

    stiffness_n: float
    lossless: bool = True

    def __post_init__(self) -> None:
        stiffness_n = finite("stiffness_n", self.stiffness_n, least=0.0)
        object.__setattr__(self, "stiffness_n", stiffness_n)
        instance("lossless", self.lossless, bool, "True or False")


def edge_compliance(
    edge: IdealEdge | ElasticEdge, bending_stiffness_n_m: float, width_m: float
) -> float:
    """Return c = 2 D / (K W): infinite for simply supported edges, 0 for clamped ones."""
    if isinstance(edge, IdealEdge):
        return math.inf if edge is SIMPLY_SUPPORTED else 0.0
    hold_n_m = edge.stiffness_n * width_m
    return 2 * bending_stiffness_n_m / hold_n_m if hold_n_m else math.inf


def edge_phase(mode: int, compliance: float) -> float:
    """Return by how much the edges advance k W / 2 at cut-off beyond n pi / 2, equation (17).

    phi in rad for c = 2 D / (K W): the fixed point of phi = atan(1 / (2 c z + T(z))) with
    z = n pi / 2 + phi, T = tanh for odd and coth for even modes: free of poles, and a contraction
    for every c.

    Examples
    --------
    >>> edge_phase(1, math.inf), round(math.pi + 2 * edge_phase(1, 0.0), 9)
    (0.0, 4.730040745)
    """
    phase = 0.0
    for _ in range(_CONTRACTIONS):
        z = mode * (math.pi / 2) + phase
        hold = math.tanh(z) if mode % 2 else 1 / math.tanh(z)
        phase = math.atan(1 / (2 * compliance * z + hold))
    return phase


def edge_grip(cutoff_hz: float, supported_hz: float, clamped_hz: float) -> float:
    """Return the K W / D of a first cut-off, equation (18), free of cancellation at both limits.

    Examples
    --------
    >>> 2 / edge_grip(2.0, 1.0, 2.2669) > 2 / edge_grip(2.1, 1.0, 2.2669)
    True
    """
    clamped = edge_phase(1, 0.0)
    ratio = math.sqrt(cutoff_hz / supported_hz)
    phase = (math.pi / 2) * (cutoff_hz - supported_hz) / supported_hz / (1 + ratio)
    clamped_ratio = math.sqrt(clamped_hz / supported_hz)
    rest = (math.pi / 2) * (clamped_hz - cutoff_hz) / supported_hz / (clamped_ratio + ratio)
    z = math.pi / 2 + phase
    free = math.sin(rest) / (math.sin(phase) * math.sin(clamped))
    free += math.sinh(rest) / (math.cosh(z) * math.cosh(math.pi / 2 + clamped))
    return 4 * z / free
