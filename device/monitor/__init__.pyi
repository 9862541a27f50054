from .inputs import Calibration, InputMonitor
from .measured import Measured, Monitor, Planned, Tap, Tolerances

__all__ = ["Calibration", "InputMonitor", "Measured", "Monitor", "Planned", "Tap", "Tolerances"]
