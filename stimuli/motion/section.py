"""Sections of a long plate: how far away an end has to be for its echo not to count."""

from __future__ import annotations

import dataclasses
import math
from itertools import count
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from stimuli.arrays import Real
    from stimuli.field.scene import Scene


_BEYOND: Final = 9.0
"""A section ends so many widths beyond the outermost point or load, if the plate goes on there."""

_LONGER: Final = 1.5
"""By so much more does the next one."""

_FELT: Final = 3.5
"""Ends so many widths beyond the outermost point or load are not felt at rest: what comes back from
there has gone twice as far, and falls off by exp(-pi) in each width or faster."""

_DIGITS: Final = 12
"""Places are rounded to a picometre, so that those of all sections are equal."""

_ROUNDING: Final = 1e-9

AGREED: Final = 0.5
"""Part of a wanted error by which two sections may differ: with the longer one, whose ends are half
as far away again, less is left."""

_LOUD, _LOUDLY = 1e-2, 0.25
"""The same of what is more than such a part of the largest: it decides whether a burst is fit."""

ECHOED: Final = 4.0
"""Echoes are of waves up to so many times the reference: few modes tell whether they count."""


def sections(scene: Scene) -> Iterator[Scene]:
    """Yield a scene on sections of its plate with free ends, each longer, at last on all of it.

    Where nothing changes from one to the next, no echo counts, and all that are longer are alike.

    >>> from stimuli import ALUMINIUM, CLAMPED, PointForce, Scene, Strip
    >>> strip = Strip(width_m=0.1, thickness_m=5e-4, length_m=9.0, material=ALUMINIUM, edge=CLAMPED)
    >>> load = PointForce(x_m=3.5, y_m=0.05)
    >>> scene = Scene(strip=strip, loads=(load,), points_m=((4.0, 0.05),))
    >>> [(round(one.strip.length_m, 2), round(one.points_m[0][0], 2)) for one in sections(scene)]
    [(1.9, 0.45), (2.35, 0.67), (3.03, 1.01), (4.04, 1.52), (5.56, 2.28), (7.83, 3.42), (9.0, 4.0)]
    """
    strip, places = scene.strip, _places_m(scene)
    half_m = math.inf if strip.length_m is None else strip.length_m / 2
    for step in count():
        beyond_m = _BEYOND * _LONGER**step * strip.width_m
        start_m, end_m = min(places) - beyond_m, max(places) + beyond_m
        if strip.length_m is None or (start_m <= -half_m and end_m >= half_m):
            break
        yield _section(scene, max(start_m, -half_m), min(end_m, half_m), places)
    yield scene


def _places_m(scene: Scene) -> list[float]:
    """Return where points, loads and patches are along the strip, and where these end."""
    places = [x for x, _ in scene.points_m]
    for one in (*scene.loads, *scene.strip.patches):
        places += [one.x_m - one.half_size_m[0], one.x_m + one.half_size_m[0]]
    return places


def _section(scene: Scene, start_m: float, end_m: float, places: list[float]) -> Scene:
    """Return a scene on a part of its plate, which has its middle at 0 as all plates have."""
    middle_m = (start_m + end_m) / 2
    # what lies on an end of the plate must not lie beyond it by a rounding
    half_m = max(end_m - middle_m, *(abs(x - middle_m) for x in places))
    patches = (dataclasses.replace(one, x_m=one.x_m - middle_m) for one in scene.strip.patches)
    return dataclasses.replace(
        scene,
        strip=dataclasses.replace(scene.strip, length_m=2 * half_m, patches=tuple(patches)),
        loads=tuple(dataclasses.replace(load, x_m=load.x_m - middle_m) for load in scene.loads),
        points_m=tuple((x - middle_m, y) for x, y in scene.points_m),
    )


def unpatched(scene: Scene) -> Scene:
    """Return a scene whose strip has no patches."""
    return dataclasses.replace(scene, strip=dataclasses.replace(scene.strip, patches=()))


def without_far_ends(scene: Scene) -> Scene:
    """Return a scene without ends, its first point at 0, if these are not felt at rest."""
    strip = scene.strip
    if strip.patches:
        return scene
    reach_m = max(abs(x) for x in _places_m(scene))
    if strip.length_m and strip.length_m / 2 - reach_m < _FELT * strip.width_m:
        return scene
    first_m = scene.points_m[0][0]
    return dataclasses.replace(
        scene,
        strip=dataclasses.replace(strip, length_m=None),
        loads=tuple(
            dataclasses.replace(load, x_m=round(load.x_m - first_m, _DIGITS))
            for load in scene.loads
        ),
        points_m=tuple((round(x - first_m, _DIGITS), y) for x, y in scene.points_m),
    )


def repeated(section: Scene, scene: Scene) -> tuple[Scene, float | None]:
    """Return a section that ends where its plate goes on as an endless strip, and its period.

    What comes round has gone as far as what would come back from the ends, and the waves of the
    strip are its modes. Others, and all without loss, are returned as they are, without a period.
    """
    strip, whole_m = section.strip, scene.strip.length_m
    if strip.length_m is None or whole_m is None or not strip.material.viscous_time_s:
        return section, None
    middle_m = scene.points_m[0][0] - section.points_m[0][0]
    if abs(middle_m) + strip.length_m / 2 > (1 - _ROUNDING) * whole_m / 2:
        return section, None
    return dataclasses.replace(
        section, strip=dataclasses.replace(strip, length_m=None)
    ), strip.length_m


def echoless(
    scene: Scene, quickly: Callable[[Scene], Real | None], rtol: float, quiet: float
) -> Scene:
    """Return the shortest section of a scene that the next one agrees with; else all of it.

    Parameters
    ----------
    scene : Scene
        The scene.
    quickly : callable
        Returns what is looked at of a section, to some digits; none where it is too long for that.
    rtol : float
        Wanted error of that.
    quiet : float
        What is less than this part of the largest of its column is wanted to `rtol` of that only.
    """
    shorter: tuple[Scene, Real] | None = None
    for section in sections(scene):
        if section is scene:
            break
        found = quickly(section)
        if found is None:
            break
        largest = np.max(found, axis=0)
        part = np.where(found > _LOUD * largest, _LOUDLY, AGREED)
        most = part * rtol * np.maximum(found, quiet * largest)
        if shorter is not None and np.all(np.abs(found - shorter[1]) <= most):
            return shorter[0]
        shorter = section, found
    return scene
