"""A burst looked for in a record of one channel: matched against its planned shape.

The matched filter's output a[k] = sum(x[k + i] s[i]) / sum(s[i]^2) is the amplitude that fits best
at k. What such a sum does where nothing was played is the noise of the figure taken from it,
whatever the spectrum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from scipy import signal

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.driver import FloatArray

_TOP: Final = 0.9
"""From this part of its peak on a shape's samples are its top: there a clipped burst is flat."""
_COVERS_95: Final = 2.1
"""Standard deviations; a little over 1.96, as the noise itself is an estimate."""
MIN_QUIET: Final = 8
"""Shortest quiet part, in lengths of the shape; a shorter one gives no estimate of the noise."""
_FEW_95: Final = 1.21
_FEW_SURE: Final = 3.31
"""Student's t with n degrees of freedom is wider than a normal deviate z by 1 + (z^2 + 1) / 4n: at
95 %, and at the 3.5 standard deviations by which faults are reported."""
_MARGIN: Final = 8
"""Frames around a shape: what is played between two samples of the record rings there."""
_STEPS: Final = 3
_LOUD: Final = 6.0
"""Standard deviations of a stretch's energy."""
_UPSIDE_DOWN: Final = 8.0
"""Standard deviations: a burst of many cycles is nearly itself upside down, half a period later."""
_MIN_NOISE: Final = 2.0**-16
"""Of the record's limit: a record without any noise is still one of 16 bit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TemplateMatch:
    """The fit of the planned shape to the record of one channel, in the record's unit and frames.

    The defaults describe a burst that was recorded without noise, on time, and alone.

    Attributes
    ----------
    amplitude, amplitude_sd : float
        Amplitude of the best fit, and its standard deviation due to noise.
    tops : tuple of tuple of float
        Amplitude from the samples at the peaks alone, which is smaller than `amplitude` if the
        burst is clipped, and the standard deviation of the difference: for all peaks, and for those
        of each sign.
    onset : float
        Frame of the onset, counted from the end of the quiet part.
    onset_uncertainty : float
        Half-width of the 95 % interval of the onset, in frames.
    correlation, correlation_sd : float
        Correlation with the shape, corrected for the energy of the noise; 1 for a scaled copy. Then
        its standard deviation.
    inverted : bool
        The inverted shape fits better somewhere, by more than noise explains.
    largest : float
        Largest magnitude of the fitted shape anywhere in the record, including the burst.
    loudest, beside : float
        Amplitude of a burst with the largest energy in any stretch as long as one, after a straight
        line is removed: anywhere in the record, and outside the burst. 0 if noise explains it.
    second : float
        Largest magnitude of the fitted shape after the burst is subtracted.
    second_at : float
        Frames from the onset to that fit.
    noise_rms : float
        Root mean square of the quiet part.
    overloaded : bool
        Consecutive samples lie at the record's limit.
    """

    amplitude: float
    correlation: float
    largest: float
    noise_rms: float
    amplitude_sd: float = 0.0
    tops: tuple[tuple[float, float], ...] = ()
    onset: float = 0.0
    onset_uncertainty: float = 0.0
    correlation_sd: float = 0.0
    inverted: bool = False
    loudest: float = 0.0
    beside: float = 0.0
    second: float = 0.0
    second_at: float = 0.0
    overloaded: bool = False


class Template:
    """A burst's planned shape, of shape (n,), at the record's sample rate; it must not be zero.

    >>> shape = np.sin(2 * np.pi * np.arange(97) / 96)
    >>> record = np.zeros(3000)
    >>> record[1100:1197] = 0.5 * shape
    >>> match = Template(shape).find(record, quiet=1000, limit=1.0)
    >>> round(match.amplitude, 6), round(match.onset, 6), round(match.correlation, 6)
    (0.5, 100.0, 1.0)
    """

    def __init__(self, shape: FloatArray) -> None:
        self.shape = np.pad(np.asarray(shape, dtype=np.float64), _MARGIN)
        self.energy = float(self.shape @ self.shape)
        if not self.energy > 0:
            raise ValueError("shape must have a sample that is not 0")
        self.length = len(shape)
        self.rms = math.sqrt(self.energy / self.length)
        self.min_quiet = MIN_QUIET * self.length
        self._spectrum = np.fft.rfft(self.shape)
        self._turn = -2j * np.pi * np.fft.rfftfreq(len(self.shape))
        self._slope = self._later(0.0)[1]
        self._slope_energy = float(self._slope @ self._slope)
        itself = signal.correlate(self.shape, self.shape) / self.energy
        self._upside_down = 1 + float(np.min(itself))

    def shifted(self, frames: float) -> FloatArray:
        """Return the shape, with a margin, as it is sampled a fraction of a frame later."""
        return self._later(frames)[0]

    def _later(self, frames: float) -> tuple[FloatArray, FloatArray]:
        """Return the shape a fraction of a frame later, and its slope; as a converter plays it."""
        turned = self._spectrum * np.exp(self._turn * frames)
        size = len(self.shape)
        return np.fft.irfft(turned, size), np.fft.irfft(-self._turn * turned, size)

    def find(self, record: FloatArray, *, quiet: int, limit: float) -> TemplateMatch:
        """Look for the burst in a record whose first `quiet` frames hold none.

        `record`, shape (n,), must be longer than `quiet` and the shape together; `limit` is its
        largest magnitude.
        """
        size, min_quiet = len(self.shape), self.min_quiet
        if not min_quiet <= quiet <= len(record) - size:
            raise ValueError(
                f"quiet must be from {min_quiet} to {len(record) - size}, for the shape with its "
                f"margin is {size} frames long; got {quiet}"
            )
        x = record - np.mean(record[:quiet])
        noise = max(float(np.std(x[:quiet])), limit * _MIN_NOISE)
        few = self.length / quiet
        sure = 1 + _FEW_SURE * few
        amplitude_sd = sure * _spread(x[:quiet], noise, self.shape / self.energy)
        onset_sd = _spread(x[:quiet], noise, self._slope / self._slope_energy) * (1 + _FEW_95 * few)
        fit = signal.correlate(x, self.shape, "valid") / self.energy
        searched = fit[max(quiet - _MARGIN, 1) : -1]
        at = _vertex(fit, max(quiet - _MARGIN, 1) + int(np.argmax(searched)))
        first, here, stretch, amplitude = 0, self.shape, x, 0.0
        for _ in range(_STEPS):  # the parabola is near; least squares from there
            first = min(math.floor(at), len(x) - size)
            here, slope = self._later(at - first)
            stretch = x[first : first + size]
            amplitude = float(stretch @ here) / float(here @ here)
            if amplitude > 0:
                step = float((stretch - amplitude * here) @ slope) / (
                    amplitude * self._slope_energy
                )
                at -= min(max(step, -0.5), 0.5)
        tops = tuple(
            (
                float(weights @ stretch),
                sure * _spread(x[:quiet], noise, weights - here / self.energy),
            )
            for weights in _of_tops(here)
        )
        energies = _energies(x, size)
        noises = energies[: quiet - size]
        correlation, correlation_sd = self._correlation(stretch, amplitude, noises)
        bent = energies - _straight(x, size)
        loud = np.maximum(bent[quiet - _MARGIN :] - float(np.mean(bent[: quiet - size])), 0.0)
        loud[loud <= sure * _clear_of(bent[: quiet - size])] = 0.0
        beside = np.concatenate(
            (loud[: max(first - size - quiet + _MARGIN, 0)], loud[first + size - quiet + _MARGIN :])
        )
        opposite = -float(np.min(searched))
        x[first : first + size] -= amplitude * here
        second = np.abs(signal.correlate(x[quiet - _MARGIN :], self.shape, "valid")) / self.energy
        last = int(np.argmax(second))
        return TemplateMatch(
            amplitude=amplitude,
            amplitude_sd=amplitude_sd,
            tops=tops,
            onset=at + _MARGIN - quiet,
            onset_uncertainty=_COVERS_95 * onset_sd / amplitude if amplitude > 0 else math.inf,
            correlation=correlation,
            correlation_sd=sure * correlation_sd,
            inverted=opposite > amplitude
            and self._upside_down * opposite > _UPSIDE_DOWN * amplitude_sd,
            largest=float(np.max(np.abs(searched))),
            loudest=math.sqrt(float(np.max(loud)) / self.energy),
            beside=math.sqrt(float(np.max(beside, initial=0.0)) / self.energy),
            second=float(second[last]),
            second_at=float(last + quiet - _MARGIN - at),
            noise_rms=noise,
            overloaded=_in_a_row(np.abs(record[quiet:]) >= limit),
        )

    def _correlation(
        self, stretch: FloatArray, amplitude: float, energies: FloatArray
    ) -> tuple[float, float]:
        """Return it without the noise's energy, which a quiet part shows stretch by stretch."""
        noise, fitted = float(np.mean(energies)), amplitude**2 * self.energy
        rest = float(stretch @ stretch) - noise
        if fitted <= 0 or rest <= 0:
            return 0.0, 1.0
        spread = max(float(np.std(energies)), noise * math.sqrt(2 / len(stretch))) / fitted / 2
        return math.copysign(math.sqrt(min(1.0, fitted / rest)), amplitude), spread


