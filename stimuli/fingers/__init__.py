"""What the fingertips get: actuators, contact areas, the level at the other finger."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
