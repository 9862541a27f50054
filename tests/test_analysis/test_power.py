"""Power: simulated studies tell what exact sums, the engine and other processes tell."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, replace
from itertools import groupby
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import click
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.special import ndtr, stdtrit
from scipy.stats import binom, chi2

from analysis.answers.intervals import proportion_ci
from analysis.commands.power import Progress, power
from analysis.power.counts import draw_counts
from analysis.power.goals import Goal
from analysis.power.levers import Thumb, levers, thumb
from analysis.power.planning import plan_study
from analysis.power.population import (
    literature_people,
    pilot_people,
    stated_people,
    truth_of,
)
from analysis.power.promise import text
from analysis.power.search import MANY, PROBE, Trials, Tried, answers, smallest
from analysis.power.so_far import Ahead, SoFar
from analysis.power.studies import (
    Chunk,
    Point,
    _read,
    _session,
    design_of,
    pilot_levels_vpp,
    plan_text,
    simulate,
)
from analysis.reading.foreign.columns import load_column_map
from analysis.reading.load import read_inputs
from analysis.workers.chunks import spread
from experiment.session.simulate import simulate_study
from experiment.study.read import study_from_text
from experiment.study.sections.simulation import Simulation
from experiment.study.simulated import people_words, vibrations
from experiment.terms.gains import OWN_FINGER_ONLY, ConditionGains

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from analysis.power.promise import Promise
    from analysis.power.search import Answer
    from experiment.study.study import Study

HALF_WIDTH = Goal.parse("half-width=1dB")
ALONE = ConditionGains(
    condition="main",
    actuators=("left", "right"),
    bases=(None, None),
    per_vpp=((1.0, 0.0), (0.0, 1.0)),
)
"""Each finger gets its own actuator's vibration only."""


def study_of(design: str, people: str = "threshold_vpp = 80.0\nthreshold_sd_db = 2.0") -> Study:
    return study_from_text(f"[design]\n{design}\n[simulation]\n{people}", "study.toml")


def trials_of(study: Study, goal: str, seed: int = 1) -> Trials:
    return Trials(
        plan=plan_text(study, (ALONE,), Goal.parse(goal)),
        seed=seed,
        spread=spread,
    )


def within_error(share: float, exact: float, studies: int) -> bool:
    return abs(share - exact) < 4 * math.sqrt(exact * (1 - exact) / studies)


@pytest.mark.slow
def test_false_alarms_are_bounded_as_often_as_exact_sums_say() -> None:
    study = study_of(
        'both_trials = 0\nblank_trials = 30\nresponses = ["left", "right", "none"]',
        "threshold_vpp = 80.0\nthreshold_sd_db = 2.0\nfalse_alarm_rate = 0.02\nlapse_rate = 0.0\n"
        "reaction_time_spread = 0.0",
    )
    point = Point(participants=4, trials_per_side=1, blanks=30)
    (found,) = trials_of(study, "false-alarms=5%").run([point], 1000)
    k = np.arange(121)
    exact = binom.pmf(k, 120, 0.02)[proportion_ci(k, 120)[1] <= 0.05].sum()
    assert 0.2 < exact < 0.8
    assert within_error(found.assurance, exact, 1000)


@pytest.mark.slow
def test_one_level_of_one_person_is_known_as_often_as_exact_sums_say() -> None:
    study = study_of(
        'levels_vpp = [80.0]\norder = "balanced"',
        "threshold_vpp = 80.0\nthreshold_sd_db = 0.0\nlapse_rate = 0.0\nreaction_time_spread = 0.0",
    )
    point = Point(participants=1, trials_per_side=40, blanks=0)
    (found,) = trials_of(study, "detection=9.4%@80V").run([point], 1000)
    k = np.arange(81)
    low, high = proportion_ci(k, 80)
    exact = binom.pmf(k, 80, 0.75)[high - low <= 2 * 0.094].sum()
    assert 0.2 < exact < 0.8
    assert within_error(found.assurance, exact, 1000)


@pytest.mark.parametrize(
    ("goal", "more", "placed"),
    [
        ("false-alarms=10%", "", False),
        pytest.param("half-width=3dB", "", True, marks=pytest.mark.slow),
        ("false-alarms=10%", "wander_db = 1.0\nwander_trials = 9.0\nlast_answer_db = 2.0", False),
    ],
)
def test_results_do_not_depend_on_how_studies_are_cut_into_chunks(
    goal: str, more: str, *, placed: bool
) -> None:
    study = study_of(
        'both_trials = 0\nblank_trials = 30\nresponses = ["left", "right", "none"]',
        f"threshold_vpp = 80.0\nthreshold_sd_db = 2.0\n{more}",
    )
    whole = Chunk(
        plan=plan_text(study, (ALONE,), Goal.parse(goal)),
        point=Point(participants=3, trials_per_side=5, blanks=30, placed=placed),
        first=0,
        number=6,
        seed=7,
    )
    parts = [simulate(replace(whole, first=first, number=2)) for first in (4, 0, 2)]
    joined: dict[str, list[Any]] = {
        key: [*parts[1][key], *parts[2][key], *parts[0][key]] for key in parts[0]
    }
    assert simulate(whole) == joined
    assert json.loads(json.dumps(joined)) == joined


@pytest.mark.parametrize("bounds", [(2, 40), (1, 1000), (7, 9)])
@pytest.mark.parametrize("assurance", [0.5, 0.8, 0.95])
def test_the_search_finds_the_smallest_number_in_few_rounds(
    bounds: tuple[int, int], assurance: float
) -> None:
    def share(participants: int, middle: float) -> float:
        return 0.5 + 0.5 * math.tanh(2 * math.log(participants / middle))

    luck = np.random.default_rng(4).random(MANY)
    twice = np.tile(luck, 2)  # so that the fresh studies agree
    for middle in (0.5, 2.0, 8.0, 8.4, 30.0, 500.0):
        asked: list[int] = []

        def known(_: object, chunks: Iterable[Chunk], middle: float = middle) -> Iterator[Any]:
            some = [*chunks]
            asked.append(len(some))  # noqa: B023
            for one in reversed(some):  # whatever comes first
                found = twice[one.first : one.first + one.number]
                reached = (found < share(one.point.participants, middle)).tolist()
                yield one, dict.fromkeys(("reached", "number", "covered"), reached)

        trials = Trials(plan="", seed=1, spread=known)
        at = Point(participants=1, trials_per_side=75, blanks=0)
        (found,) = answers(trials, [smallest(trials, at, bounds, assurance)])
        inside = range(bounds[0], bounds[1] + 1)
        assert found.participants == next(
            (n for n in inside if (luck < share(n, middle)).mean() >= assurance), None
        )
        assert len(asked) <= 17
        if found.participants is not None and found.high is not None:
            assert found.low is not None
            assert found.low <= found.participants <= found.high


