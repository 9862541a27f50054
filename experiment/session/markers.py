"""Markers for other recordings, EEG or MEG, over the Lab Streaming Layer.

A marker has the time at which something happened, not that at which it was sent: it is sent when
the answer is in, for nothing may be done between a stimulus and its answer.
"""

from __future__ import annotations

import os
import select
import sys
import time
from typing import TYPE_CHECKING, Any, Final, Protocol

from device.driver import installing

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import Delivery
    from experiment.trial.events import Task

RECORDING_START: Final = "recording_start"
"""Sent in each sitting before its first trial, and kept, once it is surely heard.

Onsets of a BIDS data set are counted from the first.
"""
STREAM: Final = "tactstrip"
WORDS: Final = f"LSL stream {STREAM}"
LONGEST_S: Final = 10.0
"""So long a recorder is waited for where nobody can say that it is to go on."""
_LOOK_EVERY_S: Final = 0.1
UNHEARD: Final = f"nobody records the {WORDS}: connect the recorder"


class MarkerError(ValueError):
    """Markers cannot be sent here; what to do about it in one line."""


class Markers(Protocol):
    """Where markers go."""

    @property
    def words(self) -> str | None:
        """What sends them, for the record; none where nothing does."""

    def heard(self) -> bool:
        """Tell whether somebody listens: a marker reaches only those who were connected before."""

    def send(self, marker: str, time_s: float) -> None:
        """Send a marker for a time on the session's clock."""


class NoMarkers:
    """Sends none."""

    words = None

    def heard(self) -> bool:
        """Nobody listens."""
        return False

    def send(self, marker: str, time_s: float) -> None:
        """Send nothing."""


class LslMarkers:
    """An outlet of the Lab Streaming Layer: one channel of text, type Markers.

    The clock's reading is put on LSL's own clock, which on one machine is the same but for a
    constant.
    """

    def __init__(self, clock: Clock, *, participant: str, session: str) -> None:
        pylsl = _pylsl()
        source = f"{STREAM}-sub-{participant}-ses-{session}"
        info = pylsl.StreamInfo(STREAM, "Markers", 1, pylsl.IRREGULAR_RATE, "string", source)
        self._outlet: Any = pylsl.StreamOutlet(info)
        readings = []
        for _ in range(3):  # the closest of three, as one may be interrupted
            before_s = clock.now_s()
            theirs_s = float(pylsl.local_clock())
            after_s = clock.now_s()
            readings.append((after_s - before_s, theirs_s - (before_s + after_s) / 2))
        self._offset_s = min(readings)[1]
        library = pylsl.library_version()
        self.words: str | None = f"{WORDS}, pylsl {pylsl.__version__}, liblsl {library}"

    def heard(self) -> bool:
        """Tell whether somebody listens."""
        return bool(self._outlet.have_consumers())

    def send(self, marker: str, time_s: float) -> None:
        """Send a marker for a time on the session's clock, also one that is past."""
        self._outlet.push_sample([marker], time_s + self._offset_s)


def await_recorder(markers: Markers, tell: Callable[[str], object], *, asking: bool) -> None:
    """Give the operator time to connect a recorder to a stream that there was not before.

    `asking`: on a terminal it is waited for until Enter is pressed.
    """
    if markers.heard():
        return
    asking = asking and os.name == "posix" and sys.stdin.isatty()
    without = "Enter goes on without" if asking else f"at most {LONGEST_S:g} s"
    tell(f"Waiting until somebody records the {WORDS}: connect the recorder now; {without}.")
    until_s = time.monotonic() + LONGEST_S
    while not markers.heard():
        if asking and select.select([sys.stdin], [], [], _LOOK_EVERY_S)[0]:
            sys.stdin.readline()
            break
        if not asking:
            if time.monotonic() > until_s:
                break
            time.sleep(_LOOK_EVERY_S)
    if markers.heard():
        tell(f"The {WORDS} is recorded.")
        return
    tell(
        f"Note: nobody records the {WORDS}. {RECORDING_START} is sent before the first trial at "
        "which somebody does; what was sent before is lost to them."
    )


def stimulus_marker(task: Task, delivery: Delivery) -> str:
    """Return what is sent for a stimulus: words with slashes, by which programs select events.

    It reads ``stimulus/main/single/left/120Vpp/trial12/attempt1``.
    """
    level_vpp = max(delivery.level_left_vpp, delivery.level_right_vpp)
    trial = task.trial
    return (
        f"stimulus/{trial.condition}/{trial.kind}/{trial.side}/{level_vpp:g}Vpp/"
        f"trial{trial.number}/attempt{task.attempt}"
    )


def response_marker(task: Task, response: str) -> str:
    """Return what is sent for an answer."""
    return f"response/{response}/trial{task.trial.number}/attempt{task.attempt}"


def _pylsl() -> Any:
    try:
        import pylsl
    except ImportError as error:
        raise MarkerError(f"--lsl needs pylsl: {installing('lsl')}") from error
    except RuntimeError as error:  # it finds no liblsl
        raise MarkerError(f"--lsl needs liblsl: {str(error).splitlines()[0]}") from error
    return pylsl
