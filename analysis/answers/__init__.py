"""What was answered: trials that count, proportions, intervals, choices, effects of order."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
