"""The wire format: frames out of anything, golden frames, and the page that states it all."""

import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from device.core.core import WATCHDOG_US
from device.core.messages import (
    Arm,
    AskHealth,
    AskLimits,
    AskMeasured,
    Beat,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Ping,
    Query,
    Stop,
)
from device.core.reports import TAPS, UNITS, DeviceLimits, Entropy, Health, Measurement
from device.core.states import State
from device.core.tokens import Fate, Record
from device.errors import Refusal, Rejected
from device.wire import codec, frames
from device.wire.codec import (
    FATES,
    REFUSALS,
    STATES,
    TABLE,
    AnswerPayload,
    Kind,
    QuestionPayload,
    Told,
)
from device.wire.endpoint import Endpoint
from device.wire.frames import LONGEST_PAYLOAD, Decoder, Frame, encode
from device.wire.upload import LONGEST_DATA, Begin, Commit, Data, data_of, octets_of
from tests.test_device import golden
from tests.test_device.bursts import refusal
from tests.test_device.golden import Reader

TESTS = Path(__file__).parents[1]
GOLDEN = json.loads(golden.FILE.read_text(encoding="utf-8"))
EXCHANGES = [step for step in GOLDEN["steps"] if "question" in step]
PAGE = (TESTS.parent / "docs" / "protocol.md").read_text(encoding="utf-8")

some_frame = st.builds(
    Frame,
    kind=st.integers(0, 255),
    sequence=st.integers(0, 0xFFFF),
    payload=st.binary(max_size=LONGEST_PAYLOAD),
)


def fed_in_pieces(data: bytes, cuts: list[int]) -> tuple[list[Frame], Decoder]:
    decoder, found, begin = Decoder(), [], 0
    for cut in sorted({min(cut, len(data)) for cut in cuts} | {len(data)}):
        found += decoder.feed(data[begin:cut])
        begin = cut
    return found, decoder


@settings(max_examples=200)
@given(frame=some_frame)
def test_a_frame_survives_the_wire(frame: Frame) -> None:
    coded = encode(frame)
    assert Decoder().feed(coded) == [frame]
    assert 0 not in coded[1:-1]
    assert len(coded) <= LONGEST_PAYLOAD + 8 + 3


@pytest.mark.slow
@settings(max_examples=500)
@given(data=st.binary(max_size=600), cuts=st.lists(st.integers(0, 600), max_size=8))
@example(data=bytes(range(256)) * 2, cuts=[1, 2, 3])
@example(data=b"\xff" * 600, cuts=[300])
def test_any_bytes_are_read_without_an_error_and_in_bounded_memory(
    data: bytes, cuts: list[int]
) -> None:
    _, decoder = fed_in_pieces(data, cuts)
    assert len(decoder._piece) <= LONGEST_PAYLOAD + 8 + 1
    ping = Frame(kind=2, sequence=1, payload=b"after the noise")
    assert decoder.feed(encode(ping))[-1] == ping


@pytest.mark.slow
@settings(max_examples=300)
@given(
    sent=st.lists(some_frame, max_size=5),
    noise=st.lists(st.binary(max_size=300), min_size=6, max_size=6),
    cuts=st.lists(st.integers(0, 2500), max_size=8),
)
def test_every_whole_frame_between_noise_is_found(
    sent: list[Frame], noise: list[bytes], cuts: list[int]
) -> None:
    data = noise[0] + b"".join(
        encode(frame) + after for frame, after in zip(sent, noise[1:], strict=False)
    )
    found, _ = fed_in_pieces(data, cuts)
    remaining = iter(found)
    assert all(frame in remaining for frame in sent)


@pytest.mark.slow
@settings(max_examples=300)
@given(frame=some_frame, where=st.integers(0, 200), flip=st.integers(1, 255))
def test_a_frame_with_one_wrong_byte_is_dropped(frame: Frame, where: int, flip: int) -> None:
    coded = bytearray(encode(frame))
    coded[where % len(coded)] ^= flip
    decoder = Decoder()
    assert decoder.feed(bytes(coded) + b"\x00") == []
    assert decoder.feed(encode(frame)) == [frame]


def test_memory_stays_bounded_over_a_stream_without_delimiters() -> None:
    decoder = Decoder()
    for _ in range(1000):
        decoder.feed(b"\x55" * 997)
        assert len(decoder._piece) <= LONGEST_PAYLOAD + 9
    assert decoder.dropped == 0
    assert decoder.feed(b"\x00") == []
    assert decoder.dropped == 1


