"""External tables through the commands: data sets, file names, blanks, published examples."""

from __future__ import annotations

import csv
from collections import Counter
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ColumnMap, analyse, level_table, load_column_map, read_inputs
from tests.test_analysis.shared import EXAMPLES, LEAST, cases, draft, loaded, put, refused

if TYPE_CHECKING:
    from pathlib import Path

    from analysis import LoadedTrials

BEH = "stim_side\tvolts\tanswer\trt\nleft\t60\tleft\t0.6\nright\t95\tn/a\tn/a\n"
OF_BEH: dict[str, Any] = {
    "columns": {"side": "stim_side", "level_vpp": "volts", "response": "answer", "rt_s": "rt"},
    "values": {"response": {"n/a": "timeout"}},
}


def rows_of(read: LoadedTrials, *columns: str) -> list[list[Any]]:
    rows: list[list[Any]] = read.trials[list(columns)].to_numpy().tolist()
    return rows


def data_set(folder: Path, people: int = 21) -> Path:
    """Write the tables of a BIDS data set, one for each participant and task."""
    for number in range(1, people + 1):
        name = f"sub-{number:02}/beh/sub-{number:02}_task-felt_run-1_beh.tsv"
        put(folder / name, BEH.replace("0.6", f"0.6{number}"))
        put(folder / name.replace("_beh.tsv", "_beh.json"), "{}")
        put(folder / name.replace("task-felt", "task-rest"), "onset\tduration\n0\t1\n")
    put(folder / "participants.tsv", "participant_id\nsub-01\n")
    return folder


def test_a_bids_data_set_of_21_people_is_read_with_one_map(tmp_path: Path) -> None:
    columns = ColumnMap(**OF_BEH, rows={"keep": {"task-": "felt"}})
    read = read_inputs([data_set(tmp_path / "bids")], columns)
    assert len(read.trials) == 42
    assert rows_of(read, "participant", "session", "block", "response")[:2] == [
        ["01", "01", 1, "left"],
        ["01", "01", 1, "timeout"],
    ]
    assert read.inputs[0].name == "sub-01/beh/sub-01_task-felt_run-1_beh.tsv"
    columns = ColumnMap(**OF_BEH, rows={"keep": {"task-": "fell"}})
    error = str(refused(tmp_path / "bids", columns=columns))
    assert all(part in error for part in ("[rows.keep] task-", "'fell'", "'felt', 'rest'"))
    assert "--columns MAP.toml" in str(refused(tmp_path / "bids"))


def test_sessions_and_runs_are_in_the_names_of_files(tmp_path: Path) -> None:
    for number in "12":
        name = f"sub-a/ses-x/func/sub-a_ses-x_task-t_run-0{number}_events.tsv"
        put(tmp_path / name, BEH.replace("0.6", f"0.{number}"))
    read = read_inputs([tmp_path], ColumnMap(**OF_BEH))
    numbers = [["x", 1, 1], ["x", 1, 2], ["x", 2, 3], ["x", 2, 4]]
    assert rows_of(read, "session", "block", "trial") == numbers
    runs = ColumnMap(columns={**OF_BEH["columns"], "session": "run-"}, values=OF_BEH["values"])
    assert {*read_inputs([tmp_path / "sub-a"], runs).trials["session"]} == {"01", "02"}


def test_a_folder_of_tables_is_read_with_a_map_and_refused_without(tmp_path: Path) -> None:
    for who in "ab":
        put(tmp_path / f"{who}.csv", f"side,level_vpp,response\nleft,6{ord(who)},left\n")
    put(tmp_path / "README.txt", "no table")
    read = read_inputs([tmp_path], ColumnMap(columns={"participant": "file-"}))
    assert read.trials["participant"].tolist() == ["a", "b"]
    semicolons = put(tmp_path / "t.csv", LEAST.replace(",", ";") + "1;left;60;left\n")
    packed = tmp_path / "t.xlsx"
    packed.write_bytes(b"PK\x03\x04 and so on\n")
    for path, part in ((tmp_path, "columns"), (semicolons, "columns"), (packed, ".xlsx")):
        assert part in str(refused(path))


LEVELS = ("-30", "-24", "-18", "-12", "-6")
AMPLITUDES = ("1", "2", "4", "8", "16")


def felt(level: str, n: int) -> bool:
    """Answer higher levels more often, of ten trials each; one blank in ten is a false alarm."""
    return n < 2 * LEVELS.index(level) + 1 if level in LEVELS else n == 0


def one_place(silent: str, levels: tuple[str, ...] = LEVELS, name: str = "amp_db") -> str:
    shown = {**dict(zip(LEVELS, levels, strict=True)), "": silent}
    rows = [
        f"{who},{shown[at]},{('no', 'yes')[felt(at, n)]},0.{400 + n}"
        for who in "123456"
        for at in shown
        for n in range(10)
    ]
    return "\n".join([f"subject,{name},ans,rt", *rows]) + "\n"


def two_places(silent: str) -> str:
    """Let every row name a place, as where it is drawn before the level is."""
    rows = [
        f"{who},{'LR'[n % 2]},{at},{'LR'[n % 2] if felt(at, n // 2) else 'none'},0.{400 + n}"
        for who in "123"
        for at in (*LEVELS, silent)
        for n in range(20)
    ]
    return "\n".join(["subject,side,amp_db,ans,rt", *rows]) + "\n"


