"""A board of a lab's own in a session: what it says of itself is recorded."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from device.emulate.amplifier import Amplifier
from tests.plates import PAPER_PLATE
from tests.system.boards import board, says
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from pathlib import Path

QUICK = f"""{PAPER_PLATE}
[burst]
window = "hann"
[device]
min_interval_s = 0.01
amplifier_gain = 27.5
volts_full_scale = 110
[simulation]
reaction_time_s = 0.151
reaction_time_spread = 0
[design]
foreperiod_s = [0.01, 0.02]
min_break_s = 0
"""
TINY = QUICK + "trials_per_side = 1\nboth_trials = 1\nbreak_every = 3\n"
SHORT = QUICK + "trials_per_side = 5\nboth_trials = 1\nbreak_every = 6\n"
SERIAL = ("--responder", "simulated", "--driver", "serial")


def with_line(text: str, **keys: object) -> str:
    """Return a study with more keys of [device]."""
    stated = "".join(f"{key} = {value}\n" for key, value in keys.items())
    return text.replace("[device]\n", f"[device]\n{stated}")


def test_a_session_on_a_slow_board_that_boots_is_run_by_the_options_and_kept(
    tmp_path: Path,
) -> None:
    options = {"baud": 9600, "open_timeout_s": 3.0}
    sessions = Sessions(tmp_path, with_line(TINY, **options))
    with board(baud=9600, boots_for_s=0.5) as (port, truth):
        result = sessions.run(*SERIAL, "--port", port)
        assert result.exit_code == 0, result.stderr
        events = [json.loads(line) for line in truth.getvalue().splitlines()]
    assert "watchdog" not in {event["event"] for event in events}
    header = sessions.header()
    assert header["device_limits"]["firmware"] == "tactstrip emulator"
    assert header["device_health"]["switch_closed"] is True


@pytest.mark.parametrize(
    ("answer", "part"),
    [
        (b"tactstrip,lab,7,protocol 1.0\n", "protocol 1.0"),
        (b"", "no answer at device.baud = 115200 within device.open_timeout_s = 0.2"),
    ],
)
def test_a_device_of_another_age_or_none_is_one_line_and_exit_3(
    answer: bytes, part: str, tmp_path: Path
) -> None:
    sessions = Sessions(tmp_path, with_line(QUICK, open_timeout_s=0.2))
    with says(answer) as port:
        result = sessions.run(*SERIAL, "--port", port)
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert part in result.stderr
    assert not sessions.out.exists()


def test_a_wire_that_is_too_slow_is_one_line_and_exit_3(
    tmp_path: Path,
) -> None:
    sessions = Sessions(tmp_path, QUICK)
    with board(baud=9600, hidden=True) as (port, _):
        result = sessions.run(*SERIAL, "--port", port)
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert "slower than device.baud = 115200" in result.stderr
    assert not sessions.out.exists()


class Overloads(Amplifier):
    """Reports over-current from 1.5 s on: a host that is slow to begin must not miss it."""

    def sensed_at(self, now_s: float) -> Any:
        return replace(super().sensed_at(now_s), over_current=now_s >= 1.5)


@pytest.mark.parametrize(
    ("amplifier", "part", "n_bursts"),
    [
        (Amplifier(switch_open=True), "safety switch", {0}),
        (Overloads(), "over-current", set(range(12))),
    ],
)
def test_an_amplifier_that_cannot_drive_ends_the_session_and_no_trial_counts_then(
    amplifier: Amplifier, part: str, n_bursts: set[int], tmp_path: Path
) -> None:
    sessions = Sessions(tmp_path, with_line(SHORT, baud=1_000_000))
    with board(amplifier=amplifier) as (port, truth):
        result = sessions.run(*SERIAL, "--port", port)
        events = [json.loads(line) for line in truth.getvalue().splitlines()]
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert part in result.stderr
    bursts = [event["token"] for event in events if event["event"] == "burst"]
    cut = [event["token"] for event in events if event["event"] == "cut"]
    assert len(bursts) in n_bursts
    ends = sessions.lines("trial_end")
    ok = [end for end in ends if end["status"] == "ok"]
    assert len(ok) in {len(bursts), len(bursts) - len(cut)}
