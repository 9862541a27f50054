"""How the equations of a strip are solved: one load at one frequency, endless or with ends."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
