"""No module imports what imports it: for typing, inside a function and by a face included."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Container, Iterator

ROOT = Path(__file__).parent.parent
PACKAGES = ("stimuli", "device", "experiment", "analysis", "benchmarks")


def imports(root: Path, packages: tuple[str, ...]) -> dict[str, set[str]]:
    """Return which modules each module names in any import; a face names those of its stub."""
    files = [file for name in packages for file in sorted((root / name).rglob("*.py*"))]
    files = [file for file in files if file.suffix in {".py", ".pyi"}]
    graph: dict[str, set[str]] = {module_name(file, root): set() for file in files}
    for file in files:
        name = module_name(file, root)
        package = name if file.stem == "__init__" else name.rpartition(".")[0]
        for statement in statements(ast.parse(file.read_text(encoding="utf-8")).body):
            graph[name] |= named(statement, package, graph) & graph.keys()
        graph[name].discard(name)
    return graph


def statements(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield statements and what stands inside them, but no expression: those are the many."""
    for statement in body:
        yield statement
        for within in ("body", "orelse", "finalbody"):
            yield from statements(getattr(statement, within, []))
        for branch in (*getattr(statement, "handlers", ()), *getattr(statement, "cases", ())):
            yield from statements(branch.body)


def module_name(file: Path, root: Path) -> str:
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def named(node: ast.AST, package: str, known: Container[str]) -> set[str]:
    """Return what a statement imports: a module taken from its folder is not the folder's face."""
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if not isinstance(node, ast.ImportFrom):
        return set()
    above = package.split(".")[: len(package.split(".")) + 1 - node.level] if node.level else []
    base = ".".join([*above, *([node.module] if node.module else [])])
    wanted = (f"{base}.{alias.name}" for alias in node.names)
    return {full if full in known else base for full in wanted}


@pytest.mark.slow
def test_no_module_imports_what_imports_it() -> None:
    graph = imports(ROOT, PACKAGES)
    assert len(graph) > 150
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize(
    "back",
    [
        "from pack.first import FIRST\n",
        "import pack.first\n",
        "from .first import FIRST\n",
        "from pack import first\n",
        "from pack import FIRST\n",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from pack.first import FIRST\n",
        "def late():\n    from pack.first import FIRST\n    return FIRST\n",
    ],
)
def test_a_circle_is_found_however_it_is_closed(tmp_path: Path, back: str) -> None:
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "__init__.py").write_text("")
    (tmp_path / "pack" / "__init__.pyi").write_text("from .first import FIRST\n")
    (tmp_path / "pack" / "first.py").write_text("from pack.second import SECOND\nFIRST = SECOND\n")
    second = tmp_path / "pack" / "second.py"
    second.write_text("SECOND = 2\n")
    TopologicalSorter(imports(tmp_path, ("pack",))).prepare()
    second.write_text(back + "SECOND = 2\n")
    with pytest.raises(CycleError):
        TopologicalSorter(imports(tmp_path, ("pack",))).prepare()
