from .field import Response, at_rest, displacement, response
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
    "at_rest",
    "checked_times",
    "displacement",
    "displacement_map",
    "response",
    "synthesis_work",
    "synthesized",
]
