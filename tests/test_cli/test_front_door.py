"""The front door: instant help, one line for every error, and the whole way in one command."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

import tactstrip
from device.errors import LinkError
from experiment.terms import exits
from tactstrip import COMMANDS, OTHER_WORDS, PACKAGES, main

ROOT = Path(__file__).parents[2]
HEAVY = {"numpy", "scipy", "pandas", "pydantic", "rich", "matplotlib", "statsmodels", "psychopy",
         "serial", "filelock"}  # fmt: skip


def run(*arguments: object) -> Result:
    """Run the command line in this process."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def python(
    *arguments: str, folder: Path, path: Path | None = None, more: dict[str, str] | None = None
) -> tuple[int, str, str]:
    """Run Python in a folder: its exit code, output and error."""
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=os.environ | ({} if path is None else {"PYTHONPATH": str(path)}) | (more or {}),
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout, done.stderr


def imported_by(*arguments: str) -> set[str]:
    """Run the command line in a process of its own and list the packages it imported."""
    program = (
        "import sys\nfrom tactstrip import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit as end:\n    assert not end.code, end\n"
        "print('\\n'.join(sys.modules), file=sys.stderr)"
    )
    ended, _, told = python("-c", program, *arguments, folder=ROOT)
    assert ended == 0
    return {line.split(".")[0] for line in told.splitlines()}


@pytest.mark.process
@pytest.mark.parametrize("command", [(), *((command,) for command in COMMANDS)])
def test_help_imports_nothing_heavy(command: tuple[str, ...]) -> None:
    assert not imported_by(*command, "--help") & HEAVY


@pytest.mark.process
def test_a_dry_run_imports_no_psychopy_no_statsmodels_and_no_serial(tmp_path: Path) -> None:
    used = imported_by("dry-run", "--participants", "1", "--out", str(tmp_path / "out"))
    assert not used & {"psychopy", "statsmodels", "serial"}


def test_every_command_is_listed_with_its_help() -> None:
    told = run("--help").output
    for name, (_, text) in COMMANDS.items():
        assert re.search(rf"^  {name} +{re.escape(text)}$", told, re.MULTILINE)


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
    arguments: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
def test_two_dry_runs_with_one_seed_give_the_same_sessions_and_the_same_analysis(
    tmp_path: Path,
) -> None:
    outputs = []
    for name in ("a", "b"):
        result = run("dry-run", "--seed", 7, "--out", tmp_path / name)
        assert result.exit_code == 0, result.stderr
        outputs.append(result.stdout.replace(str(tmp_path / name), "OUT"))
    assert outputs[0] == outputs[1]
    assert re.search(r"^ +60 ", outputs[0], re.MULTILINE)
    assert "Both-finger trials" in outputs[0]
    sessions = sorted((tmp_path / "a").glob("sub-*/ses-*/trials.csv"))
    assert [path.parent.parent.name for path in sessions] == [f"sub-0{n}" for n in range(1, 6)]
    for path in sessions:
        twin = tmp_path / "b" / path.relative_to(tmp_path / "a")
        assert path.read_bytes() == twin.read_bytes()
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        assert len(rows) == 155
        assert {(row["status"], row["simulated"]) for row in rows} == {("ok", "true")}
        assert {row["kind"] for row in rows} == {"single", "both"}
    names = ("levels.csv", "participants.csv", "both.csv", "summary.json",
             "detection.png", "detection.svg")  # fmt: skip
    for name in names:
        one, two = (tmp_path / run / "analysis" / name for run in ("a", "b"))
        assert one.read_bytes() == two.read_bytes()
    summary = json.loads((tmp_path / "a" / "analysis" / "summary.json").read_text("utf-8"))
    assert summary["seed"] == 7


def test_the_command_alone_says_what_one_does_with_it() -> None:
    result = run()
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line for line in lines if line.endswith(":")] == [
        "Try it out, without a device:",
        "Run a study:",
        "Analyze a table made elsewhere:",
    ]
    told = re.findall(r"^  tactstrip ([\w-]+)", result.stdout, re.MULTILINE)
    assert set(told) <= set(COMMANDS)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("anlyze", "analyze"), ("dry_run", "dry-run"), ("Check", "check"), ("analyse", "analyze")],
)
def test_of_an_unknown_command_the_nearest_is_named(typed: str, meant: str) -> None:
    told = f"error: No such command {typed!r}. Did you mean {meant}? See "
    assert run(typed).stderr.startswith(told)
    assert "mean" not in run("xyzzy").stderr


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        ("simulate", "dry-run"),
        ("simulations", "dry-run"),
        ("reports", "analyze"),
        ("settings", "init"),
        ("plot", "analyze or field"),
        ("Figure", "analyze or field"),
        ("calibrate", "check"),
        ("validate", "check or verify"),
        ("sample_size", "power"),
        ("help", "--help"),
    ],
)
def test_of_a_word_for_what_a_command_does_the_command_is_named(typed: str, meant: str) -> None:
    assert f" {typed!r}. Did you mean {meant}? See " in run(typed).stderr


