"""The command analyze: files, numbers, exit codes, and that a refusal changes nothing."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import re
import shutil
from typing import TYPE_CHECKING, Any

import pytest
from filelock import FileLock

from analysis import ColumnMap, write_analysis
from experiment import COLUMNS
from experiment.record.files import write_new
from tests.test_analysis.shared import EXAMPLES, LEAST, cases, files, put, run

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from analysis import Analysis

    Analyze = Callable[..., Result]

TABLE, MAP = EXAMPLES / "synthetic-trials.csv", EXAMPLES / "synthetic-columns.toml"
EXAMPLE = (TABLE, "--columns", MAP)
HEADER = "participant,session,trial,kind,side,level_vpp,response,status,simulated\n"
REAL, SIMULATED = (f"1,01,1,single,left,60,left,ok,{word}\n" for word in ("false", "true"))
OTHER_SIMULATED = SIMULATED.replace("1", "2", 1)
BASIC = {"levels.csv", "participants.csv", "summary.json", "trials_clean.csv", "report.html"}
BASIC |= {".tactstrip.json", "methods.txt", "columns.json"}


def table(path: Path, *rows: str) -> Path:
    return put(path, HEADER + "".join(rows))


@pytest.fixture
def analyze(tmp_path: Path) -> Analyze:
    """Analyse tables that have our names, but not all our columns, without figures."""
    names = put(tmp_path / "maps" / "names.toml", "")
    options = ("--columns", names, "--no-figures")
    return lambda *given: run("analyze", *options, "--out", tmp_path / "out", *given)


def analysed(folder: Path, text: str, **options: Any) -> Analysis:
    paths, out = [put(folder / "t.csv", text)], folder / "out"
    return write_analysis(paths, out, columns=ColumnMap(), figures=False, **options)


def summary(folder: Path) -> dict[str, Any]:
    contents: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return contents


def rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8"))))


def no_room(*_: object, **__: object) -> None:
    raise OSError(28, "No space left on device")


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the example of the documentation, and beside them what was printed."""
    out = tmp_path_factory.mktemp("example") / "out"
    result = run("analyze", *EXAMPLE, "--out", out)
    assert (result.exit_code, result.stderr) == (0, "")
    put(out.with_name("stdout"), result.stdout)
    return out


@pytest.fixture
def earlier(example: Path, tmp_path: Path) -> Path:
    """The same results, to be changed."""
    return shutil.copytree(example, tmp_path / "out")


@pytest.mark.slow
def test_a_second_run_gives_the_same_bytes(example: Path, tmp_path: Path) -> None:
    data, names = (shutil.copy(path, tmp_path) for path in (TABLE, MAP))
    for _ in range(2):
        run("analyze", data, "--columns", names, "--out", tmp_path / "out")
        assert files(tmp_path / "out") == files(example)


@pytest.mark.slow
def test_the_tables_have_the_promised_columns_and_definitions(example: Path) -> None:
    clean = " ".join([*(column.name for column in COLUMNS), "counted", "reason"])
    for name, columns in [*cases("columns of files"), ["trials_clean.csv", clean]]:
        assert files(example)[name].splitlines()[0].decode() == ",".join(columns.split())
    defined = {*json.loads((example / "columns.json").read_text(encoding="utf-8"))}
    for path in example.glob("*.csv"):
        assert {*rows(path)[0]} - {column.name for column in COLUMNS} <= defined, path.name


