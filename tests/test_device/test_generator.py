"""Generators: bytes as they go over the line, and what happens when the line or they fail."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from device import Limits, LinkError, Outcome, Refusal, RefusedError, SettingError
from tests.test_device.bursts import play, ready, refusal
from tests.test_device.generators import (
    BLOCK,
    CODES,
    GAIN,
    SILENCE,
    WAVE,
    GeneratorBench,
    loading,
    opening,
    trial,
)

IDENTITY = "Keysight Technologies,33512B,"
NO_ERROR = b'+0,"No error"\n'
ANSWERS_WITHIN_S = 5.0


@pytest.fixture
def bench() -> GeneratorBench:
    return GeneratorBench()


@pytest.fixture
def live() -> GeneratorBench:
    return GeneratorBench().live()


def test_the_set_up_and_an_upload_byte_for_byte_with_line_feeds_inside(
    bench: GeneratorBench,
) -> None:
    bench.device.open()
    assert BLOCK.count(b"\n") == 3
    assert bench.channel.taken() == opening()
    bench.device.load(0, np.stack([WAVE, SILENCE]))
    assert bench.channel.taken() == loading(1, "T3")
    bench.device.load(2, np.stack([WAVE, WAVE]))
    assert bench.channel.taken() == loading(2, "T4")


def test_a_trial_byte_for_byte_and_for_every_side_the_same_commands(live: GeneratorBench) -> None:
    for token, (slot, left, right) in enumerate([(0, "T3", "T2"), (1, "T1", "T4")]):
        live.play(1 + token, slot)
        assert live.channel.taken() == trial(left, right)
    burst, _ = live.out
    assert np.abs(burst.volts[0] * GAIN - np.array(CODES) / 32767 * 30.0).max() < 1e-5
    assert not burst.volts[1].any()


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (b"OUTP1:LOAD?", b"+5.00000000000000E+01\n"),
        (b"OUTP2:LOAD?", b"+1.00000000000000E+04\n"),
        (b"SOUR1:VOLT:LIM:HIGH?", b"+1.00000000000000E+01\n"),
        (b"SOUR2:VOLT:LIM:LOW?", b"-1.00000000000000E+01\n"),
        (b"SOUR2:VOLT:LIM:STAT?", b"0\n"),
        (b"SOUR1:FUNC:ARB:SRAT?", b"+4.00000000000000E+04\n"),
        (b"SOUR1:FUNC:ARB:FILT?", b"NORM\n"),
        (b"TRIG2:SOUR?", b"IMM\n"),
        (b"SYST:ERR?", b'-113,"Undefined header"\n'),
    ],
)
def test_a_setting_that_was_not_taken_is_refused_and_nothing_is_switched_on(
    bench: GeneratorBench, question: bytes, answer: bytes
) -> None:
    bench.answer_otherwise(question, answer)
    with pytest.raises(SettingError):
        bench.device.open()
    assert bench.generator.outputs_on == (False, False)
    assert refusal(bench.device.enable) is Refusal.NOT_OPEN


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        (b"OUTP1:LOAD?", b"+5.00000000000000E+01\n"),
        (b"SOUR1:FUNC:ARB?", b'"T1"\n'),
        (b"SOUR2:VOLT?", b"+2.50000000000000E+00\n"),
        (b"SYST:ERR?", b'-222,"Data out of range"\n'),
    ],
)
def test_a_trial_that_was_not_set_up_is_not_triggered(
    live: GeneratorBench, question: bytes, answer: bytes
) -> None:
    live.answer_otherwise(question, answer)
    with pytest.raises(SettingError):
        live.play(1)
    assert b"*TRG" not in live.channel.written
    assert live.out == []
    live.channel.change = lambda told: told
    assert live.device.query(1).outcome is Outcome.NOT_FIRED
    assert live.play(2) is Outcome.FIRED


def test_what_answers_otherwise_is_no_generator(bench: GeneratorBench) -> None:
    bench.answer_otherwise(b"*IDN?", b"Agilent Technologies,33521B,MY50000000,1.0\n")
    with pytest.raises(LinkError, match="33521B"):
        bench.device.open()


def test_a_level_the_generator_cannot_make_is_refused_and_zero_is_silence(
    live: GeneratorBench,
) -> None:
    live.device.set_levels([0.01, 0.01])
    assert refusal(lambda: live.play(1)) is Refusal.BAD_LEVEL
    live.device.set_levels([0.0, 0.0])
    assert live.play(2) is Outcome.FIRED
    assert not live.out[0].volts[0].any()


def test_a_lost_confirmation_is_indeterminate_and_no_second_trigger_goes_out(
    live: GeneratorBench,
) -> None:
    def change(told: bytes) -> bytes:
        lost = b"*TRG" in live.channel.written and b"*IDN?" not in live.channel.written
        return b"" if lost else told

    live.channel.change = change
    began_s = live.clock.now_s()
    told = play(live.device, 1)
    assert told.outcome is Outcome.INDETERMINATE
    assert live.clock.now_s() - began_s >= ANSWERS_WITHIN_S
    assert live.device.fire(1) == told == live.device.query(1)
    assert live.channel.written.count(b"*TRG") == 1
    assert [burst.token for burst in live.out] == [1]
    assert live.play(2) is Outcome.FIRED
    assert len(live.out) == 2


def test_a_confirmation_that_comes_too_late_is_taken_for_no_other_answer(
    live: GeneratorBench,
) -> None:
    held = [b""]

    def change(told: bytes) -> bytes:
        if b"*IDN?" in live.channel.written:
            early, held[0] = held[0], b""
            return early + told
        held[0] += told
        return b""

    live.device.arm(1, 0, time_to_live_s=1.0)
    live.channel.taken()
    live.channel.change = change
    assert live.device.fire(1).outcome is Outcome.INDETERMINATE
    assert live.play(2, slot=1) is Outcome.FIRED
    assert [burst.levels_vpp[1] > 0 for burst in live.out] == [False, True]


def test_a_line_that_breaks_with_the_trigger_leaves_it_open(live: GeneratorBench) -> None:
    def before(data: bytes) -> None:
        if b"*TRG" in data:
            raise LinkError("unplugged")

    live.channel.before = before
    assert live.play(1) is Outcome.INDETERMINATE
    assert live.device.query(1).outcome is Outcome.INDETERMINATE


@settings(deadline=None, max_examples=25)
@given(
    peak=st.floats(0.001, 1.0),
    level_vpp=st.floats(0.0, 1e3),
    gain=st.floats(0.5, 100.0),
    ceiling_vpp=st.floats(1.0, 400.0),
)
def test_nothing_above_the_ceiling_comes_out(
    peak: float, level_vpp: float, gain: float, ceiling_vpp: float
) -> None:
    bench = GeneratorBench(limits=Limits(ceiling_vpp=ceiling_vpp), gain=gain)
    wave = np.array([0.0, 1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.0]) * peak
    try:
        ready(bench.device, burst=wave)
        bench.device.load(2, np.stack([wave, -wave]))
        bench.device.set_levels([level_vpp, level_vpp])
        bench.play(1, slot=2)
    except (RefusedError, SettingError):
        assert bench.out == []
        return
    (burst,) = bench.out
    for volts in burst.volts:
        assert 2 * np.abs(volts).max() * gain <= ceiling_vpp * (1 + 1e-12)
        assert 2 * np.abs(volts).max() * gain <= level_vpp * peak * (1 + 1e-12)


def test_a_stop_from_another_thread_cuts_the_burst_and_its_trial_is_indeterminate(
    live: GeneratorBench,
) -> None:
    long = np.append(np.tile(WAVE[:-1], 4000), 0.0)
    live.device.load(2, np.stack([long, 0 * long]))
    stopper = threading.Thread(target=live.device.stop)

    def change(told: bytes) -> bytes:
        if live.clock.now_s() > 0.4 and stopper.ident is None:
            stopper.start()
            stopper.join()
        return told

    live.channel.change = change
    assert live.play(1, slot=2) is Outcome.INDETERMINATE
    assert live.out[0].cut_us is not None
    assert live.generator.outputs_on == (False, False)
    assert refusal(lambda: play(live.device, 2)) is Refusal.SAFE_STATE


@pytest.mark.parametrize(
    ("command", "error"),
    [
        (b"VOLTS 2", b"-113"),
        (b"SOUR1:VOLT 50", b"-222"),
        (b"SOUR1:VOLT two", b"-224"),
        (b"SOUR1:FUNC:ARB NONE", b"+785"),
        (b"SOUR1:DATA:ARB:DAC a,#13abc", b"-161"),
        (b"*TRG", b"-211"),
        (b"SOUR1:VOLT:LIM:STAT ON;:OUTP1:LOAD INF", b"-221"),
    ],
)
def test_the_emulator_refuses_what_a_generator_refuses(command: bytes, error: bytes) -> None:
    generator = GeneratorBench().generator
    answer = generator.receive(0, command + b"\nSYST:ERR?\nSYST:ERR?\n").splitlines()
    assert answer[0].startswith(error)
    assert answer[1] + b"\n" == NO_ERROR
