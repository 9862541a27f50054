"""The staircase: weighted up-down and transformed up-down rules."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from experiment.levels.bayesian import Bayesian
from experiment.levels.rule import Choice, Estimate, LevelRule, Track
from experiment.tasks import LEFT_RIGHT_BOTH
from experiment.tasks.task import SINGLE

if TYPE_CHECKING:
    from experiment.tasks.task import Presentation, Task

MIN_REVERSALS: Final = 2
"""Before, a track may still be on its way from its first level, and has no estimate."""

Count = Annotated[int, Field(ge=1)]


class Staircase(LevelRule):
    """Go down after detected stimuli, and up after a stimulus that was not detected.

    The defaults are the weighted up-down method for 75 % detected (C. Kaernbach, Perception &
    Psychophysics 49 (1991) 227-229): on average, a step down three times as often as one up. With
    ``down_after = n`` and equal steps it is the transformed n-down-1-up method (H. Levitt, J.
    Acoust. Soc. Am. 49 (1971) 467-477), for 0.5 ** (1 / n) detected. Blank trials move nothing.

    Examples
    --------
    >>> rule = Staircase(candidates_vpp=(50.0, 60.0, 70.0, 80.0, 90.0), start_vpp=70.0, seed=1)
    >>> site, other = LEFT_RIGHT_BOTH.sites
    >>> track, single = rule.start((site, other)), LEFT_RIGHT_BOTH.presentation(site)
    >>> track.update(single, 70.0, site)
    >>> track.choose(2, 1).level_vpp
    60.0
    >>> track.update(single, 60.0, other)
    >>> track.choose(3, 1).level_vpp
    90.0
    """

    kind: Literal["staircase"] = "staircase"
    down_after: Count = 1
    """Detected stimuli in a row after which the level goes down."""
    up_steps: Count = 3
    """Number of candidates by which the level goes up."""
    down_steps: Count = 1
    """Number of candidates by which the level goes down."""
    start_vpp: float
    """The first level."""

    @field_validator("start_vpp")
    @classmethod
    def _check_start(cls, start_vpp: float, info: ValidationInfo) -> float:
        if start_vpp not in info.data.get("candidates_vpp", [start_vpp]):
            raise ValueError("must be one of the candidate levels")
        return start_vpp

    def start(self, responses: tuple[str, ...], task: Task = LEFT_RIGHT_BOTH) -> StaircaseTrack:
        """Start a track at the first level."""
        return StaircaseTrack(self, responses, task)


class StaircaseTrack(Track):
    """The next level, the detected stimuli in a row, and the reversals up to here.

    The estimate is that of the Bayesian rule after the same answers. It uses every answer, its
    error is smaller than that of the mean of the reversals, and it is a threshold of the same
    definition.
    """

    def __init__(self, rule: Staircase, responses: tuple[str, ...], task: Task) -> None:
        self._rule, self._responses, self._task = rule, responses, task
        self._bayesian = Bayesian(candidates_vpp=rule.candidates_vpp, seed=rule.seed)
        self._level_vpp = rule.start_vpp
        self._in_a_row = 0
        self._last_step = 0
        self._reversals = 0
        self._unused: list[tuple[Presentation, float | None, str]] = []

    @cached_property
    def _posterior(self) -> Track:
        return self._bayesian.start(self._responses, self._task)

    def choose(self, trial: int, attempt: int) -> Choice:
        """Return the level to which the last answer led."""
        return Choice(self._level_vpp, None)

    def update(self, presentation: Presentation, level_vpp: float | None, answer: str) -> None:
        """Move from the level that was presented, as far as there are candidates."""
        self._unused.append((presentation, level_vpp, answer))
        if presentation.kind != SINGLE or level_vpp is None or answer not in self._responses:
            return
        rule = self._rule
        if self._task.is_detected(presentation.name, answer):
            self._in_a_row += 1
            if self._in_a_row < rule.down_after:
                return
            step = -rule.down_steps
        else:
            step = rule.up_steps
        self._in_a_row = 0
        self._reversals += step * self._last_step < 0
        self._last_step = step
        candidates_vpp = np.array(rule.candidates_vpp)
        index = np.abs(candidates_vpp - level_vpp).argmin() + step
        self._level_vpp = rule.candidates_vpp[np.clip(index, 0, candidates_vpp.size - 1)]

    def estimate(self) -> Estimate | None:
        """Return the estimate from every answer; None before the second reversal."""
        if self._reversals < MIN_REVERSALS:
            return None
        for presentation, level_vpp, answer in self._unused:  # most simulations need no estimate
            self._posterior.update(presentation, level_vpp, answer)
        self._unused.clear()
        return self._posterior.estimate()
