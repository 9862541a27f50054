from .clock import Clock, MonotonicClock, VirtualClock
from .core.converter import Converter, converter_device
from .core.output import Emission, OutputStage
from .driver import BurstDevice, Delivery, Identity, Outcome
from .drivers import DriverSettings, make_device
from .emulate.mock import MockDevice
from .errors import DeviceError, LimitExceeded, LinkError, Refusal, Rejected, StateError
from .limits import Limits

__all__ = [
    "BurstDevice",
    "Clock",
    "Converter",
    "Delivery",
    "DeviceError",
    "DriverSettings",
    "Emission",
    "Identity",
    "LimitExceeded",
    "Limits",
    "LinkError",
    "MockDevice",
    "MonotonicClock",
    "Outcome",
    "OutputStage",
    "Refusal",
    "Rejected",
    "StateError",
    "VirtualClock",
    "converter_device",
    "make_device",
]
