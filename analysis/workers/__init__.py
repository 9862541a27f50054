"""Work in chunks: spread over processes or a Dask cluster, and kept in a file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
