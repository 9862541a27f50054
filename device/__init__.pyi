from .clock import Clock, MonotonicClock, VirtualClock
from .core.converter import Converter, Played, converter_device
from .core.output import Emission, OutputStage
from .core.reports import Health, Measurement
from .core.states import State
from .driver import BurstDevice, Delivery, Identity, Outcome
from .drivers import DriverSettings, make_device
from .emulate.mock import MockDevice
from .errors import (
    DeviceError,
    LimitExceeded,
    LinkError,
    Refusal,
    RefusedError,
    Rejected,
    SettingError,
)
from .limits import Limits
from .wire.channels import LineSettings

__all__ = [
    "BurstDevice",
    "Clock",
    "Converter",
    "Delivery",
    "DeviceError",
    "DriverSettings",
    "Emission",
    "Health",
    "Identity",
    "LimitExceeded",
    "Limits",
    "LineSettings",
    "LinkError",
    "Measurement",
    "MockDevice",
    "MonotonicClock",
    "Outcome",
    "OutputStage",
    "Played",
    "Refusal",
    "RefusedError",
    "Rejected",
    "SettingError",
    "State",
    "VirtualClock",
    "converter_device",
    "make_device",
]
