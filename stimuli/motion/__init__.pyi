from .history import by_spectra, frames_of, transient, transient_work
from .modes import AboveFirstModeError, refuse_above_first_mode
from .motion import (
    Bare,
    Motion,
    bare_of,
    enough_of,
    is_enough,
    motion_of,
    motions,
    multiples_of,
    reference_of,
    springs_lose,
    steady,
    without_loss,
)
from .multiples import Upwards, first_known, upwards
from .oscillators import Oscillators, swung
from .peaks import (
    TOO_MANY_FOR_PATCHES,
    PatchesUnknownError,
    Peaks,
    patched_peaks,
    peaks_of,
    wait_of,
)
from .section import ECHOED, echoless, repeated, sections

__all__ = [
    "ECHOED",
    "TOO_MANY_FOR_PATCHES",
    "AboveFirstModeError",
    "Bare",
    "Motion",
    "Oscillators",
    "PatchesUnknownError",
    "Peaks",
    "Upwards",
    "bare_of",
    "by_spectra",
    "echoless",
    "enough_of",
    "first_known",
    "frames_of",
    "is_enough",
    "motion_of",
    "motions",
    "multiples_of",
    "patched_peaks",
    "peaks_of",
    "reference_of",
    "refuse_above_first_mode",
    "repeated",
    "sections",
    "springs_lose",
    "steady",
    "swung",
    "transient",
    "transient_work",
    "upwards",
    "wait_of",
    "without_loss",
]
