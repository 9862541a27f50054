"""Linear algebra on one thread: our matrices are small, and threads would wait for each other."""

from __future__ import annotations

import os
from functools import cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from threadpoolctl import ThreadpoolController

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def single_threaded(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Have a function run with BLAS on one thread.

    On two processors a gain matrix took 2 to 15 times as much processor time with two threads, and
    no less time. When the function returns the number of threads is restored. The command line
    starts with one thread; a script or a notebook has imported numpy by the time that it calls us.
    """

    @wraps(function)
    def limited(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        if _began_with_one_thread():
            return function(*args, **kwargs)
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


@cache
def _began_with_one_thread() -> bool:
    """Return whether the process was started with one thread.

    To find the libraries takes as long as a fifth of a gain matrix. Others than OpenBLAS do not
    obey its variable.
    """
    import scipy

    blas = [
        library.show_config(mode="dicts")["Build Dependencies"]["blas"] for library in (np, scipy)
    ]
    is_openblas = all("openblas" in build["name"] for build in blas)
    return is_openblas and os.environ.get("OPENBLAS_NUM_THREADS") == "1"


@cache
def _libraries() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - scipy has a BLAS of its own, which must be there to be found
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