def test_two_million_random_bytes_hold_no_frame() -> None:
    decoder = Decoder()
    data = np.random.default_rng(7).integers(0, 256, size=2_000_000, dtype=np.uint8)
    assert decoder.feed(data.tobytes()) == []
    assert decoder.dropped > 5000


@pytest.mark.parametrize(
    "wrong",
    [{"kind": 256}, {"kind": -1}, {"sequence": 65536}, {"payload": bytes(LONGEST_PAYLOAD + 1)}],
)
def test_a_frame_that_does_not_fit_the_wire_is_refused(wrong: dict[str, Any]) -> None:
    fields: dict[str, Any] = {"kind": 1, "sequence": 1, "payload": b""} | wrong
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Frame(**fields)


def golden_device() -> Endpoint:
    return golden.power_on(Reader())


def ping(device: Endpoint, number: int = 1) -> bytes:
    payload = codec.payload(Ping(), device.core.boot_id)
    return encode(Frame(kind=2, sequence=number, payload=payload))


@pytest.mark.slow
@settings(max_examples=300)
@given(data=st.binary(max_size=400))
def test_an_endpoint_takes_any_bytes(data: bytes) -> None:
    device = golden_device()
    device.receive(1, data)
    assert len(Decoder().feed(device.receive(2, b"\0" + ping(device)))) == 1


@pytest.mark.slow
@settings(max_examples=500)
@given(
    kind=st.sampled_from(sorted(Kind)) | st.integers(0, 255),
    content=st.binary(max_size=60),
    meant=st.booleans(),
)
def test_any_payload_in_a_whole_frame_is_answered_or_dropped(
    kind: int, content: bytes, *, meant: bool
) -> None:
    device = golden_device()
    question = QuestionPayload(boot_id=device.core.boot_id, content=content)
    payload = codec.QUESTION.pack(question) if meant else content
    frame = Frame(kind=kind, sequence=3, payload=payload)
    answers = Decoder().feed(device.receive(1, encode(frame)))
    silent = kind == Kind.BEAT or kind >= codec.ANSWER
    assert len(answers) == (0 if silent else 1)
    for answer in answers:
        assert (answer.kind, answer.sequence) == (kind | codec.ANSWER, 3)
        codec.HEAD.read(answer.payload)


@pytest.mark.parametrize("ending", [b"\n", b"\r\n"])
@pytest.mark.parametrize(
    "before", [b"", b"\0", b"hello?\r\n", encode(Frame(kind=2, sequence=1, payload=b""))]
)
def test_a_terminal_is_told_who_is_there(before: bytes, ending: bytes) -> None:
    device = golden_device()
    device.receive(1, before)
    for byte in b"*IDN?" + ending[:-1]:
        assert device.receive(2, bytes([byte])) == b""
    said = device.receive(3, ending[-1:])
    facts = GOLDEN["device"]
    expected = f"tactstrip,{facts['model']},{facts['serial_number']},protocol 2.0\n"
    assert said == expected.encode()


@pytest.mark.parametrize("cut", range(11))
def test_a_question_with_more_on_its_line_is_none_however_it_comes(cut: int) -> None:
    device, typed = golden_device(), b"*IDN?\r X\n"
    assert device.receive(1, typed[:cut]) + device.receive(2, typed[cut:]) == b""
    assert device.receive(3, b"*IDN? \t\r\n").startswith(b"tactstrip,")


@pytest.mark.slow
@settings(max_examples=300)
@given(
    kind=st.integers(0, 127),
    head=st.binary(max_size=30),
    tail=st.binary(max_size=30),
    cuts=st.lists(st.integers(0, 100), max_size=4),
)
def test_a_question_in_plain_text_inside_a_frame_is_no_question(
    kind: int, head: bytes, tail: bytes, cuts: list[int]
) -> None:
    payload = head + b"\n*IDN?\n" + tail
    coded = encode(Frame(kind=kind, sequence=1, payload=payload))
    line = golden_device()._text
    begin = 0
    for cut in [*sorted(cuts), len(coded)]:
        assert line.feed(coded[begin:cut]) == b""
        begin = max(begin, cut)


