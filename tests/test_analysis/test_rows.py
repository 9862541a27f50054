"""The rows of a reported table: terminal, page and summary tell the same."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING

import pytest

from analysis import print_analysis
from analysis.results.report import report_html
from analysis.results.rows import PAGE, TERMINAL, blank_cells, both_cells, level_rows
from analysis.results.summary import summary_text
from analysis.results.tables import Analysis, analyse
from tests.test_analysis.shared import LEAST, loaded

if TYPE_CHECKING:
    from pathlib import Path

ANSWERS = (
    *(("left", 60, answer) for answer in ("left", "both", "right", "timeout", "none")),
    *(("right", 95, answer) for answer in ("right", "right", "both")),
    *(("both", 95, answer) for answer in ("both", "left")),
    *(("none", 0, answer) for answer in ("none", "both")),
)


class Rows(HTMLParser):
    """The rows of the tables of a page, as the texts of their cells."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.within = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "tr":
            self.rows.append([])
        elif tag in {"td", "th"}:
            self.rows[-1].append("")
            self.within = True

    def handle_endtag(self, tag: str) -> None:
        self.within = self.within and tag not in {"td", "th"}

    def handle_data(self, data: str) -> None:
        if self.within:
            self.rows[-1][-1] += data


@pytest.fixture
def found(tmp_path: Path) -> Analysis:
    """Two participants with single, both-finger and blank trials."""
    lines = [f"{p},{side},{v},{answer}" for p in "ab" for side, v, answer in ANSWERS]
    return analyse(loaded(tmp_path, LEAST + "\n".join(lines) + "\n"))


def test_terminal_and_page_have_the_same_numbers_of_a_level(found: Analysis) -> None:
    short, long = level_rows(found, TERMINAL), level_rows(found, PAGE)
    assert len(short.header) == len(long.header) == len(short.of_condition["main"][0]) == 12
    for one, other in zip(short.of_condition["main"], long.of_condition["main"], strict=True):
        assert [cell.replace("/", " / ") for cell in one[1:6]] == other[1:6]
        assert one[7:] == other[7:]
        assert (f"{one[0]} V", one[6].replace("-", " to ")) == (other[0], other[6])


@pytest.mark.slow
def test_what_is_printed_shown_and_summed_up_are_these_rows(found: Analysis) -> None:
    printed = io.StringIO()
    print_analysis(found, printed)
    shown = Rows(report_html(found, ())).rows
    for row in level_rows(found, TERMINAL).of_condition["main"]:
        assert row in [line.split() for line in printed.getvalue().splitlines()]
    for row in level_rows(found, PAGE).of_condition["main"]:
        assert row in shown
    assert ["all", *both_cells(found.both.iloc[-1], PAGE)] in shown
    assert ["all", *blank_cells(found.blank.iloc[-1], PAGE)] in shown
    levels = json.loads(summary_text(found))["levels"]
    assert [one["detected_any"] for one in levels] == [6, 6]
    assert [row[-1] for row in level_rows(found, PAGE).of_condition["main"]] == ["6", "6"]


def test_where_none_was_not_offered_no_column_tells_what_was_felt_at_all(found: Analysis) -> None:
    forced = replace(found, detected_any=None)
    assert level_rows(forced, PAGE).header == level_rows(found, PAGE).header[:-1]
    assert [one["detected_any"] for one in json.loads(summary_text(forced))["levels"]] == [None] * 2


@pytest.mark.slow
def test_false_alarms_beside_a_difference_are_whole_numbers_or_null(tmp_path: Path) -> None:
    lines = [
        f"{p},{c},{side},{v},{answer}"
        for p in "ab" for c in "12" for side, v, answer in ANSWERS if p == "a" or side != "none"
    ]  # fmt: skip
    found = analyse(loaded(tmp_path, LEAST.replace(",", ",condition,", 1) + "\n".join(lines)))
    of_a, of_b, _ = json.loads(summary_text(found))["differences"]
    names = ("false_alarms_a", "blanks_a", "false_alarms_b", "blanks_b")
    assert [repr(of_a[name]) for name in names] == ["1", "2", "1", "2"]
    assert [of_b[name] for name in names] == [None] * 4
