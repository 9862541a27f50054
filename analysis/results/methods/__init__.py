"""What an author pastes into a section of methods: the task, the fits and how well they fit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
