from .misfit import misfits
from .paragraphs import Methods, methods_of
from .task import is_yes_no

__all__ = ["Methods", "is_yes_no", "methods_of", "misfits"]
