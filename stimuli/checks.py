"""Checks of single values that the modules of this package share; each refuses by name."""

from __future__ import annotations

import math
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def finite(
    name: str,
    value: float,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
) -> float:
    """Return a real number as a float, or refuse it by name, range and value.

    A bool, a text, an infinity and a NaN are none. `above` and `below` are not in the range,
    `least` and `most` are.

    >>> finite("width_m", 1, above=0, most=10)
    1.0
    >>> finite("width_m", 0.0, above=0, most=10)
    Traceback (most recent call last):
    ValueError: width_m must be a finite number > 0 and <= 10, got 0.0
    """
    number = _as_float(value)
    fits = above < number < below and least <= number <= most
    if not (fits and math.isfinite(number)):
        limits = ((">", above), (">=", least), ("<=", most), ("<", below))
        range_text = " and ".join(f"{s} {v:.12g}" for s, v in limits if math.isfinite(v))
        raise ValueError(f"{name} must be a finite number {range_text}, got {value!r}")
    return number


def _as_float(value: float) -> float:
    if not _is_number(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _is_number(value: Any, sort: type) -> bool:
    return isinstance(value, sort) and not isinstance(value, bool)


def whole(name: str, value: int, *, least: int, most: int) -> int:
    """Return a value as an int, or refuse it.

    ValueError where the value is not a whole number from `least` to `most`.

    >>> whole("mode", 3, least=1, most=9)
    3
    >>> whole("mode", 3.0, least=1, most=9)
    Traceback (most recent call last):
    ValueError: mode must be a whole number from 1 to 9, got 3.0
    """
    if not _is_number(value, Integral) or not least <= value <= most:
        raise ValueError(f"{name} must be a whole number from {least} to {most}, got {value!r}")
    return int(value)


def finite_array(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return numbers as an array of float64 of the same shape, or refuse them.

    ValueError where they are not real numbers, or not all of them are finite.

    >>> finite_array("y_m", [0, 1])
    array([0., 1.])
    >>> finite_array("y_m", [0, float("nan")])
    Traceback (most recent call last):
    ValueError: y_m must hold finite real numbers, got array([ 0., nan])
    """
    numbers = np.asarray(values)
    if numbers.dtype.kind not in "iuf" or not np.all(np.isfinite(numbers)):
        line = " ".join(repr(numbers).split())
        raise ValueError(f"{name} must hold finite real numbers, got {line}")
    return numbers.astype(np.float64)


def instance(name: str, value: Any, kind: type | tuple[type, ...], wanted: str) -> None:
    """Refuse a value of the wrong type.

    ValueError where the value is no instance; the message says what is required.

    >>> instance("lossless", 1, bool, "True or False")
    Traceback (most recent call last):
    ValueError: lossless must be True or False, got 1
    """
    fits = isinstance(value, kind)
    if not fits:
        raise ValueError(f"{name} must be {wanted}, got {value!r}")
