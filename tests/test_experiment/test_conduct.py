"""A session on a device that stays on, with a participant whose every key is scripted."""

from __future__ import annotations

import platform
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest
from click.testing import CliRunner

from device import LimitExceeded, LinkError, Outcome, Refusal
from experiment import ArchiveError, Journal, JournalError, Progress, SessionPart
from experiment.hardware.safety import Purpose, require_device
from tactstrip import main
from tests.test_experiment.lab import Crash, FakeNoise, Lab, Scripted, Watching

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from device import Delivery
    from experiment import AwaitedAnswer, Press

    LabOf: TypeAlias = Callable[..., Lab]
    Script: TypeAlias = dict[str, Mapping[int, object]]

STOPPED: dict[str, Any] = {"ask": {3: ("escape", 0.3)}, "pause": {1: False}}
"""The script of a session of which two trials are answered when it is stopped."""


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the script for a person's."""
    monkeypatch.setattr(Scripted, "simulated", False)


@pytest.mark.parametrize("text", ["", '[burst]\nwindow = "hann"\n'])
def test_what_the_device_emitted_is_what_the_rows_say(lab_of: LabOf, text: str) -> None:
    lab = lab_of(text)
    assert lab.begin().finished
    emitted = list(lab.device.emitted)
    assert len(emitted) == len(lab.rows) == 5
    for row, emission in zip(lab.rows, emitted, strict=True):
        left = 2 * float(abs(emission.volts[0]).max())
        right = 2 * float(abs(emission.volts[1]).max())
        left_vpp, right_vpp = row.site_levels_vpp
        assert left_vpp == pytest.approx(left, abs=0.02)
        assert right_vpp == pytest.approx(right, abs=0.02)
        assert row.level_vpp == max(left_vpp or 0.0, right_vpp or 0.0)
        assert (left_vpp == 0) == (row.side == "right")
        assert (right_vpp == 0) == (row.side == "left")
        assert row.onset_s == pytest.approx(emission.start_us * 1e-6, abs=2e-6)


def test_every_answer_stays_in_the_record_and_is_timed_from_the_onset(lab: Lab) -> None:
    ending = lab.begin(ask={1: (None, 3.0), 4: ("right", 0.321)})
    assert (ending.finished, ending.unanswered) == (True, 1)
    assert [row.response for row in lab.rows] == ["timeout", "left", "left", "right", "left"]
    assert lab.rows[0].correct is False
    assert [row.rt_s for row in lab.rows][1:] == [0.5, 0.5, 0.321, 0.5]
    assert {row.status for row in lab.rows} == {"ok"}


def test_a_key_that_is_no_answer_here_is_no_miss_but_a_note(lab: Lab) -> None:
    keys = {1: ("none", 0.2), 2: ("key q", 0.3), 3: ("key q", 0.35), 4: ("right", 0.4)}
    lab.begin(ask=keys | {6: ("key x", 0.3), 7: (None, 3.0)}, wait={1: "none"})
    assert [row.response for row in lab.rows] == ["right", "left", "timeout", "left", "left"]
    assert lab.rows[0].rt_s == 0.4
    assert not any(row.premature for row in lab.rows)
    notes = [note.split(": ", 1)[1] for note in lab.members("note", "text")]
    for note, key in zip(notes, ("none", "key q", "key x"), strict=True):
        assert note.startswith(key)


ALWAYS_EARLY: dict[str, Script] = {
    "a key held down": {"wait": dict.fromkeys(range(1, 1000), "left")},
    "bursts": {"ask": dict.fromkeys(range(1, 1000), ("left", 0.05))},
}


@pytest.mark.parametrize("script", ALWAYS_EARLY.values(), ids=ALWAYS_EARLY)
def test_somebody_who_always_presses_too_early_gets_three_trials_then_the_operator(
    lab: Lab, script: Script
) -> None:
    lab.requests.attended = True
    at_pauses: list[int] = []

    def note() -> bool:
        at_pauses.append(len(lab.rows))
        return len(at_pauses) < 4

    assert not lab.begin(pause=dict.fromkeys(range(1, 9), note), **script).finished
    assert at_pauses[0] == 3
    assert all(later - earlier <= 3 for earlier, later in pairwise(at_pauses))
    assert len(lab.device.emitted) in {0, at_pauses[-1]}
    calls = lab.members("pause", "operator_called")
    assert len(calls) == 4
    assert lab.display.messages == {*calls}