def test_a_command_that_lacks_a_letter_is_still_found_by_its_letters() -> None:
    short = {name[:at] + name[at + 1 :]: name for name in COMMANDS for at in range(len(name))}
    assert {typed: told for typed, name in short.items()
            if f"mean {name}?" not in (told := run(typed).stderr)} == {}  # fmt: skip


def test_other_words_are_no_commands_and_lead_to_some() -> None:
    words = {word for listed in OTHER_WORDS.values() for word in listed.split()}
    assert not words & {*COMMANDS}
    assert {*OTHER_WORDS} <= {*COMMANDS, "--help", "--version"}


def example_of(command: str) -> list[str]:
    """Return the arguments of the example with which a command's help ends."""
    last = run(command, "--help").output.splitlines()[-1]
    assert last.startswith("  Example: tactstrip "), last
    return last.split()[2:]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_ends_with_an_example_of_it(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, *arguments = example_of(command)
    assert name == command
    monkeypatch.chdir(tmp_path)
    Path("results").mkdir()
    context = click.Context(main)
    found = main.get_command(context, command)
    assert found is not None
    found.make_context(command, arguments)  # which refuses what it does not know


@pytest.mark.slow
def test_the_examples_work_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for command in ("init", "check", "field", "dry-run"):
        assert run(*example_of(command)).exit_code == 0, command
    Path("dry-run-1").rename("results")
    shutil.copy(ROOT / "docs" / "examples" / "paper-table1.csv", "table.csv")
    for command in ("verify", "analyze", "levels", "export", "audit"):
        result = run(*example_of(command))
        # of the paper's table some rows are impossible, and audit says so
        assert result.exit_code == (command == "audit"), (command, result.stderr)
    shutil.copy(ROOT / "docs" / "examples" / "psychopy-trials.csv", "table.csv")
    assert run(*example_of("columns")).exit_code == 0
    assert CliRunner().invoke(main, example_of("withdraw"), input="01\n").exit_code == 0
    assert not Path("results/sub-01").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stopped", "error", "ended", "told"),
    [
        ("experiment.session.simulate.simulate_study", KeyboardInterrupt(), 130, "interrupted"),
        ("device.emulate.mock.MockDevice.arm", LinkError("no answer"), 3,
         "participant 01: device: no answer"),
    ],
)  # fmt: skip
def test_a_dry_run_that_is_stopped_ends_with_one_line(
    stopped: str,
    error: BaseException,
    ended: int,
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(stopped, stop)
    result = run("dry-run", "--out", tmp_path / "out")
    assert (result.exit_code, result.stderr) == (ended, f"error: {told}\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[device]\nceiling_vpp = 300\n[design]\nlevels_vpp = [60, 250]", "own ceiling, 200 Vpp"),
        ("[burst]\ncycles = 1000", "too long"),
        ('[burst]\nfrequency_hz = 5000\naccept_unfit = "a control"', "DC part"),
        ("[device]\nsample_rate_hz = 1000", "device.sample_rate_hz"),
        ("[design]\nlevels_vpp = [0.01, 60]", "levels_vpp[0] must be"),
    ],
)
def test_what_no_device_could_run_is_refused_by_the_check(
    tmp_path: Path, text: str, told: str
) -> None:
    study = tmp_path / "study.toml"
    study.write_text(text, encoding="utf-8")
    result = run("check", study)
    assert result.exit_code == 2
    assert told in result.stderr


