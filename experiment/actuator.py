"""The actuators under the strip: their sizes and places, and that they lie on it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final, Literal, get_args

from experiment.checks import require_word
from stimuli.checks import finite

if TYPE_CHECKING:
    from stimuli import MeasuredDisplacement, PiezoLayers, Strip

Side = Literal["left", "right", "other"]
SIDES: Final[tuple[str, ...]] = get_args(Side)
Shape = Literal["disc", "rectangle", "motor"]

_NAME = re.compile(r"[A-Za-z0-9_-]{1,32}")
_ROUNDING_M = 1e-12
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""
_MOST_FINGER_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """A patch or a motor under the strip and the finger above it.

    Attributes
    ----------
    side : str
        ``left`` or ``right``, as the participant sees it; ``other`` is under neither finger.
    shape : str
        ``disc`` or ``rectangle``, a bonded patch, or ``motor``, which pushes over its contact.
    x_m : float
        Place of its centre along the strip, from the middle, positive to the right.
    y_m : float
        Place of its centre across the strip, from one edge.
    diameter_m : float or None
        Diameter of a disc, else none.
    length_x_m, length_y_m : float or None
        Sides of a rectangle or of a motor's contact along and across the strip, else none.
    name : str or None
        1 to 32 letters, digits, ``_`` or ``-``, where the side is ``other``; else none.
    finger_diameter_m : float
        Contact of the fingertip above it, up to 50 mm.
    basis : MeasuredDisplacement, PiezoLayers or None
        What is known of its displacement per volt.

    Raises
    ------
    ValueError
        If a word is unknown, a number is not finite, or the sizes are not those of the shape.

    Examples
    --------
    >>> Actuator(side="left", shape="disc", x_m=-0.25, y_m=0.5, diameter_m=0.5).span_x_m
    (-0.5, 0.0)
    """

    side: Side
    shape: Shape
    x_m: float
    y_m: float
    diameter_m: float | None = None
    length_x_m: float | None = None
    length_y_m: float | None = None
    name: str | None = None
    finger_diameter_m: float = 0.01
    basis: MeasuredDisplacement | PiezoLayers | None = None

    def __post_init__(self) -> None:
        require_word("side", self.side, SIDES)
        require_word("shape", self.shape, get_args(Shape))
        finite("x_m", self.x_m)
        finite("y_m", self.y_m)
        self._check_name()
        finite("finger_diameter_m", self.finger_diameter_m, above=0, most=_MOST_FINGER_M)
        rectangle_m = {"length_x_m": self.length_x_m, "length_y_m": self.length_y_m}
        disc_m = {"diameter_m": self.diameter_m}
        own_m, others_m = (disc_m, rectangle_m) if self.shape == "disc" else (rectangle_m, disc_m)
        for name, length_m in others_m.items():
            if length_m is not None:
                raise ValueError(f"{name} is no size of a {self.shape}; got {length_m!r}")
        for name, length_m in own_m.items():
            _require_size(name, length_m, self.shape)

    def _check_name(self) -> None:
        if (self.name is not None) != (self.side == "other"):
            raise ValueError(
                f"name must be given where side is other, and only there; got {self.name!r} where "
                f"side is {self.side}"
            )
        if self.name is not None and (not _NAME.fullmatch(self.name) or self.name in SIDES):
            raise ValueError(
                "name must be 1 to 32 of the characters A-Z a-z 0-9 _ - and no side; "
                f"got {self.name!r}"
            )

    @property
    def label(self) -> str:
        """What it is called: its side, or its name."""
        return self.name or self.side

    @property
    def span_x_m(self) -> tuple[float, float]:
        """Where the patch begins and ends along the strip."""
        return _span_m(self.x_m, self.diameter_m or self.length_x_m)

    @property
    def span_y_m(self) -> tuple[float, float]:
        """Where the patch begins and ends across the strip."""
        return _span_m(self.y_m, self.diameter_m or self.length_y_m)


def _require_size(name: str, length_m: float | None, shape: str) -> None:
    if length_m is None:
        raise ValueError(f"{name} is missing; a {shape} needs it")
    finite(name, length_m, above=0)


def _span_m(centre_m: float, length_m: float | None) -> tuple[float, float]:
    half_m = (length_m or 0.0) / 2
    return centre_m - half_m, centre_m + half_m


def check_actuators(actuators: tuple[Actuator, ...], strip: Strip) -> None:
    """Refuse patches that reach over the strip's edge or over each other.

    Parameters
    ----------
    actuators : tuple of Actuator
        Left, right, and any number of others.
    strip : Strip
        The strip that they lie on.

    Raises
    ------
    ValueError
        If one reaches over an edge or an end, the rectangles around two overlap, the left does not
        end before the right begins, a side is missing, or two others have the same name.
    """
    sides = [actuator.side for actuator in actuators]
    if sides[:2] != ["left", "right"] or set(sides[2:]) - {"other"}:
        raise ValueError(
            "actuator sides must be left and right, each once, and other for more; "
            f"got {', '.join(sides)}"
        )
    names = [actuator.name for actuator in actuators[2:]]
    if len(set(names)) != len(names):
        raise ValueError(f"actuator names must be distinct; got {', '.join(map(str, names))}")
    left, right, *_ = actuators
    for actuator in actuators:
        _check_span(actuator, "y_m", actuator.span_y_m, (0.0, strip.width_m))
        if strip.length_m is not None:
            limits_m = (-strip.length_m / 2, strip.length_m / 2)
            _check_span(actuator, "x_m", actuator.span_x_m, limits_m)
    if left.span_x_m[1] > right.span_x_m[0]:
        raise ValueError(
            "the left actuator must end, along the strip, before the right one begins at "
            f"{_mm(right.span_x_m[0])}; got an end at {_mm(left.span_x_m[1])}"
        )
    for one, two in combinations(actuators, 2):
        if _overlap(one.span_x_m, two.span_x_m) and _overlap(one.span_y_m, two.span_y_m):
            raise ValueError(
                f"the actuators {one.label} and {two.label} must not overlap; got centres at "
                f"x = {_mm(one.x_m)} and {_mm(two.x_m)}"
            )


def _overlap(one_m: tuple[float, float], two_m: tuple[float, float]) -> bool:
    """Tell whether two spans have more than an end in common."""
    return min(one_m[1], two_m[1]) - max(one_m[0], two_m[0]) > _ROUNDING_M


def _check_span(
    actuator: Actuator, axis: str, span_m: tuple[float, float], limits_m: tuple[float, float]
) -> None:
    if span_m[0] < limits_m[0] - _ROUNDING_M or span_m[1] > limits_m[1] + _ROUNDING_M:
        raise ValueError(
            f"the {actuator.label} actuator must lie on the strip, which goes from "
            f"{axis[0]} = {_mm(limits_m[0])} to {_mm(limits_m[1])}; "
            f"got a {actuator.shape} from {_mm(span_m[0])} to {_mm(span_m[1])}"
        )


def _mm(length_m: float) -> str:
    return f"{length_m * 1e3:.6g} mm"
