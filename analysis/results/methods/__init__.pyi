from .alarms import alarm_sentences, blank_rows, criterion_sentences
from .left_out import REASONS, left_out_rows, left_out_words, unread_words
from .looked import looked_words
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

__all__ = [
    "REASONS",
    "alarm_sentences",
    "at_bound_often",
    "blank_rows",
    "counts_told",
    "criterion_sentences",
    "hit_words",
    "is_yes_no",
    "lapses_words",
    "left_out_rows",
    "left_out_words",
    "looked_words",
    "methods_of",
    "misfit_p_text",
    "misfit_words",
    "misfits",
    "misfitting",
    "one_side_words",
    "steep_words",
    "unread_words",
]
