"""Commands on a study in a process of their own: on a terminal, in a pipe, and what they import."""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from pathlib import Path
from typing import Self

import pytest

from experiment import paper_study, read_study
from tests.test_experiment.sessions import COMMAND


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
                "import sys\nfrom tactstrip import main\nopen('study.toml', 'w').close()\n"
                "main(['field', 'study.toml', '--out', 'field.csv'], standalone_mode=False)\n"
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


class Terminal:
    """`tactstrip init --preset plate` in a process of its own, in front of a pseudo-terminal."""

    def __init__(self, *options: str) -> None:
        pty = pytest.importorskip("pty", reason="pseudo-terminals are a POSIX feature")
        self._keyboard, inner = pty.openpty()
        self._process = subprocess.Popen(
            [*COMMAND, "init", "--preset", "plate", *options],
            stdin=inner, stdout=inner, stderr=inner, start_new_session=True,
        )  # fmt: skip
        os.close(inner)
        self.shown = b""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._keyboard)

    def _read(self, until_s: float) -> bool:
        ready, _, _ = select.select([self._keyboard], [], [], max(0.0, until_s - time.monotonic()))
        try:
            new = os.read(self._keyboard, 4096) if ready else b""
        except OSError:  # Linux ends a pseudo-terminal so
            return False
        self.shown += new
        return bool(new)

    def answer(self, question: bytes, answer: bytes) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while question not in self.shown.replace(b"\r\n", b""):
            assert self._read(until_s), (question, self.shown)
        assert not Path("study.toml").exists()
        self.shown = b""
        os.write(self._keyboard, answer)

    def ended(self) -> int:
        until_s = time.monotonic() + PATIENCE_S
        while self._read(until_s):
            pass
        return self._process.wait(PATIENCE_S)


def test_on_a_terminal_what_is_missing_is_asked_for_until_it_is_right() -> None:
    dialogue = [
        (b"Width ", b"0.025"),
        (b"got 0.025;", b"25"),
        (b"Thickness", b"0,5"),
        (b"write 0.5,", b"0.5"),
        (b"Length", b"200"),
        (b"polycarbonate: ", b"aluminum"),
        (b"aluminium?", b"aluminium"),
        (b"Edges: ", b"measured-cutoff"),
        (b"First cut-off", b"9000"),
        (b"17.4 mm", b"2500"),
        (b"at X: ", b"disc:12.8@99"),
        (b"100 mm", b"disc:12.8@35"),
    ]
    with Terminal() as terminal:
        for question, answer in dialogue:
            terminal.answer(question, answer + b"\n")
        assert terminal.ended() == 0, terminal.shown
    assert read_study("study.toml").plate.measured_cutoff_hz == 2500.0


def test_what_the_command_line_has_is_not_asked_for_but_refused_before_the_questions() -> None:
    given = ["--length-mm", "150", "--edge", "clamped", "--actuator", "disc:12.8@35"]
    with Terminal(*given, "--material", "steel") as terminal:
        terminal.answer(b"Width ", b"30\n")
        terminal.answer(b"Thickness", b"0.5\n")
        assert terminal.ended() == 0, terminal.shown
    Path("study.toml").unlink()
    with Terminal(*given, "--material", "steal") as terminal:
        assert terminal.ended() == 2, terminal.shown
        assert b"Width" not in terminal.shown
    with Terminal(*given) as terminal:
        terminal.answer(b"Width", END_OF_INPUT)
        assert terminal.ended() == 2, terminal.shown
        assert b"error: " in terminal.shown
    assert not Path("study.toml").exists()


PATIENCE_S = 60


END_OF_INPUT = b"\x04"
