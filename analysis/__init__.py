"""What came out: checked trials, detection probabilities, thresholds, figures."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.columns import ColumnMap, load_column_map
    from analysis.commands import write_analysis
    from analysis.console import print_analysis
    from analysis.detection import level_table
    from analysis.errors import ResultFileError
    from analysis.guessing import GuessRate
    from analysis.intervals import group_interval, proportion_ci
    from analysis.load import read_trials
    from analysis.psychometric import PsychometricFit, fit_psychometric, probit_mle
    from analysis.tables import Analysis
    from analysis.thresholds import group_table, threshold_table

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

# Imported on first use: the command line must not pay for numpy and pandas to show its help.
_HOMES = {
    "Analysis": "tables",
    "ColumnMap": "columns",
    "GuessRate": "guessing",
    "PsychometricFit": "psychometric",
    "ResultFileError": "errors",
    "fit_psychometric": "psychometric",
    "group_interval": "intervals",
    "group_table": "thresholds",
    "level_table": "detection",
    "load_column_map": "columns",
    "print_analysis": "console",
    "probit_mle": "psychometric",
    "proportion_ci": "intervals",
    "read_trials": "load",
    "threshold_table": "thresholds",
    "write_analysis": "commands",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
