"""Control trials in the analysis: counted apart, written apart, in no probability."""

from __future__ import annotations

import csv
import io
import json
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, read_trials
from analysis.answers.counting import control_table
from analysis.answers.detection import both_table, level_table
from analysis.reading.load import read_inputs
from analysis.results.tables import analyse
from tests.test_analysis.shared import EXAMPLES, loaded, put, refused, run

if TYPE_CHECKING:
    from pathlib import Path

    from tests.conftest import Simulate

HEADER = "participant,block,trial,kind,side,level_vpp,response,status,anticipated,noise_ok\n"
MAIN = (
    "1,1,90,single,left,60,left,ok,false,true\n1,1,91,single,right,60,left,ok,false,true\n"
    "1,1,92,both,both,60,both,ok,false,true\n"
)
CONTROL = (
    "1,-1,1,control,left,200,none,ok,false,true\n"
    "1,-1,2,control,right,200,right,ok,false,true\n"
    "1,-1,3,control,left,200,left,voided,false,false\n"
    "1,-1,4,control,left,200,left,ok,true,true\n"
    "1,9,94,control,left,200,timeout,ok,false,true\n"
    "1,9,95,control,left,200,both,ok,false,true\n"
    "1,9,96,control,right,200,none,ok,false,n/a\n"
    "1,9,97,control,right,200,left,ok,false,false\n"
    "2,-1,1,control,right,200,invalid,ok,false,true\n"
)


def trials_of(folder: Path, *rows: str) -> pd.DataFrame:
    return loaded(folder, HEADER + "".join(rows)).trials


def analysed(folder: Path, *rows: str) -> tuple[str, dict[str, Any]]:
    """Return what the command says, and its summary."""
    table, names = put(folder / "t.csv", HEADER + "".join(rows)), put(folder / "map.toml", "")
    out = folder / "out"
    result = run("analyze", table, "--columns", names, "--no-figures", "--out", out)
    assert result.exit_code == 0
    return " ".join(result.stdout.split()), json.loads((out / "summary.json").read_text())


def test_answers_are_counted_by_person_part_and_side(tmp_path: Path) -> None:
    table = control_table(trials_of(tmp_path, MAIN, CONTROL))
    counts = ["left", "right", "both", "none", "timeouts", "invalid", "presented"]
    assert list(table.columns) == ["participant", "part", "side", *counts]
    assert table.to_numpy().tolist() == [
        ["1", "audibility", "left", 0, 0, 0, 1, 0, 0, 1],
        ["1", "audibility", "right", 0, 1, 0, 0, 0, 0, 1],
        ["1", "control", "left", 0, 0, 1, 0, 1, 0, 2],
        ["1", "control", "right", 0, 0, 0, 1, 0, 0, 1],
        ["2", "audibility", "right", 0, 0, 0, 0, 0, 1, 1],
        ["all", "audibility", "left", 0, 0, 0, 1, 0, 0, 1],
        ["all", "audibility", "right", 0, 1, 0, 0, 0, 1, 2],
        ["all", "control", "left", 0, 0, 1, 0, 1, 0, 2],
        ["all", "control", "right", 0, 0, 0, 1, 0, 0, 1],
    ]


def test_no_other_table_knows_them(tmp_path: Path) -> None:
    without, with_them = trials_of(tmp_path, MAIN), trials_of(tmp_path, MAIN, CONTROL)
    pd.testing.assert_frame_equal(level_table(with_them), level_table(without))
    pd.testing.assert_frame_equal(both_table(with_them), both_table(without))
    assert level_table(with_them)["level_vpp"].tolist() == [60.0]


@pytest.mark.slow
def test_none_in_a_control_trial_does_not_say_that_it_was_offered_elsewhere(tmp_path: Path) -> None:
    said, summary = analysed(tmp_path, MAIN, CONTROL)
    assert 'The answer "none" was not offered' in said
    assert summary["levels"][0]["detected_any"] is None


def test_conditions_are_never_pooled(tmp_path: Path) -> None:
    trials = trials_of(tmp_path, MAIN, CONTROL)
    trials["condition"] = trials["trial"].mod(2).map({0: "a", 1: "b"})
    table = control_table(trials)
    assert table.columns[0] == "condition"
    totals = table[table["participant"].eq("all")]
    assert totals.groupby("condition")["presented"].sum().to_dict() == {"a": 3, "b": 3}


@pytest.mark.slow
def test_the_command_writes_and_tells_them_apart(tmp_path: Path) -> None:
    said, summary = analysed(tmp_path, MAIN, CONTROL)
    for words in (
        "audibility check: 1/3 answered with the driven side, 1/3 left, right or both.",
        "the plate, control: 0/3 answered with the driven side, 1/3 left, right or both",
        "Counted: single 2, both 1, blank 0; left out 9.",
    ):
        assert words in said
    text = (tmp_path / "out" / "control.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == len(summary["control"]) == 9
    assert rows[0] == {name: str(value) for name, value in summary["control"][0].items()}
    documented = (EXAMPLES.parent / "statistics.md").read_text("utf-8")
    defined = {name for key in summary["definitions"] for name in key.split(", ")}
    for column in rows[0]:
        assert f"`{column}`" in documented, column
        assert column in defined | {"participant"}, column


@pytest.mark.slow
def test_without_control_trials_there_is_no_file_and_no_line(tmp_path: Path) -> None:
    said, summary = analysed(tmp_path, MAIN)
    assert "Fingers off" not in said
    assert not (tmp_path / "out" / "control.csv").exists()
    assert summary["control"] == []


@pytest.mark.slow
def test_control_trials_alone_can_be_read(tmp_path: Path) -> None:
    assert "Fingers off the plate, audibility check: 1/3" in analysed(tmp_path, CONTROL)[0]


def test_a_block_before_the_audibility_check_is_refused(tmp_path: Path) -> None:
    path = put(tmp_path / "t.csv", HEADER + MAIN.replace("1,1,90", "1,-2,90"))
    assert "a whole number of at least -1" in str(refused(path, columns=ColumnMap()))


@pytest.fixture
def dry(tmp_path: Path, simulate: Simulate) -> Path:
    control = "audibility_trials = 4\ncontrol_trials = 2\n"
    return simulate(tmp_path / "dry", control, participants=2, seed=3)


@pytest.mark.slow
def test_a_simulated_studys_control_trials_are_complete(dry: Path) -> None:
    analysis = analyse(read_inputs([dry]))
    assert analysis.warnings == ()
    totals = analysis.control[analysis.control["participant"].eq("all")]
    assert totals[["part", "side", "presented"]].to_numpy().tolist() == [
        ["audibility", "left", 4],
        ["audibility", "right", 4],
        ["control", "left", 2],
        ["control", "right", 2],
    ]
    assert (analysis.counts.single, analysis.counts.both, analysis.counts.left_out) == (8, 2, 12)


def test_none_is_legal_by_the_plan_in_a_control_trial_only(dry: Path) -> None:
    table = dry / "sub-01" / "ses-01" / "trials.csv"
    table.with_name("journal.jsonl").unlink()  # by which the change would be found
    trials = pd.read_csv(table, dtype=str, keep_default_na=False)
    trials.loc[trials["kind"].eq("control"), ["response", "correct"]] = ["none", "false"]
    trials.to_csv(table, index=False)
    assert read_trials([table])["response"].eq("none").sum() == 6
    trials.loc[trials["kind"].eq("single").idxmax(), ["response", "correct"]] = ["none", "false"]
    trials.to_csv(table, index=False)
    assert "one of left, right, both, timeout, invalid by" in str(refused(table))
