from .conduct import begin, completed, resume
from .markers import LslMarkers, Markers, NoMarkers, await_recorder
from .run import run_session
from .setting import Ending, NobodyLooks, Setting, Sitting
from .simulate import SimulationError, simulate_study, simulated_responder

__all__ = [
    "Ending",
    "LslMarkers",
    "Markers",
    "NoMarkers",
    "NobodyLooks",
    "Setting",
    "SimulationError",
    "Sitting",
    "await_recorder",
    "begin",
    "completed",
    "resume",
    "run_session",
    "simulate_study",
    "simulated_responder",
]
