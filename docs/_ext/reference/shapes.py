"""The shapes of the JSON that is written and printed: every member with its type."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from analysis.definitions import DEFINITIONS
from reference.markdown import literal, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reference.sample import Sample

_TYPES: Final = {
    str: "text", bool: "true or false", int: "whole number", float: "number",
    type(None): "null", list: "list", dict: "object",
}  # fmt: skip


def members(value: Any, path: str = "") -> dict[str, str]:
    """Return every member of a JSON value by its path, with the types that it has.

    >>> members({"a": [{"b": 1}, {"b": None}], "c": []})
    {'a[].b': 'whole number or null', 'c': 'list'}
    """
    found: dict[str, dict[str, None]] = {}
    for place, kind in _walk(value, path):
        found.setdefault(place, {})[kind] = None
    return {place: " or ".join(kinds) for place, kinds in found.items()}


def _walk(value: Any, path: str) -> Iterator[tuple[str, str]]:
    inside: list[tuple[str, Any]] = []
    if isinstance(value, dict):
        inside = [(f"{path}.{name}".removeprefix("."), one) for name, one in value.items()]
    elif isinstance(value, list):
        inside = [(f"{path}[]", one) for one in value]
    if not inside:
        yield path, _TYPES[type(value)]
    for place, one in inside:
        yield from _walk(one, place)


def page(sample: Sample) -> str:
    """Write the page."""
    known = {name: text for names, text in DEFINITIONS.items() for name in names.split(", ")}
    told = [
        "# JSON that is written and printed\n",
        (
            "Every member with its type, as a study of two conditions has them; `[]` stands for "
            "each item of a list. A version of the layout, `schema`, stands in each file; a file "
            "of another version is refused.\n"
        ),
    ]
    shapes = {
        "tactstrip check --json": sample.check,
        "tactstrip audit --json": sample.audit,
        "plan.json": _read(sample.session / "plan.json"),
        "header.json": _read(sample.session / "header.json"),
        "summary.json": _read(sample.analysis / "summary.json"),
    }
    for name, value in shapes.items():
        rows = [
            (literal(path), kind, known.get(path.rsplit(".", maxsplit=1)[-1], ""))
            for path, kind in members(_shortened(value)).items()
        ]
        told += [f"## {name}\n", table(("member", "type", "meaning"), rows)]
    return "\n".join(told)


def _shortened(value: Any) -> Any:
    """Leave out what other pages list: the keys of the study, the definitions of columns."""
    return {
        name: {} if name in {"definitions", "study"} and isinstance(one, dict) else one
        for name, one in value.items()
    }


def _read(path: Any) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))
