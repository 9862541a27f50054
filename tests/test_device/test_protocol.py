"""What the frames carry: layouts that are read and packed again, and the page that states them."""

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import Outcome, Refusal, Rejected
from device.core.tokens import Record
from device.wire import protocol
from device.wire.protocol import FATES, REFUSALS, STATES, TABLE, Kind
from tests.test_device import golden
from tests.test_device.bursts import refusal

PAGE = (Path(__file__).parents[2] / "docs" / "protocol.md").read_text(encoding="utf-8")
LAYOUTS = {
    **{kind.name: row.message for kind, row in TABLE.items()},
    **{f"answer to {kind.name}": row.answer for kind, row in TABLE.items() if row.answer},
    "question": protocol.QUESTION,
    "answer": protocol.HEAD,
}
SIZES = {"u8": 1, "u16": 2, "u32": 4, "u64": 8}
CHANNELS = 2
some_octets = st.lists(st.integers(0, 5) | st.integers(0, 255), max_size=96).map(bytes)


@pytest.mark.parametrize("name", LAYOUTS)
@settings(max_examples=30)
@given(octets=some_octets, fits=st.booleans())
def test_a_content_is_refused_or_read_and_packed_again(
    name: str, octets: bytes, *, fits: bool
) -> None:
    layout = LAYOUTS[name]
    content = (octets + bytes(layout.size))[: layout.size] if fits else octets
    codes, values = set(), []
    try:
        values.append(layout.read(content))
    except Rejected as error:
        codes.add(error.code)
    assert codes <= {Refusal.BAD_MESSAGE, Refusal.BAD_TOKEN}
    for value in values:
        packed = layout.pack(value)
        assert layout.read(packed) == value
        assert packed == content or name not in Kind.__members__


@pytest.mark.parametrize("kind", [Kind.FIRE, Kind.LIMITS, Kind.HEALTH, Kind.MEASURED, Kind.STOP])
def test_a_report_is_read_again(kind: Kind) -> None:
    report = {
        Kind.FIRE: Record(token=3, outcome=Outcome.FIRED, start_us=5, levels_mvpp=(64_100, 1)),
        Kind.LIMITS: golden.power_on(golden.Reader()).core.take(
            1, protocol.read_message(Kind.LIMITS, b"")
        ),
        Kind.HEALTH: protocol.read_report(Kind.HEALTH, b"\x05\x04", 2),
        Kind.MEASURED: golden.READING,
        Kind.STOP: None,
    }[kind]
    assert protocol.read_report(kind, protocol.pack_report(kind, report, 2), 2) == report


@given(known=st.integers(0, 255), sensed=st.integers(0, 255))
def test_health_keeps_what_is_known_and_nothing_else(known: int, sensed: int) -> None:
    health = protocol.read_report(Kind.HEALTH, bytes([known, sensed]), 2)
    assert protocol.pack_report(Kind.HEALTH, health, 2) == bytes([known & 7, known & sensed & 7])


@pytest.mark.parametrize(
    ("layout", "place", "number"),
    [
        (protocol.RECORD, 8, len(FATES)),
        (protocol.HEAD, 0, len(Refusal) + 1),
        (protocol.HEAD, 1, len(STATES)),
        (protocol.HEAD, 17, 128),
        (protocol.LIMITS, -1, 255),
    ],
)
def test_numbers_that_stand_for_nothing_are_refused(layout: Any, place: int, number: int) -> None:
    content = bytearray([1] + [0] * (layout.size - 1))
    layout.read(bytes(content))
    content[place] = number
    assert refusal(lambda: layout.read(bytes(content)), Rejected) is Refusal.BAD_MESSAGE


def test_every_type_has_its_row_and_every_row_its_own_message() -> None:
    assert set(TABLE) == set(Kind)
    assert len({row.message.make for row in TABLE.values()}) == len(TABLE)


def test_a_piece_of_a_waveform_is_no_message_of_the_core() -> None:
    core, piece = (
        golden.power_on(golden.Reader()).core,
        protocol.read_message(Kind.BEGIN, b"\0\1\0\0\0"),
    )
    assert refusal(lambda: core.take(1, piece), Rejected) is Refusal.BAD_MESSAGE


def table_of(heading: str) -> list[list[str]]:
    """Return the rows of the first table under a heading, without its head."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip().strip("`") for cell in row.strip("|").split("|")] for row in rows]


def size_of(layout: str) -> int:
    """Return the bytes of a layout such as `token u64, slot u8, name 16 bytes, level u32 x n`."""
    sizes = [
        SIZES[kind] * (CHANNELS if each else 1)
        for kind, each in re.findall(r"\b(u8|u16|u32|u64)\b( x n)?", layout)
    ]
    return sum(sizes) + sum(int(count) for count in re.findall(r"(\d+) bytes", layout))


def size_with_channels(layout: protocol.Layout[Any] | None) -> int:
    """Return the bytes of a layout whose repeated fields are those of two channels."""
    if layout is None:
        return 0
    return layout.size + (layout.size_of_each > 1) * CHANNELS * layout.size_of_each


def test_the_page_lists_the_types_with_their_numbers_and_layouts() -> None:
    page = {row[1]: row for row in table_of("Messages")}
    assert {name: int(row[0], 16) for name, row in page.items()} == {k.name: int(k) for k in Kind}
    for kind, row in TABLE.items():
        assert size_of(page[kind.name][3]) == size_with_channels(row.message), kind.name
        size = size_with_channels(row.answer)
        size += protocol.IDENTITY.size if kind is Kind.HELLO else 0
        assert size_of(page[kind.name][4]) == size, kind.name


def test_the_page_numbers_states_and_fates() -> None:
    names = {"States": [state.value for state in STATES], "Fates": list(FATES)}
    for heading, listed in names.items():
        assert [(int(row[0]), row[1]) for row in table_of(heading)] == list(enumerate(listed))
    assert [int(refusal) for refusal in Refusal] == list(range(1, len(REFUSALS)))
