"""What the levels of a table are: their axis and their unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


Levels = TypeVar("Levels", float, "Floats")
XScale = Literal["log10", "dB", "linear"]
_DB = 20.0
_MOST_UNIT = 16
LARGEST = 1e300
"""The largest number of a table."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """The axis on which levels lie.

    Attributes
    ----------
    x_scale : {"log10", "dB", "linear"}
        ``log10`` for levels above 0, ``dB`` for 20 log10 of such levels, ``linear`` for any.
    unit : str
        Of the levels: printable, of 1 to 16 characters.
    peak_to_peak : bool
        Whether volts are known to be peak-to-peak.

    Raises
    ------
    ValueError
        For another scale, and for a unit that is no such text.

    Examples
    --------
    >>> Axis(x_scale="linear", unit="cm/s").signed, Axis().signed
    (True, False)
    >>> Axis(x_scale="dB", unit="dB SL").on_axis(20.0), Axis(x_scale="dB", unit="dB SL").level(1.0)
    (1.0, 20.0)
    """

    x_scale: XScale = "log10"
    unit: str = "V"
    peak_to_peak: bool = True

    def __post_init__(self) -> None:
        if self.x_scale not in get_args(XScale):
            raise ValueError(f"[axis] x_scale: allowed log10, dB, linear, got {self.x_scale!r}")
        unit: object = self.unit
        if not (isinstance(unit, str) and 0 < len(unit) <= _MOST_UNIT and unit.isprintable()):
            raise ValueError(f"[axis] unit: printable text of 1 to {_MOST_UNIT}, got {unit!r}")
        if unit.lower().startswith("db") != (self.x_scale == "dB"):
            raise ValueError(
                '[axis] x_scale = "dB" needs a unit such as "dB" or "dB SL", and such a unit '
                f'needs x_scale = "dB"; got unit = "{unit}" and x_scale = "{self.x_scale}"'
            )

    def on_axis(self, levels: Levels) -> Levels:
        """Return where levels lie on the axis.

        Parameters
        ----------
        levels : float or numpy.ndarray
            In their unit.

        Returns
        -------
        float or numpy.ndarray
            Their places.

        Examples
        --------
        >>> import numpy as np
        >>> Axis().on_axis(np.array([10.0, 100.0])).tolist()
        [1.0, 2.0]
        """
        import numpy as np

        if self.x_scale == "dB":
            return levels / _DB
        return np.log10(levels) if self.x_scale == "log10" else levels

    def level(self, x: Levels) -> Levels:
        """Return the levels at places on the axis.

        Parameters
        ----------
        x : float or numpy.ndarray
            The places.

        Returns
        -------
        float or numpy.ndarray
            In the unit of the levels.

        Examples
        --------
        >>> Axis().level(2.0)
        100.0
        """
        if self.x_scale == "dB":
            return _DB * x
        return 10.0**x if self.x_scale == "log10" else x

    def width(self, sigma: float) -> float:
        """Return a width on the axis in log10 units, dB, or in the unit of the levels.

        Parameters
        ----------
        sigma : float
            The width on the axis.

        Returns
        -------
        float
            In log10 units of levels above 0, otherwise in the unit of the levels.

        Examples
        --------
        >>> Axis().width(0.1), Axis(x_scale="dB", unit="dB").width(0.1)
        (0.1, 2.0)
        """
        return _DB * sigma if self.x_scale == "dB" else sigma

    @property
    def is_logarithmic(self) -> bool:
        """Whether levels are compared by their ratio, in dB."""
        return self.x_scale != "linear"

    @property
    def label(self) -> str:
        """The unit in the axis label of a figure.

        >>> Axis().label, Axis(x_scale="linear", unit="cm/s").label, axis_of({"unit": "V"}).label
        ('V peak-to-peak', 'cm/s', 'V')
        """
        return "V peak-to-peak" if self.is_vpp else self.unit

    @property
    def is_vpp(self) -> bool:
        """Whether levels are volts peak-to-peak."""
        return self.unit == VOLTS.unit and self.peak_to_peak

    @property
    def signed(self) -> bool:
        """Whether levels may have any sign."""
        return self.x_scale != "log10"


def axis_of(section: Mapping[str, Any]) -> Axis:
    """Return the axis that a map's section ``[axis]`` describes.

    Raises ValueError for another key, and as `Axis`.

    >>> axis_of({"x_scale": "linear"}).x_scale
    'linear'
    """
    for key in section:
        if key not in ("x_scale", "unit"):
            raise ValueError(f"[axis] {key}: allowed x_scale, unit")
    return Axis(**section, peak_to_peak="unit" not in section)


VOLTS = Axis()
"""Drive levels, volts peak-to-peak."""