def test_a_plain_question_between_frames_disturbs_neither() -> None:
    device = golden_device()
    said = device.receive(1, ping(device, 1) + b"*IDN?\n" + ping(device, 2))
    assert [answer.sequence for answer in Decoder().feed(said)] == [1, 2]
    assert b"tactstrip," in said


def asked(device: Endpoint, message: Message[Any], number: int) -> Refusal | None:
    """Ask a question; return why it was refused."""
    payload = codec.payload(message, device.core.boot_id)
    question = Frame(kind=codec.kind_of(message), sequence=number, payload=payload)
    (answer,) = Decoder().feed(device.receive(1, encode(question)))
    return codec.HEAD.read(answer.payload).refusal


def test_a_line_that_is_lost_leaves_nothing_half_done() -> None:
    device = golden_device()
    device.receive(1, b"*ID")
    device.hang_up(1)
    assert device.receive(1, b"N?\n") == b""
    asking = ping(device)
    device.receive(1, b"\0" + asking[:9])
    device.hang_up(1)
    assert device.receive(1, asking[9:]) == b""
    silence = np.zeros(4, dtype=np.int32)
    octets = octets_of(LoadSlot(slot=0, left=silence, right=silence), 16)
    commit = Commit(slot=0, crc=zlib.crc32(octets))
    for begin, hangs_up in ((3, True), (10, False)):
        assert asked(device, Begin(slot=0, samples=4), begin) is None
        assert [asked(device, piece, 0) for piece in data_of(octets, begin)] == [None]
        if hangs_up:
            device.hang_up(1)
        assert asked(device, commit, begin + 1) is (Refusal.BAD_UPLOAD if hangs_up else None)


def test_a_piece_of_a_waveform_is_no_message_of_the_core() -> None:
    core, piece = golden_device().core, Begin(slot=0, samples=1)
    assert refusal(lambda: core.take(1, piece), Rejected) is Refusal.BAD_MESSAGE


def test_the_golden_frames_are_what_an_endpoint_answers() -> None:
    reader = Reader()
    device = golden.power_on(reader)
    for step in GOLDEN["steps"]:
        if "question" in step:
            answered = device.receive(step["at_us"], bytes.fromhex(step["question"]))
            assert answered.hex(" ") == step["answer"], step["meaning"]
        elif "sense" in step:
            known, sensed = step["sense"]["known"], step["sense"]["set"]
            device.core.sense(step["at_us"], Health.of_bits(known=known, set_bits=sensed))
        elif "reading" in step:
            told = step["reading"] | {"token": 1, "unit": UNITS[step["reading"]["unit"]]}
            reader.reading = Measurement(**told | {"tap": TAPS[told["tap"]]})
        else:
            assert step["hang_up"]
            device.hang_up(step["at_us"])


def test_the_golden_frames_are_those_that_their_script_writes() -> None:
    assert golden.FILE.read_text(encoding="utf-8") == golden.text()


@pytest.mark.parametrize("exchange", EXCHANGES, ids=lambda e: e["meaning"][:60])
def test_the_golden_frames_are_what_they_are_said_to_be(exchange: dict[str, Any]) -> None:
    (question,) = Decoder().feed(bytes.fromhex(exchange["question"]))
    known = {int(kind): kind.name for kind in Kind}
    assert known.get(question.kind, "unknown") == exchange["type"]
    if exchange["answer"]:
        (answer,) = Decoder().feed(bytes.fromhex(exchange["answer"]))
        assert (answer.kind, answer.sequence) == (question.kind | 0x80, question.sequence)
        said = codec.HEAD.read(answer.payload)
        assert (said.refusal.name if said.refusal else None) == exchange["refusal"]
        assert said.state.value == exchange["state"]
        assert said.device_us <= exchange["at_us"]


def test_a_host_packs_the_golden_questions_byte_for_byte() -> None:
    packed = set()
    for exchange in EXCHANGES:
        (question,) = Decoder().feed(bytes.fromhex(exchange["question"]))
        if not question.payload or exchange["refusal"] in {"BAD_MESSAGE", "BAD_TOKEN"}:
            continue
        if question.kind == Kind.HELLO:
            meant, content = 0, question.payload
        else:
            asked = codec.QUESTION.read(question.payload)
            meant, content = asked.boot_id, asked.content
        message = codec.read(question.kind, content)
        assert codec.payload(message, meant) == question.payload, exchange["meaning"]
        packed.add(codec.kind_of(message))
    assert packed == set(Kind)


