"""Fields of many drawn strips: none has a NaN or a warning, and their errors are told."""

from __future__ import annotations

import dataclasses
import warnings

import numpy as np
import pytest

from stimuli import CLAMPED, SIMPLY_SUPPORTED, Burst, causal, transient_response
from tests.long.test_fuzz import rounds
from tests.test_stimuli.scenes import check_drawn_scene, drawn_scene
from tests.test_stimuli.test_values import check_told_errors


def test_no_scene_has_nan_or_a_warning() -> None:
    finite = [check_drawn_scene(seed) for seed in range(100, 100 + rounds(2000))]
    assert np.mean(finite) > 0.9


@pytest.mark.parametrize("window", ["none", "hann"])
def test_no_motion_has_nan_or_a_warning(window: str) -> None:
    """On strips of any kind; narrow or long ones follow a slow burst at once."""
    for seed in range(rounds(100)):
        rng = np.random.default_rng(seed)
        scene, _ = drawn_scene(rng)
        edge = (SIMPLY_SUPPORTED, CLAMPED, scene.strip.edge)[seed % 3]
        frequency_hz = scene.strip.cutoff_hz() * rng.uniform(0.05, 0.9)
        burst = Burst(frequency_hz=frequency_hz, cycles=1 + seed % 3, window=window)  # type: ignore[arg-type]
        strip = causal(dataclasses.replace(scene.strip, edge=edge), burst)
        times_s = np.linspace(-0.1, 2, 30) * burst.duration_s
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            moved = transient_response(dataclasses.replace(scene, strip=strip), burst, times_s)
        assert np.all(np.isfinite(moved.value)), seed
        assert np.all(moved.error[times_s > 0] > 0), seed


def test_errors_are_told_of_drawn_strips_at_and_beside_meetings() -> None:
    for seed in range(100, 100 + rounds(100)):
        check_told_errors(seed)
