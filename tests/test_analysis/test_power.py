"""Power: studies reach a goal as often as exact sums say; the curve finds the smallest number."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pytest
from scipy.special import ndtr, ndtri
from scipy.stats import binom

from analysis import proportion_ci
from analysis.planning.goals import Goal, Outcome
from analysis.planning.sessions import Session, draw_counts
from analysis.planning.studies import Chunk, Point, pilot_levels_vpp, plan_text, simulate
from experiment import simulate_study
from experiment.perception.gains import without_crosstalk
from experiment.study.physics import study_gains
from tests.plates import on_paper_plate
from tests.test_analysis.planning import (
    BOTH_AND_NONE,
    plan_of,
    search,
    simulated,
    stated_in,
    study_of,
)
from tests.test_analysis.shared import cases, put, run
from tests.test_experiment.test_identification import names, study_at

if TYPE_CHECKING:
    from pathlib import Path

BLANKS = f"""
[design]
{BOTH_AND_NONE}
[simulation]
threshold_vpp = 60.0
false_alarm_rate = 0.01
lapse_rate = 0.0
reaction_time_spread = 0.0
"""
FORCED = 'both_trials = 0\nblank_trials = 30\nresponses = ["left", "right", "none"]'
WANDERING = "wander_db = 1.0\nwander_trials = 9.0\nlast_answer_db = 2.0"


def powered(folder: Path, study: str, goal: str, *options: object) -> tuple[int, dict[str, Any]]:
    """Plan by the command; return its exit code and the object that it prints."""
    path = put(folder / "study.toml", on_paper_plate(study))
    done = run("power", path, "--goal", goal, "--seed", 3, "--json", *options)
    assert (done.exit_code in {0, 1}, done.stderr) == (True, "")
    return done.exit_code, json.loads(done.stdout)


def false_alarms_bounded(people: int) -> float:
    """Return the exact share of studies that bound false alarms of 1 % at 5 %."""
    k = np.arange(20 * people + 1)
    bounded = proportion_ci(k, 20 * people)[1] <= 0.05
    return float(binom.pmf(k, 20 * people, 0.01)[bounded].sum())


@pytest.mark.slow
def test_the_answer_is_the_smallest_number_that_exact_sums_allow(tmp_path: Path) -> None:
    figure = tmp_path / "curve.svg"
    options = ("--people", "stated", "--participants", 5, 10, "--figure", figure)
    _, result = powered(tmp_path, BLANKS, "false-alarms=5%", *options)
    for point in result["tried"]:
        exact = false_alarms_bounded(point["participants"])
        error = math.sqrt(exact * (1 - exact) / point["studies"])
        assert abs(point["share"] - exact) < 4 * error
    number = result["answer"]["participants"]
    assert false_alarms_bounded(number) > 0.76
    assert false_alarms_bounded(number - 2) < 0.8  # shares of whole counts rise as a sawtooth
    assert result["answer"]["checked"]["studies"] >= 300
    assert "participants" in result["ethics"]
    assert figure.read_text().startswith("<?xml")


@pytest.mark.slow
def test_a_goal_out_of_reach_is_an_answer_and_no_error(tmp_path: Path) -> None:
    code, result = powered(tmp_path, BLANKS, "false-alarms=1%", "--participants", 1, 2)
    assert (code, result["answer"]) == (1, None)
    assert {point["reached"] for point in result["tried"]} == {0}


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
    at: dict[str, Any] = {"trials_per_side": 5, "blanks": 30, "placed": placed}

    third, first, second = (simulated(study, goal, 2, 7, start, **at) for start in (4, 0, 2))
    together = simulated(study, goal, 6, 7, **at)
    assert together == [*first, *second, *third]
    assert [Outcome(*row) for row in json.loads(json.dumps(together))] == together


STEP: Final = """
levels_vpp = [50.0, 60.0, 70.0, 80.0, 90.0]
trials_per_side = 25
both_trials = 0
responses = ["left", "right", "none"]
blank_trials = 10
"""


def test_a_staircase_is_simulated_answer_by_answer() -> None:
    """Whoever detects all above 72 V goes 90, 80, 70 and up again at each site; blanks do not."""
    person = {"threshold_vpp": 72.0, "sigma": 0.001, "lapse_rate": 0.0, "false_alarm_rate": 0.0}
    study = study_of(STEP, "reaction_time_spread = 0").changed(levels={"rule": "staircase"})
    study = study.changed(simulation=person | {"reaction_time_spread": 0.0})
    sessions = [
        Session(
            person=study.simulation.median,
            designs=(study.design,) * 2,
            rng=np.random.default_rng(seed),
            shifts_db=(0.0, 0.0),
        )
        for seed in range(3)
    ]
    for counts in draw_counts(sessions, without_crosstalk(2), study.task, study.levels):
        assert counts.tables.presented.tolist() == [[0, 0, 16, 16, 18]] * 3
        assert counts.tables.detected.tolist() == [[0, 0, 0, 16, 18]] * 3


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["staircase", "bayesian"])
def test_chosen_levels_are_those_of_sessions_through_the_engine(rule: str, tmp_path: Path) -> None:
    people = "threshold_vpp = 75.0\nthreshold_sd_db = 2.0\nlast_answer_db = 1.0\nsigma = 0.08"
    study = study_of(STEP, people).changed(levels={"rule": rule})
    gains = study_gains(study)
    folders = simulate_study(study, tmp_path, participants=60, seed=5, gains=gains)
    rows = [row for folder in folders for row in folder.read_history(folder.read_plan()).rows]
    single = [row for row in rows if row.kind == "single" and row.status == "ok"]
    of_engine = np.array(
        [[row.level_vpp == vpp for row in single] for vpp in study.design.levels_vpp]
    ).reshape(5, 60, -1)
    sessions = [
        Session(
            person=study.simulation.draw(study.site_distance_mm, rng),
            designs=(study.design,),
            rng=rng,
        )
        for rng in map(np.random.default_rng, range(60))
    ]
    gains_of_fingers = gains[0].at_fingers(study.task.sites)
    (counts,) = draw_counts(sessions, gains_of_fingers, study.task, study.levels)
    shares = of_engine.mean(axis=2)
    drawn = counts.tables.presented.T / 50
    error = np.sqrt((shares.var(axis=1) + drawn.var(axis=1)) / 60)
    assert (np.abs(shares.mean(axis=1) - drawn.mean(axis=1)) < 4 * error + 1e-9).all()


@pytest.mark.parametrize(("kind", "n_sites"), [("yes-no", 1), ("yes-no", 3), ("identification", 4)])
def test_any_number_of_sites_can_be_planned(kind: str, n_sites: int) -> None:
    blanks = 20 if kind == "yes-no" else 0
    study = study_at(*names(n_sites), kind=kind, levels_vpp=[30, 50, 80, 120], blank_trials=blanks)
    plan = plan_text(study, study_gains(study), Goal.parse("half-width=9dB"))
    point = Point(participants=6, trials_per_side=60, blanks=blanks)
    outcomes = simulate(Chunk(plan=plan, point=point, first=0, number=2, seed=1))
    assert all(outcome.reached and outcome.covered for outcome in outcomes)


@pytest.mark.parametrize("bounds", [(2, 40), (2, 200), (7, 9)])
@pytest.mark.parametrize("assurance", [0.5, 0.8, 0.95])
@pytest.mark.parametrize("middle", [3.0, 8.0, 15.0, 30.0, 500.0])
def test_the_curve_recovers_the_number_of_participants(
    bounds: tuple[int, int], assurance: float, middle: float
) -> None:
    slope = 2.5
    answer = search(lambda n: float(ndtr(slope * math.log(n / middle))), bounds, assurance)
    exact = middle * math.exp(ndtri(assurance) / slope)
    if exact > 1.2 * bounds[1]:
        assert answer.participants is None
    elif exact < bounds[1] / 1.2:
        assert answer.participants is not None
        whole = max(math.ceil(exact), bounds[0])
        assert answer.participants == pytest.approx(whole, rel=0.15, abs=1)
        assert answer.low is not None
        assert answer.high is not None
        assert answer.low <= answer.participants <= answer.high
        assert answer.checked is not None
        assert answer.checked.high >= assurance


@pytest.mark.parametrize(("share", "answer"), [(0.97, 17), (0.82, 17), (0.5, None), (0.7, None)])
def test_a_single_number_is_checked(share: float, answer: int | None) -> None:
    result = search(lambda _: share, (17, 17))
    assert (result.participants, result.low, result.high) == (answer, answer, answer)


@pytest.mark.parametrize("most", [20, 11])
def test_a_number_that_fresh_studies_rule_out_is_not_the_answer(most: int) -> None:
    result = search(lambda n: float(n >= 12), (2, most))
    assert result.participants == (12 if most == 20 else None)


def test_a_number_beyond_the_range_is_extrapolated() -> None:
    result = search(lambda n: float(ndtr(2.5 * math.log(n / 30))), (2, 24))
    assert result.participants is None
    assert result.extrapolated is not None
    assert 24 < result.extrapolated < 72


@pytest.mark.slow
def test_the_goal_is_the_whole_difference_whatever_a_dry_run_has() -> None:
    people = "threshold_vpp = 80.0\ndifference_sd_db = 1.0"
    result, same = (
        simulated(study_of("", people + more), "difference=2dB", 8, 1, trials_per_side=20)
        for more in ("", "\ndifference_db = -3.0")
    )
    assert result == same
    assert 1.0 < np.median([outcome.number for outcome in result]) < 3.0


@pytest.mark.slow
@pytest.mark.parametrize("more", ["", "wander_db = 0.5\nwander_trials = 9.0"])
def test_each_condition_has_levels_of_its_own_after_a_pilot(more: str) -> None:
    """The study's levels would find neither threshold, nor one list of five both."""
    design = f"levels_vpp = [190.0, 195.0]\ntrials_per_side = 10\n{BOTH_AND_NONE}"
    study = study_of(design, f"threshold_vpp = 30.0\nthreshold_sd_db = 1.0\n{more}")
    at: dict[str, Any] = {"trials_per_side": 30, "blanks": 20, "placed": True}
    result = simulated(study, "difference=10dB", 6, 5, **at)
    reached, numbers, _, unplaced = zip(*result, strict=True)
    assert sum(unplaced) <= 2
    assert np.median(numbers) == pytest.approx(10, abs=0.6)
    assert sum(reached) == 6


