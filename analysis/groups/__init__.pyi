from .criterion import ALTERNATED, MIXED, alarms_of, same_rates_p, with_criterion
from .difference import Difference
from .draws import difference_spread_draws, group_draws
from .functions import Function, Line, group_function, person_function
from .group import (
    ConditionDifference,
    GroupFit,
    compare_conditions,
    difference_on_axis,
    fit_group,
    threshold_on_axis,
)
from .hierarchy import FEW, PeopleTables
from .micrometres import (
    in_micrometres,
    micrometres_row,
    unequal_sides,
    with_group_micrometres,
    with_micrometres,
)
from .population import PopulationThreshold, population_thresholds
from .sensitivity import (
    NEARLY_ALL,
    SEVERAL,
    LevelsApart,
    d_prime_differences,
    levels_apart,
)
from .tables import Without, difference_table, group_table, without_people

__all__ = [
    "ALTERNATED",
    "FEW",
    "MIXED",
    "NEARLY_ALL",
    "SEVERAL",
    "ConditionDifference",
    "Difference",
    "Function",
    "GroupFit",
    "LevelsApart",
    "Line",
    "PeopleTables",
    "PopulationThreshold",
    "Without",
    "alarms_of",
    "compare_conditions",
    "d_prime_differences",
    "difference_on_axis",
    "difference_spread_draws",
    "difference_table",
    "fit_group",
    "group_draws",
    "group_function",
    "group_table",
    "in_micrometres",
    "levels_apart",
    "micrometres_row",
    "person_function",
    "population_thresholds",
    "same_rates_p",
    "threshold_on_axis",
    "unequal_sides",
    "with_criterion",
    "with_group_micrometres",
    "with_micrometres",
    "without_people",
]
