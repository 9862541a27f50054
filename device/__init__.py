"""What drives the actuators: the driver protocol, its limits and the mock device."""

from device.clock import Clock, MonotonicClock, VirtualClock
from device.driver import (
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
from device.limits import Limits
from device.mock import MockDevice
from device.output import Emission, OutputStage

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
]
