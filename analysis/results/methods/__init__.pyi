from .misfit import misfits
from .paragraphs import counts_told, methods_of
from .task import is_yes_no, one_side_words

__all__ = ["counts_told", "is_yes_no", "methods_of", "misfits", "one_side_words"]
