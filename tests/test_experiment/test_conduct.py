"""A session on a device that stays on, with a participant whose every key is scripted."""

from __future__ import annotations

import contextlib
import json
import platform
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import pytest

from device.clock import VirtualClock
from device.driver import LinkError, Outcome, Refusal, rejection
from experiment.apparatus.noise import NoiseError, NoiseFacts, NoiseHealth
from experiment.apparatus.rig import mock_device
from experiment.apparatus.slots import SuitabilityError
from experiment.archive.disk import UNWAITED
from experiment.archive.files import ArchiveError
from experiment.archive.folders import SessionFolder
from experiment.archive.history import replay
from experiment.archive.journal import Entry, Journal, JournalError, read_journal
from experiment.operator.requests import Requests, StopSignal
from experiment.session.conduct import begin, resume
from experiment.session.setting import Setting
from experiment.session.simulate import simulated_responder
from experiment.terms.responder import ESCAPE, Press, SessionPart
from experiment.trial.draw import draw_plan
from experiment.trial.plan import seal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from device.driver import Delivery
    from device.emulate.mock import MockDevice
    from experiment.operator.requests import Status
    from experiment.session.setting import Ending
    from experiment.study.study import Study
    from experiment.terms.record import TrialRow
    from experiment.terms.responder import AwaitedAnswer, Progress
    from experiment.trial.plan import Plan


class Crash(BaseException):
    """The end of the process, as far as a session in the same process can have one."""


class Scripted:
    """Answers `left` after half a second, unless the script says otherwise for the n-th call."""

    simulated = True

    def __init__(self, clock: VirtualClock, **script: Mapping[int, object]) -> None:
        self._clock = clock
        self._script = script
        self.calls: dict[str, int] = {}
        self.told: list[object] = []

    def _next(self, call: str) -> object:
        number = self.calls.get(call, 0) + 1
        self.calls[call] = number
        act = self._script.get(call, {}).get(number)
        if callable(act):
            act = act()
        if isinstance(act, BaseException):
            raise act
        return act

    def begin(self, progress: Progress) -> bool:
        return self._next("begin") is not False

    def introduce(self, part: SessionPart, progress: Progress) -> bool:
        self.told.append(part)
        return self._next("introduce") is not False

    def cue(self, progress: Progress) -> None:
        self._next("cue")
        self.told.append(progress)

    def wait(self, until_s: float) -> Press | None:
        act = self._next("wait")
        if act is not None:
            return Press(str(act), self._clock.now_s())
        self._clock.wait(max(0.0, until_s - self._clock.now_s()))
        return None

    def ask(self, question: AwaitedAnswer) -> Press | None:
        act = self._next("ask") or ("left", 0.5)
        assert isinstance(act, tuple)
        response, rt_s = act
        self._clock.wait(question.onset_s + rt_s - self._clock.now_s())
        return None if response is None else Press(response, self._clock.now_s())

    def feedback(self, *, correct: bool) -> None:
        self.told.append(correct)

    def pause(self, progress: Progress, *, paused: bool, minimum_s: float) -> bool:
        self._clock.wait(minimum_s)
        return self._next("pause") is not False

    def end(self, progress: Progress, *, finished: bool) -> None:
        self._next("end")


class FakeNoise:
    """Noise that plays, or does not, as a test says; ``ok`` is ``None`` where none is to play."""

    def __init__(self, *, ok: bool | None = True) -> None:
        self.ok = ok
        self.can_start = True
        self.calls: list[str] = []
        played = ok is not None
        self.facts = NoiseFacts(
            noise="pink" if played else "none",
            played=played,
            sha256="ab12" if played else None,
            measured_level_dba=62.5 if played else None,
        )

    def start(self) -> None:
        self.calls.append("start")
        if not self.can_start:
            raise NoiseError("the sound card is gone: plug it in")
        self.ok = None if self.ok is None else True

    def health(self) -> NoiseHealth:
        return NoiseHealth(
            ok=self.ok, words={True: "plays", False: "silent", None: "none"}[self.ok]
        )

    def stop(self) -> None:
        self.calls.append("stop")

    def lose(self) -> None:
        self.ok = False

    def lose_for_good(self) -> None:
        self.ok = self.can_start = False


class Watching:
    """Keeps what the operator was shown."""

    def __init__(self) -> None:
        self.seen: list[Status] = []

    def show(self, status: Status) -> None:
        self.seen.append(status)

    @property
    def messages(self) -> set[str]:
        return {status.message for status in self.seen} - {""}


