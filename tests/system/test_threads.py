"""Linear algebra of small matrices runs on one thread, whoever calls."""

from __future__ import annotations

import os
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
from stimuli.threads import single_threaded

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


def thread_counts() -> set[int]:
    return {library["num_threads"] for library in LIBRARIES.info()}


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    threads = sys.modules["stimuli.threads"]
    monkeypatch.setattr(threads, "_began_with_one_thread", lambda: False)
    with threadpool_limits(2, user_api="blas"):
        assert thread_counts() == {2}
        yield


@pytest.mark.usefixtures("two_threads")
def test_a_function_has_one_thread_and_leaves_as_many_as_there_were() -> None:
    assert single_threaded(thread_counts)() == {1}
    assert thread_counts() == {2}


@pytest.mark.usefixtures("two_threads")
def test_an_error_leaves_as_many_as_there_were() -> None:
    with pytest.raises(ValueError, match="rtol"):
        response(SCENE, [500.0], -1.0)
    assert thread_counts() == {2}


@pytest.mark.usefixtures("two_threads")
@pytest.mark.parametrize(
    "call",
    [
        lambda: response(SCENE, [500.0]),
        lambda: displacement_map(STRIP, [DISC], 500.0, x_m=[0.0, 0.01], y_m=[0.005]),
        lambda: felt(STRIP, [DISC], [Fingertip(x_m=0.0, y_m=0.0125)], BURST),
        lambda: transient(SCENE, BURST, [0.001]),
        lambda: fit_group(LEVELS_VPP, DETECTED, PRESENTED, guess_rate=0.02),
        lambda: compare_conditions(
            LEVELS_VPP, DETECTED, PRESENTED, DETECTED, PRESENTED, guess_rate=0.02
        ),
    ],
)
def test_what_a_script_calls_has_one_thread(
    call: Callable[[], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The numbers of threads are read where numerical work goes on."""
    seen: set[int] = set()
    for module, name in ((np, "exp"), (np.linalg, "solve"), (np, "sqrt"), (np, "einsum")):
        whole = getattr(module, name)

        def watched(*args: Any, whole: Any = whole, **kwargs: Any) -> Any:
            seen.update(thread_counts())
            return whole(*args, **kwargs)

        monkeypatch.setattr(module, name, watched)
    call()
    monkeypatch.undo()
    assert seen == {1}
    assert thread_counts() == {2}


ALONE = """
import sys
import numpy
import scipy
from stimuli.threads import single_threaded
if sys.argv[1:]:
    numpy.show_config = lambda mode: {"Build Dependencies": {"blas": {"name": "mkl"}}}
single_threaded(int)()
print("threadpoolctl" in sys.modules)
"""


@pytest.mark.parametrize(
    ("threads", "more", "sought"), [("1", [], False), ("2", [], True), ("1", ["mkl"], True)]
)
def test_libraries_are_sought_unless_the_process_began_with_one_thread(
    threads: str, more: list[str], *, sought: bool
) -> None:
    environment = os.environ | {"OPENBLAS_NUM_THREADS": threads}
    command = [sys.executable, "-c", ALONE, *more]
    output = subprocess.check_output(command, env=environment, cwd=ROOT, text=True)
    assert output == f"{sought}\n"
