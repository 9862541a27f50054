"""Levels placed on a participant's function: laws, expected precision, refusals, the command."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.thresholds import levels as placing
from analysis.thresholds.levels import (
    FELT,
    Function,
    LevelsError,
    expected_error_db,
    place_levels,
    placed,
)
from benchmarks.calibration import psychometric
from experiment.study.read import paper_study, read_levels
from tests.test_analysis.shared import PAPER, felt, put, run

if TYPE_CHECKING:
    from pathlib import Path

    from tests.test_analysis.conftest import Simulate

WIDE = (20.0, 40.0, 60.0, 80.0, 100.0, 130.0, 160.0, 200.0)
PILOT = """
[design]
levels_vpp = [20, 40, 60, 80, 100, 130, 160, 200]
trials_per_side = 40
both_trials = 0
order = "balanced"
responses = ["left", "right", "both", "none"]
foreperiod_s = [0.01, 0.02]

[simulation]
threshold_vpp = 85.0
threshold_sd_db = 0.0
sigma = 0.1
lapse_rate = 0.0
false_alarm_rate = 0.0
"""
TYPICAL = Function(threshold_vpp=62.0, sigma=0.08, lapse_rate=0.02, guess_rate=0.5)


RISING = [0, 0, 1, 2, 4, 5, 5, 5]


def pilot(detected: list[int] = RISING, **same: Any) -> pd.DataFrame:
    return felt(detected, WIDE, n=5, **({"participant": "P7"} | same))


@pytest.fixture
def folder(tmp_path: Path, simulate: Simulate) -> Path:
    """A pilot session of one simulated participant whose threshold is 85 V."""
    return simulate(tmp_path / "pilot", study=PILOT, seed=11)


@pytest.fixture
def few_studies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expected errors from fewer simulated studies: enough where their digits do not matter."""
    monkeypatch.setattr(placing, "_STUDIES", 20)


def owner(folder: Path) -> str:
    (session,) = folder.glob("sub-*")
    return session.name.removeprefix("sub-")


@given(st.floats(5, 100), st.floats(0.02, 0.3), st.floats(0, 0.5))
def test_each_level_is_felt_as_often_as_it_should_be(
    threshold_vpp: float, sigma: float, guess_rate: float
) -> None:
    one = Function(threshold_vpp=threshold_vpp, sigma=sigma, lapse_rate=0.0, guess_rate=guess_rate)
    levels = placed(one, 1000.0)
    same = {"threshold_vpp": threshold_vpp, "sigma": sigma}
    p = psychometric(levels, **same, guess_rate=0, lapse_rate=0)
    assert p == pytest.approx(FELT, abs=0.4 * 0.05 / (levels[0] * sigma * 2.3) + 1e-9)


@settings(max_examples=50)
@given(st.floats(1, 250), st.floats(0.02, 0.3))
def test_levels_rise_within_what_can_be_set_or_are_refused(
    threshold_vpp: float, sigma: float
) -> None:
    one = Function(threshold_vpp=threshold_vpp, sigma=sigma, lapse_rate=0.0, guess_rate=0.0)
    try:
        levels = placed(one, 200.0)
    except LevelsError:
        assert threshold_vpp * 10 ** (0.675 * sigma) > 200 or threshold_vpp * sigma < 0.5
        return
    assert len(levels) == 5
    assert (np.diff(levels) > 0).all()
    assert levels[0] >= 0.1
    assert levels[-1] <= 200


@pytest.mark.slow
def test_the_papers_levels_find_one_threshold_to_0_8_db_and_placed_levels_to_0_5_db() -> None:
    """150 stimuli; a forced choice with a threshold near the paper's lowest level."""
    fixed = expected_error_db(TYPICAL, PAPER, 150)
    near = expected_error_db(TYPICAL, placed(TYPICAL, 200.0), 150)
    assert fixed == pytest.approx(0.81, abs=0.1)
    assert near == pytest.approx(0.5, abs=0.06)


@pytest.mark.slow
def test_more_trials_make_the_error_smaller_by_their_root() -> None:
    levels = placed(TYPICAL, 200.0)
    errors = [expected_error_db(TYPICAL, levels, trials) for trials in (300, 1200)]
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.2)
    assert expected_error_db(TYPICAL, levels, 300) == errors[0]


def test_one_level_finds_no_threshold() -> None:
    assert math.isnan(expected_error_db(TYPICAL, [60.0], 150))


