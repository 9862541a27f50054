"""A session on a device that stays on, with a participant whose every key is scripted."""

from __future__ import annotations

import platform
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from device.clock import VirtualClock
from device.driver import LinkError, Outcome, Refusal, rejection
from experiment.archive import ArchiveError, SessionFolder
from experiment.conduct import Setting, begin, resume
from experiment.draw import draw_plan
from experiment.interrupts import StopSignal
from experiment.journal import Journal, JournalError, read_journal
from experiment.noise_player import NoiseError, NoiseFacts, NoiseHealth
from experiment.operator import Requests
from experiment.replay import replay
from experiment.responder import ESCAPE, Press
from experiment.rig import mock_device
from experiment.stimulus import SuitabilityError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from device.driver import Delivery
    from device.mock import MockDevice
    from experiment.conduct import Ending
    from experiment.operator import Status
    from experiment.record import TrialRow
    from experiment.responder import Part, Progress, Question
    from experiment.study import Study


class Crash(BaseException):
    """The end of the process, as far as a session in the same process can have one."""


class Scripted:
    """Answers `left` after half a second, unless the script says otherwise for the n-th call."""

    simulated = True

    def __init__(self, clock: VirtualClock, **script: dict[int, object]) -> None:
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

    def introduce(self, part: Part, progress: Progress) -> bool:
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

    def ask(self, question: Question) -> Press | None:
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
        self.folder = SessionFolder(root, "01", "01", durable=False)
        self.plan = draw_plan(study, participant="01", session="01", seed=3)
        self.responder = Scripted(self.clock)
        self.noise = FakeNoise(ok=None)
        self.requests = Requests()
        self.monitor = Watching()
        self.stop = StopSignal()

    def setting(self, **script: dict[int, object]) -> Setting:
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

    def begin(self, **script: dict[int, object]) -> Ending:
        return begin(self.folder, self.plan, self.setting(**script))

    def resume(self, **script: dict[int, object]) -> Ending:
        return resume(self.folder, self.setting(**script))

    @property
    def rows(self) -> tuple[TrialRow, ...]:
        return replay(self.plan, read_journal(self.folder.journal_path).entries).rows

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

    def ask_and_be_stopped(question: Question) -> Press | None:
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

    def logged_ask(self: Scripted, question: Question) -> Press | None:
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
