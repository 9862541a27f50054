"""Freed memory that stays with a process, for work that is made of arrays of some megabytes."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress
from functools import cache
from typing import Final

_TRIM_THRESHOLD: Final = -1
_MMAP_THRESHOLD: Final = -3
_KEPT_BYTES: Final = 1 << 26
_LARGEST_BYTES: Final = 1 << 25


@cache
def keep_freed_memory() -> None:
    """Have the C library keep what is freed, up to 64 MB, where it is glibc's.

    Otherwise it gives arrays back to the system and fetches them again page by page: a seventh of
    the time of simulated studies, and half as much again in a Dask worker, whose nanny asks for it.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)
            library.mallopt(_MMAP_THRESHOLD, _LARGEST_BYTES)
            library.mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)
