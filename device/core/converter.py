"""A device around what plays waveforms: a sound card, a generator, a program of a lab.

Tokens, times to live, rests, levels and ceilings are kept for it by a `DeviceCore` in this process.
"""

from __future__ import annotations

import secrets
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, cast

from device.core.core import DeviceCore
from device.core.host import HostDriver
from device.core.local import LocalCore
from device.core.messages import Arm, AskHealth, Disarm, Enable, Fire, LoadSlot, Message, Query
from device.core.output import OutputStage
from device.core.reports import Health
from device.core.tokens import Exchange, Record, Reply
from device.driver import Identity, Outcome
from device.errors import DeviceError, LinkError, Refusal, error_line

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from device.clock import Clock
    from device.driver import FloatArray
    from device.limits import CodeArray, Limits

_ATTRIBUTES: Final = ("name", "serial_number", "sample_rate_hz", "bits", "full_scale_v", "emulated")


@dataclass(frozen=True, slots=True, kw_only=True)
class Played:
    """What a converter reports after playing a burst.

    Attributes
    ----------
    outcome : Outcome
        FIRED only if the whole burst certainly came out, NOT_FIRED only if certainly nothing did.
    onset_s : float or None
        Onset on the host's clock. If None, the burst began after the call of `play` and ended
        before `play` returned.
    uncertainty_s : float
        Half-width of the interval around `onset_s`.
    levels_vpp : tuple of float or None
        Level that each channel really had; None if the required levels were set.

    Examples
    --------
    >>> Played(outcome=Outcome.FIRED).onset_s is None
    True
    """

    outcome: Outcome
    onset_s: float | None = None
    uncertainty_s: float = 0.0
    levels_vpp: tuple[float, ...] | None = None


class Converter(ABC):
    """Hardware or a program that turns samples into volts at the actuators.

    A subclass sets the attributes and implements the four abstract methods. It sets attributes that
    only the hardware knows in `connect`. The other three methods are for hardware that stores
    waveforms or switches its outputs.

    Attributes
    ----------
    name : str
        Model.
    serial_number : str
        Serial number, which distinguishes two converters of one model.
    sample_rate_hz : float
        Rate at which it plays.
    bits : int
        Resolution of its converters.
    full_scale_v : float
        Volts at the actuator for a sample of 1, measured behind the amplifier; -1 gives as many
        volts below zero.
    emulated : bool
        Whether no actuator can move.
    cannot : tuple of str
        What it cannot guarantee; each text continues "it cannot" and is shown before a session.
    channels : int
        Number of outputs.
    protocol : str
        Name of the protocol or interface by which the computer controls it.
    longest_waveform : int
        Longest waveform, in samples.

    Examples
    --------
    `converter_device` makes a device of a converter; docs/own-device.md has an example of 40 lines:

    >>> from device import Converter, Outcome, Played
    >>> class Silent(Converter):
    ...     name, serial_number, sample_rate_hz, bits = "silent", "1", 48_000.0, 16
    ...     full_scale_v, emulated, cannot = 100.0, True, ("be felt",)
    ...     def connect(self): pass
    ...     def play(self, volts): return Played(outcome=Outcome.NOT_FIRED)
    ...     def zero(self): pass
    ...     def disconnect(self): pass
    >>> Silent().protocol
    'own'
    """

    name: str
    serial_number: str
    sample_rate_hz: float
    bits: int
    full_scale_v: float
    emulated: bool
    cannot: tuple[str, ...] = ()
    channels: int = 2
    protocol: str = "own"
    longest_waveform: int = 2**31

    @abstractmethod
    def connect(self) -> None:
        """Open it, its outputs at zero; `LinkError` if it is not there."""

    @abstractmethod
    def play(self, volts: FloatArray) -> Played:
        """Play volts at the actuators once, return when they are over, and say what is known.

        Parameters
        ----------
        volts : ndarray of float64, shape (n_channels, n_samples)
            Volts at each actuator, a value for each period of `sample_rate_hz`.

        Returns
        -------
        Played
            What is known. Whatever is raised counts as INDETERMINATE.
        """

    @abstractmethod
    def zero(self) -> None:
        """Bring the outputs to zero and cut what plays; from any thread, at any time."""

    @abstractmethod
    def disconnect(self) -> None:
        """Close it."""

    def store(self, slot: int, codes: CodeArray) -> None:  # noqa: B027 - most need no such step
        """Store codes in a slot; by default nothing is stored.

        Parameters
        ----------
        slot : int
            Which waveforms.
        codes : ndarray of int, shape (n_channels, n_samples)
            Codes of each channel.
        """

    def switch_on(self) -> None:  # noqa: B027 - most need no such step
        """Switch the outputs on, at zero; by default nothing has to be switched."""

    def select(self, slot: int, levels_vpp: Sequence[float]) -> None:  # noqa: B027 - most need no such step
        """Make a slot ready for the next `play`; by default nothing has to be prepared.

        Parameters
        ----------
        slot : int
            Which waveforms.
        levels_vpp : sequence of float
            Level of each channel, in peak-to-peak volts at the actuator.
        """


