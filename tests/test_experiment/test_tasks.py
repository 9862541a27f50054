"""Every task: its presentations, answers and decision rule agree with each other."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from experiment import first_study
from experiment.study.base import StudyError
from experiment.tasks import SITES, TASKS, make_task
from experiment.tasks.task import BLANK, SINGLE, Burst, Guessing, Presentation, Sensation

if TYPE_CHECKING:
    from experiment.tasks.task import Task

REFERENCE_VPP = 100.0
EVERY = [make_task(kind) for kind in TASKS]
EVERY = [replace(t, reference_vpp=REFERENCE_VPP) if t.has_reference else t for t in EVERY]
TASK = pytest.mark.parametrize("task", EVERY, ids=lambda task: task.name)
NEVER, ALWAYS = np.zeros((1, 1)), np.ones((1, 1))
UNBIASED = Guessing(NEVER, ALWAYS / 2, NEVER)


def offers(task: Task) -> list[tuple[str, ...]]:
    """Every set of answers that a study may offer."""
    optional = task.optional_answers
    sets = [{*chosen} for n in range(len(optional) + 1) for chosen in combinations(optional, n)]
    return [
        tuple(n for n in task.answer_names if n not in optional or n in chosen) for chosen in sets
    ]


def sensations(task: Task, presentation: str, strength: float = 9.0) -> list[Sensation]:
    """What somebody senses who detects every burst; a stronger one is felt to be stronger."""
    return [
        Sensation(
            detected=[ALWAYS * (level > 0) for level in levels],
            amplitudes=[ALWAYS * level for level in levels],
            strengths=[ALWAYS * (strength * level if level else -math.inf) for level in levels],
        )
        for levels in task.levels_vpp(presentation, 2 * REFERENCE_VPP)
    ]


@TASK
def test_answers_and_presentations_name_sites_of_the_task(task: Task) -> None:
    assert {answer.name for answer in task.answers} >= {p.correct for p in task.presentations}
    assert task.keys.keys() == {*task.answer_names}
    assert task.reversed_mapping.keys() <= {*task.answer_names}
    for site in task.sites:
        intervals = [{p.interval for p in task.at_site(site)}]
        assert intervals == [{*range(task.n_intervals)}]
    for presentation in task.presentations:
        level_vpp = 2 * REFERENCE_VPP if presentation.sites else None
        correct = presentation.correct
        assert task.is_correct(presentation.name, level_vpp, correct)
        assert task.is_correct(presentation.name, level_vpp, None) is None
        levels_vpp = task.levels_vpp(presentation.name, 7.0)
        assert [*map(len, levels_vpp)] == [len(task.sites)] * task.n_intervals
        at_level = [task.sites[i] for levels in levels_vpp for i, v in enumerate(levels) if v == 7]
        assert (*at_level,) == presentation.sites


@TASK
def test_only_the_correct_answer_detects_a_stimulus_and_any_other_is_a_false_alarm(
    task: Task,
) -> None:
    for presentation in task.presentations:
        for answer in task.answer_names:
            correct = answer == presentation.correct
            expected = answer != task.nothing if presentation.kind == BLANK else correct
            assert task.is_detected(presentation.name, answer) == expected
        assert not task.is_detected(presentation.name, "timeout")


def test_a_comparison_below_the_reference_is_answered_by_the_interval_of_the_reference() -> None:
    task = make_task("amplitude-discrimination", REFERENCE_VPP)
    for level_vpp, answers in ((101.0, (True, False)), (99.0, (False, True)), (100.0, (None,) * 2)):
        assert [task.is_correct("left_1", level_vpp, a) for a in ("first", "second")] == [*answers]
        assert [task.is_correct("left_2", level_vpp, a) for a in ("second", "first")] == [*answers]
        assert task.is_detected("left_1", "first")


@TASK
def test_instructions_and_guess_rates_follow_the_offered_answers(task: Task) -> None:
    for responses in offers(task):
        assert task.instructions[frozenset(responses) & frozenset(task.optional_answers)]
        blank = task.nothing in responses
        chance = 0.0 if task.has_reference else 1 / len(responses)
        assert task.guess_rate(responses) == (None if blank else chance)
        assert task.nothing in {*task.offered(responses, hands_off=True), None}
        assert task.offered(responses, hands_off=False) == responses


@TASK
def test_the_decision_rule_gives_probabilities_that_sum_to_one(task: Task) -> None:
    rng = np.random.default_rng(1)
    n_sites, shape = len(task.sites), (5, 7)
    intervals = [
        Sensation(
            [*rng.random((n_sites, *shape))],
            [*rng.choice([0.0, 1.0, 2.0], (n_sites, *shape))],
            [*rng.choice([-math.inf, 0.5, 2.0], (n_sites, *shape))],
        )
        for _ in range(task.n_intervals)
    ]
    guessing = Guessing(*rng.random((3, shape[0], 1)))
    for responses in offers(task):
        decided = task.decide(intervals, responses, guessing)
        assert decided.keys() == {*responses}
        assert np.allclose(sum(decided.values()), 1.0)
        assert min(p.min() for p in decided.values()) >= 0.0


@TASK
def test_whoever_detects_everything_and_nothing_else_answers_correctly(task: Task) -> None:
    guessing = Guessing(NEVER, NEVER, NEVER)
    for presentation in task.presentations:
        felt = sensations(task, presentation.name)
        decided = task.decide(felt, task.answer_names, guessing)
        assert decided[presentation.correct] == pytest.approx(1.0)


@TASK
def test_whoever_detects_nothing_is_correct_at_the_guess_rate(task: Task) -> None:
    silent = Sensation(*([NEVER * 0 - (i == 2) * 1e9 for _ in SITES] for i in range(3)))
    for shown in task.of_kind(SINGLE):
        decided = task.decide([silent] * task.n_intervals, task.answer_names, UNBIASED)
        p = decided[shown.correct].item()
        rate = 0.0 if task.nothing else 1 / len(task.answer_names)
        assert p == pytest.approx(rate)


def test_two_bursts_are_told_apart_by_the_difference_of_two_normal_sensations() -> None:
    task = make_task("amplitude-discrimination", REFERENCE_VPP)
    first, second = 1.3, 1.9
    felt = [Sensation([ALWAYS], [ALWAYS], [ALWAYS * strength]) for strength in (first, second)]
    expected = NormalDist(sigma=math.sqrt(2)).cdf(second - first)
    assert task.decide(felt, task.answer_names, UNBIASED)["second"] == pytest.approx(expected)


def test_detection_in_one_of_three_intervals_follows_the_high_threshold_model() -> None:
    task, p = make_task("3ifc"), 0.37
    felt = [Sensation([ALWAYS * p * (i == 1)], [ALWAYS], [ALWAYS]) for i in range(3)]
    decided = task.decide(felt, task.answer_names, UNBIASED)
    assert decided["second"].item() == pytest.approx(p + (1 - p) / 3)
    assert decided["first"].item() == decided["third"].item() == pytest.approx((1 - p) / 3)


@TASK
def test_contradictions_of_a_task_are_refused(task: Task) -> None:
    first = task.presentations[0]
    changes: list[dict[str, Any]] = [
        {"presentations": (*task.presentations, first)},
        {"presentations": (*task.presentations, replace(first, name="x", correct="nowhere"))},
        {"presentations": (*task.presentations, replace(first, name="x", bursts=first.bursts * 2))},
        {"answers": (*task.answers, task.answers[0])},
        {"nothing": "nobody"},
        {"kinds": {}},
        {"sites": task.sites[:1]},
        {"presentations": ()},
        {"instructions": {}},
        {"texts": {}},
        {"scoring": "guess"},
        {"answers": (*task.answers, replace(task.answers[0], name="timeout"))},
    ]
    for change in changes:
        with pytest.raises(ValueError, match="contradicts itself"):
            replace(task, **change)


@pytest.mark.parametrize(
    ("task", "design", "key"),
    [
        ({"kind": "2afc"}, {}, "task.kind"),
        ({"gap_s": 0.5}, {}, "task.gap_s"),
        ({"kind": "2ifc", "reference_vpp": 100.0}, {}, "task.reference_vpp"),
        ({"kind": "amplitude-discrimination"}, {}, "task.reference_vpp"),
        (
            {"kind": "amplitude-discrimination", "reference_vpp": 1e4},
            {},
            "task.reference_vpp",
        ),
        ({"kind": "3ifc"}, {"both_trials": 3}, "design.both_trials"),
        ({"kind": "2ifc"}, {"blank_trials": 3}, "design.blank_trials"),
        ({"kind": "yes-no"}, {"both_level": 100.0}, "design.both_level"),
        ({"kind": "yes-no"}, {"responses": ["yes"], "blank_trials": 1}, "design.responses"),
        ({"kind": "yes-no"}, {"responses": ["left", "right"]}, "design.responses[0]"),
    ],
)
def test_what_a_task_does_not_use_is_refused_by_its_key(
    task: dict[str, Any], design: dict[str, Any], key: str
) -> None:
    with pytest.raises(StudyError) as refused:
        first_study().changed(task=task, design={"levels_vpp": [50.0, 100.0]} | design)
    assert key in [fault.key for fault in refused.value.faults]


def test_practice_is_at_the_level_that_differs_most_from_the_reference() -> None:
    levels_vpp = (50.0, 80.0, 100.0, 130.0)
    assert make_task("2ifc").easiest_vpp(levels_vpp) == 130.0
    for reference_vpp, easiest_vpp in ((130.0, 50.0), (50.0, 130.0), (100.0, 50.0)):
        task = make_task("amplitude-discrimination", reference_vpp)
        assert task.easiest_vpp(levels_vpp) == easiest_vpp


def test_a_trial_is_measured_where_its_site_is_driven() -> None:
    bursts = (Burst(("left",)), Burst(("right",)))
    shown = Presentation(name="x", kind=SINGLE, bursts=bursts, correct="", site="right", meaning="")
    assert shown.interval == 1
    assert replace(shown, site="left").interval == 0
    assert replace(shown, site=None).interval == 0
