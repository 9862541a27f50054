from .channels import Channel, open_channel, port_lack
from .endpoint import Endpoint
from .frames import MINOR, VERSION
from .link import FrameLink
from .serial import identify, serial_device

__all__ = [
    "MINOR",
    "VERSION",
    "Channel",
    "Endpoint",
    "FrameLink",
    "identify",
    "open_channel",
    "port_lack",
    "serial_device",
]
