"""What drives the actuators: the driver protocol, its limits, the mock and the emulators."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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

# Imported on first use: the command line must not pay for numpy to show its help.
_HOMES = {
    "Clock": "clock",
    "Emission": "output",
    "Limits": "limits",
    "MockDevice": "mock",
    "MonotonicClock": "clock",
    "OutputStage": "output",
    "VirtualClock": "clock",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module that defines it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES.get(name, 'driver')}"), name)
