from .field import Response, displacement, response
from .maps import DisplacementMap, displacement_map
from .scene import Scene, Work
from .synthesis import MOST_TIME_S, TransientWork, transient, transient_work

__all__ = [
    "MOST_TIME_S",
    "DisplacementMap",
    "Response",
    "Scene",
    "TransientWork",
    "Work",
    "displacement",
    "displacement_map",
    "response",
    "transient",
    "transient_work",
]