def test_the_golden_frames_hold_every_type_and_every_refusal_of_the_wire() -> None:
    types = {exchange["type"] for exchange in EXCHANGES}
    assert types == {kind.name for kind in Kind} | {"unknown"}
    refusals = {exchange["refusal"] for exchange in EXCHANGES} - {None}
    on_the_host = set(GOLDEN["refusals_of_hosts_only"])
    assert refusals == {refusal.name for refusal in Refusal} - on_the_host


@pytest.mark.parametrize("noise", GOLDEN["no_frames"], ids=lambda n: n["meaning"])
def test_what_is_no_golden_frame_gets_no_answer(noise: dict[str, Any]) -> None:
    assert golden_device().receive(1, bytes.fromhex(noise["bytes"])) == b""


LAYOUTS = {
    **{kind.name: row.message for kind, row in TABLE.items()},
    **{f"answer to {kind.name}": row.answer for kind, row in TABLE.items() if row.answer},
    "question": codec.QUESTION,
    "answer": codec.HEAD,
}


def test_every_type_has_its_row_and_every_row_its_own_message() -> None:
    assert set(TABLE) == set(Kind)
    assert len({row.message.of for row in TABLE.values()}) == len(TABLE)


@pytest.mark.parametrize("name", LAYOUTS)
@settings(max_examples=60)
@given(content=st.binary(max_size=LONGEST_PAYLOAD))
def test_a_content_is_read_or_refused_as_such(name: str, content: bytes) -> None:
    codes = set()
    try:
        LAYOUTS[name].read(content)
    except Rejected as refused:
        codes.add(refused.code)
    assert codes <= {Refusal.BAD_MESSAGE, Refusal.BAD_TOKEN}


def test_numbers_that_stand_for_nothing_are_refused() -> None:
    told = codec.TOLD.pack(codec.Told.of(Record(token=3, fate=Fate.ABORTED)))
    head = codec.HEAD.pack(AnswerPayload(refusal=None, state=State.SAFE, boot_id=5, device_us=9))
    for layout, content, place, number in (
        (codec.TOLD, told, 8, len(FATES)),
        (codec.HEAD, head, 0, len(Refusal) + 1),
        (codec.HEAD, head, 1, len(STATES)),
        (codec.HEAD, head, 17, 128),
    ):
        wrong = content[:place] + bytes([number]) + content[place + 1 :]
        with pytest.raises(Rejected, match=Refusal.BAD_MESSAGE.text):
            layout.read(wrong)


some_token = st.integers(1, 2**64 - 1)
some_slot = st.integers(0, 255)
some_u16 = st.integers(0, 0xFFFF)
some_octets = st.binary(min_size=1, max_size=LONGEST_DATA)
some_u32 = st.integers(0, 2**32 - 1)


@given(
    message=st.builds(Arm, token=some_token, slot=some_slot, time_to_live_us=some_u32)
    | st.builds(Levels, left_mvpp=some_u32, right_mvpp=some_u32)
    | st.sampled_from([Fire, Disarm, Query, AskMeasured]).flatmap(
        lambda of: st.builds(of, token=some_token)
    )
    | st.sampled_from([Ping(), Enable(), Stop(), Beat(), AskLimits(), AskHealth()])
    | st.builds(Begin, slot=some_slot, samples=some_u32)
    | st.builds(Data, upload=some_u16, offset=some_u32, octets=some_octets)
    | st.builds(Commit, slot=some_slot, crc=some_u32),
    boot_id=st.integers(0, 2**64 - 1),
)
def test_a_message_that_is_packed_is_read_again(message: Message[Any], boot_id: int) -> None:
    question = codec.QUESTION.read(codec.payload(message, boot_id))
    assert question.boot_id == boot_id
    assert codec.read(codec.kind_of(message), question.content) == message


@given(
    st.builds(
        DeviceLimits,
        slots=some_slot,
        memory_samples=some_u32,
        least_interval_us=some_u32,
        max_duty_ppm=some_u32,
        dc_tolerance_ppm=some_u32,
        longest_time_to_live_us=some_u32,
        data_window=some_slot,
        entropy=st.sampled_from(Entropy),
        firmware=st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=32),
    )
)
def test_limits_that_are_told_are_read_again(limits: DeviceLimits) -> None:
    assert codec.understood(Kind.LIMITS, codec.told(Kind.LIMITS, limits)) == limits


