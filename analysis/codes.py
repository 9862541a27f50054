"""The codes of warnings and of statements: what programs read where people read sentences."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator


class _Code(StrEnum):
    """A code with what it means."""

    text: str

    def __new__(cls, value: str, text: str) -> Self:
        """Make a member of a code and its meaning."""
        code = str.__new__(cls, value)
        code._value_ = value
        code.text = text
        return code


class WarningCode(_Code):
    """What a warning is about; its message has the numbers and the names.

    Examples
    --------
    >>> WarningCode.GUESSING == "guessing"
    True
    """

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
    REACTION_TIMES_RESCALED = "reaction_times_rescaled", "reaction times are read in another unit"
    CONDITIONS_POOLED = "conditions_pooled", "a column that may distinguish conditions was not read"
    SESSION_IN_SEVERAL_FILES = (
        "session_in_several_files",
        "the trials of one session are in several files",
    )
    BLANKS_MOSTLY_DETECTED = "blanks_mostly_detected", "most blank trials were answered as felt"
    SEVERAL_STUDIES = "several_studies", "the trials come from different studies"
    SESSION_MODIFIED = "session_modified", "a session was modified after it was recorded"
    SESSION_LOST = "session_lost", "a recorded session has no table any more"
    PRACTICE_WITHOUT_DEVICE = (
        "practice_without_device",
        "a person was on a device that moves nothing",
    )
    SIMULATED_AND_REAL = "simulated_and_real", "simulated and real trials are analysed together"
    CONTACT_DIFFERS = "contact_differs", "force and contact of the fingers differ between sessions"
    ANSWERS_MISSING = "answers_missing", "a participant gave no answer in a condition"
    NONE_OFFERED_IN_PART = "none_offered_in_part", "the answer none was offered in some trials only"
    BLANKS_WITHOUT_NONE = "blanks_without_none", "blank trials did not offer the answer none"
    RESPONSES_REVERSED = "responses_reversed", "a participant seems to have reversed the sides"
    GUESSING = "guessing", "a participant's answers do not differ from guesses"
    THRESHOLD_DRIFTS = "threshold_drifts", "a threshold drifts within a session"
    FUNCTION_MISFIT = "function_misfit", "a psychometric function does not fit its counts"
    SIDES_UNEQUAL = "sides_unequal", "the same volts move one finger more than the other"
    # of a power analysis
    SIGMA_TOO_WIDE = "sigma_too_wide", "a power analysis: sigma may be stated in dB"
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


class StatementCode(_Code):
    """What a statement of the answer is about.

    Examples
    --------
    >>> StatementCode("one_session").text
    'the interval is for one session'
    """

    # the threshold
    THRESHOLD = "threshold", "a threshold or its bound"
    THRESHOLD_MISSING = "threshold_missing", "no threshold, as no single stimulus counts"
    THRESHOLDS_IN_TABLE = "thresholds_in_table", "thresholds of many conditions are in the table"
    CONDITION_NEVER_ANSWERED = "condition_never_answered", "conditions in which nobody answered"
    RESPONSES_REVERSED = "responses_reversed", "participants who seem to have reversed the sides"
    THRESHOLD_WITHOUT_REVERSED = "threshold_without_reversed", "the threshold without these"
    GUESSING = "guessing", "participants whose answers do not differ from guesses"
    GUESS_RATE_ASSUMED = "guess_rate_assumed", "the guess rate is assumed"
    ONE_SESSION = "one_session", "the interval is for one session"
    FEW_PARTICIPANTS = (
        "few_participants",
        "the spread of few participants comes mostly from its prior",
    )
    # how conditions compare
    DIFFERENCE = "difference", "a difference of thresholds"
    DIFFERENCE_NOT_SHOWN = "difference_not_shown", "an interval of a difference that includes 0"
    DIFFERENCE_UNKNOWN = "difference_unknown", "a difference that the levels do not bound"
    DIFFERENCES_IN_TABLE = "differences_in_table", "differences of many conditions are in the table"
    DIFFERENCE_HAS_OWN_MODEL = (
        "difference_has_own_model",
        "the difference need not equal that of both thresholds",
    )
    CONDITION_ALWAYS_FIRST = "condition_always_first", "order and condition cannot be separated"
    SEVERAL_COMPARISONS = (
        "several_comparisons",
        "intervals are not corrected for several comparisons",
    )
    CONDITIONS_NOT_COMPARED = (
        "conditions_not_compared",
        "levels on a linear axis have no difference in dB",
    )
    # false alarms, and whether they explain a difference
    CRITERION_UNKNOWN = "criterion_unknown", "a difference may be one of criterion"
    FALSE_ALARMS_DIFFER = "false_alarms_differ", "false alarms differ between conditions"
    FALSE_ALARM_DIFFERENCE_NOT_SHOWN = (
        "false_alarm_difference_not_shown",
        "an interval or test that includes equal false alarms",
    )
    FALSE_ALARM_TENDENCY = "false_alarm_tendency", "the direction of such a difference"
    D_PRIME_BY_LEVEL = "d_prime_by_level", "at how many levels d' differs"
    CONDITIONS_INTERLEAVED = (
        "conditions_interleaved",
        "false alarms of interleaved conditions together",
    )
    FALSE_ALARMS = "false_alarms", "rates of false alarms"
    FALSE_ALARMS_IN_TABLE = "false_alarms_in_table", "rates of many conditions are in the table"
    FALSE_ALARMS_NOT_ASKED = "false_alarms_not_asked", "the answer none was not offered"
    FALSE_ALARMS_UNKNOWN = "false_alarms_unknown", "no blank trial counts"
    EQUAL_COUNTS_UNEQUAL_INTERVALS = (
        "equal_counts_unequal_intervals",
        "why equal counts have unequal intervals",
    )
    # what was left out
    LEFT_OUT = "left_out", "trials that are left out"
    LEFT_OUT_BY_MAP = "left_out_by_map", "rows and files that a column map leaves out"
    PARTICIPANTS_NOT_COUNTED = (
        "participants_not_counted",
        "participants without a trial that counts",
    )
    SESSIONS_LOST = "sessions_lost", "sessions that were lost after recording"
    FUNCTIONS_STEEP = "functions_steep", "functions that rise in one step"
    LAPSES_AT_BOUND = "lapses_at_bound", "functions with the largest lapse rate allowed"
    WARNINGS = "warnings", "the number of warnings"


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the answer: what it is about, and its words without capital and full stop."""

    code: StatementCode
    text: str

    def __str__(self) -> str:
        return f"{self.text[0].upper()}{self.text[1:]}."
