"""Pink noise: its slope, its level, and that nobody can tell where the loop begins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from stimuli.drive.noise import LOWEST_HZ, crest_factor, pink_loop

RATE_HZ = 48_000.0
OCTAVE_DB = -10 * math.log10(2)


def loop_of(
    seed: int = 1, *, loop_s: float = 2.0, level_dbfs: float = -30.0, rate_hz: float = RATE_HZ
) -> NDArray[np.float64]:
    rng = np.random.default_rng(seed)
    return pink_loop(sample_rate_hz=rate_hz, loop_s=loop_s, level_dbfs=level_dbfs, rng=rng)


loops = st.builds(
    loop_of,
    st.integers(0, 2**32),
    loop_s=st.floats(1.0, 3.0),
    level_dbfs=st.floats(-70.0, -20.0),
    rate_hz=st.sampled_from([8e3, 11_025.0, 22_050.0, 48e3]),
)


@settings(max_examples=25)
@given(loop=loops)
def test_every_line_above_20_hz_is_3_0103_db_lower_an_octave_up(loop: NDArray[np.float64]) -> None:
    size = np.abs(np.fft.rfft(loop))
    lines = np.flatnonzero(size > 1e-6 * size.max())
    half = lines[2 * lines <= lines[-1]]
    assert np.array_equal(lines, np.arange(lines[0], lines[-1] + 1))
    np.testing.assert_allclose(20 * np.log10(size[2 * half] / size[half]), OCTAVE_DB, atol=1e-6)


@pytest.mark.parametrize("rate_hz", [8e3, 44.1e3, 48e3])
def test_the_lines_go_from_20_hz_to_half_the_rate(rate_hz: float) -> None:
    for loop_s in (1.0, 1.0 + 1 / rate_hz, 2.5):
        size = np.abs(np.fft.rfft(loop_of(loop_s=loop_s, rate_hz=rate_hz)))
        lines_hz = np.flatnonzero(size > 1e-6 * size.max()) / (round(loop_s * rate_hz) / rate_hz)
        assert LOWEST_HZ <= lines_hz[0] < LOWEST_HZ + 1 / loop_s
        assert rate_hz / 2 - 1.01 / loop_s <= lines_hz[-1] < rate_hz / 2


@pytest.mark.slow
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32), level_dbfs=st.floats(-70.0, -20.0), loop_s=st.floats(1.0, 3.0))
def test_its_rms_is_the_level_asked_for_about_no_mean(
    seed: int, level_dbfs: float, loop_s: float
) -> None:
    loop = loop_of(seed, loop_s=loop_s, level_dbfs=level_dbfs)
    assert 10 * np.log10(np.mean(loop**2)) == pytest.approx(level_dbfs, abs=1e-9)
    assert len(loop) == round(loop_s * RATE_HZ)
    assert abs(loop.mean()) < 1e-12 * np.abs(loop).max()


@pytest.mark.slow
@pytest.mark.parametrize("lag", [1, 2, 4])
def test_across_the_seam_it_correlates_as_anywhere_and_a_cut_piece_does_not(lag: int) -> None:
    loops = np.array([loop_of(seed, rate_hz=8e3) for seed in range(200)])
    pieces = loops[:, : loops.shape[1] // 2]
    anywhere = np.corrcoef(loops[:, :-lag].ravel(), loops[:, lag:].ravel())[0, 1]
    seam = np.corrcoef(loops[:, -1], loops[:, lag - 1])[0, 1]
    cut = np.corrcoef(pieces[:, -1], pieces[:, lag - 1])[0, 1]
    deviation = 1 / math.sqrt(len(loops) - 3)  # standard, of the arc tangents
    assert abs(np.arctanh(seam) - np.arctanh(anywhere)) < 3 * deviation
    assert abs(cut) < 3 * deviation < anywhere - 2 * deviation


def test_same_seed_same_noise_and_another_seed_another() -> None:
    assert np.array_equal(loop_of(5), loop_of(5))
    assert abs(np.corrcoef(loop_of(5), loop_of(6))[0, 1]) < 0.1


@pytest.mark.slow
@settings(max_examples=25)
@given(seed=st.integers(0, 2**32), level_dbfs=st.floats(-20.0, 0.0))
def test_a_level_is_refused_if_and_only_if_it_would_be_clipped(
    seed: int, level_dbfs: float
) -> None:
    most_dbfs = -20 * math.log10(crest_factor(loop_of(seed)))
    if level_dbfs > most_dbfs:
        with pytest.raises(ValueError, match=r"^level_dbfs .*-\d+\.\d+.* got -?\d"):
            loop_of(seed, level_dbfs=level_dbfs)
    else:
        assert np.abs(loop_of(seed, level_dbfs=level_dbfs)).max() <= 1.0


def test_the_crest_factor_is_that_of_gaussian_noise() -> None:
    crests = [crest_factor(loop_of(seed)) for seed in range(20)]
    gaussian = math.sqrt(2 * math.log(2 * RATE_HZ))
    assert np.mean(crests) == pytest.approx(gaussian, rel=0.1)
