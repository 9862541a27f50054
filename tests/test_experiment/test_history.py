"""What a journal says: the lines of a session, replayed to rows without a session."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from device.driver import Outcome
from experiment import Entry, JournalError, draw_plan, replay
from experiment.perception.gains import ConditionGains
from experiment.record.entries import (
    JournalLine,
    ResponseGiven,
    SessionOpened,
    SessionResumed,
    StimulusConfirmed,
    TrialArmed,
    TrialEnded,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from experiment import Plan, Study, TrialRow

GAINS = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=("measured", "predicted"),
    per_vpp=((0.02, 0.003), (0.001, 0.05)),
)
"""Four different numbers: whatever is mixed up gives other displacements."""


HOST: dict[str, Any] = {
    "host": "lab",
    "host_boot": "first",
    "device": "plate",
    "device_kind": "emulated",
    "serial_number": "1",
    "boot_id": 7,
}
PLANNED: dict[str, Any] = {
    "participant": "01",
    "session": "01",
    "simulated": False,
    "header_sha256": "0" * 64,
    "plan_file_sha256": "0" * 64,
}
FIRED: dict[str, Any] = {
    "outcome": "fired",
    "token": 12,
    "boot_id": 7,
    "device_us": 3_500_000,
    "uncertainty_s": 1e-4,
    "retries": 0,
    "onset_s": 3.5,
}


def resume_line(clock: str) -> SessionResumed:
    """Return the first line of a later visit, on another device."""
    values = dict.fromkeys(SessionResumed.model_fields) | HOST
    values |= {"event": "session_resume", "boot_id": 8, "device_kind": "real", "host_boot": None}
    values |= {"responder": "screen", "masking_noise_played": False}
    return SessionResumed.model_validate(values | {"session_clock": clock})


@pytest.fixture
def plan(make_study: Callable[[str], Study], short_study_text: str) -> Plan:
    study = make_study(short_study_text.replace("[design]", "[design]\nhands_off_trials_after = 2"))
    return draw_plan(study, participant="01", session="01", seed=1, gains=(GAINS,))


def lines(plan: Plan, number: int, levels_vpp: tuple[float, float] | None = None) -> list[Entry]:
    """Return the journal of a session whose one trial had this delivery."""
    events: list[JournalLine] = [
        SessionOpened(**HOST, **PLANNED, plan_sha256=plan.sha256),
        TrialArmed(trial=number, attempt=1, token=12),
        StimulusConfirmed(trial=number, attempt=1, **FIRED, levels_vpp=levels_vpp),
        ResponseGiven(
            trial=number, attempt=1, response="left", rt_s=0.5, premature=False, noise_ok=True
        ),
        TrialEnded(trial=number, attempt=1, status="ok", premature=False, noise_ok=True),
    ]
    return [Entry(line, float(at), 100.0 + at, 7.0 + at) for at, line in enumerate(events)]


def row_of(plan: Plan, number: int, levels_vpp: tuple[float, float] | None) -> TrialRow:
    (row,) = replay(plan, lines(plan, number, levels_vpp)).rows
    return row


def peaks(row: TrialRow) -> tuple[float | str | None, ...]:
    return (*row.site_peaks_um, row.displacement_basis)


@pytest.mark.parametrize(
    ("levels_vpp", "expected"),
    [
        ((100.0, 0.0), (2.0, 0.1, "measured")),
        ((0.0, 100.0), (0.3, 5.0, "predicted")),
        ((100.0, 40.0), (2.12, 2.1, "predicted")),
        ((0.0, 0.0), (0.0, 0.0, "predicted")),
    ],
)
def test_displacements_are_of_the_levels_that_the_device_reported(
    plan: Plan, levels_vpp: tuple[float, float], expected: tuple[float, float, str]
) -> None:
    row = row_of(plan, 1, levels_vpp)
    assert peaks(row) == expected
    assert row.site_levels_vpp == levels_vpp


def test_no_displacement_is_told_of_an_unknown_level_or_a_finger_that_is_off(plan: Plan) -> None:
    hands_off = next(trial for trial in plan.trials if trial.kind == "hands_off")
    assert peaks(row_of(plan, hands_off.number, (100.0, 40.0))) == (None, None, None)
    assert peaks(row_of(plan, 1, None)) == (None, None, None)


def test_a_row_says_what_plan_and_lines_say(plan: Plan) -> None:
    row = row_of(plan, 1, (100.0, 0.0))
    trial = plan.trials[0]
    planned = (1, trial.kind, trial.side, trial.level_vpp)
    assert (row.trial, row.kind, row.side, row.level_vpp) == planned
    assert (row.response, row.rt_s, row.onset_s, row.status) == ("left", 0.5, 3.5, "ok")
    assert (row.premature, row.noise_ok, row.simulated) == (False, True, False)
    assert row.correct is (trial.side == "left")
    assert (row.device_kind, row.burst_verified) == ("emulated", None)


@pytest.mark.parametrize(
    ("clocks", "expected"),
    [(["goes on"], [1, 1]), (["broken"], [1, 2]), (["broken", "goes on", "broken"], [1, 3])],
)
def test_a_row_says_whether_its_onset_can_be_compared(
    plan: Plan, clocks: list[str], expected: list[int]
) -> None:
    resumed = [Entry(resume_line(clock), 5.0, 105.0, 12.0) for clock in clocks]
    history = replay(plan, [*lines(plan, 1), *resumed, *lines(plan, 2)[1:]])
    assert [row.onset_clock for row in history.rows] == expected
    assert history.onset_clock == expected[-1]


def test_a_trial_without_its_end_is_open_with_all_that_was_written(plan: Plan) -> None:
    history = replay(plan, lines(plan, 1)[:-1])
    trial = history.interrupted
    assert trial is not None
    assert (trial.token, trial.boot_id) == (12, 7)
    assert {i: line.outcome for i, line in trial.confirmed.items()} == {1: Outcome.FIRED}
    assert trial.response is not None
    assert trial.response.response == "left"
    assert history.rows == ()
    assert [attempt.trial.number for attempt in history.pending] == [t.number for t in plan.trials]
    assert (history.last_t_s, history.last_token) == (3.0, 12)
    last = history.last
    assert (last.boot, last.up_s, last.wall_s) == ("first", 10.0, 103.0)


def test_a_journal_of_another_plan_or_of_lines_that_cannot_be_is_refused(plan: Plan) -> None:
    whole = lines(plan, 1)
    for entries, named in (
        (whole[1:], "session_open"),
        ([*whole, whole[2]], "end"),
        (lines(plan, 99), "99"),
        ([*whole[:-1], *lines(plan, 2)[1:]], "ended"),
        (lines(replace(plan, sha256="0" * 64), 1), "000000000000"),
    ):
        with pytest.raises(JournalError, match=named):
            replay(plan, entries)
