"""Arbitrary-waveform generators over SCPI. Not tried on hardware.

A generator has no burst counter: its trigger is sent once and never again, and a trigger whose
confirmation was lost is INDETERMINATE. Every waveform spans the whole range of the converter and
the amplitude carries the level, so that it means the same whether the generator takes its amplitude
for that of the waveform or of the range. A silent channel plays a waveform of zeros: generators
have a least amplitude, and for every site the same commands are sent.
"""

from __future__ import annotations

import contextlib
from contextlib import closing
from typing import TYPE_CHECKING, Final

import numpy as np

from device.checks import require_positive
from device.clock import Clock, MonotonicClock
from device.core.converter import Converter, ConverterDevice, Played
from device.driver import Outcome
from device.errors import DeviceError, LinkError, Refusal, SettingError, rejection
from device.scpi.dialects import EMULATED, KEYSIGHT, ReadBack, dialect_of
from device.scpi.line import BITS, ScpiLine, Wave, decimals, encode, matches
from device.scpi.visa import open_instrument
from device.wire.channels import USUAL, Channel, LineSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from device.driver import FloatArray
    from device.limits import CodeArray, Limits


CANNOT: Final = (
    "bring its outputs to zero when this program or the line to it dies",
    "count its bursts: a trigger whose confirmation is lost is recorded as indeterminate",
    "refuse a trigger that reaches it late",
)
"""What no generator can promise."""

_IDENTIFY_WITHIN_S: Final = 1.0


