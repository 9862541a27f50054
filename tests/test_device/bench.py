"""A device's core on a bench: messages by their names on the wire, and the bursts that came out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from device import Limits, OutputStage, Refusal, RefusedError
from device.core.core import DeviceCore
from device.core.messages import to_codes
from device.wire.protocol import FATES
from tests.test_device.bursts import refusal, sine
from tests.test_device.wire import message

if TYPE_CHECKING:
    from collections.abc import Callable

    from device import Emission, Measurement, State
    from device.core.tokens import Record


def fate_name(record: Record) -> str:
    """Return the name that docs/protocol.md gives to what became of a token."""
    return next(name for name, fate in FATES.items() if fate == record.fate)


LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.01, max_duty=0.5)
BURST_US = 2021
"""Duration of the burst of `Bench.load`, of 97 samples at 48 kHz."""


class Bench:
    """A core that was just switched on; times are the device's, in microseconds."""

    def __init__(
        self,
        *,
        history: int = 1024,
        limits: Limits = LIMITS,
        output: OutputStage | None = None,
        measure: Callable[[Emission], Measurement | None] | None = None,
    ) -> None:
        self.over: list[Emission] = []
        more: dict[str, Any] = {} if measure is None else {"measure": measure}
        self.core = DeviceCore(
            boot_id=1,
            limits=limits,
            output=output or OutputStage(),
            sink=self.over.append,
            history=history,
            **more,
        )

    @property
    def now_us(self) -> int:
        return self.core.now_us

    def take(self, at_us: int, name: str, **fields: Any) -> Any:
        return self.core.take(at_us, message(name, **fields))

    def refused(self, at_us: int, name: str, **fields: Any) -> Refusal:
        return refusal(lambda: self.take(at_us, name, **fields))

    def load(
        self, at_us: int, slot: int = 0, *, n: int = 97, left: float = 1.0, right: float = 0.0
    ) -> None:
        """Store a sine of `n` samples with these peaks."""
        codes = to_codes([sine(n, peak=peak) for peak in (left, right)], bits=16)
        self.take(at_us, "LOAD", slot=slot, codes=codes)

    def levels(self, at_us: int, left_mvpp: int, right_mvpp: int | None = None) -> None:
        right_mvpp = left_mvpp if right_mvpp is None else right_mvpp
        self.take(at_us, "LEVEL", levels_mvpp=(left_mvpp, right_mvpp))

    def arm(self, at_us: int, token: int, *, slot: int = 0, time_to_live_us: int = 100_000) -> None:
        self.take(at_us, "ARM", token=token, slot=slot, time_to_live_us=time_to_live_us)

    def fire(self, at_us: int, token: int) -> Any:
        return self.take(at_us, "FIRE", token=token)

    def fate(self, token: int) -> str:
        return fate_name(self.take(self.now_us, "QUERY", token=token))

    def state_at(self, at_us: int) -> State:
        self.core.advance(at_us)
        return self.core.state

    def live(self, *, n: int = 97) -> Bench:
        """Bring it to live at 0 us, at 100 Vpp, with a burst of `n` samples in slot 0."""
        self.load(0, n=n)
        self.levels(0, 100_000)
        self.take(0, "OUTPUT")
        return self

    def play(self, tokens: range) -> int:
        """Play a burst for each token, 50 ms after each other; return the time 50 ms later."""
        for token in tokens:
            now_us = self.now_us + 50_000
            self.take(now_us, "BEAT")
            self.arm(now_us, token)
            self.fire(now_us, token)
        self.take(self.now_us + 50_000, "BEAT")
        return self.now_us

    def future(self) -> list[object]:
        """Return what it answers to all that may be asked from now on, and what comes out."""
        answers: list[object] = [self.core.state, self.core.health]
        orders: tuple[tuple[int, str, dict[str, int]], ...] = (
            *((0, "QUERY", {"token": token}) for token in (1, 2, 3)),
            (0, "FIRE", {"token": 1}),
            (60_000, "BEAT", {}),
            *((0, "ARM", {"token": 7, "slot": slot, "time_to_live_us": 99}) for slot in (5, 0)),
            (0, "FIRE", {"token": 7}),
            (450_000, "QUERY", {"token": 7}),
            (60_000, "STOP", {}),
        )
        for after_us, name, fields in orders:
            try:
                answers.append(self.take(self.now_us + after_us, name, **fields))
            except RefusedError as error:
                answers.append(error.code)
            answers.append(self.core.state)
        return [
            *answers,
            *((burst.token, burst.start_us, burst.cut_us) for burst in self.over),
            *(burst.volts.tolist() for burst in self.over),
        ]
