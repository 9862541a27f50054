from .across import Span
from .endless import Waves, n_waves, solved, summed
from .guided import PI
from .leading import Grid, grid_nodes, over_frequency
from .source import LEAST_RTOL, Answered, Ends, Question, Source, far_clearance

__all__ = [
    "LEAST_RTOL",
    "PI",
    "Answered",
    "Ends",
    "Grid",
    "Question",
    "Source",
    "Span",
    "Waves",
    "far_clearance",
    "grid_nodes",
    "n_waves",
    "over_frequency",
    "solved",
    "summed",
]
