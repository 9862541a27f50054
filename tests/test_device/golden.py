"""The golden frames: what is asked of a device from power on, and all that it answers.

`python -m tests.test_device.golden` writes tests/golden_frames.json anew, by the core and the codec
of this program; a test says where the file and they disagree. Nobody need trust them for it: the
file was read against docs/protocol.md, and an implementation in another language agrees with it.
"""

from __future__ import annotations

import json
import zlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from cobs import cobs

from device.core.core import DeviceCore
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
    to_codes,
)
from device.core.output import Emission, OutputStage
from device.core.reports import TAPS, UNITS, About, DeviceLimits, Entropy, Health, Measurement
from device.errors import Refusal
from device.limits import Limits
from device.wire import codec
from device.wire.codec import Hello, Kind
from device.wire.endpoint import Endpoint
from device.wire.frames import Decoder, Frame, encode
from device.wire.upload import Begin, Commit, Data, data_of, octets_of
from tests.test_device.bursts import identity, sine

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.core.messages import CodeArray

FILE: Final = Path(__file__).parents[1] / "golden_frames.json"
BOOT_ID: Final = 0x1122334455667788
FACTS: Final[dict[str, Any]] = {
    "model": "example",
    "serial_number": "0001",
    "boot_id": BOOT_ID,
    "sample_rate_hz": 48000.0,
    "bits": 16,
    "ceiling_vpp": 200.0,
    "longest_waveform": 64,
    "emulated": False,
}
LIMITS: Final = Limits(
    ceiling_vpp=200.0,
    least_interval_s=0.001,
    longest_waveform=64,
    slots=4,
    memory_samples=96,
)
ABOUT: Final = About(firmware="example 1.2", entropy=Entropy.HARDWARE, data_window=8)
TOLD: Final = DeviceLimits.of(LIMITS, ABOUT)
ON_THE_HOST: Final = ("LENGTHS_DIFFER", "NOT_FINITE", "BAD_LEVEL", "NOT_OPEN", "ALREADY_OPEN")
READING: Final = Measurement(
    token=1,
    tap="amplifier",
    unit="mV",
    left=49_900,
    right=12,
    onset_offset_us=21,
    onset_uncertainty_us=11,
    correlation_left=9987,
)
SIXTEEN: Final = 16
LIFE_US: Final = 5_000_000


@dataclass(slots=True)
class Reader:
    """What an input of the golden device measures of each burst that ends."""

    reading: Measurement | None = None

    def __call__(self, burst: Emission) -> Measurement | None:
        """Return it."""
        if self.reading is None:
            return None
        return Measurement(**asdict(self.reading) | {"token": burst.token})


def power_on(reader: Reader, sink: Callable[[Emission], None] = lambda _: None) -> Endpoint:
    """Return the golden device, freshly switched on."""
    core = DeviceCore(
        boot_id=BOOT_ID,
        limits=LIMITS,
        output=OutputStage(),
        sink=sink,
        measure=reader,
        about=ABOUT,
    )
    return Endpoint(core, identity(**FACTS))


