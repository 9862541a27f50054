"""More and more modes of a scene, until what they give is known as well as is wanted."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

Some = TypeVar("Some")
Found = TypeVar("Found")
Upwards = Generator[Some, float | None, None]
"""Yields a scene with ever more modes; what is sent back: how many times an error is too large."""

_LEAST_STEP, _STEP = 1.15, 1.08
"""By so much more at least, and than what an error asks for by its fourth root."""


def upwards(multiples: Sequence[float], motion_at: Callable[[float, float], Some]) -> Upwards[Some]:
    """Yield the same up to each of some multiples, or only as far as what was sent back asks for.

    That is by how many times the error was too large: it falls with about the fourth power.
    """
    for place, multiple in enumerate(multiples):
        excess = yield motion_at(multiple, multiples[-1])
        if excess is not None and place + 1 < len(multiples):
            near = multiple * max(_LEAST_STEP, _STEP * excess**0.25)
            if near < multiples[place + 1] / _LEAST_STEP:
                yield motion_at(near, multiples[-1])


def first_known(
    found: Upwards[Some], look: Callable[[Some], tuple[Found, float]]
) -> tuple[Found, Some] | None:
    """Return the first peaks that are known well enough, and whose; none if none are.

    `look` returns peaks, and by how many times their error is too large.
    """
    excess: float | None = None
    while True:
        try:
            motion = found.send(excess)
        except StopIteration:
            return None
        peaks, excess = look(motion)
        if excess <= 1:
            return peaks, motion
