"""Code lines of each package: `python -m benchmarks.size [ROOT]`.

A code line is a line that may have to be changed: docstrings, comments, imports and blank lines do
not count.
"""

from __future__ import annotations

import ast
import io
import sys
import tokenize
from pathlib import Path

PACKAGES = ("stimuli", "device", "experiment", "analysis")
_NO_CODE = frozenset(
    {
        *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE),
        *(tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER),
    }
)


def code_lines(text: str) -> int:
    """Count the code lines of a module."""
    ignored: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Import() | ast.ImportFrom() | ast.Expr(value=ast.Constant(value=str())):
                ignored.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - ignored)


def main(root: Path) -> None:
    """Print the number of modules and code lines of each package and of its folders."""
    print(f"{'folder':26} modules   code")
    for package in PACKAGES:
        folders = [root / package, *sorted(p for p in (root / package).iterdir() if p.is_dir())]
        for folder in folders:
            files = list(folder.rglob("*.py"))
            if files:
                code = sum(code_lines(file.read_text("utf-8")) for file in files)
                print(f"{folder.relative_to(root)!s:26} {len(files):7} {code:6}")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent.parent)
