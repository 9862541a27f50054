"""Linear algebra on one thread, and freed memory kept for what comes next.

Our matrices are small, so that more threads wait for each other; and arrays of some megabytes come
and go by the thousand, each of which the C library would give back to the system.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import sys
from contextlib import suppress
from functools import cache, wraps
from typing import TYPE_CHECKING, Final, ParamSpec, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from threadpoolctl import ThreadpoolController

Given = ParamSpec("Given")
Returned = TypeVar("Returned")

_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD = -1, -2, -3
"""Of glibc's mallopt."""
_DEFAULT_PAD_BYTES: Final = 1 << 17
_KEPT_BYTES: Final = 1 << 27
_GROWS_BYTES: Final = 1 << 26
_LARGEST_BYTES: Final = 1 << 23


def tuned(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """Have a function run with BLAS on one thread, and freed memory kept.

    On two processors a gain matrix took 2 to 15 times as much processor time with two threads, and
    no less time; when the function returns there are as many threads as before. The command line
    asks for one when it starts, so that nothing has to be sought then; a script or a notebook has
    imported numpy by the time that it calls us.
    """

    @wraps(function)
    def alone(*args: Given.args, **kwargs: Given.kwargs) -> Returned:
        keep_freed_memory()
        if _began_alone():
            return function(*args, **kwargs)
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return alone


@cache
def _began_alone() -> bool:
    """Tell whether the process was started with one thread, so that no library has to be sought.

    That takes as long as a fifth of a gain matrix. Other libraries than OpenBLAS do not obey its
    variable.
    """
    import scipy

    built = [one.show_config(mode="dicts")["Build Dependencies"]["blas"] for one in (np, scipy)]
    are_open = all("openblas" in one["name"] for one in built)
    return are_open and os.environ.get("OPENBLAS_NUM_THREADS") == "1"


@cache
def _libraries() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - scipy has a BLAS of its own, which must be there to be found
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


@cache
def keep_freed_memory() -> None:
    """Have the C library keep arrays of up to 8 MB that are freed, where it is glibc's.

    That holds for the whole process from then on: 128 MB may be kept at the end of its heap, and
    what lies below memory that is still in use. Otherwise such arrays are given back to the system
    and fetched again page by page: a seventh of the time of simulated studies and of many gain
    matrices, and half as much again in a Dask worker, whose nanny asks for it by a variable, which
    is overruled here.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            library = ctypes.CDLL(None)
            if library.mallopt(_MMAP_THRESHOLD, _LARGEST_BYTES):  # else it is too much for it
                library.mallopt(_TRIM_THRESHOLD, _KEPT_BYTES)
                _have_large_pages(library)


def _have_large_pages(library: ctypes.CDLL) -> None:
    """Let the heap grow by 64 MB of addresses, which the system may fill by 2 MB at a time.

    Nothing of it takes memory before it is used. Another twentieth of a gain matrix is spent on
    single pages otherwise.
    """
    address, size = ctypes.c_void_p, ctypes.c_size_t
    library.malloc.restype, library.malloc.argtypes = address, [size]
    library.free.restype, library.free.argtypes = None, [address]
    library.sbrk.restype, library.sbrk.argtypes = address, [ctypes.c_ssize_t]
    library.madvise.argtypes = [address, size, ctypes.c_int]
    begin: int = -(-library.sbrk(0) // mmap.PAGESIZE) * mmap.PAGESIZE
    library.mallopt(_TOP_PAD, _GROWS_BYTES)
    # more than imports have left free
    library.free(library.malloc(_LARGEST_BYTES - mmap.PAGESIZE))
    library.mallopt(_TOP_PAD, _DEFAULT_PAD_BYTES)
    if (end := library.sbrk(0)) > begin:
        library.madvise(begin, end - begin, mmap.MADV_HUGEPAGE)
