"""A device's core in the host's process: the mock's, and that of a device which has none.

States, tokens, times to live, rests and ceilings are then kept by the host. Whatever stands behind
such a core is told what to play by a class derived from `LocalCore`.
"""

from __future__ import annotations

import secrets
from abc import abstractmethod
from collections import deque
from typing import TYPE_CHECKING, TypeVar

from device.clock import Clock, resolution_s
from device.core.core import DeviceCore
from device.core.states import State
from device.core.tokens import Exchange, Record

if TYPE_CHECKING:
    from collections.abc import Callable

    from device.core.messages import Arm, Levels, Load
    from device.core.output import OutputStage
    from device.limits import Limits

BEAT_US = 100_000
"""Interval of the host's heartbeat."""

_STRIDE_US = 4 * BEAT_US
"""One beat in four is given to the core: the others could not change what its watchdog does."""

_Content = TypeVar("_Content")
_Answer = TypeVar("_Answer")


class LocalCore:
    """A `host.Link` but for `hello`: calls of a core, with the heart of a host that is well.

    Parameters
    ----------
    core : DeviceCore
        The core; its time is the clock's.
    clock : Clock
        The host's.

    Examples
    --------
    >>> from device.clock import VirtualClock
    >>> from device.limits import Limits
    >>> from device.core.output import OutputStage
    >>> clock = VirtualClock()
    >>> core = DeviceCore(boot_id=1, limits=Limits(ceiling_vpp=200.0), output=OutputStage(),
    ...                   sink=print)
    >>> link = LocalCore(core, clock)
    >>> link.query(7).record.fate.value
    'never_armed'
    """

    def __init__(self, core: DeviceCore, clock: Clock) -> None:
        self._core = core
        self._clock = clock
        self._resolution_s = resolution_s(clock)
        self._stops: deque[float] = deque()
        self._known = State.CLOSED
        self._heart_beats = True
        self._beat_us = 0

    @property
    def state(self) -> State:
        """The core's state with its last answer; SAFE after `stop`, CLOSED if not connected."""
        stopped = self._stops and self._known is not State.CLOSED
        return State.SAFE if stopped else self._known

    @property
    def boot_id(self) -> int:
        """The core's power cycle."""
        return self._core.boot_id

    def load(self, message: Load) -> None:
        """Store a waveform."""
        self._ask(self._core.load, message)

    def set_levels(self, message: Levels) -> None:
        """Set both levels."""
        self._ask(self._core.set_levels, message)

    def enable(self) -> None:
        """Switch the output on."""
        self._ask(lambda now_us, _: self._core.enable(now_us), None)

    def arm(self, message: Arm) -> None:
        """Arm a token."""
        self._ask(self._core.arm, message)

    def fire(self, token: int) -> Exchange:
        """Fire a token and return question and answer."""
        return self._exchange(self._core.fire, token)

    def disarm(self, token: int) -> None:
        """Disarm a token."""
        self._ask(self._core.disarm, token)

    def query(self, token: int) -> Exchange:
        """Ask for a token and return question and answer."""
        return self._exchange(self._core.query, token)

    def stop(self) -> None:
        """Note a stop, from any thread; the core hears of it before anything else."""
        self._stops.append(self._clock.now_s())

    def hang_up(self) -> None:
        """Disconnect."""
        self._attend()
        self._known = State.CLOSED

    def _exchange(self, call: Callable[[int, int], Record], token: int) -> Exchange:
        before_s = self._clock.now_s()
        record = self._ask(call, token)
        return self._told(record, before_s, self._clock.now_s(), self._core.now_us)

    def _told(self, record: Record, before_s: float, after_s: float, device_us: int) -> Exchange:
        return Exchange(
            record=record,
            boot_id=self._core.boot_id,
            host_before_s=before_s,
            host_after_s=after_s,
            device_us=device_us,
            resolution_s=self._resolution_s,
            retries=0,
        )

    def _ask(self, call: Callable[[int, _Content], _Answer], content: _Content) -> _Answer:
        """Give a message to the core; its answer, also a refusal, tells the core's state."""
        now_us = self._attend()
        try:
            return call(now_us, content)
        finally:
            self._known = self._core.state

    def _attend(self) -> int:
        """Bring the core up to the present, stops first, and return its time."""
        while self._stops:
            at_us = max(self._device_us(self._stops.popleft()), self._core.now_us)
            self._beat_until(at_us)
            self._core.stop(at_us)
        now_us = self._device_us(self._clock.now_s())
        self._beat_until(now_us)
        self._core.advance(now_us)
        return now_us

    def _beat_until(self, until_us: int) -> None:
        due_us = until_us - (until_us - self._beat_us) % BEAT_US
        while self._heart_beats and self._beat_us < due_us:
            self._beat_us = min(self._beat_us + _STRIDE_US, due_us)
            self._core.beat(self._beat_us)

    def _device_us(self, host_s: float) -> int:
        return round(host_s * 1e6)


class HostedCore(LocalCore):
    """The core of a device that has none, in the host; it keeps what became of each token.

    A derived class plays what the core has allowed, once, and says what is known of it.

    Parameters
    ----------
    clock : Clock
        The host's.
    limits : Limits
        Of the study.
    output : OutputStage
        Rate and bits of the waveforms, and the volts of full scale.
    """

    def __init__(self, clock: Clock, *, limits: Limits, output: OutputStage) -> None:
        boot_id = secrets.randbits(63)
        core = DeviceCore(boot_id=boot_id, limits=limits, output=output, sink=lambda _: None)
        super().__init__(core, clock)
        self._fired: dict[int, Exchange] = {}

    def fire(self, token: int) -> Exchange:
        """Play a token if the core allows it; the same one again gives the same exchange."""
        if token not in self._fired:
            record = self._ask(self._core.fire, token)
            self._fired[token] = self._play(record)
        return self._fired[token]

    def query(self, token: int) -> Exchange:
        """Return what became of a token."""
        return self._fired[token] if token in self._fired else super().query(token)

    @abstractmethod
    def _play(self, record: Record) -> Exchange:
        """Play what the core has allowed with this record."""
