from .density import Ruler, kind_prior, legendre, quantiles, sigma_prior, trapezoid
from .fit import (
    BOUNDED,
    WITH_THRESHOLD,
    FitStatus,
    PsychometricFit,
    checked_levels,
    fit_many,
    fit_psychometric,
    in_volts,
    probit_mle,
    status_of,
)
from .grid import Surface, surfaces
from .levels import ExpectedError, LevelsError, Placement, place_levels
from .mle import LOG_SIGMA, MOST_LAPSES, REACH, SIGMA_FACTOR, SIGMA_MEDIAN
from .people import FORCED_CHOICE, MOST_GUESSES, Guessing, GuessRate, PersonCounts, people_in
from .posterior import within_levels
from .probit import increasing_exists
from .table import WORDS, levels_of, threshold_table, thresholds_of

__all__ = [
    "BOUNDED",
    "FORCED_CHOICE",
    "LOG_SIGMA",
    "MOST_GUESSES",
    "MOST_LAPSES",
    "REACH",
    "SIGMA_FACTOR",
    "SIGMA_MEDIAN",
    "WITH_THRESHOLD",
    "WORDS",
    "ExpectedError",
    "FitStatus",
    "GuessRate",
    "Guessing",
    "LevelsError",
    "PersonCounts",
    "Placement",
    "PsychometricFit",
    "Ruler",
    "Surface",
    "checked_levels",
    "fit_many",
    "fit_psychometric",
    "in_volts",
    "increasing_exists",
    "kind_prior",
    "legendre",
    "levels_of",
    "people_in",
    "place_levels",
    "probit_mle",
    "quantiles",
    "sigma_prior",
    "status_of",
    "surfaces",
    "threshold_table",
    "thresholds_of",
    "trapezoid",
    "within_levels",
]
