from .inputs import Calibration, InputMonitor
from .measured import Fault, Measured, Monitor, Planned, Tap, Tolerances
from .reported import DeviceMonitor

__all__ = [
    "Calibration",
    "DeviceMonitor",
    "Fault",
    "InputMonitor",
    "Measured",
    "Monitor",
    "Planned",
    "Tap",
    "Tolerances",
]
