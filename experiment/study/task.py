"""The section [task] of a study file: what the participant is asked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import Field, model_validator

from experiment.study.base import Line, Section
from experiment.study.design import Level
from experiment.tasks import LEFT_RIGHT_BOTH, SITES, make_task

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.base import Rule
    from experiment.tasks.task import Task

_GAP_S: Final = 0.5


class TaskChoice(Section):
    """What the participant is asked, and what only some tasks need."""

    kind: Line = LEFT_RIGHT_BOTH.name
    """left-right-both, yes-no, 2ifc, 3ifc, amplitude-discrimination, identification or installed"""
    gap_s: Annotated[float, Field(ge=0.1, le=10)] | None = None
    """from a burst to the cue of the next interval; by default 0.5 in tasks with intervals"""
    reference_vpp: Level | None = None
    """amplitude-discrimination: level of the reference"""

    @property
    def task(self) -> Task:
        """The task at two sites, whose keys are those at any sites."""
        return self.task_at(SITES)

    def task_at(self, sites: tuple[str, ...]) -> Task:
        """Return the task at these sites; ValueError if it cannot have them."""
        return make_task(self.kind, self.reference_vpp, sites)

    @model_validator(mode="after")
    def _fill_in_gap(self) -> Self:
        """State the gap of a task with intervals, so that a plan has it."""
        if self.gap_s is None and self.task.n_intervals > 1:
            self.__dict__["gap_s"] = _GAP_S
        return self

    def rules(self) -> Iterator[Rule]:
        """Yield the rules that a task has the keys that it needs, and no others."""
        try:
            task = self.task
        except ValueError as error:
            yield True, "kind", str(error), None
            return
        rule = f'must be omitted with task.kind = "{self.kind}"'
        yield task.n_intervals == 1 and self.gap_s is not None, "gap_s", rule
        yield not task.has_reference and self.reference_vpp is not None, "reference_vpp", rule
        rule = f'is required with task.kind = "{self.kind}"'
        yield task.has_reference and self.reference_vpp is None, "reference_vpp", rule