@pytest.mark.slow
def test_the_summary_has_inputs_by_checksum_and_the_numbers_of_the_tables(tmp_path: Path) -> None:
    run("analyze", *EXAMPLE, "--out", tmp_path, "--seed", 7, "--no-figures")
    found = summary(tmp_path)
    assert found["inputs"] == [
        {"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in (MAP, TABLE)
    ]
    for folder in (tmp_path, EXAMPLES):
        assert str(folder) not in json.dumps(found)
    assert found["seed"] == 7
    parts = [found["counts"][name] for name in ("trials", "single", "both", "blank", "left_out")]
    assert parts == [370, 300, 20, 50, 0]
    assert [row["detected_any"] >= row["detected"] for row in found["levels"]] == [True] * 5
    for row, level in zip(rows(tmp_path / "levels.csv"), found["levels"], strict=True):
        assert row.pop("condition") == level["condition"]
        assert {name: float(row[name]) for name in row} == {name: level[name] for name in row}
    assert not (tmp_path / "detection.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["wilson", "jeffreys", "clopper-pearson"])
def test_the_interval_is_the_one_asked_for(tmp_path: Path, analyze: Analyze, method: str) -> None:
    analyze(table(tmp_path / "t.csv", REAL), "--ci", method)
    assert summary(tmp_path / "out")["ci"] == method


@pytest.mark.slow
def test_results_go_into_the_folder_that_was_given_or_the_current_one(
    two_sessions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sessions = shutil.copytree(two_sessions, tmp_path / "sessions")
    for _ in range(2):
        assert run("analyze", sessions, "--no-figures", "--allow-simulated").exit_code == 0
        assert {*files(sessions / "analysis")} >= BASIC
    path = table(tmp_path / "study" / "sub-1" / "ses-01" / "trials.csv", REAL)
    options = ("--no-figures", "--columns", put(tmp_path / "names.toml", ""))
    for name, given in (("a file", path), ("a folder made elsewhere", tmp_path / "study")):
        taken = put(tmp_path / name / f"{given.stem}-analysis" / "mine.txt", "mine")
        monkeypatch.chdir(tmp_path / name)
        for _ in range(2):  # beside the user's folder, and over the earlier analysis
            assert run("analyze", given, *options).exit_code == 0
        assert (tmp_path / name / f"{given.stem}-analysis-2" / "levels.csv").exists()
        assert [*taken.parent.iterdir()] == [taken]
        assert len([*(tmp_path / name).iterdir()]) == 2
    assert not (tmp_path / "study" / "analysis").exists()


@pytest.mark.slow
def test_tables_of_older_data_do_not_stay(earlier: Path, tmp_path: Path, analyze: Analyze) -> None:
    (earlier / "notes.txt").write_text("mine")
    analyze(table(tmp_path / "t.csv", REAL))
    assert set(files(earlier)) == BASIC | {"notes.txt", "thresholds.csv", "confusion.csv"}


@pytest.mark.slow
def test_a_refusal_is_one_line_with_exit_2_and_changes_nothing(
    earlier: Path, tmp_path: Path
) -> None:
    before = files(earlier)
    text = TABLE.read_text().replace("S03,1,40,single", "S03,1,40,double")
    broken = put(tmp_path / "broken.csv", text)
    result = run("analyze", TABLE, broken, "--columns", MAP, "--out", earlier)
    line = text[: text.index("double")].count("\n") + 1
    assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (2, "", 1)
    assert result.stderr.startswith(f"error: {broken}:{line}: ")
    assert "'kind'" in result.stderr
    assert files(earlier) == before
    assert {path.name for path in tmp_path.iterdir()} == {"broken.csv", "out"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["levels.csv", "summary.json"])
def test_what_is_analysed_is_never_overwritten(tmp_path: Path, analyze: Analyze, name: str) -> None:
    path = table(tmp_path / name, REAL)
    before = path.read_bytes()
    assert analyze(path, "--out", tmp_path).exit_code == 2
    assert path.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["out/blank.csv", "out/detection.svg", "out/summary.json", "out"])
def test_files_of_the_user_are_never_touched(tmp_path: Path, analyze: Analyze, name: str) -> None:
    mine = put(tmp_path / name, "mine")
    result = analyze(table(tmp_path / "a.csv", REAL))
    assert result.exit_code == 2
    assert str(mine) in result.stderr
    assert mine.read_text() == "mine"
    assert mine.parent == tmp_path or [*mine.parent.iterdir()] == [mine]


def folder_in_the_way(out: Path, _: pytest.MonkeyPatch) -> None:
    (out / "detection.svg").unlink()
    (out / "detection.svg").mkdir()


def no_room_for_figures(_: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analysis.results.figures.figures.render", no_room)


def no_room_for_a_table(_: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes, disk: Any) -> None:
        if path.name == "both.csv":
            no_room()
        write_new(path, content, disk)

    monkeypatch.setattr("analysis.results.files.write_new", full)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "name"),
    [(folder_in_the_way, "detection.svg"), (no_room_for_figures, ""),
     (no_room_for_a_table, "both.csv")],
)  # fmt: skip # rows of a table
def test_results_that_cannot_be_written_leave_the_old_ones(
    earlier: Path, monkeypatch: pytest.MonkeyPatch, fault: Callable[..., None], name: str
) -> None:
    fault(earlier, monkeypatch)
    before = {path: path.read_bytes() for path in earlier.iterdir() if path.is_file()}
    result = run("analyze", *EXAMPLE, "--out", earlier, "--ci", "jeffreys")
    assert result.exit_code == 2
    assert str(earlier / name) in result.stderr or not name
    assert {path: path.read_bytes() for path in earlier.iterdir() if path.is_file()} == before
    assert [path.name for path in earlier.parent.iterdir()] == ["out"]


@pytest.mark.slow
def test_only_what_a_killed_analysis_left_is_removed(tmp_path: Path, analyze: Analyze) -> None:
    out = tmp_path / "out"
    left, writing, mine = (out / f".analysis-{name}" for name in ("dead", "alive", "notes"))
    for folder, name in ((left, "both.csv"), (writing, "both.csv"), (mine, "notes.txt")):
        put(folder / name, "")
    with FileLock(writing / "lock"):
        analyze(table(tmp_path / "t.csv", REAL))
    assert {path for path in out.iterdir() if path.is_dir()} == {writing, mine}
    assert (mine / "notes.txt").exists()


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ([], "PATH"),
        ([TABLE, "--ci", "wald"], "wald"),
        ([TABLE, "--seed", "-1"], "-1"),
        ([TABLE, "--columns", "no/such.toml"], "no/such.toml"),
        (["no/such.csv"], "error: no/such.csv: "),
        (["no/such.csv", "--columns", "no/such.toml"], "error: no/such.toml: "),
        ([TABLE], "--columns MAP.toml"),
        ([TABLE, "--pdf", "--no-figures"], "--pdf"),
    ],
)
def test_bad_usage_has_exit_code_2(tmp_path: Path, arguments: list[object], part: str) -> None:
    result = run("analyze", *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert part in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("wrong", [True, -1])
def test_a_seed_is_a_whole_number(tmp_path: Path, wrong: int) -> None:
    with pytest.raises(ValueError, match="seed"):
        analysed(tmp_path, LEAST + "1,left,60,left\n", seed=wrong)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("together", [False, True])
def test_simulated_and_real_sessions_are_not_mixed(
    tmp_path: Path, analyze: Analyze, *, together: bool
) -> None:
    paths = [table(tmp_path / "1.csv", REAL), table(tmp_path / "2.csv", OTHER_SIMULATED)]
    line = 2
    if together:
        paths, line = [table(tmp_path / "1.csv", REAL, OTHER_SIMULATED)], 3
    out, result = tmp_path / "out", analyze(*paths)
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {paths[-1]}:{line}: ")
    assert "--allow-simulated" in result.stderr
    assert not out.exists()
    assert analyze(*paths, "--allow-simulated").exit_code == 0
    assert len(summary(out)["warnings"]) == 1
    assert summary(out)["mark"]
    people = [(row["participant"], row["simulated"]) for row in rows(out / "participants.csv")]
    assert people == [("1", "false"), ("2", "true")]
    assert [row["simulated"] for row in rows(out / "levels.csv")] == ["mixed"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "number"),
    [
        (f"{HEADER}{REAL}1,01,2,single,left,60,n/a,device_error,false\n", "1"),
        (f"{HEADER}{REAL}1,01,2,single,left,60,left,voided,false\n", "1"),
        (f"{HEADER}{REAL}2,01,2,practice,left,60,left,ok,false\n", "2"),
        (f"{HEADER}{REAL}1,01,2,blank,none,0,left,ok,false\n", "none"),
        (f"{LEAST[:-1]},study_sha256\n1,left,60,left,a\n2,left,60,left,b\n", "2"),
        (
            f"{LEAST[:-1]},condition\n1,none,0,none,a\n1,left,60,none,a\n1,left,60,left,b\n",
            "2 of 3",
        ),
    ],
)
def test_strict_makes_a_warning_exit_1(
    tmp_path: Path, analyze: Analyze, text: str, number: str
) -> None:
    path = put(tmp_path / "t.csv", text)
    plain, strict = analyze(path), analyze(path, "--strict")
    assert (plain.exit_code, strict.exit_code) == (0, 1)
    assert plain.stdout == strict.stdout
    listed = re.findall(r"^(?:Warnings)? +(\d)  ", plain.stdout, re.MULTILINE)
    assert len(listed) == len(summary(tmp_path / "out")["warnings"])
    assert number in json.dumps(summary(tmp_path / "out")["warnings"])


