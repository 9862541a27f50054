"""A fingertip: the points of its contact area, and the peak it feels of each actuator."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from stimuli.checks import finite, instance
from stimuli.drive.sampled import Drive
from stimuli.field.scene import Scene
from stimuli.fingers.impedance import Impedance, Pressed, pressing
from stimuli.fingers.mirrored import images_of
from stimuli.fingers.pressed import pressed_peaks
from stimuli.fingers.unpressed import by_modes, by_patched_modes
from stimuli.load import LOADS, Load
from stimuli.motion.history import by_spectra
from stimuli.strip.patch import cutoff_factor
from stimuli.strip.strip import Strip
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from stimuli.arrays import Real


_LEAST_RINGS: Final = 3
_RINGS_PER_WIDTH: Final = 15.0
"""Rings about the centre, per width of the strip: with these the largest displacement over the
points is within 0.1 dB of that over the area, unless a load of a few millimetres lies under it
away from its centre: then within 0.3 dB."""

_POINTS_PER_RING: Final = 8
_DIGITS: Final = 12
"""Places are rounded to a picometre, so that mirrored pairs of loads and points are equal."""


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
        finger touched it. Only a plate with ends can be pressed on, by a whole disc.

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
        """Return points that sample the contact area, equation (69).

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


RTOL: Final = 5e-3
"""Wanted relative error of a displacement over time: 0.04 dB, less than the sampling adds."""


@tuned
def felt(
    strip: Strip,
    loads: Sequence[Load],
    fingertips: Sequence[Fingertip],
    drive: Drive,
    rtol: float = RTOL,
) -> Real:
    """Return the greatest displacement at each fingertip for each load, equation (69).

    Parameters
    ----------
    strip : Strip
        The strip. One with a constant loss factor is replaced by `causal(strip, drive)`.
    loads : tuple or list of Load
        Loads, each driven by itself.
    fingertips : tuple or list of Fingertip
        Fingertips; beside their own points the centres of loads under them are looked at. Those
        with an impedance that holds for the drive rest on the plate, whichever load is driven.
    drive : Drive
        A burst or any other drive, with the amplitude 1.
    rtol : float
        Wanted relative error of the displacement over time; bursts without a window take much
        longer where it is small. Levels below -60 dB are known less well, with impedances those
        below -50 dB. On a strip with patches `felt_known` tells how well.

    Returns
    -------
    ndarray of float64, shape (n_fingertips, n_loads)
        The greatest abs(u(t)) over contact area and time in metres per unit load amplitude
        (1 N, 1 Pa, 1 N m/m).

    Raises
    ------
    ValueError
        If an argument is not what it should be, or a load or fingertip is not on the strip; with
        impedances, if it is endless, too long for its modes, or a disc is not wholly on it.

    Notes
    -----
    Beside the error `rtol` the sampling adds up to 0.05 dB in time and 0.1 dB over the area. A
    strip of finite length without loss may ring on above its cut-off; what comes later than
    eight times the time that an endless one takes is left out.

    Examples
    --------
    Two equal actuators with a finger on each feel alike:

    >>> from stimuli import ALUMINIUM, CLAMPED, Burst, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> discs = [MomentDisc(x_m=x, y_m=0.0125, radius_m=0.0064) for x in (-0.035, 0.035)]
    >>> fingers = [Fingertip(x_m=x, y_m=0.0125) for x in (-0.035, 0.035)]
    >>> burst = Burst(frequency_hz=500.0, cycles=1, window="hann")
    >>> peaks_m = felt(strip, discs, fingers, burst)
    >>> bool(abs(peaks_m / peaks_m.T - 1).max() < 1e-6)
    True
    >>> bool(peaks_m[1, 0] < 1e-3 * peaks_m[0, 0])
    True
    """
    scene, places, far_m = asked(strip, loads, fingertips, drive)
    images = images_of(strip, loads, fingertips)
    scene, pressed = images.fewer(scene), pressed_of(strip, fingertips, drive)
    with images.named():
        if pressed:
            peaks = pressed_peaks(scene, places, drive, pressed, rtol=rtol, far_m=far_m)[0]
            return images.every(peaks.peak_m)
        if strip.patches:
            return images.every(by_patched_modes(scene, places, drive, far_m)[0].peak_m)
    found = by_modes(scene, places, drive, rtol, far_m)
    if found is None:
        return images.every(by_spectra(scene, places, drive, rtol, far_m))
    return images.every(found[0].peak_m)


