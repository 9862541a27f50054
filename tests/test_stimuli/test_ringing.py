"""What rings after the corners of slow bursts: in few patterns, and not looked at in vain."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stimuli import ALUMINIUM, CLAMPED, Burst, Fingertip, MomentDisc, Scene, Strip, felt
from stimuli.fingers.fingertip import asked
from stimuli.motion.motion import motion_of
from stimuli.motion.peaks import peaks_of
from stimuli.motion.ringing import search
from stimuli.motion.ringing.patterns import watched_of
from stimuli.motion.section import repeated, sections

LOSSY = dataclasses.replace(ALUMINIUM, loss_factor=0.01)
BURST = Burst(frequency_hz=250.0, cycles=1, window="none")


def narrow(length_m: float, width_m: float = 0.005) -> Strip:
    return Strip(width_m=width_m, thickness_m=5e-4, length_m=length_m, material=LOSSY, edge=CLAMPED)


def pair(y_m: float, x_m: float = 0.02) -> tuple[list[MomentDisc], list[Fingertip]]:
    places = (-x_m, x_m)
    discs = [MomentDisc(x_m=x, y_m=y_m, radius_m=1e-3) for x in places]
    return discs, [Fingertip(x_m=x, y_m=y_m) for x in places]


def scene_of(strip: Strip, y_m: float) -> tuple[Scene, list[np.ndarray], float | None]:
    """Fingers on a plate, or on the shortest section of a longer one as an endless strip."""
    scene, places, _ = asked(strip, *pair(y_m), BURST)
    found, period_m = repeated(next(sections(scene)), scene)
    return found, places, period_m


@pytest.mark.parametrize("y_m", [0.0025, 0.0022])  # even across, and not
@pytest.mark.parametrize("length_m", [0.1, 1.0])  # with ends, and without: few modes, many points
def test_few_patterns_move_points_as_all_oscillators_do(y_m: float, length_m: float) -> None:
    scene, places, period_m = scene_of(narrow(length_m), y_m)
    motion = motion_of(scene, scene.strip.cutoff_hz(), 4.0, period_m=period_m)
    oscillators, lag_s = motion.oscillators, 1e-6
    watched = watched_of(motion, places, lag_s, with_error=True)
    pairs = [(place, load) for place in places for load in range(2)]
    for one, (place, load) in zip(watched, pairs, strict=True):
        weights, rest_m = oscillators.weights(load)[place], oscillators.rest_m[load, place]
        strengths = one.fields[0].strengths
        assert len(strengths) < len(place)
        size = np.abs(weights).max()
        np.testing.assert_allclose(one.rows @ strengths[:, :-1], weights, atol=1e-10 * size)
        lags = one.rows @ strengths[:, -1].real * lag_s
        np.testing.assert_allclose(lags, rest_m, atol=1e-10 * np.abs(rest_m).max())
        late = one.rows @ one.fields[1].strengths[:, :-1]
        np.testing.assert_allclose(late, weights * motion.late, atol=1e-10 * size)
        assert np.all(np.abs(weights).max(axis=0) <= (1 + 1e-9) * one.sizes[0, :-1])


@pytest.mark.slow
@pytest.mark.parametrize("window", ["none", "hann", "tukey"])
def test_what_is_not_looked_at_is_lower(window: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene, places, _ = scene_of(narrow(0.08), 0.0022)
    drive = dataclasses.replace(BURST, window=window)  # type: ignore[arg-type]
    motion = motion_of(scene, scene.strip.cutoff_hz(), 4.0)
    some, unsought = peaks_of(motion, places, drive, wait_s=1e-3), search.UNSOUGHT
    monkeypatch.setattr(search, "UNSOUGHT", 0.0)
    monkeypatch.setattr(search, "widened", lambda near: np.arange(near.size))
    every = peaks_of(motion, places, drive, wait_s=1e-3)
    loud = every.peak_m > unsought * every.peak_m.max(axis=0)
    np.testing.assert_allclose(some.peak_m[loud], every.peak_m[loud], rtol=1e-9)
    assert np.all(abs(some.peak_m - every.peak_m) <= some.error_m)


@pytest.mark.slow
def test_a_finger_that_hardly_moves_at_all_has_a_level() -> None:
    discs, tips = pair(0.0025, x_m=0.05)
    found = felt(narrow(0.2), discs, tips, dataclasses.replace(BURST, window="hann"))
    quiet = found[[0, 1], [1, 0]] / np.diag(found)
    assert np.all(quiet > 0)
    assert np.all(quiet < search.UNSOUGHT)
