from .amplifier import Adc, Amplifier
from .emulator import SERIAL_NUMBER, Emulator, Nature, Truth
from .faults import Faults, FaultScript
from .generator import GeneratorEmulator
from .lines import Line, PtyLine, TcpLine
from .mock import DEVICE_LIMITS, MODEL, MockDevice

__all__ = [
    "DEVICE_LIMITS",
    "MODEL",
    "SERIAL_NUMBER",
    "Adc",
    "Amplifier",
    "Emulator",
    "FaultScript",
    "Faults",
    "GeneratorEmulator",
    "Line",
    "MockDevice",
    "Nature",
    "PtyLine",
    "TcpLine",
    "Truth",
]