@pytest.mark.slow
def test_a_thick_plate_is_warned_of(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    disc = '[[actuator]]\nside = "{}"\nx_mm = {}\ndiameter_mm = 12.8\n'
    plate = '[strip]\nedge = "clamped"\nthickness_mm = 5\nlength_mm = 200\nmaterial = "steel"\n'
    text = plate + disc.format("left", -35) + disc.format("right", 35)
    study.write_text(text, encoding="utf-8")
    assert "not a thin plate" in run("check", study).output


@pytest.mark.slow
def test_dry_runs_without_out_are_numbered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dry-run-1").mkdir()
    result = run("dry-run", "--participants", 1)
    assert result.exit_code == 0
    assert (tmp_path / "dry-run-2" / "analysis" / "levels.csv").exists()


@pytest.mark.slow
def test_a_dry_run_never_writes_into_a_folder_with_files(tmp_path: Path) -> None:
    (tmp_path / "precious.txt").write_text("kept", encoding="utf-8")
    result = run("dry-run", "--out", tmp_path)
    assert result.exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


@pytest.mark.slow
def test_an_unfit_stimulus_is_not_run_unless_the_study_says_why(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    unfit = '[strip]\nedge = "simply-supported"\n[burst]\nfrequency_hz = 1500\n'
    study.write_text(unfit, encoding="utf-8")
    out = tmp_path / "out"
    commands = (
        ("dry-run", study, "--participants", 1, "--out", out),
        ("run", study, "--participant", "01", "--responder", "simulated", "--out", out),
    )
    for command in commands:
        result = run(*command)
        assert result.exit_code == 1
        assert "unfit" in result.stderr
        assert not out.exists()
    study.write_text(unfit + 'accept_unfit = "control condition"\n', encoding="utf-8")
    result = run(*commands[1])
    assert result.exit_code == 0, result.stderr
    header = json.loads((out / "sub-01" / "ses-01" / "header.json").read_text("utf-8"))
    assert header["unfit_stimuli_accepted"] == {"main": "control condition"}


@pytest.mark.slow
def test_what_is_accepted_with_another_loss_than_the_plans_is_in_the_header(tmp_path: Path) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "out"
    study.write_text(
        '[strip]\nmeasured_cutoff_hz = 2500\n[burst]\naccept_unfit = "control condition"\n'
        "[design]\ntrials_per_side = 5\n",
        encoding="utf-8",
    )
    words = ("run", study, "--participant", "01", "--responder", "simulated", "--out", out)
    result = run(*words)
    assert result.exit_code == 0, result.stderr
    folder = out / "sub-01" / "ses-01"
    header = json.loads((folder / "header.json").read_text("utf-8"))
    assert header["unfit_stimuli_accepted"] == {"main": "control condition"}
    plan = json.loads((folder / "plan.json").read_text("utf-8"))
    (left, right) = plan["gains"][0]["per_vpp"]
    assert 20 * math.log10(right[0] / left[0]) < -20


@pytest.mark.process
def test_the_front_door_opens_as_a_module_too() -> None:
    ended, _, told = python("-m", "tactstrip", "no-such-command", folder=ROOT)
    assert ended == 2
    assert "See tactstrip --help" in told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("bursts", "s.toml", "--cycles", "1.5"), "between them; got '1.5'. See tactstrip bursts"),
        (("bursts",), "Missing argument 'STUDY'. See tactstrip bursts --help.\n"),
    ],
)
def test_what_is_wrong_with_a_command_line_is_a_sentence(words: tuple[str, ...], said: str) -> None:
    assert said in CliRunner().invoke(main, words, prog_name="tactstrip").stderr


# --- a lab's own files of the same names ----------------------------------------------------------

OWN_FILE = 'print("not ours")\n'


@pytest.mark.process
@pytest.mark.parametrize("name", PACKAGES)
@pytest.mark.parametrize("arguments", [("check", "study.toml"), ("--help",), ()])
def test_a_labs_own_file_that_hides_a_package_is_named_and_not_run(
    name: str, arguments: tuple[str, ...], tmp_path: Path
) -> None:
    own = tmp_path / f"{name}.py"
    own.write_text(OWN_FILE, encoding="utf-8")
    ended, out, told = python("-m", "tactstrip", *arguments, folder=tmp_path)
    assert (ended, out) == (2, "")
    assert told.startswith(f"error: {own} hides the package {name} of tactstrip: rename it")
    assert told.count("\n") == 1


@pytest.mark.process
def test_a_labs_own_package_on_the_path_is_named_too(tmp_path: Path) -> None:
    own = tmp_path / "lab" / "analysis" / "__init__.py"
    own.parent.mkdir(parents=True)
    own.write_text(OWN_FILE, encoding="utf-8")
    ended, out, told = python("-m", "tactstrip", folder=tmp_path, path=tmp_path / "lab")
    assert (ended, out) == (2, "")
    assert told.startswith(f"error: {own} hides the package analysis")


@pytest.mark.process
@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("device", "from experiment import read_study"),
        ("stimuli", "from experiment.trial.plan import Plan"),
        ("experiment", "from analysis import probit_mle"),
        ("stimuli", "from analysis import read_trials; read_trials"),
    ],
)
def test_a_face_names_the_file_that_hides_what_it_needs(
    name: str, line: str, tmp_path: Path
) -> None:
    own = tmp_path / f"{name}.py"
    own.write_text(OWN_FILE, encoding="utf-8")
    ended, out, told = python("-c", line, folder=tmp_path)
    assert (ended, out) == (1, "")
    assert told.splitlines()[-1].startswith(f"ImportError: {own} hides the package {name} of")


@pytest.mark.process
def test_a_folder_of_that_name_without_a_package_in_it_hides_nothing(tmp_path: Path) -> None:
    (tmp_path / "analysis").mkdir()
    (tmp_path / "device").mkdir()
    assert python("-m", "tactstrip", "--help", folder=tmp_path)[0] == 0


@pytest.mark.process
@pytest.mark.parametrize("face", PACKAGES)
def test_a_face_is_imported_without_numpy(face: str, tmp_path: Path) -> None:
    line = f"import sys, {face}; print('numpy' in sys.modules)"
    assert python("-c", line, folder=tmp_path)[:2] == (0, "False\n")


def test_the_front_door_has_the_exit_code_of_bad_input() -> None:
    assert tactstrip.BAD_INPUT == exits.BAD_INPUT