@pytest.mark.parametrize("script", ALWAYS_EARLY.values(), ids=ALWAYS_EARLY)
def test_where_no_operator_attends_the_session_stops_and_no_key_of_the_participant_goes_on(
    lab: Lab, script: Script
) -> None:
    assert not lab.begin(**script).finished
    assert not lab.resume(**script).finished
    assert "pause" not in lab.responder.calls
    assert len(lab.device.emitted) in {0, 6}
    assert [message.split()[-1] for message in lab.messages] == ["--resume."] * 2
    assert len(lab.members("pause", "operator_called")) == 2
    assert lab.resume().finished


@pytest.mark.parametrize(("call", "number", "status"), [("ask", 3, "voided"), ("pause", 1, "ok")])
def test_a_stop_from_outside_ends_a_wait(lab: Lab, call: str, number: int, status: str) -> None:
    def stop() -> None:
        lab.stop.request()

    script: Script = {call: {number: stop}}
    assert not lab.begin(**script).finished
    assert lab.statuses()[-1] == (3, 1, status)
    assert "end" not in lab.responder.calls
    assert lab.resume().finished
    assert lab.responder.calls["end"] == 1


@pytest.mark.parametrize("status", ["voided", "indeterminate"])
def test_only_a_device_that_stayed_on_tells_that_a_stimulus_was_felt(lab: Lab, status: str) -> None:
    lab.crash(2)
    if status == "indeterminate":
        lab.replace_device()
    assert lab.resume().finished
    assert lab.statuses()[1] == (2, 1, status)
    assert lab.rows[1].onset_s is None


def test_a_device_that_stayed_on_tells_that_the_stimulus_never_went_out(lab: Lab) -> None:
    with lab.failing("fire", Crash()), pytest.raises(Crash):
        lab.begin()
    assert lab.resume().finished
    assert lab.statuses()[0] == (1, 1, "aborted")
    assert len(lab.device.emitted) == 5


def test_an_indeterminate_delivery_is_recorded_and_repeated(lab: Lab) -> None:
    fire = lab.device.fire
    fired: list[int] = []

    def lose_the_first_answer(token: int) -> Delivery:
        delivery = fire(token)
        fired.append(token)
        return replace(delivery, outcome=Outcome.INDETERMINATE) if len(fired) == 1 else delivery

    lab.patch.setattr(lab.device, "fire", lose_the_first_answer)
    assert lab.begin().finished
    first = lab.rows[0]
    assert (first.status, first.response) == ("indeterminate", None)
    assert first.site_levels_vpp == (None, None)
    assert lab.n_ok == 5


@pytest.mark.parametrize(
    ("call", "error", "statuses"),
    [
        ("arm", LimitExceeded(Refusal.CEILING, "201 Vpp"), [(1, 1, "device_error")]),
        ("fire", LinkError("silent"), [(1, 1, "indeterminate")]),
        ("load", LinkError("silent"), []),
    ],
)
def test_a_device_that_fails_stops_the_session_which_can_be_resumed(
    lab: Lab, call: str, error: Exception, statuses: list[tuple[int, int, str]]
) -> None:
    with lab.failing(call, error):
        ending = lab.begin()
    assert (ending.finished, ending.failure) == (False, error)
    assert lab.statuses() == statuses
    assert lab.members("fault", "message") == [str(error)]
    assert lab.display.seen[-1].device == "failed"
    assert lab.resume().finished


@pytest.mark.usefixtures("person")
def test_practice_and_trials_with_the_hands_off_are_counted_apart_from_the_task(
    lab_of: LabOf,
) -> None:
    """Whatever is presented again, in a warm-up what goes on behind it."""
    lab = lab_of("practice_trials = 2\nhands_off_trials_before = 2\nhands_off_trials_after = 2\n")

    def counted() -> list[tuple[str, int, int]]:
        cues = (shown for shown in lab.responder.shown if isinstance(shown, Progress))
        return [(cue.part.value, cue.done, cue.planned) for cue in cues]

    before = [(part, n, 2) for part in ("hands_off_before", "practice") for n in (0, 1)]
    lab.crash(7, ask={3: ("left", 0.0)})
    assert counted() == [*before[:3], *before[2:], ("main", 0, 5), ("main", 1, 5)]
    assert lab.resume().finished
    warm_up = [("warm_up", 1, 5)] * 2
    main = [("main", n, 5) for n in range(1, 5)]
    assert counted() == [*warm_up, *main, ("hands_off_after", 0, 2), ("hands_off_after", 1, 2)]
    last = lab.display.seen[-1]
    assert (last.done, last.planned) == (5, 5)


