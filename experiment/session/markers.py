"""Markers for other recordings, EEG or MEG, over the Lab Streaming Layer.

A marker has the time at which something happened, not that at which it was sent: it is sent when
the answer is in, for nothing may be done between a stimulus and its answer.
"""

from __future__ import annotations

import math
import os
import select
import sys
import time
from typing import TYPE_CHECKING, Any, Final

from device.driver import installing
from experiment.participant.keys import clock_offset_s

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import Delivery
    from experiment.trial.events import Attempt

RECORDING_START: Final = "recording_start"
"""Sent in each visit before its first trial, and kept, once it is surely heard.

Onsets of a BIDS data set are counted from the first.
"""
STREAM: Final = "tactstrip"
STREAM_TEXT: Final = f"LSL stream {STREAM}"
MAX_WAIT_S: Final = 10.0
"""Longest wait for a recorder if no operator can end it."""
_LOOK_EVERY_S: Final = 0.1
UNHEARD: Final = f"no program records the {STREAM_TEXT}: connect the recorder"


class MarkerError(ValueError):
    """Markers cannot be sent here; what to do about it in one line."""


class LslMarkers:
    """An outlet of the Lab Streaming Layer: one channel of text, type Markers.

    The clock's reading is put on LSL's own clock, which on one machine is the same but for a
    constant.
    """

    def __init__(self, clock: Clock, *, participant: str, session: str) -> None:
        try:
            import pylsl
        except (ImportError, RuntimeError) as error:  # pylsl, or the liblsl that it needs
            raise MarkerError(
                f"--lsl needs pylsl: {installing('lsl')}; got {str(error).splitlines()[0]}"
            ) from error
        source = f"{STREAM}-sub-{participant}-ses-{session}"
        info = pylsl.StreamInfo(STREAM, "Markers", 1, pylsl.IRREGULAR_RATE, "string", source)
        self._outlet: Any = pylsl.StreamOutlet(info)
        self._ahead_s = clock_offset_s(clock, pylsl.local_clock)
        versions = f"pylsl {pylsl.__version__}, liblsl {pylsl.library_version()}"
        self.description = f"{STREAM_TEXT}, {versions}"

    def heard(self) -> bool:
        """Return whether a recorder is connected; it receives no earlier marker."""
        return bool(self._outlet.have_consumers())

    def send(self, marker: str, time_s: float) -> None:
        """Send a marker for a time on the session's clock, also one that is past."""
        self._outlet.push_sample([marker], time_s - self._ahead_s)


def await_recorder(markers: LslMarkers, report: Callable[[str], object], *, asking: bool) -> None:
    """Give the operator time to connect a recorder to the new stream.

    With `asking`, the wait on a terminal lasts until Enter is pressed.
    """
    if markers.heard():
        return
    asking = asking and os.name == "posix" and sys.stdin.isatty()
    without = "press Enter to continue without" if asking else f"wait {MAX_WAIT_S:g} s"
    report(f"Waiting for a recorder of the {STREAM_TEXT}: connect it now, or {without}.")
    until_s = math.inf if asking else time.monotonic() + MAX_WAIT_S
    while not markers.heard() and time.monotonic() < until_s:
        if not asking:
            time.sleep(_LOOK_EVERY_S)
        elif select.select([sys.stdin], [], [], _LOOK_EVERY_S)[0]:
            sys.stdin.readline()
            break
    if markers.heard():
        report(f"The {STREAM_TEXT} is recorded.")
        return
    report(
        f"Note: no program records the {STREAM_TEXT}. {RECORDING_START} is sent before the first "
        "trial at which one does; it does not receive earlier markers."
    )


def stimulus_marker(attempt: Attempt, interval: int, delivery: Delivery) -> str:
    """Return what is sent for a stimulus: words with slashes, by which programs select events.

    It reads ``stimulus/main/single/left/120Vpp/trial12/attempt1/interval1``.
    """
    level_vpp = max(delivery.levels_vpp, default=0.0)
    trial = attempt.trial
    return (
        f"stimulus/{trial.condition}/{trial.kind}/{trial.side}/{level_vpp:g}Vpp/"
        f"trial{trial.number}/attempt{attempt.number}/interval{interval}"
    )


def response_marker(attempt: Attempt, response: str) -> str:
    """Return what is sent for an answer."""
    return f"response/{response}/trial{attempt.trial.number}/attempt{attempt.number}"