def _energies(x: FloatArray, length: int) -> FloatArray:
    """Return the energy of each stretch of that length."""
    sums = np.cumsum(x**2)
    energies: FloatArray = sums[length:] - sums[:-length]
    return energies


def _straight(x: FloatArray, length: int) -> FloatArray:
    """Return the energy of the line that fits each stretch: slow noise is little more."""
    at = np.arange(len(x))
    sums, moments = np.cumsum(x), np.cumsum(at * x)
    total = sums[length:] - sums[:-length]
    middle = at[1 : 1 - length or None][: len(total)] + (length - 1) / 2
    tilted = moments[length:] - moments[:-length] - middle * total
    line: FloatArray = total**2 / length + tilted**2 * 12 / (length * (length**2 - 1))
    return line


def _clear_of(noises: FloatArray) -> float:
    """Return by how much more than the mean no noise has, if it goes on as in the quiet part.

    Slow noise has few large stretches: what is twice the largest of them is none.
    """
    mean = float(np.mean(noises))
    return max(_LOUD * float(np.std(noises)), 2 * float(np.max(noises)) - mean)


def _spread(quiet: FloatArray, noise: float, weights: FloatArray) -> float:
    """Return the standard deviation that noise gives a weighted sum, at least that of white."""
    sums = signal.correlate(quiet, weights, "valid")
    return max(noise * float(np.linalg.norm(weights)), math.sqrt(float(np.mean(sums**2))))


def _of_tops(here: FloatArray) -> Iterator[FloatArray]:
    """Yield the weights that estimate the amplitude from the samples at a shape's peaks alone.

    The first are for all peaks, then those of each sign: a supply that is too low on one side clips
    only there.
    """
    high = np.where(np.abs(here) >= _TOP * np.max(np.abs(here)), np.sign(here), 0.0)
    for sign in (high, np.maximum(high, 0.0), np.minimum(high, 0.0)):
        if sign.any():
            yield sign / float(sign @ here)


def _vertex(values: FloatArray, k: int) -> float:
    """Return the place of a peak by the parabola through the values around k."""
    before, here, after = (float(value) for value in values[k - 1 : k + 2])
    bend = before - 2 * here + after
    return k + (min(max((before - after) / (2 * bend), -0.5), 0.5) if bend < 0 else 0.0)


def _in_a_row(full: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> bool:
    """Return whether three neighbours are full: one alone may be a true peak."""
    return bool(np.any(full[:-2] & full[1:-1] & full[2:]))
