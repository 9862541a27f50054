"""The shapes of the JSON that is written and printed: every member with its type."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

from analysis.definitions import DEFINITIONS
from reference.markdown import literal, table
from reference.sample import CONDITIONS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from reference.sample import Sample

_TYPES: Final = {
    str: "text", bool: "true or false", int: "whole number", float: "number",
    type(None): "null", list: "list", dict: "object",
}  # fmt: skip
_FEW: Final = 5
"""A study in a plan has all its keys, which have a page of their own."""


def members(*values: Any) -> dict[str, str]:
    """Return every member of JSON values by its path, with the types that it has in any of them.

    >>> members({"a": [{"b": 1}, {"b": None}], "c": []}, {"c": ["x"]})
    {'a[].b': 'whole number or null', 'c': 'list', 'c[]': 'text'}
    """
    found: dict[str, dict[str, None]] = {}
    for value in values:
        for place, kind in _walk(value, ""):
            found.setdefault(place, {})[kind] = None
    return {place: " or ".join(kinds) for place, kinds in found.items()}


def _walk(value: Any, path: str) -> Iterator[tuple[str, str]]:
    inside: list[tuple[str, Any]] = []
    if isinstance(value, dict):
        inside = [
            (f"{path}.{'CONDITION' if name in CONDITIONS else name}".removeprefix("."), one)
            for name, one in value.items()
        ]
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
            "Every member with its type, as a study of two conditions has them, what a check "
            "prints also of the paper's; `[]` stands for each item of a list, `CONDITION` for the "
            "name of one. A version of the layout, `schema`, stands in each file; a file of "
            "another version is refused. What is not known is null, or for one kind of study "
            "only.\n"
        ),
    ]
    shapes = {
        "tactstrip check --json": sample.checks,
        "tactstrip bursts --json": [sample.bursts],
        "tactstrip audit --json": [sample.audit],
        "plan.json": [_read(sample.session / "plan.json")],
        "header.json": [_read(sample.session / "header.json")],
        "summary.json": [_read(sample.analysis / "summary.json")],
    }
    for name, values in shapes.items():
        rows = [
            (literal(path), kind, known.get(path.rsplit(".", maxsplit=1)[-1], ""))
            for path, kind in members(*map(_shortened, values)).items()
        ]
        told += [f"## {name}\n", table(("member", "type", "meaning"), rows)]
    return "\n".join(told)


def _shortened(value: Any) -> Any:
    """Leave out what other pages list: the keys of the study, the definitions of columns."""
    return {
        name: {} if name == "definitions" or (name == "study" and len(one) > _FEW) else one
        for name, one in value.items()
    }


def _read(path: Any) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))
