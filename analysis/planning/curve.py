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
from analysis.planning.people import truth_of
from analysis.planning.result import Answer, PowerResult, Tally
from analysis.planning.spread import CHUNK_S
from analysis.planning.studies import Chunk, Point, pilot_levels_vpp, plan_text, simulate
from experiment.study.physics import study_gains
from experiment.study.threshold import people_for_burst

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from analysis.planning.goals import Goal
    from analysis.planning.people import People
    from experiment.study.study import Study

    Spread = Callable[
        [Callable[[Chunk], dict[str, Any]], Iterable[Chunk]], Iterable[tuple[Chunk, Any]]
    ]

RUNGS: Final = 6
"""Numbers of participants that are simulated, evenly on the logarithm."""
FIRST_STUDIES: Final = 30
"""Of each number of the first ladder, which rules most numbers out."""
CURVE_STUDIES: Final = 90
"""Of each number of the second ladder, which lies between those that may be the answer."""
CHECK_STUDIES: Final = 300
"""Fresh studies of the answer: a standard error of 2.3 % at 80 %."""
_FIRST_FRESH: Final = 500
_STRIDE: Final = 1009
"""From the first study of a number of participants to that of the next; a prime, so that draws of
a pilot, which take turns, differ between numbers."""
_MARGIN: Final = 1.1
"""By which the second ladder is wider than the interval of the first curve."""
_STEP: Final = 0.05
"""From a number that the check rules out to the next, as a part of it."""
_MAX_EXTRAPOLATION: Final = 3.0
"""A curve is believed up to so many times the largest number that was simulated."""
_MAX_DESIGN_RUNGS: Final = 4
LEVELS_PLACED: Final = 5
_STUDY_S, _PERSON_S, _PLACED_S = 0.005, 0.001, 0.004
"""Processor time of a study, of each participant, and of a pilot: the size of chunks."""
_Z_95: Final = 1.96


@dataclass(slots=True, kw_only=True)
class Studies:
    """The simulated studies of all designs, by their number."""

    plan: str
    seed: int
    spread: Spread
    step: Callable[[float, float], object] = lambda _done, _total: None
    """Called with the work that is done, and about how much there is."""
    total: float = 0.0
    _done: float = 0.0
    _results: dict[Point, dict[int, tuple[Any, ...]]] = field(default_factory=dict)

    def run(self, points: Iterable[Point], first: int, stop: int) -> None:
        """Simulate the studies from the first up to the last of each point that lacks them."""
        chunks = [
            Chunk(
                plan=self.plan,
                point=point,
                first=start + _STRIDE * point.participants,
                number=min(size, stop - start),
                seed=self.seed,
            )
            for point in sorted(set(points), key=work_of, reverse=True)  # the longest first
            if first not in self._results.get(point, {})
            for size in [max(1, round(CHUNK_S / work_of(point)))]
            for start in range(first, stop, size)
        ]
        for chunk, result in self.spread(simulate, chunks):
            unplaced = result.get("unplaced") or [0] * chunk.number
            rows = zip(
                result["reached"], result["number"], result["covered"], unplaced, strict=True
            )
            start = chunk.first - _STRIDE * chunk.point.participants
            self._results.setdefault(chunk.point, {}).update(enumerate(rows, start=start))
            self._done += chunk.number * work_of(chunk.point)
            self.step(self._done, max(self.total, self._done))

    def expect(self, work: float) -> None:
        """Set how much work is still ahead."""
        self.total = self._done + work

    def of_design(self, design: Point) -> tuple[Tally, ...]:
        """Return the outcomes of a design, by the number of participants."""
        points = [p for p in self._results if replace(p, participants=1) == design]
        return tuple(self.tally(point) for point in sorted(points))

    def tally(self, point: Point, first: int = 0, stop: int = _FIRST_FRESH) -> Tally:
        """Return the outcome of the studies of a point, by default of those for the curve."""
        rows = [row for study, row in self._results[point].items() if first <= study < stop]
        reached, numbers, covered, unplaced = zip(*rows, strict=True)
        values = [math.inf if number is None else number for number in numbers]
        low, high = proportion_ci(sum(reached), len(rows))
        return Tally(
            point=point,
            studies=len(rows),
            reached=sum(reached),
            share=sum(reached) / len(rows),
            low=low,
            high=high,
            median=float(np.median(values)),
            open_share=math.fsum(map(math.isinf, values)) / len(rows),
            covered=sum(covered) / len(rows),
            unplaced=sum(unplaced) / (point.participants * len(rows)) if point.placed else None,
        )