@pytest.mark.slow
def test_a_session_without_a_table_is_a_warning(tmp_path: Path, analyze: Analyze) -> None:
    table(tmp_path / "s" / "sub-1" / "ses-01" / "trials.csv", REAL)
    lost = tmp_path / "s" / "sub-1" / "ses-02" / "journal.jsonl"
    lost.parent.mkdir()
    lost.touch()
    assert analyze(tmp_path / "s", "--strict").exit_code == 1
    assert "sub-1/ses-02" in json.dumps(summary(tmp_path / "out")["warnings"])


@pytest.mark.slow
def test_a_study_where_nothing_counts_has_no_thresholds(tmp_path: Path, analyze: Analyze) -> None:
    practice = [f"{name},01,2,practice,left,60,left,ok,false\n" for name in "12"]
    assert analyze(table(tmp_path / "t.csv", *practice)).exit_code == 0
    assert set(files(tmp_path / "out")) == BASIC
    excluded = summary(tmp_path / "out")["excluded"]
    assert [[*row.values()] for row in excluded] == [["1", "practice", 1], ["2", "practice", 1]]


def test_the_report_is_opened_on_request(
    tmp_path: Path, analyze: Analyze, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    path = table(tmp_path / "t.csv", REAL)
    short, long = analyze(path), analyze(path, "--open", "--details")
    assert opened == [(tmp_path / "out" / "report.html").as_uri()]
    assert long.stdout.startswith(short.stdout)
    assert len(short.stdout.splitlines()) <= 12 < len(long.stdout.splitlines())
