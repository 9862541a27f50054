"""Tables made elsewhere: the map that names their columns, and what it says of file and rows."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
