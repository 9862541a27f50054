"""The tasks that a participant can be given: one value each, in a module of its own."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Final

import numpy as np

from device.errors import error_line
from device.installed import lookup, require_instance
from experiment.tasks.identification import identification
from experiment.tasks.intervals import amplitude_discrimination, three_intervals, two_intervals
from experiment.tasks.left_right_both import LEFT_RIGHT_BOTH
from experiment.tasks.task import Guessing, Sensation, Task
from experiment.tasks.yes_no import yes_no

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

GROUP: Final = "tactstrip.tasks"
"""The group of entry points by which other distributions offer tasks."""
SITES: Final = LEFT_RIGHT_BOTH.sites
"""The sites of left-right-both."""

TASKS: Final[Mapping[str, Callable[[tuple[str, ...]], Task]]] = {
    "left-right-both": lambda _: LEFT_RIGHT_BOTH,
    "yes-no": yes_no,
    "2ifc": two_intervals,
    "3ifc": three_intervals,
    "amplitude-discrimination": amplitude_discrimination,
    "identification": identification,
}
"""What makes each task for the sites of a study, by the task's name."""


@lru_cache
def make_task(
    kind: str = LEFT_RIGHT_BOTH.name,
    reference_vpp: float | None = None,
    sites: tuple[str, ...] = SITES,
) -> Task:
    """Return a task by its name, built in or installed.

    Raises
    ------
    ValueError
        If there is no such task, or an installed one fails or is no `Task`.
    """
    factory = TASKS.get(kind)
    if factory is not None:
        return replace(factory(sites), reference_vpp=reference_vpp)
    installed = lookup(GROUP, kind, tuple(TASKS))
    try:
        task: Task = installed.load()(sites)
        require_instance(task, Task)
        _require_decision(task)
        if task.name != kind:
            raise ValueError(f"the task must have the name of its entry point; got {task.name}")
    except Exception as error:
        raise ValueError(f"{kind} of {installed.distribution}: {error_line(error)}") from error
    return replace(task, reference_vpp=reference_vpp)


def _require_decision(task: Task) -> None:
    """Refuse a task whose decision gives no probabilities of its answers, where nothing is felt."""
    nothing, never = np.zeros((1, 1)), np.full((1, 1), -np.inf)
    silent = Sensation(*([value for _ in task.sites] for value in (nothing, nothing, never)))
    guessing = Guessing(nothing, nothing + 0.5, nothing)
    p = task.decide([silent] * task.n_intervals, task.answer_names, guessing)
    if {*p} != {*task.answer_names} or not np.allclose(sum(p.values()), 1.0):
        raise ValueError("decide must return the probability of every answer; they must sum to 1")


__all__ = ["GROUP", "LEFT_RIGHT_BOTH", "SITES", "TASKS", "make_task"]
