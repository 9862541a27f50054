"""A strip at given frequencies in units of its width."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.edge import SIMPLY_SUPPORTED, ElasticEdge
from stimuli.guided import PI

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.strip import Strip

    Complex = NDArray[np.complex128]
    Exact = NDArray[np.clongdouble]

_NO_SPRING_N: Final = 1e-200
"""Softer edges are simple supports: 1 / (kappa W) would overflow."""

_SOFTEST: Final = 1e18
"""1 / (kappa W) that stands for a simple support where nothing is to be skipped."""


def is_supported(strip: Strip) -> bool:
    """Return whether both edges are simple supports.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, ElasticEdge, Strip
    >>> is_supported(Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...                    edge=ElasticEdge(stiffness_n=0.0)))
    True
    """
    edge = strip.edge
    if isinstance(edge, ElasticEdge):
        return edge.stiffness_n <= _NO_SPRING_N
    return edge is SIMPLY_SUPPORTED


def dimensionless(
    strip: Strip, frequencies_hz: Complex, *, skip: bool = True
) -> tuple[Exact, Exact]:
    """Return k W and 1 / (kappa W) with the digits that p needs near a cut-off.

    Parameters
    ----------
    strip : Strip
        The strip.
    frequencies_hz : ndarray of complex128, shape (n_frequencies,)
        Frequencies.
    skip : bool
        Whether simple supports are treated as such, else as springs next to none.

    Returns
    -------
    k, hold : ndarray of clongdouble, shape (n_frequencies,)

    Examples
    --------
    >>> from stimuli import ALUMINIUM, SIMPLY_SUPPORTED, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM,
    ...               edge=SIMPLY_SUPPORTED)
    >>> k, hold = dimensionless(strip, np.array([strip.cutoff_hz() + 0j]))
    >>> bool(abs(k[0] - PI) < 1e-14), bool(np.isinf(hold[0]))
    (True, True)
    """
    material = strip.material
    width, thickness, nu = (
        np.longdouble(v) for v in (strip.width_m, strip.thickness_m, material.poisson_ratio)
    )
    stiffness = material.youngs_modulus_pa * thickness**3 / (12 * (1 - nu) * (1 + nu))
    factor = stiffness_factors(strip, frequencies_hz).astype(np.clongdouble)
    inertia = np.sqrt(np.sqrt(material.density_kg_m3 * thickness / stiffness))
    forward_hz = np.where(frequencies_hz.real < 0, -frequencies_hz, frequencies_hz)
    k = np.sqrt(2 * PI * forward_hz) * inertia * width / np.sqrt(np.sqrt(factor))
    edge = strip.edge
    if is_supported(strip):
        return k, np.full(k.size, np.inf if skip else _SOFTEST, dtype=np.clongdouble)
    if not isinstance(edge, ElasticEdge):
        return k, np.zeros(k.size, dtype=np.clongdouble)
    hold = stiffness / (edge.stiffness_n * width)
    return k, hold * (factor if edge.lossless else np.ones_like(factor))


def stiffness_factors(strip: Strip, frequencies_hz: Complex) -> Complex:
    """Return what the loss makes of the bending stiffness, equation (15)."""
    material = strip.material
    loss = material.loss_factor + 2 * np.pi * frequencies_hz * material.viscous_time_s
    return np.asarray(1 - 1j * loss)
