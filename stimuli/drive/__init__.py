"""What drives a load over time: bursts, samples, noise; and whether a strip is fit for it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
