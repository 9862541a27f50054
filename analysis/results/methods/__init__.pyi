from .alarms import alarm_sentences, blank_rows, criterion_sentences
from .looked import looked_words
from .misfit import lapses_words, misfit_p_text, misfit_words, misfits, steep_words
from .paragraphs import counts_told, methods_of
from .task import hit_words, is_yes_no, one_side_words

__all__ = [
    "alarm_sentences",
    "blank_rows",
    "counts_told",
    "criterion_sentences",
    "hit_words",
    "is_yes_no",
    "lapses_words",
    "looked_words",
    "methods_of",
    "misfit_p_text",
    "misfit_words",
    "misfits",
    "one_side_words",
    "steep_words",
]
