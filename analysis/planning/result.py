"""The result of a power analysis: what was simulated, and the answer, as text or JSON."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from analysis.planning.studies import PILOT_PER_SITE
from experiment.templates import open_templates

if TYPE_CHECKING:
    from analysis.planning.goals import Goal
    from analysis.planning.people import People
    from analysis.planning.studies import Point


@dataclass(frozen=True, slots=True, kw_only=True)
class Tally:
    """The outcome of the simulated studies of a point.

    `share` of them reached the goal, with its 95 % limits by the number of studies (Wilson);
    `median` is that of the number that decides, infinite where it is open in half of the studies;
    `covered` is the share of intervals that hold the truth, `unplaced` that of people whose pilot
    placed no levels.
    """

    point: Point
    studies: int
    reached: int
    share: float
    low: float
    high: float
    median: float
    open_share: float
    covered: float
    unplaced: float | None

    def json(self) -> dict[str, Any]:
        """Return the tally as plain values."""
        values: dict[str, Any] = asdict(self.point) | asdict(self)
        del values["point"]
        return values | {"median": self.median if math.isfinite(self.median) else None}


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """The smallest number of participants of a design; None where none in the range suffices.

    `low` and `high` are the 95 % limits of the curve, `checked` the fresh studies of this number,
    `tried` the points of the curve, `extrapolated` a number beyond the range.
    """

    point: Point
    participants: int | None
    low: int | None = None
    high: int | None = None
    extrapolated: int | None = None
    checked: Tally | None = None
    tried: tuple[Tally, ...] = ()

    @property
    def trials(self) -> int:
        """The number of trials of all participants together."""
        return (self.participants or 0) * (2 * self.point.trials_per_side + self.point.blanks)

    def json(self) -> dict[str, Any]:
        """Return the answer as plain values."""
        return asdict(self.point) | {
            "participants": self.participants,
            "participants_low": self.low,
            "participants_high": self.high,
            "extrapolated": self.extrapolated,
            "checked": self.checked.json() if self.checked else None,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class PowerResult:
    """A power analysis: the question, the answer of each design, and the assumed population.

    `best` is the checked answer with the fewest trials altogether; `truth` the true value of what
    the goal concerns; `pilot_vpp` the levels of the pilots that place levels.
    """

    goal: Goal
    assurance: float
    participants: tuple[int, int]
    best: Answer | None
    answers: tuple[Answer, ...]
    people: People
    truth: float
    pilot_vpp: tuple[float, ...]
    seed: int
    plan_sha256: str

    @property
    def shown(self) -> Answer:
        """The answer whose curve is shown: the best, or the one that comes closest to the goal."""
        return self.best or max(
            self.answers, key=lambda answer: max(tally.share for tally in answer.tried)
        )

    @property
    def curve(self) -> list[Tally]:
        """The points near the answer, which have the most studies."""
        most = max(tally.studies for tally in self.shown.tried)
        return [tally for tally in self.shown.tried if tally.studies == most]

    @property
    def sources(self) -> dict[str, list[str]]:
        """The parameters of the population by their source."""
        sources: dict[str, list[str]] = {}
        for parameter in self.people.parameters:
            sources.setdefault(parameter.source, []).append(parameter.text)
        return sources

    @property
    def covered(self) -> float:
        """The share of all simulated intervals that hold the truth."""
        tallies = [tally for answer in self.answers for tally in answer.tried]
        studies = [tally.studies for tally in tallies]
        return float(np.average([tally.covered for tally in tallies], weights=studies))

    @property
    def unplaced(self) -> float | None:
        """The share of all pilots that placed no levels; None where levels are fixed."""
        tallies = [t for answer in self.answers for t in answer.tried if t.unplaced is not None]
        pilots = [t.studies * t.point.participants for t in tallies]
        unplaced = [t.unplaced or 0.0 for t in tallies]
        return float(np.average(unplaced, weights=pilots)) if tallies else None

    @property
    def goal_text(self) -> str:
        """The goal as half a sentence."""
        return self.goal.text(self.people.study.task.scoring)

    def text(self) -> str:
        """Return the result for a terminal: the answer first."""
        return self._render("power.txt.jinja")

    def ethics(self) -> str:
        """Return a paragraph for an ethics committee; empty where there is no answer."""
        return self._render("ethics.txt.jinja") if self.best else ""

    def _render(self, template: str) -> str:
        filters = {
            "g": "{:g}".format,
            "percent": lambda share: f"{100 * share:.0f} %",
            "db": lambda value: f"{value:.2f} dB" if math.isfinite(value) else "open",
            "rate": lambda value: f"{value:.1%}" if math.isfinite(value) else "open",
        }
        text = open_templates(str(__package__), filters).get_template(template)
        return text.render(result=self, pilot_per_site=PILOT_PER_SITE).strip()

    def json(self) -> str:
        """Return the result as one JSON object."""
        values = {
            "schema": 2,
            "study": self.people.study.name,
            "goal": asdict(self.goal),
            "assurance": self.assurance,
            "seed": self.seed,
            "answer": self.best.json() if self.best else None,
            "answers": [answer.json() for answer in self.answers],
            "tried": [tally.json() for answer in self.answers for tally in answer.tried],
            "pilot_vpp": list(self.pilot_vpp) or None,
            "people": [asdict(parameter) for parameter in self.people.parameters],
            "warnings": [asdict(warning) for warning in self.people.warnings],
            "ethics": self.ethics(),
            "plan_sha256": self.plan_sha256,
        }
        return json.dumps(values, indent=2, ensure_ascii=False, allow_nan=False)
