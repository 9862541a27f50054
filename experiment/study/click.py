"""A sampled drive from a file: a click as .wav or .csv, scaled so that its peak is 1."""

from __future__ import annotations

import io
import struct
import warnings
from typing import TYPE_CHECKING, Final

import numpy as np

from device.printing import escaped, shortened
from experiment.bounded import read_bounded

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray


MAX_SAMPLES: Final = 1_000_000
_MAX_BYTES: Final = 64_000_000
"""Of a file: as many samples in text, with their times."""
_HEADINGS: Final = ("time_s,value", "value")
_HEADING_BYTES: Final = 100
_RATE_RULE: Final = "must have the device's sample rate, device.sample_rate_hz = {:g}"
_OFF_GRID: Final = 0.1
"""Part of a sample by which a stated time may miss its place: times are rounded when written."""


def read_click(path: Path, sample_rate_hz: float) -> NDArray[np.float64]:
    """Read the samples of a drive, over their greatest absolute value.

    A .wav file (PCM of 16, 24 or 32 bits, or float; one channel) or a .csv file with the columns
    ``time_s,value``, or with one column of samples at the device's rate. Where it does not begin or
    end with 0, as the device needs it, one sample of 0 is put there. A ValueError begins with the
    file's name: no such file, of another sample rate, silent, or too long.
    """
    reader = {".wav": _read_wav, ".csv": _read_csv}.get(path.suffix.lower())
    try:
        if reader is None:
            raise ValueError(f"must be a .wav or .csv file; got {path.suffix!r}")
        return _scaled(reader(read_bounded(path, _MAX_BYTES), sample_rate_hz))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def _scaled(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    if not 1 <= samples.size <= MAX_SAMPLES:
        raise ValueError(f"must hold 1 to {MAX_SAMPLES} samples; got {samples.size}")
    if not np.all(np.isfinite(samples)):
        raise ValueError("must hold finite samples only")
    peak = float(np.max(np.abs(samples)))
    if peak == 0:
        raise ValueError("must hold a sample that is not 0; got silence")
    return np.pad(samples / peak, (int(samples[0] != 0), int(samples[-1] != 0)))


def _read_wav(content: bytes, sample_rate_hz: float) -> NDArray[np.float64]:
    from scipy.io import wavfile

    with warnings.catch_warnings():
        # chunks of text that the reader does not know are no fault of the samples, a torn end is
        warnings.simplefilter("ignore", wavfile.WavFileWarning)
        warnings.filterwarnings("error", "Reached EOF", wavfile.WavFileWarning)
        try:
            rate_hz, samples = wavfile.read(io.BytesIO(content))
        except (struct.error, EOFError, ArithmeticError, wavfile.WavFileWarning) as error:
            raise ValueError(f"must be a whole .wav file; {error}") from error
    if samples.ndim != 1:
        raise ValueError(f"must have one channel; got {samples.shape[1]}")
    if samples.dtype.kind not in "if":
        raise ValueError("must be PCM of 16, 24 or 32 bits or float; got 8 bits")
    if rate_hz != sample_rate_hz:
        raise ValueError(f"{_RATE_RULE.format(sample_rate_hz)}; got {rate_hz:g} Hz")
    return np.asarray(samples, dtype=np.float64)


def _read_csv(content: bytes, sample_rate_hz: float) -> NDArray[np.float64]:
    heading = content[:_HEADING_BYTES].decode("utf-8-sig", "replace").partition("\n")[0]
    stream = io.TextIOWrapper(io.BytesIO(content), encoding="utf-8-sig")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of a file without samples
        try:
            table = np.loadtxt(
                stream,
                delimiter=",",
                comments=None,
                ndmin=2,
                skiprows=int(heading.replace(" ", "").strip() in _HEADINGS),
                max_rows=MAX_SAMPLES + 1,
            )
        except ValueError as error:
            reason = shortened(escaped(error))
            rule = "must hold numbers, below a heading time_s,value if any"
            raise ValueError(f"{rule}; got {reason}") from error
    n_columns = table.shape[1]
    if n_columns > len(_HEADINGS):
        raise ValueError(f"must have the columns time_s,value or one of samples; got {n_columns}")
    if n_columns == len(_HEADINGS):
        _check_times(table[:, 0], sample_rate_hz)
    return np.asarray(table[:, -1])


def _check_times(times_s: NDArray[np.float64], sample_rate_hz: float) -> None:
    if times_s.size < 2 or not np.all(np.isfinite(times_s)):  # noqa: PLR2004 - a step needs two
        raise ValueError("must hold at least two finite times")
    steps = (times_s - times_s[0]) * sample_rate_hz
    if np.max(np.abs(steps - np.arange(times_s.size))) > _OFF_GRID:
        with np.errstate(divide="ignore"):
            rate_hz = sample_rate_hz * (times_s.size - 1) / max(steps[-1], 0.0)
        rule = _RATE_RULE.format(sample_rate_hz)
        raise ValueError(f"{rule}; got {rate_hz:g} Hz on average, in steps of one sample")
