"""A device of a lab's own: all that it has to do is to play two waveforms, once.

Tokens, times to live, rests, levels and ceilings are kept for it by a `DeviceCore` in this process.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

from device.core.host import HostDriver
from device.core.local import HostedCore
from device.core.messages import Arm, Enable, Message
from device.core.output import OutputStage
from device.core.tokens import Exchange, Fate, Record, Reply
from device.driver import Identity, Outcome
from device.errors import DeviceError, LinkError
from device.installed import require_whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.clock import Clock
    from device.driver import FloatArray
    from device.limits import Limits


class Converter(Protocol):
    """What turns samples into volts at two actuators: a card, an instrument, a program.

    Attributes
    ----------
    name : str
        Its model.
    serial_number : str
        Which one it is.
    sample_rate_hz : float
        At which it plays.
    bits : int
        Of its converters.
    full_scale_v : float
        Volts at the actuator, to both sides, of its largest sample: measured, behind the amplifier.
    emulated : bool
        Whether no actuator can move.
    cannot : tuple of str
        What it cannot promise, each to be read after "it cannot"; told before a session.

    Examples
    --------
    `converter_device` makes a device around one; docs/own-device.md has it in 40 lines:

    >>> from device import Converter, Outcome
    >>> class Silent:
    ...     name, serial_number, sample_rate_hz, bits = "silent", "1", 48_000.0, 16
    ...     full_scale_v, emulated, cannot = 100.0, True, ("be felt",)
    ...     def connect(self): pass
    ...     def play(self, left_v, right_v): return Outcome.NOT_FIRED
    ...     def zero(self): pass
    ...     def disconnect(self): pass
    >>> converter: Converter = Silent()
    """

    name: str
    serial_number: str
    sample_rate_hz: float
    bits: int
    full_scale_v: float
    emulated: bool
    cannot: tuple[str, ...]

    def connect(self) -> None:
        """Open it, its outputs at zero; `LinkError` where it is not there."""

    def play(self, left_v: FloatArray, right_v: FloatArray) -> Outcome:
        """Play volts at the actuators once, return when they are over, and say what is known.

        Parameters
        ----------
        left_v, right_v : ndarray of float64, shape (n,)
            Volts at both actuators, a value for each period of `sample_rate_hz`.

        Returns
        -------
        Outcome
            FIRED only where it surely came out as a whole, NOT_FIRED where surely nothing did.
            Whatever is raised counts as INDETERMINATE.
        """

    def zero(self) -> None:
        """Bring the outputs to zero and cut what plays; from any thread, at any time."""

    def disconnect(self) -> None:
        """Close it."""


_FATES = {
    Outcome.FIRED: Fate.FIRED,
    Outcome.NOT_FIRED: Fate.ABORTED,
    Outcome.INDETERMINATE: Fate.UNKNOWN,
}
_SLEW_V_S = 1e12


class _ConverterLink(HostedCore):
    """A `host.Link` to a converter, with the core that it lacks."""

    def __init__(self, converter: Converter, clock: Clock, limits: Limits) -> None:
        output = OutputStage(
            sample_rate_hz=converter.sample_rate_hz,
            bits=converter.bits,
            rail_v=converter.full_scale_v,
            slew_v_s=_SLEW_V_S,
        )
        super().__init__(clock, limits=limits, output=output)
        self._converter = converter
        self._trouble: Exception | None = None

    def hello(self) -> Identity:
        self._attend()
        self._do(self._converter.connect)
        self._trouble = None
        self._known = self._core.state
        return Identity(
            model=self._converter.name,
            serial_number=self._converter.serial_number,
            boot_id=self.boot_id,
            protocol_version="own",
            sample_rate_hz=self._core.output.sample_rate_hz,
            bits=self._core.output.bits,
            channels=2,
            ceiling_vpp=self._core.limits.ceiling_vpp,
            longest_waveform=self._core.limits.longest_waveform,
            emulated=self._converter.emulated,
        )

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Give a message to the core; what failed while it played is told at the next step."""
        if self._trouble is not None and isinstance(message, Enable | Arm):
            raise LinkError(f"{self._converter.name}: {self._trouble}") from self._trouble
        return super().exchange(message)

    def stop(self) -> None:
        super().stop()
        self._do(self._converter.zero)

    def hang_up(self) -> None:
        super().hang_up()
        self._do(self._converter.disconnect)

    def _do(self, step: Callable[[], None]) -> None:
        """Have a step done; what fails is told as a failure of this device, in one line."""
        try:
            step()
        except DeviceError:
            raise
        except Exception as error:
            said = f"{type(error).__name__}: {' '.join(str(error).split())}"
            raise LinkError(f"{self._converter.name}: {step.__name__} failed: {said}") from error

    def _play(self, record: Record) -> Exchange[Record]:
        playing = self._core.playing
        asked_s = self._clock.now_s()
        if playing is None:
            return self._told(record, asked_s, asked_s, self._device_us(asked_s))
        try:
            outcome = Outcome(self._converter.play(playing.left_v, playing.right_v))
        except Exception as error:  # noqa: BLE001 - whatever it was, the burst may have been felt
            self._trouble, outcome = error, Outcome.INDETERMINATE
        if self._stops and outcome is Outcome.FIRED:
            outcome = Outcome.INDETERMINATE  # it may have been cut
        returned_s = self._clock.now_s()
        if outcome is not Outcome.FIRED:
            known = Record(token=record.token, fate=_FATES[outcome])
            return self._told(known, asked_s, returned_s, 0)
        # It began when it was asked to at the earliest, and its length before it was over at the
        # latest.
        latest_s = returned_s - len(playing.left_v) / self._core.output.sample_rate_hz
        start_us = self._device_us(asked_s)
        known = replace(record, start_us=start_us)
        return self._told(known, asked_s, max(asked_s, latest_s), start_us)


