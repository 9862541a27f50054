"""A threshold in micrometres is that in volts times what trials.csv tells of the fingers."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from click.testing import CliRunner

from analysis.axis import VOLTS, Axis
from analysis.groups.micrometres import (
    UM_COLUMNS,
    group_per_volt,
    in_micrometres,
    micrometres_row,
    unequal_sides,
    with_group_micrometres,
    with_micrometres,
)
from tactstrip import main


def trials(left: float, right: float, basis: str = "measured", **columns: Any) -> pd.DataFrame:
    """Return a single stimulus on each side, of so many micrometres per volt."""
    told = {
        "participant": "1", "condition": "main", "kind": "single", "side": ["left", "right"],
        "level_vpp": [100.0, 50.0], "reason": "", "displacement_basis": basis,
        "peak_left_um": [100 * left, 0.01], "peak_right_um": [0.01, 50 * right],
    }  # fmt: skip
    return pd.DataFrame(told | columns)


def threshold(participant: str = "1", status: str = "ok", low_vpp: float = 50.0) -> pd.DataFrame:
    told = {
        "participant": [participant], "condition": ["main"], "status": [status],
        "threshold_vpp": [60.0], "threshold_low_vpp": [low_vpp], "threshold_high_vpp": [72.0],
    }  # fmt: skip
    return pd.DataFrame(told)


PER_VOLT = "by the measured displacement per volt"


def said(of: pd.DataFrame, table: pd.DataFrame) -> tuple[str, list[tuple[str, str, str]]]:
    """Return what is said of one person's threshold, in the sentence and in the table."""
    people = with_micrometres(table, of, VOLTS)
    row = people.iloc[0]
    return in_micrometres(row, people), [*micrometres_row(row, people, "")]


def test_what_is_the_same_of_both_sides_is_said_once_and_what_differs_of_each() -> None:
    words, rows = said(trials(0.02, 0.02), threshold())
    assert words == f"; at the fingers 1.20 um, {PER_VOLT}"
    assert rows == [
        ("The same at the fingers", "1.20 um (1.00 to 1.44)", "measured displacement per volt")
    ]
    words, rows = said(trials(0.02, 0.018), threshold())
    assert words == f"; these volts give the fingers 1.20 um left and 1.08 um right, {PER_VOLT}"
    assert rows[0][1] == "1.20 um (1.00 to 1.44) left and 1.08 um (0.900 to 1.30) right"
    assert rows[0][0] == "What these volts give the fingers"


@pytest.mark.parametrize(
    ("left", "right", "begins"),
    [
        (0.02, 0.0225, "the same volts move the right finger 1.0 dB more than the left: a thres"),
        (0.0225, 0.02, "the same volts move the left finger 1.0 dB more than the right: a thres"),
        (0.02, 0.0223, None),
        (0.02, 0.02, None),
        (0.02, math.nan, None),
    ],
)
def test_volts_that_move_one_finger_more_are_warned_of(
    left: float, right: float, begins: str | None
) -> None:
    told = list(unequal_sides(trials(left, right), VOLTS))
    assert len(told) == (begins is not None)
    assert begins is None or told[0].startswith(begins)
    assert not list(unequal_sides(trials(left, right), Axis(x_scale="linear", unit="mm")))


def test_it_is_said_that_only_some_have_such_a_plate() -> None:
    of = pd.concat([trials(0.02, 0.03), trials(0.02, 0.02, participant="2")])
    (told,) = unequal_sides(of, VOLTS)
    assert " 3.5 dB more than the left (not of all people and conditions): " in told


def test_what_is_predicted_is_not_called_measured() -> None:
    assert said(trials(0.02, 0.02, "predicted"), threshold())[0].endswith(
        " um, by the predicted displacement per volt"
    )
    both = trials(0.02, 0.02, displacement_basis=["measured", "predicted"])
    assert said(both, threshold())[0].endswith(" um, by the predicted displacement per volt")


@pytest.mark.parametrize(
    "of",
    [
        trials(0.02, 0.02, displacement_basis=[None, None]),
        trials(0.02, 0.02, reason="voided"),
        trials(0.02, 0.02, participant="2"),
        trials(0.02, 0.02, kind="both"),
        trials(0.02, 0.02).drop(columns=["peak_left_um", "displacement_basis"]),
        trials(0.02, 0.02).iloc[:0],
    ],
)
def test_without_displacement_of_counted_single_stimuli_nothing_is_said(of: pd.DataFrame) -> None:
    assert said(of, threshold()) == ("", [])


def test_a_threshold_that_is_only_bounded_has_no_micrometres() -> None:
    people = with_micrometres(threshold(status="threshold_above_levels"), trials(0.02, 0.02), VOLTS)
    assert people[[*UM_COLUMNS]].isna().to_numpy().all()
    assert said(trials(0.02, 0.02), threshold(status="flat")) == ("", [])


def test_an_open_limit_is_open_in_micrometres_too() -> None:
    ((_, words, _),) = said(trials(0.02, 0.02), threshold(low_vpp=math.nan))[1]
    assert words == "1.20 um (open to 1.44)"


def test_levels_in_another_unit_have_none() -> None:
    axis = Axis(x_scale="linear", unit="mm")
    people = with_micrometres(threshold(), trials(0.02, 0.02), axis)
    assert people[[*UM_COLUMNS]].isna().to_numpy().all()


def test_a_plate_that_was_measured_anew_between_sessions_has_no_one_number() -> None:
    of = pd.concat([trials(0.02, 0.02), trials(0.03, 0.02)])
    people = with_micrometres(threshold(), of, VOLTS)
    left_um, right_um, basis = people[[*UM_COLUMNS]].to_numpy().tolist()[0]
    assert (math.isnan(left_um), right_um, basis) == (True, pytest.approx(1.2), "measured")
    assert in_micrometres(people.iloc[0], people) == f"; at the fingers 1.20 um right, {PER_VOLT}"


def test_a_group_has_micrometres_where_all_with_a_threshold_have_the_same() -> None:
    table = pd.concat([threshold("1"), threshold("2")], ignore_index=True)
    same = pd.concat([trials(0.02, 0.02), trials(0.02, 0.02, participant="2")])
    other = pd.concat([trials(0.02, 0.02), trials(0.03, 0.03, participant="2")])
    group = threshold().drop(columns="participant")
    people = with_micrometres(table, same, VOLTS)
    assert with_group_micrometres(group, people).loc[0, UM_COLUMNS[0]] == pytest.approx(1.2)
    for of in (other, trials(0.02, 0.02)):
        people = with_micrometres(table, of, VOLTS)
        assert math.isnan(group_per_volt(people)[0])
        assert with_group_micrometres(group, people)[[*UM_COLUMNS]].isna().to_numpy().all()


@pytest.mark.slow
def test_a_dry_run_of_a_measured_plate_tells_them_in_table_and_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    study = Path(__file__).parents[2] / "docs" / "examples" / "first-study.toml"
    command = ["dry-run", str(study), "--seed", "7", "--out", "out"]
    result = CliRunner().invoke(main, command)
    assert result.exit_code == 0
    with (tmp_path / "out/analysis/thresholds.csv").open(encoding="utf-8") as table:
        rows = [row for row in csv.DictReader(table) if row["threshold_left_um"] != "n/a"]
    assert {row["participant"] for row in rows} >= {"all"}
    for row in rows:
        ratio = float(row["threshold_left_um"]) / float(row["threshold_vpp"])
        assert ratio == pytest.approx(1.57 / 58.8, rel=3e-3)  # as its first lines say
        assert row["displacement_basis"] == "measured"
    assert "at the fingers " in " ".join(result.stdout.split())