class Script:
    """Writes down what is asked and answered."""

    def __init__(self) -> None:
        self.reader = Reader()
        self.device = power_on(self.reader)
        self.steps: list[dict[str, Any]] = []
        self.now_us = 0
        self.number = 0x0D63
        self.step_us = 1000

    def ask(
        self, meaning: str, message: Message[Any], number: int | None = None, boot: int = BOOT_ID
    ) -> int:
        """Ask a question, with the next number where none is given; return its number."""
        kind = codec.kind_of(message)
        if number is None:
            self.number = number = self.number + 1
        self.send(meaning, kind, number, codec.payload(message, boot))
        return number

    def send(self, meaning: str, kind: int, number: int, payload: bytes) -> None:
        """Send a frame, whatever it holds."""
        self.now_us += self.step_us
        question = encode(Frame(kind=kind, sequence=number, payload=payload))
        answer = self.device.receive(self.now_us, question)
        said = [codec.HEAD.read(frame.payload) for frame in Decoder().feed(answer)]
        refused = said[0].refusal if said else None
        known = {int(one): one.name for one in Kind}
        self.steps.append(
            {
                "meaning": meaning,
                "at_us": self.now_us,
                "type": known.get(kind, "unknown"),
                "refusal": refused.name if refused else None,
                "state": said[0].state.value if said else None,
                "question": question.hex(" "),
                "answer": answer.hex(" "),
            }
        )

    def sense(self, meaning: str, sensed: Health) -> None:
        """Have the device sense something of its amplifier."""
        self.now_us += self.step_us
        self.device.core.sense(self.now_us, sensed)
        told = {"known": sensed.known, "set": sensed.set_bits}
        self.steps.append({"meaning": meaning, "at_us": self.now_us, "sense": told})

    def hang_up(self, meaning: str) -> None:
        """Lose the line."""
        self.now_us += self.step_us
        self.device.hang_up(self.now_us)
        self.steps.append({"meaning": meaning, "at_us": self.now_us, "hang_up": True})

    def read(self, meaning: str, reading: Measurement | None) -> None:
        """Have the input measure something else from now on."""
        self.reader.reading = reading
        told = None
        if reading is not None:
            told = {name: value for name, value in asdict(reading).items() if name != "token"}
            told |= {"tap": TAPS.index(reading.tap), "unit": UNITS.index(reading.unit)}
        self.steps.append({"meaning": meaning, "at_us": self.now_us, "reading": told})

    def upload(
        self, what: str, slot: int, codes: CodeArray, *, without: int | None = None, begun: str = ""
    ) -> None:
        """Upload a waveform to the left and silence to the right; its DATA from the last on."""
        waveform = LoadSlot(slot=slot, left=codes, right=np.zeros_like(codes))
        octets = octets_of(waveform, SIXTEEN)
        begin = Begin(slot=slot, samples=codes.size)
        number = self.ask(f"BEGIN: {begun or what}", begin)
        pieces = [piece for piece in data_of(octets, number) if piece.offset != without]
        for count, piece in enumerate(reversed(pieces)):
            self.ask(f"DATA at byte {piece.offset}", piece, number=9 - count)
        self.ask(f"COMMIT: {what}", Commit(slot=slot, crc=zlib.crc32(octets)))


def codes_of(*codes: int) -> CodeArray:
    """Return a waveform of a few codes."""
    return np.array(codes, dtype=np.int32)


def greet(script: Script) -> None:
    """Begin: HELLO, the order of questions, limits and health."""
    hello = Hello(nonce=0x0102030405060708)
    number = script.ask("HELLO with the nonce 0x0102030405060708", hello)
    script.ask("the same HELLO again: its answer again, nothing changed", hello, number)
    script.ask("PING", Ping())
    script.ask("the last question again: its answer again, byte for byte", Ping(), script.number)
    script.ask("a question for another power cycle", Ping(), script.number + 1, BOOT_ID + 1)
    script.ask("a number that is not newer", Ping(), number)
    script.ask("LIMITS", AskLimits())
    script.ask("HEALTH: of its switch and of over-current it knows nothing yet", AskHealth())
    script.sense("the safety switch is closed", Health(switch_closed=True, over_current=False))
    script.ask("HEALTH", AskHealth())


