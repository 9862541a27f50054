"""A table beside the rows that its journal tells of: where it says something else."""

from __future__ import annotations

import csv
from dataclasses import fields
from typing import TYPE_CHECKING, TypeAlias

from experiment.rows import format_value, table_csv

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from experiment.rows import Row

    Key: TypeAlias = tuple[str, str]


def table_differences(
    found: bytes | None, kind: type[Row], rows: Sequence[Row], *, least: int
) -> list[tuple[int, str]]:
    """List where a table differs from its rows, as line and message; nowhere if there is none.

    A session that was cut off wrote its table before: so many rows at `least` have to be there, and
    those that are have to be the first ones, byte by byte.

    >>> from experiment.rows import TrialRow
    >>> table_differences(table_csv(TrialRow, []).encode(), TrialRow, [], least=0)
    []
    """
    text = table_csv(kind, rows)
    if found is None or found == text.encode() or _is_earlier(found, text, least):
        return []
    told = found.decode(errors="replace")
    names = [one.name for one in fields(kind)]
    must = [[format_value(getattr(row, name)) for name in names] for row in rows]
    differences = list(_of_cells(told, names, must, least))
    if not differences:
        lines = zip(found.split(b"\n"), text.encode().split(b"\n"), strict=False)
        line = next((n for n, (a, b) in enumerate(lines, 1) if a != b), text.count("\n"))
        differences.append((line, "is written otherwise than a session writes it"))
    return differences


def _is_earlier(found: bytes, text: str, least: int) -> bool:
    whole = found.endswith(b"\n") and text.encode().startswith(found)
    return whole and found.count(b"\n") - 1 >= least


def _of_cells(
    told: str, names: list[str], must: list[list[str]], least: int
) -> Iterator[tuple[int, str]]:
    """Compare row by row; a row is known by its trial and attempt."""
    try:
        heading, *lines = list(csv.reader(told.splitlines(), strict=True)) or [[]]
    except csv.Error as error:
        yield 1, f"cannot be read as a table: {error}"
        return
    if heading != names:
        yield 1, "the columns are not those that a session writes"
        return
    trial, attempt = names.index("trial"), names.index("attempt")

    def key(cells: list[str]) -> Key:
        return cells[trial], cells[attempt]

    def name(cells: list[str]) -> str:
        if len(cells) != len(names):
            return f"a row of {len(cells)} cells, not {len(names)},"
        return f"trial {cells[trial]!s}, attempt {cells[attempt]!s}"

    places = {key(cells): place for place, cells in enumerate(must)}
    due, line = 0, 1
    for line, cells in enumerate(lines, start=2):
        place = places.get(key(cells)) if len(cells) == len(names) else None
        if place is None:
            yield line, f"{name(cells)} is not in the journal"
            continue
        if place < due:
            yield line, f"{name(cells)} stands here again, or too late"
            continue
        yield from ((line, f"{name(lost)} is missing before it") for lost in must[due:place])
        yield from _of_row(line, names, cells, must[place])
        due = place + 1
    if due < least:
        yield from ((line + 1, f"{name(lost)} is missing") for lost in must[due:])


def _of_row(
    line: int, names: list[str], cells: list[str], must: list[str]
) -> Iterator[tuple[int, str]]:
    for name, is_, was in zip(names, cells, must, strict=True):
        if is_ != was:
            yield line, f"column '{name}' is {is_!r}; by the journal it is {was!r}"
