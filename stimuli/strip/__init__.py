"""The strip: its material, its edges, and the waves that it carries or cuts off."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
