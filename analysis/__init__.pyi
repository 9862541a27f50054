from .answers.detection import level_table
from .answers.intervals import group_interval, proportion_ci
from .commands.analyze import write_analysis
from .reading.columns import ColumnMap, load_column_map
from .reading.load import read_trials
from .reading.text import ResultFileError
from .results.console import print_analysis
from .results.tables import Analysis
from .thresholds.fit import PsychometricFit, fit_psychometric, probit_mle
from .thresholds.people import GuessRate
from .thresholds.table import group_table, threshold_table

__all__ = [
    "Analysis",
    "ColumnMap",
    "GuessRate",
    "PsychometricFit",
    "ResultFileError",
    "fit_psychometric",
    "group_interval",
    "group_table",
    "level_table",
    "load_column_map",
    "print_analysis",
    "probit_mle",
    "proportion_ci",
    "read_trials",
    "threshold_table",
    "write_analysis",
]
