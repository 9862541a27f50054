from .figure import write_figure
from .goals import Goal
from .planning import plan_study
from .population import People, literature_people, pilot_people, stated_people
from .promise import Promise, as_json, text

__all__ = [
    "Goal",
    "People",
    "Promise",
    "as_json",
    "literature_people",
    "pilot_people",
    "plan_study",
    "stated_people",
    "text",
    "write_figure",
]
