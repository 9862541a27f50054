"""The parts of a slow burst: what oscillators do under its sines, and what rings beside that."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, TypeGuard

import numpy as np

from stimuli.drive.burst import Burst
from stimuli.drive.windows import sines
from stimuli.motion.motion import is_slow

if TYPE_CHECKING:
    from collections.abc import Iterator

    from stimuli.arrays import Complex, Real
    from stimuli.drive.sampled import Drive


class Part(NamedTuple):
    """A part of a slow burst, or what comes after it: there nothing drives the oscillators."""

    duration_s: float
    omegas: Real  # angular frequencies of its sines
    sine: Complex  # how the oscillators follow them, (n_poles, n_sines) each
    cosine: Complex
    phase: Real  # of the sines where it begins
    left: Complex  # what beside that decays freely, where it begins, (n_poles,)


def parts_of(poles: Complex, burst: Burst) -> Iterator[Part]:
    """Yield the parts of a burst as what oscillators do under them, the last without an end.

    Under a sin(omega t) an oscillator follows by A sin + B cos with A = -a p / (p^2 + omega^2) and
    B = -a omega / (p^2 + omega^2); what it does else decays as exp(p t).
    """
    state = np.zeros(poles.size, dtype=np.complex128)
    duration_s = burst.duration_s
    for one in sines(burst.window, burst.cycles):
        omegas = 2 * math.pi * np.array(one.ys) / duration_s
        driven = -np.array(one.amplitudes) / (poles[:, np.newaxis] ** 2 + omegas**2)
        sine, cosine = driven * poles[:, np.newaxis], driven * omegas
        phase = 2 * math.pi * np.array(one.ys) * one.begin
        left = state - sine @ np.sin(phase) - cosine @ np.cos(phase)
        long_s = (one.end - one.begin) * duration_s
        yield Part(long_s, omegas, sine, cosine, phase, left)
        phase = 2 * math.pi * np.array(one.ys) * one.end
        state = left * np.exp(poles * long_s) + sine @ np.sin(phase) + cosine @ np.cos(phase)
    none = np.zeros((poles.size, 0), dtype=np.complex128)
    yield Part(math.inf, none[0].real, none, none, none[0].real, state)


def leaves_ringing(drive: Drive, reference_hz: float) -> TypeGuard[Burst]:
    """Tell whether a drive is a slow burst that is a sum of sines between its corners."""
    if not isinstance(drive, Burst):
        return False
    return is_slow(drive, reference_hz) and bool(sines(drive.window, drive.cycles))
