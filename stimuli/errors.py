"""What a field refuses to compute, with the values that decide as attributes.

Each is a `ValueError`. A caller that has other names for these values, such as the keys of a study,
reads the attributes and not the message.
"""

from __future__ import annotations

from enum import Enum


class TooManyModesError(ValueError):
    """A plate that has too many modes for its patches to be computed.

    Parameters
    ----------
    length_m : float or None
        Length of the strip; an attribute of the error.
    """

    def __init__(self, length_m: float | None) -> None:
        super().__init__(
            "the plate has too many modes for its patches to be counted, got "
            f"length_m = {length_m!r}"
        )
        self.length_m = length_m


class PeakOutOfRangeError(ValueError):
    """A drive whose spectrum has its peak where the field of the strip is not known.

    Parameters
    ----------
    peak_hz, max_hz : float
        Where the peak is, and the highest frequency allowed; attributes of the error.
    """

    def __init__(self, peak_hz: float, max_hz: float) -> None:
        super().__init__(
            f"burst must have its peak below {max_hz:.6g} Hz, where the field is known far beyond "
            f"it, got one of {peak_hz:.6g} Hz"
        )
        self.peak_hz, self.max_hz = peak_hz, max_hz


class SpectrumTailError(ValueError):
    """A drive that reaches beyond the highest frequency at which the field is known.

    Parameters
    ----------
    rtol, min_rtol : float
        The tolerance, and the smallest that can be kept; attributes of the error.
    highest_hz : float
        The highest frequency of the field.
    """

    def __init__(self, *, rtol: float, min_rtol: float, highest_hz: float) -> None:
        super().__init__(
            f"rtol must be at least {min_rtol:.2g} for this drive and scene: they reach "
            f"beyond {highest_hz:.6g} Hz, the highest frequency of the field; "
            f"smoother ends or viscous loss reach less far, got {rtol!r}"
        )
        self.rtol, self.min_rtol, self.highest_hz = rtol, min_rtol, highest_hz


class FingertipLoadError(ValueError):
    """A plate whose motion under the load of fingertips cannot be computed."""


class Rule(Enum):
    """What a plate, a load or a drive violates; the value is the message."""

    ABOVE_FIRST_MODE = (
        "frequency_hz must lie below the strip's first mode, {first_hz:.6g} Hz (without ends its "
        "first cut-off), got {frequency_hz!r}"
    )
    INFINITE = (
        "frequencies_hz must not be a cut-off or a resonance of a strip without loss, where the "
        "field is infinite, got {frequency_hz!r}"
    )
    TOLERANCE = "rtol must be at least {min_rtol:.2g} in this scene, got {rtol!r}"
    TOO_MANY_FUNCTIONS = (
        "the plate needs {n_functions} functions (at most {max_functions}): take a shorter or "
        "narrower plate, or lower frequencies"
    )
    UNCERTAIN_PEAK = (
        "loads must have peaks at their fingertips that are known to {max_percent:g} %, got an "
        "error of {error_percent:.1f} % for number {load}"
    )
    LEVEL_NOT_REACHED = (
        "wanted_db must be reached by a burst of at most {max_cycles} cycles, got {target_db!r}: "
        "the lowest level is {lowest_db:.2f} dB, of {cycles} cycles with window {window}"
    )


class PlateError(ValueError):
    """A violated rule with its values.

    Parameters
    ----------
    rule : Rule
    **values : float or str
        What the rule's message names.

    Examples
    --------
    >>> error = PlateError(Rule.ABOVE_FIRST_MODE, frequency_hz=2950.0, first_hz=2891.118)
    >>> error.rule.name, error.values["first_hz"]
    ('ABOVE_FIRST_MODE', 2891.118)
    """

    def __init__(self, rule: Rule, **values: float | str) -> None:
        super().__init__(rule.value.format(**values))
        self.rule, self.values = rule, values
