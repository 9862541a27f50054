"""How arbitrary-waveform generators are spoken to: a table of SCPI dialects, data only.

A further make is a further entry of `DIALECTS`. None of them was tried on hardware: they are
written from the makers' programming guides.

Commands are templates. Known names: ``{channel}`` from 1, ``{name}`` of a waveform, ``{rate}`` in
samples per second, ``{volts}`` peak-to-peak, ``{high}`` and ``{low}`` the voltage limits. Waveforms
are kept by name, and their codes are of 16 bit, the low byte first.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

EMULATED: Final = "EMULATED"
"""The serial number by which an emulator says that it is one."""

INFINITE_OHM: Final = "9.9E+37"
"""What SCPI answers for infinity."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadBack:
    """A question, and what its answer has to be.

    Both are templates; numbers are compared as numbers, anything else as words.
    """

    question: str
    answer: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """What one family of generators understands; commands are formatted with channel, name, rate.

    >>> KEYSIGHT.select[0].format(channel=2, name="T1", rate=48000, volts="1.5")
    'SOUR2:FUNC:ARB T1'
    """

    name: str
    identity: str  # regular expression that the answer to *IDN? begins with
    channels: int  # number of outputs of these models
    shortest_waveform: int  # in samples, as the longest
    longest_waveform: int
    min_vpp: float  # amplitudes it can make into an open circuit
    max_vpp: float
    volts_digits: int  # after the point, with which volts are written
    reset: tuple[str, ...]  # into a known state: outputs off, every error forgotten
    channel_load: tuple[str, ...]  # first commands for each channel: what its voltages mean
    store: str  # precedes the binary block of an upload
    channel_setup: tuple[str, ...]  # for each channel, once a silent waveform is stored
    channel_readings: tuple[ReadBack, ...]  # what each channel is then asked
    select: tuple[str, ...]  # before each burst, for each channel
    # what each channel is then asked, with its amplitude in any case
    select_readings: tuple[ReadBack, ...]
    amplitude: str  # question for the amplitude in volts
    output_on: str  # for each channel, as `output_off`
    output_off: str
    abort: tuple[str, ...]  # ends a burst that is under way
    trigger: tuple[str, ...]  # plays every channel once
    complete: str  # a question that is answered once everything before it was done
    error: str  # question for the oldest error that was not reported yet


KEYSIGHT: Final = Dialect(
    name="keysight",
    identity=r"(Agilent|Keysight) Technologies,(33512B|33522[AB]|33612A|33622A),",
    channels=2,
    shortest_waveform=8,
    longest_waveform=65_536,
    min_vpp=0.002,
    max_vpp=20.0,
    volts_digits=7,
    reset=("*RST", "*CLS", "OUTP1 OFF", "OUTP2 OFF", "FORM:BORD SWAP"),
    channel_load=(
        "SOUR{channel}:VOLT:LIM:STAT OFF",
        "OUTP{channel}:LOAD INF",
        "SOUR{channel}:VOLT:UNIT VPP",
        "SOUR{channel}:DATA:VOL:CLE",
    ),
    store="SOUR{channel}:DATA:ARB:DAC {name},",
    channel_setup=(
        "SOUR{channel}:FUNC:ARB {name}",
        "SOUR{channel}:FUNC:ARB:SRAT {rate}",
        "SOUR{channel}:FUNC:ARB:FILT OFF",
        "SOUR{channel}:FUNC ARB",
        "SOUR{channel}:VOLT:OFFS 0",
        "SOUR{channel}:VOLT {volts}",
        "SOUR{channel}:VOLT:RANG:AUTO OFF",
        "SOUR{channel}:VOLT:LIM:HIGH {high}",
        "SOUR{channel}:VOLT:LIM:LOW {low}",
        "SOUR{channel}:VOLT:LIM:STAT ON",
        "SOUR{channel}:BURS:MODE TRIG",
        "SOUR{channel}:BURS:NCYC 1",
        "SOUR{channel}:BURS:PHAS 0",
        "TRIG{channel}:SOUR BUS",
        "SOUR{channel}:BURS:STAT ON",
    ),
    channel_readings=(
        ReadBack(question="OUTP{channel}:LOAD?", answer=INFINITE_OHM),
        ReadBack(question="SOUR{channel}:VOLT:LIM:HIGH?", answer="{high}"),
        ReadBack(question="SOUR{channel}:VOLT:LIM:LOW?", answer="{low}"),
        ReadBack(question="SOUR{channel}:VOLT:LIM:STAT?", answer="1"),
        ReadBack(question="SOUR{channel}:VOLT:OFFS?", answer="0"),
        ReadBack(question="SOUR{channel}:FUNC?", answer="ARB"),
        ReadBack(question="SOUR{channel}:FUNC:ARB:FILT?", answer="OFF"),
        ReadBack(question="SOUR{channel}:FUNC:ARB:SRAT?", answer="{rate}"),
        ReadBack(question="SOUR{channel}:BURS:MODE?", answer="TRIG"),
        ReadBack(question="SOUR{channel}:BURS:NCYC?", answer="1"),
        ReadBack(question="SOUR{channel}:BURS:STAT?", answer="1"),
        ReadBack(question="TRIG{channel}:SOUR?", answer="BUS"),
    ),
    select=(
        "SOUR{channel}:FUNC:ARB {name}",
        "SOUR{channel}:FUNC:ARB:SRAT {rate}",
        "SOUR{channel}:VOLT {volts}",
    ),
    select_readings=(
        ReadBack(question="OUTP{channel}:LOAD?", answer=INFINITE_OHM),
        ReadBack(question="SOUR{channel}:FUNC:ARB?", answer="{name}"),
        ReadBack(question="SOUR{channel}:FUNC:ARB:SRAT?", answer="{rate}"),
    ),
    amplitude="SOUR{channel}:VOLT?",
    output_on="OUTP{channel} ON",
    output_off="OUTP{channel} OFF",
    abort=("ABOR",),
    trigger=("*TRG",),
    complete="*OPC?",
    error="SYST:ERR?",
)
"""Keysight 33500 and 33600 Series, two channels with arbitrary waveforms (33512B, 33522A/B,
33612A, 33622A). The load is set while no limit is on: a limit would forbid it. The attenuator's
range is held, so that no relay switches with the level."""

DIALECTS: Final = (KEYSIGHT,)
"""Every dialect that is known."""


def dialect_of(identity: str) -> Dialect | None:
    """Return the dialect of the generator that gave this answer to ``*IDN?``, or None.

    >>> dialect_of("Agilent Technologies,33522B,MY57800256,5.00-1.19-2.00-58-00").name
    'keysight'
    >>> dialect_of("Agilent Technologies,33521B,MY50000000,1.0") is None      # one channel
    True
    """
    matching = (
        dialect for dialect in DIALECTS if re.match(dialect.identity, identity, re.IGNORECASE)
    )
    return next(matching, None)
