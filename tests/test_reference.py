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
from click.testing import CliRunner
from numpydoc.docscrape import NumpyDocString
from pydantic import TypeAdapter, ValidationError

from experiment.commands.init import write_study_text
from experiment.session.simulate import simulate_study
from experiment.study.read import read_study
from experiment.study.sections.table import file_keys
from experiment.terms.entries import EVENTS
from experiment.terms.gains import ConditionGains
from experiment.terms.record import COLUMNS
from stimuli import MATERIALS
from tactstrip import main

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "docs" / "_ext"
MODULES = sorted(
    ".".join(path.relative_to(FOLDER / "reference").with_suffix("").parts)
    for path in (FOLDER / "reference").rglob("*.py")
    if path.stem[0] != "_"
)


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


def test_every_key_has_an_example_that_somebody_would_write() -> None:
    shown = [(key.section, key.example) for key, _ in described() if "..." in key.example]
    assert shown == []
    names = {key.name for key, _ in described()}
    assert {*tomllib.loads(module("study").EXAMPLES.read_text(encoding="utf-8"))} <= names


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


def test_a_column_of_trials_means_in_an_analysis_what_it_means_in_a_session() -> None:
    told = module("tables").meanings("trials_clean.csv")
    for column in COLUMNS:
        assert told[column.name].startswith(column.description), column.name
        assert all(word in told[column.name] for word in column.choices), column.name


def test_a_column_in_a_lab_s_own_unit_is_not_told_in_volts() -> None:
    told = module("tables").meanings("trials_clean.csv")
    own = {column.name.removesuffix("_vpp") for column in COLUMNS if "_vpp" in column.name}
    assert own == {"level", "level_left", "level_right", "level_planned"}
    assert [name for name in own if "levels' unit" not in told[name] or "volt" in told[name]] == []


@pytest.mark.slow
def test_every_column_of_a_field_is_told(tmp_path: Path) -> None:
    tables = module("tables")
    for options in ((), ("--band", "100", "200")):
        out = tmp_path / "field.csv"
        study = ROOT / "docs" / "_ext" / "reference" / "studies" / "marked.toml"
        done = CliRunner().invoke(main, ["field", str(study), *options, "--out", str(out)])
        assert done.exit_code == 0, done.output
        heads = out.read_text(encoding="utf-8").partition("\n")[0].split(",")
        assert len({tables.of_field(name) for name in heads}) == len(heads)
        out.unlink()


@pytest.mark.slow
def test_a_practised_session_beside_simulated_ones_is_marked_in_every_table(tmp_path: Path) -> None:
    text = "[design]\ntrials_per_side = 5\nboth_trials = 2\n[masking]\nnoise = 'none'\n"
    (study := tmp_path / "study.toml").write_text(text, encoding="utf-8")
    results, out = tmp_path / "results", tmp_path / "out"
    gains = ConditionGains(
        condition="main", actuators=("left", "right"), bases=("measured", "measured"),
        per_vpp=((0.03, 0.001), (0.001, 0.03)),
    )  # fmt: skip
    [*_] = simulate_study(read_study(study), results, participants=2, seed=7, gains=(gains,))
    marked = module("marked")
    marked.practise(study, results, "03")
    marked.alter(results / "sub-02" / "ses-01" / "trials.csv")
    accepted = ["--allow-simulated", "--accept-altered", "--no-figures", "--out", str(out)]
    done = CliRunner().invoke(main, ["analyze", str(results), *accepted])
    assert done.exit_code == 0, done.output
    marks = [*module("tables").MARKS]
    for path in out.glob("*.csv"):
        heads = path.read_text(encoding="utf-8").partition("\n")[0].split(",")
        assert heads[-len(marks) :] == marks or path.name == "trials_clean.csv", path.name
    last = (out / "thresholds.csv").read_text(encoding="utf-8").splitlines()[-1]
    assert last.endswith(",mixed,mixed,mixed")


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
