from .converter import Converter, converter_device
from .core import DeviceCore
from .host import HostDriver
from .local import HostedCore, LocalCore
from .messages import (
    Arm,
    AskHealth,
    AskLimits,
    AskMeasured,
    Beat,
    CodeArray,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Ping,
    Query,
    Stop,
    full_scale,
    to_millivolts,
)
from .output import Emission, OutputStage
from .reports import TAPS, UNIT_AT, UNITS, About, DeviceLimits, Entropy, Health, Measurement
from .states import State
from .tokens import Exchange, Fate, Record, Reply

__all__ = [
    "TAPS",
    "UNITS",
    "UNIT_AT",
    "About",
    "Arm",
    "AskHealth",
    "AskLimits",
    "AskMeasured",
    "Beat",
    "CodeArray",
    "Converter",
    "DeviceCore",
    "DeviceLimits",
    "Disarm",
    "Emission",
    "Enable",
    "Entropy",
    "Exchange",
    "Fate",
    "Fire",
    "Health",
    "HostDriver",
    "HostedCore",
    "Levels",
    "LoadSlot",
    "LocalCore",
    "Measurement",
    "Message",
    "OutputStage",
    "Ping",
    "Query",
    "Record",
    "Reply",
    "State",
    "Stop",
    "converter_device",
    "full_scale",
    "to_millivolts",
]
