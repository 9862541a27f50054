"""The line above the real axis on which a field over time is summed, and the grid on it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real


_ALIAS: Final = 0.125
"""Part of rtol that is left to the next periods."""

_RISE: Final = 4.0
"""Logarithm of what exp(sigma t) grows to over the span: more makes the field smoother along the
line, but its errors grow as much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComplexLine:
    """The line omega + i sigma and the grid on it, equation (64).

    Attributes
    ----------
    span_s : float
        Times up to this one are wanted.
    period_s : float
        Period T of the sum over the grid, whose step is 1 / T.
    decay_per_s : float
        Decay sigma that keeps the next periods out.

    Examples
    --------
    >>> line = ComplexLine(span_s=0.01, period_s=0.04, decay_per_s=400.0)
    >>> line.step_hz, round(line.rise, 3)
    (25.0, 54.598)
    """

    span_s: float
    period_s: float
    decay_per_s: float

    @property
    def step_hz(self) -> float:
        """Distance of two bins."""
        return 1 / self.period_s

    @property
    def rise(self) -> float:
        """What errors grow by up to the end of the span."""
        return math.exp(self.decay_per_s * self.span_s)

    def at(self, bins: Real | NDArray[np.intp]) -> Complex:
        """Return the complex frequencies of bins."""
        return np.asarray(bins * self.step_hz + 1j * self.decay_per_s / (2 * np.pi))


def line_for(span_s: float, rtol: float, further: float = 0.0) -> ComplexLine:
    """Return the line on which times up to a span are found to a relative error.

    `further` is the logarithm by which the next periods must be smaller than rtol asks for.

    Examples
    --------
    >>> found = line_for(0.01, 1e-6)
    >>> round(found.period_s, 3), round(found.decay_per_s)
    (0.04, 400)
    """
    turns = math.log(1 / (_ALIAS * rtol)) + further
    period_s = span_s * max(turns / _RISE, 1.05)
    return ComplexLine(span_s=span_s, period_s=period_s, decay_per_s=turns / period_s)
