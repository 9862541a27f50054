from .history import MOST_FUNCTIONS, MULTIPLES, transient, transient_work
from .modes import n_functions
from .motion import motion_of
from .peaks import peaks_of

__all__ = [
    "MOST_FUNCTIONS",
    "MULTIPLES",
    "motion_of",
    "n_functions",
    "peaks_of",
    "transient",
    "transient_work",
]
