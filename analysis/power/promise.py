"""What is promised of a study: the answer, the points behind it, and the people assumed."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from analysis.power.population import ASSUMED
from analysis.power.studies import PILOT_STIMULI

if TYPE_CHECKING:
    from collections.abc import Sequence

    from analysis.power.goals import Goal
    from analysis.power.levers import Lever, Thumb
    from analysis.power.population import People, Stated
    from analysis.power.search import Answer, Tried
    from analysis.power.studies import Point


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
        One for each number of trials and blanks that was tried.
    tried : tuple of Tried
    levers : tuple of Lever
        The largest first.
    people : People
        The population, with the source of every number.
    of_people : str
        Whose they are, and what of them a dry run has not.
    false_alarms : float or None
        How often their blanks are answered, where the goal asks for it.
    pilot_vpp : tuple of float
        Levels of the pilots on which levels are placed.
    seed : int
    plan_sha256 : str
        Of what was simulated: study, gains, goal, people.
    partial : str
        What was known when the search was stopped; empty if it was not.
    left : tuple of int or None
        The numbers between which the answer of such a search lies, where both ends are known.
    thumb : Thumb or None
        How many people may be enough, where the answer lies beyond what was tried.
    """

    study: str
    goal: Goal
    assurance: float
    participants: tuple[int, int]
    answers: tuple[Answer, ...]
    tried: tuple[Tried, ...]
    levers: tuple[Lever, ...]
    people: People
    of_people: str
    false_alarms: float | None
    pilot_vpp: tuple[float, ...]
    seed: int
    plan_sha256: str
    partial: str = ""
    left: tuple[int, int] | None = None
    thumb: Thumb | None = None

    @property
    def best(self) -> Answer | None:
        """The answer with the fewest trials of all people together, if there is one."""
        return best_of(self.answers)

    @property
    def sentence(self) -> str:
        """Say the answer."""
        if self.best is not None:
            told = f"{self.people_of(self.best)}, {_design(self.best.point)}: {self.wanted}."
            return f"{told} Stopped before other designs were tried." if self.partial else told
        if self.partial:
            return f"Stopped, so this is partial: {self.partial} ({self.wanted})."
        least, most = self.participants
        if least == most:
            return f"{_counted(most)} {'is' if most == 1 else 'are'} not enough: {self.wanted}."
        return (
            f"No number within the bounds, {least} to {_counted(most)}, is enough: {self.wanted}."
        )

    def people_of(self, one: Answer) -> str:
        """Return the number of people of an answer, and between which numbers it lies."""
        if one.participants is None:
            return "no number of participants"
        told = _counted(one.participants)
        least, most = self.participants
        if least == most:
            return f"{told} (no other number was tried)"
        if one.high is None:
            return f"{told} (at least {one.low} by the simulation)"
        if one.low == one.high:
            return told + " (fewer were not tried)" * (one.participants == least > _FEWEST)
        return f"{told} ({one.low} to {one.high} by the simulation)"

    @property
    def wanted(self) -> str:
        """Say what was asked for."""
        return f"{self.goal.words}, in at least {self.assurance:.0%} of studies"

    @property
    def reaching(self) -> str:
        """Say how many studies with the answer, or with what comes closest to one, reach it."""
        if self.best is not None:
            checked = self.best.checked
            if checked is None:
                return ""
            fresh = f"{checked.studies} fresh studies, which took no part in the search"
            return f"Of {fresh}, {_percent(checked)} reach it."
        return self._nearly(self._closest) if self._closest and not self.partial else ""

    def _nearly(self, closest: Tried) -> str:
        """Say how close a point comes, and what would help."""
        told = f"Of {closest.studies} studies with {_counted(closest.point.participants)}"
        told += f", {_design(closest.point)}," * (len(self.answers) > 1)
        told += f" {_percent(closest)} reach it"
        if self.false_alarms is not None and self.false_alarms >= self.goal.size:
            return (
                f"{told}: with the rates below people have {self.false_alarms:.1%} of false alarms,"
                f" which no number of people or blanks bounds at {100 * self.goal.size:.3g} %."
            )
        better = [one for one in self.levers if one.gain > 0 and not one.by_chance]
        if better:
            return f"{told}; with {better[0].change}, {_percent(better[0].after)} do."
        return f"{told}; no other design that was tried does clearly better."

    @property
    def pilots(self) -> str:
        """Say what pilots placed levels are from, and of how many people there are none."""
        placed = [one for one in self.tried if one.unplaced is not None]
        if not placed:
            return ""
        people = [one.studies * one.point.participants for one in placed]
        without = sum(n * (one.unplaced or 0.0) for n, one in zip(people, placed, strict=True))
        levels = " ".join(f"{level:g}" for level in self.pilot_vpp)
        own = " ".join(f"{level:g}" for level in self.people.study.design.levels_vpp)
        share = without / sum(people)
        each = " in each condition" * (self.goal.kind == "difference")
        told = f"Levels are placed after a pilot of {PILOT_STIMULI} stimuli{each} at {levels} V. "
        if not without:
            return f"{told}Each of {sum(people)} pilots placed some."
        return (
            f"{told}Of {sum(people)} pilots {share:.1%} placed none{each and ' in some'}; their "
            f"people have the study's levels{each and ' there'}, {own} V."
        )

    @property
    def ask_next(self) -> str:
        """Say which numbers to ask next, where the answer lies beyond those that were tried."""
        if self.best is None and self.partial and self.left == self.participants:
            return "The same command tells more if it may go on; --keep FILE keeps what is done."
        if self.best is None and self.partial and self.left is not None:
            return f"Try --participants {self.left[0]} {self.left[1]} next."
        return self.thumb.words if self.thumb else ""

    @property
    def _searched(self) -> list[Tried]:
        """The points that were searched, not those of other designs."""
        designs = {replace(one.point, participants=0) for one in self.answers}
        designs = designs or {replace(one.point, participants=0) for one in self.tried}
        return [
            one
            for one in self.tried
            if replace(one.point, participants=0) in designs
            and one.point.participants <= self.participants[1]
        ]

    @property
    def _closest(self) -> Tried | None:
        """The point that comes closest to the goal, of those that were searched."""
        return max(
            self._searched,
            key=lambda one: (one.assurance, one.point.participants),
            default=None,
        )

    def base(self, studies: int) -> Tried | None:
        """Return the point from which a rule of thumb begins, of so many studies at least.

        There is none where the answer lies within what was searched.
        """
        known = [one for one in self._searched if one.studies >= studies]
        if self.best is not None:
            least = self.participants[0]
            known = [
                one for one in known if self.best.participants == least == one.point.participants
            ]
            known = [one for one in known if one.clear(self.assurance) > 0]
        return max(known, key=lambda one: (one.point.participants, one.assurance), default=None)

    @property
    def ethics(self) -> str:
        """Return a paragraph for the form of an ethics committee."""
        if self.best is None or self.best.checked is None:
            return ""
        fresh = self.best.checked
        covered = sum(one.covered * one.studies for one in self.tried)
        covered /= sum(one.studies for one in self.tried)
        people = ", ".join(f"{one.key} = {one.value:.4g}" for one in self.people.numbers)
        of = "; those of the pilot are medians of draws that took turns" * bool(self.people.draws)
        one = self.participants[0] == self.participants[1]
        told = _counted(self.best.participants or 0) if one else self.people_of(self.best)
        each = " in each condition" * (len(self.people.study.conditions) > 1)
        return (
            f"The number of participants was {'checked' if one else 'chosen'} by simulation "
            f"(tactstrip power, seed {self.seed}). With {told}, {_design(self.best.point)}{each}, "
            f"the goal is expected to be reached, {self.goal.words}: at least "
            f"{self.assurance:.0%} of such studies were asked for, and of {fresh.studies} "
            f"{'fresh' * one or 'simulated'} ones"
            f"{'' if one else ' that took no part in choosing this number'} {_percent(fresh)} "
            "reached it. All were "
            "analysed as the recorded data will be; of all "
            f"simulated intervals {covered:.0%} held the truth. Assumed of the population: "
            f"{people}{of}. People who leave or are left out are not counted in this number."
        )


