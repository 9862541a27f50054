"""What came out: every burst measured at a tap, matched against what was planned, and judged."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
