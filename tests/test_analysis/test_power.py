"""Power: studies reach a goal as often as exact sums say; the smallest number is found."""

from __future__ import annotations

import json
import math
import re
from itertools import pairwise
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.special import ndtr, stdtrit
from scipy.stats import binom

from analysis import proportion_ci
from analysis.commands.power import Progress
from tests.plates import on_paper_plate
from tests.test_analysis import planning
from tests.test_analysis.planning import BOTH_AND_NONE, evenly, made_up, search, study_of
from tests.test_analysis.shared import cases, put, run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

MANY = 1000
"""Studies that decide, and as many fresh ones that tell how often the answer reaches the goal."""
BLANKS = f"""
[design]
{BOTH_AND_NONE}
[simulation]
threshold_vpp = 60.0
"""
CERTAIN = "lapse_rate = 0.0\nreaction_time_spread = 0.0\n"


def powered(folder: Path, study: str, goal: str, *options: object) -> tuple[int, dict[str, Any]]:
    """Plan by the command; return its exit code and the object it prints."""
    path = put(folder / "study.toml", on_paper_plate(study))
    done = run("power", path, "--goal", goal, "--seed", 3, "--json", *options)
    assert done.exit_code in (0, 1), done.stderr
    return done.exit_code, json.loads(done.stdout)


def false_alarms_bounded(people: int, *, rate: float = 0.01, size: float = 0.05) -> float:
    k = np.arange(20 * people + 1)
    bounded = proportion_ci(k, 20 * people)[1] <= size
    return float(binom.pmf(k, 20 * people, rate)[bounded].sum())


@pytest.mark.slow
def test_the_answer_is_the_smallest_number_that_exact_sums_allow(tmp_path: Path) -> None:
    study, figure = BLANKS + "false_alarm_rate = 0.01\n" + CERTAIN, tmp_path / "curve.svg"
    options = ("--participants", 5, 10, "--figure", figure)
    _, found = powered(tmp_path, study, "false-alarms=5%", *options)
    for point in found["tried"]:
        if point["blanks"] == 20:
            exact = false_alarms_bounded(point["participants"])
            assert planning.within_error(point["assurance"], exact, point["studies"])
    number = found["answer"]["participants"]
    assert false_alarms_bounded(number) > 0.77
    assert false_alarms_bounded(number - 1) < 0.83
    assert figure.read_text().startswith("<?xml")


@pytest.mark.slow
def test_a_goal_out_of_reach_is_an_answer_and_no_error(tmp_path: Path) -> None:
    code, found = powered(
        tmp_path, BLANKS + "false_alarm_rate = 0.01\n", "false-alarms=1%", "--participants", 1, 2
    )
    assert (code, found["answer"]) == (1, None)
    assert {point["assurance"] for point in found["tried"] if point["blanks"] == 20} == {0.0}


FORCED = 'both_trials = 0\nblank_trials = 30\nresponses = ["left", "right", "none"]'
WANDERING = "wander_db = 1.0\nwander_trials = 9.0\nlast_answer_db = 2.0"


@pytest.mark.parametrize(
    ("goal", "more", "placed"),
    [
        ("false-alarms=10%", "", False),
        pytest.param("half-width=3dB", "", True, marks=pytest.mark.slow),
        ("false-alarms=10%", WANDERING, False),
    ],
)
def test_results_do_not_depend_on_how_studies_are_cut_into_chunks(
    goal: str, more: str, *, placed: bool
) -> None:
    study = study_of(FORCED, f"threshold_vpp = 80.0\nthreshold_sd_db = 2.0\n{more}")

    def studies(first: int, number: int) -> dict[str, list[Any]]:
        at: dict[str, Any] = {"trials_per_side": 5, "blanks": 30, "placed": placed}
        found: dict[str, list[Any]] = planning.simulated(study, goal, number, 7, first, **at)
        return found

    parts = [studies(first, 2) for first in (4, 0, 2)]
    joined = {key: [*parts[1][key], *parts[2][key], *parts[0][key]] for key in parts[0]}
    assert studies(0, 6) == joined == json.loads(json.dumps(joined))


@pytest.mark.parametrize(
    "bounds", [(2, 40), pytest.param((1, 1000), marks=pytest.mark.slow), (7, 9)]
)
@pytest.mark.parametrize("assurance", [0.5, 0.8, 0.95])
def test_the_search_finds_the_smallest_number(bounds: tuple[int, int], assurance: float) -> None:
    luck = np.random.default_rng(4).random(MANY)
    twice = np.tile(luck, 2)  # so that the fresh studies agree
    for middle in (0.5, 2.0, 8.0, 8.4, 30.0, 500.0):

        def share(participants: int, middle: float = middle) -> float:
            return 0.5 + 0.5 * math.tanh(2 * math.log(participants / middle))

        trials = made_up(lambda n, first, size: twice[first : first + size] < share(n))
        found = search(trials, bounds, assurance)
        inside = range(bounds[0], bounds[1] + 1)
        enough = (n for n in inside if (luck < share(n)).mean() >= assurance)
        assert found.participants == next(enough, None)
        assert len({tried.point.participants for tried in trials.all()}) <= 40
        if found.participants is not None and found.high is not None:
            assert found.low is not None
            assert found.low <= found.participants <= found.high


