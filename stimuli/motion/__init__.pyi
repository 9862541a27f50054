from .frames import frames_of
from .history import transient, transient_work
from .motion import motions, reference_of
from .peaks import LOOKS, crests, peaks_of

__all__ = [
    "LOOKS",
    "crests",
    "frames_of",
    "motions",
    "peaks_of",
    "reference_of",
    "transient",
    "transient_work",
]
