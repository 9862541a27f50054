"""The codes of warnings: what programs read where people read sentences."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Mapping


class WarningCode(StrEnum):
    """What a warning is about; its message has the numbers and the names.

    Examples
    --------
    >>> WarningCode.GUESSING == "guessing"
    True
    """

    text: str

    def __new__(cls, value: str, text: str) -> Self:
        """Make a member of a code and its meaning."""
        code = str.__new__(cls, value)
        code._value_ = value
        code.text = text
        return code

    # of an analysis
    SESSION_WITHOUT_TABLE = "session_without_table", "a session's folder has no trials.csv"
    PLANNED_TRIALS_MISSING = (
        "planned_trials_missing",
        "fewer planned trials than the plan has were presented",
    )
    TRIALS_NOT_EXPORTED = "trials_not_exported", "the journal has more trials than trials.csv"
    VALID_ATTEMPT_MISSING = "valid_attempt_missing", "trials have no valid attempt"
    FEWER_TRIALS_THAN_OTHERS = (
        "fewer_trials_than_others",
        "a participant has fewer trials than most",
    )
    TRIALS_LEFT_OUT = "trials_left_out", "trials are left out, by reason"
    PARTICIPANT_NOT_COUNTED = "participant_not_counted", "no trial of a participant counts"
    SINGLE_STIMULI_MISSING = "single_stimuli_missing", "no trial with a single stimulus counts"
    CONDITIONS_POOLED = "conditions_pooled", "a column that may distinguish conditions was not read"
    NAMES_ALIKE = "names_alike", "two names differ in their spelling only"
    SAME_TRIALS_TWICE = "same_trials_twice", "two files hold the same trials"
    BLANKS_MOSTLY_DETECTED = "blanks_mostly_detected", "most blank trials were answered as felt"
    SEVERAL_STUDIES = "several_studies", "the trials come from different studies"
    SESSION_MODIFIED = "session_modified", "a session was modified after it was recorded"
    SESSION_LOST = "session_lost", "the table of a recorded session is missing"
    PRACTICE_WITHOUT_DEVICE = (
        "practice_without_device",
        "a person was on a device that moves nothing",
    )
    SIMULATED_AND_REAL = "simulated_and_real", "simulated and real trials are analysed together"
    LEVELS_CHOSEN = "levels_chosen", "levels were chosen during the session, from the answers"
    CONTACT_DIFFERS = "contact_differs", "force and contact of the fingers differ between sessions"
    ANSWERS_MISSING = "answers_missing", "a participant gave no answer in a condition"
    NONE_OFFERED_IN_PART = "none_offered_in_part", "the answer none was offered in some trials only"
    BLANKS_WITHOUT_NONE = "blanks_without_none", "blank trials did not offer the answer none"
    RESPONSES_REVERSED = "responses_reversed", "a participant seems to have reversed the sides"
    GUESSING = "guessing", "a participant's answers do not differ from guesses"
    THRESHOLD_DRIFTS = "threshold_drifts", "a threshold drifts within a session"
    FUNCTION_MISFIT = "function_misfit", "a psychometric function does not fit its counts"
    SIDES_UNEQUAL = "sides_unequal", "the same volts move one finger more than the other"
    SIDES_DIFFER = "sides_differ", "the detection of stimuli differs between the sides"
    FALSE_ALARMS_DIFFER = "false_alarms_differ", "false alarms differ between conditions"
    CONDITION_ALWAYS_FIRST = "condition_always_first", "all participants began with one condition"
    LAPSES_AT_BOUND = "lapses_at_bound", "many lapse rates are at their upper limit"
    FUNCTIONS_STEEP = "functions_steep", "functions that rise in one step"
    # of a power analysis
    VALUES_ASSUMED = "values_assumed", "a power analysis: values without a source"
    PILOT_TOO_SMALL = "pilot_too_small", "a power analysis: a pilot of few participants"
    PILOT_UNIT = "pilot_unit", "a power analysis: levels in the unit of the pilot"


@dataclass(frozen=True, slots=True)
class AnalysisWarning:
    """Something that the reader of a result should look at.

    Attributes
    ----------
    code : WarningCode
        What the warning is about.
    message : str
        The same as a sentence, with numbers and names.
    data : mapping of str to object
        The numbers and names of the sentence.

    Examples
    --------
    >>> warning = AnalysisWarning(WarningCode.TRIALS_LEFT_OUT, "2 trials are left out: aborted 2")
    >>> f"{warning.code}: {warning}"
    'trials_left_out: 2 trials are left out: aborted 2'
    """

    code: WarningCode
    message: str
    data: Mapping[str, object] = field(default_factory=dict, compare=False)

    def __str__(self) -> str:
        return self.message
