from .axis import Axis
from .codes import AnalysisWarning, WarningCode
from .commands.analyze import write_analysis
from .counts.intervals import group_interval, proportion_ci
from .counts.table import level_table
from .reading.columns import ColumnMap, load_column_map
from .reading.text import ResultFileError
from .reading.trials import LoadedTrials, read_inputs, read_trials
from .results.analysis import Analysis, analyse
from .results.console import print_analysis
from .results.figures.confusion import plot_confusion
from .results.figures.d_prime import plot_d_prime
from .results.figures.detection import plot_detection, plot_participants
from .results.figures.drawing import Style
from .results.figures.reaction_times import plot_reaction_times
from .results.figures.thresholds import plot_thresholds
from .thresholds.difference import ConditionDifference, Difference, compare_conditions
from .thresholds.fit import PsychometricFit, fit_psychometric
from .thresholds.fitted import PsychometricFits, fit
from .thresholds.group import GroupFit, fit_group
from .thresholds.guess import GuessRate
from .thresholds.likeliest import probit_mle
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
    "PsychometricFits",
    "ResultFileError",
    "Style",
    "WarningCode",
    "analyse",
    "compare_conditions",
    "fit",
    "fit_group",
    "fit_psychometric",
    "group_interval",
    "level_table",
    "load_column_map",
    "plot_confusion",
    "plot_d_prime",
    "plot_detection",
    "plot_participants",
    "plot_reaction_times",
    "plot_thresholds",
    "print_analysis",
    "probit_mle",
    "proportion_ci",
    "read_inputs",
    "read_trials",
    "threshold_table",
    "write_analysis",
]
