"""A study as everybody but the file's reader sees it: frozen values in SI units.

A file is read by `experiment.study.read`; the ranges are checked here, whoever builds the values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from stimuli.checks import finite

if TYPE_CHECKING:
    from experiment.terms.observer import Observer


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """The population that simulated participants are drawn from; see `experiment.terms.observer`.

    Attributes
    ----------
    median : Observer
        The participant in the middle of the population.
    threshold_sd_db : float
        Standard deviation of 20 log10(threshold) between participants; they are alike otherwise.
    """

    median: Observer
    threshold_sd_db: float

    def __post_init__(self) -> None:
        finite("threshold_sd_db", self.threshold_sd_db, least=0, most=40)