@pytest.mark.parametrize(
    ("share", "studies", "told"),
    [
        (1.0, 200, 160),  # 40 of 40 are clear
        (0.93, 400, 200),  # 37 of 40 are not, 186 of 200 are
        (0.83, 2000, 1000),  # near the assurance: as a search
        (0.5, 40, None),
        (0.7, 200, None),
    ],
)
def test_one_number_that_is_clearly_enough_takes_few_studies_and_tells_of_fresh_ones(
    share: float, studies: int, told: int | None
) -> None:
    trials = evenly(lambda _: share)
    at = Point(participants=1, trials_per_side=75, blanks=0)
    (found,) = answers(trials, [smallest(trials, at, (17, 17), 0.8)])
    (point,) = trials.all()
    if share >= 0.8:
        assert point.studies == studies
    assert (found.checked.studies if found.checked else None) == told
    if found.checked:
        assert found.checked.assurance == pytest.approx(share, abs=0.01)
        assert (found.participants, found.low, found.high) == (17, 17, 17)


@pytest.mark.slow
def test_what_is_told_of_one_number_is_not_chosen_by_its_luck() -> None:
    """Its first studies only say that it is enough: what is told of it is no better for that."""
    truth, told = 0.87, []
    for seed in range(400):
        trials = evenly(lambda _: truth, np.random.default_rng(seed))
        at = Point(participants=1, trials_per_side=75, blanks=0)
        (found,) = answers(trials, [smallest(trials, at, (5, 5), 0.8)])
        assert found.checked is not None
        told.append((found.checked.assurance, *found.checked.limits))
    assert np.mean([share for share, *_ in told]) == pytest.approx(truth, abs=0.003)
    assert np.mean([low <= truth <= high for _, low, high in told]) > 0.93


