from .across import Span
from .endless import solved
from .ends import ResonanceError, faintness, reflected
from .guided import PI
from .leading import Grid, grid_nodes, over_frequency
from .source import Answered, Ends, Question, Source, far_clearance

__all__ = [
    "PI",
    "Answered",
    "Ends",
    "Grid",
    "Question",
    "ResonanceError",
    "Source",
    "Span",
    "faintness",
    "far_clearance",
    "grid_nodes",
    "over_frequency",
    "reflected",
    "solved",
]
