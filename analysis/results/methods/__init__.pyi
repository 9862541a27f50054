from .alarms import alarm_sentences, blank_rows
from .criterion import criterion_sentences, settled
from .left_out import REASONS, left_out_rows, left_out_words, unread_words
from .looked import EACH, each_participant, looked_words
from .misfit import (
    at_bound_often,
    lapses_words,
    misfit_p_text,
    misfit_words,
    misfits,
    misfitting,
    steep_words,
)
from .paragraphs import counts_told, methods_of
from .task import hit_words, is_yes_no, one_side_words
from .words import SPELLED, and_words, isolated, number_of, plain

__all__ = [
    "EACH",
    "REASONS",
    "SPELLED",
    "alarm_sentences",
    "and_words",
    "at_bound_often",
    "blank_rows",
    "counts_told",
    "criterion_sentences",
    "each_participant",
    "hit_words",
    "is_yes_no",
    "isolated",
    "lapses_words",
    "left_out_rows",
    "left_out_words",
    "looked_words",
    "methods_of",
    "misfit_p_text",
    "misfit_words",
    "misfits",
    "misfitting",
    "number_of",
    "one_side_words",
    "plain",
    "settled",
    "steep_words",
    "unread_words",
]
