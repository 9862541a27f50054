from .frames import frames_of
from .history import transient, transient_work
from .motion import (
    Bare,
    Motion,
    bare_of,
    is_enough,
    motions,
    multiples_of,
    reference_of,
    springs_lose,
    steady,
    without_loss,
)
from .oscillators import Oscillators, poles
from .peaks import (
    LOOKS,
    TOO_MANY_FOR_PATCHES,
    PatchesUnknownError,
    Peaks,
    crests,
    patched_peaks,
    peaks_of,
    wait_of,
)
from .section import AGREED, sections

__all__ = [
    "AGREED",
    "LOOKS",
    "TOO_MANY_FOR_PATCHES",
    "Bare",
    "Motion",
    "Oscillators",
    "PatchesUnknownError",
    "Peaks",
    "bare_of",
    "crests",
    "frames_of",
    "is_enough",
    "motions",
    "multiples_of",
    "patched_peaks",
    "peaks_of",
    "poles",
    "reference_of",
    "sections",
    "springs_lose",
    "steady",
    "transient",
    "transient_work",
    "wait_of",
    "without_loss",
]
