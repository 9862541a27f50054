"""CSV tables: what a spreadsheet would calculate is text; different texts stay different."""

from __future__ import annotations

import re

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analysis.results.files import csv_text, harmless

DANGEROUS = re.compile(r"""\s*[=+\-@＝＋－＠]""")
TEXTS = st.text(alphabet="=+-@＝'\";,|\t a1.e", max_size=8)


def is_number(cell: str) -> bool:
    return re.fullmatch(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?", cell) is not None


@pytest.mark.parametrize(
    "text", ["=1+1", "+7 dB", "-6 dB", "@SUM(A1)", "\t=1", " =1", '=HYPERLINK("x";"y")', "＝1+1"]
)
def test_a_formula_gets_an_apostrophe(text: str) -> None:
    assert harmless(text) == f"'{text}" or harmless(text).startswith(text[0] + "'")


@pytest.mark.parametrize("text", ["S01", "-3", "+3.5", "1e-3", "n/a", "a-b", "", "bare plate", "'"])
def test_other_texts_stay_as_they_are(text: str) -> None:
    assert harmless(text) == text


@given(TEXTS)
def test_no_spreadsheet_finds_a_formula_whatever_ends_its_cells(text: str) -> None:
    written = harmless(text)
    if not is_number(text):
        for end in ",;|\t":
            assert not any(DANGEROUS.match(part.strip('"')) for part in written.split(end))


@given(TEXTS, TEXTS)
def test_different_texts_stay_different(one: str, other: str) -> None:
    assert (harmless(one) == harmless(other)) == (one == other)


def test_missing_values_are_written_in_words_and_numbers_shortest() -> None:
    values = pd.DataFrame({"v": [60.0, None, -0.1], "ok": pd.array([True, None, False], "boolean")})
    assert csv_text(values) == "v,ok\n60,true\nn/a,n/a\n-0.1,false\n"