class HostedCore(LocalCore):
    """A `host.Link` to a converter: its core is in this process and keeps what it cannot keep.

    The core decides first, so that the converter does only what is allowed; what the converter
    then refuses is taken back.
    """

    def __init__(self, converter: Converter, clock: Clock, limits: Limits) -> None:
        output = OutputStage(
            channels=converter.channels,
            sample_rate_hz=converter.sample_rate_hz,
            bits=converter.bits,
            rail_v=converter.full_scale_v,
        )
        core = DeviceCore(
            boot_id=secrets.randbits(63), limits=limits, output=output, sink=lambda _: None
        )
        super().__init__(core, clock)
        self._converter = converter
        self._fired: dict[int, Exchange[Any]] = {}
        self._failure: Exception | None = None

    def hello(self) -> Identity:
        """Connect the converter and return who it is."""
        self._advance()
        self._call(self._converter.connect)
        self._failure = None
        self._state = self._core.state
        converter, limits = self._converter, self._core.limits
        return Identity(
            model=converter.name,
            serial_number=converter.serial_number,
            boot_id=self.boot_id,
            protocol_version=converter.protocol,
            sample_rate_hz=converter.sample_rate_hz,
            bits=converter.bits,
            channels=self._core.output.channels,
            ceiling_vpp=min(limits.ceiling_vpp, 2 * converter.full_scale_v),
            longest_waveform=min(limits.longest_waveform, converter.longest_waveform),
            emulated=converter.emulated,
        )

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Give a message to the core and have the converter do what it allows.

        A token is played once: the same FIRE again, or a QUERY, gives the same exchange. What
        failed while the converter played is raised at the next step.
        """
        if self._failure is not None and isinstance(message, Enable | Arm):
            raise LinkError(f"{self._converter.name}: {self._failure}") from self._failure
        if isinstance(message, Fire) and message.token not in self._fired:
            self._fired[message.token] = self._play(self._take(message))
        if isinstance(message, Fire | Query) and message.token in self._fired:
            return self._fired[message.token]
        exchange = super().exchange(message)
        match message:
            case LoadSlot():
                self._call(self._converter.store, message.slot, message.codes)
            case Enable():
                self._switch_on()
            case Arm():
                self._select(message)
            case AskHealth():  # which this host cannot see
                return replace(exchange, record=cast("Reply", Health()))
        return exchange

    def stop(self) -> None:
        """Bring the outputs to zero at once, from any thread; the core hears of it next."""
        super().stop()
        self._call(self._converter.zero)

    def hang_up(self) -> None:
        """Disconnect the converter."""
        try:
            super().hang_up()
        finally:
            self._call(self._converter.disconnect)

    def _advance(self) -> int:
        if self._stops:  # again: hardware may have missed it while it was sent something else
            self._call(self._converter.zero)
        return super()._advance()

    def _switch_on(self) -> None:
        try:
            self._call(self._converter.switch_on)
        except DeviceError:
            self.stop()
            raise
        self._advance()  # a stop that another thread requested meanwhile takes precedence

    def _select(self, message: Arm) -> None:
        try:
            self._call(self._converter.select, message.slot, self._core.levels.vpp)
        except DeviceError:
            super().exchange(Disarm(token=message.token))
            raise

    def _call(self, step: Callable[..., None], *args: object) -> None:
        """Call a method of the converter; whatever fails is a `DeviceError` of one line."""
        try:
            step(*args)
        except DeviceError:
            raise
        except Exception as error:
            message = f"{self._converter.name}: {step.__name__} failed: {error_line(error)}"
            raise LinkError(message) from error

    def _play(self, record: Record) -> Exchange[Record]:
        """Play what the core has allowed with this record."""
        playing = self._core.playing
        called_s = self._clock.now_s()
        if playing is None:
            return self._exchange(record, called_s, called_s, self._device_us(called_s))
        played, outcome = Played(outcome=Outcome.NOT_FIRED), Outcome.NOT_FIRED
        if not self._stops:
            try:
                played = self._converter.play(playing.volts)
                outcome = Outcome(played.outcome)
            except Exception as error:  # noqa: BLE001 - whatever it was, the burst may have been felt
                self._failure, outcome = error, Outcome.INDETERMINATE
        returned_s = self._clock.now_s()
        if outcome is Outcome.NOT_FIRED:
            unplayed = Record.not_fired(record.token, Refusal.ABORTED)
            return self._exchange(unplayed, called_s, returned_s, 0)
        if outcome is Outcome.INDETERMINATE or self._stops:  # a stop may have cut it
            return self._exchange(Record.unknown(record.token), called_s, returned_s, 0)
        before_s, after_s = called_s, returned_s - playing.duration_us * 1e-6
        if played.onset_s is not None:
            before_s = max(before_s, played.onset_s - played.uncertainty_s)
            after_s = min(returned_s, played.onset_s + played.uncertainty_s)
        if played.levels_vpp is not None:
            levels_mvpp = tuple(round(level_vpp * 1e3) for level_vpp in played.levels_vpp)
            record = replace(record, levels_mvpp=levels_mvpp)
        start_us = self._device_us(before_s)
        record = replace(record, start_us=start_us)
        return self._exchange(record, before_s, max(before_s, after_s), start_us)


class ConverterDevice(HostDriver):
    """A `BurstDevice` around its `converter`; see `converter_device`."""

    def __init__(self, converter: Converter, *, limits: Limits, clock: Clock) -> None:
        reachable_vpp = min(limits.ceiling_vpp, 2 * converter.full_scale_v)
        reachable = replace(limits, ceiling_vpp=reachable_vpp)
        self.converter = converter
        super().__init__(HostedCore(converter, clock, reachable), limits=reachable, clock=clock)

    @property
    def cannot(self) -> tuple[str, ...]:
        """What the converter says that it cannot promise."""
        return tuple(self.converter.cannot)


def converter_device(converter: Converter, *, limits: Limits, clock: Clock) -> ConverterDevice:
    """Return a device that plays its bursts through a converter, each of them exactly once.

    Parameters
    ----------
    converter : Converter
        The converter; nothing is opened yet.
    limits : Limits
        Limits of the study. The ceiling is at most what the converter's full scale gives.
    clock : Clock
        Clock of the host.

    Returns
    -------
    ConverterDevice
        A `BurstDevice`.

    Raises
    ------
    ValueError
        If `converter` is no `Converter`, or one of its attributes is missing or out of range.

    Examples
    --------
    A burst is played once, however often it is fired:

    >>> import numpy as np
    >>> from device import Converter, Limits, Outcome, Played, VirtualClock
    >>> class Printer(Converter):
    ...     name, serial_number, sample_rate_hz, bits = "printer", "1", 48_000.0, 16
    ...     full_scale_v, emulated, cannot = 100.0, True, ("be felt",)
    ...     def connect(self): pass
    ...     def play(self, volts):
    ...         print(abs(volts).max(axis=1).round().tolist())
    ...         return Played(outcome=Outcome.FIRED)
    ...     def zero(self): pass
    ...     def disconnect(self): pass
    >>> device = converter_device(Printer(), limits=Limits(ceiling_vpp=150.0), clock=VirtualClock())
    >>> _ = device.open()
    >>> sine = np.sin(np.linspace(0, 2 * np.pi, 97)); sine[-1] = 0.0
    >>> device.load(0, np.stack([sine, sine])); device.enable(); device.set_levels([150.0, 0.0])
    >>> device.arm(7, 0, time_to_live_s=1.0)
    >>> device.fire(7).outcome is device.fire(7).outcome is Outcome.FIRED
    [75.0, 0.0]
    True
    """
    if not isinstance(converter, Converter):
        raise ValueError(f"converter must be a device.Converter, got {converter!r}")  # noqa: TRY004
    for name in _ATTRIBUTES:
        if not hasattr(converter, name):
            raise ValueError(
                f"{type(converter).__name__}.{name} must be set (see device.Converter)"
            )
    return ConverterDevice(converter, limits=limits, clock=clock)
