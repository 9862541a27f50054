"""What is felt: the strip, its loads and its field, the burst and the check on the strip."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
