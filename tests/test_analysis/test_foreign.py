"""Tables made elsewhere: how they are written, which rows count, what names of files tell."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, read_trials
from analysis.reading.load import read_inputs
from analysis.results.tables import analyse
from tests.test_analysis.shared import LEAST, loaded, put, refused, run

if TYPE_CHECKING:
    from analysis.reading.load import LoadedTrials
    from tests.conftest import Simulate

LEFT = {"side": "left"}


PAGE = Path(__file__).parents[2] / "docs" / "howto" / "foreign-table.md"
KEYS = (
    "participant,level_vpp,stimSide,key_resp.keys\n1,60,left,left\n1,60,right,right\n"
    "1,95,right,left\n1,95,left,space\n"
)
"""Keys left and right, either of them a yes; the space bar is a no."""


def recipe_of(what: str) -> str:
    """Return as the text of a map what the page says may stand there for a table like that."""
    row = next(line for line in PAGE.read_text("utf-8").splitlines() if f"| {what}" in line)
    parts = re.findall(r"`([^`]+)`", row.split(" | ", 1)[1])
    return "\n".join(part for part in parts if part.startswith("[") or " = " in part) + "\n"


def told(read: LoadedTrials, *columns: str) -> list[list[Any]]:
    rows: list[list[Any]] = read.trials[list(columns)].to_numpy().tolist()
    return rows


def test_decimal_commas_are_read_where_the_map_says_so(tmp_path: Path) -> None:
    text = "participant;side;level_vpp;response;rt_s\n1;left;60,5;left;0,612\n1;left;95;none;\n"
    error = refused(put(tmp_path / "t.csv", text), columns=ColumnMap())
    assert '[file] decimal = ","' in str(error)
    read = loaded(tmp_path, text, ColumnMap(file={"decimal": ","}))
    assert read.trials[["level_vpp", "rt_s"]].to_numpy().tolist()[0] == [60.5, 0.612]
    points = put(tmp_path / "p.csv", text.replace("60,5", "60.5"))
    assert "holds '60.5'" in str(refused(points, columns=ColumnMap(file={"decimal": ","})))


def test_only_rows_that_the_map_keeps_are_read_and_the_others_are_counted(tmp_path: Path) -> None:
    text = (
        "participant,side,level_vpp,response,phase,n\n,,,,welcome,\n1,left,60,left,practice,0\n"
        "1,left,60,left,main,0\n1,left,95,none,main,1\n1,left,95,left,main,\n,,,,,\n\n"
    )
    columns = ColumnMap(rows={"keep": {"phase": "main"}, "skip": {"n": [""]}})
    read = loaded(tmp_path, text, columns)
    assert told(read, "line", "level_vpp") == [[4, 60.0], [5, 95.0]]
    assert read.left_out == 3


def test_filters_of_columns_that_a_table_lacks_or_that_leave_nothing_are_refused(
    tmp_path: Path,
) -> None:
    path = put(tmp_path / "t.csv", LEAST + "1,left,60,left\n1,right,60,none\n")
    lacks = refused(path, columns=ColumnMap(rows={"skip": {"phase": "a"}}))
    assert "no column 'phase', named by [rows]; it has participant, side" in str(lacks)
    rows = {"keep": {"side": "right"}, "skip": {"response": "none"}}
    nothing = refused(path, columns=ColumnMap(rows=rows))
    assert "all 2 rows are left out by [rows.keep] side and [rows.skip] response" in str(nothing)


@pytest.mark.parametrize("counts", [False, True])
def test_a_word_of_a_filter_that_stands_in_no_row_is_refused_with_those_that_do(
    tmp_path: Path, *, counts: bool
) -> None:
    text = "participant,side,level_vpp,response,phase,k,n\n1,left,60,left,practice,9,9\n"
    paths = [put(tmp_path / "a.csv", text), put(tmp_path / "b.csv", text.replace("practice", "go"))]
    table = {"detected": "k", "presented": "n"} if counts else {}
    for section, word in (("skip", "practise"), ("keep", "practise"), ("skip", ["go", "practise"])):
        columns = ColumnMap(rows={section: {"phase": word}}, table=table, task="yes/no")
        said = f"[rows.{section}] phase: 'practise' stands in no row, allowed 'go', 'practice'"
        assert said in str(refused(*paths, columns=columns))
    kept = ColumnMap(rows={"skip": {"phase": ["go", ""]}}, table=table, task="yes/no")
    assert read_inputs(paths, kept).left_out == 1
    nothing = ColumnMap(rows={"skip": {"phase": ["go", "practice"]}}, table=table, task="yes/no")
    assert "[rows.skip] phase" in str(refused(*paths, columns=nothing))


def test_a_word_that_no_name_of_a_file_tells_is_refused_with_those_that_do(tmp_path: Path) -> None:
    put(tmp_path / "sub-1/beh/sub-1_task-felt_beh.tsv", LEAST.replace(",", "\t"))
    columns = ColumnMap(rows={"keep": {"task-": "fell"}})
    said = "[rows.keep] task-: 'fell' is told by no file's name, allowed 'felt'"
    assert said in str(refused(tmp_path, columns=columns))


def test_a_percentage_of_full_scale_is_a_level_by_its_factor(tmp_path: Path) -> None:
    text = LEAST + "1,left,40,left\n1,left,62.5,none\n"
    read = loaded(tmp_path, text, ColumnMap(scale={"level_vpp": 2.5}))
    assert told(read, "level_vpp") == [[100.0], [156.25]]


def test_trials_that_count_from_0_count_from_1_and_keep_their_order(tmp_path: Path) -> None:
    rows = "".join(f"{who},left,60,left,{n}\n" for who, n in (("1", 0), ("1", 1), ("2", 1)))
    read = loaded(tmp_path, LEAST.replace("\n", ",trial\n") + rows)
    assert told(read, "participant", "trial") == [["1", 1], ["1", 2], ["2", 1]]


def test_level_0_is_a_trial_without_a_stimulus_unless_the_side_was_guessed(tmp_path: Path) -> None:
    table = put(tmp_path / "t.csv", LEAST + "1,left,60,left\n1,left,0,none\n1,left,0,left\n")
    assert told(read_inputs([table], ColumnMap()), "kind", "side", "correct") == [
        ["single", "left", True], ["blank", "none", True], ["blank", "none", False],
    ]  # fmt: skip
    error = str(refused(table, columns=ColumnMap(task="forced choice")))
    assert "t.csv:3: the level is 0, and a forced choice has no trials without" in error
    linear = ColumnMap(task="forced choice", axis={"x_scale": "linear"})
    assert told(read_inputs([table], linear), "kind") == [["single"]] * 3


def test_a_word_for_no_answer_is_a_timeout_and_ms_that_are_none_are_told(tmp_path: Path) -> None:
    text = "participant,side,level_vpp,detected,rt_s\n1,left,60,None,\n1,left,60,1,0.5\n"
    table = put(tmp_path / "t.csv", text)
    error = refused(table, columns=ColumnMap(task="yes/no"))
    assert '[values.detected] "None" = "timeout"' in str(error)
    none = {"detected": {"None": "timeout"}}
    seconds = refused(table, columns=ColumnMap(task="yes/no", values=none, units={"rt_s": "ms"}))
    assert "allowed 0.01 to 10 s; the map has ms; without it these are seconds" in str(seconds)


def test_milliseconds_of_some_participants_are_found_and_told(tmp_path: Path) -> None:
    times = {"1": 0.6, "2": 612.0, "3": 0.8}
    text = LEAST.replace("\n", ",rt_s\n") + "".join(
        f"{who},left,60,left,{rt}\n" for who, rt in times.items()
    )
    read = loaded(tmp_path, text)
    assert read.trials["rt_s"].tolist() == pytest.approx([0.6, 0.612, 0.8])
    assert read.changed == (
        "participant 2: reaction times are taken for milliseconds (median 612 s)",
    )
    stated = loaded(tmp_path, text.replace("0.6\n", "600\n").replace("0.8\n", "800\n"),
                    ColumnMap(units={"rt_s": "ms"}))  # fmt: skip
    assert (stated.trials["rt_s"].max(), stated.changed) == (0.8, ())
    seconds = loaded(tmp_path, text.replace("0.8\n", "800\n"), ColumnMap(units={"rt_s": "ms"}))
    assert seconds.trials["rt_s"].tolist() == pytest.approx([0.6, 0.612, 0.8])
    assert "participant 1: reaction times are taken for seconds" in seconds.changed[0]


@pytest.mark.parametrize(
    "times", [{"1": 612.0}, {"1": 612.0, "2": 700.0}, {"1": 0.6, "2": 20.0}, {"1": 0.6, "2": 2e5}]
)
def test_times_that_are_not_told_by_the_others_are_refused(
    tmp_path: Path, times: dict[str, float]
) -> None:
    text = LEAST.replace("\n", ",rt_s\n") + "".join(
        f"{who},left,60,left,{rt}\n" for who, rt in times.items()
    )
    error = refused(put(tmp_path / "t.csv", text), columns=ColumnMap())
    assert '[units] rt_s = "ms"' in str(error)


def test_zeros_and_ones_under_the_name_correct_are_trials_with_a_task(tmp_path: Path) -> None:
    text = "participant,side,level_vpp,correct\n1,left,60,1\n1,right,60,0\n"
    columns = ColumnMap(columns={"detected": "correct"}, task="forced choice")
    assert told(loaded(tmp_path, text, columns), "response", "correct") == [
        ["left", True],
        ["left", False],
    ]


def test_true_and_false_are_whether_something_was_detected_and_other_words_need_a_map(
    tmp_path: Path,
) -> None:
    text = "participant,side,level_vpp,correct\n1,left,60,true\n1,right,60,FALSE\n"
    columns = ColumnMap(columns={"detected": "correct"}, task="yes/no")
    assert told(loaded(tmp_path, text, columns), "response") == [["left"], ["none"]]
    own = {"detected": {"true": "0", "FALSE": "timeout"}}
    other = ColumnMap(columns={"detected": "correct"}, values=own, task="yes/no")
    assert told(loaded(tmp_path, text, other), "response") == [["none"], ["timeout"]]
    error = refused(put(tmp_path / "w.csv", text.replace("true", "yes")), columns=columns)
    assert 'a map says what it stands for, as [values.detected] "yes" = "1"' in str(error)


def test_a_name_that_stands_twice_is_refused_only_where_it_is_needed(tmp_path: Path) -> None:
    text = "participant,side,level_vpp,response,note,note\n1,left,60,left,a,b\n"
    assert told(loaded(tmp_path, text), "level_vpp") == [[60.0]]
    named = refused(put(tmp_path / "n.csv", text), columns=ColumnMap(columns={"condition": "note"}))
    assert "no column 'note', named by the map for condition" in str(named)
    assert "note (twice)" in str(named)
    ours = put(tmp_path / "o.csv", text.replace("note", "session"))
    error = refused(ours, columns=ColumnMap())
    assert "names column session twice; [columns] session" in str(error)
    assert read_trials([ours], ColumnMap(columns={"session": ""}))["session"].tolist() == ["01"]


def test_trials_that_are_numbered_anew_are_refused_with_what_helps(tmp_path: Path) -> None:
    text = LEAST.replace("\n", ",trial\n") + "1,left,60,left,1\n" * 2
    error = refused(put(tmp_path / "t.csv", text), columns=ColumnMap())
    assert '[columns] trial = ""' in str(error)
    assert len(loaded(tmp_path, text, ColumnMap(columns={"trial": ""})).trials) == 2


BEH = "stim_side\tvolts\tanswer\trt\nleft\t60\tleft\t0.6\nright\t95\tn/a\tn/a\n"
OF_BEH = ColumnMap(
    columns={"side": "stim_side", "level_vpp": "volts", "response": "answer", "rt_s": "rt"},
    values={"response": {"n/a": "timeout"}},
)


def data_set(folder: Path, people: int = 21) -> Path:
    """Write the tables of a BIDS data set, each person's own."""
    for number in range(1, people + 1):
        name = f"sub-{number:02}/beh/sub-{number:02}_task-felt_run-1_beh.tsv"
        put(folder / name, BEH.replace("0.6", f"0.6{number}"))
        put(folder / name.replace("_beh.tsv", "_beh.json"), "{}")
        other = name.replace("task-felt", "task-rest")
        put(folder / other, "onset\tduration\n0\t1\n")
    put(folder / "participants.tsv", "participant_id\nsub-01\n")
    return folder


