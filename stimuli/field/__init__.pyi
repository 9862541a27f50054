from .field import Response, displacement, response
from .maps import DisplacementMap, displacement_map
from .scene import Scene, Work
from .synthesis import MOST_TIME_S, TransientWork, checked_times, synthesis_work, synthesized

__all__ = [
    "MOST_TIME_S",
    "DisplacementMap",
    "Response",
    "Scene",
    "TransientWork",
    "Work",
    "checked_times",
    "displacement",
    "displacement_map",
    "response",
    "synthesis_work",
    "synthesized",
]
