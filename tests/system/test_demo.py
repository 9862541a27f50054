"""Commands of the analysis as processes: the demo on a pseudo-terminal, closed streams."""

from __future__ import annotations

import csv
import os
import re
import select
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from pathlib import Path

termios = pytest.importorskip("termios", reason="pseudo-terminals are a POSIX feature")

COMMAND = (sys.executable, "-c", "from tactstrip import main; main(prog_name='tactstrip')", "demo")
LEFT, ENTER, ESCAPE = b"\x1b[D", b"\n", b"\x1b"
PATIENCE_S = 60
LATER_S = 0.2
CUT = b"trial 3 of 6  ... ?"


class Person:
    """Somebody who presses a key whenever a text is shown."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.keyboard, self._inner = os.openpty()
        self.before = termios.tcgetattr(self._inner)
        self.shown = b""
        self._process = subprocess.Popen(
            [*COMMAND, *options],
            cwd=folder,
            env=os.environ | {"TMPDIR": str(folder)},
            stdin=self._inner,
            stdout=self._inner,
            stderr=self._inner,
            start_new_session=True,
        )

    def press_until_ended(self, keys: dict[bytes, bytes]) -> int:
        """Press the key of each text that is shown, each once more; return the exit code."""
        new, until_s = b"", time.monotonic() + PATIENCE_S
        while self._process.poll() is None or select.select([self.keyboard], [], [], 0)[0]:
            assert time.monotonic() < until_s, self.shown
            if select.select([self.keyboard], [], [], 0.05)[0]:
                read = os.read(self.keyboard, 4096)
                self.shown += read
                new += read
            for text, key in keys.items():
                if text in new and (b"Killed" in self.shown or not new.endswith(CUT)):
                    new = b""
                    time.sleep(LATER_S if key == LEFT else 0)
                    os.write(self.keyboard, key)
        return self._process.wait()

    def terminal_as_before(self) -> bool:
        return bool(termios.tcgetattr(self._inner) == self.before)

    def close(self) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self.keyboard)
        os.close(self._inner)


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "results/sub-01/ses-01/trials.csv").open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["kind"] == "single"]


def test_a_person_sees_a_session_killed_resumed_verified_and_analyzed(tmp_path: Path) -> None:
    person = Person(tmp_path, "--out", "kept")
    try:
        assert person.press_until_ended({b"Press Enter to continue": ENTER, b" ?": LEFT}) == 0, (
            person.shown
        )
        assert person.terminal_as_before()
    finally:
        person.close()
    text = person.shown.decode().replace("\r\n", "\n")
    assert re.findall(r"^\S*(\d)\. ", text, re.MULTILINE) == ["1", "2", "3", "4", "5"]
    assert all(part in text for part in ("crosstalk -23.7", "Killed", "--resume"))
    (assumed,) = re.findall(r"Simulated +([\d.]+) V", text)
    ((lower, upper),) = re.findall(r"Threshold.* \(([\d.]+) to ([\d.]+)\)", text)
    assert float(lower) < float(assumed) < float(upper)
    rows = rows_of(tmp_path / "kept")
    ok = [row for row in rows if row["status"] == "ok"]
    assert sorted(row["trial"] for row in ok) == list("123456")
    (cut,) = [row for row in rows if row["status"] != "ok"]
    assert (cut["trial"], cut["attempt"], cut["status"]) == ("3", "1", "indeterminate")
    assert {row["response"] for row in ok} == {"left"}


def test_of_a_demo_that_is_stopped_nothing_stays(tmp_path: Path) -> None:
    person = Person(tmp_path)
    try:
        ended = person.press_until_ended({b"Press Enter to continue": ESCAPE})
        assert person.terminal_as_before()
    finally:
        person.close()
    assert ended == 130
    assert b"error: " in person.shown
    assert list(tmp_path.iterdir()) == []
