"""A session in progress: the effects of the trial engine carried out, begun or resumed."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