def test_a_session_goes_on_only_where_it_was_begun(lab: Lab) -> None:
    lab.crash(2)
    lines = lab.folder.journal_path.read_bytes()
    with lab.patch.context() as patch:
        patch.setattr(platform, "node", lambda: "elsewhere")
        with pytest.raises(ArchiveError, match=r"host .*'elsewhere'.*--resume-anyway"):
            lab.resume()
    assert lab.folder.journal_path.read_bytes() == lines
    assert lab.resume().finished


def test_what_the_device_would_refuse_leaves_no_session(lab_of: LabOf) -> None:
    lab = lab_of('[burst]\nfrequency_hz = 5000\naccept_violation = "a control"\n')
    with pytest.raises(ValueError, match="main: "):
        lab.begin()
    assert not lab.folder.plan_path.exists()


def test_a_session_begun_with_a_person_does_not_go_on_with_a_simulation(lab: Lab) -> None:
    with lab.patch.context() as patch:
        patch.setattr(Scripted, "simulated", False)
        lab.crash(2)
    lines = lab.folder.journal_path.read_bytes()
    for lab.resume_anyway in (False, True):
        with pytest.raises(ArchiveError, match="--responder"):
            lab.resume()
    assert lab.folder.journal_path.read_bytes() == lines


def test_a_lost_journal_is_not_begun_anew_over_its_table(lab: Lab) -> None:
    lab.begin(**STOPPED)
    table = lab.folder.trials_path.read_bytes()
    journal = lab.folder.journal_path.read_bytes()
    for rest in (b"", b"".join(journal.splitlines(keepends=True)[:8])):
        lab.folder.journal_path.write_bytes(rest)
        for act in (lab.resume, lab.folder.write_trials):
            with pytest.raises(JournalError, match="3 trials"):
                act()
    lab.folder.journal_path.unlink()
    with pytest.raises(ArchiveError, match=r"journal\.jsonl"):
        lab.resume()
    assert lab.folder.trials_path.read_bytes() == table
    lab.folder.journal_path.write_bytes(journal)
    assert lab.resume().finished


@pytest.mark.parametrize(("ok", "on_record"), [(True, [True]), (None, [])])
def test_noise_is_on_record_in_every_row_where_some_is_to_play_and_stopped_at_the_end(
    lab: Lab, *, ok: bool | None, on_record: list[bool]
) -> None:
    lab.noise = FakeNoise(ok=ok)
    assert lab.begin().finished
    assert {row.noise_ok for row in lab.rows} == {ok}
    assert lab.noise.calls[0] == "start"
    assert set(lab.noise.calls[1:]) == {"stop"}
    assert lab.members("noise_status", "ok") == on_record


@pytest.mark.parametrize("answer", [("left", 0.5), ("escape", 0.3), ("left", 0.05), (None, 3.0)])
def test_noise_lost_while_the_answer_is_awaited_voids_the_trial(
    noisy: Lab, answer: tuple[str | None, float]
) -> None:
    def lose_and_answer() -> tuple[str | None, float]:
        noisy.noise.lose()
        return answer

    assert noisy.begin(ask={3: lose_and_answer}).finished
    lost = noisy.rows[2]
    assert (lost.status, lost.noise_ok, lost.response) == ("voided", False, None)
    assert lost.onset_s is not None
    assert noisy.noise.calls.count("start") == 2
    assert noisy.members("noise_status", "ok") == [True, False, True]
    assert len(noisy.display.messages) == 1
    assert noisy.display.seen[-1].message == ""


def test_a_gap_that_is_over_voids_its_trial_and_stays_on_record(noisy: Lab) -> None:
    health, gaps = noisy.noise.health, 0

    def health_since_last_asked() -> object:
        now = replace(health(), underruns=gaps)
        noisy.noise.ok = True
        return now

    def gap() -> None:
        nonlocal gaps
        noisy.noise.ok, gaps = False, gaps + 1

    noisy.patch.setattr(noisy.noise, "health", health_since_last_asked)
    assert noisy.begin(ask={2: gap}, cue={4: gap}).finished
    # one in an answer window, one in a foreperiod
    assert [s for _, _, s in noisy.statuses()] == ["ok", "voided", "ok", "aborted", *["ok"] * 3]
    assert noisy.members("noise_status", "ok") == [True, False, True, False, True]
    assert noisy.members("noise_status", "underruns") == [0, 1, 1, 2, 2]


