"""A sampled drive from a file: a click as .wav or .csv, scaled so that its peak is 1."""

from __future__ import annotations

import csv
import math
import struct
import warnings
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


MOST_SAMPLES: Final = 1_000_000
_HEADINGS: Final = (["time_s", "value"], ["value"])
_OFF_GRID: Final = 0.1
"""Part of a sample by which a stated time may miss its place: times are rounded when written."""


def read_click(path: Path, sample_rate_hz: float) -> NDArray[np.float64]:
    """Read the samples of a drive, over their greatest absolute value.

    A .wav file (PCM of 16, 24 or 32 bits, or float; one channel) or a .csv file with the columns
    ``time_s,value``, or with one column of samples at the device's rate. Where it does not begin or
    end with 0, as the device needs it, one sample of 0 is put there. A ValueError begins with the
    file's name: no such file, of another sample rate, silent, or too long.
    """
    readers = {".wav": _read_wav, ".csv": _read_csv}
    reader = readers.get(path.suffix.lower())
    try:
        if reader is None:
            raise ValueError(f"must be a .wav or .csv file; got {path.suffix!r}")
        return _scaled(reader(path, sample_rate_hz))
    except OSError as error:
        raise ValueError(f"{path}: {error.strerror or error}") from error
    except (ValueError, csv.Error) as error:
        raise ValueError(f"{path}: {error}") from error


def _scaled(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    if not 1 <= samples.size <= MOST_SAMPLES:
        raise ValueError(f"must hold 1 to {MOST_SAMPLES} samples; got {samples.size}")
    if not np.all(np.isfinite(samples)):
        raise ValueError("must hold finite samples only")
    peak = float(np.max(np.abs(samples)))
    if peak == 0:
        raise ValueError("must hold a sample that is not 0; got silence")
    before, after = int(samples[0] != 0), int(samples[-1] != 0)
    return np.pad(samples / peak, (before, after))


def _read_wav(path: Path, sample_rate_hz: float) -> NDArray[np.float64]:
    from scipy.io import wavfile

    with warnings.catch_warnings():
        # chunks of text that the reader does not know are no fault of the samples, a torn end is
        warnings.simplefilter("ignore", wavfile.WavFileWarning)
        warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
        try:
            rate_hz, samples = wavfile.read(path)
        except (struct.error, EOFError, ArithmeticError, wavfile.WavFileWarning) as error:
            raise ValueError(f"must be a whole .wav file; {error}") from error
    if samples.ndim != 1:
        raise ValueError(f"must have one channel; got {samples.shape[1]}")
    if samples.dtype.kind not in "if":
        raise ValueError("must be PCM of 16, 24 or 32 bits or float; got 8 bits")
    if rate_hz != sample_rate_hz:
        raise ValueError(_rates(rate_hz, sample_rate_hz))
    return np.asarray(samples, dtype=np.float64)


def _rates(rate_hz: float, sample_rate_hz: float) -> str:
    return (
        f"must have the device's sample rate, device.sample_rate_hz = {sample_rate_hz:g}; "
        f"got {rate_hz:g} Hz"
    )


def _read_csv(path: Path, sample_rate_hz: float) -> NDArray[np.float64]:
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = [(number, row) for number, row in enumerate(csv.reader(file), start=1) if row]
    if rows and [cell.strip() for cell in rows[0][1]] in _HEADINGS:
        del rows[0]
    columns = len(rows[0][1]) if rows else 1
    if columns > len(_HEADINGS):
        raise ValueError(f"must have the columns time_s,value or one of samples; got {columns}")
    table = np.array([_numbers(line, row, columns) for line, row in rows]).reshape(-1, columns)
    if columns == len(_HEADINGS):
        _check_times(table[:, 0], sample_rate_hz)
    return table[:, -1]


def _numbers(line: int, row: list[str], columns: int) -> list[float]:
    told = ",".join(row)
    if len(row) != columns:
        raise ValueError(f"line {line} must have {columns} columns; got {told!r}")
    try:
        return [float(cell) for cell in row]
    except ValueError as error:
        raise ValueError(
            f"line {line} must hold numbers, below a heading time_s,value if any; got {told!r}"
        ) from error


def _check_times(times_s: NDArray[np.float64], sample_rate_hz: float) -> None:
    if times_s.size < 2 or not np.all(np.isfinite(times_s)):  # noqa: PLR2004 - a step needs two
        raise ValueError("must hold at least two finite times")
    off = (times_s - times_s[0]) * sample_rate_hz - np.arange(times_s.size)
    if np.max(np.abs(off)) <= _OFF_GRID:
        return
    span_s = float(times_s[-1] - times_s[0])
    rate_hz = (times_s.size - 1) / span_s if span_s > 0 else math.inf
    raise ValueError(_rates(rate_hz, sample_rate_hz) + " on average, in steps of one sample")
