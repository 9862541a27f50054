from .misfit import misfits
from .paragraphs import counts_told, methods_of
from .task import is_yes_no

__all__ = ["counts_told", "is_yes_no", "methods_of", "misfits"]
