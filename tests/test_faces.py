"""What a folder offers stands in its face; the rest stays inside."""

from __future__ import annotations

import ast
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("stimuli", "device", "experiment", "analysis")
FACES = sorted(
    face.parent.relative_to(ROOT).as_posix().replace("/", ".")
    for package in PACKAGES
    for face in (ROOT / package).rglob("__init__.pyi")
)


class Taken(NamedTuple):
    """A name that one module takes from another."""

    by: str
    module: str
    name: str


def modules() -> dict[str, Path]:
    """Return every module of the four packages, folders not counted, and the front door."""
    found = {
        path.relative_to(ROOT).with_suffix("").as_posix().replace("/", "."): path
        for package in PACKAGES
        for path in (ROOT / package).rglob("*.py")
        if path.name != "__init__.py"
    }
    return found | {"tactstrip": ROOT / "tactstrip.py"}


@cache
def taken() -> tuple[Taken, ...]:
    """Return every name that a module takes from another one or from a face, typing included."""
    known = modules()
    return tuple(
        Taken(by, node.module, alias.name)
        for by, path in known.items()
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module in known or node.module in FACES)
        for alias in node.names
    )


def folder(module: str) -> str:
    """Return the folder in which a module stands."""
    return module.rpartition(".")[0]


@pytest.mark.slow
def test_what_is_taken_from_a_folder_stands_in_its_face() -> None:
    hidden = [
        one
        for one in taken()
        if one.module not in FACES
        and folder(one.module) not in {*PACKAGES, ""}
        and not one.by.startswith(f"{folder(one.module)}.")
        and one.name not in import_module(folder(one.module)).__all__
    ]
    assert hidden == []


def test_no_name_with_an_underscore_crosses_a_file() -> None:
    assert [one for one in taken() if one.name.startswith("_")] == []


@pytest.mark.parametrize("face", FACES)
def test_a_face_offers_what_it_lists_and_nothing_under_the_name_of_a_module(face: str) -> None:
    offered = import_module(face)
    inside = {module.rpartition(".")[2] for module in modules() if folder(module) == face}
    for name in offered.__all__:
        value = getattr(offered, name)
        assert name not in inside or value is import_module(f"{face}.{name}")


@pytest.mark.parametrize("face", [face for face in FACES if face not in PACKAGES])
def test_a_folder_s_face_lists_only_what_somebody_outside_takes(face: str) -> None:
    wanted = {
        one.name
        for one in taken()
        if face in {one.module, folder(one.module)} and folder(one.by) != face
    }
    package = face.partition(".")[0]
    stub = ast.parse((ROOT / package / "__init__.pyi").read_text("utf-8"))
    wanted |= {
        alias.name
        for node in ast.walk(stub)
        if isinstance(node, ast.ImportFrom) and f"{package}.{node.module}".startswith(f"{face}.")
        for alias in node.names
    }
    assert sorted(set(import_module(face).__all__) - wanted) == []
