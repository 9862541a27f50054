from .inputs import Calibration, InputMonitor
from .measured import Fault, Measured, Monitor, Planned, Tap, Tolerances
from .reported import ALSO_UNSEEN, DeviceMonitor

__all__ = [
    "ALSO_UNSEEN",
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
