"""What a constant or a type holds, read from its value: a table, or a list with links."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from types import UnionType
from typing import TYPE_CHECKING, Any

from numpydoc.docscrape import NumpyDocString

from reference.api.constants import below

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence


def held(value: Any) -> str:
    """Write what a constant holds, as reStructuredText.

    >>> from stimuli import CLAMPED
    >>> print(held(CLAMPED))
    A member of :obj:`~stimuli.IdealEdge`; its value is ``"clamped"``.
    <BLANKLINE>
    """
    if isinstance(value, UnionType):
        return "".join(f"- {_link(one)}: {summary(one)}\n" for one in value.__args__)
    if isinstance(value, Enum):
        return f"A member of {_link(type(value))}; its value is {_code(value.value)}.\n"
    if isinstance(value, Mapping):
        return _table(("name", *_heads(value.values())), _named_rows(value))
    if isinstance(value, tuple):
        return _table(_heads(value), (_cells(one, _heads(value)) for one in value))
    if not is_dataclass(value):
        raise TypeError(f"value must be one that a page can list, got {value!r}")
    told = meanings(type(value))
    rows = ((name, cell, told.get(name, "")) for name, cell in _flat(value).items())
    return _table(("attribute", "value", "meaning"), rows)


def enumerated(kind: type[Enum]) -> str:
    """Write the members of an enumeration: their names, their values, and what they mean.

    >>> from stimuli import IdealEdge
    >>> "clamped" in enumerated(IdealEdge)
    True
    """
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    told = below(body.body) if isinstance(body, ast.ClassDef) else {}
    rows = (
        (name, _plain(one.value), told.get(name) or str(getattr(one, "text", "")))
        for name, one in kind.__members__.items()
    )
    return _table(("member", "value", "meaning"), rows)


def described(kind: type) -> tuple[Field[Any], ...]:
    """Return the fields of a class that carry their meaning with them, as columns of a table do."""
    return tuple(one for one in fields(kind) if "description" in one.metadata)


def attributes(kind: type) -> str:
    """Write the fields of a class that carry their meaning; empty where none does.

    >>> from experiment import TrialRow
    >>> "participant's identifier" in attributes(TrialRow)
    True
    """
    rows = [
        (one.name, str(one.type), str(one.metadata["description"]), _plain(one.metadata["choices"]))
        for one in described(kind)
    ]
    return _table(("attribute", "type", "meaning", "words"), rows) if rows else ""


def meanings(kind: type) -> dict[str, str]:
    """Return what a docstring says of each attribute and parameter, by its name.

    >>> from stimuli import Material
    >>> meanings(Material)["density_kg_m3"]
    'Mass density rho.'
    """
    said = NumpyDocString(inspect.getdoc(kind) or "")
    return {
        name.strip().lstrip("*"): " ".join(one.desc)
        for section in ("Parameters", "Other Parameters", "Attributes")
        for one in said[section]
        for name in one.name.split(",")
    }


def summary(kind: type) -> str:
    """Return the first line of a class's docstring."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def _link(kind: type) -> str:
    return f":obj:`~{kind.__module__.partition('.')[0]}.{kind.__name__}`"


def _heads(values: Iterable[Any]) -> tuple[str, ...]:
    """Return the fields that differ from their default in some value, those inside included."""
    return tuple(dict.fromkeys(name for one in values for name in _flat(one, changed=True)))


def _named_rows(values: Mapping[str, Any]) -> Iterable[Sequence[str]]:
    heads = _heads(values.values())
    return ((f'"{name}"', *_cells(one, heads)) for name, one in values.items())


def _cells(value: Any, heads: Sequence[str]) -> list[str]:
    flat = _flat(value)
    return [flat[head] for head in heads]


def _flat(value: Any, *, changed: bool = False) -> dict[str, str]:
    """Return the fields of a value in words, those of a value within it beside its own."""
    found: dict[str, str] = {}
    for one in fields(value):
        part = getattr(value, one.name)
        if is_dataclass(part):
            found |= _flat(part, changed=changed)
        elif not changed or one.default is MISSING or part != one.default:
            found[one.name] = _plain(part)
    return found


def _plain(value: object) -> str:
    """Return a value as a reader writes it.

    >>> _plain(6.7e10), _plain(("left", "right")), _plain(True), _plain("clamped")
    ('6.7e10', 'left right', 'yes', 'clamped')
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}".replace("e+", "e")
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def _code(value: object) -> str:
    return f'``"{value}"``' if isinstance(value, str) else f"``{value}``"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a table of plain text, whose first column has names of the program."""
    lines = [".. list-table::", "   :header-rows: 1", ""]
    for row in (heads, *([f"``{name}``", *map(_escaped, others)] for name, *others in rows)):
        first, *cells = row
        lines.append(f"   * - {first}")
        lines += [f"     - {cell}".rstrip() for cell in cells]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    """Return a text in which no sign means anything to reStructuredText."""
    return "".join(f"\\{sign}" if sign in "\\*`|_" else sign for sign in " ".join(text.split()))
