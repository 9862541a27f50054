"""Which columns of a table made elsewhere hold counts instead of trials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

COUNTED_COLUMNS = ("participant", "session", "condition", "side", "level_vpp")
"""What a row of counts may tell besides its counts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CountColumns:
    """A map's section ``[table]``.

    Attributes
    ----------
    detected, presented : str
        Their columns with the two counts.
    group : tuple of str
        Their columns that tell whose and which function a row belongs to. That of the participant
        may be among them; the others together are the condition.
    none_offered : bool
        Whether "not felt" could be said; false for a forced choice, where who feels nothing
        guesses.

    Raises
    ------
    ValueError
        For a name that is no text, and one that is named twice.

    Examples
    --------
    >>> CountColumns(detected="k", presented="n", group=("who", "speed")).conditions("who")
    ['speed']
    """

    detected: str
    presented: str
    group: tuple[str, ...] = ()
    none_offered: bool = True

    def __post_init__(self) -> None:
        names = [self.detected, self.presented, *self.group]
        if not all(isinstance(name, str) and name for name in names):
            raise ValueError(f"[table]: names of columns must be text, got {names}")
        if len({*names}) < len(names):
            raise ValueError(f"[table]: each column may be named once, got {', '.join(names)}")
        if type(self.none_offered) is not bool:
            raise ValueError(f"[table] none_offered: true or false, got {self.none_offered!r}")

    def conditions(self, participant: str) -> list[str]:
        """Return their columns that are the condition, given their name of the participant."""
        return [name for name in self.group if name != participant]


def count_columns(section: Mapping[str, Any]) -> CountColumns | None:
    """Return what a map's section ``[table]`` says; without entries none.

    Raises
    ------
    ValueError
        For an unknown or missing key, and as `CountColumns`.

    Examples
    --------
    >>> count_columns({"detected": "k"})
    Traceback (most recent call last):
    ValueError: [table] needs detected and presented, and may have group and none_offered; got
    detected
    """
    if not section:
        return None
    known = tuple(CountColumns.__dataclass_fields__)
    if {*section} - {*known} or not {"detected", "presented"} <= {*section}:
        raise ValueError(
            "[table] needs detected and presented, and may have group and none_offered; "
            f"got {', '.join(section)}"
        )
    group = section.get("group", [])
    if type(group) not in (list, tuple):
        raise ValueError(f"[table] group: must be a list of columns, got {group!r}")
    return CountColumns(**{**section, "group": tuple(group)})
