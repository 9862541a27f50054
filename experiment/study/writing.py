"""Writing study files: a preset or a file with changed keys, every other key as a comment."""

from __future__ import annotations

import json
import re
import textwrap
import tomllib
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import tomlkit

from experiment.study.base import describe, schema_of
from experiment.study.files import PRESETS
from experiment.study.stimulus import PLANNED_KEYS, Condition
from experiment.study.study import Study, section_models

if TYPE_CHECKING:
    from collections.abc import Mapping

    from experiment.study.base import Section

SCHEMA_FILE: Final = "study.schema.json"
"""The JSON Schema in the folder of a study file, by which editors complete keys."""
_DIRECTIVE: Final = f"#:schema ./{SCHEMA_FILE}\n"
_WIDTH: Final = 100


def preset_text(preset: str) -> str:
    """Return the study file of a preset."""
    return (PRESETS / f"{preset}.toml").read_text("utf-8")


@cache
def discs() -> dict[str, dict[str, Any]]:
    """Return the size and layers of common buzzer discs, by name, as keys of [[actuator]]."""
    tables = tomllib.loads(Path(__file__).with_name("discs.toml").read_text("utf-8"))
    constants = tables.pop("constants")
    return {name: table | constants for name, table in tables.items()}


def changed_text(text: str, sections: Mapping[str, Any]) -> str:
    """Return a study file with other values of keys; None removes a key.

    Comments stay. A list replaces all tables of [[actuator]] or [[condition]], which the file has.
    """
    document = tomlkit.parse(text)
    for name, values in sections.items():
        if isinstance(values, list):
            tables: Any = document[name]
            for table, keys in zip(tables, values, strict=True):
                _set_keys(table, dict.fromkeys(table) | keys)
        else:
            _set_keys(document.setdefault(name, tomlkit.table()), values)
    return tomlkit.dumps(document)


def _set_keys(table: Any, values: Mapping[str, Any]) -> None:
    for key, value in values.items():
        if value is None:
            table.pop(key, None)
        else:
            table[key] = [*map(_plain, value)] if isinstance(value, list) else _plain(value)


def _plain(value: Any) -> Any:
    """Return a whole number without its point."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def aligned(text: str) -> str:
    """Return a study file with the comments behind keys in one column."""
    return re.sub(r"^([a-z][^#\n]*?) +# ", lambda m: f"{m[1]:35} # ", text, flags=re.MULTILINE)


def with_directive(text: str) -> str:
    """Put the line first that names the JSON Schema."""
    return text if text.startswith("#:schema") else _DIRECTIVE + text


def schema_text() -> str:
    """Return the JSON Schema of study files."""
    head = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": "tactstrip-study",
        "title": "tactstrip study",
    }
    schema = head | deepcopy(schema_of(Study))
    for key in PLANNED_KEYS:
        del schema["$defs"][Condition.__name__]["properties"][key]
    return json.dumps(schema, indent=1) + "\n"


def with_every_key(text: str) -> str:
    """Add every key that a study file omits, as a comment with its default."""
    tables = tomllib.loads(text)
    chunks = [chunk.rstrip() for chunk in re.split(r"^(?=\[)", text, flags=re.MULTILINE)]
    for name, model in section_models().items():
        table = tables.get(name, {})
        keys = _commented_keys(model, table[0] if isinstance(table, list) else table)
        headings = (f"[{name}]", f"[[{name}]]")
        positions = [i for i, chunk in enumerate(chunks) if chunk.startswith(headings)]
        if positions:
            chunks[positions[0]] = "\n".join((chunks[positions[0]], *keys))
        else:
            introduction = _comment((model.__doc__ or "").split("\n\n")[0])
            heading = f"# {headings[name == 'condition']}"
            chunks.append("\n".join((introduction, heading, *keys)))
    return "\n\n".join(chunks) + "\n"


def _commented_keys(model: type[Section], given: Mapping[str, Any]) -> list[str]:
    lines = []
    for key, schema in schema_of(model)["properties"].items():
        if key in given or (model is Condition and key in PLANNED_KEYS):
            continue
        default = schema.get("default")
        value = "" if default is None else json.dumps(default, ensure_ascii=False)
        line = f"# {key} = {value}".rstrip()
        comment = "; ".join(filter(None, (schema.get("description"), describe(schema))))
        beside = f"{line:35} # {comment}"
        lines += [beside] if len(beside) <= _WIDTH else [_comment(comment), line]
    return lines


def _comment(text: str) -> str:
    line = " ".join(text.split())
    return textwrap.fill(line, _WIDTH, initial_indent="# ", subsequent_indent="# ")
