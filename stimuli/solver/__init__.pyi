from .across import Span
from .endless import solved
from .ends import ResonanceError, faintness, reflected
from .guided import PI
from .source import Answered, Ends, Question, Source, far_clearance

__all__ = [
    "PI",
    "Answered",
    "Ends",
    "Question",
    "ResonanceError",
    "Source",
    "Span",
    "faintness",
    "far_clearance",
    "reflected",
    "solved",
]
