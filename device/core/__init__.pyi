from .converter import Converter, converter_device
from .core import DeviceCore
from .host import HostDriver
from .local import HostedCore, LocalCore
from .messages import (
    Arm,
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
    check_slot,
    full_scale,
)
from .output import Emission, OutputStage
from .states import State
from .tokens import Exchange, Fate, Record, Reply

__all__ = [
    "Arm",
    "Beat",
    "CodeArray",
    "Converter",
    "DeviceCore",
    "Disarm",
    "Emission",
    "Enable",
    "Exchange",
    "Fate",
    "Fire",
    "HostDriver",
    "HostedCore",
    "Levels",
    "LoadSlot",
    "LocalCore",
    "Message",
    "OutputStage",
    "Ping",
    "Query",
    "Record",
    "Reply",
    "State",
    "Stop",
    "check_slot",
    "converter_device",
    "full_scale",
]
