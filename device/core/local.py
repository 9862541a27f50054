"""A device's core in the host's process: the mock's, and that of a device which has none."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from device.core.messages import Beat, Message, Stop
from device.core.states import State
from device.core.tokens import Exchange, Reply

if TYPE_CHECKING:
    from device.clock import Clock
    from device.core.core import DeviceCore

BEAT_US = 100_000
"""Interval of the host's heartbeat."""

_STRIDE_US = 4 * BEAT_US
"""One beat in four is given to the core: the others could not change what its watchdog does."""


class LocalCore:
    """A `host.Link` but for `hello`: calls of a core, with the heartbeat of a host that is well.

    The core's time is the clock's.

    >>> from device.clock import VirtualClock
    >>> from device.core.core import DeviceCore
    >>> from device.core.messages import Query
    >>> from device.limits import Limits
    >>> from device.core.output import OutputStage
    >>> clock = VirtualClock()
    >>> core = DeviceCore(boot_id=1, limits=Limits(ceiling_vpp=200.0), output=OutputStage(),
    ...                   sink=print)
    >>> link = LocalCore(core, clock)
    >>> link.exchange(Query(token=7)).record.outcome.value
    'not_fired'
    """

    def __init__(self, core: DeviceCore, clock: Clock) -> None:
        self._core = core
        self._clock = clock
        self._stops: deque[float] = deque()
        self._state = State.CLOSED
        self._heart_beats = True
        self._beat_us = 0

    @property
    def state(self) -> State:
        """The core's state with its last answer; SAFE after `stop`, CLOSED if not connected."""
        stopped = self._stops and self._state is not State.CLOSED
        return State.SAFE if stopped else self._state

    @property
    def boot_id(self) -> int:
        """The core's power cycle."""
        return self._core.boot_id

    def exchange(self, message: Message[Reply]) -> Exchange[Reply]:
        """Pass a message to the core; its answer, or its refusal, reports the core's state."""
        before_s = self._clock.now_s()
        record = self._take(message)
        return self._exchange(record, before_s, self._clock.now_s(), self._core.now_us)

    def stop(self) -> None:
        """Note a stop, from any thread; the core hears of it before anything else."""
        self._stops.append(self._clock.now_s())

    def hang_up(self) -> None:
        """Disconnect."""
        self._advance()
        self._state = State.CLOSED

    def _take(self, message: Message[Reply]) -> Reply:
        now_us = self._advance()
        try:
            return self._core.take(now_us, message)
        finally:
            self._state = self._core.state

    def _exchange(
        self, record: Reply, before_s: float, after_s: float, device_us: int
    ) -> Exchange[Reply]:
        return Exchange(
            record=record,
            boot_id=self._core.boot_id,
            host_before_s=before_s,
            host_after_s=after_s,
            device_us=device_us,
        )

    def _advance(self) -> int:
        """Bring the core up to the present, stops first, and return its time."""
        while self._stops:
            at_us = max(self._device_us(self._stops.popleft()), self._core.now_us)
            self._beat_until(at_us)
            self._core.take(at_us, Stop())
        now_us = self._device_us(self._clock.now_s())
        self._beat_until(now_us)
        self._core.advance(now_us)
        return now_us

    def _beat_until(self, until_us: int) -> None:
        due_us = until_us - (until_us - self._beat_us) % BEAT_US
        while self._heart_beats and self._beat_us < due_us:
            self._beat_us = min(self._beat_us + _STRIDE_US, due_us)
            self._core.take(self._beat_us, Beat())

    def _device_us(self, host_s: float) -> int:
        return round(host_s * 1e6)
