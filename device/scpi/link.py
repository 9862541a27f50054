"""A generator as a `host.Link`: what each step of a session means in SCPI.

A generator knows no tokens, states or rests: a `DeviceCore` in this process keeps them. It has no
burst counter: its trigger is sent once and never again, and a trigger whose confirmation was lost
is INDETERMINATE. Every waveform spans the whole range of the converter and the amplitude carries
the level, so that it means the same whether the generator takes its amplitude for that of the
waveform or of the range. A silent channel plays a waveform of zeros: generators have a least
amplitude, and for every side the same commands are sent.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from device.checks import require_positive
from device.core.local import HostedCore
from device.core.messages import Arm, Disarm, Enable, Levels, LoadSlot, Message
from device.core.output import OutputStage
from device.core.tokens import Exchange, Fate, Record, Reply
from device.driver import Identity
from device.errors import DeviceError, LinkError, Refusal, SettingError, rejection
from device.scpi.dialects import EMULATED, Dialect, ReadBack, dialect_of
from device.scpi.line import BITS, ScpiLine, Wave, decimals, encode, matches

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.limits import Limits
    from device.wire.channels import Channel


CANNOT: Final = (
    "bring its outputs to zero when this program or the line to it dies",
    "count its bursts: a trigger whose confirmation is lost is recorded as indeterminate",
    "refuse a trigger that reaches it late",
)
"""What no generator can promise."""

_CHANNELS: Final = (1, 2)
_UNITY_SLEW_V_S: Final = 1e12


@dataclass(frozen=True, slots=True, kw_only=True)
class _GeneratorSlot:
    waves: tuple[Wave, Wave]
    silence: Wave
    duration_s: float


class GeneratorLink(HostedCore):
    """A `host.Link` to a generator, with the core that it lacks."""

    def __init__(
        self,
        connect: Callable[[], Channel],
        clock: Clock,
        *,
        limits: Limits,
        amplifier_gain: float,
        sample_rate_hz: float,
    ) -> None:
        require_positive("amplifier_gain", amplifier_gain)
        output = OutputStage(
            sample_rate_hz=sample_rate_hz,
            bits=BITS,
            rail_v=limits.ceiling_vpp / 2,
            slew_v_s=_UNITY_SLEW_V_S,
        )
        super().__init__(clock, limits=limits, output=output)
        self._connect = connect
        self._limits = limits
        self._gain = amplifier_gain
        self._rate = f"{sample_rate_hz:.12g}"
        self._channel: Channel | None = None
        self._talk: tuple[ScpiLine, Dialect] | None = None
        self._off = b""
        self._names: dict[tuple[int, bytes], str] = {}
        self._slots: dict[int, _GeneratorSlot] = {}
        self._levels_vpp = (0.0, 0.0)
        self._set_mvpp = (0, 0)
        self._armed_s = 0.0

    @property
    def cannot(self) -> tuple[str, ...]:
        """What the generator cannot promise; complete once it is known which one it is."""
        return CANNOT if self._talk is None else CANNOT + self._talk[1].cannot

    def hello(self) -> Identity:
        """Connect, set the generator up with its outputs off, and read it back."""
        self._attend()
        self._drop()
        self._channel = self._connect()
        try:
            identity = self._set_up(ScpiLine(self._channel, self._clock))
        except DeviceError:
            self._drop()
            raise
        self._known = self._core.state
        return identity

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Have the core allow what a message asks, and the generator do it.

        Uploads and the switch come first, lest the core believe in what the generator refused; an
        ARM comes to the generator last, for only the core knows whether it is allowed.
        """
        stored = self._stored(message) if isinstance(message, LoadSlot) else None
        if isinstance(message, Enable):
            self._switch_on()
        told = super().exchange(message)
        if isinstance(message, LoadSlot) and stored is not None:
            self._slots[message.slot] = stored
        elif isinstance(message, Levels):
            self._levels_vpp = message.vpp
        elif isinstance(message, Enable):
            self._attend()
        elif isinstance(message, Arm):
            self._make_ready(message)
        return told

    def _stored(self, message: LoadSlot) -> _GeneratorSlot:
        """Return a waveform as the generator plays it, stored there if it keeps several."""
        self._attend()
        line, dialect = self._require_talk()
        samples = message.left.size
        if samples > dialect.longest_waveform:
            detail = f"{samples} samples, at most {dialect.longest_waveform}"
            raise rejection(Refusal.WAVEFORM_TOO_LONG, detail)
        waves = encode(message.left, dialect), encode(message.right, dialect)
        silence = encode(np.zeros_like(message.left), dialect)
        slot = _GeneratorSlot(waves=waves, silence=silence, duration_s=samples / float(self._rate))
        if dialect.named:
            for channel, wave in zip(_CHANNELS, waves, strict=True):
                self._store(line, dialect, channel, wave)
                self._store(line, dialect, channel, silence)
            line.check_errors(dialect.error)
        return slot

    def _switch_on(self) -> None:
        """Read the set-up back and switch both outputs on."""
        self._attend()
        line, dialect = self._require_talk()
        self._read_back(dialect.channel_readings)
        line.say(*(dialect.output_on.format(channel=channel) for channel in _CHANNELS))
        line.check_errors(dialect.error)

    def _make_ready(self, message: Arm) -> None:
        """Select waveforms and amplitudes and read them back, or take the token back."""
        try:
            self._select(self._slots[message.slot])
        except DeviceError:
            super().exchange(Disarm(token=message.token))
            raise
        self._armed_s = self._slots[message.slot].duration_s

    def stop(self) -> None:
        """Send both outputs off at once, from any thread; the next step sends it again."""
        super().stop()
        channel = self._channel
        if channel is not None:
            with contextlib.suppress(LinkError):
                channel.write(self._off)

    def hang_up(self) -> None:
        """Wait until the generator has done what it was sent, outputs off included; disconnect."""
        super().hang_up()
        if self._talk is not None:
            line, dialect = self._talk
            with contextlib.suppress(LinkError):
                line.ask(dialect.complete)
        self._drop()

    def _drop(self) -> None:
        self._talk = None
        if self._channel is not None:
            self._channel.close()
            self._channel = None

    def _attend(self) -> int:
        """Repeat a stop first: it may have been swallowed by an upload that was under way."""
        if self._stops and self._channel is not None:
            with contextlib.suppress(LinkError):
                self._channel.write(self._off)
        return super()._attend()

    def _require_talk(self) -> tuple[ScpiLine, Dialect]:
        if self._talk is None:
            raise LinkError("the generator is not connected")
        return self._talk

    def _set_up(self, line: ScpiLine) -> Identity:
        words = line.identify()
        dialect = dialect_of(words)
        if dialect is None:
            raise LinkError(f"no generator with two channels that is known here: {words}")
        off = (dialect.output_off.format(channel=channel) for channel in _CHANNELS)
        self._off = "".join(f"{command}\n" for command in ("", *dialect.abort, *off)).encode()
        self._talk = line, dialect
        self._names.clear()
        self._slots.clear()
        line.say(*dialect.reset)
        line.check_errors(dialect.error)
        silence = encode(np.zeros(dialect.shortest_waveform, dtype=np.int32), dialect)
        for channel in _CHANNELS:
            self._say_each(dialect.channel_load, channel)
            self._store(line, dialect, channel, silence)
            self._say_each(dialect.channel_setup, channel, silence)
            line.check_errors(dialect.error)
        self._read_back(dialect.channel_readings)
        return self._identity(words, dialect)

    def _identity(self, words: str, dialect: Dialect) -> Identity:
        maker, model, serial, *_ = (*words.split(","), "", "")
        return Identity(
            model=f"{maker} {model}",
            serial_number=serial,
            boot_id=self.boot_id,
            protocol_version=f"SCPI {dialect.name}",
            sample_rate_hz=float(self._rate),
            bits=BITS,
            channels=len(_CHANNELS),
            ceiling_vpp=min(self._limits.ceiling_vpp, dialect.most_vpp * self._gain),
            longest_waveform=dialect.longest_waveform,
            emulated=serial == EMULATED,
        )

    def _highest_vpp(self, dialect: Dialect) -> float:
        """Return the amplitude that the ceiling means at the generator."""
        return min(self._limits.ceiling_vpp / self._gain, dialect.most_vpp)

    def _fill(self, template: str, channel: int, name: str, volts: float) -> str:
        """Fill a template in: amplitudes are rounded down, the limit that guards them up."""
        _, dialect = self._require_talk()
        limit = decimals(self._highest_vpp(dialect) / 2, dialect.volts_digits, up=True)
        return template.format(
            channel=channel,
            name=name,
            rate=self._rate,
            volts=decimals(volts, dialect.volts_digits),
            high=limit,
            low=f"-{limit}",
        )

    def _say_each(self, templates: tuple[str, ...], channel: int, wave: Wave | None = None) -> None:
        line, dialect = self._require_talk()
        name = "" if wave is None else self._names[channel, wave.data]
        volts = self._highest_vpp(dialect)
        line.say(*(self._fill(template, channel, name, volts) for template in templates))

    def _store(self, line: ScpiLine, dialect: Dialect, channel: int, wave: Wave) -> None:
        """Store a waveform, unless a generator that keeps waveforms by name has it."""
        key = channel, wave.data
        if dialect.named and key in self._names:
            return
        self._names[key] = f"T{len(self._names) + 1}"
        command = dialect.store.format(channel=channel, name=self._names[key])
        line.say_block(command, wave.data)

    def _read_back(self, readings: tuple[ReadBack, ...]) -> None:
        for channel in _CHANNELS:
            self._compare(readings, channel, "", 0.0)

    def _compare(
        self, readings: tuple[ReadBack, ...], channel: int, name: str, volts: float
    ) -> None:
        line, _ = self._require_talk()
        for reading in readings:
            question = self._fill(reading.question, channel, name, volts)
            wanted = self._fill(reading.answer, channel, name, volts)
            got = line.ask(question)
            if not matches(wanted, got):
                raise SettingError(f"{question} must answer {wanted}, got {got}")

    def _select(self, slot: _GeneratorSlot) -> None:
        """Make the generator ready for one trigger, the same way for every side."""
        line, dialect = self._require_talk()
        pairs = zip(slot.waves, self._levels_vpp, strict=True)
        chosen = [self._choice(wave, level_vpp, slot, dialect) for wave, level_vpp in pairs]
        for channel, (wave, volts) in zip(_CHANNELS, chosen, strict=True):
            if not dialect.named:
                self._store(line, dialect, channel, wave)
            name = self._names[channel, wave.data]
            line.say(*(self._fill(command, channel, name, volts) for command in dialect.select))
        levels_mvpp = []
        for channel, (wave, volts) in zip(_CHANNELS, chosen, strict=True):
            name = self._names[channel, wave.data]
            self._compare(dialect.select_readings, channel, name, volts)
            levels_mvpp.append(self._level_set(channel, wave, volts, dialect))
        line.check_errors(dialect.error)
        self._set_mvpp = levels_mvpp[0], levels_mvpp[1]

    def _choice(
        self, wave: Wave, level_vpp: float, slot: _GeneratorSlot, dialect: Dialect
    ) -> tuple[Wave, float]:
        """Return what a channel plays and with which amplitude in volts peak-to-peak."""
        highest_vpp = self._highest_vpp(dialect)
        volts = level_vpp * self._limits.gain * (wave.peak or 1.0) / self._gain
        if wave.peak == 0.0 or level_vpp == 0.0:
            return slot.silence, min(max(volts, dialect.least_vpp), highest_vpp)
        if not dialect.least_vpp <= volts <= dialect.most_vpp:
            allowed = f"{dialect.least_vpp:g} to {dialect.most_vpp:g} Vpp at the generator"
            raise rejection(Refusal.BAD_LEVEL, f"{level_vpp:g} Vpp is {volts:g} of {allowed}")
        return wave, min(volts, highest_vpp)

    def _level_set(self, channel: int, wave: Wave, volts: float, dialect: Dialect) -> int:
        """Return the level in mVpp that the generator says it has set."""
        line, _ = self._require_talk()
        got = line.ask(dialect.amplitude.format(channel=channel))
        limit_vpp = float(decimals(self._highest_vpp(dialect), dialect.volts_digits, up=True))
        if not matches(f"{volts!r}", got) or float(got) > limit_vpp:
            raise SettingError(f"channel {channel} must have {volts:g} Vpp, got {got}")
        factor = self._limits.gain * wave.peak
        return round(float(got) * self._gain / factor * 1000) if factor else 0

    def _play(self, record: Record) -> Exchange[Record]:
        """Send the trigger and the question that confirms it; an answer lost is not asked again."""
        before_s = self._clock.now_s()
        fate, after_s = (Fate.ABORTED, before_s) if self._stops else self._confirmed()
        if fate is Fate.FIRED:
            start_us = self._device_us(before_s)
            known = replace(record, start_us=start_us, levels_mvpp=self._set_mvpp)
            return self._told(known, before_s, after_s, start_us)
        return self._told(Record(token=record.token, fate=fate), before_s, after_s, 0)

    def _confirmed(self) -> tuple[Fate, float]:
        """Return what the generator says to the trigger, and when it said so."""
        try:
            line, dialect = self._require_talk()
            answer = line.ask(dialect.complete, after=dialect.trigger, within_s=self._armed_s)
            after_s = self._clock.now_s()
            line.check_errors(dialect.error)
        except (LinkError, SettingError):
            return Fate.UNKNOWN, self._clock.now_s()
        certain = matches("1", answer) and not self._stops
        return Fate.FIRED if certain else Fate.UNKNOWN, after_s
