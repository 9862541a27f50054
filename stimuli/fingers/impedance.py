"""What a fingertip opposes to a plate: a mass, a spring and a damper, and where they press."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from stimuli.checks import finite
from stimuli.load import PointForce, PressureDisc

if TYPE_CHECKING:
    from stimuli.drive.sampled import Drive
    from stimuli.strip.strip import Strip

_ROUNDING_M: Final = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Impedance:
    """What a fingertip opposes to the plate: Z = damping - i w mass + i stiffness / w.

    Attributes
    ----------
    mass_kg : float
        Mass that goes with the plate, from 1e-7 to 1 kg.
    stiffness_n_m : float
        Spring between the plate and what does not move, from 0 to 1e8 N/m.
    damping_n_s_m : float
        Damper beside it, from 0 to 1e5 N s/m.
    holds_up_to_hz : float
        Upper end of the band in which these values were found, from 1e-3 to 1e6 Hz. They are
        left out of the answer to a drive whose band at half power reaches above it.

    Raises
    ------
    ValueError
        If a value is not a number in its range.

    Notes
    -----
    There are no values by default. They depend on the direction, the force and the posture, and
    such a lumped model holds in a band: above it less and less of a finger goes with the plate,
    while the force on a mass grows with the square of the frequency.

    Examples
    --------
    A spring alone is not to be had, but a mass that does not count is:

    >>> Impedance(mass_kg=0.0, stiffness_n_m=500.0, damping_n_s_m=1.0, holds_up_to_hz=800.0)
    Traceback (most recent call last):
    ValueError: mass_kg must be a finite number >= 1e-07 and <= 1, got 0.0
    >>> spring = Impedance(
    ...     mass_kg=1e-7, stiffness_n_m=500.0, damping_n_s_m=0.0, holds_up_to_hz=800.0
    ... )
    """

    mass_kg: float
    stiffness_n_m: float
    damping_n_s_m: float
    holds_up_to_hz: float

    def __post_init__(self) -> None:
        ranges = {
            "mass_kg": (1e-7, 1.0),
            "stiffness_n_m": (0.0, 1e8),
            "damping_n_s_m": (0.0, 1e5),
            "holds_up_to_hz": (1e-3, 1e6),
        }
        for name, (least, most) in ranges.items():
            value = finite(name, getattr(self, name), least=least, most=most)
            object.__setattr__(self, name, value)

    def holds_for(self, drive: Drive) -> bool:
        """Tell whether a drive's band at half power lies within that of the values.

        Parameters
        ----------
        drive : Drive
            A burst or any other drive.

        Returns
        -------
        bool
            Whether its upper edge is at most `holds_up_to_hz`.

        Examples
        --------
        >>> from stimuli import Burst
        >>> finger = Impedance(mass_kg=1e-4, stiffness_n_m=500.0, damping_n_s_m=1.0,
        ...                    holds_up_to_hz=800.0)
        >>> [finger.holds_for(Burst(frequency_hz=hz)) for hz in (500.0, 1000.0)]
        [True, False]
        """
        return drive.band_hz()[1] <= self.holds_up_to_hz


@dataclass(frozen=True, slots=True, kw_only=True)
class Pressed:
    """An impedance on the mean displacement of an area: that of its pressure, or a point."""

    over: PressureDisc | PointForce
    impedance: Impedance

    @property
    def area_m2(self) -> float:
        """What turns a force into the load's unit."""
        return 1.0 if isinstance(self.over, PointForce) else math.pi * self.over.radius_m**2


def pressing(strip: Strip, place_m: tuple[float, float], radius_m: float, z: Impedance) -> Pressed:
    """Return an impedance on a disc or a point of a strip; ValueError if it is not wholly on it."""
    x_m, y_m = place_m
    end_m = math.inf if strip.length_m is None else strip.length_m / 2
    room_m = min(end_m - abs(x_m), y_m, strip.width_m - y_m)
    if radius_m > room_m + _ROUNDING_M:
        raise ValueError(
            "fingertips with an impedance must lie wholly on the strip, radius_m at most "
            f"{room_m:g} at {place_m}, got {radius_m!r}"
        )
    if not radius_m:
        return Pressed(over=PointForce(x_m=x_m, y_m=y_m), impedance=z)
    return Pressed(over=PressureDisc(x_m=x_m, y_m=y_m, radius_m=radius_m), impedance=z)
