"""The command line as a whole: instant help, one line for every error, one guard."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click
import pytest
from click.shell_completion import ShellComplete

import tactstrip
from device import LinkError
from tactstrip import COMMANDS, PACKAGES, main
from tests.plates import on_paper_plate

if TYPE_CHECKING:
    from tests.conftest import Run

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


@pytest.mark.parametrize(
    "arguments",
    [
        "nonsense",
        "--nonsense",
        "demo",
        "run",
        "run study.toml --participant 01 --driver none",
        "analyze",
        "run nowhere.toml --participant 01 --responder simulated",
        "run nowhere.toml --participant no/slash",
        "run nowhere.toml --participant all",
        "check nowhere.toml",
        "check .",
        "dry-run nowhere.toml",
        "dry-run --participants 0",
        "analyze nowhere",
        "audit",
        "audit nowhere.csv",
        "audit .",
        "export nowhere",
        "withdraw nowhere --participant 01",
    ],
)
def test_bad_input_is_one_line_on_stderr_and_exit_2(
    arguments: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*arguments.split())
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    assert len(result.stderr.splitlines()) == 1
    assert result.stderr.startswith("error: ")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("study", "exit_code", "key"),
    [
        ("[device]\nceiling_vpp = 230\n[design]\nlevels_vpp = [60, 250]", 2, "levels_vpp"),
        ("[burst]\ncycles = 1000", 2, "burst"),
        ('[burst]\nfrequency_hz = 5000\naccept_violation = "a control"', 2, "burst"),
        ("[device]\nsample_rate_hz = 1000", 2, "device.sample_rate_hz"),
        ("[design]\nlevels_vpp = [0.01, 60]", 2, "levels_vpp[0]"),
        ('[strip]\nedge = "simply-supported"\n[burst]\nfrequency_hz = 1500\n', 1, "violates"),
    ],
)
def test_a_study_that_no_device_could_run_is_refused(
    study: str, exit_code: int, key: str, run: Run, tmp_path: Path
) -> None:
    file, out = tmp_path / "study.toml", tmp_path / "out"
    file.write_text(on_paper_plate(study), encoding="utf-8")
    simulated = ("--participant", "01", "--responder", "simulated", "--out", out)
    for command in (("check", file), ("dry-run", file, "--out", out), ("run", file, *simulated)):
        result = run(*command)
        assert result.exit_code == exit_code, command
        assert key in result.stderr or command[0] == "check"
        assert not out.exists()


@pytest.mark.slow
def test_an_accepted_violation_is_in_the_plan(run: Run, tmp_path: Path) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "out"
    text = (
        '[strip]\nmeasured_cutoff_hz = 2500\n[burst]\naccept_violation = "control condition"\n'
        "[design]\ntrials_per_side = 5\n"
    )
    study.write_text(on_paper_plate(text), encoding="utf-8")
    result = run("run", study, "--participant", "01", "--responder", "simulated", "--out", out)
    assert result.exit_code == 0, result.stderr
    plan = json.loads((out / "sub-01" / "ses-01" / "plan.json").read_text("utf-8"))
    assert plan["study"]["condition"][0]["accept_violation"] == "control condition"


@pytest.mark.slow
def test_two_dry_runs_with_one_seed_write_the_same_files(run: Run, tmp_path: Path) -> None:
    folders = [tmp_path / "a", tmp_path / "b"]
    for folder in folders:
        result = run("dry-run", "--seed", 7, "--participants", 2, "--out", folder)
        assert result.exit_code == 0, result.stderr
    files = [path.relative_to(folders[0]) for path in folders[0].rglob("*.*") if path.is_file()]
    dated = {"header.json", "journal.jsonl", "sessions.tsv", "report.html", ".tactstrip.json"}
    compared = [path for path in files if path.name not in dated and path.suffix != ".lock"]
    assert len(compared) > 20
    for path in compared:
        assert (folders[0] / path).read_bytes() == (folders[1] / path).read_bytes(), path


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_dry_run_without_a_study_has_its_threshold_within_its_levels(
    seed: int, run: Run, tmp_path: Path
) -> None:
    assert run("dry-run", "--seed", seed, "--out", tmp_path / "out").exit_code == 0
    summary = json.loads((tmp_path / "out" / "analysis" / "summary.json").read_text("utf-8"))
    (group,) = summary["groups"]
    levels = [row["level_vpp"] for row in summary["levels"]]
    assert group["status"] == "ok"
    assert min(levels) < group["threshold_low_vpp"] < group["threshold_high_vpp"] < max(levels)


@pytest.mark.slow
def test_dry_runs_without_out_are_numbered_and_never_fill_a_folder_with_files(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dry-run-1").mkdir()
    Path("dry-run-1/precious.txt").write_text("kept", encoding="utf-8")
    assert run("dry-run", "--participants", 1, "--out", "dry-run-1").exit_code == 2
    assert [path.name for path in Path("dry-run-1").iterdir()] == ["precious.txt"]
    assert run("dry-run", "--participants", 1).exit_code == 0
    assert Path("dry-run-2/analysis/levels.csv").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stopped", "error", "exit_code"),
    [
        ("experiment.session.simulate.simulate_study", KeyboardInterrupt(), 130),
        ("device.emulate.mock.MockDevice.arm", LinkError("no answer"), 3),
    ],
)
def test_a_dry_run_that_is_stopped_ends_with_one_line(
    stopped: str,
    error: BaseException,
    exit_code: int,
    run: Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(stopped, stop)
    result = run("dry-run", "--out", tmp_path / "out")
    assert result.exit_code == exit_code
    assert len(result.stderr.splitlines()) == 1
    assert str(error) in result.stderr


@pytest.mark.parametrize(
    ("typed", "similar"),
    [("anlyze", "analyze"), ("dry_run", "dry-run"), ("Check", "check"), ("analyse", "analyze")],
)
def test_the_most_similar_command_is_named(typed: str, similar: str, run: Run) -> None:
    assert f"{similar}?" in run(typed).stderr
    assert "?" not in run("xyzzy").stderr


def example_of(command: str, run: Run) -> list[str]:
    """Return the arguments of the example with which a command's help ends."""
    last = run(command, "--help").output.splitlines()[-1]
    assert last.startswith("  Example: tactstrip "), last
    return last.split()[2:]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_ends_with_an_example_of_it(
    command: str, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, *arguments = example_of(command, run)
    assert name == command
    monkeypatch.chdir(tmp_path)
    Path("results").mkdir()
    known = main.get_command(click.Context(main), command)
    assert known is not None
    known.make_context(command, arguments)  # refuses what it does not know


@pytest.mark.slow
def test_the_examples_work_one_after_the_other(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for command in ("init", "check", "field", "dry-run"):
        assert run(*example_of(command, run)).exit_code == 0, command
    Path("dry-run-1").rename("results")
    shutil.copy(EXAMPLES / "paper-table1.csv", "table.csv")
    for command in ("verify", "analyze", "levels", "export", "audit"):
        result = run(*example_of(command, run))
        # some rows of the paper's table are impossible
        assert result.exit_code == (command == "audit"), (command, result.stderr)
    shutil.copy(EXAMPLES / "psychopy-trials.csv", "table.csv")
    assert run(*example_of("columns", run)).exit_code == 0
    assert run(*example_of("withdraw", run), typed="01\n").exit_code == 0
    assert not Path("results/sub-01").exists()


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which tactstrip and its packages seem to be installed."""
    folder = tmp_path / "site"
    for package in PACKAGES:
        (folder / package).mkdir(parents=True)
        shutil.copy(Path(__file__).parents[2] / package / "__init__.py", folder / package)
    monkeypatch.setattr(tactstrip, "__file__", str(folder / "tactstrip.py"))
    for package in PACKAGES:
        monkeypatch.delitem(sys.modules, package, raising=False)
    monkeypatch.syspath_prepend(str(folder))
    return folder


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_that_is_replaced_shadowed_or_missing_is_one_line_and_exit_2(
    package: str, site: Path, tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refusal() -> str:
        tactstrip._other_distributions.cache_clear()
        result = run("check", "study.toml")
        assert result.exit_code == 2
        (line,) = result.stderr.splitlines()
        assert package in line
        return line

    # another distribution has written to the same folder, before or after tactstrip
    record = site / "other_stimuli-1.0.dist-info" / "RECORD"
    record.parent.mkdir()
    for path in (f"{package}/__init__.py", f"{package}/audio/tone.py", f"{package}.py"):
        record.write_text(f"README,,\n{path},sha256=x,5\n", "utf-8")
        assert "other_stimuli" in refusal()
    shutil.rmtree(record.parent)
    # something that keeps no record has overwritten a file, or removed it
    ours = site / package / "__init__.py"
    overwritten = ours.read_text("utf-8")
    ours.write_text("# another program\n", encoding="utf-8")
    assert refusal()
    ours.unlink()
    assert refusal()
    ours.write_text(overwritten, encoding="utf-8")
    # a file or a folder that comes earlier on the path
    for intruder in (f"{package}.py", f"{package}/__init__.py"):
        file = tmp_path / "lab" / intruder
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text('raise SystemExit("run")', encoding="utf-8")
        with monkeypatch.context() as earlier:
            earlier.syspath_prepend(str(tmp_path / "lab"))
            assert str(file) in refusal()
        file.unlink()


@pytest.mark.parametrize(
    ("option", "typed", "names"),
    [
        ("--responder", "s", {"screen", "simulated"}),
        ("--driver", "", {"mock", "serial", "generator", "audio"}),
    ],
)
def test_the_shell_completes_names_of_drivers_and_responders(
    option: str, typed: str, names: set[str]
) -> None:
    completed = ShellComplete(main, {}, "tactstrip", "_TACTSTRIP_COMPLETE")
    items = completed.get_completions(["run", "study.toml", option], typed)
    assert names <= {item.value for item in items}
