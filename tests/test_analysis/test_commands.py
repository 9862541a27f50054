"""The command analyze: files, output, exit codes, and that a refusal changes nothing."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner, Result
from filelock import FileLock

from analysis import ColumnMap, print_analysis, write_analysis
from analysis.commands.analyze import MANY_TABLES, analyze
from analysis.definitions import METHODS
from analysis.results.files import NAMES
from experiment.archive.disk import write_new
from experiment.terms.record import COLUMNS

if TYPE_CHECKING:
    from experiment.archive.disk import Disk

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
TABLE, MAP = EXAMPLES / "synthetic-trials.csv", EXAMPLES / "synthetic-columns.toml"
HEADER = "participant,session,trial,kind,side,level_vpp,response,status,simulated\n"
ONE = "1,01,{},single,left,60,left,ok,{}\n"


READ = {column.name for column in COLUMNS}


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(analyze, [str(a) for a in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.output
    return result


def table(path: Path, *rows: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(HEADER + "".join(rows), encoding="utf-8")
    return path


@pytest.fixture
def names(tmp_path: Path) -> Path:
    """An empty map: the tables of these tests have our names, but not all our columns."""
    path = tmp_path / "names.toml"
    path.write_text("", encoding="utf-8")
    return path


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.slow
def test_the_example_gives_every_file_and_exit_code_0(tmp_path: Path) -> None:
    result = run(TABLE, "--columns", MAP, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert set(files(tmp_path / "out")) == {*NAMES} - {"control.csv"}  # it has no such trials
    assert result.stderr == ""


@pytest.mark.slow
def test_a_second_run_gives_the_same_bytes(tmp_path: Path) -> None:
    elsewhere = tmp_path / "else" / "where"
    elsewhere.mkdir(parents=True)
    copied = [elsewhere / path.name for path in (TABLE, MAP)]
    for path, copy in zip((TABLE, MAP), copied, strict=True):
        copy.write_bytes(path.read_bytes())
    run(TABLE, "--columns", MAP, "--out", tmp_path / "1")
    run(TABLE, "--columns", MAP, "--out", tmp_path / "1")
    run(copied[0], "--columns", copied[1], "--out", tmp_path / "2")
    assert files(tmp_path / "1") == files(tmp_path / "2")


@pytest.mark.slow
def test_the_tables_have_the_promised_columns(tmp_path: Path) -> None:
    run(TABLE, "--columns", MAP, "--out", tmp_path, "--no-figures")
    promised = {
        "levels.csv": "condition level_vpp detected presented p_min p_mean p_max p_pooled "
        "group_low group_high over_report mislocalised timeouts p_answered",
        "participants.csv": "participant condition level_vpp detected presented p low high",
        "both.csv": "participant noticed presented p low high left_only right_only",
        "blank.csv": "participant left right both presented p low high",
        "confusion.csv": "condition kind side left right both none timeout invalid presented",
        "thresholds.csv": "participant condition status threshold_vpp threshold_low_vpp "
        "threshold_high_vpp threshold_db threshold_low_db threshold_high_db printed sigma "
        "lapse_rate mle_threshold_vpp mle_sigma mle_lapse_rate deviance deviance_p guess_rate "
        "guess_basis threshold_guess_0_vpp threshold_guess_third_vpp levels trials",
        "trials_clean.csv": " ".join([*(column.name for column in COLUMNS), "counted", "reason"]),
    }
    for name, columns in promised.items():
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert text.splitlines()[0] == ",".join(columns.split())
    assert not (tmp_path / "detection.png").exists()


def test_the_summary_tells_inputs_by_name_and_checksum(tmp_path: Path) -> None:
    run(TABLE, "--columns", MAP, "--out", tmp_path, "--seed", 7, "--no-figures")
    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    summary = json.loads(text)
    assert list(summary) == [
        *("schema", "definitions", "inputs", "versions", "seed", "counts", "excluded", "levels"),
        *("both", "blank", "control", "thresholds", "groups", "population", "choice"),
        *("reaction_times", "warnings"),
    ]
    assert summary["inputs"] == [
        {"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in (MAP, TABLE)
    ]
    assert str(EXAMPLES) not in text
    assert str(tmp_path) not in text
    counts = summary["counts"]
    assert summary["seed"] == 7
    parts = [counts[name] for name in ("single", "both", "blank", "left_out")]
    assert (counts["trials"], parts) == (370, [300, 20, 50, 0])
    levels = list(csv.DictReader(io.StringIO((tmp_path / "levels.csv").read_text())))
    assert [row["detected_any"] >= row["detected"] for row in summary["levels"]] == [True] * 5
    for row, told in zip(levels, summary["levels"], strict=True):
        assert {name: float(row[name]) for name in row if name != "condition"} == {
            name: told[name] for name in row if name != "condition"
        }


@pytest.mark.slow
def test_definitions_and_documentation_name_every_output_column(tmp_path: Path) -> None:
    run(TABLE, "--columns", MAP, "--out", tmp_path, "--no-figures")
    documented = (EXAMPLES.parent / "statistics.md").read_text(encoding="utf-8")
    told = json.loads((tmp_path / "summary.json").read_text())["definitions"]
    defined = {name for key in told for name in key.split(", ")}
    for path in tmp_path.glob("*.csv"):
        for column in path.read_text().splitlines()[0].split(","):
            if column not in READ:
                assert f"`{column}`" in documented, (path.name, column)
                assert column in defined, column


@pytest.mark.slow
def test_split_files_give_the_numbers_of_the_whole(tmp_path: Path) -> None:
    lines = TABLE.read_text(encoding="utf-8").splitlines(keepends=True)
    parts = [lines[1:100], lines[100:250], lines[250:]]
    for number, part in enumerate(parts):
        (tmp_path / f"{number}.csv").write_text(lines[0] + "".join(part))
    run(TABLE, "--columns", MAP, "--out", tmp_path / "whole")
    run(*(tmp_path / f"{n}.csv" for n in (2, 0, 1)), "--columns", MAP, "--out", tmp_path / "split")
    whole, split = files(tmp_path / "whole"), files(tmp_path / "split")
    for name in ("summary.json", "report.html"):  # they name the files
        del whole[name], split[name]
    assert whole == split


@pytest.mark.slow
def test_the_output_reads_in_80_columns(tmp_path: Path) -> None:
    result = run(TABLE, "--columns", MAP, "--out", tmp_path / "out", "--no-figures")
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80 + len(str(tmp_path))
    assert "\x1b" not in result.stdout
    assert lines[1] == "Counted: single 300, both 20, blank 50; left out 0."
    assert "ignores participants" in " ".join(result.stdout.split())
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    for level in summary["levels"]:
        row = next(line for line in lines if line.split()[:1] == [f"{level['level_vpp']:g}"])
        assert row.split()[1] == f"{level['detected']}/{level['presented']}"
        assert row.split()[-1] == str(level["detected_any"])


@pytest.mark.slow
def test_a_terminal_gets_the_same_text(tmp_path: Path) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    analysis = write_analysis([TABLE], tmp_path, columns=ColumnMap(**map_of_example()))
    plain, terminal = io.StringIO(), Terminal()
    print_analysis(analysis, plain)
    print_analysis(analysis, terminal)
    assert plain.getvalue().count("/60 ") == 5
    assert terminal.getvalue() == plain.getvalue()


@pytest.mark.process
def test_a_closed_standard_output_is_no_failure(tmp_path: Path) -> None:
    code = "from analysis.commands.analyze import analyze; analyze()"
    command = (
        f"'{sys.executable}' -c '{code}' '{TABLE}' --columns '{MAP}' --no-figures --out out >&-"
    )
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert (tmp_path / "out" / "levels.csv").exists()


def map_of_example() -> dict[str, Any]:
    return {"values": {"kind": {"null": "blank"}}}


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_the_interval_is_the_one_asked_for(tmp_path: Path, method: str) -> None:
    run(TABLE, "--columns", MAP, "--out", tmp_path, "--ci", method, "--no-figures")
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["definitions"]["ci"] == method


def test_results_go_into_the_folder_that_was_given(tmp_path: Path, names: Path) -> None:
    study = tmp_path / "study"
    table(study / "sub-1" / "ses-01" / "trials.csv", ONE.format(1, "false"))
    assert run(study, "--columns", names, "--no-figures").exit_code == 0
    assert (study / "analysis" / "levels.csv").exists()
    before = files(study / "analysis")
    assert run(study, "--columns", names, "--no-figures").exit_code == 0
    assert files(study / "analysis") == before


def test_results_of_files_go_into_the_current_folder(
    tmp_path: Path, names: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = table(tmp_path / "t.csv", ONE.format(1, "false"))
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert run(path, "--columns", names, "--no-figures").exit_code == 0
    assert (tmp_path / "here" / "analysis" / "levels.csv").exists()


@pytest.mark.slow
def test_tables_of_older_data_do_not_stay(tmp_path: Path, names: Path) -> None:
    run(TABLE, "--columns", MAP, "--out", tmp_path / "out")
    (tmp_path / "out" / "notes.txt").write_text("mine")
    run(table(tmp_path / "t.csv", ONE.format(1, "false")), "--columns", names,
        "--out", tmp_path / "out", "--no-figures")  # fmt: skip
    assert set(files(tmp_path / "out")) == {
        *("levels.csv", "participants.csv", "summary.json", "notes.txt", "trials_clean.csv"),
        *("thresholds.csv", "confusion.csv", "report.html", ".tactstrip.json"),
    }


@pytest.mark.slow
def test_a_refusal_is_one_line_with_exit_code_2_and_changes_nothing(tmp_path: Path) -> None:
    run(TABLE, "--columns", MAP, "--out", tmp_path / "out", "--no-figures")
    before = files(tmp_path / "out")
    broken = tmp_path / "broken.csv"
    broken.write_text(TABLE.read_text().replace("S03,1,40,single", "S03,1,40,double"))
    result = run(TABLE, broken, "--columns", MAP, "--out", tmp_path / "out")
    line = broken.read_text()[: broken.read_text().index("double")].count("\n") + 1
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {broken}:{line}: column 'kind' holds 'double'")
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert files(tmp_path / "out") == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["broken.csv", "out"]


@pytest.mark.parametrize("name", ["levels.csv", "summary.json"])
def test_what_is_analysed_is_never_overwritten(tmp_path: Path, names: Path, name: str) -> None:
    path = table(tmp_path / name, ONE.format(1, "false"))
    before = path.read_bytes()
    result = run(path, "--columns", names, "--out", tmp_path)
    assert result.exit_code == 2
    assert "must not hold what is analysed" in result.stderr
    assert path.read_bytes() == before


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    result = run(TABLE, "--columns", MAP, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "must be a folder" in result.stderr
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.slow
def test_a_failure_while_drawing_leaves_the_old_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    columns = ColumnMap(**map_of_example())
    write_analysis([TABLE], tmp_path / "out", columns=columns)
    before = files(tmp_path / "out")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("analysis.results.figures.figures.written", fail)
    with pytest.raises(OSError, match="No space left"):
        write_analysis([TABLE], tmp_path / "out", columns=columns, ci="jeffreys")
    assert files(tmp_path / "out") == before
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.mark.slow
def test_a_full_disk_names_the_file_and_leaves_the_old_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = (TABLE, "--columns", MAP, "--out", tmp_path / "out", "--no-figures")
    run(*options)
    before = files(tmp_path / "out")

    def full(path: Path, content: bytes, disk: Disk) -> None:
        if path.name == "both.csv":
            raise OSError(28, "No space left on device")
        write_new(path, content, disk)

    monkeypatch.setattr("analysis.results.files.write_new", full)
    result = run(*options, "--ci", "jeffreys")
    assert result.exit_code == 2
    target = tmp_path / "out" / "both.csv"
    assert result.stderr.startswith(f"error: {target}: No space left on device")
    assert files(tmp_path / "out") == before


def test_a_folder_that_was_made_for_nothing_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, *_: object) -> None:
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr("analysis.results.files.write_new", full)
    assert run(TABLE, "--columns", MAP, "--out", tmp_path / "out").exit_code == 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_what_a_killed_analysis_left_is_removed_and_nothing_else(tmp_path: Path) -> None:
    left, writing, mine = (tmp_path / f".analysis-{name}" for name in ("dead", "alive", "notes"))
    for folder, name in ((left, "both.csv"), (writing, "both.csv"), (mine, "notes.txt")):
        folder.mkdir()
        (folder / name).touch()
    with FileLock(writing / "lock"):
        run(TABLE, "--columns", MAP, "--out", tmp_path, "--no-figures")
    assert {path for path in tmp_path.iterdir() if path.is_dir()} == {writing, mine}
    assert (mine / "notes.txt").exists()


@pytest.mark.slow
def test_nothing_is_written_beside_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[object] = []

    class Recorded(tempfile.TemporaryDirectory[str]):
        def __init__(self, prefix: str, dir: Path) -> None:  # noqa: A002 (its name in the library)
            used.append(dir)
            super().__init__(prefix=prefix, dir=dir)

    monkeypatch.setattr("analysis.results.files.TemporaryDirectory", Recorded)
    run(TABLE, "--columns", MAP, "--out", tmp_path / "out", "--no-figures")
    assert used == [tmp_path / "out"]


@pytest.mark.parametrize("name", ["blank.csv", "detection.svg", "summary.json"])
def test_files_of_the_user_are_never_replaced_or_removed(
    tmp_path: Path, names: Path, name: str
) -> None:
    path = table(tmp_path / "a.csv", ONE.format(1, "false"))
    (tmp_path / name).write_text("mine")
    before = files(tmp_path)
    result = run(path, "--columns", names, "--no-figures", "--out", tmp_path)
    assert result.exit_code == 2
    assert f"not of an earlier analysis, got {tmp_path / name}" in result.stderr
    assert files(tmp_path) == before


@pytest.mark.slow
def test_a_folder_in_the_place_of_a_file_changes_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(TABLE, "--columns", MAP, "--out", out, "--no-figures")
    before = files(out)
    (out / "detection.svg").mkdir()
    result = run(TABLE, "--columns", MAP, "--out", out, "--ci", "jeffreys")
    assert result.exit_code == 2
    assert f"got {out / 'detection.svg'}" in result.stderr
    (out / "detection.svg").rmdir()
    assert files(out) == before


def test_a_name_that_is_not_utf8_is_told_in_ascii(tmp_path: Path, names: Path) -> None:
    path = table(tmp_path / os.fsdecode(b"t\xff.csv"), ONE.format(1, "false"))
    result = run(path, "--columns", names, "--out", tmp_path / "out", "--no-figures")
    assert result.exit_code == 0
    told = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))["inputs"]
    assert "t\\udcff.csv" in [file["name"] for file in told]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "PATH"),
        ([TABLE, "--ci", "wald"], "wald"),
        ([TABLE, "--seed", "-1"], "-1"),
        ([TABLE, "--columns", "no/such.toml"], "no/such.toml"),
        (["no/such.csv"], "error: no/such.csv: no such file or folder"),
        ([TABLE], "a table made elsewhere needs --columns MAP.toml"),
    ],
)
def test_bad_usage_has_exit_code_2(tmp_path: Path, arguments: list[object], words: str) -> None:
    result = run(*arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert words in result.stderr
    assert not (tmp_path / "out").exists()


def test_simulated_and_real_sessions_are_not_mixed(tmp_path: Path, names: Path) -> None:
    paths = [
        table(tmp_path / "1.csv", ONE.format(1, "false")),
        table(tmp_path / "2.csv", ONE.format(2, "true")),
    ]
    options = ("--columns", names, "--out", tmp_path / "out", "--no-figures")
    result = run(*paths, *options)
    assert result.exit_code == 2
    assert "--allow-simulated" in result.stderr
    assert result.stderr.startswith(f"error: {paths[1]}:2: a simulated trial, and others are real")
    assert not (tmp_path / "out").exists()
    result = run(*paths, *options, "--allow-simulated")
    assert result.exit_code == 0
    assert result.stdout.startswith("Simulated and real participants mixed.")
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["warnings"] == [
        "1 of 2 trials are simulated, the others real"
    ]


def test_every_table_of_a_mixture_says_whose_trials_a_row_is_of(
    tmp_path: Path, names: Path
) -> None:
    rows = ONE.format(1, "false"), ONE.format(1, "true").replace("1", "2", 1)
    path, out = table(tmp_path / "t.csv", *rows), tmp_path / "out"
    options = ("--columns", names, "--out", out, "--no-figures", "--allow-simulated")
    assert run(path, *options).exit_code == 0
    with (out / "participants.csv").open(newline="") as stream:
        assert [(r["participant"], r["simulated"]) for r in csv.DictReader(stream)] == [
            ("1", "false"),
            ("2", "true"),
        ]
    with (out / "levels.csv").open(newline="") as stream:
        assert [r["simulated"] for r in csv.DictReader(stream)] == ["mixed"]


def test_simulated_and_real_rows_in_one_file_have_a_line(tmp_path: Path, names: Path) -> None:
    path = table(tmp_path / "t.csv", ONE.format(1, "false"), ONE.format(2, "true"))
    result = run(path, "--columns", names, "--out", tmp_path / "out", "--no-figures")
    assert result.stderr.startswith(f"error: {path}:3: a simulated trial")


def test_blank_trials_are_judged_by_their_own_condition(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    header = "participant,side,level_vpp,response,condition\n"
    path.write_text(header + "1,none,0,none,a\n1,left,60,none,a\n1,left,60,left,b\n")
    analysis = write_analysis([path], tmp_path / "o", columns=ColumnMap(), figures=False)
    assert analysis.warnings == ('"none" is known to be an answer in 2 of 3 trials only',)
    assert analysis.detected_any is None


def test_simulated_sessions_alone_are_marked_and_accepted(tmp_path: Path, names: Path) -> None:
    path = table(tmp_path / "t.csv", ONE.format(1, "true"))
    result = run(path, "--columns", names, "--out", tmp_path / "out", "--strict", "--no-figures")
    assert result.exit_code == 0
    assert result.stdout.startswith("Simulated participants.")


WARNED = [
    ("1,01,2,single,left,60,n/a,device_error,false\n", "1 trials are left out: device_error 1"),
    ("1,01,2,single,left,60,left,voided,false\n", "session 01: trials without a valid attempt: 1"),
    ("2,01,2,practice,left,60,left,ok,false\n", "no trial counts of participant 2"),
    ("1,01,2,blank,none,0,left,ok,false\n", 'blank trials without "none" as an answer'),
]


@pytest.mark.slow
@pytest.mark.parametrize(("row", "words"), WARNED)
def test_strict_turns_a_warning_into_exit_code_1(
    tmp_path: Path, names: Path, row: str, words: str
) -> None:
    path = table(tmp_path / "t.csv", ONE.format(1, "false"), row)
    options = (path, "--columns", names, "--out", tmp_path / "out", "--no-figures")
    plain, strict = run(*options), run(*options, "--strict")
    assert (plain.exit_code, strict.exit_code) == (0, 1)
    assert plain.stdout == strict.stdout
    assert words in " ".join(plain.stdout.split())
    told = json.loads((tmp_path / "out" / "summary.json").read_text())["warnings"]
    assert any(words in warning for warning in told)


def test_what_is_left_out_is_printed_with_its_reason(tmp_path: Path, names: Path) -> None:
    rows = [ONE.format(1, "false"), "1,01,2,practice,left,60,left,ok,false\n"]
    path = table(tmp_path / "t.csv", *rows, "2,01,2,practice,left,60,left,ok,false\n")
    result = run(path, "--columns", names, "--out", tmp_path / "out", "--no-figures")
    assert "Left out, practice: 2 trials (1 1, 2 1)." in result.stdout


def test_a_session_without_a_table_is_a_warning(tmp_path: Path, names: Path) -> None:
    table(tmp_path / "s" / "sub-1" / "ses-01" / "trials.csv", ONE.format(1, "false"))
    (tmp_path / "s" / "sub-1" / "ses-02").mkdir()
    result = run(tmp_path / "s", "--columns", names, "--no-figures", "--strict")
    assert result.exit_code == 1
    assert "session sub-1/ses-02 has no trials.csv; tactstrip export DIR" in result.stdout


def test_a_study_where_nothing_counts_says_so(tmp_path: Path, names: Path) -> None:
    path = table(tmp_path / "t.csv", "1,01,1,practice,left,60,left,ok,false\n")
    result = run(path, "--columns", names, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert "no trial with a single stimulus counts" in result.stdout
    assert set(files(tmp_path / "out")) == {
        *("levels.csv", "participants.csv", "summary.json", "trials_clean.csv", "report.html"),
        ".tactstrip.json",
    }


def test_different_studies_in_one_analysis_are_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text(
        "participant,side,level_vpp,response,study_sha256\n1,left,60,left,a\n2,left,60,left,b\n"
    )
    analysis = write_analysis([path], tmp_path / "o", columns=ColumnMap(), figures=False)
    assert analysis.warnings == ("the trials come from 2 different studies (study_sha256)",)


def test_conditions_are_printed_one_by_one(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rows = "1,both,60,both,{0}\n1,left,60,left,{0}\n"
    path.write_text(
        "participant,side,level_vpp,response,condition\n" + rows.format("a") + rows.format("b")
    )
    analysis = write_analysis([path], tmp_path / "o", columns=ColumnMap(), figures=False)
    shown = io.StringIO()
    print_analysis(analysis, shown)
    assert "Condition a\n" in shown.getvalue()
    assert "Both-finger trials in condition b: 1/1" in shown.getvalue()
    assert (tmp_path / "o" / "both.csv").read_text().startswith("condition,participant,")


@pytest.mark.parametrize(("wrong", "words"), [(True, "seed"), (-1, "seed")])
def test_a_seed_is_a_whole_number(tmp_path: Path, wrong: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        write_analysis([TABLE], tmp_path / "o", columns=ColumnMap(**map_of_example()), seed=wrong)
    assert not (tmp_path / "o").exists()


@pytest.mark.process
def test_the_help_imports_no_numpy_pandas_rich_or_matplotlib() -> None:
    code = (
        "import sys\nfrom analysis.commands.analyze import analyze\n"
        "analyze(['--help'], standalone_mode=False)\n"
        "sys.exit(bool({'numpy', 'pandas', 'rich', 'matplotlib'} & set(sys.modules)))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.mark.slow
def test_a_population_is_fitted_only_on_request(tmp_path: Path) -> None:
    options = (TABLE, "--columns", MAP, "--no-figures", "--out", tmp_path)
    assert "of the population" not in run(*options).stdout
    assert json.loads((tmp_path / "summary.json").read_text())["population"] == []
    assert "Threshold of the population: " in run(*options, "--population").stdout
    [one] = json.loads((tmp_path / "summary.json").read_text())["population"]
    low, high = one["threshold_limits_vpp"]
    assert low < one["threshold_vpp"] < high
    report = (tmp_path / "report.html").read_text()
    assert f"{one['threshold_vpp']:.1f} V ({low:.1f} to {high:.1f})" in report


def test_a_population_that_cannot_be_fitted_has_a_reason(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("participant,side,level_vpp,response\n1,left,60,left\n1,left,90,left\n")
    out = tmp_path / "out"
    analysis = write_analysis([path], out, columns=ColumnMap(), figures=False, population=True)
    [one] = analysis.population
    assert one.reason
    assert json.loads((out / "summary.json").read_text())["population"][0]["threshold_vpp"] is None
    assert one.reason in (out / "report.html").read_text()


def test_an_unknown_name_of_the_package_is_refused() -> None:
    import analysis

    name = "wald"
    with pytest.raises(AttributeError, match="analysis attribute wald"):
        getattr(analysis, name)
    assert all(getattr(analysis, name) is not None for name in analysis.__all__)


def test_a_bar_is_shown_on_a_terminal_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "participant,side,level_vpp,response\n"
    for number in range(MANY_TABLES):
        (tmp_path / f"{number}.csv").write_text(f"{text}p{number},left,60,left\n")
    for is_terminal in (False, True):
        stream = io.StringIO()
        monkeypatch.setattr(stream, "isatty", lambda shown=is_terminal: shown)
        monkeypatch.setattr(sys, "stderr", stream)
        write_analysis(
            sorted(tmp_path.glob("*.csv")), tmp_path / "out", columns=ColumnMap(),
            figures=False, bar=True,
        )  # fmt: skip
        assert ("100%" in stream.getvalue()) == is_terminal
        assert bool(stream.getvalue()) == is_terminal
