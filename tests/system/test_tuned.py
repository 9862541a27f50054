"""Linear algebra of small matrices runs on one thread, and memory is kept, whoever calls."""

from __future__ import annotations

import mmap
import os
import platform
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - its BLAS is there from the beginning
from threadpoolctl import ThreadpoolController, threadpool_limits

from analysis import compare_conditions, fit_group
from stimuli import (
    ALUMINIUM,
    CLAMPED,
    Burst,
    Fingertip,
    MomentDisc,
    Scene,
    Strip,
    displacement_map,
    felt,
    response,
    transient,
)
from stimuli.tuned import tuned

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

ROOT = Path(__file__).parents[2]
STRIP = Strip(width_m=0.025, thickness_m=5e-4, material=ALUMINIUM, edge=CLAMPED)
DISC = MomentDisc(x_m=0.0, y_m=0.0125, radius_m=0.006)
SCENE = Scene(strip=STRIP, loads=(DISC,), points_m=((0.0, 0.0125),))
BURST = Burst(frequency_hz=250.0, window="hann")
DETECTED, PRESENTED = np.array([[1, 4, 9], [2, 6, 10]]), np.full((2, 3), 10)
LEVELS_VPP = [30.0, 60.0, 120.0]


LIBRARIES = ThreadpoolController().select(user_api="blas")


def threads() -> set[int]:
    return {one["num_threads"] for one in LIBRARIES.info()}


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(sys.modules["stimuli.tuned"], "_began_alone", lambda: False)
    with threadpool_limits(2, user_api="blas"):
        assert threads() == {2}
        yield


@pytest.mark.usefixtures("two_threads")
def test_a_function_has_one_thread_and_leaves_as_many_as_there_were() -> None:
    assert tuned(threads)() == {1}
    assert threads() == {2}


@pytest.mark.usefixtures("two_threads")
def test_an_error_leaves_as_many_as_there_were() -> None:
    with pytest.raises(ValueError, match="rtol"):
        response(SCENE, [500.0], -1.0)
    assert threads() == {2}


@pytest.mark.usefixtures("two_threads")
@pytest.mark.parametrize(
    "call",
    [
        lambda: response(SCENE, [500.0]),
        lambda: displacement_map(STRIP, DISC, 500.0, x_m=[0.0, 0.01], y_m=[0.005]),
        lambda: felt(STRIP, [DISC], [Fingertip(x_m=0.0, y_m=0.0125)], BURST),
        lambda: transient(SCENE, BURST, [0.001]),
        lambda: fit_group(LEVELS_VPP, DETECTED, PRESENTED, guess_rate=0.02),
        lambda: compare_conditions(
            LEVELS_VPP, DETECTED, PRESENTED, DETECTED, PRESENTED, guess_rate=0.02
        ),
    ],
)
def test_what_a_script_calls_computes_tuned(
    call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: set[int] = set()
    for module, name in ((np, "exp"), (np, "zeros"), (np, "sqrt")):
        whole = getattr(module, name)

        def watched(*args: Any, whole: Any = whole, **kwargs: Any) -> Any:
            seen.update(threads())
            return whole(*args, **kwargs)

        monkeypatch.setattr(module, name, watched)
    call()
    monkeypatch.undo()
    assert seen == {1}
    assert threads() == {2}


ALONE = """
import sys
import numpy
import scipy
from stimuli.tuned import tuned
if sys.argv[1:]:
    numpy.show_config = lambda mode: {"Build Dependencies": {"blas": {"name": "mkl"}}}
tuned(int)()
print("threadpoolctl" in sys.modules)
"""


@pytest.mark.parametrize(
    ("threads", "more", "sought"), [("1", [], False), ("2", [], True), ("1", ["mkl"], True)]
)
def test_libraries_are_sought_unless_the_process_began_with_one_thread(
    threads: str, more: list[str], *, sought: bool
) -> None:
    asked = os.environ | {"OPENBLAS_NUM_THREADS": threads}
    command = [sys.executable, "-c", ALONE, *more]
    assert subprocess.check_output(command, env=asked, cwd=ROOT, text=True) == f"{sought}\n"


FAULTS = """
import resource
import sys
import numpy as np
from stimuli.tuned import keep_freed_memory
if sys.argv[2:]:
    keep_freed_memory()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
kept = []
for _ in range(100):
    kept.append(np.ones(390_000))
    del kept[: -int(sys.argv[1])]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
"""Arrays of 3 MB: too large for gaps that imports can leave in the heap, which would serve them
without a fault; smaller than those for which NumPy asks for huge pages."""


def faults(held: int, *more: str) -> int:
    """Count page faults of 100 arrays of which so many are held at a time."""
    asked = os.environ | {"MALLOC_TRIM_THRESHOLD_": "65536"}  # as Dask's nanny asks for
    command = [sys.executable, "-c", FAULTS, str(held), *more]
    return int(subprocess.check_output(command, env=asked, cwd=ROOT))


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library has no mallopt")
def test_arrays_are_not_fetched_from_the_system_again_and_again() -> None:
    again = faults(1)
    assert again > 20 * faults(1, "keep")
    assert again > 50_000  # 762 pages each time


GIVEN = """
import mmap
import resource
own = mmap.mmap(-1, 1 << 26, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
own.madvise(mmap.MADV_HUGEPAGE)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for place in range(0, len(own), mmap.PAGESIZE):
    own[place] = 1
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
"""64 MB, whose faults say whether there are large pages to be had just now."""
LARGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage/enabled")


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library has no mallopt")
@pytest.mark.skipif(
    not LARGE_PAGES.exists() or "[never]" in LARGE_PAGES.read_text(encoding="utf-8"),
    reason="this system gives no large pages",
)
def test_what_is_used_first_comes_in_large_pages() -> None:
    given = subprocess.check_output([sys.executable, "-c", GIVEN], cwd=ROOT)
    if int(given) > (1 << 26) / mmap.PAGESIZE / 4:
        pytest.skip("this system has no large pages free")
    assert faults(15, "keep") < 15 * 762 / 2  # 45 MB at the same time