def pressed_of(strip: Strip, tips: Sequence[Fingertip], drive: Drive) -> tuple[Pressed, ...]:
    """Return what presses on the strip: the fingertips whose impedance holds for a drive."""
    return tuple(
        pressing(strip, (tip.x_m, tip.y_m), tip.radius_m, tip.impedance)
        for tip in tips
        if tip.impedance and tip.impedance.holds_for(drive)
    )


def asked(
    strip: Strip, loads: Sequence[Load], fingertips: Sequence[Fingertip], drive: Drive
) -> tuple[Scene, list[NDArray[np.intp]], float]:
    """Return what is looked at, the places of each fingertip in it, and the farthest."""
    instance("drive", drive, Drive, "a burst or a sampled drive")
    instance("loads", loads, (tuple, list), "a tuple of loads")
    for load in loads:
        instance("loads", load, LOADS, "a tuple of loads")
    tips = checked_fingertips(fingertips)
    areas = [tip.points_m(strip) + _centres(tip, loads) for tip in tips]
    if _is_even(strip, loads, tips):
        areas = [_folded(area, strip.width_m) for area in areas]
    points_m = tuple(dict.fromkeys(point for area in areas for point in area))
    scene = Scene(strip=causal(strip, drive), loads=tuple(loads), points_m=points_m)
    row = {point: index for index, point in enumerate(points_m)}
    places = [np.array([row[point] for point in area]) for area in areas]
    far_m = max(abs(tip.x_m - load.x_m) + tip.radius_m for tip in tips for load in loads)
    return scene, places, far_m


def _is_even(strip: Strip, loads: Sequence[Load], tips: Sequence[Fingertip]) -> bool:
    """Tell whether all that moves or loads the strip lies on its centre line."""
    pressed = [tip for tip in tips if tip.impedance is not None]
    return all(one.y_m == strip.width_m / 2 for one in (*loads, *strip.patches, *pressed))


def _folded(
    area: tuple[tuple[float, float], ...], width_m: float
) -> tuple[tuple[float, float], ...]:
    """Return the points of an area without those that are mirror images of others across."""
    lower = ((x_m, min(y_m, round(width_m - y_m, _DIGITS))) for x_m, y_m in area)
    return tuple(dict.fromkeys(lower))


def causal(strip: Strip, drive: Drive) -> Strip:
    """Return a strip whose loss is causal: viscous instead of constant, equation (69).

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
    strip moves as a spring, and its loss hardly counts; what reaches another finger are the waves
    just above it, which therefore have to keep their loss. For the paper's plates and bursts the
    level at the other finger is then that of the constant loss within 0.2 dB for a loss factor of
    0.01, and within 1.1 dB for 0.05; matched at the peak of a 500 Hz burst it would be 2 to 13 dB
    too low for 0.01. Where patches cover the plate its waves begin at the laminate's cut-off;
    beside small ones there is a little too little loss: a few tenths of a dB on the loud side.

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


def _centres(tip: Fingertip, loads: Sequence[Load]) -> tuple[tuple[float, float], ...]:
    """Return the centres of loads under a fingertip: there a small load moves the plate most."""
    places = [(load.x_m, load.y_m) for load in loads]
    return tuple(p for p in places if math.dist(p, (tip.x_m, tip.y_m)) <= tip.radius_m)