def work_of(point: Point) -> float:
    """Return about how much processor time a study of a point takes, in s."""
    return _STUDY_S + (_PERSON_S + _PLACED_S * point.placed) * point.participants


def ladder(low: int, high: int, rungs: int = RUNGS, multiple: int = 1) -> list[int]:
    """Return numbers from low to high, evenly on the logarithm, multiples of a number.

    >>> ladder(2, 40), ladder(12, 12), ladder(10, 80, 4, 5), ladder(0, 0)
    ([2, 4, 7, 12, 22, 40], [12], [10, 20, 40, 80], [0])
    """
    if low == high:
        return [multiple * math.ceil(low / multiple)]
    numbers = np.geomspace(max(low, 1), high, rungs)
    return sorted({multiple * max(1, round(number / multiple)) for number in numbers.tolist()})


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveEstimate:
    """The number of participants at which a curve crosses the assurance, with its 95 % limits."""

    participants: float
    low: float
    high: float


def fit_curve(tallies: Sequence[Tally], assurance: float) -> CurveEstimate | None:
    """Fit the share of studies as a probit curve in the logarithm of the number of participants.

    Returns None where the curve does not rise, or there is no curve through one number. Numbers
    below the last that never reaches the goal, and above the first that always does, are left out:
    they say nothing about where the curve crosses the assurance, but much about its tails.
    """
    from scipy.special import ndtri
    from statsmodels.genmod.families import Binomial
    from statsmodels.genmod.families.links import Probit
    from statsmodels.genmod.generalized_linear_model import GLM

    rungs = sorted(tallies, key=lambda tally: tally.point.participants)
    first = max((i for i, t in enumerate(rungs) if not t.reached), default=0)
    stop = next((i + 1 for i, t in enumerate(rungs) if i > first and t.share == 1), len(rungs))
    rungs = rungs[first:stop]
    if len(rungs) == 1 or rungs[0].share == 1:
        return None
    reached = np.array([t.reached for t in rungs])
    missed = np.array([t.studies for t in rungs]) - reached
    log_n = np.tile(np.log([t.point.participants for t in rungs]), 2)
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
    return CurveEstimate(participants=float(middle), low=float(low), high=float(high))


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
    study = people.study
    if placed and people.unit != "V":
        raise ValueError(
            "--levels placed needs levels in V, because pilots go up to the device's highest; got "
            f"{people.unit}"
        )
    designs = _designs(study, goal, trials_per_side, blanks, placed=placed)
    gains = study_gains(study)
    plan = plan_text(study, gains, goal, people.draws)
    studies = Studies(plan=plan, seed=seed, spread=spread, step=step)
    answers, best = find_answers(studies, designs, participants, assurance)
    fingers = gains[0].fingers()
    placed_study = study.changed(simulation=people_for_burst(study))
    return PowerResult(
        study=study,
        goal=goal,
        assurance=assurance,
        participants=participants,
        best=best,
        answers=tuple(answers),
        people=people,
        false_alarm_rate=truth_of(goal, study.simulation, study, fingers)
        if goal.kind == "false-alarms"
        else None,
        pilot_vpp=pilot_levels_vpp(placed_study, fingers) if placed else (),
        seed=seed,
        plan_sha256=hashlib.sha256(plan.encode()).hexdigest(),
    )


def find_answers(
    studies: Studies, designs: Sequence[Point], participants: tuple[int, int], assurance: float
) -> tuple[list[Answer], Answer | None]:
    """Return the answer of each design, and the checked one with the fewest trials altogether."""
    sizes = ladder(*participants)
    first = [replace(design, participants=n) for design in designs for n in sizes]
    middle = replace(designs[0], participants=round(math.sqrt(math.prod(participants))))
    check_work = CHECK_STUDIES * work_of(middle)
    studies.expect(2 * FIRST_STUDIES * sum(map(work_of, first)) + check_work)
    studies.run(first, 0, FIRST_STUDIES)
    second = [
        replace(design, participants=n)
        for design in designs
        for n in _second_ladder(studies, design, sizes, assurance)
    ]
    studies.expect(CURVE_STUDIES * sum(map(work_of, second)) + check_work)
    studies.run(second, 0, FIRST_STUDIES)
    studies.run(second, FIRST_STUDIES, CURVE_STUDIES)
    answers = [_answer(studies, design, participants, assurance) for design in designs]
    for answer in sorted(answers, key=lambda answer: answer.trials):
        if answer.participants is not None:
            studies.expect(CHECK_STUDIES * work_of(answer.at(answer.participants)))
            checked = _check(studies, answer, participants[1], assurance)
            answers[answers.index(answer)] = checked
            if checked.participants is not None:
                return answers, checked
    return answers, None


