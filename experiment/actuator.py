"""The patches under the strip: their sizes and places, and that they lie on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from experiment.checks import require_word
from stimuli.checks import finite

if TYPE_CHECKING:
    from stimuli import Strip

Side = Literal["left", "right"]
Shape = Literal["disc", "rectangle"]

_ROUNDING_M = 1e-12
"""A patch as wide as the strip ends on its edges, but for the rounding of the sums."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """A patch under the strip and the finger it serves.

    Attributes
    ----------
    side : str
        ``left`` or ``right``, as the participant sees it.
    shape : str
        ``disc`` or ``rectangle``.
    x_m : float
        Place of its centre along the strip, from the middle, positive to the right.
    y_m : float
        Place of its centre across the strip, from one edge.
    diameter_m : float or None
        Diameter of a disc, else none.
    length_x_m, length_y_m : float or None
        Sides of a rectangle along and across the strip, else none.

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

    def __post_init__(self) -> None:
        require_word("side", self.side, get_args(Side))
        require_word("shape", self.shape, get_args(Shape))
        finite("x_m", self.x_m)
        finite("y_m", self.y_m)
        sizes = {
            "disc": {"diameter_m": self.diameter_m},
            "rectangle": {"length_x_m": self.length_x_m, "length_y_m": self.length_y_m},
        }
        for shape, lengths_m in sizes.items():
            for name, length_m in lengths_m.items():
                if shape != self.shape and length_m is not None:
                    raise ValueError(f"{name} is the size of a {shape}; got it for a {self.shape}")
                if shape == self.shape:
                    _require_size(name, length_m, shape)

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
        Left, right.
    strip : Strip
        The strip that they lie on.

    Raises
    ------
    ValueError
        If one reaches over an edge or an end, they overlap along the strip, or a side is missing.
    """
    sides = [actuator.side for actuator in actuators]
    if sides != ["left", "right"]:
        raise ValueError(f"actuator sides must be left and right, each once; got {sides}")
    left, right = actuators
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


def _check_span(
    actuator: Actuator, axis: str, span_m: tuple[float, float], limits_m: tuple[float, float]
) -> None:
    if span_m[0] < limits_m[0] - _ROUNDING_M or span_m[1] > limits_m[1] + _ROUNDING_M:
        raise ValueError(
            f"the {actuator.side} actuator must lie on the strip, which goes from "
            f"{axis[0]} = {_mm(limits_m[0])} to {_mm(limits_m[1])}; "
            f"got a {actuator.shape} from {_mm(span_m[0])} to {_mm(span_m[1])}"
        )


def _mm(length_m: float) -> str:
    return f"{length_m * 1e3:.6g} mm"
