"""Frames: whole ones are read out of any bytes, and a device answers nothing else."""

import struct
import zlib
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from device import Refusal
from device.wire.frames import Decoder, Frame, encode, longest_payload
from device.wire.protocol import GREETING, HEAD, IDENTITY, QUESTION, TABLE
from device.wire.upload import LONGEST_DATA
from tests.test_device import golden, wire
from tests.test_device.golden import GOLDEN, Reader

EXCHANGES = [step for step in GOLDEN["steps"] if "question" in step]
OWN_BOOT = GOLDEN["device"]["boot_id"]

some_frame = st.builds(
    Frame,
    kind=st.integers(0, 255),
    sequence=st.integers(0, 0xFFFF),
    payload=st.binary(max_size=longest_payload(64)),
)


def fed_in_pieces(data: bytes, cuts: list[int]) -> tuple[list[Frame], Decoder]:
    decoder, frames, begin = Decoder(), [], 0
    for cut in sorted({min(cut, len(data)) for cut in cuts} | {len(data)}):
        frames += decoder.feed(data[begin:cut])
        begin = cut
    return frames, decoder


@settings(max_examples=80)
@given(frame=some_frame, where=st.integers(0, 500), flip=st.integers(1, 255))
def test_a_frame_survives_the_wire_and_one_with_a_wrong_byte_is_dropped(
    frame: Frame, where: int, flip: int
) -> None:
    coded = bytearray(encode(frame))
    assert Decoder().feed(bytes(coded)) == [frame]
    assert 0 not in coded[1:-1]
    assert len(coded) <= longest_payload(64) + 8 + 4
    coded[where % len(coded)] ^= flip
    decoder = Decoder()
    assert decoder.feed(bytes(coded) + b"\x00") == []
    assert decoder.feed(encode(frame)) == [frame]


@settings(max_examples=50)
@given(
    sent=st.lists(some_frame, max_size=5),
    noise=st.lists(st.binary(max_size=600), min_size=6, max_size=6),
    cuts=st.lists(st.integers(0, 2500), max_size=8),
)
@example(sent=[], noise=[bytes(range(256)) * 2] * 6, cuts=[1, 2, 3])
@example(sent=[], noise=[b"\xff" * 600] * 6, cuts=[300])
def test_every_whole_frame_between_noise_is_read(
    sent: list[Frame], noise: list[bytes], cuts: list[int]
) -> None:
    data = noise[0] + b"".join(
        encode(frame) + after for frame, after in zip(sent, noise[1:], strict=False)
    )
    frames, decoder = fed_in_pieces(data, cuts)
    remaining = iter(frames)
    assert all(frame in remaining for frame in sent)
    last = Frame(kind=2, sequence=1, payload=b"after the noise")
    assert decoder.feed(encode(last))[-1] == last


def test_two_million_random_bytes_hold_no_frame() -> None:
    decoder = Decoder()
    data = np.random.default_rng(7).integers(0, 256, size=2_000_000, dtype=np.uint8)
    assert decoder.feed(data.tobytes()) == []


@pytest.mark.parametrize("wrong", [{"kind": 256}, {"kind": -1}, {"sequence": 65536}])
def test_a_frame_that_does_not_fit_the_wire_is_refused(wrong: dict[str, Any]) -> None:
    fields: dict[str, Any] = {"kind": 1, "sequence": 1, "payload": b""} | wrong
    with pytest.raises(struct.error):
        encode(Frame(**fields))


def test_every_payload_fits_a_frame_and_a_longer_one_is_noise() -> None:
    longest_rest = max(IDENTITY.size, LONGEST_DATA)  # of an answer to HELLO, and of DATA
    for channels in (1, 2, 10, 11, 64):
        longest = longest_payload(channels)
        for row in TABLE.values():
            question = QUESTION.size + row.message.size + channels * row.message.size_of_each
            assert question <= longest
            if row.answer is not None:
                answer = HEAD.size + row.answer.size + channels * row.answer.size_of_each
                assert answer <= longest
        assert HEAD.size + GREETING.size + longest_rest <= longest
        for size in (longest, longest + 1):
            frame = Frame(kind=1, sequence=1, payload=bytes(size))
            assert Decoder(channels).feed(encode(frame)) == [frame] * (size == longest)


def ping(number: int = 1) -> bytes:
    return wire.question("PING", number, boot_id=OWN_BOOT)


