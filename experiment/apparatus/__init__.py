"""What stands beside the participant: device, clock, slots of the conditions, masking noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
