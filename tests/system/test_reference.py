"""The reference that the site reads from the program is complete.

The build of the site (test_site.py) fails for a column without a meaning.
"""

from __future__ import annotations

import ast
import dataclasses
import doctest
import enum
import importlib
import inspect
import re
import textwrap
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from numpydoc.docscrape import NumpyDocString

from experiment import read_study
from tactstrip import COMMANDS

if TYPE_CHECKING:
    from collections.abc import Iterator


ROOT = Path(__file__).parents[2]
GENERATORS = ROOT / "docs" / "_ext" / "reference"
MODULES = sorted(
    ".".join(path.relative_to(GENERATORS).with_suffix("").parts)
    for path in GENERATORS.rglob("*.py")
    if path.stem[0] != "_"
)


@pytest.fixture(autouse=True)
def _generators_on_the_path() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(GENERATORS.parent)
        yield


def module(name: str) -> Any:
    return importlib.import_module(f"reference.{name}")


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_the_generators_hold(name: str) -> None:
    assert doctest.testmod(module(name)).failed == 0


# study.toml


def test_every_key_has_a_meaning() -> None:
    keys = list(module("study").study_keys())
    assert keys
    assert [key for key in keys if not key.meaning] == []


def test_every_key_without_a_default_is_in_an_example_that_can_be_read() -> None:
    study, shown = module("study"), set()
    for path in study.EXAMPLES:
        assert path.stem == f"example-{read_study(path).name}"
        for section, table in tomllib.loads(path.read_text(encoding="utf-8")).items():
            tables = table if isinstance(table, list) else [table]
            shown |= {(section, key) for one in tables for key in one}
    silent = {(k.section, k.name) for k in study.study_keys() if not k.default.strip('"[]')}
    assert silent - shown == set()


# Commands


def test_every_command_and_exit_code_is_documented() -> None:
    commands = module("commands")
    headings = re.findall(r"^## tactstrip (\w[\w-]*)$", commands.page(), re.MULTILINE)
    assert set(headings) == {*COMMANDS}
    assert [code for code, _ in commands.exit_codes()] == [0, 1, 2, 3, 4, 70, 130]


# The public names


class Documented(NamedTuple):
    """A public name with the parts of its docstring."""

    name: str
    value: Any

    @property
    def sections(self) -> NumpyDocString:
        return NumpyDocString(inspect.getdoc(self.value) or "")

    def names(self) -> set[str]:
        """The parameters and attributes that the docstring describes."""
        parts = ("Parameters", "Other Parameters", "Attributes")
        entries = [entry for part in parts for entry in self.sections[part]]
        return {name.strip().lstrip("*") for entry in entries for name in entry.name.split(",")}


def public() -> list[Documented]:
    python = module("api.python")
    return [
        Documented(f"{package}.{name}", getattr(importlib.import_module(package), name))
        for package in python.PACKAGES
        for name in python.names(package)
    ]


def classes() -> list[Documented]:
    return [entry for entry in public() if inspect.isclass(entry.value)]


def routines() -> list[Documented]:
    """Every public function, and every method that the page of a class shows."""
    functions = [entry for entry in public() if inspect.isroutine(entry.value)]
    methods = [
        Documented(f"{entry.name}.{member}", getattr(entry.value, member))
        for entry in classes()
        for member in module("api.python").shown(*entry.name.split("."), entry.value)
    ]
    return functions + [
        m for m in methods if inspect.isfunction(m.value) or inspect.ismethod(m.value)
    ]


def raises(value: Any) -> bool:
    body = ast.parse(textwrap.dedent(inspect.getsource(value)))
    return any(isinstance(node, ast.Raise) and node.exc is not None for node in ast.walk(body))


def test_every_public_name_has_a_page_with_a_summary() -> None:
    python = module("api.python")
    for package in python.PACKAGES:
        names = python.names(package)
        assert sorted(names) == sorted(importlib.import_module(package).__all__)
        assert [name for name, inside in names.items() if not python.text(inside, name)] == []


def test_every_public_function_describes_its_parameters_result_and_errors() -> None:
    for entry in routines():
        signature = inspect.signature(entry.value)
        assert entry.names() == {*signature.parameters} - {"self", "cls"}, entry.name
        result = entry.sections["Returns"] or entry.sections["Yields"]
        assert bool(result) != (signature.return_annotation in {"None", None}), entry.name
        assert entry.sections["Raises"] or not raises(entry.value), entry.name
        assert entry.sections["Examples"] or entry.name.count(".") > 1, entry.name


def test_every_public_class_describes_its_fields_and_errors() -> None:
    for entry in classes():
        kind: type = entry.value
        if dataclasses.is_dataclass(kind) and not issubclass(kind, enum.Enum):
            fields = {field.name for field in dataclasses.fields(kind) if field.init}
            elsewhere = {field.name for field in module("api.held").described(kind) or ()}
            if "__init__" not in inspect.getsource(kind):
                assert fields <= entry.names() | elsewhere, entry.name
        assert entry.sections["Raises"] or "__post_init__" not in vars(kind), entry.name
        assert entry.sections["Examples"], entry.name
