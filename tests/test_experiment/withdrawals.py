"""Folders of results with a withdrawal that is under way, or done."""

from __future__ import annotations

import contextlib
from functools import partial
from typing import TYPE_CHECKING

from experiment.record.people import Tombstone, read_people, read_tombstone, write_tombstone
from experiment.record.withdraw import held, look_up, remove

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


def begin_withdrawal(results: Path, who: str, day: str, *, removed: bool = False) -> None:
    """Leave the tombstone of a withdrawal, and the data."""
    write_tombstone(results, Tombstone(participant=who, withdrawn=day, removed=removed))


@contextlib.contextmanager
def change_meanwhile(results: Path, who: str) -> Iterator[Callable[[], object]]:
    """Look a person up and hold the sessions; what is given removes the person."""
    person = look_up(results, who)
    with held(person) as locks:
        yield partial(remove, person, locks, today="2026-01-02")


def assert_gone(results: Path) -> None:
    """Check that nothing but a tombstone is left of participant 01."""
    assert not (results / "sub-01").exists()
    assert [*read_people(results).rows] == ["sub-02"]
    tombstone = read_tombstone(results, "01")
    assert tombstone is not None
    assert tombstone.removed
    assert [path.name for path in (results / "withdrawn").iterdir()] == ["sub-01.json"]
    assert look_up(results, "01").gone
    assert (results / "sub-02" / "ses-01" / "trials.csv").exists()