def test_a_bids_data_set_of_21_people_is_read_with_one_map(tmp_path: Path) -> None:
    columns = ColumnMap(
        columns=OF_BEH.columns, values=OF_BEH.values, rows={"keep": {"task-": "felt"}}
    )
    read = read_inputs([data_set(tmp_path / "bids")], columns)
    assert len(read.trials) == 42
    assert told(read, "participant", "session", "block", "response")[:2] == [
        ["01", "01", 1, "left"],
        ["01", "01", 1, "timeout"],
    ]
    assert read.inputs[0].name == "sub-01/beh/sub-01_task-felt_run-1_beh.tsv"


def test_sessions_and_runs_are_told_by_names_of_files(tmp_path: Path) -> None:
    for run_ in "12":
        put(
            tmp_path / f"sub-a/ses-x/func/sub-a_ses-x_task-t_run-0{run_}_events.tsv",
            BEH.replace("0.6", f"0.{run_}"),
        )
    by_name = read_inputs([tmp_path], OF_BEH)
    assert told(by_name, "session", "block", "trial") == [
        ["x", 1, 1],
        ["x", 1, 2],
        ["x", 2, 3],
        ["x", 2, 4],
    ]
    runs = ColumnMap(columns={**OF_BEH.columns, "session": "run-"}, values=OF_BEH.values)
    assert {*read_inputs([tmp_path / "sub-a"], runs).trials["session"]} == {"01", "02"}


