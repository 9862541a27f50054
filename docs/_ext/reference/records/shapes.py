"""The shapes of the JSON that is written and printed: every member with its type and meaning."""

from __future__ import annotations

import re
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final

from reference.markdown import literal, table
from reference.records import members

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from reference.sample import Sample

_TYPES: Final = {
    str: "text",
    bool: "true or false",
    int: "whole number",
    float: "number",
    type(None): "null",
    list: "list",
    dict: "object",
}
_INTRODUCTION: Final = """\
# JSON that is written and printed

Every member with its type, as studies of several kinds have them. `[]` stands for each item of a
list, a word in capitals for names: `CONDITION`, for example, for that of a condition. What is not
known, or belongs to another kind of study, is null, `n/a` in header.json, or left out. `schema` is
the version of the layout; a plan of another version is refused.
"""


def shape(*values: Any, named: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return every member of JSON values by its path, with the types that it has in any of them.

    `named` has the objects whose members are names, and the word that stands for these.

    >>> shape({"a": [{"b": 1}, {"b": None}], "c": []}, {"c": ["x"], "d": 2, "a": None})
    {'a': 'list or null', 'a[].b': 'whole number or null', 'c[]': 'text', 'd': 'whole number'}
    >>> shape({"of": {"one": 1, "two": 2}}, named={"of": "NAME"})
    {'of.NAME': 'whole number'}
    """
    found: dict[str, dict[str, None]] = {}
    order: dict[str, int] = {}
    for value in values:
        for path, kind in _walk(value, "", named or {}):
            found.setdefault(path, {})[kind] = None
            for prefix in _prefixes(path):
                order.setdefault(prefix, len(order))
    told = {}
    for path in sorted(found, key=lambda one: [order[prefix] for prefix in _prefixes(one)]):
        listed = any(other.startswith(f"{path}[]") for other in found)
        filled = listed or any(other.startswith(f"{path}.") for other in found)
        if filled:
            others = [kind for kind in found[path] if kind not in {"list", "object"}]
            if not others:
                continue
            found[path] = dict.fromkeys(["list" if listed else "object", *others])
        told[path] = " or ".join(sorted(found[path], key="null".__eq__))  # null last
    return told


def kind_of(values: list[Any]) -> str:
    """Return the types of some values, each by itself.

    >>> kind_of([1, None, ["a"], {"b": 2}])
    'whole number or list of texts or object or null'
    """
    kinds = [
        f"list of {_TYPES[type(value[0])]}s"
        if isinstance(value, list) and value
        else _TYPES[type(value)]
        for value in values
    ]
    return " or ".join(sorted(dict.fromkeys(kinds), key="null".__eq__))


def _walk(value: Any, path: str, named: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    inside: list[tuple[str, Any]] = []
    if isinstance(value, dict):
        inside = [
            (f"{path}.{named.get(path, name)}".removeprefix("."), one)
            for name, one in value.items()
        ]
    elif isinstance(value, list):
        inside = [(f"{path}[]", one) for one in value]
    if not inside:
        yield path, _TYPES[type(value)]
    for place, one in inside:
        yield from _walk(one, place, named)


def _prefixes(path: str) -> list[str]:
    """Return a member and those it is within.

    >>> _prefixes("a[].b.c")
    ['a', 'a[].b', 'a[].b.c']
    """
    within = accumulate(path.split("."), lambda before, name: f"{before}.{name}")
    return [one.removesuffix("[]") for one in within]


def page(sample: Sample) -> str:
    """Write the page; a ValueError names members that nobody says the meaning of."""
    told = [_INTRODUCTION]
    for name, values in sample.shapes.items():
        if name == "journal.jsonl":  # which has a page of its own
            continue
        told += [f"## {name}\n", table(("member", "type", "meaning"), rows(name, values))]
    return "\n".join(told)


def rows(name: str, values: list[Any]) -> list[tuple[str, str, str]]:
    """Return the members of a file or of what a command prints, each with type and meaning.

    ValueError where one has none, where its meaning speaks of null and its type does not, and where
    a meaning is told that none has.
    """
    about = members.about(name)
    whole = shape(*map(about.without_the_study, values), named=about.named)
    found = [
        (literal(path), about.kind(path, kind), about.meaning(path))
        for path, kind in about.shortened(whole).items()
    ]
    wrong = [
        path
        for path, kind, meaning in found
        if not meaning
        or kind in {"null", "list"}
        or (re.search(r"\bnull\b", meaning) and "null" not in kind)
    ]
    if wrong := wrong + about.unused(whole):
        raise ValueError(f"{members.TOLD.name}: of {name} not told, or told in vain: {wrong}")
    return found
