"""Emulated generators, and what a Keysight is sent, byte for byte.

The transcripts are for a gain of 27.5 and a ceiling of 200 Vpp.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from device import Emission, Limits, Outcome, VirtualClock
from device.emulate.generator import EmulatedGenerator
from tests.test_device.bursts import play, ready
from tests.test_device.in_process import LIMITS, LocalChannel, generator_on

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.core.converter import ConverterDevice

GAIN = 27.5

CODES = [0, 10, 2570, 32767, -2570, -32767, -10, 0]
"""Their bytes hold 0x0A alone, doubled, and at either place."""

WAVE = np.clip((np.array(CODES) + 0.25 * np.sign(CODES)) / 32767, -1.0, 1.0)
SILENCE = np.zeros_like(WAVE)

BLOCK = b"#216" + np.array(CODES, dtype="<i2").tobytes()
ZEROS = b"#216" + bytes(16)

CLEARED = """
SOUR{0}:VOLT:LIM:STAT OFF;OUTP{0}:LOAD INF;SOUR{0}:VOLT:UNIT VPP;SOUR{0}:DATA:VOL:CLE;
"""
SET_UP = """
SOUR{0}:FUNC:ARB T{0};SOUR{0}:FUNC:ARB:SRAT 48000;SOUR{0}:FUNC:ARB:FILT OFF;SOUR{0}:FUNC ARB;
SOUR{0}:VOLT:OFFS 0;SOUR{0}:VOLT 7.2727272;SOUR{0}:VOLT:RANG:AUTO OFF;
SOUR{0}:VOLT:LIM:HIGH 3.6363637;SOUR{0}:VOLT:LIM:LOW -3.6363637;SOUR{0}:VOLT:LIM:STAT ON;
SOUR{0}:BURS:MODE TRIG;SOUR{0}:BURS:NCYC 1;SOUR{0}:BURS:PHAS 0;
TRIG{0}:SOUR BUS;SOUR{0}:BURS:STAT ON;SYST:ERR?;
"""
READ_BACK = """
OUTP{0}:LOAD?;SOUR{0}:VOLT:LIM:HIGH?;SOUR{0}:VOLT:LIM:LOW?;SOUR{0}:VOLT:LIM:STAT?;
SOUR{0}:VOLT:OFFS?;SOUR{0}:FUNC?;SOUR{0}:FUNC:ARB:FILT?;SOUR{0}:FUNC:ARB:SRAT?;
SOUR{0}:BURS:MODE?;SOUR{0}:BURS:NCYC?;SOUR{0}:BURS:STAT?;TRIG{0}:SOUR?;
"""
SELECT = "SOUR{0}:FUNC:ARB {1};SOUR{0}:FUNC:ARB:SRAT 48000;SOUR{0}:VOLT 2.1818181;"
SELECTED = "OUTP{0}:LOAD?;SOUR{0}:FUNC:ARB?;SOUR{0}:FUNC:ARB:SRAT?;SOUR{0}:VOLT?;"
"""What a channel is told, and asked; a semicolon here ends a line there."""


def lines(*texts: str) -> bytes:
    return "".join(f"{text}\n" for text in texts).encode()


def filled(commands: str, *values: object) -> bytes:
    return commands.replace("\n", "").replace(";", "\n").format(*values).encode()


def upload(channel: int, name: str, block: bytes) -> bytes:
    return f"SOUR{channel}:DATA:ARB:DAC {name},".encode() + block + b"\n"


def opening() -> bytes:
    """Return what is sent once, when the device is opened."""
    return b"".join(
        (
            filled(";*IDN?;*RST;*CLS;OUTP1 OFF;OUTP2 OFF;FORM:BORD SWAP;SYST:ERR?;"),
            *(filled(CLEARED, 1), upload(1, "T1", ZEROS), filled(SET_UP, 1)),
            *(filled(CLEARED, 2), upload(2, "T2", ZEROS), filled(SET_UP, 2)),
            *(filled(READ_BACK, 1), filled(READ_BACK, 2)),
        )
    )


def loading(channel: int, name: str) -> bytes:
    """Return what stores the wave for a channel, where silence is stored already."""
    return upload(channel, name, BLOCK) + lines("SYST:ERR?")


def switching_on() -> bytes:
    return filled(READ_BACK, 1) + filled(READ_BACK, 2) + filled("OUTP1 ON;OUTP2 ON;SYST:ERR?;")


def trial(left: str, right: str) -> bytes:
    """Return what plays two stored waveforms at 60 Vpp, once."""
    said = filled(SELECT, 1, left) + filled(SELECT, 2, right)
    asked = filled(SELECTED, 1) + filled(SELECTED, 2)
    return said + asked + filled("SYST:ERR?;*TRG;*OPC?;SYST:ERR?;")


class Recorder(LocalChannel):
    """A channel that notes every line and can lose answers."""

    def __init__(self, generator: EmulatedGenerator, clock: VirtualClock) -> None:
        super().__init__(generator, clock)
        self.written = b""
        self.before: Callable[[bytes], None] = lambda data: None
        self.change: Callable[[bytes], bytes] = lambda told: told

    def write(self, data: bytes) -> None:
        self.before(data)
        self.written += data
        super().write(data)

    def read(self, timeout_s: float) -> bytes:
        return self.change(super().read(timeout_s))

    def taken(self) -> bytes:
        written, self.written = self.written, b""
        return written


@dataclass(slots=True)
class GeneratorBench:
    """A generator device with an emulated generator behind it."""

    limits: Limits = LIMITS
    gain: float = GAIN
    clock: VirtualClock = field(default_factory=VirtualClock)
    out: list[Emission] = field(default_factory=list)
    generator: EmulatedGenerator = field(init=False)
    channel: Recorder = field(init=False)
    device: ConverterDevice = field(init=False)

    def __post_init__(self) -> None:
        self.generator = EmulatedGenerator(self.out.append)
        self.channel = Recorder(self.generator, self.clock)
        self.device = generator_on(self.channel, self.clock, gain=self.gain, limits=self.limits)

    def live(self) -> GeneratorBench:
        ready(self.device, 60.0, burst=WAVE)
        self.channel.taken()
        return self

    def answer_otherwise(self, question: bytes, answer: bytes) -> None:
        """Have the answer to one question replaced."""

        def change(told: bytes) -> bytes:
            is_it = told and self.channel.written.endswith(question + b"\n")
            return answer if is_it else told

        self.channel.change = change

    def play(self, token: int, slot: int = 0) -> Outcome:
        self.clock.wait(0.1)
        return play(self.device, token, slot).outcome
