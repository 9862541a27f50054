from .fit import PsychometricFit, fit_psychometric, probit_mle
from .levels import Placement, place_levels
from .people import GuessRate, PersonCounts, people_of, people_of_counts
from .population import PopulationThreshold, population_thresholds
from .table import group_table, threshold_table, thresholds_of

__all__ = [
    "GuessRate",
    "PersonCounts",
    "Placement",
    "PopulationThreshold",
    "PsychometricFit",
    "fit_psychometric",
    "group_table",
    "people_of",
    "people_of_counts",
    "place_levels",
    "population_thresholds",
    "probit_mle",
    "threshold_table",
    "thresholds_of",
]