def false_alarms(table: Path, columns: ColumnMap) -> tuple[int, int]:
    """Return the false alarms and the blanks of a table."""
    trials = read_inputs([table], columns).trials
    blank = trials[trials["kind"].eq("blank")]
    return int((~blank["response"].isin(["none", "timeout"])).sum()), len(blank)


@pytest.mark.parametrize("silent", ["-inf", "-Inf", "", "NA", "-999"])
@pytest.mark.parametrize("places", [1, 2])
def test_blanks_in_db_are_proposed_by_their_level(tmp_path: Path, silent: str, places: int) -> None:
    """A number that may be a code is asked for and not guessed."""
    table = put(tmp_path / "t.csv", (one_place if places == 1 else two_places)(silent))
    made = draft(table)
    asked = ["-999"] if silent == "-999" else []
    assert made.fill_in == (["task", *asked, "side"] if places == 1 else asked)
    filled_in = {"task": "yes/no", "side": "left", "-999": "-inf"}
    assert false_alarms(table, made.filled(tmp_path / "map.toml", filled_in)) == (6, 60)


@pytest.mark.parametrize("silent", ["0", "", "-inf"])
def test_blanks_of_amplitudes_are_drafted_as_well(tmp_path: Path, silent: str) -> None:
    table = put(tmp_path / "t.csv", one_place(silent, AMPLITUDES, "amp_um"))
    columns = draft(table).filled(tmp_path / "map.toml", {"task": "yes/no", "side": "left"})
    assert false_alarms(table, columns) == (6, 60)


def test_levels_of_an_amplitude_are_not_taken_for_signed_by_a_code(tmp_path: Path) -> None:
    made = draft(put(tmp_path / "t.csv", one_place("-999", AMPLITUDES, "amp_um")))
    assert made.map["axis"] == {"unit": "µm"}
    assert made.fill_in == ["task", "-999", "side"]


def example(folder: Path, name: str, text: str) -> LoadedTrials:
    """Read a few rows of a published table with its map of docs/examples."""
    return loaded(folder, text, load_column_map(EXAMPLES / f"{name}-columns.toml"))


def test_an_unanswered_trial_of_grund_2022_is_no_no(tmp_path: Path) -> None:
    head = "ID,block,trial,stim_type,stim_step,intensity,resp1,resp1_t,resp1_btn\n"
    rows = ("1,1,1,1,1.0,2.6,0,0.6899,2", "1,1,2,1,1.0,2.6,1,0.37,1", "1,2,1,1,1.0,2.6,0,1.5,0",
            "1,2,2,0,0.0,2.6,1,0.5,1", "1,2,3,0,0.0,2.6,0,1.5,-1")  # fmt: skip # rows of a table
    read = example(tmp_path, "grund2022", head + "\n".join(rows) + "\n")
    trials = read.trials
    assert trials["response"].tolist() == ["none", "left", "timeout", "left", "timeout"]
    assert trials["rt_s"].isna().tolist() == [False, False, True, False, True]
    level = level_table(trials).iloc[0]
    assert level[["level_vpp", "detected", "presented", "timeouts"]].tolist() == [1, 1, 3, 1]
    assert level["p_answered"] == 1 / 2
    assert analyse(read).blank[["left", "presented"]].iloc[-1].tolist() == [1, 2]


@pytest.mark.parametrize(("name", "text", "cells"), cases("published counts"))
def test_published_counts_give_their_cells(
    tmp_path: Path, name: str, text: str, cells: list[list[object]]
) -> None:
    cells_read = example(tmp_path, name, text).cells
    assert cells_read is not None
    columns = ["condition", "level_vpp", "participant", "detected", "presented"]
    assert cells_read[columns].to_numpy().tolist() == cells


def test_the_synthetic_example_is_counted_as_a_plain_reading_of_its_rows_counts_it() -> None:
    table = EXAMPLES / "synthetic-trials.csv"
    with table.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    single = [row for row in rows if row["kind"] == "single"]
    correct = Counter(float(r["level_vpp"]) for r in single if r["response"] == r["side"])
    sides = {"left", "right", "both"}
    noticed_any = Counter(float(r["level_vpp"]) for r in single if r["response"] in sides)
    late = Counter(float(r["level_vpp"]) for r in single if r["response"] == "timeout")
    levels_vpp = (60, 95, 130, 165, 200)
    analysis = analyse(read_inputs([table], load_column_map(EXAMPLES / "synthetic-columns.toml")))
    levels = analysis.levels.set_index("level_vpp")
    assert levels["presented"].to_dict() == dict.fromkeys(map(float, levels_vpp), 60)
    assert levels["detected"].to_dict() == {level: correct[level] for level in levels_vpp}
    assert levels["timeouts"].to_dict() == {level: late[level] for level in levels_vpp}
    assert analysis.detected_any is not None
    detected_any = analysis.detected_any.set_index("level_vpp")["detected_any"]
    assert detected_any.to_dict() == {level: noticed_any[level] for level in levels_vpp}
    noticed = sum(r["kind"] == r["response"] == "both" for r in rows)
    assert analysis.both.iloc[-1][["noticed", "presented"]].tolist() == [noticed, 20]
    false = sum(r["kind"] == "null" and r["response"] not in {"none", "timeout"} for r in rows)
    total = analysis.blank.iloc[-1]
    assert [total[["left", "right", "both"]].sum(), total["presented"]] == [false, 50]