def test_noise_that_never_plays_again_pauses_until_the_session_is_stopped(noisy: Lab) -> None:
    assert not noisy.begin(ask={2: noisy.noise.lose_for_good}, pause={4: False}).finished
    assert noisy.responder.calls["pause"] == 4
    assert noisy.responder.calls["cue"] == 2
    assert noisy.members("noise_status", "text")[:2] == ["plays", "silent"]
    assert noisy.members("noise_status", "ok") == [True, *[False] * 4]
    noisy.noise.can_start = True
    assert noisy.resume().finished
    assert noisy.n_ok == 5


def test_noise_that_cannot_be_played_at_all_leaves_no_session(noisy: Lab) -> None:
    noisy.noise.can_start = False
    with pytest.raises(RuntimeError, match="plug"):
        noisy.begin()
    assert not noisy.folder.plan_path.exists()
    assert noisy.noise.calls == ["start", "stop"]
    noisy.noise.can_start = True
    assert noisy.begin().finished
    noisy.noise.can_start = False
    assert noisy.resume().finished  # nothing is left to hear


def test_the_operators_pause_comes_after_the_trial_and_is_over_when_it_ends(lab: Lab) -> None:
    assert lab.begin(ask={2: lab.requests.pause}).finished
    events = [e.event for e in lab.entries()]
    assert events[events.index("pause") - 1] == "trial_end"
    assert events.count("pause") == 1
    assert {status for _, _, status in lab.statuses()} == {"ok"}
    assert not lab.requests.paused


def test_the_operator_sees_how_the_session_stands(noisy: Lab) -> None:
    noisy.begin(ask={1: ("right", 0.5)})
    phases = [status.phase for status in noisy.display.seen]
    assert phases[:5] == ["ready", "welcome", "ready", "introduction", "ready"]
    assert phases[-1] == "finished"
    assert {"foreperiod", "break"} < set(phases)
    assert not {"arming", "firing", "answer"} & set(phases)
    last = noisy.display.seen[-1]
    assert (last.done, last.planned, last.block, last.blocks) == (5, 5, 2, 2)
    assert (last.noise, last.device, last.left_s) == ("plays", "ok", 0.0)
    for side in ("left", "right"):
        rows = [row for row in noisy.rows if (row.kind, row.side) == ("single", side)]
        assert last.tallies[side].presented == len(rows) == 2
        assert last.tallies[side].correct == sum(row.correct is True for row in rows)
        assert last.tallies[side].last == tuple(row.response for row in rows)


def test_whatever_happens_nothing_is_written_or_shown_between_onset_and_key(noisy: Lab) -> None:
    log: list[str] = []
    ask = Scripted.ask

    def logged(word: str, act: Callable[..., object]) -> Callable[..., object]:
        def log_and_act(*args: object, **more: object) -> object:
            log.append(word)
            return act(*args, **more)

        return log_and_act

    def ask_and_log(self: Scripted, question: AwaitedAnswer) -> Press | None:
        noisy.requests.note("while an answer is awaited")
        noisy.requests.pause()
        if len(noisy.device.emitted) % 2:
            noisy.noise.lose()
        press = ask(self, question)
        log.append("key")
        return press

    noisy.patch.setattr(Journal, "append", logged("written", Journal.append))
    noisy.patch.setattr(noisy.device, "fire", logged("onset", noisy.device.fire))
    noisy.patch.setattr(Watching, "show", logged("shown", Watching.show))
    noisy.patch.setattr(Scripted, "ask", ask_and_log)
    assert noisy.begin().finished
    onsets = [place for place, entry in enumerate(log) if entry == "onset"]
    assert len(onsets) == 10
    assert all(log[place + 1] == "key" for place in onsets)
    assert {"written", "shown"} < set(log)


@pytest.fixture
def off_plate(lab_of: LabOf) -> Lab:
    """Set up a session with an audibility check before it and a control block after it."""
    lab = lab_of("hands_off_trials_before = 2\nhands_off_trials_after = 2\n")
    lab.noise = FakeNoise()
    return lab


