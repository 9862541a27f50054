from .frames import frames_of
from .history import transient, transient_work
from .motion import motions, reference_of, steady
from .peaks import LOOKS, Peaks, crests, peaks_of

__all__ = [
    "LOOKS",
    "Peaks",
    "crests",
    "frames_of",
    "motions",
    "peaks_of",
    "reference_of",
    "steady",
    "transient",
    "transient_work",
]
