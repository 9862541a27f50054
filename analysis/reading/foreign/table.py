"""A map's section ``[table]``: which columns of a table made elsewhere are counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping


COUNTED_COLUMNS = ("participant", "session", "condition", "kind", "side", "level_vpp")
"""What a row of counts may tell besides its counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CountColumns:
    """A map's section ``[table]``; a ValueError for a name that is no text or is given twice.

    >>> CountColumns(detected="k", presented="n", group=("who", "speed")).conditions("who")
    ['speed']
    """

    detected: str  # their columns with the two counts
    presented: str
    # their columns that tell whose and which function a row belongs to: that of the participant may
    # be among them; the others together are the condition
    group: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        names: list[object] = [self.detected, self.presented, *self.group]
        if not all(isinstance(name, str) and name for name in names):
            raise ValueError(f"[table]: names of columns must be text, got {names}")
        if len({*names}) < len(names):
            raise ValueError(
                f"[table]: each column may be named once, got {', '.join(map(str, names))}"
            )

    def conditions(self, participant: str) -> list[str]:
        """Return their columns that are the condition, given their name of the participant."""
        return [name for name in self.group if name != participant]


def count_columns(section: Mapping[str, Any]) -> CountColumns | None:
    """Return what a map's section ``[table]`` says; without entries none.

    Raises ValueError for an unknown or missing key, and as `CountColumns`.

    >>> count_columns({"detected": "k"})
    Traceback (most recent call last):
    ValueError: [table] needs detected and presented, and may have group; got detected
    """
    if not section:
        return None
    known = tuple(CountColumns.__dataclass_fields__)
    if {*section} - {*known} or not {"detected", "presented"} <= {*section}:
        raise ValueError(
            f"[table] needs detected and presented, and may have group; got {', '.join(section)}"
        )
    group = section.get("group", [])
    if type(group) not in (list, tuple):
        raise ValueError(f"[table] group: must be a list of columns, got {group!r}")
    return CountColumns(**{**section, "group": tuple(group)})
