from .actuator import LoadPerVolt, MeasuredDisplacement, PiezoLayers, load_per_volt
from .fingertip import Fingertip, causal, felt, felt_error
from .impedance import Impedance
from .level import WindowChoice, level_db, shortest_window
from .work import FeltWork, felt_work

__all__ = [
    "FeltWork",
    "Fingertip",
    "Impedance",
    "LoadPerVolt",
    "MeasuredDisplacement",
    "PiezoLayers",
    "WindowChoice",
    "causal",
    "felt",
    "felt_error",
    "felt_work",
    "level_db",
    "load_per_volt",
    "shortest_window",
]
