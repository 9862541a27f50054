"""The reference that the site reads from the program says what the program does."""

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
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import pytest
from numpydoc.docscrape import NumpyDocString
from pydantic import TypeAdapter, ValidationError

from experiment.commands.init import write_study_text
from experiment.study.read import paper_study, read_study, study_from_text
from experiment.study.sections.actuator import paper_actuators
from experiment.study.sections.table import file_keys
from experiment.study.study import StudyError
from experiment.terms.entries import EVENTS
from stimuli import MATERIALS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from experiment.study.study import Study

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "_ext"
MODULES = sorted(
    ".".join(path.relative_to(FOLDER / "reference").with_suffix("").parts)
    for path in (FOLDER / "reference").rglob("*.py")
    if path.stem[0] != "_"
)

DISCS: Final = """
[[actuator]]
side = 'left'
x_mm = -35
diameter_mm = 12.8
[[actuator]]
side = 'right'
x_mm = 35
diameter_mm = 12.8
"""


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


def held_by(study: Study) -> dict[tuple[str, str], Any]:
    """Every value of a study by its section and key; of actuators that of the first."""
    found: dict[tuple[str, str], Any] = {}
    for name, section in study.sections().items():
        one = section[0] if isinstance(section, tuple) else section
        fields = type(one).__pydantic_fields__
        found |= {(name, field.alias or own): getattr(one, own) for own, field in fields.items()}
    return found


def test_every_default_is_what_an_empty_file_has_and_no_other_is_there() -> None:
    paper, unmeasured = held_by(paper_study()), held_by(study_from_text(DISCS, "study.toml"))
    for key, field in described():
        if key.section in {"actuator", "condition"} and not key.default:
            continue
        known = unmeasured if key.name == "threshold_vpp" else paper
        stated = known[key.section, key.name]
        if not key.default:
            assert stated is None, key
            continue
        default = tomllib.loads(f"one = {key.default}")["one"]
        value = tuple(default) if isinstance(default, list) else default
        assert accepts(field, value), key
        assert value == stated, key


def test_the_discs_that_an_empty_file_has_are_told() -> None:
    page = module("study").page()
    for disc in paper_actuators():
        assert f"{disc['x_mm']:g}" in page
        alike = {key: value for key, value in disc.items() if key not in {"side", "x_mm"}}
        assert all(f"`{key} = {value:g}`" in page for key, value in alike.items())


@pytest.mark.parametrize(
    ("key", "text"),
    [
        ("side", DISCS.replace("side = 'left'", "")),
        ("x_mm", DISCS.replace("x_mm = -35", "")),
        ("diameter_mm", DISCS.replace("diameter_mm = 12.8", "")),
        ("length_x_mm", DISCS.replace("diameter_mm = 12.8", "shape = 'motor'\nlength_y_mm = 8")),
        ("length_y_mm", DISCS.replace("diameter_mm = 12.8", "shape = 'motor'\nlength_x_mm = 8")),
        ("name", "[[condition]]\ncycles = 2"),
    ],
)
def test_a_key_that_is_told_as_required_is_missed(key: str, text: str) -> None:
    assert key in {one.name for one, _ in described() if one.left_out.startswith("required")}
    with pytest.raises(StudyError, match=f"{key} is missing"):
        study_from_text(text, "study.toml")


def test_every_example_is_a_study_that_can_be_read() -> None:
    for path in module("study").EXAMPLES:
        assert path.stem == f"example-{read_study(path).name}"


def test_every_key_is_in_an_example_or_shows_its_default() -> None:
    study = module("study")
    shown = set()
    for path in study.EXAMPLES:
        for section, table in tomllib.loads(path.read_text(encoding="utf-8")).items():
            each = table if isinstance(table, list) else [table]
            shown |= {(section, key) for one in each for key in one}
    silent = {(key.section, key.name) for key, _ in described() if not key.default.strip('"[]')}
    assert silent - shown == set()


def test_the_page_shows_the_sections_of_the_examples_as_they_are() -> None:
    study = module("study")
    files = [tomllib.loads(path.read_text(encoding="utf-8")) for path in study.EXAMPLES]
    for section in study.sections():
        blocks = [tomllib.loads(text) for _, text in study.examples(section)]
        assert blocks == [{section: one[section]} for one in files if section in one], section
        assert blocks, section


def test_no_key_that_only_a_plan_has_is_on_the_page() -> None:
    names = {"auto_cycles", "auto_window", "levels_vpp", "samples_base64", "sample_rate_hz"}
    assert names == module("study").PLANNED
    assert not [key for key, _ in described() if key.section == "condition" and key.name in names]


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


def test_a_member_without_a_meaning_ends_the_build() -> None:
    with pytest.raises(ValueError, match=r"not told.*'`hue`'"):
        module("records.shapes").rows("tactstrip audit --json", [{"hue": 1}])


def test_the_exit_codes_are_told() -> None:
    codes = module("commands").exit_codes()
    assert [code for code, _ in codes] == [0, 1, 2, 3, 4, 130]


def test_every_name_of_a_face_has_a_page_that_says_what_it_is() -> None:
    python = module("api.python")
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


# What a stranger reads of a face: its docstrings, by numpydoc's own parser, and generated tables.

NAMED: Final = ("Parameters", "Other Parameters", "Attributes")
IMPLICIT: Final = {"self", "cls"}


class Told(NamedTuple):
    """Something with a docstring of its own on a page of the reference."""

    name: str
    value: Any
    sections: NumpyDocString

    def named(self) -> set[str]:
        """The parameters and attributes that are described."""
        entries = [entry for section in NAMED for entry in self.sections[section]]
        return {name.strip().lstrip("*") for entry in entries for name in entry.name.split(",")}


