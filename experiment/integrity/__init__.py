"""Whether the record of a session is what the session wrote: heads, tables, all of it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