@given(known=st.integers(0, 255), told=st.integers(0, 255))
def test_health_keeps_what_is_known_and_nothing_else(known: int, told: int) -> None:
    health = codec.understood(Kind.HEALTH, bytes([known, told]))
    assert codec.told(Kind.HEALTH, health) == bytes([known & 7, known & told & 7])


@given(
    st.builds(
        Measurement,
        token=some_token,
        tap=st.sampled_from(TAPS),
        unit=st.sampled_from(UNITS),
        left=some_u32,
        right=some_u32,
        onset_offset_us=some_u32,
        onset_uncertainty_us=some_u32,
        correlation_left=some_u16,
        correlation_right=some_u16,
    )
)
def test_a_measurement_that_is_told_is_read_again(measured: Measurement) -> None:
    assert codec.understood(Kind.MEASURED, codec.told(Kind.MEASURED, measured)) == measured


def test_a_name_of_firmware_that_is_no_ascii_is_refused() -> None:
    told = codec.told(Kind.LIMITS, golden.TOLD)
    with pytest.raises(Rejected, match="firmware"):
        codec.understood(Kind.LIMITS, told[:-1] + b"\xff")


@given(token=some_token, level=some_u32, fate=st.sampled_from(Fate))
def test_a_record_that_is_told_is_read_again(token: int, level: int, fate: Fate) -> None:
    start_us = 5 if fate is Fate.FIRED else None
    record = Record(token=token, fate=fate, start_us=start_us, levels_mvpp=(level, 1))
    assert codec.TOLD.read(codec.TOLD.pack(Told.of(record))).record == record


@given(
    st.builds(
        AnswerPayload,
        refusal=st.none() | st.sampled_from(Refusal),
        state=st.sampled_from(STATES),
        boot_id=st.integers(0, 2**64 - 1),
        device_us=st.integers(0, 2**63 - 1),
        body=st.binary(max_size=30),
    )
)
def test_an_answer_that_is_packed_is_read_again(answer: AnswerPayload) -> None:
    assert codec.HEAD.read(codec.HEAD.pack(answer)) == answer


def table_of(heading: str) -> list[list[str]]:
    """Return the rows of the first table under a heading, without its head."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("|")][2:]
    return [[cell.strip().strip("`") for cell in row.strip("|").split("|")] for row in rows]


def test_the_page_lists_the_types_with_their_numbers() -> None:
    listed = {row[1]: int(row[0], 16) for row in table_of("Messages")}
    assert listed == {kind.name: int(kind) for kind in Kind}


SIZES = {"u8": 1, "u16": 2, "u32": 4, "u64": 8}


def size_of(layout: str) -> int:
    """Return the bytes of a layout such as `token u64, slot u8, name 16 bytes`."""
    sizes = [SIZES[kind] for kind in re.findall(r"\b(u8|u16|u32|u64)\b", layout)]
    return sum(sizes) + sum(int(count) for count in re.findall(r"(\d+) bytes", layout))


def test_the_page_states_the_layouts() -> None:
    page = {row[1]: row for row in table_of("Messages")}
    for kind, row in TABLE.items():
        assert size_of(page[kind.name][3]) == row.message.size, kind.name
        assert size_of(page[kind.name][4]) == (row.answer.size if row.answer else 0), kind.name
    assert f"1 to {LONGEST_DATA}" in page["DATA"][3]


def test_the_page_numbers_states_and_fates() -> None:
    for heading, listed in (("States", STATES), ("Fates", FATES)):
        names = [member.value for member in listed]
        assert [(int(row[0]), row[1]) for row in table_of(heading)] == list(enumerate(names))


def test_the_page_lists_the_refusals() -> None:
    listed = [(int(row[0]), row[1], row[2]) for row in table_of("Refusals")]
    assert listed == [(int(refusal), refusal.name, refusal.text) for refusal in Refusal]
    assert [number for number, _, _ in listed] == list(range(1, len(REFUSALS)))


def test_the_page_states_version_and_times() -> None:
    assert f"version {frames.VERSION}.{frames.MINOR}" in PAGE
    assert f"at most {LONGEST_PAYLOAD} bytes" in PAGE
    assert f"{WATCHDOG_US // 1000} ms" in PAGE
