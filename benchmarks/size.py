"""How large the packages are: `python -m benchmarks.size [ROOT]`.

Code lines are where a change has to be made: neither docstrings and comments nor imports, which
follow from where things stand, nor blank lines.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("stimuli", "device", "experiment", "analysis")
ROOT = Path(__file__).parent.parent
SILENT = frozenset(
    {
        *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
        *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
    }
)


class Folder(NamedTuple):
    """The modules of one folder, its face apart."""

    path: Path
    modules: tuple[Path, ...]


def folders(root: Path = ROOT) -> list[Folder]:
    """Return every folder of the packages that holds modules."""
    found = []
    for package in PACKAGES:
        for face in sorted((root / package).rglob("__init__.py")):
            modules = tuple(p for p in sorted(face.parent.glob("*.py")) if p != face)
            found.append(Folder(face.parent.relative_to(root), modules))
    return found


def code_lines(text: str) -> int:
    """Count the code lines of a module."""
    left_out: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Import() | ast.ImportFrom() | ast.Expr(value=ast.Constant(value=str())):
                left_out.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    held: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SILENT:
            held.update(range(token.start[0], token.end[0] + 1))
    return len(held - left_out)


def table(root: Path = ROOT) -> str:
    """Return modules and code lines of each package, and of the largest folders."""
    lines = ["package     modules   code"]
    total = 0
    for package in PACKAGES:
        files = sorted((root / package).rglob("*.py"))
        code = sum(code_lines(file.read_text(encoding="utf-8")) for file in files)
        modules = sum(file.name != "__init__.py" for file in files)
        lines.append(f"{package:11} {modules:7} {code:6}")
        total += code
    every = folders(root)
    lines.append(f"{'together':11} {sum(len(f.modules) for f in every):7} {total:6}")
    largest = sorted(every, key=lambda folder: len(folder.modules), reverse=True)[:5]
    lines += ["", f"the largest of {len(every)} folders, in modules"]
    lines += [f"{folder.path!s:27} {len(folder.modules)}" for folder in largest]
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT))
