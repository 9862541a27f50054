"""docs/map.md sends a newcomer to files that are there and have what it says."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINES = (ROOT / "docs" / "map.md").read_text(encoding="utf-8").splitlines()
ROWS = [row for line in LINES if (row := re.fullmatch(r"\| (.+) \| (.+) \| `(\w+)` \|", line))]


def names_of(path: Path) -> set[str]:
    """Return what a module defines at its top."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        match node:
            case ast.ClassDef(name=name) | ast.FunctionDef(name=name):
                found.add(name)
            case ast.AnnAssign(target=ast.Name(id=name)):
                found.add(name)
            case ast.Assign(targets=[ast.Name(id=name)]):
                found.add(name)
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[1])
def test_a_named_file_has_the_named_thing(row: re.Match[str]) -> None:
    files = [ROOT / name for name in re.findall(r"`([\w/]+\.py)`", row[2])]
    assert files
    assert row[3] in names_of(files[-1])
    assert all(file.is_file() for file in files)


def test_the_map_fits_on_a_screen_and_answers_what_is_asked_first() -> None:
    assert len(LINES) <= 30
    assert len(ROWS) == sum(line.startswith("| ") and "name in it" not in line for line in LINES)
    sought = " ".join(row[1] for row in ROWS)
    for word in ("trial", "columns", "key", "journal", "ceiling", "equation", "threshold"):
        assert word in sought
    for added in ("a study key", "a device", "a figure"):
        assert any(row[1] == added for row in ROWS)


def test_a_command_is_a_file_of_its_own_name() -> None:
    import tactstrip

    for command, (package, _) in tactstrip.COMMANDS.items():
        name = command.replace("-", "_")
        assert name in names_of(ROOT / package / "commands" / f"{name}.py")
