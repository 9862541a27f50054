"""Serial effects: none is found where the order of stimuli is not random, and true ones are."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from analysis import load_column_map
from analysis.answers import serial
from analysis.answers.choice import choices
from analysis.answers.serial import ADAPTIVE, FOLLOWING_Z, SerialEffect, runs
from analysis.definitions import TOTAL
from analysis.reading.load import read_inputs
from benchmarks.people import HONEST
from benchmarks.serial import DRIFT, LAST, NO_EFFECT, Order, found, levels_follow, session
from tests.test_analysis.shared import SINGLE, put, run

if TYPE_CHECKING:
    from pathlib import Path

EQUAL = "too few equal stimuli with different answers"
LATER = [name for name in NO_EFFECT if name and not name.startswith(("continuous", "stair"))]


def trials(side: list[str], level_vpp: list[float], response: list[str]) -> pd.DataFrame:
    """Trials of one person in their order."""
    table = pd.DataFrame({"side": side, "level_vpp": level_vpp, "response": response})
    fixed = SINGLE | {"session": "01", "block": 1, "attempt": 1, "none_offered": True}
    more = {name: value for name, value in fixed.items() if name not in table}
    return table.assign(**more, trial=np.arange(len(table)))


def effect(table: pd.DataFrame, name: str = "felt") -> SerialEffect:
    (one,) = (one for one in choices(table) if one.participant == TOTAL)
    found: SerialEffect = getattr(one.serial, name)
    return found


def test_a_run_has_one_stimulus_and_as_many_trials_as_a_drift_allows() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        stimuli = rng.integers(0, rng.integers(1, 9), rng.integers(1, 200))
        blocks = np.sort(rng.integers(0, rng.integers(1, 9), len(stimuli)))
        number = runs(stimuli, blocks)
        assert set(number) == set(range(number.max() + 1))
        for one in range(number.max() + 1):
            (name,) = set(stimuli[number == one])
            assert (number == one).sum() >= min(5, (stimuli == name).sum())


def test_blocks_with_enough_of_a_stimulus_share_no_run() -> None:
    stimuli, blocks = np.tile([0, 0, 0, 1], 8), np.repeat([1, 2], 16)
    number = runs(stimuli, blocks)
    assert not set(number[stimuli == 0][:12]) & set(number[stimuli == 0][12:])
    assert len(set(number[stimuli == 1])) == 1  # four in a block are too few


def test_strong_and_weak_stimuli_in_turn_are_no_effect_of_answers() -> None:
    level = [90.0, 30.0] * 40
    answer = ["left" if one == 90 else "none" for one in level]
    found = effect(trials(["left"] * 80, level, answer))
    assert (found.again.p, found.p, found.difference, found.reason) == (0.0, None, None, EQUAL)
    rng = np.random.default_rng(1)
    unsure = [a if rng.random() < 0.8 else "none" for a in answer]
    found = effect(trials(["left"] * 80, level, unsure))
    assert found.again.p == 0
    assert found.p is None or found.p > 0.05


def test_the_difference_is_that_of_proportions_beyond_the_stimuli() -> None:
    rng = np.random.default_rng(2)
    level = rng.choice([40.0, 60.0, 80.0], 6000)
    felt = [True]
    for one in level[1:]:
        felt.append(rng.random() < {40: 0.2, 60: 0.5, 80: 0.8}[one] + (0.1 if felt[-1] else -0.1))
    found = effect(trials(["left"] * 6000, level.tolist(), ["left" if y else "none" for y in felt]))
    assert found.difference == pytest.approx(0.2, abs=0.04)
    assert found.p == 0.002
    assert found.otherwise is not None
    shares = found.again.p, found.otherwise.p, found.expected, found.expected_otherwise
    again, otherwise, given, given_otherwise = (one or 0 for one in shares)
    assert (again - otherwise) - (given - given_otherwise) == pytest.approx(0.2, abs=0.04)


def test_levels_that_hardly_come_twice_tell_nothing() -> None:
    rng = np.random.default_rng(3)
    level = rng.uniform(40, 90, 300).round(2)
    level[:6] = 60.0
    answer = rng.choice(["left", "none"], 300)
    one = effect(trials(["left"] * 300, level.tolist(), answer.tolist()))
    assert (one.p, one.difference, one.expected, one.reason) == (None, None, None, EQUAL)


def test_levels_of_a_staircase_tell_nothing() -> None:
    order = NO_EFFECT["staircase, one"][0]
    told = [levels_follow([session(order, HONEST, np.random.default_rng(s))]) for s in range(20)]
    assert max(told) < FOLLOWING_Z
    level, answers, rng = [60.0], [], np.random.default_rng(1)
    for _ in range(80):
        answers.append(str(rng.choice(["left", "none"], p=[level[-1] / 120, 1 - level[-1] / 120])))
        level.append(level[-1] + (-10.0 if answers[-1] == "left" else 10.0))
    one = effect(trials(["left"] * 80, level[:-1], answers))
    assert (one.p, one.difference, one.reason) == (None, None, ADAPTIVE)


def test_sides_in_turn_are_told_and_are_no_effect() -> None:
    rng = np.random.default_rng(4)
    side = ["left", "right"] * 100
    other = {"left": "right", "right": "left"}
    answer = [one if rng.random() < 0.8 else other[one] for one in side]
    found = effect(trials(side, [60.0] * 200, answer), "side")
    assert (found.again.p or 1) < 0.4
    assert found.expected == pytest.approx(0.32, abs=0.05)
    assert (found.p or 0) > 0.05


@pytest.mark.parametrize(
    "name", ["", *(pytest.param(name, marks=pytest.mark.long) for name in LATER)]
)
@pytest.mark.slow
def test_one_in_twenty_tables_without_an_effect_has_a_small_p(name: str) -> None:
    order, median = NO_EFFECT[name]
    told = found(order, median, 400, compared=False)
    assert told["felt"].of > 380
    for what in ("felt", "correct"):
        assert told[what].small <= 0.085 * told[what].of
        assert abs(told[what].difference) < 0.015
    assert told["side"].small <= max(0.085 * told["side"].of, 4)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["", "balanced"])
def test_a_drift_is_hardly_taken_for_a_serial_effect(name: str) -> None:
    told = found(*DRIFT[f"{name}, drift"], 100, compared=False)
    assert told["felt"].small <= 12


@pytest.mark.slow
def test_runs_of_a_whole_session_would_take_a_drift_for_an_effect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    order, median = Order(how="shuffled", repeats=20), replace(HONEST, drift_db=4.0)
    short = found(order, median, 40, compared=False)["felt"]
    monkeypatch.setattr(serial, "SPAN", 10**6)
    long = found(order, median, 40, compared=False)["felt"]
    assert long.difference > 0.03
    assert short.difference < 0.02
    assert long.small > short.small


@pytest.mark.slow
def test_an_effect_of_the_last_answer_is_found() -> None:
    told = found(*LAST[", 2.0"], 60, compared=False)
    assert told["felt"].small >= 45
    assert 0.12 < told["felt"].difference < 0.25


@pytest.mark.slow
def test_random_orders_of_whole_trials_would_take_the_order_for_an_effect() -> None:
    order, median = NO_EFFECT[""]
    told = found(replace(order, people=12), median, 60)
    assert told["whole trials"].small >= 12
    assert told["felt"].small <= 8


MAP = """
task = "yes/no"

