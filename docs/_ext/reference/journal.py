"""The lines of journal.jsonl: every event with its members, from the models of the record."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from experiment.record.entries import LINES
from experiment.record.journal import SCHEMA
from reference.markdown import literal, table

if TYPE_CHECKING:
    from collections.abc import Iterator

_CHAIN = (
    ("crc", "CRC-32 of the line without this member, 8 hexadecimal digits"),
    ("schema", f"version of the lines: {SCHEMA}; a journal of another version is refused"),
    ("seq", "number of the line, counted from 1"),
    ("prev", "SHA-256 of the line before, 64 hexadecimal digits; zeros in the first line"),
    ("event", "name of the event"),
    ("t_s", "time on the session's clock, seconds"),
    ("wall_s", "calendar time of the computer, seconds since 1970"),
    ("up_s", "time since the computer was started, seconds"),
)


def page() -> str:
    """Write the page."""
    return "\n".join(
        [
            "# Lines of the journal\n",
            (
                "Each line of `journal.jsonl` is a JSON object. A member that is not known, or "
                "does not apply, is `null`. The {download}`JSON Schema "
                "<_site/journal.schema.json>` of the events has the same content.\n"
            ),
            "## Members of every line\n",
            table(("member", "meaning"), [(literal(name), text) for name, text in _CHAIN]),
            *_events(),
        ]
    )


def schema_text() -> str:
    """Write the JSON Schema of all events."""
    return json.dumps(LINES.json_schema(mode="serialization"), indent=1) + "\n"


def _events() -> Iterator[str]:
    schema = LINES.json_schema(mode="serialization")
    for reference in schema["oneOf"]:
        model = schema["$defs"][reference["$ref"].rsplit("/", 1)[1]]
        event = model["properties"]["event"]["const"]
        yield f"## {event}\n\n{_plain(model['description'])}\n"
        members = {name: value for name, value in model["properties"].items() if name != "event"}
        if members:
            rows = [
                (literal(name), _plain(value.get("description", "")), _type(value, schema["$defs"]))
                for name, value in members.items()
            ]
            yield table(("member", "meaning", "type"), rows)


def _plain(text: str) -> str:
    """Write a docstring's text on one line, its literals as Markdown has them."""
    return " ".join(text.split()).replace("``", "`")


def _type(value: dict[str, Any], definitions: dict[str, Any]) -> str:
    """Name the types of a member.

    >>> _type({"anyOf": [{"type": "number"}, {"type": "null"}]}, {})
    'number or null'
    >>> _type({"enum": ["goes on", "broken"], "type": "string"}, {})
    '`goes on`, `broken`'
    """
    if "anyOf" in value:
        return " or ".join(_type(each, definitions) for each in value["anyOf"])
    for reference in [value.get("$ref"), *(each["$ref"] for each in value.get("allOf", ()))]:
        if reference is not None:
            return _type(definitions[reference.rsplit("/", 1)[1]], definitions)
    if "enum" in value:
        return ", ".join(map(literal, value["enum"]))
    return str(value.get("const") or value["type"])
