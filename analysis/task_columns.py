"""The columns by which a table of trials, or of their counts, knows its task."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiment.tasks import LEFT_RIGHT_BOTH, make_task

if TYPE_CHECKING:
    import pandas as pd

    from experiment.tasks.task import Task


def with_task(rows: pd.DataFrame, task: Task) -> pd.DataFrame:
    """Return rows with the columns ``task``, its name, and ``sites``, with slashes between them."""
    return rows.assign(task=task.name, sites="/".join(task.sites))


def task_of(rows: pd.DataFrame) -> Task:
    """Return the task of trials or of their counts, whose words they have.

    It has no reference level. Without the columns of `with_task` it is left-right-both, as in every
    external table.

    >>> import pandas as pd
    >>> task = make_task("2ifc", sites=("a", "b"))
    >>> task_of(with_task(pd.DataFrame({"side": ["a_1"]}), task)).presentation_names
    ('a_1', 'a_2', 'b_1', 'b_2')
    >>> task_of(pd.DataFrame()).name
    'left-right-both'
    """
    if "task" not in rows or rows.empty:
        return LEFT_RIGHT_BOTH
    return make_task(rows["task"].iloc[0], sites=tuple(rows["sites"].iloc[0].split("/")))
