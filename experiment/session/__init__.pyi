from .conduct import begin, resume
from .run import run_session
from .setting import Ending, NobodyLooks, Setting, Sitting
from .simulate import SimulationError, simulate_study, simulated_responder

__all__ = [
    "Ending",
    "NobodyLooks",
    "Setting",
    "SimulationError",
    "Sitting",
    "begin",
    "resume",
    "run_session",
    "simulate_study",
    "simulated_responder",
]
