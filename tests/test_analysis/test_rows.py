"""The rows of a level on the terminal, on the page and in the summary have the same numbers."""

from __future__ import annotations

import io
import json
import re
from typing import TYPE_CHECKING, Any

import pytest

from analysis import ColumnMap, print_analysis, write_analysis
from tests.test_analysis.shared import LEAST, put

if TYPE_CHECKING:
    from pathlib import Path

ANSWERS = (
    *(("left", 60, answer) for answer in ("left", "both", "right", "timeout", "none")),
    *(("right", 95, answer) for answer in ("right", "right", "both")),
    *(("both", 95, answer) for answer in ("both", "left")),
    *(("none", 0, answer) for answer in ("none", "both")),
)


def outputs(folder: Path, text: str) -> tuple[str, list[list[str]], dict[str, Any]]:
    """Return what is printed, the rows of the page's tables, and the summary."""
    table, out = put(folder / "t.csv", text), folder / "out"
    printed = io.StringIO()
    print_analysis(write_analysis([table], out, columns=ColumnMap(), figures=False), printed)
    page = (out / "report.html").read_text(encoding="utf-8")
    rows = [
        [re.sub("<[^>]+>", "", cell) for cell in re.findall("<t[dh].*?</t[dh]>", row, re.DOTALL)]
        for row in re.findall("<tr.*?</tr>", page, re.DOTALL)
    ]
    return printed.getvalue(), rows, json.loads((out / "summary.json").read_bytes())


@pytest.mark.slow
def test_terminal_page_and_summary_have_the_same_numbers(tmp_path: Path) -> None:
    lines = [f"{p},{side},{v},{answer}" for p in "ab" for side, v, answer in ANSWERS]
    printed, page, summary = outputs(tmp_path, LEAST + "\n".join(lines) + "\n")
    assert [level["detected_any"] for level in summary["levels"]] == [6, 6]
    short = [line.split() for line in printed.splitlines()]
    for level in summary["levels"]:
        (row,) = (cells for cells in short if cells[:1] == [f"{level['level_vpp']:g}"])
        name = f"{level['level_vpp']:g} V"
        (long,) = (cells for cells in page if cells[:1] == [name] and len(cells) == len(row))
        assert row[1] == f"{level['detected']}/{level['presented']}"
        assert [cell.replace("/", " / ") for cell in row[1:6]] == long[1:6]
        assert row[6].replace("-", " to ") == long[6]
        assert row[7:] == long[7:]
        assert row[-1] == str(level["detected_any"])