@pytest.mark.usefixtures("few_studies")
def test_a_pilot_places_levels_around_its_threshold() -> None:
    found = place_levels(pilot(), "P7", paper_study())
    assert found.levels_vpp[0] < found.function.threshold_vpp < found.levels_vpp[3]
    assert found.felt == pytest.approx(FELT, abs=0.01)
    assert found.error_db < found.fixed_error_db
    assert (found.trials, found.fixed_levels_vpp) == (150, tuple(PAPER))


@pytest.mark.usefixtures("few_studies")
def test_a_pilot_that_rises_in_one_step_places_levels_about_the_step() -> None:
    found = place_levels(pilot([0, 0, 0, 2, 5, 5, 5, 5]), "P7", paper_study())
    assert found.levels_vpp[0] < 80 < found.levels_vpp[-1]
    low, high = found.threshold_limits_vpp
    assert 60 < low < found.function.threshold_vpp < high < 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trials", "said"),
    [
        (pilot([5] * 8), "threshold_below_levels .< 20 V."),
        (pilot([0] * 8), "threshold_above_levels .> 200 V."),
        (pilot([2, 3, 2, 3, 2, 3, 2, 3]), "flat"),
        (pilot([5, 5, 4, 3, 2, 1, 0, 0]), "decreasing"),
        (pilot([3, 2, 2, 3, 3, 2, 4, 4], none_offered=False), "cannot place levels|only as"),
        (pilot([0, 1, 0, 1, 1, 1, 2, 3]), "threshold_above_levels|only as|too close"),
        (pilot(participant="other"), "got conditions: none"),
        (pilot(kind="practice"), "got conditions: none"),
        (pd.concat([pilot(condition=name) for name in "ab"]), "got conditions: a, b"),
    ],
)
def test_a_pilot_that_cannot_place_levels_is_refused(trials: pd.DataFrame, said: str) -> None:
    with pytest.raises(LevelsError, match=said):
        place_levels(trials, "P7", paper_study())


def test_levels_at_the_ceiling_are_refused_below_three_quarters() -> None:
    one = Function(threshold_vpp=185.0, sigma=0.1, lapse_rate=0.0, guess_rate=0.0)
    with pytest.raises(LevelsError, match="too close to an end of the levels that can be set"):
        placed(one, 200.0)
    assert placed(one, 220.0)[-1] == 220.0


@pytest.mark.usefixtures("few_studies")
def test_the_command_writes_what_run_reads(folder: Path, tmp_path: Path) -> None:
    target, name = tmp_path / "levels.toml", owner(folder)
    result = run("levels", folder, "--participant", name, "--write", target)
    assert (result.exit_code, result.stderr) == (0, "")
    levels = read_levels(target, name)
    assert len(levels) == 5
    assert levels[0] < 85 < levels[-1]
    assert "dB with these levels" in result.stdout
    assert "dB with 20 40 60 80 100 130 160 200 V" in result.stdout
    again = run("levels", folder, "--participant", name)
    assert again.stdout == result.stdout[: len(again.stdout)]


def test_no_levels_come_from_a_person_without_a_device(folder: Path, tmp_path: Path) -> None:
    name = owner(folder)
    (trials,) = folder.rglob("trials.csv")
    alone = tmp_path / "alone" / "pilot.csv"
    alone.parent.mkdir()
    table = pd.read_csv(trials, dtype=str, keep_default_na=False)
    table["simulated"] = "false"
    table.to_csv(alone, index=False)
    result = run("levels", alone, "--participant", name, "--write", tmp_path / "levels.toml")
    assert result.exit_code == 2
    assert f"participant {name} practised without a device" in result.stderr
    assert not (tmp_path / "levels.toml").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("{dir} --participant {me} --write {file}", "--write must be a new file; got {file}"),
        (
            "{dir} --participant {me} --write l.txt",
            "--write must be a file that ends in .toml; got",
        ),
        ("{dir} --participant {me} --study {study}", "levels that can be set, 0.1 to 90 V"),
        ("{dir} --participant nobody", "error: --participant must be one of {me}; got nobody\n"),
        ("nowhere --participant 1", "nowhere: no such file or folder"),
        ("nowhere", "Missing option '--participant'"),
    ],
)
def test_a_refusal_is_one_line(folder: Path, tmp_path: Path, arguments: str, said: str) -> None:
    study = "[design]\nlevels_vpp = [60, 90]\n[device]\nceiling_vpp = 90\n"
    mine = put(tmp_path / "levels.toml", "mine")
    study_file = put(tmp_path / "study.toml", study)
    named = {"dir": folder, "me": owner(folder), "study": study_file, "file": mine}
    result = run("levels", *(word.format(**named) for word in arguments.split()))
    assert result.exit_code == 2
    assert said.format(**named) in result.stderr
    assert result.stderr.count("\n") == 1
    assert mine.read_text() == "mine"
