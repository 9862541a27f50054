"""The tracks of one condition: one for each site, or one for all."""

from __future__ import annotations

from typing import TYPE_CHECKING

from experiment.tasks.task import BLANK

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.levels.rule import Choice, Estimate, LevelRule, Track
    from experiment.tasks.task import Task


class Tracks:
    """What a level rule knows of a condition.

    Parameters
    ----------
    rule : LevelRule
        The rule of the condition.
    responses : tuple of str
        The answers that are offered.
    task : Task
        The task, whose presentations have names.

    Examples
    --------
    >>> from experiment.levels.staircase import Staircase
    >>> from experiment.tasks import LEFT_RIGHT_BOTH
    >>> rule = Staircase(candidates_vpp=(50.0, 60.0, 70.0), start_vpp=70.0, seed=1)
    >>> site, other = LEFT_RIGHT_BOTH.sites
    >>> tracks = Tracks(rule, LEFT_RIGHT_BOTH.sites, LEFT_RIGHT_BOTH)
    >>> tracks.update(site, 70.0, site)
    >>> [tracks.choose(name, trial=2).level_vpp for name in (site, other)]
    [60.0, 70.0]
    """

    def __init__(self, rule: LevelRule, responses: tuple[str, ...], task: Task) -> None:
        self._is_pooled, self._task = rule.pooled, task
        sites = ("",) if rule.pooled else task.sites
        self._tracks: dict[str, Track] = {site: rule.start(responses, task) for site in sites}

    def choose(self, side: str, trial: int, attempt: int = 1) -> Choice:
        """Return the level of an attempt at a trial with a presentation of a single stimulus."""
        site = "" if self._is_pooled else self._task.presentation(side).site or ""
        return self._tracks[site].choose(trial, attempt)

    def update(self, side: str, level_vpp: float | None, answer: str) -> None:
        """Take the answer to a presentation: by the track of its site, or by all if it is blank."""
        presentation = self._task.presentation(side)
        for site, track in self._tracks.items():
            if site in {"", presentation.site} or presentation.kind == BLANK:
                track.update(presentation, level_vpp, answer)

    def estimates(self) -> Iterator[tuple[str, Estimate]]:
        """Yield the running estimate of each site that has one; the site is empty if pooled."""
        for site, track in self._tracks.items():
            if (estimate := track.estimate()) is not None:
                yield site, estimate