def _second_ladder(
    studies: Studies, design: Point, sizes: Sequence[int], assurance: float
) -> list[int]:
    """Return numbers about the interval of the first curve; none if the largest clearly fails."""
    tallies = studies.of_design(design)
    if len(sizes) == 1 or tallies[-1].high < assurance:
        return []
    curve = fit_curve(tallies, assurance)
    if curve is None:
        return list(sizes[:2])
    limits = np.clip([curve.low / _MARGIN, curve.high * _MARGIN], sizes[0], sizes[-1])
    return ladder(math.floor(limits[0]), math.ceil(limits[1]))


def _answer(
    studies: Studies, design: Point, participants: tuple[int, int], assurance: float
) -> Answer:
    """Return the number of participants of a design by its curve."""
    tallies = studies.of_design(design)
    largest = tallies[-1]
    curve = fit_curve(tallies, assurance)
    answer = Answer(point=largest.point, participants=None, tried=tallies)
    least, most = participants
    if least == most:
        if largest.high < assurance:
            return answer
        return replace(answer, participants=most, low=most, high=most)
    if curve is None:
        numbers = [tally.point.participants for tally in tallies if tally.share >= assurance]
        number = min(numbers) if numbers else None
        return replace(answer, participants=number, low=number, high=number)
    number, low, high = (
        max(least, math.ceil(round(n, 6))) for n in (curve.participants, curve.low, curve.high)
    )
    if number <= most and largest.high >= assurance:
        return replace(answer, participants=number, low=low, high=high)
    is_near = most < number <= _MAX_EXTRAPOLATION * most
    return replace(answer, extrapolated=number if is_near else None)


def _check(studies: Studies, answer: Answer, most: int, assurance: float) -> Answer:
    """Check an answer with fresh studies, and larger numbers where they rule it out."""
    number = answer.participants
    while number is not None:
        point, stop = answer.at(number), _FIRST_FRESH + CHECK_STUDIES
        studies.run([point], _FIRST_FRESH, stop)
        checked = studies.tally(point, _FIRST_FRESH, stop)
        if checked.high >= assurance:
            high = max(number, answer.high or number)
            return replace(answer, participants=number, high=high, checked=checked)
        step = max(1, round(_STEP * number))
        number = min(most, number + step) if number < most else None
    return replace(answer, participants=None, low=None, high=None)


def _designs(
    study: Study,
    goal: Goal,
    trials_per_side: tuple[int, int] | None,
    blanks: tuple[int, int] | None,
    *,
    placed: bool,
) -> list[Point]:
    """Return the designs to try, but for the number of participants."""
    design = study.design
    levels = LEVELS_PLACED if placed else len(design.levels_vpp)
    multiple = levels if design.order == "balanced" or trials_per_side else 1
    most_blanks = design.blank_trials if blanks is None else blanks[1]
    if most_blanks and "none" not in design.responses:
        raise ValueError("--blanks needs the answer none in design.responses; got a forced choice")
    _check_goal(study, goal, most_blanks, placed=placed)
    trials = trials_per_side or (design.trials_per_side, design.trials_per_side)
    blank_trials = blanks or (design.blank_trials, design.blank_trials)
    return [
        Point(participants=1, trials_per_side=number, blanks=blank, placed=placed)
        for number in ladder(*trials, _MAX_DESIGN_RUNGS, multiple)
        for blank in ladder(*blank_trials, _MAX_DESIGN_RUNGS)
    ]


def _check_goal(study: Study, goal: Goal, blanks: int, *, placed: bool) -> None:
    """Reject a goal that no study of this design can reach."""
    levels_vpp = study.design.levels_vpp
    if goal.kind == "difference" and len(study.conditions) == 1:
        raise ValueError(
            "goal difference needs two conditions, [[condition]] twice in the study; got "
            f"{study.conditions[0].name} alone"
        )
    if goal.kind == "detection" and goal.level_vpp not in levels_vpp:
        levels = " ".join(f"{level:g}" for level in levels_vpp)
        raise ValueError(
            f"goal detection must be at one of design.levels_vpp, {levels} V; got "
            f"{goal.level_vpp:g} V"
        )
    if goal.kind == "detection" and placed:
        raise ValueError("goal detection needs --levels fixed: placed ones differ between people")
    if goal.kind == "false-alarms" and not blanks:
        raise ValueError(
            "goal false-alarms needs design.blank_trials > 0, or --blanks MIN MAX; got 0"
        )
    if goal.kind in {"half-width", "difference"} and len(levels_vpp) == 1 and not placed:
        raise ValueError(f"goal {goal.kind} needs two levels or more in design.levels_vpp; got 1")
