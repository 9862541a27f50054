"""The host's side of every device that has a `DeviceCore` in it, whatever lies between them.

`HostDriver` is the `BurstDevice`: it refuses what is beyond the study's limits before anything is
sent, and concludes from the answers what became of a burst. Which step is legal when, the device
alone decides. A `Link` carries the messages: calls in this process, or frames on a wire.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from device.core.messages import (
    Arm,
    AskHealth,
    AskLimits,
    AskMeasured,
    Disarm,
    Enable,
    Fire,
    Levels,
    LoadSlot,
    Message,
    Query,
    check_slot,
    check_token,
    full_scale,
    to_codes,
    to_microseconds,
    to_millivolts,
)
from device.core.states import ILLEGAL, State
from device.core.tokens import Exchange, Record, Reply, delivery
from device.driver import BurstDevice
from device.errors import (
    DeviceError,
    LinkError,
    Refusal,
    RefusedError,
    rejection,
)
from device.limits import (
    MAX_CHANNELS,
    Limits,
    check_ceiling,
    check_channels,
    check_codes,
    check_rest,
    check_time_to_live,
    lowest_peaks,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from device.clock import Clock
    from device.core.reports import DeviceLimits, Health, Measurement
    from device.driver import Delivery, FloatArray, Identity


class Link(Protocol):
    """A channel to a device's core, which keeps up the heartbeat while it is connected.

    Every message is meant for the power cycle that said hello, and takes effect in no other. A
    refusal by the device is raised as `Rejected`.
    """

    @property
    def state(self) -> State:
        """The device's state with its last answer; SAFE after `stop`, CLOSED if not connected."""

    @property
    def boot_id(self) -> int:
        """The power cycle that was last heard of."""

    def hello(self) -> Identity:
        """Connect and return who answered.

        The device is IDLE or SAFE then: the loss of a connection before has stopped it.
        """

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Send a message and return it with its answer."""

    def stop(self) -> None:
        """Send STOP: from any thread, in any state, without waiting for a lock."""

    def hang_up(self) -> None:
        """Disconnect."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _HostSlot:
    peaks: tuple[int, ...]
    duration_us: int


