from .parts import leaves_ringing
from .search import UNSOUGHT, ringing_peaks

__all__ = ["UNSOUGHT", "leaves_ringing", "ringing_peaks"]
