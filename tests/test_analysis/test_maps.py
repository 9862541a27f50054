"""Column maps of external tables: what they mean, defaults, units, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
import pytest

from analysis import ColumnMap, analyse, load_column_map, read_inputs, read_trials
from tests.test_analysis.shared import LEAST, cases, loaded, put, refused

if TYPE_CHECKING:
    from analysis import LoadedTrials
    from tests.conftest import Run

FELT = "participant,side,level_vpp,detected\n"
TIMED = LEAST.replace("\n", ",rt_s\n")


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
    constants |= {"premature": False, "simulated": False, "schema": 3}
    constants |= {"study_sha256": "n/a"}
    for name, value in constants.items():
        assert trials[name].tolist() == [value] * 3, name
    absent = ["rt_s", "onset_s", "foreperiod_s", "noise_ok", "level_left_vpp", "peak_left_um"]
    absent += ["device_kind", "burst_verified"]
    assert trials[absent].isna().all(axis=None)


PHASES = (
    "participant,side,level_vpp,response,phase,n\n,,,,welcome,\n1,left,60,left,practice,0\n"
    "1,left,60,left,main,0\n1,left,95,none,main,1\n1,left,95,left,main,\n,,,,,\n\n"
)


@pytest.mark.parametrize(("table", "columns", "names", "expected"), cases("tables that are read"))
def test_a_table_is_read_by_its_map(
    tmp_path: Path, table: str, columns: Any, names: str, expected: list[list[Any]]
) -> None:
    assert rows_of(loaded(tmp_path, table, ColumnMap(**columns)), *names.split()) == expected


def test_rows_are_left_out_and_counted(tmp_path: Path) -> None:
    columns = ColumnMap(rows={"keep": {"phase": "main"}, "skip": {"n": [""]}})
    assert loaded(tmp_path, PHASES, columns).left_out == 3
    text = "participant,side,level_vpp,response,phase,k,n\n1,left,60,left,practice,9,9\n"
    paths = [put(tmp_path / "a.csv", text), put(tmp_path / "b.csv", text.replace("practice", "go"))]
    for table in (None, {"detected": "k", "presented": "n"}):
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
    read = loaded(tmp_path, "participant,level_vpp,response\n1,60,left\n", columns)
    assert [file.name for file in read.inputs] == ["MAP.toml", "t.csv"]


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


def test_times_in_the_unit_that_the_map_states_are_read(tmp_path: Path) -> None:
    in_ms = ColumnMap(units={"rt_s": "ms"})
    read = loaded(tmp_path, timed({"1": 600, "2": 612.0, "3": 800}), in_ms)
    assert read.trials["rt_s"].tolist() == pytest.approx([0.6, 0.612, 0.8])
    error = refused(put(tmp_path / "t.csv", timed({"1": 0.6, "2": 612})), columns=in_ms)
    assert (error.line, "ms" in str(error)) == (2, True)


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
    read = loaded(tmp_path, text, ColumnMap(axis={"x_scale": "linear", "unit": "deg"}))
    assert read.trials["level_vpp"].tolist()[:3] == [-60.0, 0.0, 1e7]
    assert read.trials["level_vpp"].isna().tolist() == [False, False, False, True]
    assert (read.axis.x_scale, read.axis.unit) == ("linear", "deg")


def test_volts_are_from_peak_to_peak_unless_a_map_states_them(tmp_path: Path) -> None:
    table = put(tmp_path / "t.csv", LEAST + "1,left,60,left\n1,left,40,none\n")
    maps = ColumnMap(), ColumnMap(axis={"unit": "V"})
    ours, theirs = (analyse(read_inputs([table], columns)).axis.label for columns in maps)
    assert theirs == "V"
    assert ours != theirs


@pytest.mark.parametrize(("table", "columns", "line", "parts"), cases("tables that are refused"))
def test_a_table_that_does_not_fit_its_map_is_refused(
    tmp_path: Path, table: str, columns: dict[str, Any], line: int | None, parts: str
) -> None:
    error = refused(put(tmp_path / "t.csv", table), columns=ColumnMap(**columns))
    assert error.line == line
    assert all(part in str(error) for part in parts.split("|"))


LONG = [("a = " + "[" * 100_000, ""), ("x" * 1_000_001, "1000000")]


@pytest.mark.parametrize(("text", "parts"), [*cases("maps that are refused"), *LONG])
def test_a_map_that_cannot_be_meant_is_refused(tmp_path: Path, text: str, parts: str) -> None:
    text = text.replace("COUNTS", 'detected = "k"\npresented = "n"')
    with pytest.raises(ValueError, match=r"MAP\.toml: ") as caught:
        load(tmp_path, text)
    assert all(part in str(caught.value) for part in parts.split("|"))
    assert "\n" not in str(caught.value)


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
        (None, "", ["plate"]),  # a file for each level says the stimulus again
        ("", "", []),
        ("plate", "", []),
        ("plate", "loose tight", ["grip"]),
    ],
)
def test_columns_of_words_that_the_map_leaves_aside_are_named(
    tmp_path: Path, condition: str | None, grips: str, named: list[str]
) -> None:
    cells = grips.split() or ["bare"]
    head, *rows = PLATES.splitlines()
    rows = [row.replace("{grip}", grip) for row in rows for grip in cells]
    theirs = {"level_vpp": "level"} | ({} if condition is None else {"condition": condition})
    read = loaded(tmp_path, "\n".join([head, *rows]) + "\n", ColumnMap(columns=theirs))
    assert len(read.warnings) == len(named)
    assert all(name in str(data) for name, (_, data) in zip(named, read.warnings, strict=True))


def test_one_place_for_all_is_refused_where_a_column_and_the_answers_name_two(
    tmp_path: Path,
) -> None:
    shown = [("0", "none"), ("4", "left"), ("9", "right"), ("9", "left"), ("4", "right")]
    rows = [f"1,{level},{side},{'down' if level == '0' else side}\n" for level, side in shown]
    table = put(tmp_path / "t.csv", "participant,amp_um,target,key\n" + "".join(rows))
    theirs = {"level_vpp": "amp_um", "response": "key"}
    values = {"response": {"down": "none"}}
    columns = ColumnMap(columns=theirs, values=values, constant={"side": "left"})
    assert "left and right" in str(refused(table, columns=columns))
    values = {"response": {"down": "none", "left": "none", "right": "left"}}  # yes/no by arrows
    read_inputs([table], ColumnMap(columns=theirs, values=values, constant={"side": "left"}))


def test_blanks_that_are_mostly_felt_are_warned_of(tmp_path: Path) -> None:
    felt = {0: 20, 5: 4, 9: 8}
    rows = "".join(f"p,left,{v},{int(n < k)}\n" for v, k in felt.items() for n in range(20))
    read = loaded(tmp_path, FELT + rows, ColumnMap(task="yes/no"))
    assert read.warnings == (("blanks_mostly_detected", {"share": 1.0, "blanks": 20}),)


def begun_again(folder: Path) -> Path:
    """Write the tables of two people, and one of the second, who broke off after two trials."""
    head = "participant,session,trial,level_vpp,side,response,condition"
    rows = [f"{n},{60 + n},left,left,{'dry' if n < 5 else 'moist'}" for n in range(1, 9)]
    for name, number in (("p0_b", 8), ("p1_b", 8), ("p1_a", 2)):
        lines = "\n".join(f"{name[:2]},001,{row}" for row in rows[:number])
        put(folder / f"{name}.csv", f"{head}\n{lines}\n")
    return folder


@pytest.mark.parametrize(
    ("sections", "rows", "numbered"),
    [
        ({"rows": {"skip": {"file-": "p1_a"}}}, 16, True),
        ({"columns": {"session": "file-"}}, 18, True),
        ({"columns": {"trial": ""}}, 18, False),
        ({"columns": {"trial": "", "session": "file-"}}, 18, False),  # rows show no order
    ],
)
def test_a_run_begun_anew_is_pooled_with_no_other(
    tmp_path: Path, sections: dict[str, Any], rows: int, *, numbered: bool
) -> None:
    data = begun_again(tmp_path / "data")
    error = refused(data, columns=ColumnMap())
    assert (Path(error.file).name, error.line) == ("p1_b.csv", 2)
    assert "[rows.skip] file-" in str(error)
    assert str(data / "p1_a.csv:2") in str(error)
    read = read_inputs([data], ColumnMap(**sections))
    assert len(read.trials) == rows
    assert read.numbered is numbered


def test_names_that_differ_in_spelling_only_are_warned_of(tmp_path: Path) -> None:
    people = ("A01", "a01 ", "007", "7", "7.0", "B")
    rows = "".join(f"{who},left,60,left,{skin}\n" for who in people for skin in ("Dry", "DRY"))
    warnings = loaded(tmp_path, LEAST.replace("\n", ",condition\n") + rows).warnings
    assert [code for code, _ in warnings] == ["names_alike"] * 2
    names = [re.findall("'[^']+'", str(data["names"])) for _, data in warnings]
    assert names == [[repr(name) for name in people[:-1]], ["'Dry'", "'DRY'"]]


@pytest.mark.parametrize(
    ("column", "limit"), [("condition", 24), ("participant", 1000), ("level_vpp", 50_000)]
)
def test_a_column_with_thousands_of_values_is_refused_before_it_is_analysed(
    tmp_path: Path, column: str, limit: int
) -> None:
    values = {"participant": "1", "condition": "a", "level_vpp": "60"}
    lines = [",".join({**values, column: str(n + 1)}.values()) for n in range(80_000)]
    text = "participant,condition,level_vpp,response\n" + ",left\n".join([*lines, ""])
    columns = ColumnMap(constant={"side": "left"})
    error = refused(put(tmp_path / "t.csv", text), columns=columns)
    assert error.line == limit + 2
    assert f"column '{column}' is {limit + 1}; " in str(error)
    assert f"at most {limit} " in str(error)


def test_a_map_that_is_not_filled_in_is_refused_before_data_are_read(
    tmp_path: Path, run: Run
) -> None:
    columns = put(tmp_path / "m.toml", 'task = ""  # FILL IN: a\n[axis]\nunit = ""  # FILL IN: b\n')
    result = run("analyze", tmp_path / "no.csv", "--columns", columns, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stderr.endswith("m.toml: fill in task (line 1), unit (line 3)\n")


def test_all_gaps_of_a_map_are_named_at_once(tmp_path: Path) -> None:
    text = (
        'task = ""  # FILL IN: which\n[columns]\nlevel_vpp = ""  # FILL IN\ndetected = ""\n'
        'condition = \'\'# FILL IN: which\n[values.detected]\n"no, no" = ""  # FILL IN: 3'
    )
    gaps = 'task (line 1), level_vpp (line 3), condition (line 5), "no, no" (line 7)'
    with pytest.raises(ValueError, match=re.escape(f"MAP.toml: fill in {gaps}") + "$"):
        load(tmp_path, text)


def test_keys_may_be_empty_on_purpose(tmp_path: Path) -> None:
    text = (
        'task = ""\n[file]\ndelimiter = ""\n[rows.skip]\nx = ""\n[rows.keep]\ny = ""\n[columns]\n'
        'condition = ""\ndetected = ""\nside = ""\n[constant]\nside = "left"\n'
    )
    assert load(tmp_path, text).columns == {"condition": "", "detected": "", "side": ""}


def test_columns_of_words_are_named_where_the_table_has_no_side(tmp_path: Path) -> None:
    head = "participant,level_vpp,detected,skin,date,stepSize\n"
    rows = "".join(
        f"{who},{level},{hit},{skin},day {who},{('up', 'down')[hit]}\n"
        for who in "ab"
        for level in (5, 9, 14)
        for hit in (0, 1)
        for skin in ("dry", "moist")
    )
    columns = ColumnMap(constant={"side": "left"}, task="yes/no")
    ((_, data),) = loaded(tmp_path, head + rows, columns).warnings
    assert data["columns"] == "skin"
