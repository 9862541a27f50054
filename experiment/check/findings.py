"""What a check found, each fact stated once: a line on a terminal beside a value for programs."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from collections.abc import Iterable


_COLUMN: Final = 15
"""Where the words begin in a line."""


class WarningCode(StrEnum):
    """What a warning of a check is about, in words that other programs may rely on."""

    # plate and actuators
    THICK_PLATE = "thick_plate"
    CUTOFF_MISMATCH = "cutoff_mismatch"
    AMBIGUOUS_CUTOFF = "ambiguous_cutoff"
    IDEAL_EDGE = "ideal_edge"
    OTHER_EDGE_UNKNOWN = "other_edge_unknown"
    CROSSTALK_NEAR_LIMIT = "crosstalk_near_limit"
    ASSUMED_POSITION = "assumed_position"
    # stimuli
    ENERGY_ABOVE_CUTOFF = "energy_above_cutoff"
    CROSSTALK_ABOVE_LIMIT = "crosstalk_above_limit"
    UNCERTAIN_CROSSTALK = "uncertain_crosstalk"
    ACCEPTED_STIMULUS = "accepted_stimulus"
    UNKNOWN_DISPLACEMENT = "unknown_displacement"
    ONE_SIDED_DISPLACEMENT = "one_sided_displacement"
    UNEQUAL_SIDES = "unequal_sides"
    CROSSTALK_BELOW_MODEL = "crosstalk_below_model"
    ASSUMED_LOSS = "assumed_loss"
    PLASTIC_LOSS = "plastic_loss"
    MEASURED_NEAR_MODE = "measured_near_mode"
    OMITTED_FINGER_LOAD = "omitted_finger_load"
    # device and monitor
    REFUSED_DEVICE = "refused_device"
    FULL_SCALE_ABOVE_CEILING = "full_scale_above_ceiling"
    CEILING_ABOVE_FULL_SCALE = "ceiling_above_full_scale"
    PRACTICE_DEVICE = "practice_device"
    UNUSED_MONITOR = "unused_monitor"
    NARROW_ONSET_TOLERANCE = "narrow_onset_tolerance"
    MISSING_EQUIPMENT = "missing_equipment"
    MISSING_GUARANTEE = "missing_guarantee"
    FAILED_CHANNEL = "failed_channel"
    UNVERIFIED_BURST = "unverified_burst"
    # participants and design
    UNKNOWN_CONTACT = "unknown_contact"
    INCOMPLETE_INSTRUCTIONS = "incomplete_instructions"
    UNKNOWN_KEY = "unknown_key"
    UNTYPED_KEY = "untyped_key"
    SHORT_BLOCKS = "short_blocks"
    NO_MASKING_NOISE = "no_masking_noise"
    THRESHOLD_OF_ANOTHER_PLATE = "threshold_of_another_plate"
    THRESHOLD_OUTSIDE_LEVELS = "threshold_outside_levels"
    THRESHOLD_NEAR_END_OF_LEVELS = "threshold_near_end_of_levels"
    THRESHOLD_OUTSIDE_CURVES = "threshold_outside_curves"
    ASSUMED_VALUE = "assumed_value"


@dataclass(frozen=True, slots=True)
class CheckWarning:
    """Something in a study that the reader should look at: a code for programs and a message."""

    code: WarningCode
    message: str


class Findings:
    """Lines for a terminal and, from the same statements, facts by keys that carry their unit.

    Examples
    --------
    >>> found = Findings()
    >>> found.tell("cut-off", "2900.0 Hz, measured", cutoff_hz=2900.0)
    >>> found.text, found.json
    ('cut-off        2900.0 Hz, measured', '{"cutoff_hz": 2900.0}')
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.facts: dict[str, Any] = {}
        self.warnings: list[CheckWarning] = []

    def tell(self, label: str, words: str, **facts: Any) -> None:
        """State facts in a line; without a label it goes on with what the line above says."""
        self.lines.append(f"{label:{_COLUMN}}{words}")
        self.facts |= facts

    def warn(self, label: str, code: WarningCode, *lines: str, **facts: Any) -> None:
        """State facts in lines, which are one warning.

        >>> found = Findings()
        >>> found.warn("warning", WarningCode.THICK_PLATE, "not a thin plate")
        >>> [(warning["code"].value, warning["message"]) for warning in found.coded]
        [('thick_plate', 'not a thin plate')]
        """
        for number, line in enumerate(lines):
            self.tell("" if number else label, line)
        self.note(**facts)
        self.note_warning(code, " ".join(lines))

    def note_warning(self, code: WarningCode, message: str) -> None:
        """Add a warning whose words are part of a line that is stated by itself."""
        self.warnings.append(CheckWarning(code, message))

    @property
    def coded(self) -> list[dict[str, str]]:
        """The warnings as facts for programs."""
        return [asdict(warning) for warning in self.warnings]

    def note(self, **facts: Any) -> None:
        """State facts that only programs are told."""
        self.facts |= facts

    def space(self) -> None:
        """Leave a line free."""
        self.lines.append("")

    def take(self, other: Findings) -> None:
        """Go on with other findings on the same thing."""
        self.lines += other.lines
        self.facts |= other.facts
        self.warnings += other.warnings

    def part(self, key: str, part: Findings) -> None:
        """Take in the findings on one thing, under a key of their own."""
        self.lines += part.lines
        self.facts[key] = part.facts
        self.warnings += part.warnings

    def parts(self, key: str, parts: Iterable[Findings]) -> None:
        """Take in the findings on several things of a kind, as a list."""
        self.facts[key] = []
        for part in parts:
            self.lines += part.lines
            self.facts[key].append(part.facts)
            self.warnings += part.warnings

    @property
    def text(self) -> str:
        """The lines."""
        return "\n".join(self.lines)

    @property
    def json(self) -> str:
        """The facts as one JSON object on one line."""
        return json.dumps(self.facts, allow_nan=False)
