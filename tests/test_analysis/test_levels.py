"""Levels placed on a participant's function: laws, expected precision, refusals, the command."""

from __future__ import annotations

import math
import tomllib
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import threshold_table
from analysis.planning.levels import (
    TARGETS,
    LevelsError,
    Placement,
    expected_error,
    levels_on,
    place_levels,
)
from analysis.thresholds.band import Line
from benchmarks.calibration import psychometric
from experiment import draw_plan, paper_study, read_study
from tests.plates import PAPER_PLATE
from tests.test_analysis.shared import PAPER, felt, put, run

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from tests.conftest import Simulate

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
TYPICAL = Line(mu=math.log10(62), sigma=0.08, lapse_rate=0.02, guess_rate=0.5)


RISING = [0, 0, 1, 2, 4, 5, 5, 5]


def pilot(detected: list[int] = RISING, **same: Any) -> pd.DataFrame:
    return felt(detected, WIDE, n=5, **({"participant": "P7"} | same))


@pytest.fixture
def folder(tmp_path: Path, simulate: Simulate) -> Path:
    """A pilot session of one simulated participant whose threshold is 85 V."""
    return simulate(tmp_path / "pilot", study=PILOT, seed=11)


@pytest.fixture
def few_studies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expected errors from fewer drawn functions: enough where their digits do not matter."""
    monkeypatch.setattr("analysis.planning.levels._DRAWS", 5)


def only(trials: pd.DataFrame) -> Placement:
    (found,) = place_levels(trials, "P7", paper_study()).values()
    if isinstance(found, LevelsError):
        raise found
    return found


def owner(folder: Path) -> str:
    (session,) = folder.glob("sub-*")
    return session.name.removeprefix("sub-")


@given(st.floats(5, 100), st.floats(0.02, 0.3), st.floats(0, 0.5))
def test_each_level_is_felt_as_often_as_it_should_be(
    threshold_vpp: float, sigma: float, guess_rate: float
) -> None:
    one = Line(mu=math.log10(threshold_vpp), sigma=sigma, lapse_rate=0.0, guess_rate=guess_rate)
    levels = levels_on(one, 1000.0)
    p = psychometric(levels, threshold_vpp=threshold_vpp, sigma=sigma, guess_rate=0, lapse_rate=0)
    assert p == pytest.approx(TARGETS, abs=0.4 * 0.05 / (levels[0] * sigma * 2.3) + 1e-9)


@settings(max_examples=50)
@given(st.floats(1, 250), st.floats(0.02, 0.3))
def test_levels_rise_within_what_can_be_set_or_are_refused(
    threshold_vpp: float, sigma: float
) -> None:
    one = Line(mu=math.log10(threshold_vpp), sigma=sigma, lapse_rate=0.0, guess_rate=0.0)
    try:
        levels = levels_on(one, 200.0)
    except LevelsError:
        assert threshold_vpp * 10 ** (0.675 * sigma) > 200 or threshold_vpp * sigma < 0.5
        return
    assert len(levels) == 5
    assert (np.diff(levels) > 0).all()
    assert levels[0] >= 0.1
    assert levels[-1] <= 200


def error_db(levels: Sequence[float], trials: int) -> float:
    many = replace(TYPICAL, mu=np.full(60, TYPICAL.mu))
    return expected_error(many, levels, trials).median_db


@pytest.mark.slow
def test_the_papers_levels_find_one_threshold_to_0_8_db_and_placed_levels_to_0_5_db() -> None:
    """150 stimuli; a forced choice with a threshold near the paper's lowest level."""
    assert error_db(PAPER, 150) == pytest.approx(0.81, abs=0.1)
    assert error_db(levels_on(TYPICAL, 200.0), 150) == pytest.approx(0.5, abs=0.06)


@pytest.mark.slow
def test_more_trials_make_the_error_smaller_by_their_root() -> None:
    levels = levels_on(TYPICAL, 200.0)
    errors = [error_db(levels, trials) for trials in (300, 1200)]
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.2)
    assert error_db(levels, 300) == errors[0]


def test_one_level_finds_no_threshold() -> None:
    assert math.isnan(error_db([60.0], 150))


@pytest.mark.slow
@pytest.mark.usefixtures("few_studies")
def test_a_pilot_places_levels_around_its_threshold() -> None:
    found = only(pilot())
    assert found.levels_vpp[0] < found.threshold_vpp[1] < found.levels_vpp[3]
    assert found.shares == pytest.approx(TARGETS, abs=0.01)
    assert found.error.median_db < found.error.p90_db
    assert found.error.median_db < found.design_error.median_db
    assert found.design.levels_vpp == tuple(PAPER)
    row = threshold_table(pilot(), seed=1).iloc[0]
    points = row[["threshold_low_vpp", "threshold_vpp", "threshold_high_vpp"]].tolist()
    assert found.threshold_vpp == pytest.approx(points, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trials", "status"),
    [
        (pilot([5] * 8), "threshold_below_levels.*20 V"),
        (pilot([0] * 8), "threshold_above_levels.*200 V"),
        (pilot([2, 3, 2, 3, 2, 3, 2, 3]), "flat"),
        (pilot([5, 5, 4, 3, 2, 1, 0, 0]), "decreasing"),
        (pilot([3, 2, 2, 3, 3, 2, 4, 4], none_offered=False), "P7"),
        (pilot([0, 1, 0, 1, 1, 1, 2, 3]), "threshold"),
        (pilot(participant="other"), "P7"),
        (pilot(kind="practice"), "P7"),
    ],
)
def test_a_pilot_that_cannot_place_levels_is_refused(trials: pd.DataFrame, status: str) -> None:
    with pytest.raises(LevelsError, match=status):
        only(trials)


