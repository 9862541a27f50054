from . import events as events
from .draw import block_count, block_lengths, block_words, draw_plan, shuffled_blocks
from .engine import step, upcoming
from .events import EndTrial, Event, Happening, Key, Phase, SessionState, Task
from .order import order_count
from .plan import AUDIBILITY_BLOCK, CONTROL, PRACTICE_BLOCK, Plan, PlanError, Trial, plan_from_json

__all__ = [
    "AUDIBILITY_BLOCK",
    "CONTROL",
    "PRACTICE_BLOCK",
    "EndTrial",
    "Event",
    "Happening",
    "Key",
    "Phase",
    "Plan",
    "PlanError",
    "SessionState",
    "Task",
    "Trial",
    "block_count",
    "block_lengths",
    "block_words",
    "draw_plan",
    "events",
    "order_count",
    "plan_from_json",
    "shuffled_blocks",
    "step",
    "upcoming",
]
