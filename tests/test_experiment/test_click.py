"""Clicks from files: every format means the same samples, and a fault is one line."""

from __future__ import annotations

import wave
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.io import wavfile

from experiment.study.click import read_click

if TYPE_CHECKING:
    from pathlib import Path

RATE_HZ = 48_000
SINE = np.concatenate([np.sin(2 * np.pi * np.arange(96) / 96), [0.0]])


def wav(folder: Path, samples: Any, rate_hz: int = RATE_HZ) -> Path:
    path = folder / "click.wav"
    wavfile.write(path, rate_hz, samples)
    return path


def text(folder: Path, content: str) -> Path:
    path = folder / "click.csv"
    path.write_text(content, encoding="utf-8")
    return path


def refusal(path: Path) -> str:
    with pytest.raises(ValueError, match=r"^.") as caught:
        read_click(path, RATE_HZ)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)
    return str(caught.value).removeprefix(f"{path}: ")


@pytest.mark.parametrize(
    ("samples", "digits"),
    [
        (np.round(SINE * 20_000).astype(np.int16), 4),
        (np.round(SINE * 2**30).astype(np.int32), 8),
        ((SINE * 0.3).astype(np.float32), 6),
        (SINE * 1e-5, 14),
    ],
)
def test_every_format_is_scaled_to_a_peak_of_1(
    tmp_path: Path, samples: np.ndarray[Any, Any], digits: int
) -> None:
    found = read_click(wav(tmp_path, samples), RATE_HZ)
    assert np.max(np.abs(found)) == 1.0
    assert found == pytest.approx(SINE, abs=10.0**-digits)


def test_text_with_times_or_without_means_the_same(tmp_path: Path) -> None:
    times = "".join(f"{k / RATE_HZ:.6f},{value!r}\n" for k, value in enumerate(SINE.tolist()))
    plain = "".join(f"{value!r}\n" for value in SINE.tolist())
    for content in (times, "time_s,value\n" + times, plain, "value\n" + plain):
        assert np.array_equal(read_click(text(tmp_path, content), RATE_HZ), SINE / SINE.max())


def test_a_click_that_does_not_begin_and_end_at_zero_gets_a_zero(tmp_path: Path) -> None:
    assert read_click(text(tmp_path, "1\n-1\n"), RATE_HZ).tolist() == [0.0, 1.0, -1.0, 0.0]
    assert read_click(text(tmp_path, "0\n2\n-1\n"), RATE_HZ).tolist() == [0.0, 1.0, -0.5, 0.0]


def test_another_sample_rate_is_refused_and_both_are_named(tmp_path: Path) -> None:
    message = refusal(wav(tmp_path, SINE.astype(np.float32), 44_100))
    assert message.endswith("device.sample_rate_hz = 48000; got 44100 Hz")
    times = "".join(f"{k / 44_100!r},{value!r}\n" for k, value in enumerate(SINE.tolist()))
    assert "48000; got 44100 Hz" in refusal(text(tmp_path, times))


@pytest.mark.parametrize(
    ("content", "part"),
    [
        ("", "1 to 1000000"),
        ("value\n", "1 to 1000000"),
        ("0\n0\n", "silence"),
        ("0\nnan\n", "finite samples"),
        ("0\ninf\n", "finite samples"),
        ("0\nx\n", "'x' to float64 at row 1"),
        ("0,0,0\n", "got 3"),
        ("0\n1,2\n", "from 1 to 2 at row 2"),
        ("0,1\n", "two"),
        ("0,1\n0,1\n", "got inf Hz"),
        ("time,value\n0,1\n", "time_s,value"),
    ],
)
def test_a_text_that_is_no_click_is_refused_in_one_line(
    tmp_path: Path, content: str, part: str
) -> None:
    assert part in refusal(text(tmp_path, content))


def test_stereo_bytes_and_other_files_are_refused(tmp_path: Path) -> None:
    stereo = np.zeros((10, 2), np.int16)
    assert refusal(wav(tmp_path, stereo)).endswith("; got 2")
    assert "got 8 bits" in refusal(wav(tmp_path, np.full(10, 128, np.uint8)))
    (tmp_path / "click.mp3").write_bytes(b"x")
    assert ".wav or .csv" in refusal(tmp_path / "click.mp3")
    assert refusal(tmp_path / "none.wav")
    assert "No such" in refusal(tmp_path / "none.csv")
    path = tmp_path / "click.wav"
    with wave.open(str(path), "wb") as file:  # of 24 bits, which are read
        file.setparams((1, 3, RATE_HZ, 0, "NONE", ""))
        for value in np.round(SINE * (2**23 - 1)):
            file.writeframes(int(value).to_bytes(3, "little", signed=True))
    assert read_click(path, RATE_HZ) == pytest.approx(SINE, abs=1e-6)


def test_a_torn_file_is_refused_wherever_it_is_torn(tmp_path: Path) -> None:
    path = wav(tmp_path, SINE.astype(np.float32))
    whole = path.read_bytes()
    for length in (*range(60), len(whole) - 1):
        path.write_bytes(whole[:length])
        refusal(path)
