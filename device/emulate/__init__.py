"""Devices without actuators: the mock, and emulators on a pty or a port, with faults."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
