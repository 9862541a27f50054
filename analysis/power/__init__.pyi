from .goals import Goal
from .planning import plan_study
from .promise import as_json, text

__all__ = ["Goal", "as_json", "plan_study", "text"]
