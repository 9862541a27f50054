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
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest
from numpydoc.docscrape import NumpyDocString

from tactstrip import COMMANDS

if TYPE_CHECKING:
    from collections.abc import Iterator


ROOT = Path(__file__).parents[2]
EXTENSIONS = ROOT / "docs" / "_ext"


@pytest.fixture(autouse=True)
def _generators_on_the_path() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(EXTENSIONS)
        yield


def reference() -> Any:
    return importlib.import_module("reference")


def test_examples_of_the_generator_hold() -> None:
    assert doctest.testmod(reference()).failed == 0


def test_every_key_has_a_meaning() -> None:
    keys = list(reference().study_keys())
    assert keys
    assert [key for key in keys if not key[2]] == []


def test_every_command_and_exit_code_is_documented() -> None:
    headings = re.findall(r"^## tactstrip (\w[\w-]*)$", reference().commands_page(), re.MULTILINE)
    assert set(headings) == {*COMMANDS}
    assert [code for code, _ in reference().exit_codes()] == [0, 1, 2, 3, 4, 70, 130]


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
    return [
        Documented(f"{package}.{name}", getattr(importlib.import_module(package), name))
        for package in reference().PACKAGES
        for name in reference().names(package)
    ]


def classes() -> list[Documented]:
    return [entry for entry in public() if inspect.isclass(entry.value)]


def members(entry: Documented) -> list[str]:
    """The methods and properties of a class that its page shows."""
    owners = [
        one for one in entry.value.__mro__ if one is entry.value or dataclasses.is_dataclass(one)
    ]
    offered = {
        member
        for owner in owners
        for member, part in vars(owner).items()
        if member[0] != "_"
        and (isinstance(part, property | classmethod) or inspect.isroutine(part))
    }
    documented = offered - {*reference().INTERNAL.get(entry.name, ())}
    return sorted(m for m in documented if inspect.getdoc(getattr(entry.value, m)))


def routines() -> list[Documented]:
    """Every public function, and every method that the page of a class shows."""
    functions = [entry for entry in public() if inspect.isroutine(entry.value)]
    methods = [
        Documented(f"{entry.name}.{member}", getattr(entry.value, member))
        for entry in classes()
        for member in members(entry)
    ]
    return functions + [
        m for m in methods if inspect.isfunction(m.value) or inspect.ismethod(m.value)
    ]


def raises(value: Any) -> bool:
    body = ast.parse(textwrap.dedent(inspect.getsource(value)))
    return any(isinstance(node, ast.Raise) and node.exc is not None for node in ast.walk(body))


def test_every_public_name_has_a_docstring() -> None:
    for package in reference().PACKAGES:
        names = reference().names(package)
        assert sorted(names) == sorted(importlib.import_module(package).__all__)
        for name, inside in names.items():
            value = getattr(importlib.import_module(package), name)
            is_documented_by_python = inspect.isclass(value) or inspect.isroutine(value)
            assert (
                inspect.getdoc(value)
                if is_documented_by_python
                else name in reference().constants(inside)
            )


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
            elsewhere = {f.name for f in dataclasses.fields(kind) if "description" in f.metadata}
            if "__init__" not in inspect.getsource(kind):
                assert fields <= entry.names() | elsewhere, entry.name
        assert entry.sections["Raises"] or "__post_init__" not in vars(kind), entry.name
        assert entry.sections["Examples"], entry.name
