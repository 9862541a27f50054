"""Sessions whose levels a rule chooses: sealed, journaled, and resumed exactly."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

from experiment import draw_plan, first_study
from experiment.study.base import StudyError
from experiment.trial.plan import PlanError, plan_from_json, seal
from experiment.trial.responder import Press
from tests.test_experiment.lab import Lab, Scripted, killed_after_each_line

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from experiment.record.rows import TrialRow
    from experiment.study.study import Study
    from experiment.trial.responder import AwaitedAnswer

THRESHOLD_VPP = 90.0
LEVELS = tuple(float(level) for level in range(50, 130, 8))
RULES = [
    {"rule": "staircase"},
    {"rule": "staircase", "pooled": True, "down_after": 2, "up_steps": 1, "start_vpp": 106.0},
    {"rule": "bayesian"},
    {"rule": "bayesian", "pooled": True},
]


def study_of(**levels: object) -> Study:
    design = {
        "levels_vpp": LEVELS,
        "trials_per_side": 6,
        "both_trials": 1,
        "blank_trials": 2,
        "practice_trials": 2,
        "break_every": 8,
    }
    return first_study().changed(design=design, levels=levels)


class Threshold(Scripted):
    """Detects what is above a threshold, and lapses in every fifth trial."""

    def ask(self, question: AwaitedAnswer) -> Press | None:
        self._next("ask")
        sites = [
            site
            for site, level_vpp in zip(("left", "right"), question.levels_vpp[-1], strict=True)
            if level_vpp > THRESHOLD_VPP
        ]
        answer = "both" if len(sites) > 1 else sites[0] if sites else "none"
        if question.trial % 5 == 0:
            answer = "none"
        self._clock.wait(0.5)
        return Press(answer, self._clock.now_s())


@pytest.fixture(params=RULES, ids=lambda rule: "-".join(map(str, rule.values())))
def rule(request: pytest.FixtureRequest) -> dict[str, Any]:
    return dict(request.param)


@pytest.fixture
def lab_in(
    rule: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[[str], Lab]:
    monkeypatch.setattr("tests.test_experiment.lab.Scripted", Threshold)
    return lambda place: Lab(study_of(**rule), tmp_path / place, monkeypatch)


def presented(lab: Lab) -> list[tuple[int, str, float | None, str | None]]:
    return [(row.trial, row.side, row.level_vpp, row.response) for row in lab.rows]


def require_choices_of_the_rule(lab: Lab) -> None:
    """Every recorded choice is that of a track with the answers before it."""
    task, plan = lab.plan.task, lab.plan
    planned = {trial.number: trial for trial in plan.trials}
    tracks: dict[str, Any] = {}

    def feed(row: TrialRow) -> None:
        for site in ("",) if next(iter(plan.level_rules.values())).pooled else task.sites:
            if row.response is None or (site not in {"", row.side} and row.side != "none"):
                continue
            tracks[site].update(task.presentation(row.side), row.level_vpp, row.response)

    for rule in plan.level_rules.values():
        for site in ("",) if rule.pooled else task.sites:
            tracks[site] = rule.start(plan.responses, task)
    for row in lab.rows:
        if row.trial in planned and plan.is_chosen(planned[row.trial]) and row.level_vpp:
            track = tracks[next(iter(tracks)) if "" in tracks else row.side]
            assert row.level_vpp == track.choose(row.trial, row.attempt).level_vpp
        if row.status == "ok" and row.kind in task.kinds and not row.premature:
            feed(row)


def test_the_plan_seals_slots_and_rule_but_no_level(rule: dict[str, Any]) -> None:
    plan = draw_plan(study_of(**rule), participant="01", session="01", seed=3)
    singles = [trial for trial in plan.trials if trial.kind == "single"]
    assert len(singles) == 12
    assert {trial.level_vpp for trial in singles} == {None}
    assert all(trial.level_vpp for trial in plan.trials if trial.kind in {"both", "practice"})
    assert {each.kind for each in plan.level_rules.values()} == {rule["rule"]}
    assert plan_from_json(plan.to_json()) == plan
    with pytest.raises(PlanError, match="must have a level"):
        seal(replace(plan, level_rules={}))


def test_constant_levels_leave_plan_and_journal_without_a_word_of_rules(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab = Lab(study_of(), tmp_path, monkeypatch)
    assert lab.begin().finished
    assert "level_rules" not in lab.plan.to_json()
    assert lab.entries("level_chosen") == []


def test_a_choice_reaches_the_disk_with_the_token_and_is_the_presented_level(
    lab_in: Callable[[str], Lab],
) -> None:
    lab = lab_in("whole")
    assert lab.begin().finished
    events = [entry.event for entry in lab.entries()]
    chosen = [number for number, event in enumerate(events) if event == "level_chosen"]
    assert len(chosen) == 12
    assert {events[number + 1] for number in chosen} == {"trial_armed"}
    levels = {row.trial: row.level_vpp for row in lab.rows if row.kind == "single"}
    lines = zip(
        lab.members("level_chosen", "trial"), lab.members("level_chosen", "level_vpp"), strict=True
    )
    assert dict(lines) == levels
    assert set(levels.values()) <= {*LEVELS}
    assert all(
        max(vpp or 0.0 for vpp in row.site_levels_vpp) for row in lab.rows if row.kind == "single"
    )
    require_choices_of_the_rule(lab)
    assert lab.differences() == ()
    assert any("Vpp" in text for status in lab.display.seen for text in status.estimates)


def test_killed_after_any_line_a_session_chooses_as_its_record_says(
    lab_in: Callable[[str], Lab],
) -> None:
    whole = lab_in("whole")
    assert whole.begin().finished
    labs = [*killed_after_each_line(lab_in)]
    for lab in labs:
        require_choices_of_the_rule(lab)
        ok = [row.trial for row in lab.rows if row.status == "ok"]
        assert len(ok) == len(whole.plan.trials)
    assert len(labs) >= 4 * len(whole.plan.trials)
    exact = [presented(lab) for lab in labs].count(presented(whole))
    # Killed between two trials, it goes on as if nothing had happened.
    assert exact >= len(whole.plan.trials)


@pytest.mark.parametrize(
    ("levels", "design", "key"),
    [
        ({"pooled": True}, {}, "levels.pooled"),
        ({"rule": "bayesian", "up_steps": 2}, {}, "levels.up_steps"),
        ({"rule": "staircase", "start_vpp": 51.0}, {}, "levels.start_vpp"),
        ({"rule": "bayesian"}, {"levels_vpp": [100.0]}, "design.levels_vpp"),
        ({"rule": "bayesian"}, {"order": "balanced", "trials_per_side": 10}, "design.order"),
        ({"rule": "quest"}, {}, "levels.rule"),
    ],
)
def test_a_rule_without_a_choice_is_refused_by_its_key(
    levels: dict[str, Any], design: dict[str, Any], key: str
) -> None:
    values = {
        "levels_vpp": LEVELS,
        "trials_per_side": 6,
        "both_trials": 1,
        "blank_trials": 2,
    } | design
    with pytest.raises(StudyError) as refused:
        first_study().changed(design=values, levels=levels)
    assert [fault.key for fault in refused.value.faults] == [key]
