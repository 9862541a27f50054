"""What a journal tells: the events, and what the line of each holds beside its time."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class EventKind:
    """What an event is, and the members of its line; one with a question mark may be left out."""

    meaning: str
    members: tuple[str, ...]


def _read() -> dict[str, EventKind]:
    tables = tomllib.loads(files(__package__).joinpath("events.toml").read_text("utf-8"))
    return {
        event: EventKind(table["meaning"], tuple(table["members"]))
        for event, table in tables.items()
    }


EVENTS: Final[Mapping[str, EventKind]] = MappingProxyType(_read())
"""What a line can tell of, about in the order of a session."""
