"""Argument checks shared by the values of this package."""

from __future__ import annotations

import math
from typing import TypeGuard

import numpy as np


def is_real(value: object) -> TypeGuard[float]:
    """Return whether a value is a finite number; bool is none.

    >>> is_real(2), is_real(2.5), is_real(True), is_real(float("nan")), is_real("2")
    (True, True, False, False, False)
    """
    return (
        isinstance(value, (int, float, np.integer, np.floating))
        and not isinstance(value, bool)
        and math.isfinite(value)
    )


def is_whole(value: object) -> TypeGuard[int]:
    """Return whether a value is an integer; bool is none.

    >>> is_whole(2), is_whole(2.0), is_whole(True)
    (True, False, False)
    """
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def require_real(
    name: str, value: object, *, minimum: float = -math.inf, maximum: float = math.inf
) -> None:
    """Refuse anything but a finite number from `minimum` to `maximum`, both included.

    >>> require_real("offset_s", -2.5)
    >>> require_real("drift_ppm", 2e6, minimum=-1e5, maximum=1e5)
    Traceback (most recent call last):
    ValueError: drift_ppm must be a number from -100000 to 100000, got 2000000.0
    """
    if not is_real(value) or not minimum <= value <= maximum:
        raise ValueError(f"{name} must be a number from {minimum:g} to {maximum:g}, got {value!r}")


def require_positive(name: str, value: object, *, maximum: float = math.inf) -> None:
    """Refuse anything but a finite number above 0 and up to `maximum`.

    >>> require_positive("gain", 0.0)
    Traceback (most recent call last):
    ValueError: gain must be a number above 0 and up to inf, got 0.0
    """
    if not is_real(value) or not 0 < value <= maximum:
        raise ValueError(f"{name} must be a number above 0 and up to {maximum:g}, got {value!r}")


def require_whole(name: str, value: object, *, minimum: int, maximum: int) -> None:
    """Refuse anything but an integer from `minimum` to `maximum`, both included.

    >>> require_whole("bits", 16.0, minimum=2, maximum=24)
    Traceback (most recent call last):
    ValueError: bits must be an integer from 2 to 24, got 16.0
    """
    if not is_whole(value) or not minimum <= value <= maximum:
        raise ValueError(f"{name} must be an integer from {minimum} to {maximum}, got {value!r}")
