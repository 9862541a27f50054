"""The README is short, and its commands do what stands beside them."""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from tactstrip import COMMANDS, main

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {name: (ROOT / "docs" / name).read_text(encoding="utf-8") for name in
         ("commands.md", "plate.md", "record.md")}  # fmt: skip
"""What the README leaves to others, and what they say."""
RUN = (sys.executable, "-m", "tactstrip")
SET_UP, HARDWARE = "python3 -m venv", "--driver"
"""How lines begin that `.ci/run` runs; what is in those that need a device."""


def run(*words: str) -> Result:
    return CliRunner().invoke(main, words)


def commands_of(text: str) -> list[str]:
    """Return the commands of all shell blocks but those that install."""
    blocks: list[str] = re.findall(r"^```sh\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    return [line for line in lines if not line.startswith(SET_UP)]


def test_the_lines_that_install_end_as_ci_looks_for_them() -> None:
    ends = re.findall(r'command_of "(.+)"', (ROOT / ".ci" / "run").read_text(encoding="utf-8"))
    lines = [line for line in README.splitlines() if line.startswith(SET_UP)]
    assert [sum(line.endswith(f" && .venv/bin/{end}") for line in lines) for end in ends] == [1, 1]


def test_it_has_at_most_120_lines() -> None:
    assert README.count("\n") <= 120


@pytest.mark.parametrize("text", [README, *PAGES.values()], ids=["README.md", *PAGES])
def test_its_commands_exist_with_their_options(text: str) -> None:
    for line in commands_of(text):
        name, command, *rest = shlex.split(line, comments=True)
        if name == "tactstrip":
            told = run(command, "--help").output
            assert all(word in told for word in rest if word.startswith("--")), line


def test_every_command_stands_on_the_page_of_commands() -> None:
    told = {shlex.split(line, comments=True)[1] for line in commands_of(PAGES["commands.md"])}
    assert told == {*COMMANDS}


def test_the_lines_of_python_run_and_say_what_the_plate_does(
    capsys: pytest.CaptureFixture[str],
) -> None:
    block = re.search(r"```python\n(.*?)```", PAGES["plate.md"], re.DOTALL)
    assert block is not None
    exec(compile(block[1], "plate.md", "exec"), {})
    told = capsys.readouterr().out
    assert "no wave below 1926.0 Hz" in told
    assert "205.6 to 654.4 Hz" in told
    assert "fit for this plate: True" in told


ROWS = re.findall(r"^\| (.+) \| (\[.+) \|$", README, re.MULTILINE)


@pytest.mark.parametrize(("what", "shown_by"), ROWS)
def test_the_numbers_of_a_row_stand_where_it_is_shown(what: str, shown_by: str) -> None:
    linked = re.findall(r"\]\(([^)#]+)", shown_by)
    text = "".join((ROOT / name).read_text(encoding="utf-8") for name in linked)
    assert [n for n in re.findall(r"\d[\d.]*(?:e-\d+)?", what) if n not in text] == []


def test_the_example_of_the_site_is_this_plate(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs" / "_ext")
    plate = importlib.import_module("reference.sample").PLATE
    (words,) = (
        shlex.split(line, comments=True) for line in commands_of(README) if "--preset plate" in line
    )
    assert words == ["tactstrip", "init", "plate.toml", *plate]


def test_it_cites_this_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert f"version = {{{project['version']}}}" in README


@pytest.mark.gallery
def test_its_commands_run_as_they_stand(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs" / "examples", tmp_path / "docs" / "examples")
    done = []
    for line in commands_of(README):
        words = shlex.split(line, comments=True)
        if words[:2] == ["tactstrip", "run"]:
            if HARDWARE in words:
                continue
            words += ["--responder", "simulated"]
        if words[0] == "tactstrip":
            words[:1] = RUN
        subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
        done.append(re.sub("^tactstrip ", "", line).split()[0])
        filled_in(tmp_path / "map.toml")
        if done[-1] == "dry-run":
            shutil.move(tmp_path / "dry-run-1", tmp_path / "results")
    of_table = ["cp", "columns", "analyze"]
    of_plate = ["init", "check", "field", "run"]
    assert done == [*of_table, *of_plate, "init", "check", "dry-run", "analyze"]
    told = (
        "mine/report.html",
        "results/analysis/report.html",
        "tryout/sub-01/ses-01/plan.json",
    )
    assert [name for name in told if not (tmp_path / name).is_file()] == []


def filled_in(path: Path) -> None:
    """Fill in what the README says, once the draft is there."""
    if path.exists():
        text = path.read_text(encoding="utf-8")
        assert '\ndown = "' in text
        for key, word in (("down", "none"), ("unit", "%")):
            assert f'`{key} = "{word}"`' in README
            text = text.replace(f'\n{key} = ""', f'\n{key} = "{word}"')
        path.write_text(text, encoding="utf-8")


@pytest.mark.gallery
def test_the_dry_run_prints_what_is_shown_of_it(tmp_path: Path) -> None:
    shown = re.search(r"```text\n(.*?)```", README, re.DOTALL)
    assert shown is not None
    first, *lines = shown[1].splitlines()
    seed = re.fullmatch(r"5 simulated participants, seed (\d+), in dry-run-1", first)
    assert seed is not None
    study = re.search(r"tactstrip dry-run (\S+\.toml)$", README, re.MULTILINE)
    assert study is not None
    words = (*RUN, "dry-run", str(ROOT / study[1]), "--seed", seed[1])
    done = subprocess.run(words, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert [line for line in lines if line not in {"...", *done.stdout.splitlines()}] == []


def test_the_bench_copy_of_a_plate_has_nothing_but_bursts(tmp_path: Path) -> None:
    page = (ROOT / "docs/howto/calibrate.md").read_text(encoding="utf-8")
    block = re.search(
        r"^```sh\n(sed .*?plate\.toml > bench\.toml)\n", page, re.DOTALL | re.MULTILINE
    )
    assert block is not None
    sizes = "--width-mm 30 --thickness-mm 0.5 --length-mm 160 --material steel --edge clamped"
    made = run(
        "init", str(tmp_path / "plate.toml"), "--preset", "plate", *shlex.split(sizes),
        "--actuator", "disc:12.8@35", "--ceiling-vpp", "120",
    )  # fmt: skip
    assert made.exit_code == 0, made.stderr
    subprocess.run(block[1], shell=True, check=True, cwd=tmp_path)
    told = run("check", str(tmp_path / "bench.toml")).output
    assert "50: 25 left, 25 right, 0 both, 0 blank; 0 for practice before\n" in told
    assert "levels         30 Vpp" in told