def upload(script: Script) -> None:
    """Upload: what is taken, what is refused, and what obeys no order."""
    cycle, pair = to_codes(sine(25), SIXTEEN), codes_of(0, 32767, -32767, 0)
    script.ask("ARM before anything is loaded", Arm(token=1, slot=0, time_to_live_us=LIFE_US))
    number = script.ask("BEGIN the upload of 25 samples to slot 0", Begin(slot=0, samples=25))
    waveform = LoadSlot(slot=0, left=cycle, right=np.zeros_like(cycle))
    octets = octets_of(waveform, SIXTEEN)
    pieces = list(data_of(octets, number))
    script.ask("DATA at byte 64, first: any order will do", pieces[2], number=7)
    script.ask("DATA at byte 0, with an older number", pieces[0], number=6)
    script.ask("DATA at byte 0 again: done again", pieces[0], number=6)
    script.ask("the BEGIN again: its answer again, the upload goes on", Begin(slot=0, samples=25),
               number)  # fmt: skip
    foreign = Data(upload=number + 1, offset=32, octets=bytes(32))
    script.ask("DATA of another upload: nothing is changed", foreign, number=8)
    script.ask("DATA at an offset that is no multiple of 32",
               Data(upload=number, offset=33, octets=bytes(32)), number=8)  # fmt: skip
    script.ask("DATA that is not full", Data(upload=number, offset=32, octets=b"\1"), number=8)
    script.ask("DATA beyond the end", Data(upload=number, offset=128, octets=b"\1"), number=8)
    script.ask("DATA for another power cycle", pieces[1], 8, BOOT_ID + 1)
    script.send("DATA without octets", Kind.DATA, 8, codec.payload(pieces[1], BOOT_ID)[:14])
    script.ask("DATA at byte 32", pieces[1], number=9)
    script.ask("DATA at byte 96, the last", pieces[3], number=10)
    commit = Commit(slot=0, crc=zlib.crc32(octets))
    script.ask("COMMIT for a slot that is none: the upload goes on", Commit(slot=4, crc=commit.crc))
    script.ask("COMMIT: one cycle of a sine to the left, nothing to the right", commit)
    script.ask("COMMIT without an upload", commit)
    script.ask("DATA that comes late: the upload is over", pieces[0], number=11)
    script.upload("one of its DATA never came", 1, cycle, without=32)
    script.upload("a waveform with a DC part", 1, codes_of(0, 100, 100, 0))
    script.upload("a waveform that does not begin at 0", 1, codes_of(5, -5))
    script.upload("a code below minus full scale", 1, codes_of(0, -32768, 32767, 0))
    begin = script.ask("BEGIN the upload of 4 samples to slot 1", Begin(slot=1, samples=4))
    octets = octets_of(LoadSlot(slot=1, left=pair, right=pair), SIXTEEN)
    for piece in data_of(octets, begin):
        script.ask(f"DATA at byte {piece.offset}", piece, number=12)
    script.ask("COMMIT with another CRC", Commit(slot=1, crc=zlib.crc32(octets) ^ 1))
    script.ask("BEGIN of no samples", Begin(slot=0, samples=0))
    script.ask("BEGIN for a slot that is none", Begin(slot=4, samples=4))
    script.ask("BEGIN of more samples than a waveform may have", Begin(slot=0, samples=65))


def play(script: Script) -> None:
    """Arm and fire: each reason why not, and the record of what was done."""
    ask, life = script.ask, LIFE_US
    script.read("from now on its input measures bursts", READING)
    ask("ARM before the output is on", Arm(token=1, slot=0, time_to_live_us=life))
    ask("LEVEL of 100 Vpp on both channels", Levels(left_mvpp=100_000, right_mvpp=100_000))
    ask("LEVEL above the ceiling for what is loaded", Levels(left_mvpp=200_001, right_mvpp=0))
    ask("OUTPUT on", Enable())
    ask("BEAT: no answer", Beat(), number=0)
    ask("FIRE of a token that was never armed", Fire(token=1))
    ask("QUERY of it", Query(token=1))
    ask("MEASURED of it: not measured", AskMeasured(token=1))
    payload = bytearray(codec.payload(Arm(token=1, slot=0, time_to_live_us=life), BOOT_ID))
    payload[8:16] = bytes(8)
    script.number += 1
    script.send("ARM of token 0", Kind.ARM, script.number, bytes(payload))
    ask("ARM of a slot that is none", Arm(token=1, slot=4, time_to_live_us=life))
    ask("ARM of an empty slot", Arm(token=1, slot=3, time_to_live_us=life))
    ask("ARM with no time to live", Arm(token=1, slot=0, time_to_live_us=0))
    ask(
        "ARM for more than the longest time to live",
        Arm(token=1, slot=0, time_to_live_us=10**7 + 1),
    )
    script.sense("the safety switch opens", Health(switch_closed=False, over_current=False))
    ask("ARM while the switch is open", Arm(token=1, slot=0, time_to_live_us=life))
    script.sense("the switch is closed again", Health(switch_closed=True, over_current=False))
    ask("ARM of token 1 on slot 0 for 5 s", Arm(token=1, slot=0, time_to_live_us=life))
    ask("ARM while another token is armed", Arm(token=2, slot=0, time_to_live_us=life))
    ask("QUERY of the armed token", Query(token=1))
    ask("FIRE of another token", Fire(token=2))
    script.sense("the switch opens", Health(switch_closed=False, over_current=False))
    ask("FIRE while the switch is open: the token stays armed", Fire(token=1))
    script.sense("the switch is closed again", Health(switch_closed=True, over_current=False))
    ask("FIRE of token 1", Fire(token=1))
    script.step_us = 100
    ask("the same FIRE as a new question while the burst plays: the same record", Fire(token=1))
    ask("ARM while a burst plays", Arm(token=2, slot=0, time_to_live_us=life))
    ask("MEASURED while it plays", AskMeasured(token=1))
    script.step_us = 300
    ask("MEASURED of token 1", AskMeasured(token=1))
    script.step_us = 100
    ask("QUERY of the fired token", Query(token=1))
    ask("DISARM of the fired token: its record stays", Disarm(token=1))
    ask("ARM of the fired token", Arm(token=1, slot=0, time_to_live_us=life))
    ask("ARM of token 2", Arm(token=2, slot=0, time_to_live_us=life))
    ask("FIRE too soon after the burst before", Fire(token=2))
    ask("DISARM of token 2", Disarm(token=2))
    ask("FIRE of the disarmed token", Fire(token=2))
    ask("ARM of token 3 for 50 us", Arm(token=3, slot=0, time_to_live_us=50))
    ask("FIRE after the time to live", Fire(token=3))
    ask("QUERY of the expired token", Query(token=3))