def evenly(share: Callable[[int], float], rng: np.random.Generator | None = None) -> Trials:
    """Trials of which so large a share reaches the goal, by the number of people."""

    def known(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            studies = np.arange(one.first, one.first + one.number)
            luck = studies * 0.618 % 1 if rng is None else rng.random(one.number)
            reached = (luck < share(one.point.participants)).tolist()
            yield one, dict.fromkeys(("reached", "number", "covered"), reached)

    return Trials(plan="", seed=1, spread=known)


def searched(seed: int, slope: float) -> tuple[Answer, Trials]:
    """Search where each person more reaches the goal in so many more studies, 13.6 in 80 %."""

    def drawn(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            rng = np.random.default_rng((seed, one.point.participants, one.first))
            reached = rng.random(one.number) < 0.8 + slope * (one.point.participants - 13.6)
            yield one, dict.fromkeys(("reached", "number", "covered"), reached.tolist())

    at = Point(participants=1, trials_per_side=75, blanks=0)
    trials = Trials(plan="", seed=1, spread=drawn)
    (found,) = answers(trials, [smallest(trials, at, (2, 40), 0.8)])
    return found, trials


@pytest.mark.slow
def test_what_is_told_of_the_answer_is_not_better_than_what_it_attains() -> None:
    slope = 0.01
    told: list[float] = []
    chosen: list[float] = []
    for seed in range(300):
        found, trials = searched(seed, slope)
        assert found.participants is not None
        assert found.checked is not None
        assert found.checked.studies == MANY
        attains = 0.8 + slope * (found.participants - 13.6)
        told.append(found.checked.assurance - attains)
        both = trials.tried(found.checked.point)
        chosen.append((both.reached - found.checked.reached) / MANY - attains)
    assert np.mean(chosen) > 0.005  # of the studies that chose the number
    assert abs(np.mean(told)) < 4 * np.std(told) / math.sqrt(300) < 0.004


def test_a_number_that_fresh_studies_rule_out_is_not_the_answer() -> None:
    def lucky(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            middle = 10 if one.first < MANY else 12
            reached = [one.point.participants >= middle] * one.number
            yield one, dict.fromkeys(("reached", "number", "covered"), reached)

    at = Point(participants=1, trials_per_side=75, blanks=0)
    for most, answer in ((20, 12), (11, None)):
        trials = Trials(plan="", seed=1, spread=lucky)
        (found,) = answers(trials, [smallest(trials, at, (2, most), 0.8)])
        assert found.participants == answer
        assert found.high == answer


def test_a_search_under_way_tells_between_which_numbers_the_answer_lies() -> None:
    def drawn(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            luck = np.random.default_rng(one.point.participants).random(2 * MANY)
            luck = luck[one.first : one.first + one.number]
            reached = luck < 0.8 + 0.05 * (one.point.participants - 13.6)
            yield one, dict.fromkeys(("reached", "number", "covered"), reached.tolist())

    at = Point(participants=1, trials_per_side=75, blanks=0)

    def told(participants: tuple[int, int]) -> tuple[Answer, list[str]]:
        trials = Trials(plan="", seed=1, spread=drawn)
        so_far = SoFar(trials=trials, points=[at], participants=participants, assurance=0.8)
        words: list[str] = []
        trials.step = lambda _: words.append(so_far.words())
        (found,) = answers(trials, [smallest(trials, at, participants, 0.8)])
        so_far.answers = [found]
        return found, [*(one for one, _ in groupby(words)), so_far.words()]

    found, words = told((2, 40))
    assert words[:2] == ["so far more than 2 participants", "so far more than 3 participants"]
    (low, high) = (int(one) for one in re.findall(r"\d+", words[-2]))
    assert low <= (found.participants or 0) <= high <= low + 5
    assert words[-1] == f"{found.participants} participants, now other designs"
    assert told((2, 6))[1][-2:] == [
        "so far no number up to 6 participants",
        "no number up to 6 participants, now other designs",
    ]
    share, last = told((14, 14))[1][-2:]
    assert re.fullmatch(r"so far \d+% \(\d+% to \d+%\)", share)
    assert last == f"{share}, now other designs"


@pytest.mark.parametrize(("terminal", "every_s"), [(True, 1.0), (False, 30.0)])
def test_what_is_known_is_told_every_second_or_half_minute(
    every_s: float, capsys: pytest.CaptureFixture[str], *, terminal: bool
) -> None:
    now_s, shown, asked = 0.0, [], []

    def so_far() -> str:
        asked.append(now_s)
        return "so far 19 to 25 participants" if len(asked) > 1 else ""

    progress = Progress(lambda *told: shown.append(told), terminal=terminal, clock=lambda: now_s)
    for step in range(1, 23):
        now_s = step * every_s / 10
        progress.step(4.0, 200.0 - 4.0 * step, so_far)
    assert np.diff(asked) == pytest.approx([1.1 * every_s])
    told = ["about 10 s left", "about 10 s left; so far 19 to 25 participants"]
    if not terminal:  # 44 of 200 in 33 s
        told = ["about 2 minutes left", "about 1 minute left; so far 19 to 25 participants"]
    assert shown[0] == (4, 200, "")
    assert shown[-1] == (88, 200, told[1])
    assert capsys.readouterr().err.splitlines() == ([] if terminal else told)


@pytest.mark.slow
@pytest.mark.parametrize("middle", [4, 12, 30, 100])
@pytest.mark.parametrize("slope", [1.4, 5.0])
def test_the_work_that_is_told_is_about_that_which_it_takes(middle: int, slope: float) -> None:
    def known(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            rng = np.random.default_rng((3, one.point.participants, one.first))
            share = NormalDist().cdf(0.84 + slope * math.log(one.point.participants / middle))
            reached = (rng.random(one.number) < share).tolist()
            yield one, dict.fromkeys(("reached", "number", "covered"), reached)

    at, (least, most) = Point(participants=1, trials_per_side=75, blanks=0), (2, 40)
    kind = "half-width" if slope > 2 else "difference"

    def search(trials: Trials) -> None:
        found = answers(trials, [smallest(trials, at, (least, most), 0.8)])
        levers(trials, found[0], (least, most), kind, 5, in_volts=True)

    trials = Trials(plan="", seed=1, spread=known)
    ahead = Ahead(
        trials=trials, points=[at], participants=(least, most), assurance=0.8, kind=kind,
        search=search,
    )  # fmt: skip
    low, high = ahead.between()
    done, told = [0.0], []
    trials.step = lambda part: done.append(done[-1] + part)
    trials.begun = lambda: told.append((done[-1], ahead.work()))
    search(trials)
    assert low / 1.5 < done[-1] < 1.5 * high
    after_the_ladder = [before + left for before, left in told[1:]]
    assert all(0.5 < one / done[-1] < 2 for one in after_the_ladder)


@pytest.mark.parametrize(("goal", "share"), [
    ("half-width=1dB", 0.3), ("detection=7%@60V", 0.3), ("difference=1dB", 0.5),
])  # fmt: skip
def test_the_rule_of_thumb_finds_the_number_where_its_laws_hold(goal: str, share: float) -> None:
    rng, normal = np.random.default_rng(8), NormalDist()
    people, studies, spread = np.arange(2, 200), 200, 0.9
    t = stdtrit(people - 1, 0.975)
    if goal.startswith("difference"):
        shares = ndtr(0.4 * np.sqrt(people) - t)
    else:
        size = Goal.parse(goal).size
        width = 5 * size * (t if goal.startswith("half") else 2.0) / np.sqrt(people)
        shares = ndtr(-np.log(width / size) / (spread / np.sqrt(people)))
    enough = int(people[np.argmax(shares >= 0.8)])
    base = int(people[np.argmax(shares >= share)])
    p = shares[base - 2]
    number = rng.random(studies) < p
    numbers = np.full(studies, math.nan)
    if not goal.startswith("difference"):
        luck = np.array([normal.inv_cdf(one) for one in rng.random(studies)])
        numbers = width[base - 2] * np.exp(spread / math.sqrt(base) * luck)
        number = numbers <= size
    point = Point(participants=base, trials_per_side=75, blanks=0)

    def known(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            of = slice(one.first, one.first + one.number)
            yield one, {"reached": number[of].tolist(), "number": numbers[of].tolist(),
                        "covered": number[of].tolist()}  # fmt: skip

    trials = Trials(plan="", seed=1, spread=known)
    (tried,) = trials.run([point], studies)
    found = thumb(trials, tried, Goal.parse(goal), 0.8, None)
    assert found.participants is not None
    assert found.low is not None
    assert found.high is not None
    assert base < found.low <= enough <= found.high
    assert abs(found.participants / enough - 1) < 0.25
    assert found.words.endswith(f"; try --participants {found.low} {found.high}.")


def test_blanks_that_bound_false_alarms_are_about_those_of_exact_sums() -> None:
    blanks, rate, size = 20, 0.03, 0.07

    def share(people: int) -> float:
        k = np.arange(blanks * people + 1)
        bounded = proportion_ci(k, blanks * people)[1] <= size
        return float(binom.pmf(k, blanks * people, rate)[bounded].sum())

    enough = next(people for people in range(2, 99) if share(people) >= 0.8)
    trials = Trials(plan="", seed=1, spread=lambda *_: [])
    at = Point(participants=5, trials_per_side=75, blanks=blanks)
    tried = Tried(point=at, studies=200, reached=20, median=0.09, covered=0.95)
    found = thumb(trials, tried, Goal.parse("false-alarms=7%"), 0.8, rate)
    assert found.low is not None
    assert found.high is not None
    assert found.low <= enough <= found.high <= 1.5 * enough
    refused = thumb(trials, tried, Goal.parse("false-alarms=2%"), 0.8, rate)
    assert refused.participants is None


def test_where_no_rule_of_thumb_holds_that_is_said() -> None:
    def opened(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            yield one, {"reached": [0] * one.number, "number": [None] * one.number,
                        "covered": [1] * one.number}  # fmt: skip

    trials = Trials(plan="", seed=1, spread=opened)
    for people, words in (
        (3, "There is no rule of thumb from fewer than 6 people: try --participants 6 24."),
        (20, ("There is no rule of thumb while an end of the interval is open in 100% of studies "
              "of 20 people: other levels are needed, rather than more people.")),
    ):  # fmt: skip
        (tried,) = trials.run([Point(participants=people, trials_per_side=75, blanks=0)], PROBE)
        assert thumb(trials, tried, HALF_WIDTH, 0.8, None) == Thumb(words=words)


@pytest.mark.slow
def test_studies_are_independent_within_a_seed_and_between_seeds() -> None:
    study = study_of(
        'levels_vpp = [80.0]\norder = "balanced"\nboth_trials = 0',
        "threshold_vpp = 80.0\nthreshold_sd_db = 2.0",
    )
    point = Point(participants=3, trials_per_side=10, blanks=0)
    plan = plan_text(study, (ALONE,), Goal.parse("detection=21%@80V"))
    reached = np.array([
        simulate(Chunk(plan=plan, point=point, first=0, number=60, seed=seed))["reached"]
        for seed in range(60)
    ])  # fmt: skip
    share = reached.mean()
    assert 0.2 < share < 0.8
    for axis in (0, 1):  # each study over the seeds, each seed over its studies
        scatter = ((reached.sum(axis=axis) - 60 * share) ** 2).sum() / (60 * share * (1 - share))
        assert 0.001 < chi2.sf(scatter, 59) < 0.999


@pytest.mark.slow
def test_the_goal_is_the_whole_difference_whatever_a_dry_run_has() -> None:
    point = Point(participants=3, trials_per_side=20, blanks=0)
    found = []
    for stated in ("", "\ndifference_db = -3.0"):
        study = study_of("", "threshold_vpp = 80.0\ndifference_sd_db = 1.0" + stated)
        plan = plan_text(study, (ALONE,), Goal.parse("difference=2dB"))
        found.append(simulate(Chunk(plan=plan, point=point, first=0, number=8, seed=1)))
    assert found[0] == found[1]
    assert 1.0 < np.median(found[0]["number"]) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "wander_db = 0.5\nwander_trials = 9.0"])
def test_each_condition_has_levels_of_its_own_after_a_pilot(more: str) -> None:
    """The study's levels would find neither threshold, nor one list of five both."""
    study = study_of(
        "levels_vpp = [190.0, 195.0]\ntrials_per_side = 10\nboth_trials = 0\nblank_trials = 20\n"
        'responses = ["left", "right", "none"]',
        f"threshold_vpp = 30.0\nthreshold_sd_db = 1.0\n{more}",
    )
    plan = plan_text(study, (ALONE,), Goal.parse("difference=10dB"))
    point = Point(participants=3, trials_per_side=30, blanks=20, placed=True)
    found = simulate(Chunk(plan=plan, point=point, first=0, number=6, seed=5))
    assert sum(found["unplaced"]) <= 2
    assert np.median(found["number"]) == pytest.approx(10, abs=0.6)
    assert sum(found["reached"]) == 6
    one = _read(plan)
    session = _session(one, design_of(study.design, point), 5, 0, 0)
    designs = [replace(session.design, levels_vpp=levels) for levels in ((20.0, 41.0), (7.5,))]
    (both,) = draw_counts([replace(session, own=tuple(designs))], one.gains)
    assert [counts.levels_vpp for counts in both] == [(20.0, 41.0), (7.5,)]
    assert [sum(counts.presented) for counts in both] == [60, 60]


def test_thresholds_known_for_another_vibration_are_those_of_the_dry_run() -> None:
    study = study_of("", "threshold_vpp = 20.0\nthreshold_at_hz = 250\nthreshold_at_s = 0.2")
    planned = json.loads(
        json.loads(plan_text(study, (ALONE,), Goal.parse("half-width=2dB")))["study"]
    )
    told = people_words(study, [OWN_FINGER_ONLY] * len(study.conditions))[0]
    assert f"median threshold {planned['simulation']['threshold_vpp']:.3g} V" in told
    assert planned["simulation"]["threshold_vpp"] > 22
    assert planned["simulation"]["threshold_at_hz"] is None


def test_a_threshold_that_differs_between_the_fingers_is_refused(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    sizes = {"left": (30.0, 6.0), "right": (95.0, 12.0)}
    study.write_text(
        "[simulation]\nthreshold_vpp = 60.0\nthreshold_sd_db = 2.0\nthreshold_at_cm2 = 0.3\n"
        + "".join(
            f'[[actuator]]\nside = "{side}"\nx_mm = {x_mm}\ny_mm = 7.0\ndiameter_mm = 8.0\n'
            f"finger_diameter_mm = {finger_mm}\n"
            for side, (x_mm, finger_mm) in sizes.items()
        ),
        encoding="utf-8",
    )
    result = CliRunner().invoke(power, [str(study), "--goal", "half-width=2dB"])
    assert result.exit_code == 2
    assert "threshold_at_cm2 must be left out" in result.output
    assert "6 dB apart" in result.output


BLANKS = """
[design]
both_trials = 0
blank_trials = 20
responses = ["left", "right", "none"]
[simulation]
threshold_vpp = 60.0
false_alarm_rate = 0.01
"""


@pytest.mark.slow
def test_the_answer_is_the_smallest_number_that_exact_sums_allow(tmp_path: Path) -> None:
    path, figure = tmp_path / "study.toml", tmp_path / "curve.svg"
    path.write_text(BLANKS + "lapse_rate = 0.0\nreaction_time_spread = 0.0\n")
    told = ["--goal", "false-alarms=5%", "--participants", "5", "10", "--seed", "3"]
    done = CliRunner().invoke(power, [str(path), *told, "--json", "--figure", str(figure)])
    assert done.exit_code == 0, done.stderr
    found = json.loads(done.stdout)
    exact = {}
    for people in range(4, 11):
        k = np.arange(20 * people + 1)
        bounded = proportion_ci(k, 20 * people)[1] <= 0.05
        exact[people] = float(binom.pmf(k, 20 * people, 0.01)[bounded].sum())
    for one in found["tried"]:
        if one["blanks"] == 20:
            assert within_error(one["assurance"], exact[one["participants"]], one["studies"])
    number = found["answer"]["participants"]
    assert exact[number] > 0.77
    assert exact[number - 1] < 0.83
    assert found["levers"][0]["change"] == "40 blanks instead of 20"
    assert ": at least 80% of such studies were asked for, and of 1000" in found["ethics"]
    assert figure.read_text().startswith("<?xml")


@pytest.mark.slow
def test_the_page_shows_the_shape_of_the_json(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(BLANKS)
    told = ["--goal", "false-alarms=9%", "--participants", "5", "10", "--seed", "3", "--json"]
    found = json.loads(CliRunner().invoke(power, [str(path), *told]).stdout)
    page = (Path(__file__).parents[2] / "docs" / "power.md").read_text(encoding="utf-8")
    block = re.search(r"<!-- shape of power --json -->\n```json\n(.*?)```", page, re.DOTALL)
    assert block is not None
    shown = json.loads(block[1])
    assert list(shown) == list(found)
    for key in ("goal", "answer"):
        assert {*shown[key]} == {*found[key]}
    for key in ("tried", "levers", "people"):
        assert {*shown[key][0]} == {*found[key][0]}
    assert {*found["answer"]["checked"]} == {*found["tried"][0]}


@pytest.mark.slow
def test_a_goal_out_of_reach_is_an_answer_and_no_error(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(BLANKS)
    told = ["--goal", "false-alarms=1%", "--participants", "1", "2", "--seed", "3"]
    done = CliRunner().invoke(power, [str(path), *told])
    assert done.exit_code == 1
    assert not done.stderr
    answer, closest = done.stdout.splitlines()[:2]
    assert answer == (
        "No number within the bounds, 1 to 2 participants, is enough: false alarms bounded at 1 % "
        "(95 %), in at least 80% of studies."
    )
    assert re.fullmatch(
        r"Of 200 studies with 2 participants 0% \(0% to 2%\) reach it: with the rates below people "
        r"have 3\.\d% of false alarms, which no number of people or blanks bounds at 1 %\.",
        closest,
    )
    assert "Levers, beginning with 2 participants, of whose" in done.stdout
    assert "    200  0% (0% to 2%)" in done.stdout


@pytest.mark.slow
def test_a_no_to_a_program_is_one_object_and_the_exit_code(tmp_path: Path) -> None:
    path = tmp_path / "study.toml"
    path.write_text(BLANKS)
    told = ["--goal", "false-alarms=1%", "--participants", "2", "2", "--seed", "3", "--json"]
    done = CliRunner().invoke(power, [str(path), *told])
    assert (done.exit_code, done.stderr) == (1, "")
    assert json.loads(done.stdout)["answer"] is None


def promised(
    share: Callable[[int], float],
    participants: tuple[int, int],
    step: Callable[[float, float, Callable[[], str]], object] = lambda *_: None,
) -> Promise:
    """Plan where so large a share of the studies of a number of people reaches the goal."""

    def known(_: object, chunks: Iterable[Chunk]) -> Iterator[Any]:
        for one in chunks:
            studies = np.arange(one.first, one.first + one.number)
            reached = (studies * 0.618 % 1 < share(one.point.participants)).tolist()
            yield one, dict.fromkeys(("reached", "number", "covered"), reached)

    goal = Goal.parse("false-alarms=9%")
    return plan_study(
        stated_people(NONE_OFFERED, goal), goal, participants=participants, trials_per_side=None,
        blanks=None, placed=False, assurance=0.8, seed=1, spread=known,
        predicted=lambda *_: None, step=step,
    )  # fmt: skip


@pytest.mark.slow
def test_what_other_designs_take_is_told_once_the_answer_is_known() -> None:
    told: list[tuple[float, float]] = []

    def step(part: float, ahead: float, so_far: Callable[[], str]) -> None:
        if so_far().endswith("now other designs"):
            told.append((part, ahead))

    assert promised(lambda _: 0.83, (12, 13), step).levers
    done = np.cumsum([part for part, _ in told])
    left = [ahead for _, ahead in told[:-1]]
    assert np.allclose(left, done[-1] - done[:-1], rtol=0.2)


def test_levers_begin_with_fewer_people_than_the_answer_and_say_why() -> None:
    told = text(promised(lambda people: people / 25, (2, 40)))
    assert told.startswith("20 participants (20 to 21 by the simulation), ")
    why = (
        r" reach it \(of 20, the answer, few studies fail, so that gains would hardly show\)"
        r"; the largest"
    )
    assert re.search(
        r"Levers, beginning with 12 participants, of whose studies \d+% .*" + why, told
    )


@pytest.mark.slow
def test_one_number_that_is_enough_has_no_levers() -> None:
    told = promised(lambda _: 0.97, (12, 12))
    assert (told.levers, "Levers" in text(told)) == ((), False)
    assert told.sentence.startswith("12 participants (no other number was tried), ")
    assert re.match(r"Of \d00 fresh studies, which took no part in the search, 9", told.reaching)
    assert not promised(lambda _: 0.83, (12, 12)).levers
    assert promised(lambda _: 0.7, (12, 12)).levers
    assert promised(lambda _: 0.97, (12, 14)).levers


def test_a_search_stopped_after_its_answer_tells_the_answer() -> None:
    whole = promised(lambda people: people / 25, (2, 40))
    told = text(replace(whole, partial="20 participants, now other designs", left=(20, 21)))
    sentence, fresh, people = told.splitlines()[:3]
    assert sentence == f"{whole.sentence} Stopped before other designs were tried."
    assert fresh.startswith("Of 1000 fresh studies")
    assert people.startswith("The simulated people: ")


def test_the_least_number_of_a_range_is_not_told_as_the_answer_alone() -> None:
    whole = promised(lambda _: 0.97, (7, 9))
    for told in (whole, replace(whole, partial="7 participants, now other designs")):
        lines = text(told).splitlines()
        assert lines[0].startswith("7 participants (fewer were not tried), ")
        assert "\nRule of thumb, not simulated: about " in text(told)
        assert "With 7 participants (fewer were not tried), " in told.ethics
    assert text(promised(lambda _: 0.97, (2, 9))).startswith("2 participants, ")


def test_levers_begin_with_the_most_people_where_they_are_not_enough() -> None:
    told = text(promised(lambda people: people / 50, (2, 20)))
    assert told.startswith("No number within the bounds, 2 to 20 participants, is enough: ")
    closest = told.splitlines()[1]
    assert re.match(r"Of 200 studies with 20 participants 40% \(", closest)
    assert re.search(r"; with 30 people instead of 20, 62% \(.*\) do\.$", closest)
    assert "Levers, beginning with 20 participants, of whose studies 40%" in told
    assert text(promised(lambda _: 0.1, (1, 1))).startswith("1 participant is not enough: ")


@pytest.mark.parametrize(
    ("threshold_vpp", "spread_db", "least_vpp"),
    [(80, 2, 20.0), (58, 3, 20.0), (20, 3, 7.1), (5, 1, 2.8), (0.1, 3, 0.1)],
)
def test_pilots_reach_below_nearly_all_thresholds(
    threshold_vpp: float, spread_db: float, least_vpp: float
) -> None:
    study = study_of("", f"threshold_vpp = {threshold_vpp}\nthreshold_sd_db = {spread_db}")
    levels_vpp = pilot_levels_vpp(study, OWN_FINGER_ONLY)
    assert (levels_vpp[0], levels_vpp[-1], len(levels_vpp)) == (least_vpp, 200.0, 10)


def test_pilots_have_no_level_that_the_sound_card_does_not_reach() -> None:
    card = '[device]\ndriver = "audio"\nvolts_full_scale = 59.39\n'
    study = study_of(f"levels_vpp = [40, 118.7]\n{card}", "threshold_vpp = 80")
    assert pilot_levels_vpp(study, OWN_FINGER_ONLY)[-1] == 118.78


def unplaced(threshold_vpp: float) -> tuple[dict[str, Any], str]:
    """Return some studies with placed levels, and what is told of their pilots."""
    study = study_of("", f"threshold_vpp = {threshold_vpp}\nthreshold_sd_db = 1.0")
    results = []

    def kept(function: Callable[[Chunk], dict[str, Any]], chunks: Iterable[Chunk]) -> Any:
        for one in chunks:
            few = function(replace(one, first=0, number=1))
            results.append(few)
            yield one, {key: value * one.number for key, value in few.items()}

    promise = plan_study(
        stated_people(study, HALF_WIDTH), HALF_WIDTH, participants=(8, 8), trials_per_side=None,
        blanks=None, placed=True, assurance=0.8, seed=1, spread=kept,
        predicted=lambda *_: None, step=lambda *_: None,
    )  # fmt: skip
    return results[0], promise.pilots


@pytest.mark.slow
def test_it_is_told_of_how_many_pilots_no_levels_are_placed() -> None:
    for threshold_vpp, pilot, least, most in (
        (80.0, "20 25.8 33.4", 0, 2), (5.0, "2.8 4.5 7.3", 1, 5), (190.0, "20 25.8 33.4", 4, 8)
    ):  # fmt: skip
        result, told = unplaced(threshold_vpp)
        assert least <= result["unplaced"][0] <= most
        assert told.startswith(f"Levels are placed after a pilot of 40 stimuli at {pilot} ")
        share = float(told.partition(" pilots ")[2].partition("%")[0]) / 100
        assert least / 8 - 0.1 <= share <= most / 8 + 0.1
        assert told.endswith(" their people have the study's levels, 60 95 130 165 200 V.")


def test_help_has_every_option_under_a_heading() -> None:
    told = CliRunner().invoke(power, ["--help"]).stdout
    assert all(f" {one.opts[0]} " in told for one in power.params if isinstance(one, click.Option))


def test_people_of_the_literature_are_named_as_such() -> None:
    study = study_of('responses = ["left", "right", "none"]\nboth_trials = 0', "sigma = 0.2")
    people = literature_people(study, HALF_WIDTH)
    sources = {one.key: (one.value, one.source) for one in people.numbers}
    assert sources["sigma"] == (0.2, "stated in the study")
    assert sources["threshold_sd_db"] == (3.0, "assumed: no source was found")
    assert "Grund" in sources["wander_db"][1]
    assert "threshold_sd_db" in people.warnings[0]
    assert people.study.simulation.wander_db == 1.4


def test_people_who_are_not_those_of_a_dry_run_are_told_number_by_number() -> None:
    words = literature_people(NONE_OFFERED, HALF_WIDTH).words(HALF_WIDTH, (ALONE,))
    assert words.startswith("They are the literature's where the study states none. A dry run of ")
    assert " has others: threshold_sd_db 1.5 (here 3), sigma_spread none (here 0.4), fal" in words
    assert words.endswith("last_answer_db none (here 0.35); with the numbers below in [simulation] "
                          "it has these.")  # fmt: skip
    copied = "\n".join(
        f"{one.key} = {one.value}" for one in literature_people(NONE_OFFERED, HALF_WIDTH).numbers
    )
    told = "They are the study's, and a dry run of this file has the same."
    same = stated_people(study_of(BOTH_AND_NONE, copied), HALF_WIDTH)
    assert same.words(HALF_WIDTH, (ALONE,)) == told


def two_bursts(people: str) -> Study:
    return study_from_text(
        "[simulation]\nthreshold_sd_db = 2.5\ndifference_sd_db = 1.0\n"
        + people
        + """
[burst]
frequency_hz = 300
window = "hann"
[[condition]]
name = "short"
cycles = 4
[[condition]]
name = "long"
cycles = 40
""",
        "study.toml",
    )


@pytest.mark.parametrize(
    ("people", "higher", "told"),
    [
        ("threshold_vpp = 70", 1.0, "+0.0"),
        ("threshold_vpp = 70", 2.0, "+0.0"),
        ("threshold_um = 1.2", 2.0, "-6.0"),
        ("threshold_um = 1.2\ndifference_db = 4.5", 2.0, "-1.5"),
        ("threshold_vpp = 70\nthreshold_at_s = 0.05", 1.0, "CURVE"),
    ],
)
def test_the_difference_that_a_dry_run_has_is_told_beside_the_goals(
    people: str, higher: float, told: str
) -> None:
    """That of curves by duration and of displacements, not only that which is stated."""
    study, goal = two_bursts(people), Goal.parse("difference=3dB")
    basis = ("predicted", "predicted")
    gains = [
        replace(ALONE, condition=name, bases=basis, per_vpp=((um, 0.0), (0.0, um)))
        for name, um in (("short", 0.02), ("long", 0.02 * higher))
    ]
    known = study.simulation.known_for
    if told == "CURVE":
        short, long = (both[0] for both in vibrations(study).values())
        curve_db = known.shift_db(long) - known.shift_db(short)
        assert curve_db < -1
        told = f"{curve_db:+.1f}"
    words = stated_people(study, goal).words(goal, gains)
    assert f"has others: a difference of {told} dB from short to long (here 3, the goal's)" in words
    as_it_is = Goal(kind="difference", size=abs(float(told)) or 0.01)
    assert "has the same" in stated_people(study, as_it_is).words(as_it_is, gains)


BOTH_AND_NONE = 'responses = ["left", "right", "none"]\nboth_trials = 0\nblank_trials = 20'
NONE_OFFERED = study_of(BOTH_AND_NONE, "sigma = 0.2")


@pytest.mark.parametrize(
    ("goal", "study", "without"),
    [
        ("half-width=1dB", NONE_OFFERED, {"difference_sd_db"}),
        ("detection=10%@95V", NONE_OFFERED, {"difference_sd_db"}),
        ("difference=1dB", NONE_OFFERED, set()),
        ("difference=1dB", study_of("", "sigma = 0.2"), {"false_alarm_rate"}),
    ],
)
def test_only_numbers_that_the_goal_hangs_on_are_told(
    goal: str, study: Study, without: set[str]
) -> None:
    told = {one.key for one in literature_people(study, Goal.parse(goal)).numbers}
    assert told.isdisjoint(without)
    assert {"difference_sd_db", "false_alarm_rate"} <= told | without
    warning = " ".join(literature_people(study, Goal.parse(goal)).warnings)
    assert ("difference_sd_db" in warning) == ("difference_sd_db" in told)


def test_false_alarms_hang_on_no_threshold() -> None:
    goal = Goal.parse("false-alarms=9%")
    people = literature_people(NONE_OFFERED, goal)
    assert [one.key for one in people.numbers] == ["lapse_rate", "false_alarm_rate"]
    found = ALONE.fingers()
    simulation = people.study.simulation
    known = {"threshold_vpp": 60.0, "threshold_um": None}
    others = {"threshold_vpp": 9.0, "threshold_um": None, "threshold_sd_db": 9.0, "sigma": 0.4}
    rates = [
        truth_of(goal, Simulation(**(asdict(simulation) | keys)), people.study, found)
        for keys in (known, known | {"side_bias": 0.9}, others, known | {"lapse_rate": 0.2})
    ]
    assert rates[0] == pytest.approx(rates[1]) == pytest.approx(rates[2])
    assert rates[3] > rates[0] + 0.01


@pytest.mark.slow
def test_a_pilot_gives_people_like_its_own(tmp_path: Path) -> None:
    true = study_of(
        "levels_vpp = [40.0, 60.0, 80.0, 110.0, 150.0]\ntrials_per_side = 100",
        "threshold_vpp = 80.0\nthreshold_sd_db = 3.0",
    )
    for _ in simulate_study(true, tmp_path, participants=12, seed=4):
        pass
    people = pilot_people(study_of(""), HALF_WIDTH, read_inputs([tmp_path]), "there")
    assert not people.warnings
    thresholds = 20 * np.log10([one["threshold_vpp"] / 80 for one in people.draws])
    assert abs(np.median(thresholds)) < 3 * 3 / math.sqrt(12)
    assert 0.5 < np.std(thresholds) < 1.5
    low, high = np.quantile([one["threshold_sd_db"] for one in people.draws], (0.025, 0.975))
    assert low < 3.0 < high
    assert "pilot of 12 people" in people.numbers[0].source


TWO = """
[[condition]]
name = "bare"
[[condition]]
name = "glove"
"""


def two_conditions(people: str) -> Study:
    return study_from_text(
        "[design]\nlevels_vpp = [30.0, 50.0, 70.0, 100.0, 150.0, 200.0]\ntrials_per_side = 60\n"
        f"[simulation]\nthreshold_vpp = 70.0\nthreshold_sd_db = 3.0\n{people}\n{TWO}",
        "study.toml",
    )


@pytest.mark.slow
def test_a_pilot_of_two_conditions_tells_how_much_their_difference_differs(tmp_path: Path) -> None:
    true = two_conditions("difference_db = 3.0\ndifference_sd_db = 2.5")
    for _ in simulate_study(true, tmp_path, participants=14, seed=3):
        pass
    goal, trials = Goal.parse("difference=2dB"), read_inputs([tmp_path])
    people = pilot_people(two_conditions(""), goal, trials, "there")
    drawn = [one["difference_sd_db"] for one in people.draws]
    low, high = np.quantile(drawn, (0.025, 0.975))
    assert 1.2 < low < 2.5 < high < 5.0
    (told,) = (one for one in people.numbers if one.key == "difference_sd_db")
    assert told.value == np.median(drawn)
    assert told.source == "pilot of 14 people in there, median of 400 draws"
    # of one condition a pilot does not tell it: it has to be stated, and is then as stated
    one = replace(trials, trials=trials.trials[trials.trials["condition"].eq("bare")])
    with pytest.raises(ValueError, match=r"difference_sd_db must be stated, .* got 0 in there"):
        pilot_people(two_conditions(""), goal, one, "there")
    stated = pilot_people(two_conditions("difference_sd_db = 0.7"), goal, one, "there")
    assert "difference_sd_db" not in stated.draws[0]
    assert stated.study.simulation.difference_sd_db == 0.7
    assert "difference_sd_db" not in pilot_people(true, HALF_WIDTH, trials, "there").draws[0]


MAP = """task = "yes/no"
[columns]
level_vpp = "v"
detected = "felt"
[constant]
side = "left"
[axis]
unit = "{}"
"""


def _in_db(folder: Path, rows: list[str]) -> Path:
    """Write a table with its volts in dB re 100 V, and its map; return the table."""
    lines = [rows[0]]
    for row in rows[1:]:
        person, name, level, felt = row.split(",")
        in_db = 20 * math.log10(float(level) / 100) if float(level) else -math.inf
        lines.append(f"{person},{name},{in_db!r},{felt}")
    table = folder / "db.csv"
    table.write_text("\n".join(lines) + "\n")
    words = MAP.format("dB re 100 V").replace("[axis]", '[axis]\nx_scale = "dB"')
    (folder / "db.toml").write_text(words)
    return table


@pytest.mark.parametrize(("sigma", "warned"), [(0.1, False), (0.5, False), (2.0, True)])
def test_a_width_that_is_likely_one_in_db_is_warned_of(sigma: float, *, warned: bool) -> None:
    study = study_of("", f"threshold_sd_db = 2.0\nsigma = {sigma}\n")
    told = stated_people(study, HALF_WIDTH).warnings
    assert bool(told) is warned
    if warned:
        assert "simulation.sigma = 2 is in log10 units, 40 dB" in told[0]
        assert told[0].endswith("write a twentieth of it, 0.1")


@pytest.mark.slow
def test_a_table_made_elsewhere_is_a_pilot_whatever_the_unit_of_its_levels(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(7), ["participant,condition,v,felt"]
    for person in range(8):
        for name, threshold in (("bare", 70.0), ("glove", 90.0)):
            own = threshold * 10 ** (rng.normal(0, 2.0) / 20)
            shown = [30.0, 50.0, 70.0, 100.0, 150.0, 200.0][person == 0 :]  # not all had all
            for level in shown * 15 + [0.0] * 20:
                felt = 0.1 + 0.88 * ndtr(math.log10(level / own) / 0.1) if level else 0.1
                rows.append(f"{person},{name},{level:g},{int(rng.random() < felt)}")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "all.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "map.toml").write_text(MAP.format("V"))
    in_nm = MAP.format("nm") + "[scale]\nlevel_vpp = 100\n"
    (tmp_path / "nm.toml").write_text(in_nm)
    (tmp_path / "low.toml").write_text(in_nm.replace("= 100\n", "= 0.01\n"))
    in_um = MAP.format("um") + "[scale]\nlevel_vpp = 1.0\n"
    (tmp_path / "um.toml").write_text(in_um)
    loaded = read_inputs([tmp_path / "data"], load_column_map(tmp_path / "map.toml"))
    people = pilot_people(two_conditions(""), Goal.parse("difference=2dB"), loaded, "there")
    medians = {key: np.median([one[key] for one in people.draws]) for key in people.draws[0]}
    assert 55 < medians["threshold_vpp"] < 90
    assert people.warnings == ()
    read_um = read_inputs([tmp_path / "data"], load_column_map(tmp_path / "um.toml"))
    same = pilot_people(two_conditions(""), Goal.parse("difference=2dB"), read_um, "there")
    assert same.draws == people.draws  # only numbers count
    assert same.warnings == ("levels of there are read as um, and so are those of the study",)
    in_db = read_inputs([_in_db(tmp_path, rows)], load_column_map(tmp_path / "db.toml"))
    as_db = pilot_people(two_conditions(""), Goal.parse("difference=2dB"), in_db, "there")
    assert as_db.unit == "% of 0 dB re 100 V"
    told = "levels of there are read as % of 0 dB re 100 V, and so are those of the study"
    assert as_db.warnings == (told,)
    for one, other in zip(people.draws, as_db.draws, strict=True):
        assert one.keys() == other.keys()
        assert [*other.values()] == pytest.approx([*one.values()], rel=1e-6)
    assert 0.06 < medians["false_alarm_rate"] < 0.16  # a yes to a blank, wherever it was felt
    assert 0.5 < medians["difference_sd_db"] < 5.0
    study = tmp_path / "study.toml"
    study.write_text(f"[simulation]\nthreshold_sd_db = 2.0\n{TWO}")
    asked = [str(study), "--goal", "difference=2dB", "--participants", "4", "4"]
    pilot = ["--pilot", str(tmp_path / "data")]
    for more, told in (
        (pilot, "needs --columns MAP.toml"),
        (
            [*pilot, "--columns", str(tmp_path / "nm.toml")],
            "--pilot must have levels from 0.1 to 1000; got 3000 to 20000 nm in ",
        ),
        (
            [*pilot, "--columns", str(tmp_path / "low.toml")],
            "design.levels_vpp must be in nm, as the levels of --pilot, which go from 0.3 to 2 in ",
        ),
        (["--columns", str(tmp_path / "map.toml")], "--columns needs --pilot"),
        (
            [*pilot, "--columns", str(tmp_path / "um.toml"), "--levels", "placed"],
            "--levels placed needs levels in V, as pilots go up to the device's highest; got um: ",
        ),
    ):
        done = CliRunner().invoke(power, [*asked, *more])
        assert (done.exit_code, done.stdout) == (2, "")
        assert told in done.stderr


@pytest.mark.parametrize(
    ("goal", "study", "told"),
    [
        (
            "half-width=1dB",
            "[simulation]\nsigma = 0.1",
            'add "simulation.threshold_sd_db" to told in [init]',
        ),
        ("half-width=1", "", "goal must be such as half-width=1dB"),
        ("half-width=0dB", "", "goal half-width must be > 0 and at most 40 dB; got 0"),
        ("difference=-3dB", "", "at most 40 dB, without a sign: either is found alike; got -3"),
        ("difference=1dB", "", "goal difference needs two conditions"),
        ("detection=10%@61V", "", "goal detection must be at one of design.levels_vpp, 60 95"),
        ("false-alarms=5%", "", "goal false-alarms needs design.blank_trials > 0, or --blanks"),
    ],
)
def test_what_cannot_be_asked_is_refused_in_one_line(
    goal: str, study: str, told: str, tmp_path: Path
) -> None:
    path = tmp_path / "study.toml"
    path.write_text(study or "[simulation]\nthreshold_sd_db = 2.0\ndifference_sd_db = 1.0")
    done = CliRunner().invoke(power, [str(path), "--goal", goal])
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 1
    assert told in done.stderr
    assert not done.stdout


def test_a_pilots_condition_with_a_blank_in_its_name_is_the_studys_without(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(3), ["participant,condition,v,felt"]
    for person in range(4):
        for name in ("60 Hz", "200 Hz"):
            rows += [
                f"{person},{name},{level:g},{int(rng.random() < level / 130)}"
                for level in [30.0, 60.0, 120.0] * 8 + [0.0] * 10
            ]
    (tmp_path / "all.csv").write_text("\n".join(rows) + "\n")
    (tmp_path / "map.toml").write_text(MAP.format("V"))
    loaded = read_inputs([tmp_path / "all.csv"], load_column_map(tmp_path / "map.toml"))
    study = study_of('[[condition]]\nname = "200Hz"\n[[condition]]\nname = "60Hz"\n')
    people = pilot_people(study, Goal.parse("difference=2dB"), loaded, "there")
    assert people.whose == "those of the pilot in there in condition 200Hz, and else the study's"
