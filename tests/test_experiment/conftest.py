"""What several tests of sessions need: the command line as it is typed, and the table it writes."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest

from experiment.archive.journal import Journal
from experiment.terms.entries import EVENTS

if TYPE_CHECKING:
    from collections.abc import Callable

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
