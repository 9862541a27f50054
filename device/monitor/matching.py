"""A burst looked for in a record of one channel: matched against its planned shape.

The matched filter's output a[k] = sum(x[k + i] s[i]) / sum(s[i]^2) is the amplitude that fits best
at k. What it does where nothing was played is the noise of every figure taken from it, whatever the
noise's spectrum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy import signal

if TYPE_CHECKING:
    from device.driver import FloatArray

_TOP: Final = 0.9
"""From this part of its peak on a shape's samples are its top: there a clipped burst is flat."""
_COVERS_95: Final = 2.1
"""Standard deviations; a little over 1.96, as the noise itself is an estimate."""
_ENOUGH: Final = 60
"""So many shapes long is a quiet part that tells the noise of a figure; else noise is taken as
white."""
_MARGIN: Final = 8
"""Frames around a shape: what is played between two samples of the record rings there."""
_STEPS: Final = 3
_LEAST_NOISE: Final = 2.0**-16
"""Of the record's limit: a record without any noise is still one of 16 bit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a record of one channel holds of a burst, in the record's unit and in its frames.

    Attributes
    ----------
    amplitude, amplitude_sd : float
        By which the shape fits best, and the standard deviation that noise gives it.
    top, top_sd : float
        The same of the samples at its top alone: less than the amplitude of a clipped burst.
    onset : float
        Frame at which it begins, counted from the end of the quiet part.
    onset_uncertainty : float
        Frames by which the onset is known with 95 %, half-width.
    correlation, correlation_sd : float
        With the shape, of what is left when the noise's energy is taken off; 1 for a scaled copy.
    second : float
        Largest magnitude with which the shape fits in what remains without the burst.
    second_at : float
        Frames from the onset to there.
    noise_rms : float
        Of the quiet part.
    overloaded : bool
        Samples in a row lie at the record's limit.
    """

    amplitude: float
    amplitude_sd: float
    top: float
    top_sd: float
    onset: float
    onset_uncertainty: float
    correlation: float
    correlation_sd: float
    second: float
    second_at: float
    noise_rms: float
    overloaded: bool


