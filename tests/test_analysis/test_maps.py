"""Column maps of external tables: what they mean, defaults, units, and what is refused."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, analyse, load_column_map, read_inputs, read_trials
from tests.test_analysis.shared import LEAST, loaded, put, refused

if TYPE_CHECKING:
    from analysis import LoadedTrials

FELT = "participant,side,level_vpp,detected\n"
TIMED = LEAST.replace("\n", ",rt_s\n")
NUMBERED = LEAST.replace("\n", ",trial\n")
YES_NO = {"task": "yes/no"}
LINEAR = {"axis": {"x_scale": "linear"}}
FORCED_DB = {"axis": {"x_scale": "dB", "unit": "dB"}, "task": "forced choice"}


def rows_of(read: LoadedTrials, *columns: str) -> list[list[Any]]:
    rows: list[list[Any]] = read.trials[list(columns)].to_numpy().tolist()
    return rows


def load(folder: Path, text: str) -> ColumnMap:
    return load_column_map(put(folder / "MAP.toml", text))


def test_four_columns_are_enough_and_the_rest_has_its_default(tmp_path: Path) -> None:
    table = LEAST + "007,left,60,left\n007,both,60,left\n007,none,,none\n"
    trials = loaded(tmp_path, table).trials
    assert trials["participant"].tolist() == ["007"] * 3
    assert trials["kind"].tolist() == ["single", "both", "blank"]
    assert trials["trial"].tolist() == [1, 2, 3]
    assert trials["correct"].tolist() == [True, False, True]
    constants = {"session": "01", "condition": "main", "attempt": 1, "block": 1, "status": "ok"}
    constants |= {"anticipated": False, "simulated": False, "schema": 2}
    constants |= {"study_sha256": "n/a", "level_rule": "n/a"}
    for name, value in constants.items():
        assert trials[name].tolist() == [value] * 3, name
    absent = ["rt_s", "onset_s", "foreperiod_s", "noise_ok", "level_left_vpp", "peak_left_um"]
    absent += ["device_kind", "level_planned_vpp", "burst_verified"]
    assert trials[absent].isna().all(axis=None)


CONSTANT_RIGHT = ColumnMap(columns={"trial": "", "side": ""}, constant={"side": "right"})
EXPLAINED = ColumnMap(
    columns={"kind": "stim", "side": "stim", "detected": "felt"},
    values={"kind": {"0": "blank", "1": "single"}, "side": {"0": "none", "1": "right"}},
    task="yes/no",
)
THEIRS = """
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
[units]
rt_s = "ms"
level_vpp = "mV-peak"
"""
CORRECT = "participant,side,level_vpp,correct\n1,left,60,{}\n1,right,60,{}\n"
BOTH = "participant,side,level_vpp,response,detected\n1,left,60,right,1\n"
LOW = {"level_vpp": {"low": "60", "1000": "95"}}
PHASES = (
    "participant,side,level_vpp,response,phase,n\n,,,,welcome,\n1,left,60,left,practice,0\n"
    "1,left,60,left,main,0\n1,left,95,none,main,1\n1,left,95,left,main,\n,,,,,\n\n"
)
ZEROS = LEAST + "1,left,60,left\n1,left,0,none\n1,left,0,left\n"


def of_correct(**more: Any) -> ColumnMap:
    return ColumnMap(columns={"detected": "correct"}, **more)


@pytest.mark.parametrize(
    ("table", "columns", "names", "expected"),
    [
        (
            "Subject,amplitude,key,time,colour\n01,30000,l,612.5,red\n01,30000,,,blue\n",
            ColumnMap(**tomllib.loads(THEIRS)),
            "level_vpp response side",
            [[60.0, "left", "left"], [60.0, "timeout", "left"]],
        ),
        (
            "participant,stim,level_vpp,felt\n1,1,2.5,0\n1,0,0,0\n1,0,,1\n1,1,2.5,timeout\n",
            EXPLAINED,  # a column of theirs for two of ours
            "kind response",
            [["single", "none"], ["blank", "none"], ["blank", "right"], ["single", "timeout"]],
        ),
        (
            LEAST + "1,left,low,left\n1,left,130000,left\n1,left,1000,left\n",
            ColumnMap(values=LOW, units={"level_vpp": "mV"}),  # words are in our unit
            "level_vpp",
            [[60.0], [130.0], [95.0]],
        ),
        (
            "participant,trial,side,level_vpp,response\n1,a,left,60,left\n1,a,left,60,none\n",
            CONSTANT_RIGHT,
            "trial side",
            [[1, "right"], [2, "right"]],
        ),
        (PHASES, ColumnMap(rows={"keep": {"phase": "main"}, "skip": {"n": [""]}}),
         "line level_vpp", [[4, 60.0], [5, 95.0]]),
        (LEAST + "1,left,40,left\n1,left,62.5,none\n", ColumnMap(scale={"level_vpp": 2.5}),
         "level_vpp", [[100.0], [156.25]]),
        (NUMBERED + "1,left,60,left,0\n1,left,60,left,1\n2,left,60,left,1\n", ColumnMap(),
         "participant trial", [["1", 1], ["1", 2], ["2", 1]]),
        (NUMBERED + "1,left,60,left,1\n" * 2, ColumnMap(columns={"trial": ""}),
         "trial", [[1], [2]]),
        (ZEROS, ColumnMap(), "kind side correct",
         [["single", "left", True], ["blank", "none", True], ["blank", "none", False]]),
        (ZEROS, ColumnMap(task="forced choice", axis={"x_scale": "linear"}),
         "kind", [["single"]] * 3),
        (CORRECT.format(1, 0), of_correct(task="forced choice"), "response correct",
         [["left", True], ["left", False]]),
        (CORRECT.format("true", "FALSE"), of_correct(task="yes/no"), "response none_offered",
         [["left", True], ["none", True]]),
        (CORRECT.format("true", "FALSE"),
         of_correct(values={"detected": {"true": "0", "FALSE": "timeout"}}, task="yes/no"),
         "response", [["none"], ["timeout"]]),
        (FELT + "1,left,60,1\n1,left,60,\n",
         ColumnMap(values={"detected": {"": "timeout"}}, task="yes/no"),
         "response", [["left"], ["timeout"]]),
        (LEAST.replace("\n", ",note,note\n") + "1,left,60,left,a,b\n", ColumnMap(),
         "level_vpp", [[60.0]]),
        (LEAST.replace("\n", ",session,session\n") + "1,left,60,left,a,b\n",
         ColumnMap(columns={"session": ""}), "session", [["01"]]),
        (LEAST + "1,left,1000000000,left\n", ColumnMap(units={"level_vpp": "mV"}),
         "level_vpp", [[1e6]]),
        (f"\ufeff{LEAST}1,left,60,left\n", ColumnMap(), "participant", [["1"]]),
        *(
            (BOTH, ColumnMap(columns=columns, task="yes/no"), "response", [[response]])
            for columns, response in (
                ({"detected": "detected"}, "left"), ({"response": "response"}, "right"),
                ({"response": ""}, "left"), ({"detected": ""}, "right"),
            )
        ),
    ],
)  # fmt: skip # rows of a table
def test_a_table_is_read_by_its_map(
    tmp_path: Path, table: str, columns: ColumnMap, names: str, expected: list[list[Any]]
) -> None:
    assert rows_of(loaded(tmp_path, table, columns), *names.split()) == expected


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
    read = loaded(tmp_path, table, ColumnMap(units={column: unit}))
    assert rows_of(read, column) == [[value]]


def test_rows_are_left_out_and_counted(tmp_path: Path) -> None:
    columns = ColumnMap(rows={"keep": {"phase": "main"}, "skip": {"n": [""]}})
    assert loaded(tmp_path, PHASES, columns).left_out == 3
    text = "participant,side,level_vpp,response,phase,k,n\n1,left,60,left,practice,9,9\n"
    paths = [put(tmp_path / "a.csv", text), put(tmp_path / "b.csv", text.replace("practice", "go"))]
    for table in ({}, {"detected": "k", "presented": "n"}):
        kept = ColumnMap(rows={"skip": {"phase": ["go", ""]}}, table=table, task="yes/no")
        assert read_inputs(paths, kept).left_out == 1
        for section, word in (("skip", "other"), ("keep", "other"), ("skip", ["go", "other"])):
            columns = ColumnMap(rows={section: {"phase": word}}, table=table, task="yes/no")
            error = str(refused(*paths, columns=columns))
            for part in (f"[rows.{section}]", "phase", "'other'", "'go', 'practice'"):
                assert part in error
        nothing = ColumnMap(
            rows={"skip": {"phase": ["go", "practice"]}}, table=table, task="yes/no"
        )
        assert "[rows.skip] phase" in str(refused(*paths, columns=nothing))


def test_trials_are_numbered_within_participant_and_session_across_files(tmp_path: Path) -> None:
    header = "participant,session,side,level_vpp,response\n"
    first = "a,1,left,60,left\nb,1,left,60,left\na,1,left,60,left\n"
    second = "a,1,left,60,left\na,2,left,60,left\n"
    paths = [put(tmp_path / f"{n}.csv", header + text) for n, text in enumerate((first, second))]
    assert read_trials(paths, ColumnMap())["trial"].tolist() == [1, 1, 2, 3, 1]


def test_a_constant_level_is_that_of_the_stimuli(tmp_path: Path) -> None:
    table = "participant,side,response\n1,left,left\n1,none,none\n"
    levels = loaded(tmp_path, table, ColumnMap(constant={"level_vpp": "60"})).trials["level_vpp"]
    assert levels.iloc[0] == 60.0
    assert levels.isna().tolist() == [False, True]


def test_one_answer_none_shows_that_its_condition_offered_it_to_everybody(tmp_path: Path) -> None:
    header = "participant,side,level_vpp,response,condition\n"
    rows = ("1,left,60,none,a\n1,left,60,left,a\n1,left,60,left,b\n", "2,left,60,left,a\n")
    paths = [put(tmp_path / f"{n}.csv", header + text) for n, text in enumerate(rows)]
    offered = read_trials(paths, ColumnMap())["none_offered"]
    assert [None if value is pd.NA else bool(value) for value in offered] == [
        True,
        True,
        None,
        True,
    ]


def test_a_time_beside_a_time_out_is_no_reaction_time(tmp_path: Path) -> None:
    read = loaded(tmp_path, TIMED + "1,left,60,timeout,1.5\n1,left,60,left,0.5\n")
    assert read.trials["rt_s"].isna().tolist() == [True, False]


def test_the_map_is_listed_among_the_inputs(tmp_path: Path) -> None:
    columns = load(tmp_path, '[constant]\nside = "left"\n')
    found = loaded(tmp_path, "participant,level_vpp,response\n1,60,left\n", columns)
    assert [file.name for file in found.inputs] == ["MAP.toml", "t.csv"]


def test_decimal_commas_are_read_where_the_map_says_so(tmp_path: Path) -> None:
    text = "participant;side;level_vpp;response;rt_s\n1;left;60,5;left;0,612\n1;left;95;none;\n"
    error = refused(put(tmp_path / "t.csv", text), columns=ColumnMap())
    assert '[file] decimal = ","' in str(error)
    commas = ColumnMap(file={"decimal": ","})
    assert rows_of(loaded(tmp_path, text, commas), "level_vpp", "rt_s")[0] == [60.5, 0.612]
    points = put(tmp_path / "p.csv", text.replace("60,5", "60.5"))
    assert "'60.5'" in str(refused(points, columns=commas))


def timed(times: dict[str, float]) -> str:
    return TIMED + "".join(f"{who},left,60,left,{rt}\n" for who, rt in times.items())


def test_milliseconds_of_some_participants_are_found_and_reported(tmp_path: Path) -> None:
    in_ms = ColumnMap(units={"rt_s": "ms"})
    for times, columns, changed in (
        ({"1": 0.6, "2": 612.0, "3": 0.8}, ColumnMap(), "2"),
        ({"1": 600, "2": 612.0, "3": 800}, in_ms, ""),
        ({"1": 0.6, "2": 612.0, "3": 800}, in_ms, "1"),
    ):
        read = loaded(tmp_path, timed(times), columns)
        assert read.trials["rt_s"].tolist() == pytest.approx([0.6, 0.612, 0.8])
        assert [re.findall(r"\d", str(warning))[0] for warning in read.changed] == [*changed]


@pytest.mark.parametrize(
    "times", [{"1": 612.0}, {"1": 612.0, "2": 700.0}, {"1": 0.6, "2": 20.0}, {"1": 0.6, "2": 2e5}]
)
def test_times_whose_unit_nothing_shows_are_refused(
    tmp_path: Path, times: dict[str, float]
) -> None:
    error = refused(put(tmp_path / "t.csv", timed(times)), columns=ColumnMap())
    assert '[units] rt_s = "ms"' in str(error)


def test_a_linear_axis_has_levels_of_any_sign(tmp_path: Path) -> None:
    text = LEAST + "1,left,-60,left\n1,left,0,none\n1,left,1e7,left\n1,none,0,none\n"
    found = loaded(tmp_path, text, ColumnMap(axis={"x_scale": "linear", "unit": "deg"}))
    assert found.trials["level_vpp"].tolist()[:3] == [-60.0, 0.0, 1e7]
    assert found.trials["level_vpp"].isna().tolist() == [False, False, False, True]
    assert (found.axis.x_scale, found.axis.unit) == ("linear", "deg")


def test_volts_are_from_peak_to_peak_unless_a_map_states_them(tmp_path: Path) -> None:
    table = put(tmp_path / "t.csv", LEAST + "1,left,60,left\n1,left,40,none\n")
    maps = ColumnMap(), ColumnMap(axis={"unit": "V"})
    ours, theirs = (analyse(read_inputs([table], columns)).axis.label for columns in maps)
    assert theirs == "V"
    assert ours != theirs


@pytest.mark.parametrize(
    ("table", "columns", "line", "parts"),
    [
        ("a,b\n1,2\n", {}, 1, "participant|side|level_vpp|response"),
        ("participant,side,level_vpp\n1,left,60\n", {}, 1, "response"),
        (LEAST + "1,left,60,left\n", {"columns": {"rt_s": "time"}}, 1, "'time'"),
        (LEAST + "1,left,60,left\n", {"constant": {"side": "left"}}, 1, "constant"),
        (LEAST + "1,left,60,left\n", {"rows": {"skip": {"phase": "a"}}}, 1, "'phase'|[rows]"),
        (LEAST + "1,left,60,l\n", {}, 2, "'response'|'l'"),
        (LEAST + "1,left,,left\n", {}, 2, "'level_vpp'"),
        (LEAST + ",left,60,left\n", {}, 2, "'participant'"),
        (LEAST + "1,left,60,\n", {}, 2, "'response'"),
        (LEAST.replace("side", "s") + "1,up,60,left\n", {"columns": {"side": "s"}}, 2, "(side)"),
        (LEAST + "1,up,60,left\n", {}, 2, "'up'"),
        (LEAST + "1,left,1e999,left\n", {"units": {"level_vpp": "V-peak"}}, 2, "'1e999'"),
        (LEAST + "1,left,60;1\n", {}, 2, ""),
        (LEAST + "1,left,60,left\n1,left,1e-7,left\n", {}, 3, "1e-06|1e+06"),
        (LEAST + "1,left,60,left\n1,left,1.1e6,left\n", {}, 3, "1e-06|1e+06"),
        (LEAST + "1,left,-60,left\n", {}, 2, "'level_vpp'|'-60'"),
        (LEAST + "1,left,nan,left\n", LINEAR, 2, "-inf"),
        (LEAST + "1,left,,left\n", LINEAR, 2, '[values.level_vpp] "" = "-inf"'),
        (LEAST + "1,left,-inf,left\n", {}, 2, "'level_vpp'|'-inf'"),
        (LEAST + "1,left,-inf,left\n", FORCED_DB, 2, "-inf"),
        (ZEROS, {"task": "forced choice"}, 3, "0"),
        (LEAST + "1,none,-60,none\n", LINEAR, 2, "-60|n/a"),
        (NUMBERED + "1,left,60,left,a\n", {}, 2, "'a'"),
        (NUMBERED + "1,left,60,left,1\n" * 2, {}, 3, '[columns] trial = ""'),
        (LEAST + "1,left,60,left\n", {"columns": {"side": ""}}, 1, "side"),
        (LEAST.replace("\n", ",note,note\n") + "1,left,60,left,a,b\n",
         {"columns": {"condition": "note"}}, 1, "'note'|condition"),
        (LEAST.replace("\n", ",session,session\n") + "1,left,60,left,a,b\n", {}, 1,
         "[columns] session"),
        (BOTH, {}, 1, "response|detected"),
        (LEAST + "1,left,60,left\n", {"constant": {"detected": "0"}}, 1, "detected"),
        (FELT + "1,left,60,1\n", {"constant": {"response": "none"}}, 1, "response"),
        (FELT + "1,left,60,1\n1,left,60,\n", YES_NO, 3, "'response'"),
        (FELT + "1,left,60,1\n1,right,60,1\n1,none,0,1\n", YES_NO, 4, "left|right"),
        (FELT + "1,left,60,1\n1,left,60,None\n", YES_NO, 3,
         '[values.detected] "None" = "timeout"'),
        (FELT + "A,left,60,1\nA,right,60,0\n", {}, 1, 'task = "yes/no"'),
        (CORRECT.format("yes", "FALSE"), {"columns": {"detected": "correct"}, **YES_NO}, 2,
         '[values.detected] "yes" = "1"'),
        (timed({"1": 0.5}), {"units": {"rt_s": "ms"}}, 2, "0.01|10|ms"),
        ("participant,intensity,detected\np,0,1\np,,0\np,10,1\n",
         {"columns": {"level_vpp": "intensity"}, "constant": {"side": "left"}, **YES_NO,
          "values": {"level_vpp": {"": "0"}}, "axis": {"x_scale": "dB", "unit": "dB SL"}}, None,
         '"" = "-inf"'),
    ],
)  # fmt: skip # rows of a table
def test_a_table_that_does_not_fit_its_map_is_refused(
    tmp_path: Path, table: str, columns: dict[str, Any], line: int | None, parts: str
) -> None:
    error = refused(put(tmp_path / "t.csv", table), columns=ColumnMap(**columns))
    assert error.line == line
    assert all(part in str(error) for part in parts.split("|"))


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ('[tabel]\ndetected = "k"', "[tabel]|[file]|[rows]"),
        ('[axis]\nx_scale = "ln"', "[axis] x_scale|log10|dB|linear|'ln'"),
        ('[axis]\nx = "linear"', "[axis] x|x_scale|unit"),
        ('[axis]\nunit = ""', "[axis] unit|16|''"),
        ('[axis]\nunit = "dB SL"', '[axis] x_scale = "dB"'),
        ('[axis]\nx_scale = "dB"', 'x_scale = "dB"|unit = "V"'),
        ("[axis]\nunit = 5", "[axis] unit|16|5"),
        ("[axis]\nx_scale = []", "[axis] x_scale|[]"),
        ("[constant]\nlevel_vpp = -5", "[constant] level_vpp"),
        ("[constant]\nlevel_vpp = nan", "[constant] level_vpp"),
        ("[constant]\nlevel_vpp = [60]", "[constant] level_vpp"),
        ('columns = "a"', "[columns]"),
        ('[columns]\ncolour = "c"', "[columns] colour"),
        ("[columns]\nside = 1", "[columns] side|1"),
        ('[values]\nside = "left"', "[values] side"),
        ("[values.side]\nl = 1", "[values] side"),
        ('[values.side]\nl = "up"', "[values.side]|'l'|left|none"),
        ('[values.colour]\nl = "up"', "[values] colour"),
        ('[constant]\nside = "up"', "[constant] side|'up'|none"),
        ('[constant]\nside = "left"\n[columns]\nside = "s"', "[columns]"),
        ('[units]\nrt_s = "h"', "[units] rt_s|ms|us|'h'"),
        ('[units]\nlevel_vpp = "Vrms"', "[units] level_vpp|mV-peak"),
        ('[units]\nside = "ms"', "[units] side|'ms'"),
        ('[columns]\nresponse = "a"\ndetected = "b"', "detected|response"),
        ('[constant]\nrt_s = 1\n[units]\nrt_s = "ms"', "[units] rt_s"),
        ("[columns\n", ""),
        ("task = yes  # or no", 'task = "yes"'),
        ("[columns]\nside = arm\n", 'side = "arm"'),
        ("[columns]\nside =", "side"),
        ("[scale]\nlevel_vpp = .5", "line 2|column 13"),
        ('task = "yes/no"\nalternatives = 2', "alternatives|task"),
        ('task = "forced choice"\nalternatives = 1', "alternatives"),
        ('task = "2AFC"', 'task|"yes/no"'),
        ("alternatives = 2", "alternatives|task"),
        ("a = " + "[" * 100_000, ""),
        ("x" * 1_000_001, "1000000"),
        ('[file]\ndelimiter = "::"', "[file] delimiter|','|';'"),
        ('[file]\ndelimiter = ","\ndecimal = ","', "decimal"),
        ('[file]\nencoding = "zip"', "[file] encoding"),
        ('[file]\nencoding = "latin-99"', "[file] encoding"),
        ('[file]\nquote = "\'"', "[file] quote|delimiter"),
        ("[rows.drop]", "[rows.drop]"),
        ("[rows.keep]\nphase = 1", "[rows.keep] phase"),
        ('[rows]\nkeep = ["phase"]', "[rows.keep]"),
        ("[scale]\nlevel_vpp = 0", "[scale] level_vpp|0"),
        ("[scale]\nlevel_vpp = true", "[scale] level_vpp|True"),
        ("[scale]\ntrial = 2.0", "[scale] trial"),
        ('[scale]\nrt_s = 2.0\n[units]\nrt_s = "ms"', "[scale] rt_s|[units]"),
        ('[scale]\nrt_s = 2.0\n[constant]\nrt_s = "1"', "rt_s"),
        ('[table]\ndetected = "k"', "[table]|presented"),
        ("[table]\nCOUNTS\ngroups = []", "[table]"),
        ("[table]\nCOUNTS\nnone_offered = false", "[table]"),
        ('[table]\nCOUNTS\ngroup = "p"', "[table] group"),
        ("[table]\nCOUNTS\ngroup = [1]", "[table]"),
        ('[table]\ndetected = "k"\npresented = "k"', "k, k"),
        ("[table]\nCOUNTS", 'task = "yes/no"'),
        ('[columns]\nrt_s = "t"\n[table]\nCOUNTS', "[columns] rt_s|[table]"),
        ('[constant]\ncondition = "x"\n[table]\nCOUNTS\ngroup = ["p"]', "condition"),
    ],
)
def test_a_map_that_cannot_be_meant_is_refused(tmp_path: Path, text: str, parts: str) -> None:
    text = text.replace("COUNTS", 'detected = "k"\npresented = "n"')
    with pytest.raises(ValueError, match=r"MAP\.toml: ") as caught:
        load(tmp_path, text)
    assert all(part in str(caught.value) for part in parts.split("|"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("section", ["columns", "constant", "units", "values"])
def test_a_map_made_in_python_is_held_to_the_same_types(section: str) -> None:
    sections: dict[str, Any] = {section: {"rt_s": 5}}
    with pytest.raises(ValueError, match=rf"\[{section}\] rt_s: .* 5"):
        ColumnMap(**sections)


def test_a_map_that_is_a_pipe_or_not_utf8_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "MAP.toml"
    os.mkfifo(path)
    with pytest.raises(ValueError, match=r"MAP\.toml: "):
        load_column_map(path)
    path.unlink()
    path.write_bytes(b"# caf\xe9\n")
    with pytest.raises(ValueError, match=r"MAP\.toml: "):
        load_column_map(path)


PLATES = "participant,side,level,response,plate,grip,sound\n" + "".join(
    f"{who},{side},{level},{answer},{plate},{{grip}},{level}.wav\n"
    for who in "AB"
    for plate in ("steel", "wood")
    for side in ("left", "right")
    for level in (5, 9, 14)
    for answer in (side, "none")
)


@pytest.mark.parametrize(
    ("condition", "grips", "named"),
    [
        (None, "", ["plate", "sound"]),
        ("", "", []),
        ("plate", "", []),  # a file for each level says the stimulus again
        ("plate", "loose tight", ["grip"]),
    ],
)
def test_columns_that_vary_and_are_no_condition_are_warned_of(
    tmp_path: Path, condition: str | None, grips: str, named: list[str]
) -> None:
    cells = grips.split() or ["bare"]
    head, *rows = PLATES.splitlines()
    rows = [row.replace("{grip}", grip) for row in rows for grip in cells]
    theirs = {"level_vpp": "level"} | ({} if condition is None else {"condition": condition})
    read = loaded(tmp_path, "\n".join([head, *rows]) + "\n", ColumnMap(columns=theirs))
    assert len(read.changed) == len(named)
    assert all(name in str(warning) for name, warning in zip(named, read.changed, strict=True))


def test_one_place_for_all_is_refused_where_a_column_and_the_answers_name_two(
    tmp_path: Path,
) -> None:
    shown = [("0", "none"), ("4", "left"), ("9", "right"), ("9", "left"), ("4", "right")]
    rows = [f"1,{level},{side},{'down' if level == '0' else side}\n" for level, side in shown]
    table = put(tmp_path / "t.csv", "participant,amp_um,target,key\n" + "".join(rows))
    theirs = {"level_vpp": "amp_um", "response": "key"}
    values = {"response": {"down": "none"}}
    columns = ColumnMap(columns=theirs, values=values, constant={"side": "left"})
    assert '[columns] side = "target"' in str(refused(table, columns=columns))
    values = {"response": {"down": "none", "left": "none", "right": "left"}}  # yes/no by arrows
    read_inputs([table], ColumnMap(columns=theirs, values=values, constant={"side": "left"}))


def test_blanks_that_are_mostly_felt_are_warned_of(tmp_path: Path) -> None:
    felt = {0: 20, 5: 4, 9: 8}
    rows = "".join(f"p,left,{v},{int(n < k)}\n" for v, k in felt.items() for n in range(20))
    (warning,) = loaded(tmp_path, FELT + rows, ColumnMap(task="yes/no")).changed
    assert re.findall(r"\d+", str(warning))[:2] == ["100", "20"]


def begun_again(folder: Path) -> Path:
    """Write the tables of two people, and one of the second, who broke off after two trials."""
    head = "participant,session,trial,level_vpp,side,response,condition"
    rows = [f"{n},{60 + n},left,left,{'dry' if n < 5 else 'moist'}" for n in range(1, 9)]
    for name, number in (("p0_b", 8), ("p1_b", 8), ("p1_a", 2)):
        lines = "\n".join(f"{name[:2]},001,{row}" for row in rows[:number])
        put(folder / f"{name}.csv", f"{head}\n{lines}\n")
    return folder


@pytest.mark.parametrize(
    ("sections", "rows", "warned"),
    [
        ({"rows": {"skip": {"file-": "p1_a"}}}, 16, 0),
        ({"columns": {"session": "file-"}}, 18, 0),
        ({"columns": {"trial": ""}}, 18, 1),
    ],
)
def test_a_run_begun_anew_is_pooled_with_no_other(
    tmp_path: Path, sections: dict[str, Any], rows: int, warned: int
) -> None:
    data = begun_again(tmp_path / "data")
    error = refused(data, columns=ColumnMap())
    assert (Path(error.file).name, error.line) == ("p1_b.csv", 2)
    assert '[rows.skip] file- = "p1_a"' in str(error)
    read = read_inputs([data], ColumnMap(**sections))
    assert len(read.trials) == rows
    assert sum("p1_a" in str(warning) for warning in read.changed) == warned
    assert read.numbered is not bool(warned)


def test_the_order_of_rows_is_that_of_conditions_within_a_file_only(tmp_path: Path) -> None:
    data = begun_again(tmp_path / "data")
    (data / "p1_a.csv").unlink()
    columns = ColumnMap(columns={"trial": ""})
    assert read_inputs([data], columns).numbered
    for path in [*data.iterdir()]:
        head, *rows = path.read_text(encoding="utf-8").splitlines()
        for skin in ("dry", "moist"):
            kept = [row for row in rows if row.endswith(skin)]
            put(path.with_name(f"{path.stem}{skin}.csv"), "\n".join([head, *kept]) + "\n")
        path.unlink()
    assert not read_inputs([data], columns).numbered
