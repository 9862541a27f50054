"""What rings after the corners of a slow burst: its parts, the shapes it has, its peaks."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
