"""What reaches a terminal: no control character of a value, whatever it comes from."""

from __future__ import annotations

import io

from hypothesis import given
from hypothesis import strategies as st

from device.printing import MAX_SHOWN, echo, escaped, shown


@given(st.text())
def test_an_escaped_text_is_one_line_that_moves_no_cursor(text: str) -> None:
    line = escaped(text)
    assert len(line.splitlines()) <= 1
    assert all(c.isprintable() or c.isspace() or c in "\u200c\u200d" for c in line)
    assert escaped(line) == line
    line.encode()  # also of what stands for bytes that are no text


@given(st.text(st.characters(categories=["L", "N", "P"])))
def test_words_of_any_script_stay_as_they_are(text: str) -> None:
    assert escaped(text) == text


@given(st.text() | st.binary() | st.integers())
def test_a_message_repeats_little_of_a_value(value: object) -> None:
    assert len(shown(value)) <= MAX_SHOWN


def test_letters_that_the_stream_lacks_are_escaped() -> None:
    written = io.BytesIO()
    with io.TextIOWrapper(written, encoding="ascii", newline="\n") as stream:
        echo("1.6 µm − \x1b", file=stream)
        stream.flush()
        assert written.getvalue() == b"1.6 \\xb5m \\u2212 \\x1b\n"
