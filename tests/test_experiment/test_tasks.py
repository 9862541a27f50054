"""Every task: its presentations, answers and decision rule agree with each other."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from experiment.tasks import TASKS
from experiment.tasks.task import Guessing, Task

TASK = pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)


def offers(task: Task) -> list[tuple[str, ...]]:
    """Every set of answers that a study may offer: the sites, and any of the others."""
    others = [name for name in task.answer_names if name not in task.sites]
    sets = [chosen for n in range(len(others) + 1) for chosen in combinations(others, n)]
    return [tuple(n for n in task.answer_names if n in {*task.sites, *chosen}) for chosen in sets]


@TASK
def test_answers_and_presentations_name_sites_of_the_task(task: Task) -> None:
    assert {answer.name: answer.sites for answer in task.answers} == {
        presentation.correct: presentation.sites for presentation in task.presentations
    }
    assert {site for p in task.presentations for site in p.sites} == {*task.sites}
    assert {p.kind for p in task.presentations} == task.kinds.keys()
    assert task.keys.keys() == {*task.answer_names}
    for presentation in task.presentations:
        assert task.is_correct(presentation.name, presentation.correct)
        assert task.is_correct(presentation.name, None) is None


@TASK
def test_only_the_correct_answer_detects_a_stimulus_and_any_other_is_a_false_alarm(
    task: Task,
) -> None:
    for presentation in task.presentations:
        for answer in task.answer_names:
            correct = answer == presentation.correct
            expected = correct if presentation.sites else answer != task.nothing
            assert task.is_detected(presentation.name, answer) == expected
        assert not task.is_detected(presentation.name, "timeout")


@TASK
def test_instructions_and_guess_rates_follow_the_offered_answers(task: Task) -> None:
    for responses in offers(task):
        assert task.instructions[frozenset(responses) - frozenset(task.sites)]
        blank = task.nothing in responses
        assert task.guess_rate(responses) == (None if blank else 1 / len(responses))
        assert task.nothing in task.offered(responses, hands_off=True)
        assert task.offered(responses, hands_off=False) == responses


@TASK
def test_the_decision_rule_gives_probabilities_that_sum_to_one(task: Task) -> None:
    rng = np.random.default_rng(1)
    n_sites, shape = len(task.sites), (5, 7)
    detected = rng.random((n_sites, *shape))
    amplitudes = rng.choice([0.0, 1.0, 2.0], (n_sites, *shape))
    guessing = Guessing(*rng.random((3, shape[0], 1)))
    for responses in offers(task):
        decided = task.decide([*detected], [*amplitudes], responses, guessing)
        assert decided.keys() == {*responses}
        assert np.allclose(sum(decided.values()), 1.0)
        assert min(p.min() for p in decided.values()) >= 0.0


@TASK
def test_whoever_detects_everything_and_nothing_else_answers_correctly(task: Task) -> None:
    never, certain = np.zeros((1, 1)), np.ones((1, 1))
    guessing = Guessing(false_alarm=never, first_site=never, all_sites=never)
    for presentation in task.presentations:
        felt = [certain if site in presentation.sites else never for site in task.sites]
        decided = task.decide(felt, felt, task.answer_names, guessing)
        assert decided[presentation.correct] == 1.0
