"""Bursts on a study's plate, compared with the edges that it states and with the other ideal."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
