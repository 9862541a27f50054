"""What a plate, a load or a drive violates, as data.

A caller that has other names for these values, such as the keys of a study, reads the rule and the
values, and not the message.
"""

from __future__ import annotations

from enum import Enum


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
    DRIVE_OUT_OF_RANGE = (
        "drive must last at most {max_s:g} s and have its band below {max_hz:.6g} Hz, got "
        "{duration_s:.6g} s and a band up to {band_hz:.6g} Hz"
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
