"""The reference that the site reads from the program says what the program does."""

from __future__ import annotations

import ast
import doctest
import importlib
import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import pytest
from pydantic import TypeAdapter, ValidationError

from experiment.archive.journal import EVENTS
from experiment.commands.init import write_study_text
from experiment.study.sections.table import file_keys

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "docs" / "_ext"
MODULES = sorted(path.stem for path in (FOLDER / "reference").glob("*.py") if path.stem[0] != "_")


@pytest.fixture(autouse=True)
def _reference_on_the_path() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(FOLDER)
        yield


def module(name: str) -> Any:
    return importlib.import_module(f"reference.{name}")


def accepts(field: Any, value: object) -> bool:
    kind: Any = field.annotation
    for one in field.metadata:
        kind = Annotated[kind, one]
    try:
        TypeAdapter(kind).validate_python(value)
    except ValidationError:
        return False
    return True


def described() -> list[tuple[Any, Any]]:
    """Every key of the page, with the field of its section."""
    study = module("study")
    fields = {name: file_keys(cls) for name, cls in study.sections().items()}
    return [(key, fields[key.section][key.name]) for key in study.study_keys()]


def test_the_keys_are_those_that_init_writes() -> None:
    section, written = "", set()
    for line in write_study_text("paper").splitlines():
        if heading := re.fullmatch(r"\[\[?([a-z_]+)\]\]?", line):
            section = heading[1]
        elif key := re.match(r"(?:# )?([a-z0-9_]+) =", line):
            written.add((section, key[1]))
    # examples in comments, of a condition and of a participant's column, and what it was told
    examples = {("burst", "name"), ("texts", "description"), ("init", "told")}
    page = {(key.section, key.name) for key, _ in described()}
    assert {pair for pair in page if pair[0] != "condition"} == written - examples
    assert ("condition", "name") in page


def test_every_key_says_what_it_means() -> None:
    assert [(key.section, key.name) for key, _ in described() if not key.meaning] == []


def test_every_example_and_default_is_what_its_field_takes() -> None:
    for key, field in described():
        example = tomllib.loads(key.example)[key.name]
        value = tuple(example) if isinstance(example, list) else example
        assert accepts(field, value), key
        if key.default:
            default = tomllib.loads(f"one = {key.default}")["one"]
            stated = list(field.default) if isinstance(field.default, tuple) else field.default
            assert default == stated, key


def test_every_range_ends_where_the_field_does() -> None:
    for key, field in described():
        if key.type.startswith("list"):
            continue
        whole = field.annotation is int or int in getattr(field.annotation, "__args__", ())
        for sign, number in re.findall(r"([≥≤<>]) ([^ ,]+)", key.range):
            limit: float = int(float(number)) if whole else float(number)
            step = 1 if whole else max(abs(limit), 1e-6) * 1e-6
            outside = limit + (step if sign in "≤<" else -step)
            assert accepts(field, limit) == (sign in "≥≤"), key
            assert not accepts(field, outside), key


def test_every_event_that_a_session_writes_is_told() -> None:
    appended = set()
    for path in (ROOT / "experiment").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "append":
                owner = getattr(node.func, "value", None)
                name = getattr(owner, "attr", "") or getattr(owner, "id", "")
                if name.endswith("journal"):
                    words = [one for one in ast.walk(node.args[0]) if isinstance(one, ast.Constant)]
                    appended |= {one.value for one in words if isinstance(one.value, str)}
    assert appended == set(EVENTS)


def test_the_exit_codes_are_told() -> None:
    codes = module("commands").exit_codes()
    assert [code for code, _ in codes] == [0, 1, 2, 3, 4, 130]


def test_every_name_of_a_face_has_a_page_that_says_what_it_is() -> None:
    python = module("python")
    for package in python.PACKAGES:
        names = python.names(package)
        assert sorted(names) == sorted(importlib.import_module(package).__all__)
        assert [name for name, module in names.items() if not python.text(module, name)] == []


@pytest.mark.slow
def test_every_command_is_told_with_its_help() -> None:
    page = module("commands").page()
    assert page.count("Usage: tactstrip ") == page.count("## tactstrip ")


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_the_generators_hold(name: str) -> None:
    assert doctest.testmod(module(name)).failed == 0