def told(name: str, value: Any) -> Told:
    return Told(name, value, NumpyDocString(inspect.getdoc(value) or ""))


def offered() -> list[tuple[str, Any]]:
    """Every name of the faces with its value."""
    python = module("api.python")
    return [
        (f"{package}.{name}", getattr(importlib.import_module(package), name))
        for package in python.PACKAGES
        for name in python.names(package)
    ]


def classes() -> list[Told]:
    return [told(name, value) for name, value in offered() if inspect.isclass(value)]


def routines() -> list[Told]:
    """Every function of the faces, and every method that a class's page shows."""
    found = [told(name, value) for name, value in offered() if inspect.isroutine(value)]
    for one in classes():
        for member in module("api.python").shown(*one.name.split("."), one.value):
            method = getattr(one.value, member)
            if inspect.isfunction(method) or inspect.ismethod(method):
                found.append(told(f"{one.name}.{member}", method))
    return found


def constants_of_the_faces() -> list[tuple[str, Any]]:
    return [
        (name, value)
        for name, value in offered()
        if not inspect.isclass(value) and not inspect.isroutine(value)
    ]


def accepted(kind: type) -> set[str]:
    """What a class is made of: the fields of a value, else the parameters of its own `__init__`."""
    if dataclasses.is_dataclass(kind) and "__init__" not in inspect.getsource(kind):
        return {field.name for field in dataclasses.fields(kind) if field.init}
    made = next(base for base in kind.__mro__ if "__init__" in vars(base))
    ours = made.__module__.partition(".")[0] in module("api.python").PACKAGES
    plain = ours and not getattr(kind, "_is_protocol", False) and not issubclass(kind, enum.Enum)
    return {*inspect.signature(vars(made)["__init__"]).parameters} - IMPLICIT if plain else set()


def raises(value: Any) -> bool:
    """Whether the source of a function or of a class's checks has a `raise` of its own."""
    body = ast.parse(textwrap.dedent(inspect.getsource(value)))
    return any(isinstance(node, ast.Raise) and node.exc is not None for node in ast.walk(body))


def test_every_parameter_of_a_function_of_a_face_is_described_and_no_other() -> None:
    for one in routines():
        assert one.named() == {*inspect.signature(one.value).parameters} - IMPLICIT, one.name


def test_every_field_of_a_class_of_a_face_is_described() -> None:
    for one in classes():
        in_fields = dataclasses.is_dataclass(one.value) and module("api.held").described(one.value)
        described = one.named() | {field.name for field in in_fields or ()}
        assert accepted(one.value) - described == set(), one.name


def test_whatever_a_function_of_a_face_returns_is_described() -> None:
    for one in routines():
        nothing = inspect.signature(one.value).return_annotation in {"None", None}
        described = bool(one.sections["Returns"] or one.sections["Yields"])
        assert described != nothing, one.name


def test_whatever_a_face_refuses_is_described() -> None:
    for one in routines():
        assert one.sections["Raises"] or not raises(one.value), one.name
    for one in classes():
        check = vars(one.value).get("__post_init__")
        assert one.sections["Raises"] or check is None, one.name


def test_every_function_and_class_of_a_face_has_an_example() -> None:
    functions = [one for one in routines() if one.name.count(".") == 1]
    assert [one.name for one in (*functions, *classes()) if not one.sections["Examples"]] == []


def test_the_page_of_a_constant_lists_what_it_holds() -> None:
    pages, literal = module("api.python").pages(), "``{}``".format
    for name, value in constants_of_the_faces():
        page = pages[f"api/{name}.rst"]
        if isinstance(value, UnionType):
            held = [f":obj:`~{name.partition('.')[0]}.{kind.__name__}`" for kind in value.__args__]
        elif isinstance(value, enum.Enum):
            held = [literal(f'"{value.value}"')]
        elif isinstance(value, Mapping):
            held = [literal(f'"{key}"') for key in value]
        elif isinstance(value, tuple):
            held = [literal(one.name) for one in value]
        else:
            held = [literal(field.name) for field in dataclasses.fields(value)]
        assert held, name
        assert [one for one in held if page.count(one) != 1] == [], name


def test_the_page_of_an_enumeration_lists_its_members_with_their_meaning() -> None:
    pages = module("api.python").pages()
    for one in classes():
        if issubclass(one.value, enum.Enum):
            rows = re.findall(r"\* - ``(\w+)``\n +- (.+)\n +- (.+)\n", pages[f"api/{one.name}.rst"])
            assert [name for name, _, _ in rows] == [*one.value.__members__]


def test_the_materials_are_listed_with_their_values_and_sources() -> None:
    page = module("api.python").pages()["api/stimuli.MATERIALS.rst"]
    for name, one in MATERIALS.items():
        row = page.partition(f'``"{name}"``')[2].partition("* -")[0]
        told = (one.material.poisson_ratio, one.material.density_kg_m3, one.source)
        for value in told:
            words = f"{value:g}" if isinstance(value, float) else value
            assert words in row, name


def test_the_examples_below_the_constants_hold() -> None:
    python = module("api.python")
    runner, parser = doctest.DocTestRunner(), doctest.DocTestParser()
    for name, _ in constants_of_the_faces():
        package, _, short = name.partition(".")
        text = python.text(python.names(package)[short], short)
        test = parser.get_doctest(text, {}, name, None, 0)
        assert test.examples, name
        assert runner.run(test).failed == 0
