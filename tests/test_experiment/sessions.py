"""Sessions as an experimenter types them: a study file, and the folder of results beside it."""

from __future__ import annotations

import csv
import json
import sys
from typing import TYPE_CHECKING, Any

import pytest
from click.testing import CliRunner

from experiment import Journal, SessionFolder, read_journal
from tactstrip import main
from tests.test_experiment.lab import Crash

if TYPE_CHECKING:
    from pathlib import Path

    from click.testing import Result

    from experiment import Entry

COMMAND = (sys.executable, "-c", "from tactstrip import main; main()")


def contents(folder: Path) -> dict[str, bytes]:
    """Return every file below a folder but locks."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.endswith("lock")
    }


class Sessions:
    """Sessions of participant 01 of one study; what is asked for is of session 01."""

    practice = True

    def __init__(self, folder: Path, text: str) -> None:
        folder.mkdir(exist_ok=True)
        self.study = folder / "study.toml"
        self.out = folder / "results"
        self.write(text)

    @property
    def text(self) -> str:
        return self.study.read_text("utf-8")

    def write(self, text: str) -> None:
        self.study.write_text(text, encoding="utf-8")

    def words(self, *more: str) -> list[str]:
        """Return what is typed to run a session; people are let onto devices that move nothing."""
        options = ["--participant", "01", "--out", str(self.out)]
        to_people = self.practice and "simulated" not in more
        practice = ["--practice-without-device"] if to_people else []
        return ["run", str(self.study), *options, *practice, *more]

    def run(self, *more: str, typed: str | None = None) -> Result:
        return CliRunner().invoke(main, self.words(*more), input=typed)

    def crash(self, lines: int, *more: str) -> bool:
        """Run until so many lines are written, as if killed then; False if it ended before."""
        append, written = Journal.append, 0

        def append_and_crash(journal: Journal, *args: Any, **named: Any) -> None:
            nonlocal written
            append(journal, *args, **named)
            written += 1
            if written == lines:
                raise Crash

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Journal, "append", append_and_crash)
            try:
                self.run(*more)
            except Crash:
                return True
        return False

    def folder(self, session: str = "01") -> SessionFolder:
        return SessionFolder(self.out, "01", session)

    def lines(self, event: str | None = None, session: str = "01") -> list[dict[str, Any]]:
        """Return the members of every line of an event."""
        return [entry.line.model_dump() for entry in self.entries(event, session)]

    def entries(self, event: str | None = None, session: str = "01") -> list[Entry]:
        read = read_journal(self.folder(session).journal_path).entries
        return [entry for entry in read if event in {None, entry.event}]

    def rows(self, session: str = "01") -> list[dict[str, str]]:
        with self.folder(session).trials_path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    def header(self) -> dict[str, Any]:
        text = (self.folder().path / "header.json").read_text("utf-8")
        facts: dict[str, Any] = json.loads(text)
        return facts
