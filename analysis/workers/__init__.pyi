from .chunks import CHUNK_S, spread
from .cluster import connected
from .crew import StoppedError
from .kept import Kept, computed_in
from .memory import keep_freed_memory

__all__ = [
    "CHUNK_S",
    "Kept",
    "StoppedError",
    "computed_in",
    "connected",
    "keep_freed_memory",
    "spread",
]