@pytest.mark.usefixtures("person")
def test_a_person_gets_two_warm_up_trials_after_a_resume_and_the_tally_goes_on(lab: Lab) -> None:
    lab.crash(2)
    lab.display.seen.clear()
    assert lab.resume().finished
    resumed = lab.display.seen[0]
    assert resumed.done == 1
    answered = lab.rows[0].kind == "single" and lab.rows[0].status == "ok"
    assert sum(tally.presented for tally in resumed.tallies.values()) == answered
    warm_up = [row for row in lab.rows if row.trial > len(lab.plan.trials)]
    assert [(row.kind, row.side, row.attempt) for row in warm_up] == [
        ("practice", "left", 1),
        ("practice", "right", 1),
    ]
    planned = [row.trial for row in lab.rows if row.status == "ok" and row not in warm_up]
    assert sorted(planned) == [trial.number for trial in lab.plan.trials]


@pytest.mark.usefixtures("person")
def test_who_had_no_trial_with_the_fingers_on_is_not_warmed_up_again(lab_of: LabOf) -> None:
    """A participant who still has to practise is not warmed up either."""
    lab = lab_of("practice_trials = 3\nhands_off_trials_before = 2\n")
    for question in (2, 3, 2):
        lab.crash(question)
        assert SessionPart.WARM_UP not in lab.responder.parts
    lab.crash(4)
    assert lab.responder.parts == [SessionPart.PRACTICE, SessionPart.MAIN]
    assert lab.resume().finished
    assert lab.responder.parts[0] == SessionPart.WARM_UP


@pytest.mark.slow
@pytest.mark.usefixtures("person")
def test_killed_after_any_line_a_lively_session_loses_nothing(
    lab_of: LabOf, off_plate: Lab
) -> None:
    kills = 0
    while True:
        lab = lab_of(place=str(kills))
        lab.plan, lab.noise = off_plate.plan, FakeNoise()
        kills += 1
        lively: Script = {
            "begin": {1: partial(lab.requests.note, "late")},
            "ask": {2: lab.noise.lose, 4: lab.requests.pause},
            "wait": {3: lab.noise.lose, 5: "left"},
        }
        try:
            with lab.killed_after(lines=kills):
                assert lab.begin(**lively).finished
        except Crash:
            before = lab.rows
            assert lab.resume().finished
            assert lab.rows[: len(before)] == before
        else:
            break
        for trial in lab.plan.trials:
            attempts = [row for row in lab.rows if row.trial == trial.number]
            assert [row.attempt for row in attempts] == list(range(1, len(attempts) + 1))
            assert [row.status for row in attempts].count("ok") == 1
            assert (attempts[-1].status, attempts[-1].noise_ok) == ("ok", True)
        assert {row.status for row in lab.rows if row.noise_ok is False} <= {"voided", "aborted"}
    assert kills > 5 * len(lab.plan.trials)


@pytest.mark.usefixtures("person")
def test_a_person_on_a_silent_device_begins_nothing_unless_it_is_practice(lab: Lab) -> None:
    lab.purpose = Purpose.DATA
    with pytest.raises(ValueError, match="--practice-without-device"):
        lab.begin()
    assert not lab.folder.path.exists()
    assert lab.noise.calls == []


@pytest.mark.parametrize("simulated", [False, True])
def test_a_rehearsal_plays_everything_and_stays_a_rehearsal(
    noisy: Lab, *, simulated: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(Scripted, "simulated", simulated)
    noisy.purpose = Purpose.REHEARSAL
    noisy.crash(3)
    noisy.resume_anyway = True
    for purpose in [Purpose.PRACTICE, *[Purpose.DATA] * simulated]:
        noisy.purpose = purpose
        with pytest.raises(ArchiveError, match="begun as a rehearsal"):
            noisy.resume()
    noisy.purpose = Purpose.REHEARSAL
    assert noisy.resume().finished
    assert "start" in noisy.noise.calls
    assert {row.device_kind for row in noisy.rows} == {"rehearsal"}
    results = [str(noisy.folder.root)]
    assert CliRunner().invoke(main, ["verify", *results]).exit_code == 0
    for command in ("analyze", "export"):
        out = ["--out" if command == "analyze" else "--bids", str(tmp_path / command)]
        refusal = CliRunner().invoke(main, [command, *results, *out, "--allow-simulated"])
        assert refusal.exit_code == 2, refusal.output
        assert "rehears" in refusal.stderr


def test_a_session_for_data_cannot_be_resumed_as_a_rehearsal_nor_rehearsed_on_a_real_device(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.crash(3)
    lab.purpose = Purpose.REHEARSAL
    with pytest.raises(ArchiveError, match="begun as data"):
        lab.resume()
    with pytest.raises(ValueError, match="this device is real"):
        require_device(is_real=True, simulated=True, purpose=Purpose.REHEARSAL)
