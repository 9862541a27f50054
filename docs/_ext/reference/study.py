"""The keys of study.toml, read from the sections that read them."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Union, get_args, get_origin

from experiment.study.actuator import paper_actuators
from experiment.study.base import KeyRange, file_keys, range_of
from experiment.study.files import paper_study
from experiment.study.simulation import PAPER_THRESHOLD_UM, THRESHOLD_VPP
from experiment.study.stimulus import Condition, Stimulus
from experiment.study.study import Study
from reference.markdown import code, literal, prose, table

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pydantic.fields import FieldInfo

_UNITS: Final = {
    "_kg_m3": "kg/m³",
    "_n_s_m": "N s/m",
    "_n_m": "N/m",
    "_pm_v": "pm/V",
    "_gpa": "GPa",
    "_vpp": "V peak to peak",
    "_dbfs": "dB re full scale",
    "_dba": "dB(A)",
    "_cm2": "cm²",
    "_mm": "mm",
    "_um": "µm",
    "_us": "µs",
    "_ms": "ms",
    "_hz": "Hz",
    "_db": "dB",
    "_px": "pixels",
    "_g": "g",
    "_n": "N",
    "_s": "s",
}
"""By how a key ends, the longest ending first."""
_PLAIN: Final = {str: "text", int: "whole number", float: "number", bool: "true or false"}
PLANNED: Final = {*file_keys(Condition)} - {*file_keys(Stimulus), "name"}
"""Keys of a condition that are found when a file is read or levels are placed; a plan has them."""
EXAMPLES: Final = tuple(
    Path(__file__).with_name("studies") / f"example-{name}.toml"
    for name in ("discs", "layers", "click")
)
"""Studies that have an example of every key whose default shows nothing."""
_LEFT_OUT: Final = {
    ("actuator", "y_mm"): "half of `strip.width_mm`",
    ("actuator", "diameter_mm"): "required of a disc",
    ("actuator", "length_x_mm"): "required of others",
    ("actuator", "length_y_mm"): "required of others",
    ("condition", "accept_unfit"): "that of `[burst]`, where all of the stimulus is",
    ("simulation", "threshold_um"): "where displacements are known",
    ("simulation", "threshold_vpp"): "where they are not",
}
"""What is filled in where a key is left out, as far as no default says it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key of study.toml; `left_out` is what is to be said of its default."""

    section: str
    name: str
    type: str
    unit: str
    range: str
    default: str
    left_out: str
    meaning: str


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
    default, left_out = _default(section, name, field)
    return Key(
        section=section,
        name=name,
        type=kind,
        unit=next((unit for end, unit in _UNITS.items() if name.endswith(end)), ""),
        range="" if limits is None else _between(limits),
        default=default,
        left_out=left_out,
        meaning=field.description or "",
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


def _default(section: str, name: str, field: FieldInfo) -> tuple[str, str]:
    """Return what an empty file has for a key, and words where that is not the whole."""
    said = _LEFT_OUT.get((section, name), "")
    if section == "condition" and name in file_keys(Stimulus):
        return "", said or "that of `[burst]`"
    if field.is_required():
        return "", said or "required"
    if field.default is not None:
        return _toml(field.default), said
    if section == "simulation":
        found = {"threshold_um": PAPER_THRESHOLD_UM, "threshold_vpp": THRESHOLD_VPP}.get(name)
    else:
        found = getattr(paper_study().plate, name) if section == "strip" else None
    return ("", said) if found is None else (_toml(found), said or "of the paper's plate")


def _toml(value: Any) -> str:
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, float):
        return f"{value:g}"
    return json.dumps(value, ensure_ascii=False)


def examples(section: str) -> Iterator[tuple[str, str]]:
    """Yield a section of each example that has it, as it stands there, with the study's name."""
    for path in EXAMPLES:
        text = path.read_text(encoding="utf-8")
        parts = re.split(rf"^(?=\[+(?!\[*{section}\])[a-z_]+\]+$)", text, flags=re.MULTILINE)
        begins = rf"(?=^\[+{section}\]+$)"
        for part in parts:
            if found := re.search(begins, part, flags=re.MULTILINE):
                yield tomllib.loads(text)["study"]["name"], part[found.start() :].strip()


def _papers(section: str) -> str:
    """Say what a file has that has none of several sections."""
    if section == "condition":
        (one,) = paper_study().conditions
        return f"Without any there is one, {literal(one.name)}."
    discs = paper_actuators()
    alike = [
        f"`{key} = {_toml(value)}`" for key, value in discs[0].items() if discs[1][key] == value
    ]
    places = " and ".join(f"{_toml(disc['x_mm'])}" for disc in discs)
    return (
        f"Without any the paper's plate has the paper's discs: left and right at `x_mm` {places}, "
        f"each with {', '.join(alike)}; what was measured of them only with its length and "
        "edges. Of another plate they are required."
    )


def page() -> str:
    """Write the page."""
    told = [
        "# Keys of study.toml\n",
        (
            "Every section may be left out, and of a section every key that is not required: an "
            "empty file is the paper's study. A default of the paper's plate holds where width and "
            "thickness are the paper's and no material is named; of another plate the key, or what "
            "takes its place, must be stated. "
            "`tactstrip init` writes a file with all keys, `tactstrip check` says what is wrong "
            "with one. A key's unit is the end of its name. What sections must agree on is refused "
            "in a line that names both keys. The examples are from studies that can be read.\n"
        ),
    ]
    every = [*study_keys()]
    for section, cls in sections().items():
        told.append(f"## {section}\n\n{prose(cls.__doc__)}\n")
        if section in {"actuator", "condition"}:
            told.append(f"{_papers(section)}\n")
        here = [key for key in every if key.section == section]
        rows = [
            (
                literal(key.name),
                key.meaning,
                key.type,
                key.unit,
                key.range,
                " ".join(filter(None, (literal(key.default), key.left_out))),
            )
            for key in here
        ]
        heads = ("key", "meaning", "type", "unit", "range", "default")
        used = [place for place in range(len(heads)) if any(row[place] for row in rows)]
        columns = [[row[place] for place in used] for row in (heads, *rows)]
        told.append(table(columns[0], columns[1:]))
        told += [
            f"In the study {literal(name)}:\n\n{code(text, 'toml')}"
            for name, text in examples(section)
        ]
    return "\n".join(told)