@pytest.mark.parametrize(
    ("people", "device", "lowest_vpp", "highest_vpp"),
    [
        ("threshold_vpp = 80\nthreshold_sd_db = 2", "", 20.0, 200.0),
        ("threshold_vpp = 20\nthreshold_sd_db = 3", "", 7.1, 200.0),
        ("threshold_vpp = 0.1\nthreshold_sd_db = 3", "", 0.1, 200.0),
        ("threshold_vpp = 80", 'driver = "audio"\nvolts_full_scale = 59.39', 11.9, 118.78),
    ],
)
def test_pilots_reach_below_nearly_all_thresholds_and_as_far_as_the_device(
    people: str, device: str, lowest_vpp: float, highest_vpp: float
) -> None:
    study = study_of(f"levels_vpp = [40, 118.7]\n[device]\n{device}", people)
    levels_vpp = pilot_levels_vpp(study, without_crosstalk(2))
    assert (levels_vpp[0], levels_vpp[-1], len(levels_vpp)) == (lowest_vpp, highest_vpp, 10)


def test_a_threshold_of_another_vibration_is_that_of_the_studys_burst() -> None:
    study = study_of("", "threshold_vpp = 20.0\nthreshold_at_hz = 250\nthreshold_at_s = 0.2")
    simulation = stated_in(plan_of(study, "half-width=2dB"))
    assert simulation["threshold_vpp"] > 22
    assert simulation["threshold_at_hz"] is None


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["paper", "recommended", "realistic", "plate", "first-study"])
def test_the_file_that_init_writes_can_be_planned(preset: str, tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    plate = "--width-mm 40 --thickness-mm 0.7 --length-mm 180 --material glass --edge clamped"
    options = f"{plate} --actuator disc:15@45 --ceiling-vpp 120".split() * (preset == "plate")
    if preset == "first-study":
        from importlib.resources import files

        put(file, files("experiment.study.presets").joinpath("first-study.toml").read_text())
    else:
        assert run("init", file, "--preset", preset, *options).exit_code == 0
    done = run("power", file, "--participants", 2, 2, "--seed", 1)
    assert (done.exit_code, done.stderr) == (1, "")
    assert done.stdout.startswith("2 participants are not enough.")
    assert "threshold_sd_db = 3" in done.stdout
    assert len(done.stdout.splitlines()) < 25


@pytest.mark.parametrize(("goal", "study", "parts"), cases("studies that cannot be planned"))
def test_what_cannot_be_planned_is_refused_in_one_line(
    goal: str, study: str, parts: str, tmp_path: Path
) -> None:
    stated = "[simulation]\nthreshold_sd_db = 2.0\ndifference_sd_db = 1.0"
    file = put(tmp_path / "study.toml", on_paper_plate(study or stated))
    done = run("power", file, "--goal", goal, "--people", "stated")
    assert (done.exit_code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert all(part in done.stderr for part in parts.split("|"))