def test_what_is_no_table_of_ours_is_told_with_the_command_that_helps(tmp_path: Path) -> None:
    put(tmp_path / "t.csv", LEAST.replace(",", ";") + "1;left;60;left\n")
    for path in (tmp_path, tmp_path / "t.csv"):
        assert "which tactstrip columns drafts" in str(refused(path))
    packed = tmp_path / "t.xlsx"
    packed.write_bytes(b"PK\x03\x04 and so on\n")
    assert "a workbook (.xlsx) or packed file; save it as CSV" in str(refused(packed))


def test_a_folder_of_tables_is_read_with_a_map_and_refused_without(tmp_path: Path) -> None:
    for who in "ab":
        put(tmp_path / f"{who}.csv", f"side,level_vpp,response\nleft,6{ord(who)},left\n")
    put(tmp_path / "README.txt", "no table")
    read = read_inputs([tmp_path], ColumnMap(columns={"participant": "file-"}))
    assert read.trials["participant"].tolist() == ["a", "b"]
    assert "no sub-*/ses-*/trials.csv in this folder" in str(refused(tmp_path))


def test_another_labs_data_set_without_a_map_is_refused_with_what_helps(tmp_path: Path) -> None:
    error = refused(data_set(tmp_path))
    assert "--columns MAP.toml, which tactstrip columns drafts" in str(error)


