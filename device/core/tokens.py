"""What became of a token: the device's memory of bursts, and what a driver may conclude from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Generic, TypeAlias, TypeVar

from device.checks import require_whole
from device.clock import CLOCK_TOLERANCE
from device.driver import Delivery, Outcome
from device.errors import Refusal

Fate: TypeAlias = tuple[Outcome, Refusal | None]
"""Outcome of a token, and why it has not fired."""

Reply = TypeVar("Reply")
"""What a message is answered with: the record of a token, or nothing but that it was done."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """The device's record of one token.

    Attributes
    ----------
    token : int
        Of the burst.
    outcome : Outcome
        INDETERMINATE while the token is armed, and where the device may have forgotten it.
    reason : Refusal or None
        Why it has not fired: EXPIRED, ABORTED, NOT_ARMED (it never was, in this power cycle) or
        ALREADY_ARMED (it still can); None where it fired, or may have.
    start_us : int or None
        Onset on the device's clock if it fired, and only then.
    levels_mvpp : tuple of int
        Level of each channel that was set, 0 for a silent one; empty where it did not fire.
    """

    token: int
    outcome: Outcome
    reason: Refusal | None = None
    start_us: int | None = None
    levels_mvpp: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if (self.outcome is Outcome.FIRED) is (self.start_us is None):
            raise ValueError(
                f"start_us must be given if FIRED and only then, got {self.start_us!r}"
            )

    @property
    def fate(self) -> Fate:
        """Outcome and reason, which the wire carries as one number."""
        return self.outcome, self.reason

    @classmethod
    def unknown(cls, token: int) -> Record:
        """Return the record of a token that may or may not have fired.

        >>> Record.unknown(7).outcome.value
        'indeterminate'
        """
        return cls(token=token, outcome=Outcome.INDETERMINATE)

    @classmethod
    def not_fired(cls, token: int, reason: Refusal) -> Record:
        """Return the record of a token that has surely not fired.

        >>> Record.not_fired(7, Refusal.EXPIRED).outcome.value
        'not_fired'
        """
        return cls(token=token, outcome=Outcome.NOT_FIRED, reason=reason)


# A device has little memory, and a host may ask for a token hours after it fired, if it
# crashed. The danger is not to forget but to say "never armed" of what was forgotten: a burst
# that was felt would be presented again. Hence the mark: up to the largest token ever dropped
# absence means nothing, and hosts count upwards, so that what they ask for lies above it.
class TokenHistory:
    """The last `capacity` records of a power cycle, and how certain their absence is.

    A full history drops its oldest record and remembers the largest token it ever dropped: a token
    above that mark that is not in the history was never here. With tokens in any other order than
    upwards the answers turn into INDETERMINATE once something was dropped, never into a wrong one.
    A token that was dropped can be armed again; that no token fires twice is the device's promise
    for `capacity` tokens, and the host's beyond, which makes each token once.

    >>> history = TokenHistory(capacity=1)
    >>> history.absent(7).outcome.value
    'not_fired'
    >>> for token in (7, 8):
    ...     history.keep(Record.not_fired(token, Refusal.EXPIRED))
    >>> history.find(7) is None, history.absent(7).outcome.value, history.absent(9).outcome.value
    (True, 'indeterminate', 'not_fired')
    """

    def __init__(self, capacity: int) -> None:
        require_whole("capacity", capacity, minimum=1, maximum=2**31)
        self._capacity = capacity
        self._records: dict[int, Record] = {}
        self._dropped_up_to = 0

    def find(self, token: int) -> Record | None:
        """Return the record of a token, or None where there is none."""
        return self._records.get(token)

    def absent(self, token: int) -> Record:
        """Return what can be said of a token that has no record."""
        if token <= self._dropped_up_to:
            return Record.unknown(token)
        return Record.not_fired(token, Refusal.NOT_ARMED)

    def keep(self, record: Record) -> None:
        """Add the record of a token that has none, dropping the oldest if the history is full."""
        self._records[record.token] = record
        if len(self._records) > self._capacity:
            oldest = next(iter(self._records))
            del self._records[oldest]
            self._dropped_up_to = max(self._dropped_up_to, oldest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange(Generic[Reply]):
    """One message to the device and its answer, on both clocks.

    The device answered between the two readings of the host's clock: the message was sent after
    the first and the answer read before the second, or more is known. `device_us` is its own clock
    when it answered, and `retries` how often the message had to be sent again. No burst of its
    record began before `not_before_s`.
    """

    record: Reply
    boot_id: int
    host_before_s: float
    host_after_s: float
    device_us: int = 0
    retries: int = 0
    not_before_s: float = -math.inf


def delivery(exchange: Exchange[Record], channels: int) -> Delivery:
    """Return what a driver reports for a record that the device sent, with so many levels.

    The onset of a burst that fired before the question is carried back to the host's clock by the
    device's. The interval moves by the time since the onset, and grows by `CLOCK_TOLERANCE` times
    that to both sides.

    >>> fired = Record(token=1, outcome=Outcome.FIRED, start_us=1_000_000)
    >>> late = delivery(Exchange(record=fired, boot_id=1, host_before_s=5.0, host_after_s=5.5,
    ...                          device_us=3_000_000), channels=2)
    >>> round(late.host_before_s, 6), round(late.host_after_s, 6), round(late.uncertainty_s, 6)
    (2.9998, 3.5002, 0.2502)
    """
    record = exchange.record
    since_s = 0.0 if record.start_us is None else (exchange.device_us - record.start_us) / 1e6
    after_s = exchange.host_after_s - since_s / (1 + CLOCK_TOLERANCE)
    before_s = exchange.host_before_s - since_s / (1 - CLOCK_TOLERANCE)
    before_s = min(max(before_s, exchange.not_before_s), after_s)
    return Delivery(
        outcome=record.outcome,
        token=record.token,
        boot_id=exchange.boot_id,
        device_us=record.start_us,
        host_before_s=before_s,
        host_after_s=after_s,
        uncertainty_s=(after_s - before_s) / 2,
        retries=exchange.retries,
        levels_vpp=tuple(level_mvpp / 1000 for level_mvpp in record.levels_mvpp[:channels]),
    )
