"""Folders of results with a withdrawal that is under way, or done."""

from __future__ import annotations

import contextlib
from functools import partial
from typing import TYPE_CHECKING

from experiment.record.people import (
    WithdrawalRecord,
    read_people,
    read_withdrawal,
    write_withdrawal,
)
from experiment.record.withdraw import find_person, locked_sessions, remove

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


def begin_withdrawal(results: Path, who: str, day: str, *, removed: bool = False) -> None:
    """Leave the tombstone of a withdrawal, and the data."""
    write_withdrawal(results, WithdrawalRecord(participant=who, withdrawn=day, removed=removed))


@contextlib.contextmanager
def change_meanwhile(results: Path, who: str) -> Iterator[Callable[[], object]]:
    """Look a person up and hold the sessions; what is given removes the person."""
    person = find_person(results, who)
    with locked_sessions(person) as locks:
        yield partial(remove, person, locks, today="2026-01-02")


def assert_gone(results: Path) -> None:
    """Check that nothing but a tombstone is left of participant 01."""
    assert not (results / "sub-01").exists()
    assert [*read_people(results).rows] == ["sub-02"]
    tombstone = read_withdrawal(results, "01")
    assert tombstone is not None
    assert tombstone.removed
    assert [path.name for path in (results / "withdrawn").iterdir()] == ["sub-01.json"]
    assert find_person(results, "01").is_removed
    assert (results / "sub-02" / "ses-01" / "trials.csv").exists()
