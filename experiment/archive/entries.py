"""What a journal tells: the events, and what the line of each holds beside its time."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class EventKind:
    """What an event is, and the members of its line; one with a question mark may be left out."""

    meaning: str
    members: tuple[str, ...] = ()


_TRIAL = ("trial", "attempt")
_PLACE = ("host", "host_boot", "device", "device_kind", "serial_number", "boot_id")
_MEASURED = (
    "tap",
    "source",
    "unit",
    "burst_verified",
    "faults",
    "noted",
    "unmeasured",
    "planned_left",
    "planned_right",
    "peak_left",
    "peak_right",
    "onset_s",
    "onset_uncertainty_s",
    "late_s",
    "correlation_left",
    "correlation_right",
    "noise_left",
    "noise_right",
)
_SITTING = (
    "operator",
    "responder",
    "responder_distribution",
    "driver_distribution",
    "response_mapping",
    "device_limits",
    "device_health",
    "hardware_confirmed",
    "masking_noise",
    "masking_noise_played",
    "noise_level_dba",
    "noise_max_level_dba",
    "noise_sha256",
    "noise_sample_rate_hz",
    "noise_loop_s",
    "noise_sound_card",
)
EVENTS: Final[Mapping[str, EventKind]] = MappingProxyType(
    {
        "session_open": EventKind(
            "the session begins: who, which plan, on which host and device",
            (
                *("participant", "session", "plan_sha256", "simulated", "observer?"),
                *_PLACE,
                *("header_sha256", "plan_file_sha256"),
            ),
        ),
        "session_resume": EventKind(
            "it goes on after an interruption: what may be another one by then",
            (*_PLACE, "session_clock", *_SITTING),
        ),
        "marker": EventKind(
            "other recordings were told that the session begins", ("marker", "at_s")
        ),
        "block_start": EventKind("a block begins", ("block", "condition")),
        "trial_armed": EventKind(
            "the device is about to be told of a stimulus, under this token", (*_TRIAL, "token")
        ),
        "stimulus_commanded": EventKind("the device is about to be told to emit it", ("token",)),
        "stimulus_confirmed": EventKind(
            "what the device said of it: fired or not, when, at which levels",
            (
                *(*_TRIAL, "outcome", "token", "boot_id", "device_us", "onset_s"),
                *("uncertainty_s", "retries", "level_left_vpp", "level_right_vpp"),
            ),
        ),
        "stimulus_measured": EventKind(
            "what a monitor measured of the burst", (*_TRIAL, "token", *_MEASURED)
        ),
        "response": EventKind(
            "the answer", (*_TRIAL, "response", "rt_s", "anticipated", "noise_ok")
        ),
        "trial_end": EventKind(
            "the trial is over, and whether it counts",
            (*_TRIAL, "status", "anticipated", "noise_ok"),
        ),
        "block_end": EventKind("a block is over", ("block",)),
        "break": EventKind("the participant rests"),
        "pause": EventKind("the session stands still", ("operator_called?",)),
        "noise_status": EventKind(
            "the masking noise does not play as it did, or does again",
            ("ok", "words", "frames?", "underruns?"),
        ),
        "fault": EventKind("the device, or its link, failed", ("error", "message")),
        "note": EventKind("what the operator or the program noted", ("text",)),
        "session_close": EventKind(
            "the session ends: finished, or to be resumed",
            ("finished", "trials_sha256?", "measured_sha256?"),
        ),
    }
)
"""What a line can tell of, about in the order of a session."""
