from .frames import frames_of
from .history import transient, transient_work
from .motion import motions, reference_of
from .peaks import LOOKS, crests, peaks_of
from .section import AGREED, sections

__all__ = [
    "AGREED",
    "LOOKS",
    "crests",
    "frames_of",
    "motions",
    "peaks_of",
    "reference_of",
    "sections",
    "transient",
    "transient_work",
]