class Lab:
    """A study, a folder and a device that outlives the sessions on it."""

    def __init__(self, study: Study, root: Path) -> None:
        self.study = study
        self.clock = VirtualClock()
        self.device: MockDevice = mock_device(study, self.clock)
        self.folder = SessionFolder(root, "01", "01", disk=UNWAITED)
        self.plan = draw_plan(study, participant="01", session="01", seed=3)
        self.responder = Scripted(self.clock)
        self.noise = FakeNoise(ok=None)
        self.requests = Requests()
        self.monitor = Watching()
        self.stop = StopSignal()

    def setting(self, **script: Mapping[int, object]) -> Setting:
        self.responder = Scripted(self.clock, **script)
        self.stop = StopSignal()
        return Setting(
            device=self.device,
            responder=self.responder,
            noise=self.noise,
            clock=self.clock,
            stop=self.stop,
            requests=self.requests,
            monitor=self.monitor,
        )

    def begin(self, **script: Mapping[int, object]) -> Ending:
        return begin(self.folder, self.plan, self.setting(**script))

    def resume(self, **script: Mapping[int, object]) -> Ending:
        return resume(self.folder, self.setting(**script))

    @property
    def rows(self) -> tuple[TrialRow, ...]:
        return replay(self.plan, read_journal(self.folder.journal_path).entries).rows

    def entries(self, event: str | None = None) -> list[Entry]:
        entries = read_journal(self.folder.journal_path).entries
        return [entry for entry in entries if event in {None, entry.event}]

    @contextlib.contextmanager
    def killed_after(self, event: str | None = None, *, lines: int = 0) -> Iterator[None]:
        """Crash after so many journal lines, or after the first of an event."""
        append, written = Journal.append, 0

        def append_and_crash(journal: Journal, name: str, *args: Any, sync: bool = False) -> None:
            nonlocal written
            append(journal, name, *args, sync=sync)
            written += 1
            if written == lines or name == event:
                raise Crash

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Journal, "append", append_and_crash)
            yield

    def statuses(self) -> list[tuple[int, int, str]]:
        return [(row.trial, row.attempt, row.status) for row in self.rows]


@pytest.fixture
def lab(tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str) -> Lab:
    return Lab(make_study(short_study_text), tmp_path)


def test_what_the_device_emitted_is_what_the_rows_say(lab: Lab) -> None:
    assert lab.begin().finished
    emitted = list(lab.device.emitted)
    assert len(emitted) == len(lab.rows) == 5
    for row, emission in zip(lab.rows, emitted, strict=True):
        left = 2 * float(abs(emission.left_v).max())
        right = 2 * float(abs(emission.right_v).max())
        assert row.level_left_vpp == pytest.approx(left, abs=0.02)
        assert row.level_right_vpp == pytest.approx(right, abs=0.02)
        assert row.level_vpp == max(row.level_left_vpp or 0.0, row.level_right_vpp or 0.0)
        assert (row.level_left_vpp == 0) == (row.side == "right")
        assert (row.level_right_vpp == 0) == (row.side == "left")
        assert row.onset_s == pytest.approx(emission.start_us * 1e-6, abs=2e-6)


def test_an_answer_is_timed_from_the_onset(lab: Lab) -> None:
    lab.begin(ask={2: ("right", 0.321)})
    assert [row.rt_s for row in lab.rows] == [0.5, 0.321, 0.5, 0.5, 0.5]
    assert [row.response for row in lab.rows][1] == "right"


def test_no_answer_an_invalid_and_an_unoffered_one_stay_in_the_record(lab: Lab) -> None:
    lab.begin(ask={1: (None, 3.0), 2: ("invalid", 0.4), 3: ("none", 0.4)})
    assert [row.response for row in lab.rows][:3] == ["timeout", "invalid", "invalid"]
    assert [row.correct for row in lab.rows][:3] == [False, False, False]
    assert {row.status for row in lab.rows} == {"ok"}


def test_a_press_before_the_onset_repeats_the_trial_without_a_stimulus(lab: Lab) -> None:
    lab.begin(wait={1: "left"})
    first = lab.rows[0]
    assert (first.status, first.anticipated, first.onset_s) == ("voided", True, None)
    assert (first.trial, 2, "ok") in lab.statuses()
    assert len(lab.device.emitted) == 5


def test_a_press_too_soon_after_the_onset_repeats_the_trial(lab: Lab) -> None:
    lab.begin(ask={1: ("left", 0.05)})
    first = lab.rows[0]
    assert (first.status, first.anticipated, first.response) == ("voided", True, None)
    assert first.onset_s is not None
    assert len(lab.device.emitted) == 6


def test_escape_pauses_and_escape_again_stops_with_the_outputs_at_zero(lab: Lab) -> None:
    ending = lab.begin(ask={2: (ESCAPE, 0.3)}, pause={1: False})
    assert not ending.finished
    assert lab.statuses()[-1][2] == "voided"
    assert lab.resume().finished
    assert sum(status == "ok" for _, _, status in lab.statuses()) == 5


def test_a_stop_from_outside_ends_the_wait_and_the_session(lab: Lab) -> None:
    setting = lab.setting()
    ask = lab.responder.ask

    def ask_and_be_stopped(question: AwaitedAnswer) -> Press | None:
        if question.trial == lab.plan.trials[2].number:
            lab.stop.ask()
        return ask(question)

    lab.responder.ask = ask_and_be_stopped  # type: ignore[method-assign] # the test's own class
    ending = begin(lab.folder, lab.plan, setting)
    assert not ending.finished
    assert lab.statuses()[-1] == (3, 1, "voided")
    assert lab.resume().finished