def best_of(answers: Sequence[Answer]) -> Answer | None:
    """Return the answer with the fewest trials of all people together, if any has a number."""
    found = [one for one in answers if one.participants is not None]
    return min(found, key=_trials, default=None)


def text(promise: Promise) -> str:
    """Return a promise for a terminal: the answer first."""
    lines = [one for one in (promise.sentence, promise.reaching, promise.ask_next) if one]
    known = "" if promise.people.draws else _AS_KNOWN
    lines += [f"{_assumed(promise.people)}; all are listed below{known}."]
    if len(promise.answers) > 1:
        lines += ["", "For each design:"]
        lines += [f"  {promise.people_of(one)}, {_design(one.point)}" for one in promise.answers]
    lines += ["", *_table(promise.tried, promise.goal)]
    lines += [promise.pilots] * bool(promise.pilots)
    if promise.levers:
        base = promise.levers[0].before
        told = f"{_counted(base.point.participants)}, of whose studies {_percent(base)} reach it"
        number = promise.best.participants if promise.best else None
        if number is not None and base.point.participants < number:
            told += f" (of {number}, the answer, few studies fail, so that gains would hardly show)"
        lines += ["", f"Levers, beginning with {told}; the largest first:"]
        lines += [
            f"  {one.change}: {_percent(one.after)}"
            f"{', not told apart from no change' if one.by_chance else ''}"
            for one in promise.levers
        ]
    lines += ["", "People:", f"  {promise.of_people}"]
    lines += [f"  {one.key} = {one.value:.4g} ({one.source})" for one in promise.people.numbers]
    lines += [f"Warning: {one}" for one in promise.people.warnings]
    if promise.ethics:
        lines += ["", "For the ethics form:", promise.ethics]
    return "\n".join([*lines, "", f"Seed {promise.seed}"])