@pytest.mark.slow
def test_our_own_bids_export_gives_the_tables_of_its_sessions(
    tmp_path: Path, simulate: Simulate
) -> None:
    results = simulate(tmp_path / "results", participants=2)
    assert run("export", results, "--bids", tmp_path / "bids").exit_code == 0
    for folder in ("results", "bids"):
        done = run("analyze", tmp_path / folder, "--out", tmp_path / f"{folder}-out",
                   "--no-figures")  # fmt: skip
        assert done.exit_code == 0, done.output
    one, other = (
        json.loads((tmp_path / f"{folder}-out/summary.json").read_text(encoding="utf-8"))
        for folder in ("results", "bids")
    )
    for key in ("counts", "mark", "excluded", "levels", "both", "blank", "control", "thresholds",
                "groups", "choice", "reaction_times"):  # fmt: skip
        assert one[key] == other[key]
    pd.testing.assert_frame_equal(
        read_trials([tmp_path / "bids"]).drop(columns=["file", "none_offered"]),
        read_trials([tmp_path / "results"]).drop(columns=["file", "none_offered"]),
    )


@pytest.mark.slow
def test_results_of_a_data_set_are_not_written_into_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    put(data_set(tmp_path / "bids") / "dataset_description.json", "{}")
    map_ = put(
        tmp_path / "map.toml",
        '[rows.keep]\ntask- = "felt"\n[columns]\nside = "stim_side"\nlevel_vpp = "volts"\n'
        'response = "answer"\n[values.response]\n"n/a" = "timeout"\n',
    )
    monkeypatch.chdir(tmp_path)
    done = run("analyze", "bids", "--columns", map_, "--no-figures")
    assert (done.exit_code, (tmp_path / "analysis" / "levels.csv").exists()) == (0, True)
    assert not (tmp_path / "bids" / "analysis").exists()


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"file": {"delimiter": "::"}}, "[file] delimiter: allowed ',', ';'"),
        ({"file": {"delimiter": ",", "decimal": ","}}, "must be another sign than decimal"),
        ({"file": {"encoding": "zip"}}, "[file] encoding: must name one"),
        ({"file": {"encoding": "latin-99"}}, "[file] encoding: must name one"),
        ({"file": {"quote": "'"}}, "[file] quote: allowed delimiter, decimal, encoding"),
        ({"rows": {"drop": {}}}, "[rows.drop] is not known"),
        ({"rows": {"keep": {"phase": 1}}}, "[rows.keep] phase: must be text in quotation marks"),
        ({"rows": {"keep": ["phase"]}}, "[rows.keep] must be a table"),
        ({"scale": {"level_vpp": 0}}, "[scale] level_vpp: must be a number above 0, got 0"),
        ({"scale": {"level_vpp": True}}, "[scale] level_vpp: must be a number above 0, got True"),
        ({"scale": {"trial": 2.0}}, "[scale] trial: not a column of numbers with a unit"),
        ({"scale": {"rt_s": 2.0}, "units": {"rt_s": "ms"}}, "[scale] rt_s: [units] already"),
        ({"scale": {"rt_s": 2.0}, "constant": {"rt_s": "1"}}, "rt_s: a constant is in our unit"),
    ],
)
def test_what_a_map_cannot_mean_is_refused(section: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        ColumnMap(**section)
    assert words in str(caught.value)


@pytest.mark.slow
def test_one_who_never_says_none_does_not_make_a_data_set_a_forced_choice(tmp_path: Path) -> None:
    for who in ("01", "02", "07"):
        answers = ("left", "left") if who == "07" else ("none", "right")
        rows = "".join(
            f"left\t60\t{answers[0]}\nright\t{level}\t{answers[1]}\nnone\t0\t{answers[0]}\n"
            for level in (80, 95, 110 + int(who))
        )
        put(tmp_path / f"sub-{who}/beh/sub-{who}_task-felt_beh.tsv",
            "side\tlevel_vpp\tresponse\n" + rows)  # fmt: skip
    found = analyse(read_inputs([tmp_path], ColumnMap()))
    assert found.detected_any is not None
    totals = found.blank[found.blank["participant"].eq("all")]
    assert totals["left"].tolist() == [3]
    assert {*found.thresholds["guess_basis"]} == {"few blanks"}
    assert not [one for one in found.warnings if '"none"' in one]


def test_keys_of_two_sides_are_read_as_felt_by_the_recipe_of_the_page(tmp_path: Path) -> None:
    """Blanks whose level is empty are refused with a hint that the recipe beside it follows."""
    (page,) = re.findall(
        r"### Felt at either side.*?```toml\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL
    )
    absent = r'^(\[rows\.skip\]|"trials\.thisN"|condition|rt_s) ?.*\n'
    felt = re.sub(absent, "", page, flags=re.MULTILINE)
    felt = felt.replace("amp_um", "level_vpp").replace("down", "space")
    both = recipe_of("the same, with stimuli at both sides")
    blanks = recipe_of("the same, with blanks whose level is empty")
    columns = ColumnMap(**tomllib.loads(felt))
    read = loaded(tmp_path, KEYS, columns)
    assert told(read, "kind", "response") == [["single", "left"]] * 3 + [["single", "none"]]
    blank = put(tmp_path / "blanks.csv", KEYS + "1,,,left\n1,,,space\n")
    hint = refused(blank, columns=columns)
    assert blanks.strip().replace("\n", " ") in str(hint)
    columns = ColumnMap(**tomllib.loads(felt + blanks))
    read = read_inputs([blank], columns)
    assert told(read, "kind", "response")[-2:] == [["blank", "left"], ["blank", "none"]]
    more = put(tmp_path / "both.csv", KEYS + "1,95,both,left\n")
    columns = ColumnMap(**tomllib.loads(felt + both))
    assert len(read_inputs([more], columns).trials) == 4
