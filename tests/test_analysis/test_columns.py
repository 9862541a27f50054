"""Tables made elsewhere: MAP.toml, defaults, units, refusals."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, load_column_map, read_trials
from analysis.reading.load import read_inputs
from analysis.results.summary import in_own_words
from analysis.results.tables import analyse
from tests.test_analysis.shared import LEAST, loaded, put, refused

if TYPE_CHECKING:
    from pathlib import Path

FELT = "participant,side,level_vpp,detected\n"
YES_NO = {"task": "yes/no"}
LINEAR = {"axis": {"x_scale": "linear"}}
FORCED_DB = {"axis": {"x_scale": "dB", "unit": "dB"}, "task": "forced choice"}


def read(folder: Path, table: str, columns: ColumnMap | None = None) -> pd.DataFrame:
    return loaded(folder, table, columns).trials


def load(folder: Path, text: str) -> ColumnMap:
    return load_column_map(put(folder / "MAP.toml", text))


def test_four_columns_are_enough_and_the_rest_has_its_default(tmp_path: Path) -> None:
    trials = read(tmp_path, LEAST + "007,left,60,left\n007,both,60,left\n007,none,,none\n")
    assert trials["participant"].tolist() == ["007"] * 3
    assert trials["kind"].tolist() == ["single", "both", "blank"]
    assert trials["trial"].tolist() == [1, 2, 3]
    assert trials["correct"].tolist() == [True, False, True]
    constants = {"session": "01", "condition": "main", "attempt": 1, "block": 1, "status": "ok"}
    constants |= {"anticipated": False, "simulated": False, "schema": 2}
    for name, value in constants.items():
        assert trials[name].tolist() == [value] * 3, name
    for name in ("rt_s", "onset_s", "foreperiod_s", "noise_ok", "level_left_vpp", "peak_left_um"):
        assert trials[name].isna().all(), name
    assert trials["study_sha256"].tolist() == ["n/a"] * 3
    assert trials["level_rule"].tolist() == ["n/a"] * 3
    assert trials[["device_kind", "level_planned_vpp", "burst_verified"]].isna().all(axis=None)


def test_trials_are_numbered_within_participant_and_session_across_files(tmp_path: Path) -> None:
    header = "participant,session,side,level_vpp,response\n"
    rows = ("a,1,left,60,left\nb,1,left,60,left\na,1,left,60,left\n",
            "a,1,left,60,left\na,2,left,60,left\n")  # fmt: skip
    paths = [put(tmp_path / f"{n}.csv", header + text) for n, text in enumerate(rows)]
    assert read_trials(paths, ColumnMap())["trial"].tolist() == [1, 1, 2, 3, 1]


def test_columns_words_constants_and_units_are_translated(tmp_path: Path) -> None:
    columns = load(
        tmp_path,
        """
        [columns]
        participant = "Subject"
        level_vpp = "amplitude"
        response = "key"
        rt_s = "time"
        [values.response]
        l = "left"
        "" = "timeout"
        [constant]
        side = "left"
        block = 2
        [units]
        rt_s = "ms"
        level_vpp = "mV-peak"
        """,
    )
    table = "Subject,amplitude,key,time,colour\n01,30000,l,612.5,red\n01,30000,,,blue\n"
    trials = read(tmp_path, table, columns)
    assert trials[["level_vpp", "response", "side", "block"]].to_numpy().tolist() == [
        [60.0, "left", "left", 2],
        [60.0, "timeout", "left", 2],
    ]
    assert trials["rt_s"].dropna().tolist() == [0.6125]
    assert "colour" not in trials


@pytest.mark.parametrize(
    ("column", "unit", "text", "value"),
    [
        ("rt_s", "s", "0.612", 0.612),
        ("rt_s", "ms", "612", 0.612),
        ("rt_s", "us", "612000", 0.612),
        ("level_vpp", "V", "60", 60.0),
        ("level_vpp", "mV", "60000", 60.0),
        ("level_vpp", "V-peak", "30", 60.0),
        ("level_vpp", "mV-peak", "30000", 60.0),
    ],
)
def test_units_come_out_exact(
    tmp_path: Path, column: str, unit: str, text: str, value: float
) -> None:
    cells = {"participant": "1", "side": "left", "level_vpp": "60", "response": "left", "rt_s": "1"}
    cells[column] = text
    table = ",".join(cells) + "\n" + ",".join(cells.values()) + "\n"
    assert read(tmp_path, table, ColumnMap(units={column: unit}))[column].tolist() == [value]


def test_one_column_of_theirs_may_serve_two_of_ours(tmp_path: Path) -> None:
    columns = ColumnMap(
        columns={"kind": "stim", "side": "stim", "detected": "felt"},
        values={"kind": {"0": "blank", "1": "single"}, "side": {"0": "none", "1": "right"}},
        task="yes/no",
    )
    table = (
        "participant,stim,level_vpp,felt\n1,1,2.5,1\n1,1,2.5,0\n1,0,0,0\n1,0,,1\n1,1,2.5,timeout\n"
    )
    trials = read(tmp_path, table, columns)
    assert trials["kind"].tolist() == ["single", "single", "blank", "blank", "single"]
    assert trials["response"].tolist() == ["right", "none", "none", "right", "timeout"]


def test_an_unanswered_trial_of_zeros_and_ones_must_be_explained(tmp_path: Path) -> None:
    table = "participant,side,level_vpp,detected\n1,left,60,1\n1,left,60,\n"
    columns = ColumnMap(values={"detected": {"": "timeout"}}, task="yes/no")
    assert read(tmp_path, table, columns)["response"].tolist() == ["left", "timeout"]


ANSWERS = "participant,side,level_vpp,response,detected\n1,left,60,right,1\n"


@pytest.mark.parametrize(
    ("columns", "response"),
    [
        ({"detected": "detected"}, "left"),
        ({"response": "response"}, "right"),
        ({"response": ""}, "left"),
        ({"detected": ""}, "right"),
    ],
)
def test_of_two_answers_the_map_names_one(tmp_path: Path, columns: Any, response: str) -> None:
    found = read(tmp_path, ANSWERS, ColumnMap(columns=columns, task="yes/no"))
    assert found["response"].tolist() == [response]


def test_a_word_of_theirs_stands_for_a_value_in_our_unit(tmp_path: Path) -> None:
    words = {"level_vpp": {"low": "60", "1000": "95"}}
    table = LEAST + "1,left,low,left\n1,left,130000,left\n1,left,1000,left\n"
    trials = read(tmp_path, table, ColumnMap(values=words, units={"level_vpp": "mV"}))
    assert trials["level_vpp"].tolist() == [60.0, 130.0, 95.0]


def test_a_column_with_an_empty_source_is_not_taken(tmp_path: Path) -> None:
    table = "participant,trial,side,level_vpp,response\n1,a,left,60,left\n1,a,left,60,none\n"
    trials = read(tmp_path, table, load(tmp_path, '[columns]\ntrial = ""\n'))
    assert trials["trial"].tolist() == [1, 2]
    columns = ColumnMap(columns={"trial": "", "side": ""}, constant={"side": "right"})
    assert read(tmp_path, table, columns)["side"].tolist() == ["right", "right"]


def test_a_constant_level_is_that_of_the_stimuli(tmp_path: Path) -> None:
    table = "participant,side,response\n1,left,left\n1,none,none\n"
    levels = read(tmp_path, table, ColumnMap(constant={"level_vpp": "60"}))["level_vpp"]
    assert levels.iloc[0] == 60.0
    assert levels.isna().tolist() == [False, True]


def offered(trials: pd.DataFrame) -> list[bool | None]:
    return [None if value is pd.NA else bool(value) for value in trials["none_offered"]]


def test_one_answer_none_shows_that_its_condition_offered_it_to_everybody(tmp_path: Path) -> None:
    header = "participant,side,level_vpp,response,condition\n"
    rows = ("1,left,60,none,a\n1,left,60,left,a\n1,left,60,left,b\n", "2,left,60,left,a\n")
    paths = [put(tmp_path / f"{n}.csv", header + text) for n, text in enumerate(rows)]
    assert offered(read_trials(paths, ColumnMap())) == [True, True, None, True]


def test_a_table_that_says_yes_or_no_offered_none(tmp_path: Path) -> None:
    table = "participant,side,level_vpp,detected\n1,left,60,1\n1,left,60,1\n"
    assert offered(read(tmp_path, table, ColumnMap(task="yes/no"))) == [True, True]


def test_the_bounds_of_levels_are_in_our_unit(tmp_path: Path) -> None:
    table = LEAST + "1,left,1000000000,left\n"
    columns = ColumnMap(units={"level_vpp": "mV"})
    assert read(tmp_path, table, columns)["level_vpp"].tolist() == [1e6]


def test_a_time_beside_a_time_out_is_no_reaction_time(tmp_path: Path) -> None:
    table = "participant,side,level_vpp,response,rt_s\n1,left,60,timeout,1.5\n1,left,60,left,0.5\n"
    assert read(tmp_path, table)["rt_s"].isna().tolist() == [True, False]


def test_a_spreadsheets_byte_order_mark_is_read_over(tmp_path: Path) -> None:
    assert read(tmp_path, f"\ufeff{LEAST}1,left,60,left\n")["participant"].tolist() == ["1"]


def test_the_map_is_listed_among_the_inputs(tmp_path: Path) -> None:
    columns = load(tmp_path, '[constant]\nside = "left"\n')
    found = loaded(tmp_path, "participant,level_vpp,response\n1,60,left\n", columns)
    assert [one.name for one in found.inputs] == ["MAP.toml", "t.csv"]


@pytest.mark.parametrize(
    ("table", "columns", "line", "words"),
    [
        ("a,b\n1,2\n", {}, 1, "no column participant, side, level_vpp, response; the map must"),
        ("participant,side,level_vpp\n1,left,60\n", {}, 1, "no column response;"),
        (LEAST + "1,left,60,left\n", {"columns": {"rt_s": "time"}}, 1, "no column 'time', named"),
        (LEAST + "1,left,60,left\n", {"constant": {"side": "left"}}, 1, "map has a constant"),
        (LEAST + "1,left,60,l\n", {}, 2, "column 'response' holds 'l'"),
        (LEAST + "1,left,,left\n", {}, 2, "column 'level_vpp' is n/a"),
        (LEAST + ",left,60,left\n", {}, 2, "column 'participant' is empty"),
        (LEAST + "1,left,60,\n", {}, 2, "column 'response' is n/a; it must be an answer"),
        (LEAST.replace("side", "s") + "1,up,60,left\n", {"columns": {"side": "s"}}, 2, "(side)"),
        (LEAST + "1,up,60,left\n", {}, 2, "'up'"),
        (LEAST + "1,left,1e999,left\n", {"units": {"level_vpp": "V-peak"}}, 2, "holds '1e999'"),
        (LEAST + "1,left,60;1\n", {}, 2, "too few fields"),
        (LEAST + "1,left,60,left\n1,left,1e-7,left\n", {}, 3, "a number from 1e-06 to 1e+06"),
        (LEAST + "1,left,60,left\n1,left,1.1e6,left\n", {}, 3, "a number from 1e-06 to 1e+06"),
        (LEAST + "1,left,-60,left\n", {}, 2, "column 'level_vpp' holds '-60'"),
        (
            LEAST + "1,left,nan,left\n",
            LINEAR,
            2,
            "a finite number, in a blank trial -inf",
        ),
        (LEAST + "1,left,,left\n", LINEAR, 2, '[values.level_vpp] "" = "-inf", or what stands'),
        (LEAST + "1,left,-inf,left\n", {}, 2, "column 'level_vpp' holds '-inf'"),
        (LEAST + "1,left,-inf,left\n", FORCED_DB, 2, "the level is -inf, and a forced choice"),
        (LEAST + "1,none,-60,none\n", LINEAR, 2, "-60; it must be 0 or n/a where there is no"),
        (LEAST[:-1] + ",trial\n1,left,60,left,a\n", {}, 2, "'a'"),
        (LEAST + "1,left,60,left\n", {"columns": {"side": ""}}, 1, "no column side"),
        (ANSWERS, {}, 1, "response and detected both tell the answer"),
        (LEAST + "1,left,60,left\n", {"constant": {"detected": "0"}}, 1, "both tell the answer"),
        (FELT + "1,left,60,1\n", {"constant": {"response": "none"}}, 1, "both tell the answer"),
        (FELT + "1,left,60,1\n1,left,60,\n", YES_NO, 3, "column 'response' is n/a"),
        (
            FELT + "1,left,60,1\n1,right,60,1\n1,none,0,1\n",
            YES_NO,
            4,
            "left, right: which side was",
        ),
    ],
)
def test_a_table_that_does_not_fit_its_map_is_refused(
    tmp_path: Path, table: str, columns: dict[str, Any], line: int, words: str
) -> None:
    error = refused(put(tmp_path / "t.csv", table), columns=ColumnMap(**columns))
    assert error.line == line
    assert words in str(error)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[tabel]\ndetected = "k"', "[tabel] is not a section of a map, allowed [file], [rows]"),
        ('[axis]\nx_scale = "ln"', "[axis] x_scale: allowed log10, dB, linear, got 'ln'"),
        ('[axis]\nx = "linear"', "[axis] x: allowed x_scale, unit"),
        ('[axis]\nunit = ""', "[axis] unit: printable text of 1 to 16, got ''"),
        ('[axis]\nunit = "dB SL"', '[axis] x_scale = "dB" needs a unit such as "dB" or "dB SL"'),
        ('[axis]\nx_scale = "dB"', 'needs x_scale = "dB"; got unit = "V" and x_scale = "dB"'),
        ("[axis]\nunit = 5", "[axis] unit: printable text of 1 to 16, got 5"),
        ("[axis]\nx_scale = []", "[axis] x_scale: allowed log10, dB, linear, got []"),
        ("[constant]\nlevel_vpp = -5", "[constant] level_vpp: allowed a number above 0"),
        ('columns = "a"', "[columns] is not a section"),
        ('[columns]\ncolour = "c"', "[columns] colour: not a column of trials.csv"),
        ("[columns]\nside = 1", "[columns] side: must be text in quotation marks, got 1"),
        ('[values]\nside = "left"', '[values] side: must be a table of "theirs" = "ours"'),
        ("[values.side]\nl = 1", '[values] side: must be a table of "theirs" = "ours"'),
        ('[values.side]\nl = "up"', "[values.side] 'l': allowed left, right, both or none"),
        ('[values.colour]\nl = "up"', "[values] colour: not a column"),
        ('[constant]\nside = "up"', "[constant] side: allowed left, right, both or none, got 'up'"),
        ("[constant]\nlevel_vpp = nan", "[constant] level_vpp: allowed a number above 0"),
        ("[constant]\nlevel_vpp = [60]", "[constant] level_vpp: must be text"),
        ('[constant]\nside = "left"\n[columns]\nside = "s"', "[columns] already says where"),
        ('[units]\nrt_s = "h"', "[units] rt_s: allowed s, ms, us, got 'h'"),
        ('[units]\nlevel_vpp = "Vrms"', "[units] level_vpp: allowed V, mV, V-peak, mV-peak"),
        ('[units]\nside = "ms"', "[units] side: allowed no unit but its own, got 'ms'"),
        ('[columns]\nresponse = "a"\ndetected = "b"', "detected: allowed only without response"),
        ('[constant]\nrt_s = 1\n[units]\nrt_s = "ms"', "[units] rt_s: a constant is in our unit"),
        ("[columns\n", "MAP.toml: "),
        ("task = yes  # or no", 'task: text needs quotation marks, task = "yes"'),
        ("[columns]\nside = arm\n", 'side: text needs quotation marks, side = "arm"'),
        ("[columns]\nside =", 'side: text needs quotation marks, side = "..."'),
        ("[scale]\nlevel_vpp = .5", "Invalid value (at line 2, column 13)"),
        ('task = "yes/no"\nalternatives = 2', "alternatives: allowed beside task"),
        ("alternatives = 2", "alternatives: allowed beside task"),
        ("a = " + "[" * 100_000, "MAP.toml: "),
        ("x" * 1_000_001, "it has at most 1000000 bytes"),
    ],
)
def test_a_map_that_cannot_be_meant_is_refused(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(ValueError, match=r"MAP\.toml: ") as caught:
        load(tmp_path, text)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("section", ["columns", "constant", "units", "values"])
def test_a_map_made_in_python_is_held_to_the_same_types(section: str) -> None:
    sections: dict[str, Any] = {section: {"rt_s": 5}}
    with pytest.raises(ValueError, match=rf"\[{section}\] rt_s: must be .* got 5"):
        ColumnMap(**sections)


def test_a_map_that_is_a_pipe_or_not_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "MAP.toml"
    os.mkfifo(path)
    with pytest.raises(ValueError, match=r"MAP\.toml: not a regular file"):
        load_column_map(path)
    path.unlink()
    path.write_bytes(b"# caf\xe9\n")
    with pytest.raises(ValueError, match=r"MAP\.toml: "):
        load_column_map(path)


def test_a_linear_axis_has_levels_of_any_sign(tmp_path: Path) -> None:
    text = LEAST + "1,left,-60,left\n1,left,0,none\n1,left,1e7,left\n1,none,0,none\n"
    found = loaded(tmp_path, text, ColumnMap(axis={"x_scale": "linear", "unit": "deg"}))
    assert found.trials["level_vpp"].tolist()[:3] == [-60.0, 0.0, 1e7]
    assert found.trials["level_vpp"].isna().tolist() == [False, False, False, True]
    assert (found.axis.x_scale, found.axis.unit) == ("linear", "deg")


@pytest.mark.parametrize(
    ("axis", "label", "name"),
    [({}, "V peak-to-peak", "threshold_vpp"), ({"unit": "V"}, "V", "unit")],
)
def test_volts_that_a_map_states_are_not_said_to_be_from_peak_to_peak(
    tmp_path: Path, axis: dict[str, str], label: str, name: str
) -> None:
    table = put(tmp_path / "t.csv", LEAST + "1,left,60,left\n1,left,40,none\n")
    analysis = analyse(read_inputs([table], ColumnMap(axis=axis)))
    assert analysis.axis.label == label
    assert name in in_own_words(analysis.thresholds, analysis)
