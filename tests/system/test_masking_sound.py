"""Masking noise on real sound, heard through PulseAudio's null sink."""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import pytest

from device import MonotonicClock
from experiment import paper_study
from experiment.apparatus.noise import FADE_IN_S, NoiseError, SoundCardNoise, noise_player

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from tests.conftest import Run
    from tests.processes import NullSink

    Frames: TypeAlias = NDArray[np.int16]

PINK = replace(paper_study().masking, noise="pink", max_level_dba=75.0, loop_s=1.0)
RATE_HZ = 48_000


def machine_noise() -> SoundCardNoise:
    noise = noise_player(PINK, MonotonicClock(), simulated=False)
    assert isinstance(noise, SoundCardNoise)
    return noise


@pytest.fixture(scope="module")
def heard(null_sink: NullSink) -> Frames:
    """Three seconds of noise after the fade-in and what came before, of the left channel."""
    for _ in range(3):
        null_sink.listen()
        noise = machine_noise()
        noise.start()
        MonotonicClock().wait(3.0)
        healthy = noise.health().ok
        noise.stop()
        if healthy:
            break
    recorded = null_sink.recorded()
    left: Frames = recorded[:, 0]
    assert np.array_equal(left, recorded[:, 1])
    first, *_, last = np.flatnonzero(left)
    return left[first : last + 1]


def steady(heard: Frames) -> Frames:
    """Two and a half seconds in which the noise has its full level."""
    fade = round(FADE_IN_S * RATE_HZ)
    return heard[fade : fade + 5 * RATE_HZ // 2]


def test_its_density_falls_by_3_01_db_an_octave_from_50_hz_to_8_khz(heard: Frames) -> None:
    samples = steady(heard)[: 2 * RATE_HZ] / 32_768
    power = np.abs(np.fft.rfft(samples)) ** 2
    edges_hz = 50.0 * 2 ** np.linspace(0, np.log2(160), 23)
    places = np.round(edges_hz * 2).astype(int)
    density = [power[a:b].mean() for a, b in pairwise(places)]
    middles = np.log2(np.sqrt(edges_hz[:-1] * edges_hz[1:]))
    slope_db, level_db = np.polyfit(middles, 10 * np.log10(density), 1)

    assert slope_db == pytest.approx(-3.01, abs=0.15)
    assert np.abs(10 * np.log10(density) - slope_db * middles - level_db).max() < 0.3


def test_it_has_no_gap_longer_than_one_sample(heard: Frames) -> None:
    samples = steady(heard)
    changes = np.flatnonzero(np.diff(samples, prepend=samples[0] - 1, append=samples[-1] - 1))
    nothing = np.flatnonzero(np.diff(np.flatnonzero(samples)) > 2)
    assert np.diff(changes).max() <= 3
    assert len(nothing) == 0
    assert np.array_equal(samples[RATE_HZ:], samples[:-RATE_HZ])


def test_every_window_of_it_correlates_with_the_loop_at_one_lag_the_seam_too(heard: Frames) -> None:
    samples = steady(heard).astype(float)
    loop = machine_noise()._loop.astype(float)
    width = 512
    seams, lags = 0, set()
    for start in range(0, len(samples) - width, width // 2):
        window = samples[start : start + width]
        wanted = np.zeros(len(loop))
        wanted[:width] = window
        products = np.fft.irfft(np.fft.rfft(loop) * np.conj(np.fft.rfft(wanted)), n=len(loop))
        place = int(np.argmax(products))
        match = np.resize(np.roll(loop, -place), width)
        assert np.corrcoef(window, match)[0, 1] > 0.9999
        lags.add((place - start) % len(loop))
        seams += width // 4 <= len(loop) - place <= 3 * width // 4
    assert len(lags) == 1
    assert seams >= 2


def test_over_its_seam_it_correlates_with_itself_as_anywhere(heard: Frames) -> None:
    samples = steady(heard).astype(float)
    first = machine_noise()._loop[:64].astype(float)
    seam = next(k for k in range(256, RATE_HZ + 256) if np.array_equal(samples[k : k + 64], first))
    places = np.append(seam, np.arange(256, 2 * RATE_HZ, 101))
    for lag in (1, 2, 4, 8):
        pairs = [(samples[k - lag - 64 : k + 64 - lag], samples[k - 64 : k + 64]) for k in places]
        here, *elsewhere = (np.arctanh(np.corrcoef(*pair)[0, 1]) for pair in pairs)
        assert abs(here - np.mean(elsewhere)) < 3 * np.std(elsewhere)


def test_it_fades_in_over_one_second_from_nothing(heard: Frames) -> None:
    block = RATE_HZ // 20
    soft, full = heard[: 2 * RATE_HZ].astype(float).reshape(2, -1, block)
    gain = np.sum(soft * full, axis=1) / np.sum(full**2, axis=1)
    wanted = np.sin(np.pi / 2 * (np.arange(20) + 0.5) / 20) ** 2
    assert np.all(np.diff(gain) > 0)
    assert gain[0] < 0.01
    assert np.abs(gain - wanted).max() < 0.03


def until_not_ok(noise: SoundCardNoise) -> float:
    """Return how long it took that the health was bad, in seconds."""
    began_s = time.monotonic()
    while noise.health().ok and time.monotonic() < began_s + 5.0:
        time.sleep(0.01)
    return time.monotonic() - began_s


def ways_to_lose(sink: NullSink) -> dict[str, Callable[[], object]]:
    return {
        "killed": sink.kill,
        "hanging": lambda: sink.freeze(on=True),
        "unloaded": lambda: sink.control("unload-module", "module-null-sink"),
        "suspended": lambda: sink.control("suspend-sink", "plate", "1"),
    }


@pytest.fixture
def started(null_sink: NullSink) -> Iterator[SoundCardNoise]:
    """Noise on the null sink; afterwards there is a fresh server."""
    noise = machine_noise()
    noise.start()
    yield noise
    noise.stop()
    null_sink.kill()
    null_sink.start()


@pytest.mark.parametrize("way", ["killed", "hanging", "unloaded", "suspended"])
def test_a_loss_is_found_within_half_a_second_and_the_noise_comes_back(
    null_sink: NullSink, started: SoundCardNoise, way: str
) -> None:
    started.health()
    ways_to_lose(null_sink)[way]()
    assert until_not_ok(started) < 0.5
    null_sink.freeze(on=False)
    null_sink.kill()
    with pytest.raises(NoiseError):
        started.start()
    assert started.health().ok is False
    null_sink.start()
    null_sink.listen()
    started.start()
    assert started.health().ok is True
    assert null_sink.until(lambda: bool(np.abs(null_sink.recorded()).max(initial=0) > 500))


def test_a_check_plays_it_alone(null_sink: NullSink, tmp_path: Path, run: Run) -> None:
    study = tmp_path / "study.toml"
    study.write_text(
        '[masking]\nnoise = "pink"\nmax_level_dba = 75\nloop_s = 1.0\n', encoding="utf-8"
    )
    null_sink.listen()
    done = run("check", study, "--noise", "1")
    assert done.exit_code == 0, done.stderr
    assert np.count_nonzero(null_sink.recorded()[:, 0]) > 0.5 * RATE_HZ
