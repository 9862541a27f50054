"""What came out: checked trials, detection probabilities, figures."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.columns import ColumnMap, load_column_map
    from analysis.commands import write_analysis
    from analysis.console import print_analysis
    from analysis.detection import level_table
    from analysis.errors import ResultFileError
    from analysis.intervals import group_interval, proportion_ci
    from analysis.load import read_trials
    from analysis.tables import Analysis

__all__ = [
    "Analysis",
    "ColumnMap",
    "ResultFileError",
    "group_interval",
    "level_table",
    "load_column_map",
    "print_analysis",
    "proportion_ci",
    "read_trials",
    "write_analysis",
]

# Imported on first use: the command line must not pay for numpy and pandas to show its help.
_HOMES = {
    "Analysis": "tables",
    "ColumnMap": "columns",
    "ResultFileError": "errors",
    "group_interval": "intervals",
    "level_table": "detection",
    "load_column_map": "columns",
    "print_analysis": "console",
    "proportion_ci": "intervals",
    "read_trials": "load",
    "write_analysis": "commands",
}


def __getattr__(name: str) -> object:
    """Import a public name from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