@settings(max_examples=100)
@given(
    noise=st.binary(max_size=400),
    kind=st.integers(0, 255) | st.sampled_from([0x01, 0x10, 0x11, 0x22, 0x24, 0x30, 0x31]),
    content=st.binary(max_size=60),
    meant=st.booleans(),
)
def test_any_whole_frame_is_answered_once_after_any_bytes(
    noise: bytes, kind: int, content: bytes, *, meant: bool
) -> None:
    device = golden.power_on(Reader())
    device.receive(1, noise)
    payload = OWN_BOOT.to_bytes(8, "little") * meant + content
    frame = encode(Frame(kind=kind, sequence=3, payload=payload))
    answers = wire.answers(device.receive(2, b"\0" + frame))
    silent = kind in {0x31, *range(0x80, 0x100)}
    assert [answer.number for answer in answers] == [] if silent else [3]


@pytest.mark.parametrize("ending", [b"\n", b"\r\n"])
@pytest.mark.parametrize("before", [b"", b"\0", b"hello?\r\n", ping()])
def test_a_terminal_is_answered_with_the_devices_name(before: bytes, ending: bytes) -> None:
    device = golden.power_on(Reader())
    device.receive(1, before)
    for byte in b"*IDN?" + ending[:-1]:
        assert device.receive(2, bytes([byte])) == b""
    answer = device.receive(3, ending[-1:]).decode()
    facts = GOLDEN["device"]
    assert answer == f"tactstrip,{facts['model']},{facts['serial_number']},protocol 2.0\n"


@pytest.mark.parametrize("cut", range(11))
def test_a_question_with_more_on_its_line_is_none_however_it_comes(cut: int) -> None:
    device, typed = golden.power_on(Reader()), b"*IDN?\r X\n"
    assert device.receive(1, typed[:cut]) + device.receive(2, typed[cut:]) == b""
    assert device.receive(3, b"*IDN? \t\r\n").startswith(b"tactstrip,")


def test_a_plain_question_between_frames_disturbs_neither() -> None:
    octets = golden.power_on(Reader()).receive(1, ping(1) + b"*IDN?\n" + ping(2))
    assert [answer.number for answer in wire.answers(octets)] == [1, 2]
    assert b"tactstrip," in octets


def test_a_line_that_is_lost_leaves_nothing_half_done() -> None:
    device = golden.power_on(Reader())
    for octets, cut in ((b"*IDN?\n", 3), (b"\0" + ping(), 10)):
        device.receive(1, octets[:cut])
        device.hang_up(1)
        assert device.receive(1, octets[cut:]) == b""
    silence = np.zeros((2, 4), dtype=np.int32)
    for number, hangs_up in ((3, True), (10, False)):
        octets, pieces = wire.upload_of(silence, number)
        assert wire.ask(device, number, "BEGIN", slot=0, samples=4).refusal is None
        for piece in pieces:
            fields = {"upload": number, "offset": piece.offset, "octets": piece.octets}
            assert wire.ask(device, 0, "DATA", **fields).refusal is None
        if hangs_up:
            device.hang_up(1)
        refusal = wire.ask(device, number + 1, "COMMIT", slot=0, crc=zlib.crc32(octets)).refusal
        assert refusal is (Refusal.BAD_UPLOAD if hangs_up else None)


def test_the_golden_frames_are_what_this_program_answers_and_writes() -> None:
    reader = Reader()
    device = golden.power_on(reader)
    for step in GOLDEN["steps"]:
        answer = golden.replay(device, reader, step)
        assert answer.hex(" ") == step.get("answer", ""), step["meaning"]
    assert golden.FILE.read_text(encoding="utf-8") == golden.written_again()
    for noise in GOLDEN["no_frames"]:
        assert golden.power_on(Reader()).receive(1, bytes.fromhex(noise["bytes"])) == b""


def test_the_golden_frames_are_what_their_file_states() -> None:
    for exchange in EXCHANGES:
        assert wire.kinds(bytes.fromhex(exchange["question"])) == [exchange["type"]]
        for answer in wire.answers(bytes.fromhex(exchange["answer"])):
            refusal = answer.refusal.name if answer.refusal else None
            assert (answer.kind, refusal) == (exchange["type"], exchange["refusal"])
            assert answer.state == exchange["state"]
            assert answer.device_us <= exchange["at_us"]


def test_a_host_packs_the_golden_questions_byte_for_byte() -> None:
    packed = set()
    for exchange in EXCHANGES:
        octets = bytes.fromhex(exchange["question"])
        if again := wire.packed_again(octets):
            assert again == octets, exchange["meaning"]
            packed.add(exchange["type"])
    assert packed == {exchange["type"] for exchange in EXCHANGES} - {"unknown"}


def test_the_golden_frames_hold_every_refusal_of_the_wire() -> None:
    refusals = {exchange["refusal"] for exchange in EXCHANGES} - {None}
    on_the_host = set(GOLDEN["refusals_of_hosts_only"])
    assert refusals == {refusal.name for refusal in Refusal} - on_the_host
