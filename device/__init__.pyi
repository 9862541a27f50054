from .clock import Clock, MonotonicClock, VirtualClock
from .core.output import Emission, OutputStage
from .driver import (
    BurstDevice,
    Delivery,
    DeviceError,
    Identity,
    LimitExceeded,
    LinkError,
    Outcome,
    Refusal,
    Rejected,
    StateError,
)
from .drivers import make_device
from .emulate.mock import MockDevice
from .limits import Limits

__all__ = [
    "BurstDevice",
    "Clock",
    "Delivery",
    "DeviceError",
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
    "make_device",
]
