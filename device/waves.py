"""Waveforms and volts as generators take them."""

from dataclasses import dataclass
from decimal import ROUND_DOWN, ROUND_UP, Decimal
from typing import Final

import numpy as np

from device.counts import CodeArray, full_scale
from device.dialects import Dialect

BITS: Final = 16
"""Waveforms come with so many bits; a dialect with fewer drops the lowest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wave:
    """A waveform as a generator stores it, and the peak that it had before it was stretched.

    Parameters
    ----------
    data : bytes
        Its codes.
    peak : float
        Largest magnitude, 0 to 1; 0 for silence.
    """

    data: bytes
    peak: float


def encode(codes: CodeArray, dialect: Dialect) -> Wave:
    """Return a waveform as a dialect's generator stores it, stretched to the converter's range.

    Parameters
    ----------
    codes : ndarray of int, shape (n,)
        16-bit codes.
    dialect : Dialect
        Of the generator.

    Examples
    --------
    >>> from device.dialects import KEYSIGHT
    >>> wave = encode(np.array([0, 16383, -16383, 0]), KEYSIGHT)
    >>> wave.peak, np.frombuffer(wave.data, "<i2").tolist()
    (0.49998..., [0, 32767, -32767, 0, 0, 0, 0, 0])
    """
    largest = int(np.abs(codes).max(initial=0))
    stretched = codes * (full_scale(dialect.bits) / largest) if largest else codes
    rows = np.full(max(codes.size, dialect.shortest_waveform), dialect.zero_code)
    rows[: codes.size] += np.trunc(stretched).astype(rows.dtype)
    return Wave(data=rows.astype(dialect.code_type).tobytes(), peak=largest / full_scale(BITS))


def decimals(volts: float, digits: int, *, up: bool = False) -> str:
    """Return volts with so many digits after the point, rounded toward zero or away from it.

    Examples
    --------
    >>> decimals(200 / 27.5, 7), decimals(200 / 27.5, 7, up=True)
    ('7.2727272', '7.2727273')
    """
    rounding = ROUND_UP if up else ROUND_DOWN
    return str(Decimal(volts).quantize(Decimal(1).scaleb(-digits), rounding=rounding))
