"""The record of a study on disk: sessions, journals, participants, exports, withdrawals."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
