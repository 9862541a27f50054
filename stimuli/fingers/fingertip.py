"""A fingertip: the points of its contact area, and its impedance."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final

from stimuli.checks import finite, instance
from stimuli.drive.sampled import Drive
from stimuli.plate.patch import cutoff_factor
from stimuli.plate.strip import Strip

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


_LEAST_RINGS: Final = 3
_RINGS_PER_WIDTH: Final = 15.0
"""Rings about the centre, per width of the strip: with these the largest displacement over the
points is within 0.1 dB of that over the area, unless a load of a few millimetres lies under it
away from its centre: then within 0.3 dB."""

_POINTS_PER_RING: Final = 8
_DIGITS: Final = 12
"""Places are rounded to a picometre, so that mirrored pairs of loads and points are equal."""


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
        Damper in parallel, from 0 to 1e5 N s/m.
    holds_up_to_hz : float
        Upper end of the band in which these values were found, from 1e-3 to 1e6 Hz. They are
        left out of the answer to a drive whose band at half power reaches above it.

    Raises
    ------
    ValueError
        If a value is not a number in its range.

    Notes
    -----
    There are no values by default. They depend on the direction, the force and the posture. Such a
    lumped model holds in a band. Above it less and less of a finger goes with the plate, while the
    force on a mass grows with the square of the frequency.

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
        """Return whether a drive's band at half power lies within that of the values.

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
class Fingertip:
    """The contact area of a fingertip: a disc, cut off at the edges and ends of the strip.

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    radius_m : float
        Radius, up to 0.1 m; 0 is a point. A fingertip at rest covers about 1 cm2, with some
        dependence on its owner and on how hard it presses.
    impedance : Impedance or None
        What it opposes to the mean displacement of that area; none: the plate moves as if no
        finger touched it. A fingertip that presses must lie wholly on the strip.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Notes
    -----
    Dzidek et al., J. R. Soc. Interface 14 (2017) 20160935, measured how the area of a finger pad
    on glass grows with force; 5 mm is a round value for light touch, no fit.

    Examples
    --------
    A fingertip of no size is its centre:

    >>> from stimuli import ALUMINIUM, CLAMPED, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> Fingertip(x_m=0.035, y_m=0.0125, radius_m=0.0).points_m(strip)
    ((0.035, 0.0125),)
    >>> len(Fingertip(x_m=0.035, y_m=0.0125).points_m(strip))
    49
    """

    x_m: float
    y_m: float
    radius_m: float = 0.005
    impedance: Impedance | None = None

    def __post_init__(self) -> None:
        if self.impedance is not None:
            instance("impedance", self.impedance, Impedance, "an Impedance or None")
        ranges = {"x_m": (-1e3, 1e3), "y_m": (0.0, 1e3), "radius_m": (0.0, 0.1)}
        for name, (least, most) in ranges.items():
            size_m = finite(name, getattr(self, name), least=least, most=most)
            object.__setattr__(self, name, size_m)

    def points_m(self, strip: Strip) -> tuple[tuple[float, float], ...]:
        """Return points that sample the contact area, equation (43).

        Parameters
        ----------
        strip : Strip
            The strip it rests on.

        Returns
        -------
        tuple of (float, float)
            Points (x, y), the centre first, the same on either side of it. They lie on rings;
            those beyond an edge, where the plate does not move, are left out, those beyond an
            end are moved onto it.

        Raises
        ------
        ValueError
            If the fingertip's centre is not on the strip.

        Examples
        --------
        Over an edge only a half is left:

        >>> from stimuli import ALUMINIUM, CLAMPED, Strip
        >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
        >>> points = Fingertip(x_m=0.0, y_m=0.0).points_m(strip)
        >>> all(y > 0 for x, y in points[1:])
        True
        """
        instance("strip", strip, Strip, "a Strip")
        end_m = math.inf if strip.length_m is None else strip.length_m / 2
        if self.y_m > strip.width_m or abs(self.x_m) > end_m:
            raise ValueError(
                f"x_m and y_m must lie on the strip, abs(x_m) <= {end_m:g} and "
                f"y_m <= {strip.width_m:g}, got {self!r}"
            )
        return _area(self.x_m, self.y_m, self.radius_m, strip.width_m, end_m)


