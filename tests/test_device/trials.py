"""A host that runs trials as a session does, over any line, and what must be true of them."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from device import (
    Delivery,
    DeviceError,
    Limits,
    LineSettings,
    LinkError,
    MonotonicClock,
    Outcome,
    RefusedError,
)
from device.core.host import HostDriver
from device.wire.channels import open_channel
from device.wire.link import FrameLink
from tests.test_device.bursts import sine

if TYPE_CHECKING:
    from device import Clock

LIMITS = Limits(ceiling_vpp=200.0, min_interval_s=0.005)
QUICK = sine(25)
PAIRS = [(QUICK, 0 * QUICK), (0 * QUICK, QUICK), (QUICK, QUICK), (0 * QUICK, 0 * QUICK)]
WINDOW_S = 3.0
PATIENCE_S = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What the host said of a token, and what would excuse it for not knowing."""

    outcome: Outcome
    levels_mv: tuple[int, ...] = (0, 0)
    onset_s: tuple[float, float] = (-math.inf, math.inf)
    retries: int = 0
    restarted: bool = False
    lost: bool = False
    asked_s: float = 0.0


class Trials:
    """A host that runs trials, and keeps what it was told."""

    def __init__(
        self,
        device: HostDriver,
        clock: Clock,
        rng: np.random.Generator,
        *,
        n_slots: int = len(PAIRS),
    ) -> None:
        self.device = device
        self.clock = clock
        self.rng = rng
        self.claims: dict[int, Claim] = {}
        self.windows_s: dict[int, tuple[float, float]] = {}
        self.tokens = count(1)
        self.boot_id = 0
        self._n_slots = n_slots
        self.reopen()

    def reopen(self) -> None:
        """Connect and make ready, as often as it takes."""
        for _ in range(200):
            try:
                self.device.close()
                self.boot_id = self.device.open().boot_id
                for slot, pair in enumerate(PAIRS[: self._n_slots]):
                    self.device.load(slot, np.stack(pair))
                self.device.enable()
            except DeviceError:
                continue
            return
        pytest.fail("the device cannot be reached any more")

    def trial(self) -> None:
        token, slot = next(self.tokens), int(self.rng.integers(self._n_slots))
        level_vpp = float(self.rng.integers(1, 200_001)) / 1000
        begin_s, boot_id = self.clock.now_s(), self.boot_id
        try:
            self.device.set_levels([level_vpp, level_vpp])
            self.device.arm(token, slot, time_to_live_s=WINDOW_S)
            self.windows_s[token] = begin_s, self.clock.now_s() + WINDOW_S
            began_s = self.clock.now_s()
            said = self.device.fire(token)
            assert began_s <= said.host_before_s <= said.host_after_s <= self.clock.now_s()
            restarted = said.boot_id != boot_id
            self.claim(said, restarted=restarted, asked_s=self.clock.now_s() - began_s)
            if restarted:
                self.reopen()
        except RefusedError:
            self.claims[token] = Claim(outcome=Outcome.NOT_FIRED)
            self.ready_again()
        except LinkError:
            self.settle(token, boot_id)

    def claim(self, said: Delivery, **excuses: Any) -> None:
        self.claims[said.token] = Claim(
            outcome=said.outcome,
            levels_mv=tuple(round(level_vpp * 1000) for level_vpp in said.levels_vpp),
            onset_s=(said.host_before_s, said.host_after_s),
            retries=said.retries,
            **excuses,
        )

    def ready_again(self) -> None:
        """Switch the output on again after a watchdog's stop."""
        try:
            self.device.enable()
        except DeviceError:
            self.reopen()

    def settle(self, token: int, boot_id: int) -> None:
        """Ask for a token after the line was lost, as a resumed session does."""
        for _ in range(200):
            self.reopen()
            began_s = self.clock.now_s()
            try:
                self.device.disarm(token)
                said = self.device.query(token)
            except DeviceError:
                continue
            if said.boot_id != boot_id:
                self.claims[token] = Claim(outcome=Outcome.INDETERMINATE, restarted=True, lost=True)
            else:
                self.claim(said, asked_s=self.clock.now_s() - began_s, lost=True)
            return
        pytest.fail("no answer to any question")

    def check(self, truth: list[dict[str, Any]], *, drift_ppm: float = 0.0) -> Counter[str]:
        """Join what the host said with what was emitted, by token; return the counts."""
        began_s = truth[0]["began_s"]
        bursts = [event for event in truth if event["event"] == "burst"]
        emitted = {burst["token"]: burst for burst in bursts}
        assert len(emitted) == len(bursts), "two bursts for one token"
        for token, said in self.claims.items():
            if said.outcome is Outcome.INDETERMINATE:
                assert said.restarted or said.lost or said.asked_s >= PATIENCE_S
            else:
                assert (said.outcome is Outcome.FIRED) == (token in emitted)
        for token, burst in emitted.items():
            said, onset_s = self.claims[token], began_s + burst["t_s"] / (1 + drift_ppm * 1e-6)
            begin_s, end_s = self.windows_s[token]
            assert begin_s - 2e-6 <= onset_s <= end_s + WINDOW_S * 1e-4
            if said.outcome is Outcome.FIRED:
                assert burst["levels_mv"] == list(said.levels_mv)
                assert said.onset_s[0] - 2e-6 <= onset_s <= said.onset_s[1] + 2e-6
        counts = Counter(said.outcome.value for said in self.claims.values())
        counts["bursts"] = len(emitted)
        counts["lost"] = sum(said.lost for said in self.claims.values())
        counts["retries"] = sum(said.retries for said in self.claims.values())
        return counts


def device_at(
    port: str, *, answer_within_s: float | None = None, response_timeout_s: float = 2.0, **line: Any
) -> HostDriver:
    """Return the driver of the device at a port of this machine."""
    clock = MonotonicClock()
    settings = LineSettings(
        response_timeout_s=response_timeout_s, **{"open_timeout_s": response_timeout_s} | line
    )
    link = FrameLink(
        lambda: open_channel(port, clock, settings),
        clock,
        line=settings,
        answer_within_s=answer_within_s,
    )
    return HostDriver(link, limits=LIMITS, clock=clock)