def test_a_device_that_stayed_on_tells_that_the_stimulus_was_felt(lab: Lab) -> None:
    with pytest.raises(Crash):
        lab.begin(ask={2: Crash()})
    assert lab.resume().finished
    assert lab.statuses()[1] == (2, 1, "voided")
    assert lab.rows[1].onset_s is None


def test_a_device_that_stayed_on_tells_that_the_stimulus_never_went_out(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fire_not(token: int) -> Delivery:
        raise Crash

    with monkeypatch.context() as patch:
        patch.setattr(lab.device, "fire", fire_not)
        with pytest.raises(Crash):
            lab.begin()
    assert lab.resume().finished
    assert lab.statuses()[0] == (1, 1, "aborted")
    assert len(lab.device.emitted) == 5


def test_a_device_that_was_started_anew_makes_it_indeterminate(lab: Lab) -> None:
    with pytest.raises(Crash):
        lab.begin(ask={2: Crash()})
    lab.device = mock_device(lab.study, lab.clock)
    assert lab.resume().finished
    assert lab.statuses()[1] == (2, 1, "indeterminate")


def test_an_indeterminate_delivery_is_recorded_and_repeated(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    fire = lab.device.fire
    fired: list[int] = []

    def lose_the_first_answer(token: int) -> Delivery:
        delivery = fire(token)
        fired.append(token)
        return replace(delivery, outcome=Outcome.INDETERMINATE) if len(fired) == 1 else delivery

    monkeypatch.setattr(lab.device, "fire", lose_the_first_answer)
    assert lab.begin().finished
    first = lab.rows[0]
    assert (first.status, first.response, first.level_left_vpp) == ("indeterminate", None, None)
    assert sum(status == "ok" for _, _, status in lab.statuses()) == 5


@pytest.mark.parametrize(
    ("call", "error", "status"),
    [
        ("arm", rejection(Refusal.CEILING, "201 Vpp"), "device_error"),
        ("fire", LinkError("no answer"), "indeterminate"),
    ],
)
def test_a_device_that_fails_stops_the_session_which_can_be_resumed(
    lab: Lab, monkeypatch: pytest.MonkeyPatch, call: str, error: Exception, status: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(lab.device, call, fail)
        ending = lab.begin()
    assert not ending.finished
    assert ending.failure is error
    assert lab.statuses() == [(1, 1, status)]
    assert lab.resume().finished


def test_nothing_is_written_between_the_onset_and_the_key(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    log: list[str] = []
    append, fire, ask = Journal.append, lab.device.fire, Scripted.ask

    def logged_append(self: Journal, event: str, *args: object, sync: bool = False) -> None:
        log.append("written")
        append(self, event, *args, sync=sync)  # type: ignore[arg-type] # handed on as it came

    def logged_fire(token: int) -> Delivery:
        log.append("onset")
        return fire(token)

    def logged_ask(self: Scripted, question: AwaitedAnswer) -> Press | None:
        press = ask(self, question)
        log.append("key")
        return press

    monkeypatch.setattr(Journal, "append", logged_append)
    monkeypatch.setattr(lab.device, "fire", logged_fire)
    monkeypatch.setattr(Scripted, "ask", logged_ask)
    lab.begin()
    onsets = [place for place, what in enumerate(log) if what == "onset"]
    assert len(onsets) == 5
    assert all(log[place + 1] == "key" for place in onsets)


def test_the_token_is_on_record_before_the_stimulus(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    fire = lab.device.fire

    def look_first(token: int) -> Delivery:
        entries = read_journal(lab.folder.journal_path).entries
        assert [e.event for e in entries[-2:]] == ["trial_armed", "stimulus_commanded"]
        assert entries[-1].facts["token"] == token
        return fire(token)

    monkeypatch.setattr(lab.device, "fire", look_first)
    assert lab.begin().finished


def test_practice_is_answered_with_feedback_and_recorded_as_practice(
    tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str
) -> None:
    text = short_study_text.replace("both_trials", "practice_trials = 2\nboth_trials")
    lab = Lab(make_study(text), tmp_path)
    assert lab.begin().finished
    assert [row.kind for row in lab.rows][:2] == ["practice", "practice"]
    told = [what for what in lab.responder.told if isinstance(what, bool)]
    assert sorted(told) == [False, True]


def test_a_person_gets_two_warm_up_trials_after_a_resume(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scripted, "simulated", False)
    with pytest.raises(Crash):
        lab.begin(ask={2: Crash()})
    assert lab.resume().finished
    warm_up = [row for row in lab.rows if row.trial > len(lab.plan.trials)]
    assert [(row.kind, row.side, row.attempt) for row in warm_up] == [
        ("practice", "left", 1),
        ("practice", "right", 1),
    ]
    planned = [row.trial for row in lab.rows if row.status == "ok" and row not in warm_up]
    assert sorted(planned) == [trial.number for trial in lab.plan.trials]


def test_every_condition_gets_its_own_burst(
    tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str
) -> None:
    conditions = '[[condition]]\nname = "one"\n[[condition]]\nname = "two"\ncycles = 2\n'
    lab = Lab(make_study(conditions + short_study_text), tmp_path)
    assert lab.begin().finished
    samples = {
        row.condition: {len(emission.left_v)}
        for row, emission in zip(lab.rows, lab.device.emitted, strict=True)
    }
    assert samples == {"one": {97}, "two": {193}}


def test_a_windowed_burst_is_emitted_with_the_planned_peak_to_peak_voltage(
    tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str
) -> None:
    lab = Lab(make_study('[burst]\nwindow = "hann"\n' + short_study_text), tmp_path)
    assert lab.begin().finished
    for row, emission in zip(lab.rows, lab.device.emitted, strict=True):
        peak_v = max(float(abs(emission.left_v).max()), float(abs(emission.right_v).max()))
        assert 2 * peak_v == pytest.approx(row.level_vpp, abs=0.02)


def test_a_session_goes_on_only_where_and_when_it_was_begun(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(Crash):
        lab.begin(ask={2: Crash()})
    lines = lab.folder.journal_path.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(platform, "node", lambda: "elsewhere")
        with pytest.raises(ArchiveError, match=r"host .* got 'elsewhere'.*--resume-anyway"):
            lab.resume()
    late_s = read_journal(lab.folder.journal_path).entries[-1].wall_s + 31 * 60
    with monkeypatch.context() as patch:
        patch.setattr("time.time", lambda: late_s)
        with pytest.raises(ArchiveError, match="interrupted 31 minutes ago, the most is 30"):
            lab.resume()
        assert lab.folder.journal_path.read_bytes() == lines
        assert resume(lab.folder, replace(lab.setting(), resume_anyway=True)).finished


def test_onsets_of_a_resumed_session_come_after_the_earlier_ones(lab: Lab) -> None:
    with pytest.raises(Crash):
        lab.begin(ask={3: Crash()})
    lab.clock = VirtualClock()
    lab.device = mock_device(lab.study, lab.clock)
    lab.resume()
    onsets = [row.onset_s for row in lab.rows if row.onset_s is not None]
    assert onsets == sorted(onsets)


def test_a_device_too_weak_for_the_study_is_refused_before_anything_is_felt(
    tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str
) -> None:
    text = short_study_text.replace("[80, 160]", "[80, 260]")
    lab = Lab(make_study(text + "[device]\nceiling_vpp = 300\n"), tmp_path)
    with pytest.raises(
        SuitabilityError, match="at most the device's own ceiling, 200 Vpp; got 260"
    ):
        lab.begin()
    assert not lab.folder.plan_path.exists()


def test_a_refused_fire_is_a_device_error_and_the_trial_comes_again(lab: Lab) -> None:
    arm = lab.device.arm
    armed: list[int] = []

    def arm_and_dawdle(token: int, slot: int, *, time_to_live_s: float) -> None:
        arm(token, slot, time_to_live_s=time_to_live_s)
        armed.append(token)
        if len(armed) == 1:
            lab.clock.wait(2 * time_to_live_s)

    lab.device.arm = arm_and_dawdle  # type: ignore[method-assign] # of this test's device alone
    assert lab.begin().finished
    assert lab.statuses()[0] == (1, 1, "device_error")
    assert len(lab.device.emitted) == 5


def test_a_second_interruption_on_a_restarted_device_leaves_the_trial_indeterminate(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(Crash):
        lab.begin(ask={1: Crash()})
    lab.device.reset()

    def crash(token: int) -> None:
        raise Crash

    with monkeypatch.context() as patch:
        patch.setattr(lab.device, "disarm", crash)
        with pytest.raises(Crash):
            lab.resume()
    assert lab.resume().finished
    assert lab.statuses()[0] == (1, 1, "indeterminate")


def test_warm_up_trials_are_never_taken_for_one_another(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scripted, "simulated", False)
    crashes: tuple[dict[int, object], ...] = (
        {2: Crash()},
        {1: ("left", 0.05), 3: Crash()},
        {2: Crash()},
    )
    for crash in crashes:
        with pytest.raises(Crash):
            lab.resume(ask=crash) if lab.folder.plan_path.exists() else lab.begin(ask=crash)
    assert lab.resume().finished
    keys = [(row.trial, row.attempt) for row in lab.rows]
    assert len(set(keys)) == len(keys)
    assert len(keys) == len(lab.device.emitted)


def test_a_session_begun_with_a_person_does_not_go_on_with_a_simulation(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(Scripted, "simulated", False)
        with pytest.raises(Crash):
            lab.begin(ask={2: Crash()})
    lines = lab.folder.journal_path.read_bytes()
    for anyway in (False, True):
        with pytest.raises(ArchiveError, match="begun with a person and can only go on so"):
            resume(lab.folder, replace(lab.setting(), resume_anyway=anyway))
    assert lab.folder.journal_path.read_bytes() == lines


def test_a_lost_journal_is_not_begun_anew_over_its_table(lab: Lab) -> None:
    lab.begin(ask={3: (ESCAPE, 0.3)}, pause={1: False})
    table = lab.folder.trials_path.read_bytes()
    journal = lab.folder.journal_path.read_bytes()
    lines = journal.splitlines(keepends=True)
    for rest in (b"", b"".join(lines[:8])):
        lab.folder.journal_path.write_bytes(rest)
        with pytest.raises(JournalError, match="at least the 3 trials of trials"):
            lab.resume()
        with pytest.raises(JournalError, match="restore it from a copy"):
            lab.folder.write_trials()
    lab.folder.journal_path.unlink()
    with pytest.raises(JournalError, match="at least the 3 trials"):
        lab.resume()
    assert lab.folder.trials_path.read_bytes() == table
    lab.folder.journal_path.write_bytes(journal)
    assert lab.resume().finished


def test_a_burst_that_the_device_would_refuse_is_refused_before_a_session_exists(
    tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str
) -> None:
    burst = '[burst]\nfrequency_hz = 5000\naccept_unfit = "a control"\n'
    lab = Lab(make_study(burst + short_study_text), tmp_path)
    with pytest.raises(SuitabilityError, match=r"condition main: .* DC part"):
        lab.begin()
    assert not lab.folder.plan_path.exists()


def test_practice_after_a_resume_is_felt_in_its_own_condition(
    tmp_path: Path,
    make_study: Callable[[str], Study],
    short_study_text: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Scripted, "simulated", False)
    conditions = '[[condition]]\nname = "one"\n[[condition]]\nname = "two"\ncycles = 2\n'
    text = short_study_text.replace("both_trials", "practice_trials = 3\nboth_trials")
    first = set()
    for seed in range(8):
        lab = Lab(make_study(conditions + text), tmp_path / str(seed))
        lab.plan = draw_plan(lab.study, participant="01", session="01", seed=seed)
        first.add(lab.plan.trials[0].condition)
        with pytest.raises(Crash):
            lab.begin(ask={2: Crash()})
        assert lab.resume().finished
        felt = [row for row in lab.rows if row.level_left_vpp is not None or row.status == "voided"]
        for row, emission in zip(felt, lab.device.emitted, strict=True):
            assert len(emission.left_v) == {"one": 97, "two": 193}[row.condition]
    assert first == {"one", "two"}


# --- masking noise --------------------------------------------------------------------------------


def test_noise_that_plays_is_ok_in_every_row_and_stopped_at_the_end(lab: Lab) -> None:
    lab.noise = FakeNoise()
    assert lab.begin().finished
    assert {row.noise_ok for row in lab.rows} == {True}
    assert lab.noise.calls[0] == "start"
    assert set(lab.noise.calls[1:]) == {"stop"}
    assert [e.facts["ok"] for e in lab.entries("noise_status")] == [True]


def test_where_no_noise_is_to_play_the_rows_say_neither_way(lab: Lab) -> None:
    assert lab.begin().finished
    assert {row.noise_ok for row in lab.rows} == {None}
    assert not lab.entries("noise_status")


def test_noise_lost_before_the_stimulus_aborts_the_trial_unfelt(lab: Lab) -> None:
    lab.noise = FakeNoise()
    assert lab.begin(wait={2: lab.noise.lose}).finished
    assert lab.statuses()[1] == (2, 1, "aborted")
    assert [row.noise_ok for row in lab.rows] == [True, False, True, True, True, True]
    assert len(lab.device.emitted) == 5
    assert lab.responder.calls["pause"] == 1 + 1  # and the break
    assert lab.noise.calls.count("start") == 2


def test_noise_lost_at_the_onset_voids_the_trial(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    lab.noise = FakeNoise()
    fire = lab.device.fire

    def fire_and_fall_silent(token: int) -> Delivery:
        if len(lab.device.emitted) == 1:
            lab.noise.lose()
        return fire(token)

    monkeypatch.setattr(lab.device, "fire", fire_and_fall_silent)
    # it comes back by itself before the answer: what was felt at the onset may have been heard
    assert lab.begin(ask={2: lab.noise.start}).finished
    lost = lab.rows[1]
    assert (lost.status, lost.noise_ok, lost.response) == ("voided", False, None)
    assert (lost.trial, 2, "ok") in lab.statuses()
    assert len(lab.device.emitted) == 6


@pytest.mark.parametrize("answer", [("left", 0.5), (ESCAPE, 0.3), ("left", 0.05), (None, 3.0)])
def test_noise_lost_while_the_answer_is_awaited_voids_the_trial(
    lab: Lab, answer: tuple[str | None, float]
) -> None:
    lab.noise = FakeNoise()

    def lose_and_answer() -> tuple[str | None, float]:
        lab.noise.lose()
        return answer

    assert lab.begin(ask={3: lose_and_answer}).finished
    lost = lab.rows[2]
    assert (lost.status, lost.noise_ok, lost.response) == ("voided", False, None)
    assert lost.onset_s is not None
    assert lab.noise.calls.count("start") == 2
    assert [e.facts["ok"] for e in lab.entries("noise_status")] == [True, False, True]
    assert lab.monitor.messages == {"masking noise: silent; put it right, then go on"}
    assert lab.monitor.seen[-1].message == ""


def test_a_gap_that_is_over_voids_its_trial_and_stays_on_record(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.noise = FakeNoise()
    health, gaps = lab.noise.health, 0

    def health_since_last_asked() -> NoiseHealth:
        found = replace(health(), underruns=gaps)
        lab.noise.ok = True
        return found

    def gap() -> None:
        nonlocal gaps
        lab.noise.ok, gaps = False, gaps + 1

    monkeypatch.setattr(lab.noise, "health", health_since_last_asked)
    assert lab.begin(ask={2: gap}, cue={4: gap}).finished
    # one in an answer window, one in a foreperiod
    assert [s for _, _, s in lab.statuses()] == ["ok", "voided", "ok", "aborted", *["ok"] * 3]
    told = [(e.facts["ok"], e.facts["underruns"]) for e in lab.entries("noise_status")]
    assert told == [(True, 0), (False, 1), (True, 1), (False, 2), (True, 2)]


def test_noise_that_never_plays_again_pauses_until_the_session_is_stopped(lab: Lab) -> None:
    lab.noise = FakeNoise()
    assert not lab.begin(ask={2: lab.noise.lose_for_good}, pause={4: False}).finished
    assert lab.responder.calls["pause"] == 4
    assert lab.responder.calls["cue"] == 2
    assert "the sound card is gone: plug it in" in lab.monitor.messages
    told = [e.facts["words"] for e in lab.entries("noise_status")]
    assert told == ["plays", "silent", *["the sound card is gone: plug it in"] * 3]
    lab.noise.can_start = True
    assert lab.resume().finished
    assert sum(status == "ok" for _, _, status in lab.statuses()) == 5


def test_noise_that_cannot_be_played_at_all_leaves_no_session(lab: Lab) -> None:
    lab.noise = FakeNoise()
    lab.noise.can_start = False
    with pytest.raises(NoiseError, match="plug it in"):
        lab.begin()
    assert not lab.folder.plan_path.exists()
    assert lab.noise.calls == ["start", "stop"]
    lab.noise.can_start = True
    assert lab.begin().finished
    lab.noise.can_start = False
    assert lab.resume().finished  # nothing is left to hear


def test_the_header_says_what_noise_was_played(lab: Lab) -> None:
    lab.noise = FakeNoise()
    lab.begin(ask={2: (ESCAPE, 0.3)}, pause={1: False})
    header = json.loads((lab.folder.path / "header.json").read_text("utf-8"))
    assert (header["masking_noise"], header["masking_noise_played"]) == ("pink", True)
    assert (header["noise_sha256"], header["noise_level_dba"]) == ("ab12", 62.5)
    assert header["noise_sound_card"] == "n/a"
    assert lab.resume().finished
    assert lab.entries("session_resume")[0].facts["noise_sha256"] == "ab12"


def test_an_answer_on_record_keeps_what_was_known_of_its_noise(lab: Lab) -> None:
    lab.noise = FakeNoise()
    with lab.killed_after("response"), pytest.raises(Crash):
        lab.begin()
    assert lab.resume().finished
    assert (lab.rows[0].status, lab.rows[0].noise_ok) == ("ok", True)


# --- the operator ---------------------------------------------------------------------------------


def test_the_operators_pause_comes_after_the_trial_and_is_over_when_it_ends(lab: Lab) -> None:
    assert lab.begin(ask={2: lab.requests.pause}).finished
    events = [e.event for e in lab.entries()]
    assert events[events.index("pause") - 1] == "trial_end"
    assert events.count("pause") == 1
    assert {status for _, _, status in lab.statuses()} == {"ok"}
    assert not lab.requests.paused


def test_a_pause_may_be_asked_for_before_the_first_trial(lab: Lab) -> None:
    lab.requests.pause()
    assert lab.begin().finished
    assert [e.event for e in lab.entries()][:2] == ["session_open", "pause"]


def test_a_pause_that_was_taken_back_is_none(lab: Lab) -> None:
    def ask_and_take_back() -> None:
        lab.requests.pause()
        lab.requests.go_on()

    asked = []
    script = {1: lambda: asked.append(lab.requests.take_go_on())}
    assert lab.begin(ask={2: ask_and_take_back}, pause=script).finished
    assert not lab.entries("pause")
    assert asked == [False]  # the break: what was asked for before it does not end it


def test_going_on_asked_for_in_a_pause_reaches_the_participants_screen(lab: Lab) -> None:
    asked = []

    def show(status: Status) -> None:
        if status.phase == "paused":
            lab.requests.go_on()

    lab.monitor.show = show  # type: ignore[method-assign] # of this test's operator alone
    script = {1: lambda: asked.append(lab.requests.take_go_on())}
    assert lab.begin(ask={2: lab.requests.pause}, pause=script).finished
    assert asked == [True]


def test_notes_are_journaled_between_trials_and_at_the_end(lab: Lab) -> None:
    def note() -> None:
        lab.requests.note("chair moved")
        lab.requests.note("door")

    lab.begin(ask={2: note}, pause={1: lambda: lab.requests.note("in the break")})
    assert [e.facts["text"] for e in lab.entries("note")] == ["chair moved", "door", "in the break"]
    lab = Lab(lab.study, lab.folder.root / "stopped")

    def note_and_stop() -> bool:
        lab.requests.note("tired")
        return False

    lab.begin(pause={1: note_and_stop})
    assert [e.event for e in lab.entries()][-2:] == ["note", "session_close"]


def test_the_operator_may_stop_the_session_from_beside_it(lab: Lab) -> None:
    def ask_to_stop() -> None:
        lab.stop.ask()

    assert not lab.begin(pause={1: ask_to_stop}).finished
    assert "end" not in lab.responder.calls
    assert lab.resume().finished
    assert lab.responder.calls["end"] == 1


def test_the_operator_sees_how_the_session_stands(lab: Lab) -> None:
    lab.noise = FakeNoise()
    lab.begin(ask={1: ("right", 0.5)})
    phases = [status.phase for status in lab.monitor.seen]
    expected = ["ready", "welcome", "ready", "introduction", "ready"]
    assert phases[: len(expected)] == expected
    assert phases[-1] == "finished"
    assert {"foreperiod", "break"} < set(phases)
    assert not {"arming", "firing", "answer"} & set(phases)
    last = lab.monitor.seen[-1]
    assert (last.done, last.planned, last.block, last.blocks) == (5, 5, 2, 2)
    assert (last.noise, last.device, last.left_s) == ("plays", "ok", 0.0)
    for side in ("left", "right"):
        rows = [row for row in lab.rows if (row.kind, row.side) == ("single", side)]
        assert last.tallies[side].presented == len(rows) == 2
        assert last.tallies[side].correct == sum(row.correct is True for row in rows)
        assert last.tallies[side].last == tuple(row.response for row in rows)


def test_the_time_left_is_that_of_the_trials_at_their_mean_pace(lab: Lab) -> None:
    lab.begin()
    left = {s.done: s.left_s for s in lab.monitor.seen if s.phase == "ready"}
    trial_s = 0.5 + 0.015
    assert left[4] == pytest.approx(trial_s, abs=0.02)
    assert left[2] == pytest.approx(3 * trial_s + lab.study.design.minimum_break_s, abs=0.1)
    assert sorted(left.values(), reverse=True) == [left[done] for done in sorted(left)]


def test_a_resumed_session_shows_the_answers_of_before(lab: Lab) -> None:
    with pytest.raises(Crash):
        lab.begin(ask={4: Crash()})
    before = sum(row.kind == "single" and row.status == "ok" for row in lab.rows)
    lab.monitor.seen.clear()
    lab.resume()
    first = lab.monitor.seen[0]
    assert sum(tally.presented for tally in first.tallies.values()) == before > 0
    assert first.done == 3


def test_the_operator_is_told_what_the_device_failed_with(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise LinkError("no answer")

    monkeypatch.setattr(lab.device, "arm", fail)
    lab.begin()
    assert (lab.monitor.seen[-1].device, lab.monitor.seen[-1].message) == ("failed", "no answer")


def test_whatever_happens_nothing_is_written_or_shown_between_the_onset_and_the_key(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    log: list[str] = []
    append, fire, ask, show = Journal.append, lab.device.fire, Scripted.ask, Watching.show
    lab.noise = FakeNoise()

    def logged_append(self: Journal, event: str, *args: object, sync: bool = False) -> None:
        log.append("written")
        append(self, event, *args, sync=sync)  # type: ignore[arg-type] # handed on as it came

    def logged_fire(token: int) -> Delivery:
        log.append("onset")
        return fire(token)

    def logged_show(self: Watching, status: Status) -> None:
        log.append("shown")
        show(self, status)

    def logged_ask(self: Scripted, question: AwaitedAnswer) -> Press | None:
        lab.requests.note("while an answer is awaited")
        lab.requests.pause()
        if len(lab.device.emitted) % 2:
            lab.noise.lose()
        press = ask(self, question)
        log.append("key")
        return press

    monkeypatch.setattr(Journal, "append", logged_append)
    monkeypatch.setattr(lab.device, "fire", logged_fire)
    monkeypatch.setattr(Scripted, "ask", logged_ask)
    monkeypatch.setattr(Watching, "show", logged_show)
    assert lab.begin().finished
    onsets = [place for place, what in enumerate(log) if what == "onset"]
    assert len(onsets) == 10
    assert all(log[place + 1] == "key" for place in onsets)


# --- the parts of a session -----------------------------------------------------------------------


def with_control(plan: Plan) -> Plan:
    """Return the plan with an audibility check before it and a control block after it."""
    first = replace(plan.trials[0], kind="control", side="left", level_vpp=160.0)
    check = (replace(first, block=-1), replace(first, block=-1, side="right"))
    control = (replace(first, block=9), replace(first, block=9, side="right"))
    trials = enumerate((*check, *plan.trials, *control), start=1)
    numbered = tuple(replace(trial, number=number) for number, trial in trials)
    warm_up = tuple(replace(t, number=t.number + 4) for t in plan.warm_up)
    return seal(replace(plan, trials=numbered, warm_up=warm_up))


def test_parts_are_introduced_in_their_order_and_again_after_a_resume(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scripted, "simulated", False)
    lab.plan = with_control(lab.plan)
    with pytest.raises(Crash):
        lab.begin(ask={4: Crash()})
    assert [what for what in lab.responder.told if isinstance(what, SessionPart)] == [
        SessionPart.AUDIBILITY,
        SessionPart.MAIN,
    ]
    assert lab.resume().finished
    told = [what for what in lab.responder.told if isinstance(what, SessionPart)]
    assert told == [SessionPart.WARM_UP, SessionPart.MAIN, SessionPart.CONTROL]
    assert (lab.responder.calls["begin"], lab.responder.calls["end"]) == (1, 1)


def test_warm_up_comes_only_before_a_trial_on_the_plate(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scripted, "simulated", False)
    lab.plan = with_control(lab.plan)
    parts = []
    for sitting, last in enumerate((1, 9, 4, None)):
        go_on = lab.resume if sitting else lab.begin
        if last is None:
            assert go_on().finished
        else:
            with pytest.raises(Crash):
                go_on(ask={last: Crash()})
        parts.append([what for what in lab.responder.told if isinstance(what, SessionPart)])
    assert parts == [
        [SessionPart.AUDIBILITY],
        [SessionPart.AUDIBILITY, SessionPart.WARM_UP, SessionPart.MAIN],
        [SessionPart.WARM_UP, SessionPart.MAIN, SessionPart.CONTROL],
        [SessionPart.CONTROL],
    ]


def test_none_is_an_answer_with_the_fingers_off_the_plate_and_no_displacement_is_told(
    lab: Lab,
) -> None:
    lab.plan = with_control(lab.plan)
    assert lab.begin(ask=dict.fromkeys(range(1, 10), ("none", 0.5))).finished
    for row in lab.rows:
        control = row.kind == "control"
        assert row.response == ("none" if control else "invalid")
        if control:
            assert (row.peak_left_um, row.displacement_basis) == (None, None)
            assert 160.0 in {row.level_left_vpp, row.level_right_vpp}
            assert row.correct is False


def test_a_simulated_participant_feels_nothing_with_the_fingers_off_the_plate(
    tmp_path: Path, make_study: Callable[[str], Study], short_study_text: str
) -> None:
    people = "[simulation]\nthreshold_vpp = 30\ncrosstalk_db = -30\n"
    lab = Lab(make_study(short_study_text + people), tmp_path)
    lab.plan = with_control(lab.plan)
    setting = replace(lab.setting(), responder=simulated_responder(lab.study, lab.plan, lab.clock))
    assert begin(lab.folder, lab.plan, setting).finished
    answers = [row.response for row in lab.rows if row.kind == "control"]
    assert len(answers) == 4
    assert answers.count("none") >= 2


@pytest.mark.parametrize("call", ["begin", "introduce"])
def test_a_participant_may_stop_at_the_welcome_and_before_a_part(lab: Lab, call: str) -> None:
    script: dict[str, Mapping[int, object]] = {call: {1: False}}
    assert not lab.begin(**script).finished
    assert lab.rows == ()
    assert lab.responder.calls["end"] == 1
    assert lab.resume().finished


# --- killed at every line -------------------------------------------------------------------------


@pytest.mark.slow
def test_killed_after_any_line_of_a_lively_session_it_is_resumed_and_loses_nothing(
    make_study: Callable[[str], Study], short_study_text: str, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(Scripted, "simulated", False)
    study = make_study(short_study_text)
    kills = 0
    while True:
        lab = Lab(study, tmp_path / str(kills))
        lab.plan = with_control(lab.plan)
        lab.noise = FakeNoise()
        kills += 1
        lively: dict[str, Mapping[int, object]] = {
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
        numbers = range(1, len(lab.plan.trials) + 1)
        for number in numbers:
            attempts = [row for row in lab.rows if row.trial == number]
            assert [row.attempt for row in attempts] == list(range(1, len(attempts) + 1))
            assert [row.status for row in attempts].count("ok") == 1
            assert attempts[-1].status == "ok"
            assert attempts[-1].noise_ok is True
        assert {row.status for row in lab.rows if row.noise_ok is False} <= {"voided", "aborted"}
    assert kills > 5 * len(lab.plan.trials)