@pytest.mark.parametrize(
    ("share", "studies", "fresh"),
    [
        (1.0, 200, 160),  # 40 of 40 are clear
        (0.93, 400, 200),  # 37 of 40 are not, 186 of 200 are
        (0.83, 2000, 1000),  # near the assurance: as a search
        (0.5, None, None),
        (0.7, None, None),
    ],
)
def test_one_number_that_is_clearly_enough_takes_few_studies(
    share: float, studies: int | None, fresh: int | None
) -> None:
    trials = evenly(lambda _: share)
    found = search(trials, (17, 17))
    (point,) = trials.all()
    assert studies is None or point.studies == studies
    assert (found.checked.studies if found.checked else None) == fresh
    if found.checked:
        assert found.checked.assurance == pytest.approx(share, abs=0.01)
        assert (found.participants, found.low, found.high) == (17, 17, 17)


@pytest.mark.parametrize(("most", "answer"), [(20, 12), (11, None)])
def test_a_number_that_fresh_studies_rule_out_is_not_the_answer(
    most: int, answer: int | None
) -> None:
    trials = made_up(lambda n, first, size: [n >= (10 if first < MANY else 12)] * size)
    found = search(trials, (2, most))
    assert (found.participants, found.high) == (answer, answer)


def test_what_is_known_during_a_search_narrows_to_the_answer() -> None:
    between: list[list[int]] = []

    def step(_: float, __: float, so_far: Callable[[], str]) -> None:
        between.append([int(number) for number in re.findall(r"\d+", so_far())])

    found = planning.promised(lambda people: people / 25, (2, 40), step)
    assert found.best is not None
    assert (found.best.participants, found.best.low, found.best.high) == (20, 20, 21)
    known = [numbers for numbers in between if len(numbers) == 2]
    assert all(low <= 20 <= high for low, high in known)
    assert known[-1][1] - known[-1][0] <= 5


@pytest.mark.parametrize(("terminal", "every_s"), [(True, 1.0), (False, 30.0)])
def test_progress_is_shown_every_second_or_half_minute(
    every_s: float, capsys: pytest.CaptureFixture[str], *, terminal: bool
) -> None:
    now_s, shown, asked = 0.0, [], []

    def so_far() -> str:
        asked.append(now_s)
        return ""

    progress = Progress(lambda *told: shown.append(told), terminal=terminal, clock=lambda: now_s)
    for step in range(1, 23):
        now_s = step * every_s / 10
        progress.step(4.0, 200.0 - 4.0 * step, so_far)
    assert np.diff(asked) == pytest.approx([1.1 * every_s])
    assert shown[0][:2] == (4, 200)
    assert shown[-1][:2] == (88, 200)
    assert len(capsys.readouterr().err.splitlines()) == (0 if terminal else 2)


@pytest.mark.parametrize(
    ("goal", "share"),
    [("half-width=1dB", 0.3), ("detection=7%@60V", 0.3), ("difference=1dB", 0.5)],
)
def test_the_rule_of_thumb_finds_the_number_where_its_laws_hold(goal: str, share: float) -> None:
    rng, normal = np.random.default_rng(8), NormalDist()
    people, studies, spread = np.arange(2, 200), 200, 0.9
    t = stdtrit(people - 1, 0.975)
    if goal.startswith("difference"):
        shares = ndtr(0.4 * np.sqrt(people) - t)
    else:
        size = planning.goal_of(goal).size
        width = 5 * size * (t if goal.startswith("half") else 2.0) / np.sqrt(people)
        shares = ndtr(-np.log(width / size) / (spread / np.sqrt(people)))
    enough = int(people[np.argmax(shares >= 0.8)])
    base = int(people[np.argmax(shares >= share)])
    reached = rng.random(studies) < shares[base - 2]
    numbers = np.full(studies, math.nan)
    if not goal.startswith("difference"):
        luck = np.array([normal.inv_cdf(p) for p in rng.random(studies)])
        numbers = width[base - 2] * np.exp(spread / math.sqrt(base) * luck)
        reached = numbers <= size
    trials = made_up(
        lambda _, first, size: reached[first : first + size],
        lambda _, first, size: numbers[first : first + size].tolist(),
    )
    found = planning.rule_of_thumb(trials, base, studies, goal)
    assert found.participants is not None
    assert found.low is not None
    assert found.high is not None
    assert base < found.low <= enough <= found.high
    assert abs(found.participants / enough - 1) < 0.25