@lru_cache(maxsize=32)  # a check asks for those of the same fingertips again and again
def _area(
    x_m: float, y_m: float, radius_m: float, width_m: float, end_m: float
) -> tuple[tuple[float, float], ...]:
    """Return the points of a contact area on a strip that goes as far as `end_m`."""
    found = {(x_m, y_m): None}
    for along_m, across_m in _rings(radius_m, width_m):
        if 0 < (there_m := round(y_m + across_m, _DIGITS)) < width_m:
            found[min(max(round(x_m + along_m, _DIGITS), -end_m), end_m), there_m] = None
    return tuple(found)


@lru_cache(maxsize=8)
def _rings(radius_m: float, width_m: float) -> tuple[tuple[float, float], ...]:
    """Return places on rings about 0 that may lie on a strip, exactly the same in each quadrant."""
    return tuple(place for place in _on_rings(radius_m, width_m) if abs(place[1]) < width_m)


def _on_rings(radius_m: float, width_m: float) -> Iterator[tuple[float, float]]:
    rings = max(_LEAST_RINGS, math.ceil(_RINGS_PER_WIDTH * radius_m / width_m - 1e-9))
    for ring in range(1, rings + 1 if radius_m else 1):
        reach_m, quarter = radius_m * ring / rings, _POINTS_PER_RING * ring // 4
        for step in range(quarter):
            angle = math.pi / 2 * step / quarter
            a_m = reach_m * math.cos(angle) if step else reach_m
            b_m = reach_m * math.sin(angle)
            yield from ((a_m, b_m), (-b_m, a_m), (-a_m, -b_m), (b_m, -a_m))


def causal(strip: Strip, drive: Drive) -> Strip:
    """Return a strip whose loss is causal: viscous instead of constant, equation (43).

    Parameters
    ----------
    strip : Strip
        The strip.
    drive : Drive
        What drives it.

    Returns
    -------
    Strip
        The strip itself if its material has no constant loss factor; otherwise one whose loss
        is viscous, and the same at the highest of the strip's first cut-off, that of its patches'
        laminates and the drive's peak frequency.

    Raises
    ------
    ValueError
        If an argument is not what it should be.

    Notes
    -----
    With a constant loss factor the plate would move before it is driven. Below its cut-off the
    strip moves as a spring, and its loss barely counts; what reaches another finger are the waves
    just above it, which therefore have to keep their loss. For the paper's plates and bursts the
    level at the other finger is then that of the constant loss within 0.2 dB for a loss factor of
    0.01, and within 1.1 dB for 0.05; matched at the peak of a 500 Hz burst it would be 2 to 13 dB
    too low for 0.01. Where patches cover the plate its waves begin at the laminate's cut-off;
    next to small ones there is a little too little loss: a few tenths of a dB on the loud side.

    Examples
    --------
    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, Strip
    >>> lossy = dataclasses.replace(ALUMINIUM, loss_factor=0.01)
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=lossy, edge=CLAMPED)
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="none")
    >>> material = causal(strip, burst).material
    >>> loss = 1 - material.stiffness_factor(strip.cutoff_hz())
    >>> material.loss_factor, round(loss.imag, 12)
    (0.0, 0.01)
    """
    instance("strip", strip, Strip, "a Strip")
    instance("drive", drive, Drive, "a burst or a sampled drive")
    material = strip.material
    if material.loss_factor == 0:
        return strip
    factor = cutoff_factor(material, strip.thickness_m, strip.patches)
    frequency_hz = max(factor * strip.cutoff_hz(), drive.peak_hz())
    viscous_time_s = material.viscous_time_s + material.loss_factor / (2 * math.pi * frequency_hz)
    viscous = dataclasses.replace(material, loss_factor=0.0, viscous_time_s=viscous_time_s)
    return dataclasses.replace(strip, material=viscous)


def checked_fingertips(fingertips: Sequence[Fingertip]) -> tuple[Fingertip, ...]:
    """Return fingertips as a tuple, or refuse them.

    ValueError where they are no fingertips, or none at all.

    >>> checked_fingertips(())
    Traceback (most recent call last):
    ValueError: fingertips must hold at least one, got ()
    """
    instance("fingertips", fingertips, (tuple, list), "a tuple of fingertips")
    for tip in fingertips:
        instance("fingertips", tip, Fingertip, "a tuple of fingertips")
    if not fingertips:
        raise ValueError(f"fingertips must hold at least one, got {fingertips!r}")
    return tuple(fingertips)