class Template:
    """A burst's planned shape, of shape (n,), at the record's sample rate; it must not be zero.

    >>> shape = np.sin(2 * np.pi * np.arange(97) / 96)
    >>> record = np.zeros(3000)
    >>> record[1100:1197] = 0.5 * shape
    >>> found = Template(shape).find(record, quiet=1000, limit=1.0)
    >>> round(found.amplitude, 6), round(found.onset, 6), round(found.correlation, 6)
    (0.5, 100.0, 1.0)
    """

    def __init__(self, shape: FloatArray) -> None:
        self.shape = np.pad(np.asarray(shape, dtype=np.float64), _MARGIN)
        self.energy = float(self.shape @ self.shape)
        if not self.energy > 0:
            raise ValueError("shape must have a sample that is not 0")
        self.length = len(shape)
        self.rms = math.sqrt(self.energy / self.length)
        self._spectrum = np.fft.rfft(self.shape)
        self._turn = -2j * np.pi * np.fft.rfftfreq(len(self.shape))
        self._slope = self._later(0.0)[1]
        self._slope_energy = float(self._slope @ self._slope)

    def shifted(self, part: float) -> FloatArray:
        """Return the shape, with a margin, as it is sampled a part of a frame later."""
        return self._later(part)[0]

    def _later(self, part: float) -> tuple[FloatArray, FloatArray]:
        """Return the shape a part of a frame later, and its slope; as a converter plays it."""
        turned = self._spectrum * np.exp(self._turn * part)
        size = len(self.shape)
        return np.fft.irfft(turned, size), np.fft.irfft(-self._turn * turned, size)

    def find(self, record: FloatArray, *, quiet: int, limit: float) -> Found:
        """Look for the burst in a record whose first `quiet` frames hold none.

        `record`, shape (n,), must be longer than `quiet` and the shape together; `limit` is its
        largest magnitude.
        """
        size = len(self.shape)
        if not 0 < quiet <= len(record) - size:
            raise ValueError(
                f"quiet must be from 1 to {len(record) - size}, for the shape with its margin is "
                f"{size} frames long; got {quiet}"
            )
        x = record - np.mean(record[:quiet])
        noise = max(float(np.std(x[:quiet])), limit * _LEAST_NOISE)
        amplitude_sd = self._spread(x[:quiet], noise, self.shape, self.energy)
        slope_sd = self._spread(x[:quiet], noise, self._slope, self._slope_energy)
        fit = signal.correlate(x, self.shape, "valid") / self.energy
        searched = fit[max(quiet - _MARGIN, 1) : -1]
        at = _vertex(fit, max(quiet - _MARGIN, 1) + int(np.argmax(searched)))
        first, here, part, amplitude = 0, self.shape, x, 0.0
        for _ in range(_STEPS):  # the parabola is near; least squares from there
            first = min(math.floor(at), len(x) - size)
            here, slope = self._later(at - first)
            part = x[first : first + size]
            amplitude = float(part @ here) / float(here @ here)
            if amplitude > 0:
                step = float((part - amplitude * here) @ slope) / (amplitude * self._slope_energy)
                at -= min(max(step, -0.5), 0.5)
        top, top_sd = _top(part, here, noise)
        correlation, correlation_sd = self._correlation(part, amplitude, noise)
        x[first : first + size] -= amplitude * here
        second = np.abs(signal.correlate(x[quiet - _MARGIN :], self.shape, "valid")) / self.energy
        last = int(np.argmax(second))
        return Found(
            amplitude=amplitude,
            amplitude_sd=amplitude_sd,
            top=top,
            top_sd=top_sd,
            onset=at + _MARGIN - quiet,
            onset_uncertainty=_COVERS_95 * slope_sd / amplitude if amplitude > 0 else math.inf,
            correlation=correlation,
            correlation_sd=correlation_sd,
            second=float(second[last]),
            second_at=float(last + quiet - _MARGIN - at),
            noise_rms=noise,
            overloaded=_in_a_row(np.abs(record[quiet:]) >= limit),
        )

    def _spread(self, quiet: FloatArray, noise: float, shape: FloatArray, energy: float) -> float:
        """Return the standard deviation, by noise, of what is fitted of a shape."""
        if_white = noise / math.sqrt(energy)
        if len(quiet) < _ENOUGH * self.length:
            return if_white
        return max(if_white, float(np.std(signal.correlate(quiet, shape, "valid"))) / energy)

    def _correlation(self, part: FloatArray, amplitude: float, noise: float) -> tuple[float, float]:
        fitted = amplitude**2 * self.energy
        rest = float(part @ part) - len(part) * noise**2
        if fitted <= 0 or rest <= 0:
            return 0.0, 1.0
        spread = noise**2 * math.sqrt(2 * len(part)) / fitted / 2
        return math.copysign(math.sqrt(min(1.0, fitted / rest)), amplitude), spread


def _top(part: FloatArray, here: FloatArray, noise: float) -> tuple[float, float]:
    """Return the amplitude of the samples at a shape's top, and its standard deviation."""
    high = np.abs(here) >= _TOP * np.max(np.abs(here))
    sign = np.sign(here[high])
    weight = float(sign @ here[high])
    return float(sign @ part[high]) / weight, noise * math.sqrt(len(sign)) / weight


def _vertex(values: FloatArray, k: int) -> float:
    """Return the place of a peak by the parabola through the values around k."""
    before, here, after = (float(value) for value in values[k - 1 : k + 2])
    bend = before - 2 * here + after
    return k + (min(max((before - after) / (2 * bend), -0.5), 0.5) if bend < 0 else 0.0)


def _in_a_row(full: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> bool:
    """Tell whether three neighbours are full: one alone may be a true peak."""
    return bool(np.any(full[:-2] & full[1:-1] & full[2:]))
