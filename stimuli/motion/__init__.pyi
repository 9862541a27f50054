from .frames import frames_of
from .history import MOST_FUNCTIONS, multiples, transient, transient_work
from .modes import n_functions
from .motion import motion_of
from .peaks import peaks_of

__all__ = [
    "MOST_FUNCTIONS",
    "frames_of",
    "motion_of",
    "multiples",
    "n_functions",
    "peaks_of",
    "transient",
    "transient_work",
]
