from .actuator import LoadPerVolt, MeasuredDisplacement, PiezoLayers, load_per_volt
from .fingertip import Fingertip, causal, felt
from .level import WindowChoice, level_db, shortest_window

__all__ = [
    "Fingertip",
    "LoadPerVolt",
    "MeasuredDisplacement",
    "PiezoLayers",
    "WindowChoice",
    "causal",
    "felt",
    "level_db",
    "load_per_volt",
    "shortest_window",
]
