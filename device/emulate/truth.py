"""What a device that is emulated really did, as JSON lines that no host can touch."""

from __future__ import annotations

import base64
import json
import zlib
from typing import IO, TYPE_CHECKING, Final

import numpy as np

from device.core.states import State

if TYPE_CHECKING:
    from device.core.output import Emission

_QUIET: Final = (State.IDLE, State.LOADED, State.SAFE)


class Truth:
    """A truth file.

    A burst stands in it from its onset, before any answer tells of it; one that was cut short gets
    a line of its own for that.

    With `volts` each burst carries its samples: volts as base64 of little-endian float64, left then
    right.

    >>> import sys
    >>> Truth(sys.stdout).note(0.5, "boot", boot_id=7)
    {"event": "boot", "t_s": 0.5, "boot_id": 7}
    """

    def __init__(self, file: IO[str], *, volts: bool = False) -> None:
        self._file = file
        self._volts = volts
        self._was = State.IDLE
        self._token = 0

    def note(self, t_s: float, event: str, **facts: object) -> None:
        """Write an event down."""
        self._file.write(json.dumps({"event": event, "t_s": t_s} | facts) + "\n")
        self._file.flush()

    def note_state(self, t_s: float, state: State, cause: str) -> None:
        """Write down when the output goes on or off, and why; the watchdog has its own line too."""
        off = state in _QUIET
        if off != (self._was in _QUIET):
            if off and cause == "watchdog":
                self.note(t_s, "watchdog")
            self.note(t_s, "off" if off else "on", cause=cause)
        self._was = state

    def note_burst(self, burst: Emission) -> None:
        """Write a burst down once: at its onset; and again if it was cut short later."""
        if burst.token != self._token:
            self._token = burst.token
            self._note_burst(burst)
        if burst.cut_us is not None:
            self.note(burst.cut_us / 1e6, "cut", token=burst.token)

    def _note_burst(self, burst: Emission) -> None:
        rows = burst.left_v, burst.right_v
        volts = np.stack(rows).astype("<f8").tobytes()
        levels_vpp = burst.level_left_vpp, burst.level_right_vpp
        self.note(
            burst.start_us / 1e6,
            "burst",
            token=burst.token,
            channels=[int(np.any(row)) for row in rows],
            levels_mv=[round(level_vpp * 1000) for level_vpp in levels_vpp],
            peak_v=[float(np.abs(row).max(initial=0.0)) for row in rows],
            crc=zlib.crc32(volts),
            **({"volts": base64.b64encode(volts).decode()} if self._volts else {}),
        )
