"""What of a study its file states, and what `tactstrip init` wrote into the file by itself."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from experiment.study.sections.table import Stated, Table, file_keys, stated_of, with_stated
from experiment.study.study import Study
from experiment.terms.checks import unknown_key

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

INIT: Final = "init"
"""The section that `tactstrip init` writes about itself; it is no part of the study."""

_KEYS: Final = ("told", "chosen")


def without_init(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a study file, told apart what of them `tactstrip init` wrote by itself.

    That is what is still as it was chosen, or as the paper's study has it; what init was told is
    stated by the lab, whatever its value.
    """
    if INIT not in tables:
        return tables
    told, chosen = _init(tables[INIT])
    found: dict[str, Any] = {}
    for name, one in tables.items():
        if isinstance(one, list):
            found[name] = [_apart(name, table, told, chosen) for table in one]
        elif name != INIT:
            found[name] = _apart(name, one, told, chosen)
    return found


def _init(table: Any) -> tuple[frozenset[str], dict[str, Any]]:
    """Return the paths of what init was told, and the values that it chose by their paths."""
    found = table if isinstance(table, dict) else {"": table}
    told, chosen = found.get("told", []), found.get("chosen", {})
    listed = isinstance(told, list) and all(isinstance(path, str) for path in told)
    if not listed or not isinstance(chosen, dict) or set(found) - set(_KEYS):
        raise ValueError(
            f"{INIT} must be left as `tactstrip init` wrote it, told = [...] and chosen = {{...}}, "
            f"or be removed, so that all in the file is told as yours; got {table!r}"
        )
    for path in (*told, *chosen):
        if path not in _paths():
            raise ValueError(f"{INIT}: {unknown_key(path, _paths())}")
    return frozenset(told), chosen


@cache
def _paths() -> frozenset[str]:
    """Return all keys of a study with their sections."""
    sections = Study().sections().items()
    kinds = ((name, type(one[0] if isinstance(one, tuple) else one)) for name, one in sections)
    return frozenset(f"{name}.{key}" for name, kind in kinds for key in file_keys(kind))


def _apart(name: str, table: Any, told: frozenset[str], chosen: dict[str, Any]) -> Any:
    if not isinstance(table, dict):
        return table
    still = {key for key in table if table[key] == chosen.get(f"{name}.{key}")}
    papers = _papers_section(name, table.get("side"))
    stated = {
        key: value
        for key, value in table.items()
        if f"{name}.{key}" in told
        or (key not in still and not (key in papers and papers[key] == value))
    }
    kept = frozenset(still - stated.keys())
    return Table(table, Stated(keys=stated, chosen=kept))


def chosen_values(study: Study, told: Iterable[str], tried: Iterable[str]) -> dict[str, Any]:
    """Return the numbers of a study that `tactstrip init` chose, by their sections and keys.

    Those are neither what it was `told`, such as strip.width_mm, nor the paper's study's, but for
    what it `tried` until it was fit.
    """
    paths, always, chosen = frozenset(told), frozenset(tried), dict[str, Any]()
    for name, one in json.loads(study.canonical).items():
        for table in one if isinstance(one, list) else [one]:
            papers = _papers_section(name, table.get("side"))
            for key, value in table.items() if name != "condition" else ():
                path = f"{name}.{key}"
                is_new = path in always or value != papers.get(key)
                if _is_number(value) and path not in paths and is_new:
                    chosen[path] = value
    return chosen


def not_recorded(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a plan's study, which has all keys, whoever stated them."""
    unknown = Stated(keys=None)
    return {
        name: [Table(table, unknown) if isinstance(table, dict) else table for table in one]
        if isinstance(one, list)
        else Table(one, unknown)
        if isinstance(one, dict)
        else one
        for name, one in tables.items()
    }


def as_stated(study: Study, by: Study, **more: Mapping[str, Any]) -> Study:
    """Tell of a study what another one, which it was made of, states, and more of its sections."""
    for name, table in by.sections().items():
        several = isinstance(table, tuple)
        new = study.sections()[name]
        for one, old in zip(new if several else [new], table if several else [table], strict=True):
            stated = stated_of(old)
            if name in more and stated.keys is not None:
                stated = replace(stated, keys={**stated.keys, **more[name]})
            with_stated(one, stated)
    return study


def _is_number(value: object) -> bool:
    first = value[0] if isinstance(value, list) and value else value
    return isinstance(first, int | float) and not isinstance(first, bool)


@cache
def _papers() -> dict[str, Any]:
    tables: dict[str, Any] = json.loads(Study().canonical)
    return tables


def _papers_section(name: str, side: object) -> dict[str, Any]:
    """Return a section of the paper's study; of its actuators the one of a side.

    Conditions are nobody's but the lab's.
    """
    if name == "condition":
        return {}
    one = _papers().get(name, {})
    tables = one if isinstance(one, list) else [one]
    return next((table for table in tables if table.get("side") == side), {})