class HostDriver(BurstDevice):
    """A `BurstDevice` over a link; its methods are described there.

    `limits` are the study's; the device has its own. Of the device's channels the first `channels`
    are driven, all by default; the others stay silent.

    >>> from device.clock import VirtualClock
    >>> from device.emulate.mock import MockDevice
    >>> device: HostDriver = MockDevice(VirtualClock(), limits=Limits(ceiling_vpp=200.0))
    >>> device.fire(1)
    Traceback (most recent call last):
    device.errors.RefusedError: the device is not open
    """

    def __init__(
        self, link: Link, *, limits: Limits, clock: Clock, channels: int = MAX_CHANNELS
    ) -> None:
        self._link = link
        self._channels = channels
        self._n_silent = 0
        self._limits = limits
        self._clock = clock
        self._identity: Identity | None = None
        self._has_restarted = False
        self._slots: dict[int, _HostSlot] = {}
        self._levels_mvpp: tuple[int, ...] = ()
        self._armed: Arm | None = None
        self._burst: Delivery | None = None
        self._burst_us = 0

    def open(self) -> Identity:
        """Connect and return who answered, with the number of channels that are driven.

        Levels start at 0, waveforms have to be loaded.

        Refused where it is open already and did not restart.
        """
        if self._link.state is not State.CLOSED and not self._restarted:
            raise RefusedError(Refusal.ALREADY_OPEN)
        device = self._link.hello()
        identity = replace(device, channels=min(self._channels, device.channels))
        self._has_restarted |= self._restarted
        self._identity = identity
        self._n_silent = device.channels - identity.channels
        self._slots.clear()
        self._armed = self._burst = None
        try:
            self._link.exchange(Levels(levels_mvpp=(0,) * device.channels))
        except DeviceError:
            self._link.hang_up()  # the caller cannot close a device that failed to open
            raise
        self._levels_mvpp = (0,) * identity.channels
        return identity

    def load(self, slot: int, samples: FloatArray) -> None:
        """Store waveforms, shape (n_channels, n_samples), in [-1, 1], at the device's rate."""
        identity = self._require_same()
        slot = check_slot(slot)
        codes = to_codes(samples, identity.bits)
        check_channels(len(codes), identity.channels)
        peaks = check_codes(codes, full_scale=full_scale(identity.bits), limits=self._limits)
        all_codes = np.pad(codes, ((0, self._n_silent), (0, 0)))
        self._link.exchange(LoadSlot(slot=slot, codes=all_codes))
        duration_us = round(codes.shape[1] * 1e6 / identity.sample_rate_hz)
        self._slots[slot] = _HostSlot(peaks=peaks, duration_us=duration_us)

    def enable(self) -> None:
        """Switch the output on; the only way out of a stop."""
        self._require_same()
        self._link.exchange(Enable())

    def set_levels(self, levels_vpp: Sequence[float]) -> None:
        """Set the level of each channel in peak-to-peak volts at the actuator.

        A level that no loaded waveform of its channel could use is refused here, any other where
        it is too high for a slot when that slot is armed.
        """
        channels = self._require_same().channels
        check_channels(len(levels_vpp), channels)
        levels_mvpp = tuple(to_millivolts(level_vpp) for level_vpp in levels_vpp)
        message = Levels(levels_mvpp=levels_mvpp + (0,) * self._n_silent)
        levels_mvpp = tuple(to_millivolts(level_vpp, up=True) for level_vpp in levels_vpp)
        peaks = lowest_peaks((slot.peaks for slot in self._slots.values()), channels)
        self._check_ceiling(peaks, levels_mvpp)
        self._link.exchange(message)
        self._levels_mvpp = levels_mvpp

    def arm(self, token: int, slot: int, *, time_to_live_s: float) -> None:
        """Allow `fire(token)` to play a slot for the next `time_to_live_s` seconds."""
        self._require_same()
        message = Arm(
            token=check_token(token),
            slot=check_slot(slot),
            time_to_live_us=to_microseconds(time_to_live_s),
        )
        check_time_to_live(message.time_to_live_us, self._limits)
        if message.slot not in self._slots:  # not even if the device kept it from before
            state = self._link.state
            is_armable = state in {State.LIVE, State.FIRED}  # a burst may be over by now
            raise rejection(Refusal.EMPTY_SLOT if is_armable else ILLEGAL[state], f"slot {slot}")
        self._check_ceiling(self._slots[message.slot].peaks, self._levels_mvpp)
        self._link.exchange(message)
        self._armed = message

    def fire(self, token: int) -> Delivery:
        """Play the armed slot; the same token again gives the same record, not another burst.

        Of a device that restarted since it was opened the delivery is INDETERMINATE.
        """
        self._require_open()
        token = check_token(token)
        if self._restarted:
            return self._lost(token)
        armed = self._armed if self._armed is not None and token == self._armed.token else None
        if armed is not None:
            self._check_rest()
        fired = delivery(self._link.exchange(Fire(token=token)), self._channels)
        if armed is not None:
            self._burst, self._burst_us = fired, self._slots[armed.slot].duration_us
            self._armed = None
        return fired

    def disarm(self, token: int) -> None:
        """Make sure that a token cannot fire from now on; what it did before stays."""
        self._require_open()
        self._link.exchange(Disarm(token=check_token(token)))

    def query(self, token: int) -> Delivery:
        """Return what became of a token.

        Once this driver has seen its device restart, a token that the device does not know is
        INDETERMINATE: it may have fired in the power cycle before.
        """
        self._require_open()
        answer = self._link.exchange(Query(token=check_token(token)))
        if answer.record.reason is Refusal.NOT_ARMED and (self._has_restarted or self._restarted):
            answer = replace(answer, record=Record.unknown(token))
        return delivery(answer, self._channels)

    def limits(self) -> DeviceLimits:
        """Return what the device is ready to do; a study is held against it before a session."""
        self._require_open()
        return self._link.exchange(AskLimits()).record

    def health(self) -> Health:
        """Return what the device knows of its amplifier, its safety switch, over-current."""
        self._require_open()
        return self._link.exchange(AskHealth()).record

    def measured(self, token: int) -> Measurement | None:
        """Return what the device measured of its last burst, if it was this token's, or None.

        Refused with BUSY while it plays.
        """
        self._require_open()
        measurement = self._link.exchange(AskMeasured(token=check_token(token))).record
        return measurement if measurement.tap else None

    def stop(self) -> None:
        """Bring outputs to zero: from any thread, in any state, any number of times, no lock."""
        self._link.stop()

    def close(self) -> None:
        """Stop, then disconnect."""
        try:
            self.stop()
        finally:
            self._link.hang_up()

    @property
    def _restarted(self) -> bool:
        """True if the device restarted since it was opened."""
        return self._identity is not None and self._identity.boot_id != self._link.boot_id

    def _require_open(self) -> Identity:
        if self._identity is None or self._link.state is State.CLOSED:
            raise RefusedError(Refusal.NOT_OPEN)
        return self._identity

    def _require_same(self) -> Identity:
        """Refuse a step for a device that is not open, or that restarted since it was opened."""
        identity = self._require_open()
        if self._restarted:
            raise LinkError("the device restarted and forgot everything: open it again")
        return identity

    # The device checks its own ceiling, too: two barriers, by one function.
    def _check_ceiling(self, peaks: Sequence[int], levels_mvpp: Sequence[int]) -> None:
        full = full_scale(self._require_open().bits)
        check_ceiling(peaks, levels_mvpp, full_scale=full, limits=self._limits)

    def _check_rest(self) -> None:
        if self._burst is not None:
            since_us = round((self._clock.now_s() - self._burst.host_after_s) * 1e6)
            check_rest(since_onset_us=since_us, duration_us=self._burst_us, limits=self._limits)

    def _lost(self, token: int) -> Delivery:
        """Return the delivery of a token whose power cycle is over."""
        now_s = self._clock.now_s()
        exchange = Exchange(
            record=Record.unknown(token),
            boot_id=self._link.boot_id,
            host_before_s=now_s,
            host_after_s=now_s,
        )
        return delivery(exchange, self._channels)
