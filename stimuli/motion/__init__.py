"""The plate over time as oscillators: its modes, each driven by the loads, and a static rest."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