def test_blanks_that_bound_false_alarms_are_about_those_of_exact_sums() -> None:
    def share(people: int) -> float:
        return false_alarms_bounded(people, rate=0.03, size=0.07)

    enough = next(people for people in range(2, 99) if share(people) >= 0.8)
    tried = {"reached": 20, "median": 0.09}
    found, none = (
        planning.rule_of_thumb(evenly(share), 5, 200, f"false-alarms={size}%", 0.03, **tried)
        for size in (7, 2)
    )
    assert found.low is not None
    assert found.high is not None
    assert found.low <= enough <= found.high <= 1.5 * enough
    assert none.participants is None


@pytest.mark.parametrize("people", [3, 20])
def test_no_rule_of_thumb_holds_from_few_people_or_open_intervals(people: int) -> None:
    trials = made_up(lambda _n, _, size: [0] * size, lambda _n, _, size: [None] * size)
    found = planning.rule_of_thumb(trials, people, 40, "half-width=1dB")
    assert (found.participants, found.low, found.high) == (None, None, None)


@pytest.mark.slow
def test_the_goal_is_the_whole_difference_whatever_a_dry_run_has() -> None:
    people = "threshold_vpp = 80.0\ndifference_sd_db = 1.0"
    found, other = (
        planning.simulated(study_of("", people + more), "difference=2dB", 8, 1, trials_per_side=20)
        for more in ("", "\ndifference_db = -3.0")
    )
    assert found == other
    assert 1.0 < np.median(found["number"]) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "wander_db = 0.5\nwander_trials = 9.0"])
def test_each_condition_has_levels_of_its_own_after_a_pilot(more: str) -> None:
    """The study's levels would find neither threshold, nor one list of five both."""
    design = f"levels_vpp = [190.0, 195.0]\ntrials_per_side = 10\n{BOTH_AND_NONE}"
    study = study_of(design, f"threshold_vpp = 30.0\nthreshold_sd_db = 1.0\n{more}")
    at: dict[str, Any] = {"trials_per_side": 30, "blanks": 20, "placed": True}
    found = planning.simulated(study, "difference=10dB", 6, 5, **at)
    assert sum(found["unplaced"]) <= 2
    assert np.median(found["number"]) == pytest.approx(10, abs=0.6)
    assert sum(found["reached"]) == 6


@pytest.mark.parametrize(
    ("threshold_vpp", "spread_db", "least_vpp"),
    [(80, 2, 20.0), (58, 3, 20.0), (20, 3, 7.1), (5, 1, 2.8), (0.1, 3, 0.1)],
)
def test_pilots_reach_below_nearly_all_thresholds(
    threshold_vpp: float, spread_db: float, least_vpp: float
) -> None:
    study = study_of("", f"threshold_vpp = {threshold_vpp}\nthreshold_sd_db = {spread_db}")
    levels_vpp = planning.pilot_levels(study)
    assert (levels_vpp[0], levels_vpp[-1], len(levels_vpp)) == (least_vpp, 200.0, 10)


def test_pilots_have_no_level_that_the_sound_card_does_not_reach() -> None:
    card = '[device]\ndriver = "audio"\nvolts_full_scale = 59.39\n'
    study = study_of(f"levels_vpp = [40, 118.7]\n{card}", "threshold_vpp = 80")
    assert planning.pilot_levels(study)[-1] == 118.78


def test_a_threshold_known_for_another_vibration_is_that_of_the_studys_burst() -> None:
    study = study_of("", "threshold_vpp = 20.0\nthreshold_at_hz = 250\nthreshold_at_s = 0.2")
    simulation = planning.planned(study, "half-width=2dB")["simulation"]
    assert simulation["threshold_vpp"] > 22
    assert simulation["threshold_at_hz"] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("share", "bounds", "number", "begin"),
    [
        (lambda n: n / 25, (2, 40), 20, 12),  # fewer people, so that gains show
        (lambda n: n / 50, (2, 20), None, 20),  # the most people
        (lambda _: 0.97, (12, 12), 12, None),  # one number that is enough has none
        (lambda _: 0.83, (12, 12), 12, None),
        (lambda _: 0.7, (12, 12), None, 12),
        (lambda _: 0.97, (12, 14), 12, 12),
        (lambda _: 0.1, (1, 1), None, 1),
    ],
)
def test_other_designs_begin_where_their_gains_show(
    share: Callable[[int], float], bounds: tuple[int, int], number: int | None, begin: int | None
) -> None:
    found = planning.promised(share, bounds)
    assert (found.best.participants if found.best else None) == number
    people = {lever.before.point.participants for lever in found.levers}
    assert people == ({begin} if begin else set())
    gains = [lever.gain for lever in found.levers]
    assert all(first >= second for first, second in pairwise(gains))


@pytest.mark.parametrize(("goal", "study", "parts"), cases("studies that cannot be planned"))
def test_what_cannot_be_planned_is_refused_in_one_line(
    goal: str, study: str, parts: str, tmp_path: Path
) -> None:
    stated = "[simulation]\nthreshold_sd_db = 2.0\ndifference_sd_db = 1.0"
    done = run(
        "power", put(tmp_path / "study.toml", on_paper_plate(study or stated)), "--goal", goal
    )
    assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert all(part in done.stderr for part in parts.split("|"))
