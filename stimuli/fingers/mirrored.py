"""Actuators and fingers that are mirror images of each other about the middle of a plate."""

from __future__ import annotations

import dataclasses
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple, Protocol, TypeVar

import numpy as np

from stimuli.motion.peaks import PatchesUnknownError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from dataclasses import Field
    from typing import Any, ClassVar

    from numpy.typing import NDArray

    from stimuli.arrays import Real
    from stimuli.field.scene import Scene
    from stimuli.load import Load
    from stimuli.strip.strip import Strip


class Placed(Protocol):
    """What stands somewhere along a strip: a load, a patch or a fingertip."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def x_m(self) -> float:
        """Its place, from the middle."""


Mirrored = TypeVar("Mirrored", bound=Placed)


class Images(NamedTuple):
    """Which loads have to be computed, and where the others' displacements are among theirs.

    Attributes
    ----------
    some : tuple of int
        Numbers of the loads that are no image of one before.
    columns : ndarray of int, shape (n_loads,)
        Which of these each load is, or is the image of.
    rows : ndarray of int, shape (n_fingertips, n_loads)
        Which fingertip feels of that what each one feels of the load.
    """

    some: tuple[int, ...]
    columns: NDArray[np.intp]
    rows: NDArray[np.intp]

    def fewer(self, scene: Scene) -> Scene:
        """Return a scene of all loads with those that have to be computed."""
        if len(self.some) == len(scene.loads):
            return scene
        return dataclasses.replace(scene, loads=tuple(scene.loads[one] for one in self.some))

    def every(self, of_some: Real) -> Real:
        """Return what fingertips feel of all loads, (n_fingertips, n_loads), from that of some."""
        return np.asarray(of_some[self.rows, self.columns])

    @contextmanager
    def named(self) -> Iterator[None]:
        """Have a refusal of patches name the load by its number among all."""
        try:
            yield
        except PatchesUnknownError as error:
            raise PatchesUnknownError(self.some[error.load], error.relative_error) from None


def images_of(strip: Strip, loads: Sequence[Load], fingertips: Sequence[Placed]) -> Images:
    """Return which loads are mirror images of others, with all fingertips and all of the plate.

    Two equal discs with a finger on each are what most studies have:

    >>> from stimuli import ALUMINIUM, CLAMPED, Fingertip, MomentDisc, Strip
    >>> strip = Strip(width_m=0.025, thickness_m=0.0005, material=ALUMINIUM, edge=CLAMPED)
    >>> places_m = [(x_m, 0.0125) for x_m in (-0.035, 0.035)]
    >>> discs = [MomentDisc(x_m=x_m, y_m=y_m, radius_m=0.0064) for x_m, y_m in places_m]
    >>> images = images_of(strip, discs, [Fingertip(x_m=x_m, y_m=y_m) for x_m, y_m in places_m])
    >>> images.some, images.every(np.array([[2e-6], [1e-7]])).tolist()
    ((0,), [[2e-06, 1e-07], [1e-07, 2e-06]])
    """
    tips = {tip: number for number, tip in enumerate(fingertips)}
    across = [tips.get(_mirrored(tip), -1) for tip in fingertips]
    same = np.arange(len(fingertips))
    alike = _is_its_own_image(strip) and min(across) >= 0
    if strip.patches:  # a load beside them would no longer be where its image was
        places = {(one.x_m, one.y_m) for one in strip.patches}
        alike = alike and all((load.x_m, load.y_m) in places for load in loads)
    some: dict[Load, int] = {}
    columns, rows = [], []
    for load in loads:
        image = _mirrored(load) if alike else load
        turned = load not in some and image in some
        columns.append(some.setdefault(image if turned else load, len(some)))
        rows.append(np.array(across) if turned else same)
    numbers = tuple(list(loads).index(load) for load in some)
    return Images(numbers, np.array(columns), np.stack(rows, axis=1))


def to_the_right(strip: Strip, load: Load) -> Load:
    """Return a load, or its image if it is on the left of a plate that is its own image."""
    return _mirrored(load) if load.x_m < 0 and _is_its_own_image(strip) else load


def _is_its_own_image(strip: Strip) -> bool:
    return {_mirrored(patch) for patch in strip.patches} == set(strip.patches)


def _mirrored(one: Mirrored) -> Mirrored:
    return dataclasses.replace(one, x_m=-one.x_m)
