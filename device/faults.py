"""What can go wrong on a line and behind it, drawn from a seed: for emulators and tests.

A script is a list of faults, `name=value` with commas between: ``drop=0.01,corrupt=0.01``.
"""

import math
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Final

import numpy as np

from device._checks import require_real

_SECONDS: Final = ("delay_s", "stall_s")


class Mishap(StrEnum):
    """What happens to the device as a whole.

    Examples
    --------
    >>> Mishap.RESET.value
    'reset'
    """

    NONE = "none"
    STALL = "stall"
    RESET = "reset"
    DISCONNECT = "disconnect"


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultScript:
    """How often what goes wrong.

    Parameters
    ----------
    drop, corrupt : float
        Probability for each byte, both ways.
    duplicate, delay : float
        Probability for each frame, both ways; a delayed frame comes up to `delay_s` late.
    stall, reset, disconnect : float
        Probability each time that something arrives at the device: it does nothing for up to
        `stall_s`, restarts, or loses the line.
    delay_s, stall_s : float
        Longest times.
    disconnect_at : float
        The line is lost once this many bytes have arrived at the device; infinite for never.

    Raises
    ------
    ValueError
        If a probability is not from 0 to 1, or a time or number is negative.

    Examples
    --------
    >>> FaultScript.parse("drop=0.01,delay=0.1").delay
    0.1
    """

    drop: float = 0.0
    corrupt: float = 0.0
    duplicate: float = 0.0
    delay: float = 0.0
    stall: float = 0.0
    reset: float = 0.0
    disconnect: float = 0.0
    delay_s: float = 0.05
    stall_s: float = 0.1
    disconnect_at: float = math.inf

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "disconnect_at" and value == math.inf:
                continue
            counted = field.name in (*_SECONDS, "disconnect_at")
            require_real(field.name, value, least=0.0, most=math.inf if counted else 1.0)

    @staticmethod
    def parse(text: str) -> "FaultScript":
        """Return the script that a text states; an empty one has no fault.

        Raises
        ------
        ValueError
            If a name is unknown or given twice, or a value is no number in its range.

        Examples
        --------
        >>> FaultScript.parse("drops=0.01")
        Traceback (most recent call last):
        ValueError: faults must be of drop, corrupt, duplicate, delay, stall, reset, disconnect,
        delay_s, stall_s, disconnect_at, each once as name=number; got 'drops=0.01'
        """
        known = [field.name for field in fields(FaultScript)]
        values: dict[str, float] = {}
        for part in filter(None, (part.strip() for part in text.split(","))):
            name, _, number = part.partition("=")
            try:
                value = float(number)
            except ValueError:
                value = math.nan
            if name not in known or name in values or math.isnan(value):
                raise ValueError(
                    f"faults must be of {', '.join(known)}, each once as name=number; got {part!r}"
                )
            values[name] = value
        return FaultScript(**values)


class Faults:
    """A script at work.

    Parameters
    ----------
    script : FaultScript
        How often what goes wrong.
    rng : numpy.random.Generator
        Where chance comes from.

    Examples
    --------
    >>> faults = Faults(FaultScript(drop=1.0), np.random.default_rng(1))
    >>> faults.passed(b"abc")
    [(0.0, b'')]
    """

    def __init__(self, script: FaultScript, rng: np.random.Generator) -> None:
        self._script = script
        self._rng = rng
        self._arrived = 0

    def passed(self, data: bytes) -> list[tuple[float, bytes]]:
        """Return what comes out of the line for a frame put into it: pieces and their delays."""
        script = self._script
        copies = 1 + (self._rng.random() < script.duplicate)
        pieces = []
        for _ in range(copies):
            late = self._rng.random() < script.delay
            delay_s = float(self._rng.random()) * script.delay_s if late else 0.0
            pieces.append((delay_s, self._damaged(data)))
        return pieces

    def arrived(self, count: int) -> Mishap:
        """Return what happens to the device when `count` bytes arrive."""
        self._arrived += count
        if self._arrived >= self._script.disconnect_at:
            self._arrived = -(2**62)
            return Mishap.DISCONNECT
        for mishap, probability in (
            (Mishap.RESET, self._script.reset),
            (Mishap.DISCONNECT, self._script.disconnect),
            (Mishap.STALL, self._script.stall),
        ):
            if self._rng.random() < probability:
                return mishap
        return Mishap.NONE

    def stall_s(self) -> float:
        """Return how long a stall lasts."""
        return float(self._rng.random()) * self._script.stall_s

    def _damaged(self, data: bytes) -> bytes:
        script = self._script
        if not (script.drop or script.corrupt):
            return data
        octets = np.frombuffer(data, dtype=np.uint8).copy()
        hit = self._rng.random(octets.size) < script.corrupt
        octets[hit] ^= self._rng.integers(1, 256, size=int(hit.sum()), dtype=np.uint8)
        return octets[self._rng.random(octets.size) >= script.drop].tobytes()
