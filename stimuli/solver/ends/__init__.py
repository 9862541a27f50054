"""What free ends add to the field: waves turned back, fields fitted, singular corners."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
