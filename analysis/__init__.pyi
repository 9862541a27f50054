from .answers.detection import level_table
from .answers.intervals import group_interval, proportion_ci
from .axis import Axis
from .codes import AnalysisWarning, StatementCode, WarningCode
from .commands.analyze import write_analysis
from .groups.difference import Difference
from .groups.group import ConditionDifference, GroupFit, compare_conditions, fit_group
from .reading.foreign.columns import ColumnMap, load_column_map
from .reading.load import LoadedTrials, read_inputs, read_trials
from .reading.text import ResultFileError
from .results.console import print_analysis
from .results.tables import Analysis, analyse
from .thresholds.fit import PsychometricFit, fit_psychometric, probit_mle
from .thresholds.people import GuessRate
from .thresholds.table import threshold_table

__all__ = [
    "Analysis",
    "AnalysisWarning",
    "Axis",
    "ColumnMap",
    "ConditionDifference",
    "Difference",
    "GroupFit",
    "GuessRate",
    "LoadedTrials",
    "PsychometricFit",
    "ResultFileError",
    "StatementCode",
    "WarningCode",
    "analyse",
    "compare_conditions",
    "fit_group",
    "fit_psychometric",
    "group_interval",
    "level_table",
    "load_column_map",
    "print_analysis",
    "probit_mle",
    "proportion_ci",
    "read_inputs",
    "read_trials",
    "threshold_table",
    "write_analysis",
]
