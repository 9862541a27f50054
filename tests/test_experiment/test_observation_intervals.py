"""Sessions whose trials have several bursts: a trial counts only with each of them, once."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Any

import pytest

from device.driver import Outcome
from experiment import first_study
from experiment.tasks import TASKS
from experiment.trial.responder import Press
from tests.test_experiment.lab import Lab, Scripted, killed_after_each_line

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.study.study import Study
    from experiment.trial.responder import AwaitedAnswer

LEVELS = (60.0, 80.0, 120.0, 140.0)
DESIGN: dict[str, Any] = {"levels_vpp": LEVELS, "break_every": 3}
KINDS = [kind for kind in TASKS if kind != "left-right-both"]
REFERENCE_VPP = 100.0


def study_of(kind: str, per_side: int = 2, **levels: object) -> Study:
    task = {"kind": kind} | ({"reference_vpp": REFERENCE_VPP} if "amplitude" in kind else {})
    more = {"blank_trials": 1} if kind == "yes-no" else {}
    practice = {"practice_trials": 1, "hands_off_trials_after": 2 * (per_side - 1)}
    practice["trials_per_side"] = per_side
    return first_study().changed(task=task, design=DESIGN | more | practice, levels=levels)


class Strongest(Scripted):
    """Answers the interval or site with the highest level; by yes and no, if there was a burst."""

    def ask(self, question: AwaitedAnswer) -> Press | None:
        self._next("ask")
        levels_vpp = [max(levels) for levels in question.levels_vpp]
        if len(levels_vpp) == 1:
            levels_vpp = [*question.levels_vpp[0]]
        answer = question.answers[levels_vpp.index(max(levels_vpp))]
        if "yes" in question.answers:
            answer = "yes" if any(levels_vpp) else "no"
        self._clock.wait(0.5)
        return Press(answer, self._clock.now_s())


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def lab_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, Study], Lab]:
    monkeypatch.setattr("tests.test_experiment.lab.Scripted", Strongest)
    return lambda place, study: Lab(study, tmp_path / place, monkeypatch)


def require_every_burst(lab: Lab) -> None:
    """Each trial that counts had all of its bursts, once each, at the levels of its plan."""
    task, n_intervals = lab.plan.task, lab.plan.task.n_intervals
    armed = lab.members("trial_armed", "token")
    assert sorted(armed) == sorted({*armed})
    ok = {(row.trial, row.attempt): row for row in lab.rows if row.status == "ok"}
    levels: dict[tuple[int, int], list[list[float]]] = {}
    for entry in lab.entries("stimulus_confirmed"):
        line: Any = entry.line
        key = line.trial, line.attempt
        if key not in ok:
            continue
        assert line.outcome is Outcome.FIRED
        levels.setdefault(key, []).append([*line.levels_vpp])
        assert line.interval == len(levels[key]) <= n_intervals
    assert levels == {
        key: task.levels_vpp(row.side, row.level_vpp or 0.0) for key, row in ok.items()
    }


def test_a_session_presents_every_interval_and_answers_follow(
    kind: str, lab_in: Callable[[str, Study], Lab]
) -> None:
    lab = lab_in("whole", study_of(kind))
    assert lab.begin().finished
    assert {row.status for row in lab.rows} == {"ok"}
    require_every_burst(lab)
    assert all(row.correct is not False for row in lab.rows)
    n_single = Counter((row.side) for row in lab.rows if row.kind == "single")
    of_site = Counter(lab.plan.task.presentation(side).site for side in n_single.elements())
    assert set(of_site.values()) == {2}
    assert len(set(n_single.values())) == 1 or lab.plan.task.n_intervals == 3
    for row in (row for row in lab.rows if row.kind == "single"):
        site = lab.plan.task.presentation(row.side).site
        assert row.level_vpp in LEVELS
        assert row.site_levels_vpp == (
            (row.level_vpp, 0.0) if site == "left" else (0.0, row.level_vpp)
        )
    assert lab.differences() == ()


def test_intervals_are_a_gap_and_a_foreperiod_apart(lab_in: Callable[[str, Study], Lab]) -> None:
    study = study_of("3ifc")
    lab = lab_in("whole", study)
    assert lab.begin().finished
    onsets: dict[int, list[float]] = {}
    for entry in lab.entries("stimulus_confirmed"):
        line: Any = entry.line
        onsets.setdefault(line.trial, []).append(line.onset_s)
    planned = {trial.number: trial for trial in lab.plan.trials}
    for number, (first, second, third) in onsets.items():
        apart_s = 0.5 + planned[number].foreperiod_s
        assert second - first == pytest.approx(apart_s, abs=0.01)
        assert third - second == pytest.approx(apart_s, abs=0.01)
    rows = {row.trial: [*row.earlier_onsets_s, row.onset_s] for row in lab.rows}
    assert rows == onsets
    heading = lab.folder.trials_path.read_text("utf-8").partition("\n")[0]
    assert ",onset_1_s,onset_2_s,onset_s," in heading


@pytest.mark.parametrize("call", [1, 2, 3])
def test_an_answer_before_the_last_burst_voids_the_trial(
    call: int, lab_in: Callable[[str, Study], Lab]
) -> None:
    lab = lab_in("whole", study_of("2ifc"))
    # The first call of a trial is the foreperiod, the second the gap, the third a foreperiod.
    assert lab.begin(wait={call: "first"}).finished
    assert [(row.trial, row.status) for row in lab.rows[:1]] == [(1, "voided")]
    assert lab.rows[0].premature
    bursts = [e for e in lab.entries("stimulus_confirmed") if e.line.trial == 1]  # type: ignore[union-attr]
    assert len(bursts) == (call > 1) + 2
    require_every_burst(lab)


def test_killed_after_any_line_no_trial_counts_without_all_of_its_bursts(
    kind: str, lab_in: Callable[[str, Study], Lab]
) -> None:
    levels = {} if "amplitude" in kind else {"rule": "bayesian", "pooled": True}
    study = study_of(kind, per_side=1, **levels)
    labs = [*killed_after_each_line(lambda place: lab_in(place, study))]
    for lab in labs:
        require_every_burst(lab)
        assert {row.status for row in lab.rows} <= {"ok", "voided", "aborted", "indeterminate"}
    assert len(labs) >= 4 * len(labs[0].plan.trials)
