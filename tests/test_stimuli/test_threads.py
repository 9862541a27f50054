"""Linear algebra of small matrices runs on one thread, whoever calls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - its BLAS is there from the beginning
from threadpoolctl import ThreadpoolController, threadpool_limits

from analysis.groups.group import compare_conditions, fit_group
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
from stimuli.threads import on_one_thread

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

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
def two_threads() -> Iterator[None]:
    with threadpool_limits(2, user_api="blas"):
        assert threads() == {2}
        yield


@pytest.mark.usefixtures("two_threads")
def test_a_function_has_one_thread_and_leaves_as_many_as_there_were() -> None:
    assert on_one_thread(threads)() == {1}
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
def test_what_a_script_calls_computes_on_one_thread(
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
