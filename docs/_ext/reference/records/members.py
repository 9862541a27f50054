"""What the members of JSON mean: as the classes that hold them say, or as told beside this file."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from experiment.study.base import file_keys
from reference.api.held import meanings
from reference.markdown import literal
from reference.study import PLANNED, study_keys
from reference.tables import defined

if TYPE_CHECKING:
    from collections.abc import Mapping

TOLD: Final = Path(__file__).with_suffix(".toml")
_FEW: Final = 5
"""A study in a plan has all its keys, which have a page of their own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class About:
    """What is known of the members of a file, or of what a command prints.

    Attributes
    ----------
    name : str
        The file, or the command.
    named : mapping of str to str
        Objects whose members are names, and the word that stands for these.
    sections : mapping of str to str
        Objects that have the keys of a section of the study.
    alike : mapping of str to str
        Objects that are as those of another path.
    classes : mapping of str to str
        Objects that a class of the program holds, as ``module:Class``.
    types : mapping of str to str
        Types of which the samples have none, or not all.
    meanings : mapping of str to str
        What is told by hand, by path or by how a path ends.
    """

    name: str
    named: Mapping[str, str]
    sections: Mapping[str, str]
    alike: Mapping[str, str]
    classes: Mapping[str, str]
    types: Mapping[str, str]
    meanings: Mapping[str, str]

    def without_the_study(self, value: Any) -> Any:
        """Leave out what other pages list: the keys of the study, the definitions of columns."""
        return {
            name: {}
            if name == "definitions"
            else _planned(one)
            if name == "study" and _is_whole(one)
            else one
            for name, one in value.items()
        }

    def shortened(self, shape: Mapping[str, str]) -> dict[str, str]:
        """Tell once what another object, or a section of the study, has as well."""
        told: dict[str, str] = {}
        for path, kind in shape.items():
            for before in self.meanings:
                if before != path and _within(path, before) and before not in told:
                    told[before] = _container(path, before)
            whole = next((one for one in (*self.alike, *self.sections) if _within(path, one)), path)
            section = self.sections.get(whole)
            key = path.removeprefix(f"{whole}.").removesuffix("[]")
            if whole == path or (section and key not in _keys(section)):
                told[path] = kind
            else:
                told.setdefault(whole, _container(path, whole))
        return told | {path: kind for path, kind in self.types.items() if path not in told}

    def kind(self, path: str, kind: str) -> str:
        """Return a member's type: as it is told, or as the samples have it."""
        return self.types.get(path, kind)

    def meaning(self, path: str) -> str:
        """Return what a member means; nothing where nobody says it."""
        held = self._held(path)
        words = [self.meanings[path]] if path in self.meanings else []
        if path in self.alike and held is not None and not words:
            words.append(held)
        if path in self.sections:
            words.append(f"the keys of {literal(f'[{self.sections[path]}]')} in the study")
        if path in self.alike:
            words.append(f"with the members of {literal(self.alike[path])}")
        if words:
            return "; ".join(words)
        if held is not None:
            return held
        names = path.split(".")
        suffixes = [".".join(names[place:]) for place in range(len(names))]
        tables = [self.meanings, _told()["every"]]
        tables += [_defined()] if self.name == "summary.json" else []
        return next((known[one] for one in suffixes for known in tables if one in known), "")

    def unused(self, shape: Mapping[str, str]) -> list[str]:
        """Return what is told by hand of members that nothing has."""
        paths = [*self.shortened(shape), *shape]
        ends = [f".{path}" for path in paths]
        return [one for one in self.meanings if not any(end.endswith(f".{one}") for end in ends)]

    def _held(self, path: str) -> str | None:
        """Return what a class says of a member that it holds."""
        before, _, name = path.rpartition(".")
        of = _of_class(self.classes[before]) if before in self.classes else {}
        return of.get(re.sub(r"(\[\])+$", "", name))


def _planned(study: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a plan's study has beside the keys of its file."""
    return {
        "condition": [
            {name: value for name, value in one.items() if name in PLANNED}
            for one in study["condition"]
        ]
    }


def _is_whole(study: Any) -> bool:
    """Tell whether a study has all its keys, as in a plan."""
    return isinstance(study, dict) and len(study) > _FEW


def _within(path: str, whole: str) -> bool:
    """Tell whether a path is that of an object, or below it.

    >>> _within("a.b", "a"), _within("a[].b", "a"), _within("a", "a"), _within("ab", "a")
    (True, True, True, False)
    """
    return path == whole or path.startswith((f"{whole}.", f"{whole}[]"))


def _container(path: str, whole: str) -> str:
    return "list" if path.startswith(f"{whole}[]") else "object"


def about(name: str) -> About:
    """Return what is known of a file, or of what a command prints."""
    of = dict(_told()[name])
    parts = {part: of.pop(part, {}) for part in ("named", "sections", "alike", "classes", "types")}
    return About(name=name, **parts, meanings=of)


@cache
def _told() -> dict[str, dict[str, Any]]:
    return tomllib.loads(TOLD.read_text(encoding="utf-8"))


@cache
def _keys(section: str) -> frozenset[str]:
    return frozenset(key.name for key in study_keys() if key.section == section)


@cache
def _defined() -> dict[str, str]:
    """Return what the columns of an analysis mean, by their names, with _a and _b of conditions."""
    return {f"{name}{end}": text for end in ("_a", "_b", "") for name, text in defined().items()}


def _in_json(text: str) -> str:
    """Write a sentence of a docstring as the others of the page are.

    >>> _in_json("How many; ``None`` where nobody counts.")
    'how many; null where nobody counts'
    """
    words = text.replace("``None``", "null").replace("``", "`").removesuffix(".")
    first = words.split(maxsplit=1)[0] if words else ""
    return words if first.isupper() else words[:1].lower() + words[1:]


@cache
def _of_class(name: str) -> dict[str, str]:
    """Return what a class, ``module:Class``, says of what it holds, by name.

    >>> _of_class("device.driver:Identity")["bits"]
    'of its converters'
    """
    module, _, kind = name.partition(":")
    held = getattr(import_module(module), kind)
    told = {name: field.description or "" for name, field in file_keys(held).items()}
    return {one: _in_json(text) for one, text in (told | meanings(held)).items()}
