"""Texts of a window: filled in, broken, turned to the left."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiment.participant.wrapping import filled, wrapped

WORDS = st.lists(st.text(st.characters(categories=("L", "N")), min_size=1), min_size=1)


@pytest.mark.slow
@given(words=WORDS, longest=st.integers(1, 12))
def test_a_broken_text_says_the_same_in_lines_that_fit(words: list[str], longest: int) -> None:
    text = " ".join(words)
    lines = wrapped(text, lambda line: len(line) <= longest)
    assert all(len(line) <= longest for line in lines)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")


@pytest.mark.slow
@given(words=WORDS)
def test_words_that_fit_stay_whole(words: list[str]) -> None:
    longest = max(map(len, words))
    lines = wrapped(" ".join(words), lambda line: len(line) <= longest)
    assert [word for line in lines for word in line.split()] == words


def test_line_breaks_of_the_study_are_kept() -> None:
    assert wrapped("one\n\ntwo", lambda _: True) == ("one", "", "two")


def test_a_text_tells_how_far_it_is() -> None:
    text = filled("{done}/{planned}, {seconds} s, {left}, {{done}}", {"done": 3, "planned": 8})
    assert text == "3/8, {seconds} s, {left}, {done}"
