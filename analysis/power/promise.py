"""What is promised of a study: the answer, the points behind it, and the people assumed."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.power.goals import Goal
    from analysis.power.population import Stated
    from analysis.power.search import Answer, Tried


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """All that is told of a search.

    Attributes
    ----------
    study : str
        Its name.
    goal : Goal
    assurance : float
        How often the goal was to be reached.
    participants : tuple of int
        The least and most people that were tried.
    answers : tuple of Answer
        The first at the study's own number of trials, if this was tried.
    tried : tuple of Tried
    people : tuple of Stated
        The population, with the source of every number.
    seed : int
    """

    study: str
    goal: Goal
    assurance: float
    participants: tuple[int, int]
    answers: tuple[Answer, ...]
    tried: tuple[Tried, ...]
    people: tuple[Stated, ...]
    seed: int

    @property
    def reachable(self) -> bool:
        """Whether any number of trials has an answer."""
        return any(one.participants is not None for one in self.answers)

    @property
    def sentence(self) -> str:
        """Say the answer."""
        first = next((one for one in self.answers if one.participants is not None), None)
        wanted = f"{self.goal.words}, in {self.assurance:.0%} of studies"
        if first is None:
            return f"Not within the bounds: {wanted}."
        return (
            f"{_people(first.participants)} ({_interval(first)}), "
            f"{first.trials_per_side} trials of each side: {wanted}."
        )

    @property
    def why_not(self) -> str:
        """Say that no number within the bounds does, and what comes closest."""
        best = max(self.tried, key=lambda one: (one.assurance, -one.point.participants))
        return (
            f"{self.goal.words} is not reached in {self.assurance:.0%} of studies by "
            f"{self.participants[0]} to {self.participants[1]} participants: at most in "
            f"{best.assurance:.0%}, with {best.point.participants} and "
            f"{best.point.trials_per_side} trials of each side; try --participants, --trials or "
            "--levels placed"
        )


def text(promise: Promise) -> str:
    """Return a promise for a terminal: the answer first."""
    lines = [promise.sentence, "", *_table(promise.tried), "", "People:"]
    lines += [f"  {one.key} = {one.value:g} ({one.source})" for one in promise.people]
    return "\n".join(lines)


def as_json(promise: Promise) -> str:
    """Return a promise as one JSON object."""
    told: dict[str, Any] = {
        "schema": 1,
        "study": promise.study,
        "goal": asdict(promise.goal),
        "assurance": promise.assurance,
        "seed": promise.seed,
        "reachable": promise.reachable,
        "answers": [asdict(one) for one in promise.answers],
        "tried": [
            {
                **asdict(one.point),
                "studies": one.studies,
                "reached": one.reached,
                "assurance": one.assurance,
                "low": one.limits[0],
                "high": one.limits[1],
                "median": one.median if math.isfinite(one.median) else None,
                "covered": one.covered,
            }
            for one in promise.tried
        ],
        "people": [asdict(one) for one in promise.people],
    }
    return json.dumps(told, indent=2, ensure_ascii=False)


def _table(tried: Sequence[Tried]) -> list[str]:
    lines = ["participants  trials a side  blanks  levels  studies  reached (95 %)         median"]
    for one in tried:
        low, high = one.limits
        lines.append(
            f"{one.point.participants:12d}  {one.point.trials_per_side:13d}  "
            f"{one.point.blanks:6d}  {'placed' if one.point.placed else 'fixed ':6s}  "
            f"{one.studies:7d}  {one.assurance:6.1%} ({low:.1%}-{high:.1%})  {_number(one.median)}"
        )
    return lines


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "open"


def _people(number: int | None) -> str:
    return "1 participant" if number == 1 else f"{number} participants"


def _interval(answer: Answer) -> str:
    if answer.high is None:
        return f"{answer.low} or more"
    return f"{answer.low} to {answer.high}" if answer.low != answer.high else "by all simulations"