class GeneratorConverter(Converter):
    """A generator with an amplifier behind it as a `Converter`.

    `open_port` opens the channel or raises `LinkError`; the gain is volts at the actuator per volt
    of the generator; `outputs` are those that play the channels, counted from 1.
    """

    name, serial_number = "generator", ""
    bits, emulated = BITS, False
    cannot = CANNOT

    def __init__(
        self,
        open_port: Callable[[], Channel],
        clock: Clock,
        *,
        limits: Limits,
        amplifier_gain: float,
        sample_rate_hz: float,
        outputs: tuple[int, ...] = (1, 2),
    ) -> None:
        require_positive("amplifier_gain", amplifier_gain)
        self.channels = len(outputs)
        self._outputs = outputs
        self.full_scale_v = limits.ceiling_vpp / 2
        self.sample_rate_hz = sample_rate_hz
        self._open_port = open_port
        self._clock = clock
        self._ceiling_vpp = limits.ceiling_vpp
        self._gain = amplifier_gain
        self._channel: Channel | None = None
        self._connected: ScpiLine | None = None
        self._dialect = KEYSIGHT
        self._names: dict[tuple[int, bytes], str] = {}
        self._slots: dict[int, tuple[list[Wave], Wave]] = {}
        self._selected_s = 0.0
        self._set_vpp: tuple[float, ...] = ()

    def connect(self) -> None:
        """Connect, set the generator up with its outputs off, and read it back."""
        self._drop()
        self._channel = self._open_port()
        try:
            self._set_up(ScpiLine(self._channel, self._clock))
        except DeviceError:
            self._drop()
            raise

    def disconnect(self) -> None:
        """Wait until the generator has done what it was sent, outputs off included; disconnect."""
        with contextlib.suppress(LinkError):
            self._line.ask(self._dialect.complete)
        self._drop()

    def zero(self) -> None:
        """Send every output off at once."""
        channel, dialect = self._channel, self._dialect
        off = (dialect.output_off.format(channel=number) for number in self._outputs)
        if channel is not None and self._connected is not None:
            with contextlib.suppress(LinkError):
                channel.write("".join(f"{each}\n" for each in ("", *dialect.abort, *off)).encode())

    def store(self, slot: int, codes: CodeArray) -> None:
        """Store a waveform and silence of the same length on each channel."""
        dialect, n_samples = self._dialect, codes.shape[1]
        self._slots.pop(slot, None)
        if n_samples > dialect.longest_waveform:
            detail = f"{n_samples} samples, at most {dialect.longest_waveform}"
            raise rejection(Refusal.WAVEFORM_TOO_LONG, detail)
        waves = [encode(row, dialect) for row in codes]
        silence = encode(np.zeros_like(codes[0]), dialect)
        for channel, wave in zip(self._outputs, waves, strict=True):
            self._store(channel, wave)
            self._store(channel, silence)
        self._line.check_errors(dialect.error)
        self._slots[slot] = waves, silence

    def switch_on(self) -> None:
        """Read the set-up back and switch every output on."""
        dialect = self._dialect
        self._read_back()
        self._line.say(*(dialect.output_on.format(channel=channel) for channel in self._outputs))
        self._line.check_errors(dialect.error)

    def select(self, slot: int, levels_vpp: Sequence[float]) -> None:
        """Select waveforms and amplitudes and read them back, the same way for every site."""
        if slot not in self._slots:
            raise SettingError(f"slot {slot} is not stored: load its waveforms again")
        waves, silence = self._slots[slot]
        self._selected_s = len(silence.data) / 2 / self.sample_rate_hz
        choices = [
            self._choose(wave, level_vpp, silence)
            for wave, level_vpp in zip(waves, levels_vpp, strict=True)
        ]
        for channel, (wave, volts) in zip(self._outputs, choices, strict=True):
            self._say(self._dialect.select, channel, wave, volts)
        set_vpp = []
        for channel, (wave, volts) in zip(self._outputs, choices, strict=True):
            self._compare(self._dialect.select_readings, channel, wave, volts)
            set_vpp.append(self._read_level_vpp(channel, wave, volts))
        self._line.check_errors(self._dialect.error)
        self._set_vpp = tuple(set_vpp)

    def play(self, volts: FloatArray) -> Played:
        """Send the trigger and the question that confirms it; an answer lost is not asked again."""
        dialect, before_s = self._dialect, self._clock.now_s()
        try:
            line = self._line
            answer = line.ask(dialect.complete, after=dialect.trigger, within_s=self._selected_s)
            half_s = (self._clock.now_s() - before_s) / 2
            line.check_errors(dialect.error)
        except (LinkError, SettingError):
            return Played(outcome=Outcome.INDETERMINATE)
        if not matches("1", answer):
            return Played(outcome=Outcome.INDETERMINATE)
        return Played(
            outcome=Outcome.FIRED,
            onset_s=before_s + half_s,
            uncertainty_s=half_s,
            levels_vpp=self._set_vpp,
        )

    @property
    def _line(self) -> ScpiLine:
        if self._connected is None:
            raise LinkError("the generator is not connected")
        return self._connected

    @property
    def _highest_vpp(self) -> float:
        """The amplitude that the ceiling means at the generator."""
        return min(self._ceiling_vpp / self._gain, self._dialect.max_vpp)

    def _drop(self) -> None:
        self._connected = None
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _set_up(self, line: ScpiLine) -> None:
        identity = line.identify()
        dialect = dialect_of(identity)
        if dialect is None or max(self._outputs) > dialect.channels:
            outputs = ", ".join(map(str, self._outputs))
            raise LinkError(f"no generator with outputs {outputs} that is known here: {identity}")
        maker, model, serial_number, *_ = (*identity.split(","), "", "")
        self.name, self.serial_number = f"{maker} {model}", serial_number
        self.emulated = serial_number == EMULATED
        self.protocol = f"SCPI {dialect.name}"
        self.longest_waveform = dialect.longest_waveform
        self.full_scale_v = min(self._ceiling_vpp, dialect.max_vpp * self._gain) / 2
        self._connected, self._dialect = line, dialect
        self._names.clear()
        self._slots.clear()
        line.say(*dialect.reset)
        line.check_errors(dialect.error)
        silence = encode(np.zeros(dialect.shortest_waveform, dtype=np.int32), dialect)
        for channel in self._outputs:
            self._say(dialect.channel_load, channel)
            self._store(channel, silence)
            self._say(dialect.channel_setup, channel, silence)
            line.check_errors(dialect.error)
        self._read_back()

    def _fill(self, template: str, channel: int, wave: Wave | None, volts: float | None) -> str:
        """Fill a template in: amplitudes are rounded down, the limit that guards them up."""
        highest_vpp, digits = self._highest_vpp, self._dialect.volts_digits
        limit = decimals(highest_vpp / 2, digits, up=True)
        return template.format(
            channel=channel,
            name="" if wave is None else self._names[channel, wave.data],
            rate=f"{self.sample_rate_hz:.12g}",
            volts=decimals(highest_vpp if volts is None else volts, digits),
            high=limit,
            low=f"-{limit}",
        )

    def _say(
        self,
        templates: tuple[str, ...],
        channel: int,
        wave: Wave | None = None,
        volts: float | None = None,
    ) -> None:
        """Send commands for a waveform and an amplitude, by default the highest."""
        self._line.say(*(self._fill(template, channel, wave, volts) for template in templates))

    def _store(self, channel: int, wave: Wave) -> None:
        """Store a waveform, unless the generator has it."""
        key = channel, wave.data
        if key not in self._names:
            self._names[key] = f"T{len(self._names) + 1}"
            command = self._dialect.store.format(channel=channel, name=self._names[key])
            self._line.say_block(command, wave.data)

    def _read_back(self) -> None:
        for channel in self._outputs:
            self._compare(self._dialect.channel_readings, channel)

    def _compare(
        self,
        readings: tuple[ReadBack, ...],
        channel: int,
        wave: Wave | None = None,
        volts: float | None = None,
    ) -> None:
        for reading in readings:
            question = self._fill(reading.question, channel, wave, volts)
            required = self._fill(reading.answer, channel, wave, volts)
            answer = self._line.ask(question)
            if not matches(required, answer):
                raise SettingError(f"{question} must answer {required}, got {answer}")

    def _choose(self, wave: Wave, level_vpp: float, silence: Wave) -> tuple[Wave, float]:
        """Return what a channel plays and with which amplitude in volts peak-to-peak."""
        dialect = self._dialect
        volts = level_vpp * (wave.peak or 1.0) / self._gain
        if wave.peak == 0.0 or level_vpp == 0.0:
            return silence, min(max(volts, dialect.min_vpp), self._highest_vpp)
        if not dialect.min_vpp <= volts <= dialect.max_vpp:
            allowed = f"{dialect.min_vpp:g} to {dialect.max_vpp:g} Vpp at the generator"
            raise rejection(Refusal.BAD_LEVEL, f"{level_vpp:g} Vpp is {volts:g} of {allowed}")
        return wave, min(volts, self._highest_vpp)

    def _read_level_vpp(self, channel: int, wave: Wave, volts: float) -> float:
        """Return the level in Vpp at the actuator that the generator says it has set."""
        answer = self._line.ask(self._dialect.amplitude.format(channel=channel))
        limit_vpp = float(decimals(self._highest_vpp, self._dialect.volts_digits, up=True))
        if not matches(f"{volts!r}", answer) or float(answer) > limit_vpp:
            raise SettingError(f"channel {channel} must have {volts:g} Vpp, got {answer}")
        return float(answer) * self._gain / wave.peak if wave.peak else 0.0