[rows.skip]
"trials.thisN" = ""

[columns]
trial = "trials.thisN"
level_vpp = "intensity"
detected = "key_resp.keys"

[values.detected]
y = "1"
n = "0"

[constant]
side = "left"

[axis]
unit = "% FS"
"""
PSYCHOPY = Order(how="each once a repetition", repeats=15, people=6)


def _psychopy(folder: Path, seed: int) -> None:
    """Write what PsychoPy's Builder does, a file a person, the loop's order random."""
    folder.mkdir(parents=True)
    head = ["instr.started", "intensity", "key_resp.keys", "trials.thisRepN", "trials.thisN"]
    for number in range(PSYCHOPY.people):
        one = session(PSYCHOPY, HONEST, np.random.default_rng((seed, number)))
        path = folder / f"p{number}_felt.csv"
        with path.open("w", newline="", encoding="utf-8-sig") as file:
            table = csv.writer(file)
            table.writerow([*head, "participant", "session"])
            table.writerow(["4.2", "", "", "", "", f"p{number}", "001"])
            for trial, level in enumerate(one.level_vpp):
                key = "n" if one.answer[trial] == 3 else "y"
                place = [trial // len(PSYCHOPY.each), trial, f"p{number}", "001"]
                table.writerow(["", level, key, *place])


@pytest.mark.slow
def test_tables_of_psychopy_in_its_random_order_have_no_serial_effect(tmp_path: Path) -> None:
    columns = load_column_map(put(tmp_path / "map.toml", MAP))
    told = []
    for seed in range(20):
        _psychopy(tmp_path / str(seed), seed)
        told.append(effect(read_inputs([tmp_path / str(seed)], columns).trials))
    assert sum((one.p or 0) < 0.05 for one in told) <= 3
    assert abs(np.mean([one.difference for one in told if one.difference is not None])) < 0.03


@pytest.mark.slow
def test_the_report_tells_what_the_stimuli_alone_give(tmp_path: Path) -> None:
    _psychopy(tmp_path / "data", 1)
    put(tmp_path / "map.toml", MAP)
    out = tmp_path / "out"
    done = run("analyze", tmp_path / "data", "--columns", tmp_path / "map.toml", "--out", out)
    assert done.exit_code == 0, done.output
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    felt = next(one for one in summary["choice"] if one["participant"] == TOTAL)["serial"]["felt"]
    assert felt["p"] > 0.05
    assert abs(felt["difference"]) < 0.1
    page = (out / "report.html").read_text(encoding="utf-8")
    given = f"the stimuli alone give {felt['expected']:.3f} and {felt['expected_otherwise']:.3f}"
    assert f"{given}; difference beyond them {felt['difference']:+.3f}" in page
