from .criterion import MIXED, with_criterion
from .difference import Difference
from .functions import Function, Line, group_function, person_function
from .group import FEW, ConditionDifference, GroupFit, compare_conditions, fit_group
from .population import PopulationThreshold, population_thresholds
from .tables import difference_table, group_table

__all__ = [
    "FEW",
    "MIXED",
    "ConditionDifference",
    "Difference",
    "Function",
    "GroupFit",
    "Line",
    "PopulationThreshold",
    "compare_conditions",
    "difference_table",
    "fit_group",
    "group_function",
    "group_table",
    "person_function",
    "population_thresholds",
    "with_criterion",
]
