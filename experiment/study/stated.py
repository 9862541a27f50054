"""What of a study its file states, and what `tactstrip init` wrote into the file by itself."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

from experiment.names import unknown_key
from experiment.study.base import Stated, Table, file_keys, stated_of, with_stated
from experiment.study.study import Study

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

INIT: Final = "init"
"""The section that `tactstrip init` writes about itself; it is no part of the study."""

_KEYS: Final = ("told", "left_out", "chosen")
_OF_ITS_OWN: Final = "other"
"""The side of actuators that `tactstrip init` writes none of."""


def without_init(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables of a study file, told apart what of them `tactstrip init` wrote by itself.

    That is what is still as init wrote it: as it chose it, or as the paper's study has it. What
    init was told or left out, and what was changed, is stated by the lab, whatever its value.
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
    """Return the paths of what init was told or left out, and what it chose by its paths."""
    found = table if isinstance(table, dict) else {"": table}
    told, chosen = found.get("told", []), found.get("chosen", {})
    left_out = found.get("left_out", [])
    listed = all(
        isinstance(paths, list) and all(isinstance(path, str) for path in paths)
        for paths in (told, left_out)
    )
    if not listed or not isinstance(chosen, dict) or set(found) - set(_KEYS):
        raise ValueError(
            f"{INIT} must be left as `tactstrip init` wrote it, told = [...], left_out = [...] and "
            f"chosen = {{...}}, or be removed, so that all in the file is told as yours; got "
            f"{table!r}"
        )
    for path in (*told, *left_out, *chosen):
        if path not in _paths():
            raise ValueError(f"{INIT}: {unknown_key(path, _paths())}")
    return frozenset((*told, *left_out)), chosen


@cache
def _paths() -> frozenset[str]:
    """Return all keys of a study with their sections."""
    sections = Study().sections().items()
    kinds = ((name, type(one[0] if isinstance(one, tuple) else one)) for name, one in sections)
    return frozenset(f"{name}.{key}" for name, kind in kinds for key in file_keys(kind))


def _apart(name: str, table: Any, told: frozenset[str], chosen: dict[str, Any]) -> Any:
    if not isinstance(table, dict) or table.get("side") == _OF_ITS_OWN:
        return table
    papers = _papers_section(name, table.get("side"))
    written = papers | {key: chosen[path] for key in table if (path := f"{name}.{key}") in chosen}
    stated = {
        key: value
        for key, value in table.items()
        if f"{name}.{key}" in told or key not in written or written[key] != value
    }
    kept = frozenset(key for key in table.keys() - stated.keys() if f"{name}.{key}" in chosen)
    return Table(table, Stated(keys=stated, chosen=kept))


def chosen_values(study: Study, told: Iterable[str], tried: Iterable[str]) -> dict[str, Any]:
    """Return what of a study `tactstrip init` chose, by its sections and keys.

    That is neither what it was `told`, such as strip.width_mm, nor the paper's study's, but for
    what it `tried` until it was fit.
    """
    paths, always = frozenset(told), frozenset(tried)
    return {
        path: value
        for path, value, papers in _beside_the_papers(study)
        if value is not None and path not in paths and (path in always or value != papers)
    }


def left_out(study: Study) -> list[str]:
    """Return the keys that the paper's study has and another one, which init writes, has not."""
    beside = _beside_the_papers(study)
    found = (path for path, value, papers in beside if value is None and papers is not None)
    return [*dict.fromkeys(found)]


def _beside_the_papers(study: Study) -> Iterator[tuple[str, Any, Any]]:
    """Yield every key of a study with its section, its value, and the paper's study's."""
    for name, one in json.loads(study.canonical).items():
        for table in one if isinstance(one, list) else [one]:
            papers = _papers_section(name, table.get("side"))
            for key, value in table.items() if name != "condition" else ():
                yield f"{name}.{key}", value, papers.get(key)


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
