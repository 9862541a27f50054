"""What commands of a study have in common: how they reach a plate, a device, a person."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
