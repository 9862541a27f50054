"""The device's own logic, without a line: messages, states, tokens, outputs; and its host."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