def fill(script: Script) -> None:
    """Fill the memory, play the longest waveform, and rest after it."""
    ask, life = script.ask, LIFE_US
    script.upload("the longest waveform", 1, to_codes(sine(64), SIXTEEN))
    ask("BEGIN of 8 samples where 7 are left", Begin(slot=2, samples=8))
    ask("BEGIN of 7 samples: there is room", Begin(slot=2, samples=7))
    ask("BEGIN of 64 samples to slot 1: what is replaced is free", Begin(slot=1, samples=64))
    ask("BEAT: no answer", Beat(), number=0)
    ask("ARM of token 5 on slot 1", Arm(token=5, slot=1, time_to_live_us=life))
    ask("FIRE of token 5, which plays for 1.334 ms", Fire(token=5))
    script.step_us = 2400
    ask("ARM of token 6", Arm(token=6, slot=1, time_to_live_us=life))
    script.step_us = 100
    ask("FIRE after the least interval, but too soon for the duty", Fire(token=6))
    ask("MEASURED of the last burst", AskMeasured(token=5))
    ask("MEASURED of the one before: forgotten", AskMeasured(token=1))
    script.step_us = 1000
    ask("FIRE when it has rested", Fire(token=6))
    script.step_us = 100


def stop(script: Script) -> None:
    """Stop: by over-current, by STOP, by the loss of the line; and what comes late."""
    ask, life = script.ask, LIFE_US
    script.sense("over-current cuts the burst", Health(switch_closed=True, over_current=True))
    ask("HEALTH: over-current, kept; the amplifier is off", AskHealth())
    ask("MEASURED of the burst that was cut: not measured", AskMeasured(token=6))
    ask("QUERY of it: it began", Query(token=6))
    script.sense("it is over", Health(switch_closed=True, over_current=False))
    ask("HEALTH: it is kept until OUTPUT", AskHealth())
    ask("ARM after it", Arm(token=7, slot=0, time_to_live_us=life))
    ask("OUTPUT on", Enable())
    ask("HEALTH: forgotten", AskHealth())
    ask("ARM of token 7", Arm(token=7, slot=0, time_to_live_us=life))
    script.send("a type that is none", 0x7F, script.number + 1, BOOT_ID.to_bytes(8, "little"))
    script.number += 2
    short = BOOT_ID.to_bytes(8, "little") + b"\1\2\3"
    script.send("ARM with a payload that is too short", Kind.ARM, script.number, short)
    script.number += 1
    script.send("PING with a payload that is too short", Kind.PING, script.number, b"\1\2\3")
    ask("STOP: it has a number like a question", Stop())
    ask("ARM after a stop", Arm(token=8, slot=0, time_to_live_us=life))
    script.send("STOP for another power cycle, with an old number: obeyed", Kind.STOP, 5, b"")
    ask("OUTPUT with an older number than a STOP", Enable(), number=script.number - 1)
    ask("OUTPUT on", Enable())
    ask("BEAT for another power cycle: not heard", Beat(), 0, BOOT_ID + 1)
    script.step_us = 499_900
    ask("HEALTH half a second after OUTPUT without a BEAT: off", AskHealth())
    script.step_us = 100
    ask("OUTPUT on", Enable())
    ask("BEGIN an upload", Begin(slot=2, samples=4))
    script.hang_up("the line is lost: the upload is forgotten, the outputs are at zero")
    ask("PING on the next", Ping())
    ask("COMMIT of what was forgotten", Commit(slot=2, crc=0))
    ask("HELLO of another connection", Hello(nonce=0x1112131415161718))
    ask("the HELLO of the connection before", Hello(nonce=0x0102030405060708))
    ask("OUTPUT on", Enable())


