"""One thread for linear algebra: our matrices are small, and more threads wait for each other."""

from __future__ import annotations

from functools import cache, wraps
from typing import TYPE_CHECKING, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable

    from threadpoolctl import ThreadpoolController

Given = ParamSpec("Given")
Returned = TypeVar("Returned")


def on_one_thread(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """Have a function run with BLAS on one thread, and as many as before when it returns.

    On two processors a gain matrix took 2 to 15 times as much processor time with two threads, and
    no less time. The command line asks for one thread when it starts; a script or a notebook has
    imported numpy by the time that it calls us.
    """

    @wraps(function)
    def alone(*args: Given.args, **kwargs: Given.kwargs) -> Returned:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return alone


@cache
def _libraries() -> ThreadpoolController:
    import scipy.linalg  # noqa: F401 - scipy has a BLAS of its own, which must be there to be found
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
