"""Pink masking noise as a loop without a seam: a sum of lines that all fit into it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite, finite_array, instance

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from stimuli.arrays import Real


LOWEST_HZ: Final = 20.0
"""Where the lines begin: lower ones would move the headphones and not be heard."""

LEAST_LEVEL_DBFS: Final = -70.0
"""Softest noise; below, 16 bits are too few to hold its slope."""


def pink_loop(
    *, sample_rate_hz: float, loop_s: float, level_dbfs: float, rng: np.random.Generator
) -> Real:
    """Return pink noise that may be repeated end to end.

    Parameters
    ----------
    sample_rate_hz : float
        Sample rate, 8 to 192 kHz.
    loop_s : float
        Length, 1 to 600 s, rounded to whole samples.
    level_dbfs : float
        Level 20 log10(rms), dB re full scale 1: a sine that reaches full scale has -3.01 dB.
    rng : numpy.random.Generator
        Draws the phases, one for each line.

    Returns
    -------
    ndarray of float64, shape (round(loop_s x sample_rate_hz),)
        Values from -1 to 1, mean 0: the sum over k of a_k cos(2 pi k t / loop_s + phase_k) at
        every k / loop_s from 20 Hz to below half the rate, where a_k is proportional to 1/sqrt(k)
        exactly. That is -10 log10(2) = -3.0103 dB for each octave.

    Raises
    ------
    ValueError
        If an argument is out of its range, or the loop's highest peak would be clipped.

    Examples
    --------
    Half the amplitude at four times the frequency:

    >>> loop = pink_loop(sample_rate_hz=8000.0, loop_s=2.0, level_dbfs=-30.0,
    ...                  rng=np.random.default_rng(1))
    >>> lines = np.abs(np.fft.rfft(loop))
    >>> round(float(lines[4000] / lines[1000]), 9)
    0.5
    """
    finite("sample_rate_hz", sample_rate_hz, least=8e3, most=192e3)
    finite("loop_s", loop_s, least=1, most=600)
    finite("level_dbfs", level_dbfs, least=LEAST_LEVEL_DBFS, most=0)
    instance("rng", rng, np.random.Generator, "a numpy.random.Generator")
    # Every line has a whole number of periods in the loop: that, not a fade, is why the end meets
    # the beginning. The line at half the rate is left out, for it has no phase to draw.
    count = round(loop_s * sample_rate_hz)
    line = np.arange((count - 1) // 2 + 1)
    heard = line * sample_rate_hz >= LOWEST_HZ * count
    lines = np.zeros(count // 2 + 1, dtype=np.complex128)
    phase = 2 * np.pi * rng.random(np.count_nonzero(heard))
    lines[line[heard]] = np.exp(1j * phase) / np.sqrt(line[heard])
    # Parseval's theorem; every line stands for two of the transform, at k and at -k.
    rms = math.sqrt(2 * np.sum(np.abs(lines) ** 2)) / count
    loop = np.fft.irfft(lines, n=count) / rms
    _require_unclipped(level_dbfs, crest_factor(loop))
    return np.asarray(loop * 10 ** (level_dbfs / 20), dtype=np.float64)


def crest_factor(samples: ArrayLike) -> float:
    """Return the highest peak of samples over their root mean square.

    ValueError where there are none, one is not finite, or all are zero.

    >>> crest_factor([1.0, -1.0]), round(crest_factor(np.sin(np.arange(0.0, 6.28, 0.01))), 2)
    (1.0, 1.41)
    """
    values = finite_array("samples", samples)
    if not values.any():
        raise ValueError(f"samples must hold one that is not 0, got {samples!r}")
    return float(np.max(np.abs(values)) / math.sqrt(np.mean(values**2)))


def _require_unclipped(level_dbfs: float, crest: float) -> None:
    most_dbfs = -20 * math.log10(crest)
    if level_dbfs > most_dbfs:
        raise ValueError(
            f"level_dbfs must be at most {most_dbfs:.2f}, or the noise's peaks (crest factor "
            f"{crest:.2f}) would be clipped, got {level_dbfs:g}"
        )