def no_frames() -> list[dict[str, str]]:
    """Return what gets no answer."""
    ping = codec.payload(Ping(), BOOT_ID)
    whole = encode(Frame(kind=Kind.PING, sequence=0x0D01, payload=ping))
    damaged = whole[:-2] + bytes([whole[-2] ^ 1]) + whole[-1:]
    answer = encode(Frame(kind=Kind.PING | codec.ANSWER, sequence=0x0D01, payload=ping))
    return [
        {"meaning": "a PING with one bit of its CRC wrong", "bytes": damaged.hex(" ")},
        {"meaning": "a PING of version 1", "bytes": foreign(1, ping).hex(" ")},
        {"meaning": "a PING cut short", "bytes": (whole[:-5] + b"\0").hex(" ")},
        {"meaning": "nothing but delimiters", "bytes": "00 00 00"},
        {"meaning": "an answer: devices answer no answers", "bytes": answer.hex(" ")},
        {"meaning": "a payload of 97 bytes", "bytes": foreign(2, bytes(97)).hex(" ")},
    ]


def foreign(version: int, payload: bytes) -> bytes:
    """Return a frame that ours would not make: of another version, or too long."""
    body = bytes([version, Kind.PING, 1, 0x0D]) + payload
    coded: bytes = cobs.encode(body + zlib.crc32(body).to_bytes(4, "little"))
    return b"\0" + coded + b"\0"


def made() -> dict[str, Any]:
    """Return the file's content."""
    script = Script()
    for part in (greet, upload, play, fill, stop):
        part(script)
    return {
        "about": (
            "What a host asks and what happens, in order from power on, and what a device answers "
            "byte for byte (hex). at_us is the device's clock; sense, what its amplifier reports; "
            "reading, what its input measures of each burst that ends from then on; hang_up, the "
            "loss of the line. no_frames: each to a device that was just switched on. Made by "
            "python -m tests.test_device.golden; docs/protocol.md states the format."
        ),
        "device": FACTS | asdict(TOLD) | {"entropy": tuple(Entropy).index(TOLD.entropy)},
        "refusals_of_hosts_only": list(ON_THE_HOST),
        "steps": script.steps,
        "no_frames": no_frames(),
    }


def text() -> str:
    """Return the file's text: a line for each step."""
    content = made()
    lists = {name: content.pop(name) for name in ("steps", "no_frames")}
    parts = [f" {json.dumps(name)}: {json.dumps(value)}" for name, value in content.items()]
    for name, entries in lists.items():
        rows = ",\n".join(f"  {json.dumps(entry)}" for entry in entries)
        parts.append(f" {json.dumps(name)}: [\n{rows}\n ]")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    FILE.write_text(text(), encoding="utf-8")
    assert set(ON_THE_HOST) <= {refusal.name for refusal in Refusal}
