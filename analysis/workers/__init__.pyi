from .chunks import CHUNK_S, spread
from .cluster import connected
from .crew import StoppedError
from .kept import Kept, computed_in

__all__ = [
    "CHUNK_S",
    "Kept",
    "StoppedError",
    "computed_in",
    "connected",
    "spread",
]
