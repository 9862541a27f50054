from .looked import looked_words
from .misfit import lapses_words, misfit_words, misfits
from .paragraphs import counts_told, methods_of
from .task import hit_words, is_yes_no, one_side_words

__all__ = [
    "counts_told",
    "hit_words",
    "is_yes_no",
    "lapses_words",
    "looked_words",
    "methods_of",
    "misfit_words",
    "misfits",
    "one_side_words",
]