class ConverterDevice(HostDriver):
    """A `BurstDevice` around a converter; see `converter_device`."""

    def __init__(self, converter: Converter, *, limits: Limits, clock: Clock) -> None:
        reachable_vpp = min(limits.ceiling_vpp, 2 * converter.full_scale_v)
        reachable = replace(limits, ceiling_vpp=reachable_vpp)
        self._cannot = tuple(converter.cannot)
        super().__init__(_ConverterLink(converter, clock, reachable), limits=reachable, clock=clock)

    @property
    def cannot(self) -> tuple[str, ...]:
        """What the converter says that it cannot promise."""
        return self._cannot


def converter_device(converter: Converter, *, limits: Limits, clock: Clock) -> ConverterDevice:
    """Return a device around what plays two waveforms: the whole contract, exactly once.

    Parameters
    ----------
    converter : Converter
        What plays; nothing is opened yet.
    limits : Limits
        Of the study; the ceiling is also that of the converter's full scale.
    clock : Clock
        The host's.

    Returns
    -------
    ConverterDevice
        A `BurstDevice`.

    Raises
    ------
    ValueError
        If the converter lacks something that `Converter` lists; the message says what to add.

    Examples
    --------
    A burst is played once, however often it is asked for:

    >>> import numpy as np
    >>> from device import Limits, Outcome, VirtualClock
    >>> class Printer:
    ...     name, serial_number, sample_rate_hz, bits = "printer", "1", 48_000.0, 16
    ...     full_scale_v, emulated, cannot = 100.0, True, ("be felt",)
    ...     def connect(self): pass
    ...     def play(self, left_v, right_v):
    ...         print(f"{abs(left_v).max():.0f} V left, {abs(right_v).max():.0f} V right")
    ...         return Outcome.FIRED
    ...     def zero(self): pass
    ...     def disconnect(self): pass
    >>> device = converter_device(Printer(), limits=Limits(ceiling_vpp=150.0), clock=VirtualClock())
    >>> _ = device.open()
    >>> sine = np.sin(np.linspace(0, 2 * np.pi, 97)); sine[-1] = 0.0
    >>> device.load(0, sine, sine); device.enable(); device.set_levels(150.0, 0.0)
    >>> device.arm(7, 0, time_to_live_s=1.0)
    >>> device.fire(7).outcome is device.fire(7).outcome is Outcome.FIRED
    75 V left, 0 V right
    True
    """
    require_whole(converter, Converter)
    return ConverterDevice(converter, limits=limits, clock=clock)
