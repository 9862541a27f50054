"""The numbers of a level are the same in the printed tables, on the page and in the summary."""

from __future__ import annotations

import io
import json
import re
from typing import TYPE_CHECKING

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


@pytest.mark.slow
def test_terminal_page_and_summary_have_the_same_numbers(tmp_path: Path) -> None:
    lines = [f"{p},{side},{v},{answer}" for p in "ab" for side, v, answer in ANSWERS]
    table = put(tmp_path / "t.csv", LEAST + "\n".join(lines) + "\n")
    printed, out = io.StringIO(), tmp_path / "out"
    analysis = write_analysis([table], out, columns=ColumnMap(), figures=False)
    print_analysis(analysis, printed, details=True)
    page = (out / "report.html").read_text(encoding="utf-8")
    on_page = [
        [re.sub("<[^>]+>", "", cell) for cell in re.findall("<t[dh].*?</t[dh]>", row, re.DOTALL)]
        for row in re.findall("<tr.*?</tr>", page, re.DOTALL)
    ]
    on_terminal = [re.split(" {2,}", line) for line in printed.getvalue().splitlines()]
    summary = json.loads((out / "summary.json").read_bytes())
    assert [level["detected_any"] for level in summary["levels"]] == [6, 6]
    for level in summary["levels"]:
        begins = [f"{level['level_vpp']:g} V", f"{level['detected']}/{level['presented']}"]
        (row,) = (cells for cells in on_terminal if cells[:2] == begins)
        (same,) = (cells for cells in on_page if cells[:2] == begins)
        assert row == [cell for cell in same if cell]
        assert f"{level['p_mean']:.3f}" in row
