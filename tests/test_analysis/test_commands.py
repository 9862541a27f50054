"""The command analyze: files, output, exit codes, and that a refusal changes nothing."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from typing import TYPE_CHECKING, Any

import pytest
from filelock import FileLock

import analysis as package
from analysis import ColumnMap, print_analysis, write_analysis
from analysis.commands.analyze import MANY_TABLES
from analysis.definitions import METHODS
from analysis.results.answer import answer
from analysis.results.files import NAMES
from experiment.archive.disk import write_new
from experiment.terms.record import COLUMNS
from tests.test_analysis.shared import EXAMPLES, LEAST, files, put, run, write
from tests.test_analysis.shared import row as trial

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    from analysis.results.tables import Analysis
    from experiment.archive.disk import Disk

    Analyze = Callable[..., Result]

TABLE, MAP = EXAMPLES / "synthetic-trials.csv", EXAMPLES / "synthetic-columns.toml"
EXAMPLE = (TABLE, "--columns", MAP)
HEADER = "participant,session,trial,kind,side,level_vpp,response,status,simulated\n"
REAL, SIMULATED = (f"1,01,1,single,left,60,left,ok,{word}\n" for word in ("false", "true"))
OTHER_SIMULATED = SIMULATED.replace("1", "2", 1)
BASIC = {"levels.csv", "participants.csv", "summary.json", "trials_clean.csv", "report.html"}
BASIC |= {".tactstrip.json", "methods.txt"}


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
    told: dict[str, Any] = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    return told


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
def test_a_folder_of_others_that_nobody_named_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "analysis").mkdir()
    put(tmp_path / "analysis" / "axis.py", "")
    monkeypatch.chdir(tmp_path)
    done = run("analyze", *EXAMPLE, "--no-figures")
    assert (done.exit_code, done.stdout) == (2, "")
    assert "analysis: has files that no analysis wrote, such as axis.py; --out DIR" in done.stderr
    assert [path.name for path in (tmp_path / "analysis").iterdir()] == ["axis.py"]


def test_the_example_gives_every_file(example: Path) -> None:
    absent = {"control.csv", "differences.csv", "d_prime_differences.csv"}  # one condition
    absent |= {name for name in NAMES if name.startswith("participants-")}  # more than eight people
    absent |= {name for name in NAMES if name.endswith(".pdf")}  # with --pdf
    assert set(files(example)) == {*NAMES} - absent


@pytest.mark.slow
def test_a_second_run_gives_the_same_bytes(example: Path, tmp_path: Path) -> None:
    table, names = (shutil.copy(path, tmp_path) for path in (TABLE, MAP))
    for _ in range(2):
        run("analyze", table, "--columns", names, "--out", tmp_path / "out")
        assert files(tmp_path / "out") == files(example)


@pytest.mark.slow
def test_the_tables_have_the_promised_columns(example: Path) -> None:
    promised = {
        "levels.csv": "condition level_vpp detected presented p_min p_mean p_max p_pooled "
        "group_low group_high over_report mislocalised timeouts p_answered",
        "participants.csv": "participant condition level_vpp detected presented p low high",
        "both.csv": "participant noticed presented p low high group_low group_high left_only "
        "right_only",
        "blank.csv": "participant left right both presented p low high group_low group_high",
        "confusion.csv": "condition kind side left right both none timeout invalid presented",
        "thresholds.csv": "participant condition status threshold_vpp threshold_low_vpp "
        "threshold_high_vpp threshold_db threshold_low_db threshold_high_db printed sigma "
        "lapse_rate mle_threshold_vpp mle_sigma mle_lapse_rate deviance deviance_p guess_rate "
        "guess_basis guess_posterior threshold_guess_0_vpp threshold_guess_third_vpp "
        "varied_low_vpp varied_high_vpp varied_printed levels trials threshold_left_um "
        "threshold_right_um displacement_basis",
        "trials_clean.csv": " ".join([*(column.name for column in COLUMNS), "counted", "reason"]),
    }
    for name, columns in promised.items():
        assert files(example)[name].splitlines()[0].decode() == ",".join(columns.split())


@pytest.mark.slow
def test_the_summary_tells_inputs_by_name_and_checksum(tmp_path: Path) -> None:
    run("analyze", *EXAMPLE, "--out", tmp_path, "--seed", 7, "--no-figures")
    told = summary(tmp_path)
    assert list(told) == [
        *("schema", "definitions", "inputs", "versions", "seed", "axis"),
        *("counts", "mark", "answer"),
        *("devices", "altered", "not_compared", "contact", "excluded", "levels"),
        *(
            "both",
            "blank",
            "control",
            "thresholds",
            "groups",
            "differences",
            "sensitivity",
            "d_prime_differences",
            "population",
        ),
        *("choice", "reaction_times", "warnings"),
    ]
    assert told["inputs"] == [
        {"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
        for path in (MAP, TABLE)
    ]
    assert str(tmp_path) not in json.dumps(told)
    assert str(EXAMPLES) not in json.dumps(told)
    assert told["seed"] == 7
    parts = [told["counts"][name] for name in ("trials", "single", "both", "blank", "left_out")]
    assert parts == [370, 300, 20, 50, 0]
    assert [row["detected_any"] >= row["detected"] for row in told["levels"]] == [True] * 5
    for row, level in zip(rows(tmp_path / "levels.csv"), told["levels"], strict=True):
        assert row.pop("condition") == level["condition"]
        assert {name: float(row[name]) for name in row} == {name: level[name] for name in row}
    assert not (tmp_path / "detection.png").exists()


@pytest.mark.slow
def test_definitions_and_documentation_name_every_output_column(example: Path) -> None:
    documented = (EXAMPLES.parent / "statistics.md").read_text(encoding="utf-8")
    defined = {name for key in summary(example)["definitions"] for name in key.split(", ")}
    for path in example.glob("*.csv"):
        for column in {*rows(path)[0]} - {column.name for column in COLUMNS}:
            assert f"`{column}`" in documented, (path.name, column)
            assert column in defined, column


@pytest.mark.slow
def test_split_files_give_the_numbers_of_the_whole(example: Path, tmp_path: Path) -> None:
    header, *lines = TABLE.read_text(encoding="utf-8").splitlines(keepends=True)
    parts = [lines[249:], lines[:99], lines[99:249]]
    paths = [put(tmp_path / f"{n}.csv", header + "".join(part)) for n, part in enumerate(parts)]
    run("analyze", *paths, "--columns", MAP, "--out", tmp_path / "split")
    whole, split = files(example), files(tmp_path / "split")
    for name in ("summary.json", "report.html"):  # they name the files
        del whole[name], split[name]
    assert whole == split


@pytest.mark.slow
def test_the_output_reads_in_80_columns(example: Path) -> None:
    text = example.with_name("stdout").read_text(encoding="utf-8")
    lines = text.splitlines()
    assert max(map(len, lines)) <= 80 + len(str(example))
    assert "\x1b" not in text
    assert " ".join(lines).startswith(summary(example)["answer"][0][:60])
    assert lines[lines.index("") + 1].split()[:2] == ["What", "Value"]
    assert lines[lines.index("") + 1 :].count("") == 2  # in front of counts, and of levels
    assert "Counted: single 300, both 20, blank 50; left out 0." in lines
    assert "answered both, 0.850, group 95 % 0.567-0.940; left" in " ".join(text.split())
    for level in summary(example)["levels"]:
        row = next(line for line in lines if line.split()[:1] == [f"{level['level_vpp']:g}"])
        assert row.split()[1] == f"{level['detected']}/{level['presented']}"
        assert row.split()[-1] == str(level["detected_any"])


@pytest.mark.slow
def test_a_terminal_gets_the_same_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = analysed(tmp_path, LEAST + "1,left,60,left\n1,left,60,none\n")
    plain, terminal = io.StringIO(), io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    for stream in (plain, terminal):
        print_analysis(found, stream)
    assert "1/2" in plain.getvalue()
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


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_the_interval_is_the_one_asked_for(tmp_path: Path, analyze: Analyze, method: str) -> None:
    analyze(table(tmp_path / "t.csv", REAL), "--ci", method)
    assert summary(tmp_path / "out")["definitions"]["ci"] == method


@pytest.mark.slow
def test_results_go_into_the_folder_that_was_given_or_the_current_one(
    two_sessions: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = shutil.copytree(two_sessions, tmp_path / "own")
    for _ in range(2):
        assert run("analyze", own, "--no-figures", "--allow-simulated").exit_code == 0
        assert {*files(own / "analysis")} >= BASIC
    path = table(tmp_path / "study" / "sub-1" / "ses-01" / "trials.csv", REAL)
    options = ("--no-figures", "--columns", put(tmp_path / "names.toml", ""))
    for name, given in (("a file", path), ("a folder made elsewhere", tmp_path / "study")):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        assert run("analyze", given, *options).exit_code == 0
        assert (tmp_path / name / "analysis" / "levels.csv").exists()
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
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"error: {broken}:{line}: column 'kind' holds 'double'")
    assert result.stderr.count("\n") == 1
    assert files(earlier) == before
    assert {path.name for path in tmp_path.iterdir()} == {"broken.csv", "out"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["levels.csv", "summary.json"])
def test_what_is_analysed_is_never_overwritten(tmp_path: Path, analyze: Analyze, name: str) -> None:
    path = table(tmp_path / name, REAL)
    before = path.read_bytes()
    result = analyze(path, "--out", tmp_path)
    assert result.exit_code == 2
    assert "must not hold what is analysed" in result.stderr
    assert path.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["blank.csv", "detection.svg", "summary.json"])
def test_files_of_the_user_are_never_touched(tmp_path: Path, analyze: Analyze, name: str) -> None:
    mine = put(tmp_path / "out" / name, "mine")
    result = analyze(table(tmp_path / "a.csv", REAL))
    assert result.exit_code == 2
    assert f"not of an earlier analysis, got {mine}" in result.stderr
    assert files(tmp_path / "out") == {name: b"mine"}


@pytest.mark.slow
def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path, analyze: Analyze) -> None:
    mine = put(tmp_path / "out", "mine")
    result = analyze(table(tmp_path / "t.csv", REAL))
    assert result.exit_code == 2
    assert "must be a folder" in result.stderr
    assert mine.read_text() == "mine"


@pytest.mark.slow
def test_a_folder_in_the_place_of_a_file_changes_nothing(earlier: Path) -> None:
    (earlier / "detection.svg").unlink()
    before = files(earlier)
    (earlier / "detection.svg").mkdir()
    result = run("analyze", *EXAMPLE, "--out", earlier, "--ci", "jeffreys")
    assert result.exit_code == 2
    assert f"got {earlier / 'detection.svg'}" in result.stderr
    (earlier / "detection.svg").rmdir()
    assert files(earlier) == before


@pytest.mark.slow
def test_failing_to_draw_leaves_old_results(earlier: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = files(earlier)
    monkeypatch.setattr("analysis.results.figures.figures.written", no_room)
    assert run("analyze", *EXAMPLE, "--out", earlier, "--ci", "jeffreys").exit_code == 2
    assert files(earlier) == before
    assert [path.name for path in earlier.parent.iterdir()] == ["out"]


@pytest.mark.slow
def test_a_full_disk_names_the_file_and_leaves_the_old_results(
    earlier: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files(earlier)

    def full(path: Path, content: bytes, disk: Disk) -> None:
        if path.name == "both.csv":
            no_room()
        write_new(path, content, disk)

    monkeypatch.setattr("analysis.results.files.write_new", full)
    result = run("analyze", *EXAMPLE, "--out", earlier, "--no-figures", "--ci", "jeffreys")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"error: {earlier / 'both.csv'}: No space left on device")
    assert files(earlier) == before


@pytest.mark.slow
def test_a_folder_that_was_made_for_nothing_is_removed(
    tmp_path: Path, analyze: Analyze, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = table(tmp_path / "t.csv", REAL)
    monkeypatch.setattr("analysis.results.files.write_new", no_room)
    assert analyze(path).exit_code == 2
    assert {one.name for one in tmp_path.iterdir()} == {"t.csv", "maps"}


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


@pytest.mark.slow
def test_nothing_is_written_beside_the_folder(
    tmp_path: Path, analyze: Analyze, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[object] = []

    class Recorded(tempfile.TemporaryDirectory[str]):
        def __init__(self, prefix: str, dir: Path) -> None:  # noqa: A002 (its name in the library)
            used.append(dir)
            super().__init__(prefix=prefix, dir=dir)

    monkeypatch.setattr("analysis.results.files.TemporaryDirectory", Recorded)
    assert analyze(table(tmp_path / "t.csv", REAL)).exit_code == 0
    assert used == [tmp_path / "out"]


@pytest.mark.slow
def test_a_name_that_is_not_utf8_is_told_in_ascii(tmp_path: Path, analyze: Analyze) -> None:
    assert analyze(table(tmp_path / os.fsdecode(b"t\xff.csv"), REAL)).exit_code == 0
    assert "t\\udcff.csv" in [file["name"] for file in summary(tmp_path / "out")["inputs"]]


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
    result = run("analyze", *arguments, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert words in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_simulated_and_real_sessions_are_not_mixed(tmp_path: Path, analyze: Analyze) -> None:
    paths = [table(tmp_path / "1.csv", REAL), table(tmp_path / "2.csv", OTHER_SIMULATED)]
    result = analyze(*paths)
    assert result.exit_code == 2
    assert "--allow-simulated" in result.stderr
    assert result.stderr.startswith(f"error: {paths[1]}:2: a simulated trial, and others are real")
    assert not (tmp_path / "out").exists()
    result = analyze(*paths, "--allow-simulated")
    assert result.exit_code == 0
    assert result.stdout.startswith("Simulated and real participants mixed.")
    told = ["1 of 2 trials are simulated, the others real"]
    assert summary(tmp_path / "out")["warnings"] == told


@pytest.mark.slow
def test_tables_of_a_mixture_say_whose_a_row_is(tmp_path: Path, analyze: Analyze) -> None:
    path, out = table(tmp_path / "t.csv", REAL, OTHER_SIMULATED), tmp_path / "out"
    assert analyze(path).stderr.startswith(f"error: {path}:3: a simulated trial")
    assert analyze(path, "--allow-simulated").exit_code == 0
    people = [(row["participant"], row["simulated"]) for row in rows(out / "participants.csv")]
    assert people == [("1", "false"), ("2", "true")]
    assert [row["simulated"] for row in rows(out / "levels.csv")] == ["mixed"]


@pytest.mark.slow
def test_simulated_sessions_alone_are_marked_and_accepted(tmp_path: Path, analyze: Analyze) -> None:
    result = analyze(table(tmp_path / "t.csv", SIMULATED), "--strict")
    assert result.exit_code == 0
    assert result.stdout.startswith("Simulated participants.")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{HEADER}{REAL}1,01,2,single,left,60,n/a,device_error,false\n", "out: device_error 1"),
        (f"{HEADER}{REAL}1,01,2,single,left,60,left,voided,false\n", "without a valid attempt: 1"),
        (f"{HEADER}{REAL}2,01,2,practice,left,60,left,ok,false\n", "counts of participant 2"),
        (f"{HEADER}{REAL}1,01,2,blank,none,0,left,ok,false\n", 'blank trials without "none" as'),
        (f"{LEAST[:-1]},study_sha256\n1,left,60,left,a\n2,left,60,left,b\n", "2 different studies"),
        (
            f"{LEAST[:-1]},condition\n1,none,0,none,a\n1,left,60,none,a\n1,left,60,left,b\n",
            '"none" is known to be an answer in 2 of 3 trials only',
        ),
    ],
)
def test_strict_makes_a_warning_exit_1(
    tmp_path: Path, analyze: Analyze, text: str, words: str
) -> None:
    path = put(tmp_path / "t.csv", text)
    plain, strict = analyze(path), analyze(path, "--strict")
    assert (plain.exit_code, strict.exit_code) == (0, 1)
    assert plain.stdout == strict.stdout
    assert words in " ".join(plain.stdout.split())
    assert any(words in warning for warning in summary(tmp_path / "out")["warnings"])


@pytest.mark.slow
def test_what_is_left_out_is_printed_with_its_reason(tmp_path: Path, analyze: Analyze) -> None:
    practice = [f"{name},01,2,practice,left,60,left,ok,false\n" for name in "12"]
    result = analyze(table(tmp_path / "t.csv", REAL, *practice))
    assert "Left out, practice: 2 trials (1 1, 2 1)." in result.stdout


@pytest.mark.slow
def test_a_session_without_a_table_is_a_warning(tmp_path: Path, analyze: Analyze) -> None:
    table(tmp_path / "s" / "sub-1" / "ses-01" / "trials.csv", REAL)
    (tmp_path / "s" / "sub-1" / "ses-02").mkdir()
    result = analyze(tmp_path / "s", "--strict")
    assert result.exit_code == 1
    told = " ".join(result.stdout.split())
    assert "session sub-1/ses-02 has no trials.csv; nothing was recorded in it" in told


@pytest.mark.slow
def test_a_study_where_nothing_counts_says_so(tmp_path: Path) -> None:
    path = table(tmp_path / "t.csv", REAL.replace("single", "practice"))
    names = put(tmp_path / "names.toml", "")
    result = run("analyze", path, "--columns", names, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert "no trial with a single stimulus counts" in result.stdout
    assert set(files(tmp_path / "out")) == BASIC


@pytest.mark.slow
def test_conditions_are_printed_one_by_one(tmp_path: Path) -> None:
    each = "1,both,60,both,{0}\n1,left,60,left,{0}\n"
    header = "participant,side,level_vpp,response,condition\n"
    shown = io.StringIO()
    print_analysis(analysed(tmp_path, header + each.format("a") + each.format("b")), shown)
    assert "Condition a\n" in shown.getvalue()
    assert "Both-finger trials in condition b: 1/1" in shown.getvalue()
    assert files(tmp_path / "out")["both.csv"].startswith(b"condition,participant,")


@pytest.mark.parametrize("wrong", [True, -1])
def test_a_seed_is_a_whole_number(tmp_path: Path, wrong: int) -> None:
    with pytest.raises(ValueError, match="seed"):
        analysed(tmp_path, LEAST + "1,left,60,left\n", seed=wrong)
    assert not (tmp_path / "out").exists()


@pytest.mark.process
def test_the_help_imports_no_numpy_pandas_rich_or_matplotlib() -> None:
    code = (
        "import sys\nfrom analysis.commands.analyze import analyze\n"
        "analyze(['--help'], standalone_mode=False)\n"
        "sys.exit(bool({'numpy', 'pandas', 'rich', 'matplotlib'} & set(sys.modules)))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


@pytest.mark.slow
def test_a_population_is_fitted_only_on_request(example: Path, tmp_path: Path) -> None:
    assert "of the population" not in example.with_name("stdout").read_text(encoding="utf-8")
    assert summary(example)["population"] == []
    result = run("analyze", *EXAMPLE, "--no-figures", "--out", tmp_path, "--population")
    assert "Threshold of the population: " in result.stdout
    [one] = summary(tmp_path)["population"]
    low, high = one["threshold_limits_vpp"]
    assert low < one["threshold_vpp"] < high
    report = (tmp_path / "report.html").read_text()
    assert f"{one['threshold_vpp']:.1f} V ({low:.1f} to {high:.1f})" in report
    spread = f"{20 * one['between_sd']:.1f} dB"
    assert f">{spread}<" in report.replace("<bdi>", "").replace("</bdi>", "")
    terminal = " ".join(result.stdout.split())
    assert f"between people {spread} (SD)" in terminal
    assert "It leaves out lapses and guesses" in terminal


@pytest.mark.slow
def test_a_population_in_another_unit_says_which(tmp_path: Path) -> None:
    trials = put(tmp_path / "t.csv", LEAST + "1,left,60,left\n1,left,90,left\n")
    names = put(tmp_path / "map.toml", '[axis]\nunit = "um"\n')
    out = tmp_path / "out"
    run("analyze", trials, "--columns", names, "--no-figures", "--population", "--out", out)
    [one] = summary(out)["population"]
    assert (one["unit"], one["threshold"], one["threshold_limits"]) == ("um", None, [None, None])
    assert not [name for name in one if name.endswith("_vpp")]


@pytest.mark.slow
def test_a_population_that_cannot_be_fitted_has_a_reason(tmp_path: Path) -> None:
    text = LEAST + "1,left,60,left\n1,left,90,left\n"
    analysis = analysed(tmp_path, text, population=True)
    [one] = analysis.population
    assert one.reason == "one participant tells nothing of others"
    # beside the threshold that there is, not only behind the tables
    assert ("Threshold of the population", "not fitted", one.reason) in answer(analysis).rows
    shown = io.StringIO()
    print_analysis(analysis, shown)
    told = " ".join(shown.getvalue().split())
    assert f"Threshold of the population: not fitted ({one.reason})." in told
    assert "It leaves out lapses and guesses" not in told
    assert summary(tmp_path / "out")["population"][0]["threshold_vpp"] is None
    assert one.reason in (tmp_path / "out" / "report.html").read_text()


def test_an_unknown_name_of_the_package_is_refused() -> None:
    name = "wald"
    with pytest.raises(AttributeError, match="analysis attribute wald"):
        getattr(package, name)
    assert all(getattr(package, name) is not None for name in package.__all__)


@pytest.mark.slow
def test_a_bar_is_shown_on_a_terminal_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [
        put(tmp_path / f"{number}.csv", f"{LEAST}p{number},left,60,left\n")
        for number in range(MANY_TABLES)
    ]
    for is_terminal in (False, True):
        stream = io.StringIO()
        monkeypatch.setattr(stream, "isatty", lambda shown=is_terminal: shown)
        monkeypatch.setattr(sys, "stderr", stream)
        write_analysis(paths, tmp_path / "out", columns=ColumnMap(), figures=False, bar=True)
        assert ("100%" in stream.getvalue()) == is_terminal
        assert bool(stream.getvalue()) == is_terminal


@pytest.mark.slow
def test_tables_of_several_kinds_of_device_say_which(tmp_path: Path, analyze: Analyze) -> None:
    kinds = {"1": "real", "2": "emulated", "3": "emulated"}
    paths = [
        write(
            tmp_path / f"{who}.csv", trial(participant=who, device_kind=kind, simulated=who == "2")
        )
        for who, kind in kinds.items()
    ]
    out = tmp_path / "out"
    assert analyze(*paths, "--out", out, "--no-figures").exit_code == 2
    result = analyze(*paths, "--out", out, "--no-figures", "--allow-simulated")
    assert result.exit_code == 0, result.output
    assert "Practice without a device: 1 of 3" in " ".join(result.stdout.split())
    people = {line["participant"]: line["device_kind"] for line in rows(out / "participants.csv")}
    assert people == kinds
    assert [line["device_kind"] for line in rows(out / "levels.csv")] == ["mixed"]
    summary = json.loads((out / "summary.json").read_bytes())
    assert summary["devices"] == {"emulated": 2, "real": 1}


def test_pdf_without_figures_is_refused(analyze: Analyze) -> None:
    result = analyze("--pdf", "t.csv")
    assert result.exit_code == 2
    assert "--pdf writes figures: leave --no-figures out" in result.stderr