@pytest.mark.slow
@pytest.mark.usefixtures("few_studies")
def test_each_condition_of_a_pilot_has_levels_or_a_reason() -> None:
    none = felt([5] * 8, WIDE, n=5, participant="P7", condition="b")
    a, b, c = place_levels(
        pd.concat([pilot(condition="a"), none, pilot([0, 0, 0, 1, 2, 4, 5, 5], condition="c")]),
        "P7",
        paper_study(),
    ).values()
    assert isinstance(a, Placement)
    assert isinstance(c, Placement)
    assert (a.condition, c.condition) == ("a", "c")
    assert a.levels_vpp[2] < c.levels_vpp[2]
    assert isinstance(b, LevelsError)
    assert "threshold_below_levels" in str(b)
    alone = only(pilot(condition="a"))
    assert (a.levels_vpp, a.error) == (alone.levels_vpp, alone.error)
    assert asdict(a.function) == pytest.approx(asdict(alone.function))


def test_levels_at_the_ceiling_are_refused_below_three_quarters() -> None:
    one = Line(mu=math.log10(185), sigma=0.1, lapse_rate=0.0, guess_rate=0.0)
    with pytest.raises(LevelsError, match="200"):
        levels_on(one, 200.0)
    assert levels_on(one, 220.0)[-1] == 220.0


@pytest.fixture
def table(folder: Path, tmp_path: Path) -> Path:
    """The table of the pilot alone, without the plan beside it."""
    (trials,) = folder.rglob("trials.csv")
    return put(tmp_path / "alone" / "pilot.csv", trials.read_text(encoding="utf-8"))


def change(table: Path, **columns: str) -> pd.DataFrame:
    """Return the rows of a table with other values in some columns."""
    return pd.read_csv(table, dtype=str, keep_default_na=False).assign(**columns)


def levels_in(path: Path) -> Any:
    return tomllib.loads(path.read_text("utf-8"))["levels_vpp"]


@pytest.mark.usefixtures("few_studies")
def test_the_command_writes_levels_about_the_threshold(folder: Path, tmp_path: Path) -> None:
    target, name = tmp_path / "levels.toml", owner(folder)
    result = run("levels", folder, "--participant", name, "--write", target)
    assert (result.exit_code, result.stderr) == (0, "")
    written = tomllib.loads(target.read_text("utf-8"))
    assert written["participant"] == name
    levels = written["levels_vpp"]
    assert len(levels) == 5
    assert levels[0] < 85 < levels[-1]
    plan = draw_plan(paper_study(), participant=name, session="01", seed=1, levels_vpp=(*levels,))
    assert {trial.level_vpp for trial in plan.trials if trial.kind == "single"} == {*levels}
    again = run("levels", folder, "--participant", name)
    assert again.stdout == result.stdout[: len(again.stdout)]


@pytest.mark.usefixtures("few_studies")
@pytest.mark.parametrize(
    ("device", "most_vpp", "key"),
    [
        ('driver = "audio"\nvolts_full_scale = 55.03', 110.06, "2 x device.volts_full_scale"),
        ('driver = "generator"\namplifier_gain = 5.5', 110.0, "20 x device.amplifier_gain"),
        ("ceiling_vpp = 110", 110.0, "device.ceiling_vpp"),
    ],
)
def test_placed_levels_stay_within_what_the_device_reaches_and_fit_its_study(
    folder: Path, tmp_path: Path, device: str, most_vpp: float, key: str
) -> None:
    study = put(
        tmp_path / "s.toml", f"{PAPER_PLATE}[design]\nlevels_vpp = [40, 110]\n[device]\n{device}\n"
    )
    target, name = tmp_path / "levels.toml", owner(folder)
    result = run("levels", folder, "--participant", name, "--study", study, "--write", target)
    assert result.exit_code == 0, result.stderr
    assert f"{most_vpp:g} V = {key}" in result.stdout
    levels = (*levels_in(target),)
    assert levels[-1] == 110.0
    draw_plan(read_study(study), participant=name, session="01", seed=1, levels_vpp=levels)


def test_no_levels_come_from_a_person_without_a_device(table: Path, tmp_path: Path) -> None:
    rows = change(table, simulated="false")
    rows.to_csv(table, index=False)
    name, target = rows["participant"][0], tmp_path / "levels.toml"
    result = run("levels", table, "--participant", name, "--write", target)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert not target.exists()


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        ("{dir} --participant {me} --write {file}", "--write|{file}"),
        ("{dir} --participant {me} --write l.txt", "--write|.toml"),
        ("{dir} --participant {me} --study {study}", "90 V = device.ceiling_vpp"),
        ("{dir} --participant nobody", "--participant|{me}|nobody"),
        ("nowhere --participant 1", "nowhere: "),
        ("nowhere", "'--participant'"),
    ],
)
def test_a_refusal_is_one_line(folder: Path, tmp_path: Path, arguments: str, parts: str) -> None:
    study = f"{PAPER_PLATE}[design]\nlevels_vpp = [60, 90]\n[device]\nceiling_vpp = 90\n"
    mine = put(tmp_path / "levels.toml", "mine")
    study_file = put(tmp_path / "study.toml", study)
    named = {"dir": folder, "me": owner(folder), "study": study_file, "file": mine}
    result = run("levels", *(word.format(**named) for word in arguments.split()))
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert all(part in result.stderr for part in parts.format(**named).split("|"))
    assert mine.read_text() == "mine"
