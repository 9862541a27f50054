"""Commands on a study in a process of their own: on a terminal, in a pipe, and what they import."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from experiment import paper_study
from tests.plates import PRESETS


@pytest.fixture(autouse=True)
def in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("program", "printed"),
    [
        ("from experiment import paper_study; print(paper_study().sha256)", paper_study().sha256),
        (
            (
                "import sys, experiment.commands.check\n"
                "print([name for name in ('numpy', 'pydantic', 'rich') if name in sys.modules])"
            ),
            "[]",
        ),
        (
            (
                "import sys\nfrom tactstrip import main\n"
                f"main(['field', {str(PRESETS / 'paper.toml')!r}, '--out', 'field.csv'], "
                "standalone_mode=False)\n"
                "print('matplotlib' in sys.modules)"
            ),
            "False",
        ),
    ],
    ids=["checksum", "help", "table"],
)
def test_a_process_has_the_same_checksum_and_imports_what_it_needs(
    program: str, printed: str
) -> None:
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            check=True,
            text=True,
        )
        assert done.stdout.splitlines()[-1] == printed
        Path("field.csv").unlink(missing_ok=True)


WORK = """
import sys, time
from experiment.commands.options.hardware import working
with working("Computing") as step:
    step(1, 4)
    time.sleep(float(sys.argv[1]))
print("rich" in sys.modules)
"""


@pytest.mark.parametrize(("seconds", "shows"), [("1.5", b"1"), ("0", b"")])
def test_progress_is_on_a_terminal_only_and_not_for_what_is_over_at_once(
    seconds: str, shows: bytes
) -> None:
    ours, theirs = os.openpty()
    command = [sys.executable, "-c", WORK, seconds]
    try:
        environment = os.environ | {"TERM": "xterm"}
        subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=theirs, env=environment)
        os.write(theirs, b"|end|")
        seen = os.read(ours, 1 << 16)
    finally:
        os.close(ours)
        os.close(theirs)
    assert (b"Computing" in seen) == bool(shows)
    piped = subprocess.run(command, check=True, capture_output=True, text=True)
    assert (piped.stdout, piped.stderr) == ("False\n", "")
