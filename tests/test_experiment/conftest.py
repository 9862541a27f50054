"""What several tests of sessions need: the command line as it is typed, and the table it writes."""

from __future__ import annotations

import csv
import sys
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest
from click.testing import CliRunner

from experiment.archive.journal import Journal
from experiment.terms.entries import EVENTS
from tactstrip import main
from tests.test_experiment.sessions import contents

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from click.testing import Result

    Run: TypeAlias = Callable[..., Result]
    Rows: TypeAlias = Callable[..., list[dict[str, str]]]
    Refused: TypeAlias = Callable[..., str]


@pytest.fixture(autouse=True)
def _lines_are_as_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refuse a line of a session that has other members than `EVENTS` lists."""
    append = Journal.append

    def listed(journal: Journal, event: str, facts: Any = None, *, sync: bool = False) -> None:
        if str(sys._getframe(1).f_globals["__name__"]).startswith("experiment.session."):
            members = {one.removesuffix("?") for one in EVENTS[event].members}
            needed = {one for one in EVENTS[event].members if not one.endswith("?")}
            assert needed <= {*(facts or {})} <= members, event
        append(journal, event, facts, sync=sync)

    monkeypatch.setattr(Journal, "append", listed)


@pytest.fixture
def run() -> Run:
    """Run a command with what is typed to it: exit code, output and error."""

    def run(*arguments: str | Path, typed: str | None = None) -> Result:
        return CliRunner().invoke(main, [str(argument) for argument in arguments], input=typed)

    return run


@pytest.fixture
def refused(run: Run, tmp_path: Path) -> Refused:
    """Run a command that must end with 2 and change nothing; returns its error."""

    def refused(*arguments: str | Path, typed: str | None = None) -> str:
        before = contents(tmp_path)
        result = run(*arguments, typed=typed)
        assert result.exit_code == 2, result.output
        assert contents(tmp_path) == before
        return result.stderr

    return refused


@pytest.fixture
def rows_of() -> Rows:
    """Read trials.csv of a session of participant 01 below a folder of results."""

    def rows_of(out: Path, session: str = "01") -> list[dict[str, str]]:
        path = out / "sub-01" / f"ses-{session}" / "trials.csv"
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    return rows_of
