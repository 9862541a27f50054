from .channels import USUAL, Channel, LineSettings, open_channel, port_lack
from .endpoint import Endpoint
from .frames import MINOR, VERSION
from .link import FrameLink
from .serial import identify, serial_device

__all__ = [
    "MINOR",
    "USUAL",
    "VERSION",
    "Channel",
    "Endpoint",
    "FrameLink",
    "LineSettings",
    "identify",
    "open_channel",
    "port_lack",
    "serial_device",
]
