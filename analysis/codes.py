"""The codes of warnings and of statements: what programs read where people read sentences."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class WarningCode(StrEnum):
    """What a warning is about; its message has the numbers and the names."""

    # of an analysis
    SESSION_WITHOUT_TABLE = "session_without_table"
    PLANNED_TRIALS_MISSING = "planned_trials_missing"
    TRIALS_NOT_EXPORTED = "trials_not_exported"
    VALID_ATTEMPT_MISSING = "valid_attempt_missing"
    FEWER_TRIALS_THAN_OTHERS = "fewer_trials_than_others"
    TRIALS_LEFT_OUT = "trials_left_out"
    PARTICIPANT_NOT_COUNTED = "participant_not_counted"
    SINGLE_STIMULI_MISSING = "single_stimuli_missing"
    REACTION_TIMES_RESCALED = "reaction_times_rescaled"
    CONDITIONS_POOLED = "conditions_pooled"
    SESSION_IN_SEVERAL_FILES = "session_in_several_files"
    BLANKS_MOSTLY_DETECTED = "blanks_mostly_detected"
    SEVERAL_STUDIES = "several_studies"
    SESSION_MODIFIED = "session_modified"
    SESSION_LOST = "session_lost"
    PRACTICE_WITHOUT_DEVICE = "practice_without_device"
    SIMULATED_AND_REAL = "simulated_and_real"
    CONTACT_DIFFERS = "contact_differs"
    ANSWERS_MISSING = "answers_missing"
    NONE_OFFERED_IN_PART = "none_offered_in_part"
    BLANKS_WITHOUT_NONE = "blanks_without_none"
    RESPONSES_REVERSED = "responses_reversed"
    GUESSING = "guessing"
    THRESHOLD_DRIFTS = "threshold_drifts"
    FUNCTION_MISFIT = "function_misfit"
    SIDES_UNEQUAL = "sides_unequal"
    # of a power analysis
    SIGMA_TOO_WIDE = "sigma_too_wide"
    VALUES_ASSUMED = "values_assumed"
    PILOT_TOO_SMALL = "pilot_too_small"
    PILOT_UNIT = "pilot_unit"


@dataclass(frozen=True, slots=True)
class AnalysisWarning:
    """Something that the reader of a result should look at.

    Attributes
    ----------
    code : WarningCode
        What the warning is about.
    message : str
        The same as a sentence, with numbers and names.

    Examples
    --------
    >>> warning = AnalysisWarning(WarningCode.TRIALS_LEFT_OUT, "2 trials are left out: aborted 2")
    >>> f"{warning.code}: {warning}"
    'trials_left_out: 2 trials are left out: aborted 2'
    """

    code: WarningCode
    message: str

    def __str__(self) -> str:
        return self.message


def with_code(code: WarningCode, messages: Iterable[str]) -> Iterator[AnalysisWarning]:
    """Give several messages the same code."""
    return (AnalysisWarning(code, message) for message in messages)


class StatementCode(StrEnum):
    """What a statement of the answer is about."""

    # the threshold
    THRESHOLD = "threshold"
    THRESHOLD_MISSING = "threshold_missing"
    THRESHOLDS_IN_TABLE = "thresholds_in_table"
    CONDITION_NEVER_ANSWERED = "condition_never_answered"
    RESPONSES_REVERSED = "responses_reversed"
    THRESHOLD_WITHOUT_REVERSED = "threshold_without_reversed"
    GUESSING = "guessing"
    GUESS_RATE_ASSUMED = "guess_rate_assumed"
    ONE_SESSION = "one_session"
    FEW_PARTICIPANTS = "few_participants"
    # how conditions compare
    DIFFERENCE = "difference"
    DIFFERENCE_NOT_SHOWN = "difference_not_shown"
    DIFFERENCE_UNKNOWN = "difference_unknown"
    DIFFERENCES_IN_TABLE = "differences_in_table"
    DIFFERENCE_HAS_OWN_MODEL = "difference_has_own_model"
    CONDITION_ALWAYS_FIRST = "condition_always_first"
    SEVERAL_COMPARISONS = "several_comparisons"
    CONDITIONS_NOT_COMPARED = "conditions_not_compared"
    # false alarms, and whether they explain a difference
    CRITERION_UNKNOWN = "criterion_unknown"
    FALSE_ALARMS_DIFFER = "false_alarms_differ"
    FALSE_ALARM_DIFFERENCE_NOT_SHOWN = "false_alarm_difference_not_shown"
    FALSE_ALARM_TENDENCY = "false_alarm_tendency"
    D_PRIME_BY_LEVEL = "d_prime_by_level"
    CONDITIONS_INTERLEAVED = "conditions_interleaved"
    FALSE_ALARMS = "false_alarms"
    FALSE_ALARMS_IN_TABLE = "false_alarms_in_table"
    FALSE_ALARMS_NOT_ASKED = "false_alarms_not_asked"
    FALSE_ALARMS_UNKNOWN = "false_alarms_unknown"
    EQUAL_COUNTS_UNEQUAL_INTERVALS = "equal_counts_unequal_intervals"
    # what was left out
    LEFT_OUT = "left_out"
    LEFT_OUT_BY_MAP = "left_out_by_map"
    PARTICIPANTS_NOT_COUNTED = "participants_not_counted"
    SESSIONS_LOST = "sessions_lost"
    FUNCTIONS_STEEP = "functions_steep"
    LAPSES_AT_BOUND = "lapses_at_bound"
    WARNINGS = "warnings"


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the answer: what it is about, and its words without capital and full stop."""

    code: StatementCode
    text: str

    def __str__(self) -> str:
        return f"{self.text[0].upper()}{self.text[1:]}."
