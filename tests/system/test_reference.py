"""The reference that the site reads from the program is complete.

The generators themselves refuse a JSON member and a column without a meaning, so that the build of
the site (test_site.py) fails for these.
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
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import pytest
from numpydoc.docscrape import NumpyDocString

from experiment import paper_study, read_study
from tactstrip import COMMANDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from experiment import Study
    from tests.conftest import Run

ROOT = Path(__file__).parents[2]
GENERATORS = ROOT / "docs" / "_ext" / "reference"
MODULES = sorted(
    ".".join(path.relative_to(GENERATORS).with_suffix("").parts)
    for path in GENERATORS.rglob("*.py")
    if path.stem[0] != "_"
)
DISC: Final = "[[actuator]]\nside = '{}'\nx_mm = {}\ndiameter_mm = 12.8\n"
DISCS: Final = DISC.format("left", -35) + DISC.format("right", 35)


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


def values_of(study: Study) -> dict[tuple[str, str], Any]:
    """Every value of a study by section and key; of actuators that of the first."""
    values: dict[tuple[str, str], Any] = {}
    for name, sections in study.sections().items():
        section = sections[0] if isinstance(sections, tuple) else sections
        for attribute, field in type(section).__pydantic_fields__.items():
            values[name, field.alias or attribute] = getattr(section, attribute)
    return values


def test_every_key_that_init_writes_is_documented_and_no_other(run: Run, tmp_path: Path) -> None:
    assert run("init", tmp_path / "study.toml").exit_code == 0
    section, written = "", set()
    for line in (tmp_path / "study.toml").read_text(encoding="utf-8").splitlines():
        if heading := re.fullmatch(r"\[\[?([a-z_]+)\]\]?", line):
            section = heading[1]
        elif key := re.match(r"(?:# )?([a-z0-9_]+) =", line):
            written.add((section, key[1]))
    # comments show the name of a condition and a column of participants
    examples = {("burst", "name"), ("texts", "description"), ("init", "told")}
    keys = list(module("study").study_keys())
    documented = {(key.section, key.name) for key in keys}
    assert {pair for pair in documented if pair[0] != "condition"} == written - examples
    assert ("condition", "name") in documented
    assert [key.name for key in keys if not key.meaning] == []


def test_every_default_is_the_value_of_an_empty_file(make_study: Callable[[str], Study]) -> None:
    paper, unmeasured = values_of(paper_study()), values_of(make_study(DISCS))
    for key in module("study").study_keys():
        if key.section in {"actuator", "condition"} and not key.default:
            continue
        values = unmeasured if key.name == "threshold_vpp" else paper
        default = tomllib.loads(f"key = {key.default or 'false'}")["key"]
        expected = tuple(default) if isinstance(default, list) else default
        assert values[key.section, key.name] == (expected if key.default else None), key


def test_every_key_without_a_default_is_in_an_example_that_can_be_read() -> None:
    study, shown = module("study"), set()
    for path in study.EXAMPLES:
        assert path.stem == f"example-{read_study(path).name}"
        for section, table in tomllib.loads(path.read_text(encoding="utf-8")).items():
            tables = table if isinstance(table, list) else [table]
            shown |= {(section, key) for one in tables for key in one}
    silent = {(k.section, k.name) for k in study.study_keys() if not k.default.strip('"[]')}
    assert silent - shown == set()


# Commands and JSON


def test_every_command_and_exit_code_is_documented() -> None:
    commands = module("commands")
    headings = re.findall(r"^## tactstrip (\w[\w-]*)$", commands.page(), re.MULTILINE)
    assert set(headings) == {*COMMANDS}
    assert [code for code, _ in commands.exit_codes()] == [0, 1, 2, 3, 4, 130]


def test_a_json_member_without_a_meaning_ends_the_build() -> None:
    with pytest.raises(ValueError, match="`hue`"):
        module("records.shapes").rows("tactstrip audit --json", [{"hue": 1}])


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