def generator_device(
    port: str,
    *,
    limits: Limits,
    clock: Clock,
    amplifier_gain: float,
    sample_rate_hz: float,
    outputs: tuple[int, ...] = (1, 2),
    line: LineSettings = USUAL,
) -> ConverterDevice:
    """Return the driver of the generator on a port; nothing is opened yet.

    >>> from device.clock import MonotonicClock
    >>> from device.limits import Limits
    >>> generator_device("/no/such/port", limits=Limits(ceiling_vpp=200.0), clock=MonotonicClock(),
    ...                  amplifier_gain=27.5, sample_rate_hz=48e3).open()
    Traceback (most recent call last):
    device.errors.LinkError: cannot open /no/such/port: ...
    """
    converter = GeneratorConverter(
        lambda: open_instrument(port, clock, line),
        clock,
        limits=limits,
        amplifier_gain=amplifier_gain,
        sample_rate_hz=sample_rate_hz,
        outputs=outputs,
    )
    return ConverterDevice(converter, limits=limits, clock=clock)


def identify_generator(port: str, line: LineSettings = USUAL) -> str | None:
    """Return what a generator on a port answers to ``*IDN?``, or None where none known does.

    Nothing is set. A `LinkError` says that the port cannot be opened.
    """
    clock = MonotonicClock()
    with closing(open_instrument(port, clock, line)) as channel:
        try:
            identity = ScpiLine(channel, clock, response_timeout_s=_IDENTIFY_WITHIN_S).identify()
        except LinkError:
            return None
    return identity if dialect_of(identity) is not None else None
