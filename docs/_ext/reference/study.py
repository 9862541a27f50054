"""The page of study keys, written from the models that read a study file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from experiment.study.base import describe, schema_of
from experiment.study.stimulus import PLANNED_KEYS
from experiment.study.study import section_models
from reference.markdown import code, literal, prose, table

if TYPE_CHECKING:
    from collections.abc import Iterator


EXAMPLES: Final = tuple(
    Path(__file__).with_name("studies") / f"example-{name}.toml"
    for name in ("discs", "layers", "click")
)
"""Studies that set every key whose default does not show its form."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key of a study file."""

    section: str
    name: str
    allowed: str
    default: str
    meaning: str


def study_keys() -> Iterator[Key]:
    """Yield every key that a file may have, in the order of the models."""
    for section, model in section_models().items():
        schema = schema_of(model)
        for name, key in schema["properties"].items():
            if section == "condition" and name in PLANNED_KEYS:
                continue
            default = key.get("default")
            yield Key(
                section=section,
                name=name,
                allowed=describe(key),
                default="required"
                if name in schema.get("required", [])
                else ""
                if default is None
                else literal(json.dumps(default, ensure_ascii=False)),
                meaning=key.get("description", "").strip(),
            )


def page() -> str:
    """Write the page."""
    texts = [
        "# Keys of study files\n",
        (
            "`[strip]` and an `[[actuator]]` for each finger are required; every other section and "
            "key can be omitted and then has its default. The end of a key is its unit. "
            "`tactstrip init` writes a study file, with `--all` every key as a comment; "
            "`tactstrip check` lists what is wrong with one.\n"
        ),
    ]
    keys = list(study_keys())
    for section, model in section_models().items():
        texts.append(f"## {section}\n\n{prose(model.__doc__)}\n")
        rows = [
            (literal(key.name), key.meaning, key.allowed, key.default)
            for key in keys
            if key.section == section
        ]
        texts.append(table(("key", "meaning", "allowed", "default"), rows))
    texts.append("## Examples\n")
    texts += [code(path.read_text("utf-8"), "toml") for path in EXAMPLES]
    return "\n".join(texts)
