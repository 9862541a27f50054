"""What oscillators answer to a drive, look by look, and the frames of an animation."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.drive.sampled import SampledDrive
from stimuli.motion.motion import is_enough, is_slow, motion_of, reference_of
from stimuli.motion.oscillators import followed, moved, step_weights
from stimuli.motion.section import sections

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from stimuli.arrays import Complex, Real
    from stimuli.drive.sampled import Drive
    from stimuli.field.scene import Scene
    from stimuli.motion.motion import Motion


_STEPS: Final = 128
"""Steps of the drive in a period of the reference frequency: between them it is a straight line."""

LOOKS: Final = 32
"""Looks at the displacement in such a period: with a parabola about the largest they hold the peak
to 0.05 dB, ripples of the next wave included."""

_CHUNK: Final = 1 << 20
"""Answers, of an oscillator at a look each, that are computed at once."""

_FEWEST: Final = 256

_MULTIPLES: Final = (4.0, 2.0)
"""Modes are kept up to the largest of these multiples of the reference for which there is room, on
the longest section of the plate for which there is."""


def frames_of(scene: Scene, drive: Drive, *, step_s: float, end_s: float) -> tuple[Real, Real]:
    """Return the times of frames, and the displacement of a scene's points in each.

    Parameters
    ----------
    scene : Scene
        Strip, loads, each driven by itself, and points; a loss must be viscous.
    drive : Drive
        What drives the loads, from t = 0.
    step_s : float
        Time from frame to frame.
    end_s : float
        No frame is later.

    Returns
    -------
    times_s : ndarray of float64, shape (n_frames,)
    displacement_m : ndarray of float64, shape (n_loads, n_points, n_frames)
        In metres per unit load amplitude.

    Raises
    ------
    ValueError
        If what lies between loads and points has too many modes below twice the reference: its
        first cut-off, or the upper edge of the drive's band if that is higher.

    Examples
    --------
    A plate that is not driven yet is at rest, and ends above the load's centre where it began:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Scene, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> disc = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064)
    >>> scene = Scene(strip=strip, loads=(disc,), points_m=((0.0, 0.0125), (0.07, 0.0125)))
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="hann")
    >>> times_s, moved_m = frames_of(scene, burst, step_s=1e-4, end_s=4e-3)
    >>> times_s.size, float(abs(moved_m[0, :, 0]).max())
    (41, 0.0)
    >>> own_m, far_m = abs(moved_m[0]).max(axis=1)
    >>> bool(far_m < 1e-2 * own_m), bool(abs(moved_m[0, 0, -1]) < 1e-2 * own_m)
    (True, True)
    """
    reference_hz = reference_of(scene, drive)
    room = (
        (section, multiple)
        for multiple in _MULTIPLES
        for section in reversed(list(sections(scene)))
        if is_enough(section.strip, multiple * reference_hz)
    )
    longest = next(room, None)
    if longest is None:
        raise ValueError(
            "loads and points are too far apart for the modes up to "
            f"{_MULTIPLES[-1] * reference_hz:.6g} Hz; got width_m = {scene.strip.width_m:g}"
        )
    section, multiple = longest
    motion = motion_of(section, reference_hz, multiple)
    oscillators, loads = motion.oscillators, range(len(scene.loads))
    times_s = (step_s * np.arange(math.floor(end_s / step_s + 1e-9) + 1)).astype(np.float64)
    moved_m = np.zeros((len(loads), len(scene.points_m), times_s.size))
    for answers, late, which in Course(motion, drive).at(times_s):
        for load in loads:
            weights, rest_m = oscillators.weights(load), oscillators.rest_m[load]
            moved_m[load][:, which] = moved(weights, rest_m, answers, late)
    return times_s, moved_m


class Course:
    """A drive in fine steps, and what the oscillators answer while it lasts.

    Beside them runs what the rest follows: the drive, late by the plate's relaxation time as all
    that bends slowly is. Left out, that microsecond costs a quiet finger a per cent.
    """

    def __init__(self, motion: Motion, drive: Drive) -> None:
        self._viscous_s = motion.viscous_s
        lag = [-1 / self._viscous_s] if self._viscous_s else []
        self._poles = np.append(motion.oscillators.poles, lag)
        # a slow drive is straight enough from look to look
        steps = LOOKS if is_slow(drive, motion.reference_hz) else _STEPS
        self._samples, self._step_s, self._held = _played(drive, steps * motion.reference_hz)
        self._every = max(1, round(1 / (LOOKS * motion.reference_hz * self._step_s)))
        self._samples = np.append(self._samples, np.zeros(-(self._samples.size - 1) % self._every))

    @property
    def look_s(self) -> float:
        """Time between two looks."""
        return self._every * self._step_s

    def looks(self) -> Iterator[tuple[Complex, Real]]:
        """Yield answers and what the rest follows at all looks, some at a time."""
        for first, found in self._stretches(self._every):
            shared = 0 if first == 0 else 1
            samples = self._samples[first :: self._every][: found.shape[1]]
            yield self._split(found[:, shared:], samples[shared:])

    def at(self, times_s: Real) -> Iterator[tuple[Complex, Real, NDArray[np.intp]]]:
        """Yield answers, what the rest follows, and which of the times these are."""
        place = times_s / self._step_s
        early = np.flatnonzero(place < 0)
        still = np.zeros((self._poles.size, early.size), dtype=np.complex128)
        yield *self._split(still, np.zeros(early.size)), early
        end = still[:, :0]
        for first, found in self._stretches(1):
            top = first + found.shape[1] - 1
            which = np.flatnonzero((place >= first) & (place < top))
            step = np.floor(place[which]).astype(np.intp)
            part, before = place[which] - step, self._samples[step]
            rise = 0.0 if self._held else (self._samples[step + 1] - before) * part
            turn = np.multiply.outer(self._poles, part * self._step_s)
            whole, late = step_weights(turn)
            driven = part * self._step_s * (whole * before + late * rise)
            answers = np.exp(turn) * found[:, step - first] + driven
            yield *self._split(answers, before + rise), which
            end = found[:, -1:]
        after = np.flatnonzero(place >= self._samples.size - 1)
        since_s = times_s[after] - (self._samples.size - 1) * self._step_s
        free = end * np.exp(np.multiply.outer(self._poles, since_s))
        yield *self._split(free, np.zeros(after.size)), after

    def _split(self, found: Complex, samples: Real) -> tuple[Complex, Real]:
        if not self._viscous_s:
            return found, samples
        return found[:-1], found[-1].real / self._viscous_s

    def _stretches(self, every: int) -> Iterator[tuple[int, Complex]]:
        """Yield the number of the first step and answers every so many; the ends are shared."""
        start = np.zeros(self._poles.size, dtype=np.complex128)
        length = every * max(_FEWEST, _CHUNK // self._poles.size)
        for first in range(0, self._samples.size - 1, length):
            some = self._samples[first : first + length + 1]
            found = followed(self._poles, some, self._step_s, start, held=self._held, every=every)
            start = found[:, -1]
            yield first, found


def _played(drive: Drive, least_rate_hz: float) -> tuple[Real, float, bool]:
    """Return a drive in fine steps up to its end, the step, and whether each is held."""
    if not isinstance(drive, SampledDrive):
        return np.append(drive.samples(least_rate_hz), 0.0), 1 / least_rate_hz, False
    fine = math.ceil(least_rate_hz / drive.sample_rate_hz)
    values = np.array(drive.values)
    if drive.held:
        samples = np.append(np.repeat(values, fine), 0.0)
    else:
        places = np.arange((values.size - 1) * fine + 1) / fine
        samples = np.interp(places, np.arange(values.size), values)
    return samples, 1 / (fine * drive.sample_rate_hz), drive.held
