"""Rules that choose the level of the next trial from the answers before it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from experiment.levels.bayesian import Bayesian
from experiment.levels.rule import Choice, Estimate, LevelRule, Track
from experiment.levels.staircase import Staircase
from experiment.levels.tracks import Tracks

if TYPE_CHECKING:
    from collections.abc import Mapping

RULES: Final[Mapping[str, type[LevelRule]]] = {"bayesian": Bayesian, "staircase": Staircase}
"""Every rule by its kind."""

__all__ = ["RULES", "Bayesian", "Choice", "Estimate", "LevelRule", "Staircase", "Track", "Tracks"]
