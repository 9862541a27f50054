"""A board of a lab's own in a session: what it tells is held against the study, and kept."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from device.core.reports import About, DeviceLimits, Health
from device.emulate.amplifier import Amplifier
from device.limits import Limits
from experiment.apparatus.slots import SuitabilityError, require_suitable
from tests.system.boards import board, says
from tests.system.test_links import QUICK, SHORT, TINY
from tests.test_device.bursts import identity
from tests.test_experiment.sessions import Sessions

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study

TOLD = DeviceLimits.of(Limits(ceiling_vpp=200.0), About())
SERIAL = ("--responder", "simulated", "--driver", "serial")


def with_line(text: str, **keys: object) -> str:
    """Return a study with more keys of [device]."""
    stated = "".join(f"{key} = {value}\n" for key, value in keys.items())
    return text.replace("[device]\n", f"[device]\n{stated}")


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"slots": 3}, "the device must have 4 slots, one for each side; it has 3"),
        ({"memory_samples": 387}, "for 4 sides it has 388 samples, and the device keeps 387"),
        ({"least_interval_us": 60_000}, "device.least_interval_s must be at least 0.06 for the"),
        ({"max_duty_ppm": 10_000}, "device.least_interval_s must be at least 0.202125 for the"),
        ({"longest_time_to_live_us": 999_999}, "must keep a token armed for 1 s; its longest"),
    ],
)
def test_what_the_device_would_refuse_in_mid_session_is_refused_before(
    changed: dict[str, Any], told: str, make_study: Callable[[str], Study]
) -> None:
    study = make_study("")
    require_suitable(study, identity(), TOLD)
    with pytest.raises(SuitabilityError, match=told.replace(".", r"\.")):
        require_suitable(study, identity(), replace(TOLD, **changed))


def test_a_waveform_with_more_dc_than_the_device_takes_is_refused_before(
    make_study: Callable[[str], Study],
) -> None:
    study = make_study("[burst]\nfrequency_hz = 499.3\ncycles = 1\n")
    require_suitable(study, identity(), TOLD)
    strict = replace(TOLD, dc_tolerance_ppm=1)
    with pytest.raises(SuitabilityError, match="the waveform has a DC part"):
        require_suitable(study, identity(), strict)


@pytest.mark.process
def test_a_session_on_a_slow_board_that_boots_is_run_by_the_options_and_kept(
    tmp_path: Path,
) -> None:
    options = {"baud": 9600, "opens_within_s": 3.0}
    sessions = Sessions(tmp_path, with_line(TINY, **options))
    with board(baud=9600, boots_for_s=0.5) as (port, truth):
        result = sessions.run(*SERIAL, "--port", port)
        assert result.exit_code == 0, result.stderr
        events = [json.loads(line) for line in truth.getvalue().splitlines()]
    assert "watchdog" not in {event["event"] for event in events}
    header = sessions.header()
    assert header["device_line"] == {"dtr": True, "patience_s": 2.0} | options
    assert header["device_limits"]["firmware"] == "tactstrip emulator"
    assert header["device_limits"]["entropy"] == "the operating system"
    assert header["device_health"]["switch_closed"] is True


@pytest.mark.process
@pytest.mark.parametrize(
    ("answer", "told"),
    [
        (b"tactstrip,lab,7,protocol 1.0\n", "it speaks protocol 1.0 and this program 2.0"),
        (b"", "is it switched on?"),
    ],
)
def test_a_device_of_another_age_or_none_is_one_line_and_exit_3(
    answer: bytes, told: str, tmp_path: Path
) -> None:
    sessions = Sessions(tmp_path, with_line(QUICK, opens_within_s=0.2))
    with says(answer) as port:
        result = sessions.run(*SERIAL, "--port", port)
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert told in result.stderr
    assert not sessions.out.exists()


@pytest.mark.process
def test_a_wire_that_is_too_slow_is_one_line_and_exit_3_and_runs_when_it_is_told(
    tmp_path: Path,
) -> None:
    sessions = Sessions(tmp_path, QUICK)
    with board(baud=9600, hidden=True) as (port, _):
        result = sessions.run(*SERIAL, "--port", port)
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert "the line is too slow" in result.stderr
    assert "give device.baud = 9600, or let both ends have 57600 or more" in result.stderr
    assert not sessions.out.exists()


class Overloaded(Amplifier):
    """Reports over-current from the start on: enabling the output must not clear it for long."""

    def sensed_at(self, now_s: float) -> Health:
        return Health(over_current=True)


class Overloads(Amplifier):
    """Reports over-current from 1.5 s on: a host that is slow to begin must not miss it."""

    def sensed_at(self, now_s: float) -> Health:
        return Health(over_current=now_s >= 1.5)


@pytest.mark.process
@pytest.mark.parametrize(
    ("amplifier", "told", "n_bursts"),
    [
        (Amplifier(switch_open=True), "the amplifier is off: its safety switch is open", {0}),
        (Overloaded(), "the amplifier reported over-current", {0}),
        (Overloads(), "the amplifier reported over-current", set(range(12))),
    ],
)
def test_an_amplifier_that_cannot_drive_ends_the_session_and_no_trial_counts_then(
    amplifier: Amplifier, told: str, n_bursts: set[int], tmp_path: Path
) -> None:
    sessions = Sessions(tmp_path, with_line(SHORT, baud=1_000_000))
    with board(amplifier=amplifier) as (port, truth):
        result = sessions.run(*SERIAL, "--port", port)
        events = [json.loads(line) for line in truth.getvalue().splitlines()]
    assert (result.exit_code, len(result.stderr.splitlines())) == (3, 1)
    assert told in result.stderr
    bursts = [event["token"] for event in events if event["event"] == "burst"]
    cut = [event["token"] for event in events if event["event"] == "cut"]
    assert len(bursts) in n_bursts
    ended = [dict(entry.facts) for entry in sessions.entries("trial_end")]
    ok = [one for one in ended if one["status"] == "ok"]
    assert len(ok) in {len(bursts), len(bursts) - len(cut)}
