"""How the threshold of a vibration depends on its frequency, its duration and its area.

From people in other laboratories, with sines at one place of the hand: what is asked beyond where
these were measured is extrapolated, and `ReferenceVibration.extrapolations` lists it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

FLAT_BELOW_HZ: Final = 40.0
BEST_HZ: Final = 250.0
FALL_DB_PER_OCTAVE: Final = 12.0
RISE_DB_PER_OCTAVE: Final = 9.0
MEASURED_AREA_CM2: Final = 2.9
SUMMATION_S: Final = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Vibration:
    """What a threshold is of."""

    frequency_hz: float
    duration_s: float  # of a sine without window of the same greatest value and energy
    area_cm2: float


@dataclass(frozen=True, slots=True)
class ValidRange:
    """The range over which a threshold curve was measured."""

    quantity: str
    unit: str
    key: str  # of the study: for which value its threshold holds
    min: float
    max: float


# The frequency curve is of Verrillo's thenar eminence; above 500 Hz nothing was found that could be
# cited. Durations are those of temporal summation in the Pacinian channel; a window counts by what
# it leaves of the energy.
VALID_RANGES: Final = {
    "frequency_hz": ValidRange("frequency", "Hz", "threshold_at_hz", min=20.0, max=500.0),
    "duration_s": ValidRange("duration", "s", "threshold_at_s", min=0.01, max=1.0),
    "area_cm2": ValidRange("area", "cm2", "threshold_at_cm2", min=0.005, max=5.1),
}


@dataclass(frozen=True, slots=True)
class Extrapolation:
    """Values at which a threshold curve is used outside the range over which it was measured."""

    curve: ValidRange
    values: tuple[float, ...]


def frequency_db(frequency_hz: float) -> float:
    """Return the threshold re that at 250 Hz, of 1 s under 2.9 cm2.

    Level below 40 Hz, falling by 12 dB an octave to 250 Hz, rising by 9 dB an octave above. R. T.
    Verrillo, J. Acoust. Soc. Am. 35 (1963) 1962-1966, as reported by G. A. Gescheider and R. T.
    Verrillo in *Sensory Functions of the Skin of Humans* (1979): thenar eminence. The rise is that
    of hairy skin above 220 Hz (Verrillo, J. Exp. Psychol. 71 (1966) 47-50), said to be alike.

    >>> round(frequency_db(125), 9), frequency_db(20) == frequency_db(40), frequency_db(500)
    (12.0, True, 9.0)
    """
    octaves = math.log2(max(frequency_hz, FLAT_BELOW_HZ) / BEST_HZ)
    return max(-FALL_DB_PER_OCTAVE * octaves, RISE_DB_PER_OCTAVE * octaves)


def duration_db(duration_s: float, frequency_hz: float) -> float:
    """Return the threshold re that of a long vibration: -10 log10(1 - exp(-t / 200 ms)).

    J. J. Zwislocki's theory of temporal summation, J. Acoust. Soc. Am. 32 (1960) 1046-1060; found
    in touch at high frequencies only (G. A. Gescheider, Sensory Processes 1 (1976) 68-76). Short
    vibrations follow their energy, so t is the duration of a sine without window of the same
    greatest value and energy (`stimuli.Burst.energy_duration_s`):

    >>> round(duration_db(0.004, 250) - duration_db(0.002, 250), 1), duration_db(0.01, 20)
    (-3.0, 0.0)
    """
    if frequency_hz <= FLAT_BELOW_HZ:
        return 0.0
    return -10 * math.log10(-math.expm1(-duration_s / SUMMATION_S))


def area_db(area_cm2: float, frequency_hz: float) -> float:
    """Return the threshold re that under 2.9 cm2: 3 dB less for twice the area, above 40 Hz.

    J. C. Craig and C. E. Sherrick, Perception & Psychophysics 6 (1969) 97-101, at 250 Hz.

    >>> round(area_db(1.45, 250), 2), area_db(1.45, 30)
    (3.01, 0.0)
    """
    if frequency_hz <= FLAT_BELOW_HZ:
        return 0.0
    return -10 * math.log10(area_cm2 / MEASURED_AREA_CM2)


def threshold_db(vibration: Vibration) -> float:
    """Return a vibration's threshold, re that of 250 Hz, long, under 2.9 cm2.

    The three curves are added, as if none depended on another but through the channel.
    """
    frequency_hz = vibration.frequency_hz
    level_db = frequency_db(frequency_hz) + duration_db(vibration.duration_s, frequency_hz)
    return level_db + area_db(vibration.area_cm2, frequency_hz)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceVibration:
    """What of a vibration a threshold is known for; the curves of the others are not used.

    >>> known = ReferenceVibration(frequency_hz=250.0)
    >>> round(known.shift_db(Vibration(frequency_hz=500.0, duration_s=0.002, area_cm2=0.8)), 9)
    9.0
    """

    frequency_hz: float | None = None
    duration_s: float | None = None
    area_cm2: float | None = None

    @property
    def values(self) -> dict[str, float]:
        """The quantities that are set, by name."""
        return {name: x for name in VALID_RANGES if (x := getattr(self, name)) is not None}

    def shift_db(self, vibration: Vibration) -> float:
        """Return by how much a vibration's threshold lies above the known one."""
        return threshold_db(vibration) - threshold_db(replace(vibration, **self.values))

    def extrapolations(self, *vibrations: Vibration) -> tuple[Extrapolation, ...]:
        """Return where the curves in use were not measured, each curve once.

        >>> short = Vibration(frequency_hz=500.0, duration_s=0.002, area_cm2=0.8)
        >>> reference = ReferenceVibration(duration_s=0.003)
        >>> [each.values for each in reference.extrapolations(short, short)]
        [(0.002, 0.003)]
        >>> reference.extrapolations()
        ()
        """
        extrapolations = []
        for name, reference in self.values.items() if vibrations else ():
            curve = VALID_RANGES[name]
            values = dict.fromkeys([*(getattr(each, name) for each in vibrations), reference])
            outside = tuple(value for value in values if not curve.min <= value <= curve.max)
            if outside:
                extrapolations.append(Extrapolation(curve, outside))
        return tuple(extrapolations)
