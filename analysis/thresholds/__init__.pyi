from .density import Ruler, kind_prior, quantiles, sigma_prior, trapezoid
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
from .goodness import REPLICATES, deviance_residuals
from .grid import Surface, rates_of, surfaces
from .levels import (
    ExpectedError,
    LevelsError,
    PilotFunction,
    Placement,
    pilot_functions,
    place_levels,
    placed,
)
from .mle import LOG_SIGMA, REACH, SIGMA_FACTOR, SIGMA_MEDIAN
from .people import FORCED_CHOICE, Guessing, GuessRate, PersonCounts, guessing, people_in, people_of
from .posterior import within_levels
from .probit import increasing_exists
from .table import WORDS, levels_of, threshold_table, thresholds_of

__all__ = [
    "BOUNDED",
    "FORCED_CHOICE",
    "LOG_SIGMA",
    "REACH",
    "REPLICATES",
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
    "PilotFunction",
    "Placement",
    "PsychometricFit",
    "Ruler",
    "Surface",
    "checked_levels",
    "deviance_residuals",
    "fit_many",
    "fit_psychometric",
    "guessing",
    "in_volts",
    "increasing_exists",
    "kind_prior",
    "levels_of",
    "people_in",
    "people_of",
    "pilot_functions",
    "place_levels",
    "placed",
    "probit_mle",
    "quantiles",
    "rates_of",
    "sigma_prior",
    "status_of",
    "surfaces",
    "threshold_table",
    "thresholds_of",
    "trapezoid",
    "within_levels",
]
