"""Tables of counts: they give what the trials that they stand for give."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, analyse, read_trials, write_analysis
from tests.test_analysis.shared import cases, draft, loaded, put, refused

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import Analysis
    from tests.conftest import Run

TABLE = {"detected": "k", "presented": "n", "group": ["participant", "vibration"]}
MAP = ColumnMap(
    columns={"level_vpp": "level"}, table=TABLE, axis={"x_scale": "linear"}, task="yes/no"
)
HEADER = "participant,vibration,level,k,n\n"


def cells_of(folder: Path, text: str, columns: ColumnMap = MAP) -> pd.DataFrame:
    cells = loaded(folder, text, columns).cells
    assert cells is not None
    return cells


def analysed(folder: Path, rows: str, columns: ColumnMap = MAP) -> Analysis:
    path = put(folder / "t.csv", HEADER + rows)
    return write_analysis([path], folder / "out", columns=columns, figures=False)


def test_groups_of_their_columns_are_the_conditions(tmp_path: Path) -> None:
    cells = cells_of(tmp_path, HEADER + "AK,0,1.0,3,40\nAK,32,-1.0,4,40\n")
    assert cells[["condition", "level_vpp", "participant", "detected"]].to_numpy().tolist() == [
        ["vibration=0", 1.0, "AK", 3],
        ["vibration=32", -1.0, "AK", 4],
    ]


def test_cells_are_summed_over_sessions_and_sides(tmp_path: Path) -> None:
    text = "participant,session,side,level_vpp,k,n\n1,1,left,60,1,2\n1,1,right,60,0,3\n"
    columns = ColumnMap(table={"detected": "k", "presented": "n"}, task="yes/no")
    cells = cells_of(tmp_path, text + "1,2,left,60,4,4\n", columns)
    assert cells[["detected", "presented"]].to_numpy().tolist() == [[5, 9]]


def test_blocks_of_a_table_are_summed_and_misses_are_presented(tmp_path: Path) -> None:
    blocks = "participant,level,k,missed\nA,60,2,8\nA,60,3,7\nA,90,9,1\nA,90,9,1\n"
    columns = ColumnMap(
        columns={"level_vpp": "level"},
        table={"detected": "k", "missed": "missed"},
        task="yes/no",
    )
    cells = cells_of(tmp_path, blocks, columns)
    assert cells[["detected", "presented"]].to_numpy().tolist() == [[5, 20], [18, 20]]


def test_rows_that_a_column_left_aside_distinguishes_are_not_summed(tmp_path: Path) -> None:
    text = "participant,level,hz,k,n\n" + "".join(
        f"A,{level},{hz},{k},10\n" for hz in (0, 32) for level, k in ((60, 2), (90, 8))
    )
    table = put(tmp_path / "t.csv", text)
    sections: dict[str, Any] = {"columns": {"level_vpp": "level"}, "task": "yes/no"}
    counted = {"detected": "k", "presented": "n"}
    error = refused(table, columns=ColumnMap(**sections, table=counted))
    assert error.line == 4
    assert 'group = ["hz"]' in str(error)
    assert "condition" in draft(table).fill_in
    grouped = ColumnMap(**sections, table=counted | {"group": ["hz"]})
    assert len(cells_of(tmp_path, text, grouped)) == 4
    sections["columns"] |= {"session": "hz"}
    blocks = ColumnMap(**sections, table=counted)
    assert cells_of(tmp_path, text, blocks)["detected"].tolist() == [4, 16]


def test_a_thousand_million_trials_take_no_more_room_than_one(tmp_path: Path) -> None:
    analysis = analysed(tmp_path, "A,0,60,900000000,1000000000\nA,0,70,0,0\nB,0,60,7,10\n")
    counts = analysis.levels[["detected", "presented"]].to_numpy().tolist()
    assert counts == [[900000007, 1000000010]]
    assert (len(analysis.participants), analysis.counts.trials) == (2, 1000000010)


@pytest.mark.slow
def test_what_counts_do_not_tell_is_not_given(tmp_path: Path) -> None:
    assert analysed(tmp_path, "A,0,60,9,10\n").warnings == ()
    [level] = json.loads((tmp_path / "out" / "summary.json").read_text())["levels"]
    unknown = ("over_report", "mislocalised", "timeouts", "p_answered")
    assert [level[name] for name in unknown] == [None] * 4
    assert level["detected_any"] == 9
    forced = MAP.model_copy(update={"task": "forced choice"})
    assert analysed(tmp_path, "A,0,60,9,10\n", forced).detected_any is None


def test_counts_are_no_trials() -> None:
    with pytest.raises(ValueError, match=r"\[table"):
        read_trials(["t.csv"], MAP)


NO_VIBRATION, NO_LEVEL = "participant,level,k,n\n", "participant,vibration,k,n\n"


@pytest.mark.parametrize(("text", "columns", "line", "parts"), cases("counts that are refused"))
def test_counts_that_cannot_be_are_refused(
    tmp_path: Path, text: str, columns: Any, line: int | None, parts: str
) -> None:
    error = refused(put(tmp_path / "t.csv", text), columns=ColumnMap(**columns))
    assert error.line == line
    assert all(part in str(error) for part in parts.split("|"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [False, True], ids=["by level 0", "by kind"])
def test_blanks_of_a_table_of_counts_are_the_false_alarms_of_its_trials(
    tmp_path: Path, *, kind: bool
) -> None:
    counted = "who,level,what,k,n\nA,0,blank,3,40\nA,60,single,2,10\nA,90,single,9,10\n"
    trials = "who,level,side,felt\n" + "".join(
        f"A,{level},{side},1\n" * k + f"A,{level},{side},0\n" * (n - k)
        for level, side, k, n in ((0, "none", 3, 40), (60, "left", 2, 10), (90, "left", 9, 10))
    )
    named = {"participant": "who", "level_vpp": "level"}
    of_counts = ColumnMap(
        columns=named | ({"kind": "what"} if kind else {}),
        table={"detected": "k", "presented": "n"},
        task="yes/no",
    )
    of_trials = ColumnMap(columns={**named, "detected": "felt"}, task="yes/no")
    by_counts, by_trials = (
        analyse(loaded(tmp_path, text, columns))
        for text, columns in ((counted, of_counts), (trials, of_trials))
    )
    pd.testing.assert_frame_equal(by_counts.thresholds, by_trials.thresholds)
    assert by_counts.thresholds["guess_basis"].tolist() == ["blanks"]
    shared = ["participant", "presented", "p", "low", "high"]
    pd.testing.assert_frame_equal(by_counts.blank[shared], by_trials.blank[shared])
    assert (by_counts.counts.blank, by_counts.counts.trials) == (40, 60)


def test_a_cell_told_in_two_files_is_refused(tmp_path: Path) -> None:
    paths = [put(tmp_path / f"{k}.csv", HEADER + f"A,0,60,{k},10\n") for k in (1, 2)]
    error = refused(*paths, columns=MAP)
    assert (error.file, error.line) == (str(paths[1]), 2)
    assert f"{paths[0]}:2" in str(error)


def test_a_table_of_counts_is_never_overwritten(tmp_path: Path) -> None:
    path = put(tmp_path / "levels.csv", HEADER + "A,0,60,1,10\n")
    with pytest.raises(ValueError, match="out_dir"):
        write_analysis([path], tmp_path, columns=MAP, figures=False)
    assert [one.name for one in tmp_path.iterdir()] == ["levels.csv"]


@pytest.mark.slow
def test_a_forced_choice_is_never_taken_for_yes_and_no(tmp_path: Path, run: Run) -> None:
    rows = zip((60, 80, 110, 150, 200), (15, 18, 24, 29, 30), strict=True)
    path = put(
        tmp_path / "counts.csv",
        "participant,level_vpp,k,n\n" + "".join(f"A,{v},{k},30\n" for v, k in rows),
    )
    head = 'task = "forced choice"\n'
    section = '[table]\ndetected = "k"\npresented = "n"\n'
    columns = put(tmp_path / "MAP.toml", section)
    out = tmp_path / "out"
    analyze = ("analyze", path, "--columns", columns, "--no-figures", "--out", out)
    result = run(*analyze)
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert 'task = "yes/no"' in result.stderr
    assert not out.exists()
    for more, threshold in (("", 101.2), ("alternatives = 4\n", 77.3), (None, 68.9)):
        columns.write_text((head + more if more is not None else 'task = "yes/no"\n') + section)
        assert run(*analyze).exit_code == 0
        [row] = json.loads((out / "summary.json").read_text())["thresholds"]
        assert row["threshold_vpp"] == pytest.approx(threshold, abs=0.5)


@pytest.mark.parametrize(("task", "answer"), [("yes/no", "none"), ("forced choice", "left")])
def test_the_task_says_what_a_0_means(tmp_path: Path, task: str, answer: str) -> None:
    text = "participant,side,level_vpp,detected\nA,left,60,1\nA,right,60,0\n"
    trials = loaded(tmp_path, text, ColumnMap(task=task)).trials
    assert trials["response"].tolist() == ["left", answer]
    assert trials["none_offered"].tolist() == [task == "yes/no"] * 2


@pytest.mark.parametrize("task", ["yes/no", "forced choice"])
@pytest.mark.parametrize("shift_db", [-40.0, -10.0])
def test_the_zero_of_a_scale_in_db_does_not_matter(
    task: Any, shift_db: float, tmp_path: Path
) -> None:
    """Levels at and below 0 dB are levels like all others."""
    detected = {0.0: 11, 5.0: 12, 10.0: 16, 15.0: 19, 20.0: 20}
    rows = [(level_db, hit < hits) for level_db, hits in detected.items() for hit in range(20)]

    def threshold_of(shift_db: float) -> pd.Series[float]:
        lines = [f"1,{level_db + shift_db},{int(hit)}" for level_db, hit in rows]
        path = put(tmp_path / f"{shift_db}.csv", "\n".join(["participant,level,ok", *lines]))
        columns = ColumnMap(
            columns={"level_vpp": "level", "detected": "ok"},
            constant={"side": "left"},
            axis={"x_scale": "dB", "unit": "dB"},
            task=task,
        )
        analysis = write_analysis(
            [path], tmp_path / f"out{shift_db}", columns=columns, figures=False
        )
        proportion = "Proportion correct" if task == "forced choice" else "Proportion detected"
        assert analysis.words["axis"] == proportion
        row = analysis.thresholds.iloc[0]
        return row[["threshold_vpp", "threshold_low_vpp", "threshold_high_vpp"]].astype(float)

    shifted = threshold_of(shift_db) - shift_db
    assert shifted.tolist() == pytest.approx(
        threshold_of(0.5).sub(0.5).tolist(), abs=1e-6, nan_ok=True
    )
