from .conduct import begin, resume
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
    "simulate_study",
    "simulated_responder",
]