def _assumed(people: People) -> str:
    """Say whom the answer holds for: the numbers that decide it, and whose they are."""
    told = {one.key: one for one in people.numbers}
    values = people.study.simulation.reference_vibration.values.values()
    known = f" at {', '.join(f'{value:g}' for value in values)}" if values else ""
    decide = _DECIDING if any(key in told for key, *_ in _DECIDING) else _WITHOUT_THRESHOLD
    parts = [
        f"{words} = {told[key].value:.4g}{unit.replace('V', people.unit)}"
        f"{known if 'median' in words else ''} "
        f"({told[key].source}{_elsewhere(told[key])})"
        for key, words, unit in decide
        if key in told
    ]
    return f"The simulated people: {', '.join(parts)}"


def _elsewhere(number: Stated) -> str:
    """Say that assumed volts are those of the paper's plate."""
    is_assumed = number.key == "threshold_vpp" and number.source == ASSUMED
    return ", in volts of the paper's plate" if is_assumed else ""


_FEWEST = 2
_AS_KNOWN = (
    " and taken as exactly known: if few people told them, try the ends of their intervals, too"
)
_DECIDING = (
    ("threshold_um", "median threshold", " um"),
    ("threshold_vpp", "median threshold", " V"),
    ("threshold_sd_db", "SD between people", " dB"),
)
_WITHOUT_THRESHOLD = (
    ("false_alarm_rate", "false-alarm rate", ""),
    ("lapse_rate", "lapse rate", ""),
)


def as_json(promise: Promise) -> str:
    """Return a promise as one JSON object."""
    told: dict[str, Any] = {
        "schema": 1,
        "study": promise.study,
        "goal": asdict(promise.goal),
        "assurance": promise.assurance,
        "seed": promise.seed,
        "answer": _answer(promise.best) if promise.best else None,
        "partial": bool(promise.partial),
        "rule_of_thumb": _thumb(promise.thumb),
        "answers": [_answer(one) for one in promise.answers],
        "tried": [_row(one) for one in promise.tried],
        "pilot_vpp": promise.pilot_vpp if promise.pilots else None,
        "levers": [
            {"change": one.change, "before": _row(one.before), "after": _row(one.after)}
            for one in promise.levers
        ],
        "people": [asdict(one) for one in promise.people.numbers],
        "warnings": [asdict(one) for one in promise.people.warnings],
        "ethics": promise.ethics,
        "plan_sha256": promise.plan_sha256,
    }
    return json.dumps(told, indent=2, ensure_ascii=False)


def _answer(one: Answer) -> dict[str, Any]:
    return asdict(one.point) | {
        "participants": one.participants,
        "participants_low": one.low,
        "participants_high": one.high,
        "checked": _row(one.checked) if one.checked else None,
    }


def _thumb(one: Thumb | None) -> dict[str, int | None] | None:
    if one is None or one.participants is None:
        return None
    return {"participants": one.participants, "low": one.low, "high": one.high}


def _row(one: Tried) -> dict[str, Any]:
    low, high = one.limits
    return {
        **asdict(one.point),
        "studies": one.studies,
        "reached": one.reached,
        "assurance": one.assurance,
        "low": low,
        "high": high,
        "median": one.median if math.isfinite(one.median) else None,
        "covered": one.covered,
        "unplaced": one.unplaced,
    }


def _table(tried: Sequence[Tried], goal: Goal) -> list[str]:
    head = {
        "half-width": "half-width",
        "difference": "found",
        "detection": "half-width",
        "false-alarms": "limit",
    }[goal.kind]
    first = "participants  trials a side  blanks  levels  studies  reached (95 %)    "
    rows = [
        f"{one.point.participants:12d}  {one.point.trials_per_side:13d}  "
        f"{one.point.blanks:6d}  {'placed' if one.point.placed else 'fixed':6s}  "
        f"{one.studies:7d}  {_percent(one):18s}  {_number(one.median, goal):>{7 + len(head)}}"
        f"  {one.covered:7.0%}"
        for one in tried
    ]
    return [f"{first}  median {head}  covered", *rows]


def _percent(one: Tried) -> str:
    low, high = one.limits
    return f"{one.assurance:.0%} ({low:.0%} to {high:.0%})"


def _number(value: float, goal: Goal) -> str:
    if not math.isfinite(value):
        return "open"
    return f"{value:.2f} dB" if goal.kind in {"half-width", "difference"} else f"{value:.1%}"


def _trials(one: Answer) -> int:
    return (one.participants or 0) * (2 * one.point.trials_per_side + one.point.blanks)


def _counted(people: int) -> str:
    return f"{people} participant{'' if people == 1 else 's'}"


def _design(point: Point) -> str:
    blanks = f", {point.blanks} blanks" if point.blanks else ""
    placed = ", levels placed for each" if point.placed else ""
    return f"{point.trials_per_side} trials of each side{blanks}{placed}"
