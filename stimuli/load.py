"""What an actuator does to the plate: forces, pressures and bonded patches that bend it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar, Final

from stimuli.checks import finite

_LEAST_SIZE_M: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class _Placed:
    """A load with its centre: x along the strip, y across it from one edge."""

    x_m: float
    y_m: float

    unit: ClassVar[str] = "N"
    """Unit of the load whose field is computed."""

    is_moment: ClassVar[bool] = False
    """Whether it bends the plate instead of pushing it."""

    is_disc: ClassVar[bool] = False
    """Whether it is round."""

    def __post_init__(self) -> None:
        for field in fields(self):
            least = -1e3 if field.name == "x_m" else 0.0
            if field.name not in ("x_m", "y_m"):
                least = _LEAST_SIZE_M
            size_m = finite(field.name, getattr(self, field.name), least=least, most=1e3)
            object.__setattr__(self, field.name, size_m)

    @property
    def half_size_m(self) -> tuple[float, float]:
        """Half of the extent along and across the strip."""
        return 0.0, 0.0

    @property
    def area_m2(self) -> float:
        """Area over which a unit load is spread; 1 where the load is no total force."""
        return 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PointForce(_Placed):
    """A force of 1 N at one point, equation (31).

    Attributes
    ----------
    x_m, y_m : float
        Place along the strip, and across it from one edge.

    Raises
    ------
    ValueError
        If a place is not a finite number, or `y_m` is negative.

    Examples
    --------
    >>> PointForce(x_m=0.0, y_m=0.0125).unit
    'N'
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class _Disc(_Placed):
    radius_m: float

    is_disc: ClassVar[bool] = True

    @property
    def half_size_m(self) -> tuple[float, float]:
        """Half of the extent along and across the strip."""
        return self.radius_m, self.radius_m


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureDisc(_Disc):
    """A pressure of 1 Pa over a disc, equation (31).

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    radius_m : float
        Radius, from 1 nm.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Examples
    --------
    >>> PressureDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064).unit
    'Pa'
    """

    unit: ClassVar[str] = "Pa"


@dataclass(frozen=True, slots=True, kw_only=True)
class MomentDisc(_Disc):
    """A bonded disc with an edge moment of 1 N m per metre, equation (31): a piezo bender.

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    radius_m : float
        Radius, from 1 nm.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Notes
    -----
    It is the load alone: the stiffness and the mass of a patch are in `Strip.patches`, if anywhere.

    Examples
    --------
    >>> MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.0064).unit
    'N m/m'
    """

    unit: ClassVar[str] = "N m/m"
    is_moment: ClassVar[bool] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rectangle(_Placed):
    length_x_m: float
    length_y_m: float

    @property
    def half_size_m(self) -> tuple[float, float]:
        """Half of the extent along and across the strip."""
        return self.length_x_m / 2, self.length_y_m / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class PressureRectangle(_Rectangle):
    """A pressure of 1 Pa over a rectangle, equation (31).

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    length_x_m, length_y_m : float
        Lengths along and across the strip, from 1 nm.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Examples
    --------
    >>> PressureRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.01, length_y_m=0.01).unit
    'Pa'
    """

    unit: ClassVar[str] = "Pa"


@dataclass(frozen=True, slots=True, kw_only=True)
class MomentRectangle(_Rectangle):
    """A bonded rectangle with an edge moment of 1 N m per metre, equation (31).

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    length_x_m, length_y_m : float
        Lengths along and across the strip, from 1 nm.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Examples
    --------
    >>> MomentRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.006, length_y_m=0.018).half_size_m
    (0.003, 0.009)
    """

    unit: ClassVar[str] = "N m/m"
    is_moment: ClassVar[bool] = True


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceRectangle(_Rectangle):
    """A force of 1 N spread evenly over a rectangle: a vibration motor over its contact area.

    Attributes
    ----------
    x_m, y_m : float
        Centre along the strip, and across it from one edge.
    length_x_m, length_y_m : float
        Lengths along and across the strip, from 1 nm.

    Raises
    ------
    ValueError
        If a value is not a finite number in its range.

    Examples
    --------
    A smaller contact presses harder:

    >>> motor = ForceRectangle(x_m=0.0, y_m=0.0125, length_x_m=0.01, length_y_m=0.004)
    >>> round(1 / motor.area_m2)
    25000
    """

    @property
    def area_m2(self) -> float:
        """Area of the contact."""
        return self.length_x_m * self.length_y_m


Load = PointForce | PressureDisc | PressureRectangle | MomentDisc | MomentRectangle | ForceRectangle
"""What may drive a strip: any of these loads, each of unit size.

>>> from stimuli import Load, PointForce
>>> isinstance(PointForce(x_m=0.0, y_m=0.0125), Load)
True
"""

LOADS: Final = (
    PointForce,
    PressureDisc,
    PressureRectangle,
    MomentDisc,
    MomentRectangle,
    ForceRectangle,
)
"""The same, to be checked against."""

DISCS: Final = (PressureDisc, MomentDisc)
"""The round ones."""
