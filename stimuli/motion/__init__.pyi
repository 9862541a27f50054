from .frames import frames_of
from .history import transient, transient_work
from .motion import Motion, motions, reference_of, steady
from .peaks import LOOKS, crests, patched_peaks, peaks_of
from .section import AGREED, sections

__all__ = [
    "AGREED",
    "LOOKS",
    "Motion",
    "crests",
    "frames_of",
    "motions",
    "patched_peaks",
    "peaks_of",
    "reference_of",
    "sections",
    "steady",
    "transient",
    "transient_work",
]
