from .difference import Difference
from .group import FEW, ConditionDifference, GroupFit, compare_conditions, fit_group
from .population import PopulationThreshold, population_thresholds
from .tables import difference_table, group_table

__all__ = [
    "FEW",
    "ConditionDifference",
    "Difference",
    "GroupFit",
    "PopulationThreshold",
    "compare_conditions",
    "difference_table",
    "fit_group",
    "group_table",
    "population_thresholds",
]
