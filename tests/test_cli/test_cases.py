"""Whole commands as they are typed, with all that they print: the one place that pins wording.

Each case is a folder of ``cases/``: input files, and ``session.txt``, in which a line that begins
with ``$`` is typed and the lines after it are what appears. ``ls`` lists the files, ``cat`` prints
one, ``[n]`` is an exit code other than 0, ``!`` begins a line on stderr. To accept a changed
screen, set ``TACTSTRIP_ACCEPT=1``, run this file with ``-m ""`` and review the difference.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from tests.conftest import Run

CASES = Path(__file__).parent / "cases"
QUICK = {"errors", "first-steps", "audit"}


def transcript(commands: list[str], run: Run) -> str:
    """Run commands in the current folder; return them with what they print."""
    lines = []
    for command in commands:
        lines.append(f"$ {command}")
        program, *arguments = shlex.split(command)
        if program == "ls":
            lines += sorted(str(path) for path in Path().rglob("*") if path.is_file())
            continue
        if program == "cat":
            lines += Path(*arguments).read_text("utf-8").splitlines()
            continue
        assert program == "tactstrip", command
        result = run(*arguments)
        lines += result.stdout.splitlines()
        lines += [f"! {line}" for line in result.stderr.splitlines()]
        lines += [f"[{result.exit_code}]"] * (result.exit_code != 0)
    printed = "\n".join(line.rstrip() for line in lines) + "\n"
    return re.sub(r"\b[0-9a-f]{64}\b", "<sha256>", printed)  # of a journal, which has dates


@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[] if case.name in QUICK else pytest.mark.slow, id=case.name)
        for case in sorted(CASES.iterdir())
    ],
)
def test_commands_print_what_the_case_shows(
    case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Run
) -> None:
    session = case / "session.txt"
    for source in case.iterdir():
        if source != session:
            shutil.copy(source, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    expected = session.read_text("utf-8")
    commands = [line[2:] for line in expected.splitlines() if line.startswith("$ ")]
    printed = transcript(commands, run)
    if os.environ.get("TACTSTRIP_ACCEPT"):
        session.write_text(printed, encoding="utf-8")
    assert printed == expected
