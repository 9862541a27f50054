"""What a level rule is: sealed settings that start tracks, and the state of one track.

The four steps are those of R's Open Perimetry Interface: start, choose, update, estimate. A rule
never draws from a running random stream, and `Track.choose` changes nothing. The state of a track
therefore follows from its answers alone, and a resumed session replays them from the journal.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, field_validator

from experiment.tasks import LEFT_RIGHT_BOTH

if TYPE_CHECKING:
    from experiment.tasks.task import Presentation, Task

# JSON has no tuples: a list from plan.json is accepted, and its numbers are still strict.
Levels: TypeAlias = Annotated[
    tuple[Annotated[float, Field(gt=0)], ...], Field(min_length=1, strict=False)
]
"""Numbers above 0."""


@dataclass(frozen=True, slots=True)
class Choice:
    """The level of one trial, and the entropy of the threshold that is expected after its answer.

    The entropy is in bits, rounded to 1e-9; a staircase has none.
    """

    level_vpp: float
    entropy_bits: float | None


@dataclass(frozen=True, slots=True)
class Estimate:
    """The running estimate of a threshold, with its 95 % interval."""

    threshold_vpp: float
    low_vpp: float
    high_vpp: float


class Track(ABC):
    """The state of one track: the answers of one site and condition, or of several pooled."""

    @abstractmethod
    def choose(self, trial: int, attempt: int) -> Choice:
        """Return the level of an attempt at a trial. The state of the track does not change."""

    @abstractmethod
    def update(self, presentation: Presentation, level_vpp: float | None, answer: str) -> None:
        """Take the answer to a stimulus at a single site, or to a blank trial, whose level is None.

        The track ignores stimuli at several sites, and answers that are not offered, such as a
        time-out.
        """

    @abstractmethod
    def estimate(self) -> Estimate | None:
        """Return the running estimate; None as long as the answers say too little."""


class LevelRule(BaseModel, ABC):
    """The settings of a rule, as the plan seals them."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    version: Literal[1] = 1
    """The version of the rule's equations and constants."""
    candidates_vpp: Levels
    """The levels that the rule chooses from, in increasing order."""
    seed: Annotated[int, Field(ge=0)]
    """What breaks ties, together with the numbers of trial and attempt."""
    pooled: bool = False
    """Whether one track serves all sites of a condition, in place of one for each."""

    @field_validator("candidates_vpp")
    @classmethod
    def _check_candidates(cls, levels_vpp: tuple[float, ...]) -> tuple[float, ...]:
        if len(levels_vpp) < 2:  # noqa: PLR2004 (the message says it)
            raise ValueError("must have at least two levels")
        if any(low >= high for low, high in pairwise(levels_vpp)):
            raise ValueError("must be in increasing order")
        return levels_vpp

    @abstractmethod
    def start(self, responses: tuple[str, ...], task: Task = LEFT_RIGHT_BOTH) -> Track:
        """Start a track in which these of the task's answers are offered."""
