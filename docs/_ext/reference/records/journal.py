"""The events of the journal, with what each line holds beside its time."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any, Final

from experiment.archive import journal
from experiment.archive.entries import EVENTS, EventKind
from experiment.rows import COLUMNS, MeasuredRow
from reference.markdown import code, literal, prose, table
from reference.records import members
from reference.records.shapes import kind_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reference.sample import Sample

NAME: Final = "journal.jsonl"


def page(sample: Sample) -> str:
    """Write the page; a ValueError names members that nobody says the meaning of."""
    lines = sample.shapes[NAME]
    told = [
        "# Events of the journal\n",
        f"{prose(journal.__doc__)}\n",
        "Every line has:\n",
        code(" ".join(_in_every(lines))),
        (
            "`t_s` is the session's clock, `wall_s` the calendar's (seconds since 1970), `up_s` "
            "the time since the computer was started. What does not exist, or is not known yet, is "
            "null or `n/a`.\n"
        ),
        table(("event", "meaning"), [(literal(one), kind.meaning) for one, kind in EVENTS.items()]),
    ]
    for event, kind in EVENTS.items():
        rows = [*_rows(event, kind, sample)]
        listed = table(("member", "type", "meaning"), rows) if rows else "Nothing beside it.\n"
        told += [f"## {event}\n", listed]
    return "\n".join(told)


def _in_every(lines: list[dict[str, Any]]) -> list[str]:
    every = set(lines[0]).intersection(*map(set, lines))
    return [name for name in lines[0] if name in every]


def _rows(event: str, kind: EventKind, sample: Sample) -> Iterator[tuple[str, str, str]]:
    lines = [line for line in sample.shapes[NAME] if line["event"] == event]
    known = {one.removesuffix("?") for one in kind.members}
    if others := {*_of(lines)} - known - {*_in_every(sample.shapes[NAME])}:
        raise ValueError(f"experiment.archive.entries: {event} has {sorted(others)} too")
    about, header = members.about(NAME), members.about("header.json")
    columns = {field.name: field.metadata["description"] for field in fields(MeasuredRow)}
    columns |= {column.name: column.description for column in COLUMNS}
    seen = lines or [*sample.shapes[NAME], *sample.shapes["header.json"]]
    for one in kind.members:
        name = one.removesuffix("?")
        types = about.types.get(name) or kind_of([line[name] for line in seen if name in line])
        meaning = about.meaning(f"{event}.{name}") or header.meaning(name) or columns.get(name, "")
        if not meaning or types in {"", "null"}:
            raise ValueError(f"{members.TOLD.name}: of {NAME}, {event}, not told: {name}")
        may = "; may be left out" if one != name else ""
        yield literal(name), types, f"{meaning}{may}"


def _of(lines: list[dict[str, Any]]) -> Iterator[str]:
    for line in lines:
        yield from line
