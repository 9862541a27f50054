"""The wire format of an own device, over serial ports and sockets: host's and device's end."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
