"""The tasks that a participant can be given: one value each, in a module of its own."""

from __future__ import annotations

from typing import Final

from experiment.tasks.left_right_both import LEFT_RIGHT_BOTH

TASKS: Final = {task.name: task for task in (LEFT_RIGHT_BOTH,)}
"""Every task by its name."""

__all__ = ["LEFT_RIGHT_BOTH", "TASKS"]
