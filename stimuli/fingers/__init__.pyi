from .actuator import LoadPerVolt, MeasuredDisplacement, PiezoLayers, load_per_volt
from .fingertip import Fingertip, causal, felt
from .impedance import Impedance
from .level import WindowChoice, level_db, shortest_window
from .mirrored import to_the_right
from .work import Felt, FeltWork, felt_known, felt_work

__all__ = [
    "Felt",
    "FeltWork",
    "Fingertip",
    "Impedance",
    "LoadPerVolt",
    "MeasuredDisplacement",
    "PiezoLayers",
    "WindowChoice",
    "causal",
    "felt",
    "felt_known",
    "felt_work",
    "level_db",
    "load_per_volt",
    "shortest_window",
    "to_the_right",
]
