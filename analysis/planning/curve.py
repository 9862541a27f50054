"""The power curve: how often simulated studies reach a goal, by the number of participants.

A few numbers of participants are simulated, and a probit curve in their logarithm says which
number reaches the goal as often as required. Fresh studies then check that number, because studies
that helped to choose it would flatter it. Each number has studies of its own, because a regression
takes its points as independent; designs of the same number have the same simulated participants
(common random numbers), so that they can be compared.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analysis.counts.intervals import proportion_ci
from analysis.planning.goals import Outcome
from analysis.planning.levels import TARGETS
from analysis.planning.people import truth_of
from analysis.planning.result import Answer, PowerResult, Tally
from analysis.planning.spread import CHUNK_S
from analysis.planning.studies import (
    Chunk,
    Point,
    pilot_levels_vpp,
    plan_text,
    read_plan,
    simulate,
)
from experiment.study.physics import study_gains
from experiment.tasks.task import BLANK

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from analysis.planning.goals import Goal
    from analysis.planning.people import People

    Spread = Callable[[Callable[[Chunk], Any], Iterable[Chunk]], Iterable[tuple[Chunk, Any]]]

RUNGS: Final = 6
"""Numbers of participants that are simulated, evenly on the logarithm."""
FIRST_STUDIES: Final = range(30)
"""Of each number of the first ladder, which rules most numbers out."""
CURVE_STUDIES: Final = range(90)
"""Of each number of the second ladder, which lies between those that may be the answer."""
CHECK_STUDIES: Final = range(500, 800)
"""Fresh studies of the answer: a standard error of 2.3 % at 80 %."""
_MARGIN: Final = 1.1
"""By which the second ladder is wider than the interval of the first curve."""
_STEP: Final = 0.05
"""From a number that the check rules out to the next, as a part of it."""
_MAX_EXTRAPOLATION: Final = 3.0
"""A curve is believed up to so many times the largest number that was simulated."""
_MAX_DESIGN_RUNGS: Final = 4
_STUDY_S, _PERSON_S, _PLACED_S, _CHOSEN_S = 0.005, 0.001, 0.004, 0.0006
"""Processor time of a study, of each participant, of a pilot, and of a trial whose level a rule
chooses: the size of chunks."""
_Z_95: Final = 1.96


@dataclass(slots=True, kw_only=True)
class Studies:
    """The simulated studies of all designs, by their number."""

    plan: str
    seed: int
    spread: Spread
    step: Callable[[float, float], object] = lambda _done, _total: None
    """Called with the work that is done, and about how much there is."""
    chosen_sites: int = 0
    """Sites of each participant at whose trials a rule chooses the level."""
    _done: float = 0.0
    _outcomes: dict[Point, dict[int, Outcome]] = field(default_factory=dict)

    def run(self, points: Iterable[Point], studies: range, ahead: float = 0.0) -> None:
        """Simulate the studies that points lack; about as much work as `ahead` follows."""
        chunks = []
        for point in sorted(set(points), key=self.work_of, reverse=True):  # the longest first
            outcomes = self._outcomes.setdefault(point, {})
            missing = [study for study in studies if study not in outcomes]
            size = max(1, round(CHUNK_S / self.work_of(point)))
            for i in range(0, len(missing), size):
                number = len(missing[i : i + size])
                chunks.append(
                    Chunk(
                        plan=self.plan, point=point, first=missing[i], number=number, seed=self.seed
                    )
                )
        total = (
            self._done + sum(chunk.number * self.work_of(chunk.point) for chunk in chunks) + ahead
        )
        for chunk, outcomes in self.spread(simulate, chunks):
            self._outcomes[chunk.point].update(
                (chunk.first + i, Outcome(*outcome)) for i, outcome in enumerate(outcomes)
            )
            self._done += chunk.number * self.work_of(chunk.point)
            self.step(self._done, total)

    def work_of(self, point: Point) -> float:
        """Return about how much processor time a study of a point takes, in s."""
        chosen_s = _CHOSEN_S * self.chosen_sites * point.trials_per_side
        return _STUDY_S + (_PERSON_S + _PLACED_S * point.placed + chosen_s) * point.participants

    def of_design(self, design: Point) -> tuple[Tally, ...]:
        """Return the outcomes of a design, by the number of participants."""
        points = [point for point in self._outcomes if point.at(1) == design]
        return tuple(self.tally(point) for point in sorted(points))

    def tally(self, point: Point, studies: range = CURVE_STUDIES) -> Tally:
        """Return the outcome of the studies of a point, by default of those for the curve."""
        outcomes = [row for study, row in self._outcomes[point].items() if study in studies]
        reached, numbers, covered, unplaced = np.array(outcomes, dtype=float).T
        low, high = proportion_ci(reached.sum(), len(reached))
        return Tally(
            point=point,
            studies=len(reached),
            reached=int(reached.sum()),
            share=float(reached.mean()),
            low=low,
            high=high,
            median=float(np.median(numbers)),
            open_share=float(np.isinf(numbers).mean()),
            covered=float(covered.mean()),
            unplaced=float(unplaced.sum()) / (point.participants * len(reached))
            if point.placed
            else None,
        )


def ladder(low: int, high: int, rungs: int = RUNGS, multiple: int = 1) -> list[int]:
    """Return numbers from low to high, evenly on the logarithm, multiples of a number.

    >>> ladder(2, 40), ladder(12, 12), ladder(10, 80, 4, 5), ladder(0, 0)
    ([2, 4, 7, 12, 22, 40], [12], [10, 20, 40, 80], [0])
    """
    if low == high:
        return [multiple * math.ceil(low / multiple)]
    numbers = np.geomspace(max(low, 1), high, rungs)
    return sorted({multiple * max(1, round(number / multiple)) for number in numbers.tolist()})


def fit_curve(tallies: Sequence[Tally], assurance: float) -> tuple[float, float, float] | None:
    """Fit the share of studies as a probit curve in the logarithm of the number of participants.

    Returns the number at which the curve crosses the assurance, with its 95 % limits; None where
    the curve does not rise, or there is no curve through one number. Numbers below the last that
    never reaches the goal, and above the first that always does, are left out: they say nothing
    about where the curve crosses the assurance, but much about its tails.
    """
    from scipy.special import ndtri
    from statsmodels.genmod.families import Binomial
    from statsmodels.genmod.families.links import Probit
    from statsmodels.genmod.generalized_linear_model import GLM

    first = max((i for i, t in enumerate(tallies) if not t.reached), default=0)
    stop = next((i + 1 for i, t in enumerate(tallies) if i > first and t.share == 1), len(tallies))
    rungs = tallies[first:stop]
    if len(rungs) == 1 or rungs[0].share == 1:
        return None
    reached = np.array([tally.reached for tally in rungs])
    missed = np.array([tally.studies for tally in rungs]) - reached
    log_n = np.tile(np.log([tally.point.participants for tally in rungs]), 2)
    fit = GLM(
        np.repeat([1.0, 0.0], len(rungs)),
        np.column_stack([np.ones_like(log_n), log_n]),
        family=Binomial(Probit()),
        freq_weights=np.concatenate([reached, missed]) + 0.5,  # bounds the slope
    ).fit()
    intercept, slope = fit.params
    if slope <= 0:
        return None
    crossing = (ndtri(assurance) - intercept) / slope
    gradient = -np.array([1.0, crossing]) / slope
    error = _Z_95 * math.sqrt(gradient @ fit.cov_params() @ gradient)
    middle, low, high = np.exp(np.clip([crossing, crossing - error, crossing + error], -50, 50))
    return float(middle), float(low), float(high)


def plan_study(
    people: People,
    goal: Goal,
    *,
    participants: tuple[int, int],
    trials_per_side: tuple[int, int] | None,
    blanks: tuple[int, int] | None,
    placed: bool,
    assurance: float,
    seed: int,
    spread: Spread,
    step: Callable[[float, float], object] = lambda _done, _total: None,
) -> PowerResult:
    """Return the smallest number of participants that reaches a goal as often as required."""
    design = people.study.design
    trials_per_side_range = trials_per_side or (design.trials_per_side,) * 2
    blanks_range = blanks or (design.blank_trials,) * 2
    for fault in _faults(people, goal, blanks_range[1], placed=placed):
        raise ValueError(fault)
    levels = len(TARGETS) if placed else len(design.levels_vpp)
    multiple = levels if design.order == "balanced" or trials_per_side else 1
    designs = [
        Point(participants=1, trials_per_side=number, blanks=blank, placed=placed)
        for number in ladder(*trials_per_side_range, _MAX_DESIGN_RUNGS, multiple)
        for blank in ladder(*blanks_range, _MAX_DESIGN_RUNGS)
    ]
    text = plan_text(people.study, study_gains(people.study), goal, people.draws)
    n_conditions = 2 if goal.kind == "difference" else 1
    sites = people.study.task.sites if people.study.levels.is_adaptive else ()
    studies = Studies(
        plan=text, seed=seed, spread=spread, step=step, chosen_sites=n_conditions * len(sites)
    )
    answers, best = find_answers(studies, designs, participants, assurance)
    plan = read_plan(text)
    return PowerResult(
        goal=goal,
        assurance=assurance,
        participants=participants,
        best=best,
        answers=tuple(answers),
        people=people,
        truth=truth_of(goal, plan.study.simulation, plan.study, plan.gains),
        pilot_vpp=pilot_levels_vpp(plan.study, plan.gains) if placed else (),
        seed=seed,
        plan_sha256=hashlib.sha256(text.encode()).hexdigest(),
    )


def _faults(people: People, goal: Goal, blanks: int, *, placed: bool) -> Iterator[str]:
    """Yield why no study of this design can reach a goal."""
    study, kind = people.study, goal.kind
    design, task, rule = study.design, study.task, study.levels.rule
    levels_vpp = " ".join(f"{level:g}" for level in design.levels_vpp)
    first_condition = study.conditions[0].name
    needs_slope = kind in {"half-width", "difference"} and not placed
    is_adaptive, is_detection = study.levels.is_adaptive, kind == "detection"
    no_blanks = kind == "false-alarms" and BLANK not in task.kinds
    for is_broken, fault in (
        (no_blanks, f"goal false-alarms needs a task with blank trials; got {task.name}"),
        # how much the PSE of people differs is no part of the simulated population
        (task.has_reference, f"power plans tasks of detection; got {task.name}"),
        (is_adaptive and placed, f'--levels placed needs levels.rule = "constant"; got {rule}'),
        (
            is_adaptive and is_detection,
            f'goal detection needs levels.rule = "constant"; got {rule}',
        ),
        (
            placed and people.unit != "V",
            f"--levels placed needs levels in V, for the device's highest; got {people.unit}",
        ),
        (
            blanks and task.nothing not in design.responses,
            "--blanks needs the answer none in design.responses; got a forced choice",
        ),
        (
            kind == "difference" and len(study.conditions) == 1,
            f"goal difference needs [[condition]] twice in the study; got {first_condition}",
        ),
        (
            is_detection and goal.level_vpp not in design.levels_vpp,
            f"goal detection needs one of design.levels_vpp, {levels_vpp} V; got {goal.level_vpp}",
        ),
        (
            is_detection and placed,
            "goal detection needs --levels fixed: placed ones differ between people",
        ),
        (
            kind == "false-alarms" and not blanks,
            "goal false-alarms needs design.blank_trials > 0, or --blanks MIN MAX; got 0",
        ),
        (
            needs_slope and len(design.levels_vpp) == 1,
            f"goal {kind} needs two levels or more in design.levels_vpp; got 1",
        ),
    ):
        if is_broken:
            yield fault


def find_answers(
    studies: Studies, designs: Sequence[Point], participants: tuple[int, int], assurance: float
) -> tuple[list[Answer], Answer | None]:
    """Return the answer of each design, and the checked one with the fewest trials altogether."""
    sizes = ladder(*participants)
    first = [design.at(n) for design in designs for n in sizes]
    middle = designs[0].at(round(math.sqrt(math.prod(participants))))
    check_work = len(CHECK_STUDIES) * studies.work_of(middle)
    first_work = len(FIRST_STUDIES) * sum(map(studies.work_of, first))
    studies.run(first, FIRST_STUDIES, ahead=first_work + check_work)
    second = [
        design.at(n)
        for design in designs
        for n in _second_ladder(studies.of_design(design), sizes, assurance)
    ]
    studies.run(second, CURVE_STUDIES, ahead=check_work)
    answers = [_answer(studies.of_design(design), participants, assurance) for design in designs]
    for answer in sorted(answers, key=lambda answer: answer.trials):
        if answer.participants is not None:
            checked = _check(studies, answer, participants[1], assurance)
            answers[answers.index(answer)] = checked
            if checked.participants is not None:
                return answers, checked
    return answers, None


def _second_ladder(
    tallies: Sequence[Tally], sizes: Sequence[int], assurance: float
) -> Sequence[int]:
    """Return numbers about the interval of the first curve; none if the largest clearly fails."""
    if len(sizes) == 1 or tallies[-1].high < assurance:
        return ()
    curve = fit_curve(tallies, assurance)
    if curve is None:
        return sizes[:2]
    low, high = np.clip([curve[1] / _MARGIN, curve[2] * _MARGIN], sizes[0], sizes[-1])
    return ladder(math.floor(low), math.ceil(high))


def _answer(tallies: tuple[Tally, ...], participants: tuple[int, int], assurance: float) -> Answer:
    """Return the number of participants of a design by its curve."""
    (min_size, max_size), largest = participants, tallies[-1]
    answer = Answer(point=largest.point, participants=None, tried=tallies)
    curve = fit_curve(tallies, assurance)
    if curve is None:
        sizes = [tally.point.participants for tally in tallies if tally.share >= assurance]
        if min_size == max_size and largest.high >= assurance:
            sizes = [max_size]
        number = min(sizes, default=None)
        return replace(answer, participants=number, low=number, high=number)
    number, low, high = (max(min_size, math.ceil(round(n, 6))) for n in curve)
    if number <= max_size and largest.high >= assurance:
        return replace(answer, participants=number, low=low, high=high)
    is_near = max_size < number <= _MAX_EXTRAPOLATION * max_size
    return replace(answer, extrapolated=number if is_near else None)


def _check(studies: Studies, answer: Answer, max_size: int, assurance: float) -> Answer:
    """Check an answer with fresh studies, and larger numbers where they rule it out."""
    number = answer.participants
    while number is not None:
        point = answer.point.at(number)
        studies.run([point], CHECK_STUDIES)
        checked = studies.tally(point, CHECK_STUDIES)
        if checked.high >= assurance:
            high = max(number, answer.high or number)
            return replace(answer, participants=number, high=high, checked=checked)
        step = max(1, round(_STEP * number))
        number = min(max_size, number + step) if number < max_size else None
    return replace(answer, participants=None, low=None, high=None)
