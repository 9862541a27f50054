from . import counting as counting
from . import detection as detection
from .choice import Choices, choices, confusion_table
from .counting import (
    AUDIBILITY,
    CONTROL_COLUMNS,
    COUNTED_KINDS,
    NEEDED,
    clean_table,
    counted,
    reaction_table,
    require_columns,
    uncounted,
)
from .detection import cells, level_table
from .doubts import DRIFTING, FEWEST, GUESSING, SWAPPED, Doubt, doubtful, doubtful_counts
from .dprime import d_prime_limits, sensitivity_table, z_of
from .drift import STRONG
from .intervals import checked_counts, group_interval, proportion_ci
from .sensitivity import Sensitivity, Share
from .serial import SerialEffect

__all__ = [
    "AUDIBILITY",
    "CONTROL_COLUMNS",
    "COUNTED_KINDS",
    "DRIFTING",
    "FEWEST",
    "GUESSING",
    "NEEDED",
    "STRONG",
    "SWAPPED",
    "Choices",
    "Doubt",
    "Sensitivity",
    "SerialEffect",
    "Share",
    "cells",
    "checked_counts",
    "choices",
    "clean_table",
    "confusion_table",
    "counted",
    "counting",
    "d_prime_limits",
    "detection",
    "doubtful",
    "doubtful_counts",
    "group_interval",
    "level_table",
    "proportion_ci",
    "reaction_table",
    "require_columns",
    "sensitivity_table",
    "uncounted",
    "z_of",
]
