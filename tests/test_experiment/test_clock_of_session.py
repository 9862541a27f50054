"""The session's clock over interruptions: it goes on by what nobody can set, or says it is broken.

The host's clocks are simulated: the session's, the one since the host's start, which nobody can
set, and the calendar's, which is set forward and back.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import pytest

from device.clock import MachineTime, elapsed_s
from experiment import ArchiveError, Journal

if TYPE_CHECKING:
    from tests.test_experiment.lab import Lab

MINUTE_S = 60.0
LONGEST_INTERRUPTION_S = 30 * MINUTE_S
STEPS_S = [0.0, 20 * MINUTE_S, -20 * MINUTE_S]
STEPS = ["not set", "20 minutes forward", "20 minutes back"]


class Host:
    """The clocks of a machine on which the time passes as on the session's clock."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab
        self.boot: str | None = "first"
        self.started_s = -5000.0
        self.set_by_s = 0.0

    def up_s(self) -> float:
        return self._lab.clock.now_s() - self.started_s

    def wall_s(self) -> float:
        return 1.8e9 + self._lab.clock.now_s() + self.set_by_s

    def time(self) -> MachineTime:
        return MachineTime(boot=self.boot, up_s=self.up_s(), wall_s=self.wall_s())

    def start_anew(self) -> None:
        self.boot = None if self.boot is None else "second"
        self.started_s = self._lab.clock.now_s() - 30.0


@pytest.fixture
def host(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> Host:
    host = Host(lab)
    monkeypatch.setattr("experiment.session.run.machine_time", host.time)
    monkeypatch.setattr("experiment.session.header.boot", lambda: host.boot)
    kept = partial(Journal, wall_s=host.wall_s, up_s=host.up_s)
    monkeypatch.setattr("experiment.record.folder.Journal", kept)
    monkeypatch.setattr("time.time_ns", lambda: int(host.wall_s() * 1e9))
    return host


def onsets_s(lab: Lab) -> list[float]:
    return [row.onset_s for row in lab.rows if row.onset_s is not None]


@pytest.mark.parametrize("step_s", STEPS_S, ids=STEPS)
@pytest.mark.parametrize("gap_s", [0.5, 600.0, 29.9 * MINUTE_S])
def test_over_an_interruption_the_clock_goes_on_by_what_went_by(
    lab: Lab, host: Host, step_s: float, gap_s: float
) -> None:
    lab.crash(3)
    host.set_by_s += step_s
    lab.clock.wait(gap_s)
    assert lab.resume().finished
    offsets_s = [entry.up_s - entry.t_s for entry in lab.entries()]
    assert max(offsets_s) - min(offsets_s) < 1e-5
    emitted_s = [emission.start_us * 1e-6 for emission in lab.device.emitted]
    recorded_s = emitted_s[:2] + emitted_s[3:]
    moved_s = [row_s - s for row_s, s in zip(onsets_s(lab), recorded_s, strict=True)]
    assert max(moved_s) - min(moved_s) < 1e-4
    assert {row.onset_clock for row in lab.rows} == {1}
    assert lab.members("session_resume", "session_clock") == ["goes on"]
    assert not lab.entries("note")


@pytest.mark.parametrize("step_s", STEPS_S, ids=STEPS)
def test_half_an_hour_is_half_an_hour_whatever_the_calendar_says(
    lab: Lab, host: Host, step_s: float
) -> None:
    lab.crash(3)
    lines = len(lab.entries())
    host.set_by_s += step_s
    lab.clock.wait(LONGEST_INTERRUPTION_S + MINUTE_S)
    with pytest.raises(ArchiveError, match=r"31 minutes.* at most 30 .*--resume-anyway"):
        lab.resume()
    assert len(lab.entries()) == lines
    lab.resume_anyway = True
    assert lab.resume().finished
    assert {row.onset_clock for row in lab.rows} == {1}


@pytest.mark.parametrize("step_s", STEPS_S, ids=STEPS)
@pytest.mark.parametrize("boot", ["first", None], ids=["named", "unnamed"])
def test_after_a_new_start_of_the_computer_the_clock_is_broken_and_says_so(
    lab: Lab, host: Host, step_s: float, boot: str | None
) -> None:
    host.boot = boot
    lab.crash(3)
    lines, last_t_s = len(lab.entries()), lab.entries()[-1].t_s
    lab.clock.wait(10 * MINUTE_S)
    host.start_anew()
    host.set_by_s += step_s
    minutes = round(10 + step_s / 60)
    with pytest.raises(ArchiveError, match=f" {minutes} minutes .*--resume-anyway"):
        lab.resume()
    assert len(lab.entries()) == lines
    lab.resume_anyway = True
    assert lab.resume().finished
    resumed = lab.entries("session_resume")[0]
    assert lab.members("session_resume", "session_clock") == ["broken"]
    assert resumed.t_s == pytest.approx(last_t_s, abs=1e-3)
    (note,) = lab.members("note", "text")
    assert "onset_clock 2" in note
    assert any("onset_clock 2" in message for message in lab.messages)
    clocks = defaultdict(list)
    for row in lab.rows:
        clocks[row.onset_clock].append(row.onset_s)
    assert sorted(clocks) == [1, 2]
    assert [onset_s is None for onset_s in clocks[1]] == [False, False, True]  # voided: asked later


@pytest.mark.parametrize(
    ("later_up_s", "elapsed"), [(100.0000007, 0.0), (99.0, None), (float("nan"), None)]
)
def test_a_time_that_was_rounded_upwards_is_no_new_start(
    later_up_s: float, elapsed: float | None
) -> None:
    earlier = MachineTime(boot="a", up_s=100.000001, wall_s=0.0)
    assert elapsed_s(earlier, replace(earlier, up_s=later_up_s)) == elapsed
