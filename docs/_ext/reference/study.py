"""The keys of study.toml, read from the sections that read them."""

from __future__ import annotations

import json
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Union, get_args, get_origin

from pydantic_core import PydanticUndefined

from experiment.study.sections.stimulus import Condition, Stimulus
from experiment.study.sections.table import KeyRange, file_keys, range_of
from experiment.study.study import Study
from reference.markdown import code, literal, prose, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydantic.fields import FieldInfo

_UNITS: Final = {
    "_kg_m3": "kg/m³", "_n_s_m": "N s/m", "_n_m": "N/m", "_pm_v": "pm/V", "_gpa": "GPa",
    "_vpp": "V peak to peak", "_dbfs": "dB re full scale", "_dba": "dB(A)", "_cm2": "cm²",
    "_mm": "mm", "_um": "µm", "_us": "µs", "_ms": "ms", "_hz": "Hz", "_db": "dB", "_px": "pixels",
    "_g": "g", "_n": "N", "_s": "s",
}  # fmt: skip
"""By how a key ends, the longest ending first."""
_PLAIN: Final = {str: "text", int: "whole number", float: "number", bool: "true or false"}
PLANNED: Final = {*file_keys(Condition)} - {*file_keys(Stimulus), "name"}
"""Keys of a condition that are found when a file is read or levels are placed; a plan has them."""
EXAMPLES: Final = Path(__file__).with_name("examples.toml")
"""Of keys whose default shows nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key of study.toml."""

    section: str
    name: str
    type: str
    unit: str
    range: str
    default: str
    meaning: str
    example: str


def sections() -> dict[str, type]:
    """Return the section classes by the names that a file has for them."""
    return {name: _class_of(field.annotation) for name, field in file_keys(Study).items()}


def study_keys() -> Iterator[Key]:
    """Yield every key that a file may have, in the order of `tactstrip init`."""
    for section, cls in sections().items():
        for name, field in file_keys(cls).items():
            if section != "condition" or name not in PLANNED:
                yield _key(section, name, field)


def _key(section: str, name: str, field: FieldInfo) -> Key:
    kind = _type(field.annotation)
    limits = range_of(field.annotation, tuple(field.metadata)) or _items_range(field.annotation)
    default = _default(field)
    return Key(
        section=section,
        name=name,
        type=kind,
        unit=next((unit for end, unit in _UNITS.items() if name.endswith(end)), ""),
        range="" if limits is None else _between(limits),
        default=default,
        meaning=field.description or "",
        example=f"{name} = {_example(name, default, kind, limits)}",
    )


def _class_of(kind: Any) -> type:
    """Find the section in ``tuple[Annotated[Section, ...], ...]``."""
    while not hasattr(kind, "__pydantic_fields__"):
        kind = get_args(kind)[0]
    found: type = kind
    return found


def _type(kind: Any) -> str:
    if kind in _PLAIN:
        return _PLAIN[kind]
    origin, inside = get_origin(kind), get_args(kind)
    if origin is Annotated:
        return _type(inside[0])
    if origin in {Union, UnionType}:
        return " or ".join(dict.fromkeys(_type(one) for one in inside if one is not NoneType))
    if origin is Literal:
        return " or ".join(json.dumps(word) for word in inside)
    if origin is tuple:
        many = "" if inside[-1] is Ellipsis else f"{len(inside)} "
        return f"list of {many}" + {"number": "numbers", "whole number": "whole numbers"}.get(
            _type(inside[0]), "texts" if inside[0] is str else "tables"
        )
    return "table"


def _items_range(kind: Any) -> KeyRange | None:
    """Return the limits of the items of a list."""
    for one in (kind, *get_args(kind)):
        if get_origin(one) is tuple:
            return range_of(get_args(one)[0])
    return None


def _between(limits: KeyRange) -> str:
    signs = ((">", limits.gt), ("≥", limits.ge), ("≤", limits.le), ("<", limits.lt))
    return ", ".join(f"{sign} {limit:g}" for sign, limit in signs if limit is not None)


def _default(field: FieldInfo) -> str:
    if field.default is PydanticUndefined or field.default is None:
        return ""
    return _toml(field.default)


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, float):
        return f"{value:g}"
    return json.dumps(value, ensure_ascii=False)


def _example(name: str, default: str, kind: str, limits: KeyRange | None) -> str:
    if default not in {"", '""', "[]"}:
        return default
    if name in (known := _examples()):
        return _inline(known[name])
    if kind.startswith('"'):
        return kind.split(" or ", maxsplit=1)[0]
    if "number" in kind and limits is not None:
        return f"[{_inside(limits)}]" if kind.startswith("list") else _inside(limits)
    return '["..."]' if kind.startswith("list") else '"..."'


@cache
def _examples() -> dict[str, Any]:
    return tomllib.loads(EXAMPLES.read_text(encoding="utf-8"))


def _inline(value: Any) -> str:
    """Write a value of TOML in a line.

    >>> _inline([{"name": "one"}]), _inline([1.5, 2])
    ('[{ name = "one" }]', '[1.5, 2]')
    """
    if isinstance(value, list):
        return f"[{', '.join(map(_inline, value))}]"
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_inline(one)}' for key, one in value.items())} }}"
    return _toml(value)


def _inside(limits: KeyRange) -> str:
    """Return a plain number that the limits hold: 1, or what is nearest to it of powers of ten."""
    tried = sorted((10.0**power for power in range(-4, 5)), key=lambda one: abs(one - 1))
    return next(f"{one:g}" for one in (*tried, 0.5, -1.0, -10.0) if limits.hold(one))


def page() -> str:
    """Write the page."""
    told = [
        "# Keys of study.toml\n",
        (
            "Every key may be left out; its default is then that of the paper's preset, or none. "
            "`tactstrip init` writes a file with all of them, `tactstrip check` says what is wrong "
            "with one. A key's unit is the end of its name. What sections must agree on is refused "
            "in a line that names both keys.\n"
        ),
    ]
    every = [*study_keys()]
    for section, cls in sections().items():
        several = section in {"actuator", "condition"}
        told.append(f"## {section}\n\n{prose(cls.__doc__)}\n")
        here = [key for key in every if key.section == section]
        rows = [
            (
                literal(key.name), key.meaning, key.type, key.unit, key.range, literal(key.default),
            )
            for key in here
        ]  # fmt: skip
        heads = ("key", "meaning", "type", "unit", "range", "default")
        used = [place for place in range(len(heads)) if any(row[place] for row in rows)]
        columns = [[row[place] for place in used] for row in (heads, *rows)]
        told.append(table(columns[0], columns[1:]))
        heading = f"[[{section}]]" if several else f"[{section}]"
        told.append("For example, each key by itself:\n")
        told.append(code("\n".join([heading, *(key.example for key in here)]), "toml"))
    return "\n".join(told)
