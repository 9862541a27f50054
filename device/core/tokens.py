"""What became of a token: the device's memory of bursts, and what a driver may conclude from it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from device.checks import require_whole
from device.clock import CLOCK_TOLERANCE
from device.driver import Delivery, Outcome


class Fate(StrEnum):
    """What the device knows of a token.

    `NEVER_ARMED` is said only where it is certain for this power cycle; a token that may have been
    forgotten is `UNKNOWN`.

    Examples
    --------
    >>> OUTCOMES[Fate.EXPIRED].value, OUTCOMES[Fate.UNKNOWN].value
    ('not_fired', 'indeterminate')
    """

    ARMED = "armed"
    FIRED = "fired"
    EXPIRED = "expired"
    ABORTED = "aborted"
    NEVER_ARMED = "never_armed"
    UNKNOWN = "unknown"


OUTCOMES = {
    Fate.ARMED: Outcome.INDETERMINATE,
    Fate.FIRED: Outcome.FIRED,
    Fate.EXPIRED: Outcome.NOT_FIRED,
    Fate.ABORTED: Outcome.NOT_FIRED,
    Fate.NEVER_ARMED: Outcome.NOT_FIRED,
    Fate.UNKNOWN: Outcome.INDETERMINATE,
}
"""What a driver reports for each fate. An armed token has not fired, but still can."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Record:
    """The device's record of one token.

    Parameters
    ----------
    token : int
        1 to 2**64 - 1.
    fate : Fate
        What became of it.
    start_us : int or None
        Onset on the device's clock in microseconds, if it fired.
    levels_mvpp : tuple of int
        Left and right level that were set, in peak-to-peak millivolts; 0 for a silent channel,
        and where it did not fire.

    Raises
    ------
    ValueError
        `start_us` contradicts the fate.

    Examples
    --------
    >>> Record(token=1, fate=Fate.EXPIRED).start_us is None
    True
    """

    token: int
    fate: Fate
    start_us: int | None = None
    levels_mvpp: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        if (self.fate is Fate.FIRED) is (self.start_us is None):
            raise ValueError(
                f"start_us must be given if FIRED and only then, got {self.start_us!r}"
            )


class TokenHistory:
    """The last records of a power cycle, and how certain their absence is.

    A full history drops its oldest record and remembers the largest token it ever dropped: a token
    above that mark that is not in the history was never here. Hosts that count their tokens
    upwards therefore get certain answers however long the device stays on; with tokens in any
    other order the answers turn into `UNKNOWN` once something was dropped, never into a wrong one.
    A token that was dropped can be armed again; that no token fires twice is the device's promise
    for `capacity` tokens, and the host's beyond, which makes each token once.

    Parameters
    ----------
    capacity : int
        Number of records kept.

    Raises
    ------
    ValueError
        `capacity` is below 1.

    Examples
    --------
    >>> history = TokenHistory(capacity=1)
    >>> history.absent(7).fate.value
    'never_armed'
    >>> for token in (7, 8):
    ...     history.keep(Record(token=token, fate=Fate.EXPIRED))
    >>> history.find(7) is None, history.absent(7).fate.value, history.absent(9).fate.value
    (True, 'unknown', 'never_armed')
    """

    def __init__(self, capacity: int) -> None:
        require_whole("capacity", capacity, least=1, most=2**31)
        self._capacity = capacity
        self._records: dict[int, Record] = {}
        self._dropped_up_to = 0

    def find(self, token: int) -> Record | None:
        """Return the record of a token, or None where there is none."""
        return self._records.get(token)

    def absent(self, token: int) -> Record:
        """Return what can be said of a token that has no record."""
        fate = Fate.UNKNOWN if token <= self._dropped_up_to else Fate.NEVER_ARMED
        return Record(token=token, fate=fate)

    def keep(self, record: Record) -> None:
        """Add the record of a token that has none, dropping the oldest if the history is full."""
        self._records[record.token] = record
        if len(self._records) > self._capacity:
            oldest = next(iter(self._records))
            del self._records[oldest]
            self._dropped_up_to = max(self._dropped_up_to, oldest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Exchange:
    """One question to the device and its answer, on both clocks.

    Parameters
    ----------
    record : Record
        The answer to FIRE or QUERY.
    boot_id : int
        Power cycle that answered.
    host_before_s, host_after_s : float
        Host clock readings between which the device answered: the question was sent after the
        first and the answer read before the second, or more is known.
    device_us : int
        Device clock when it answered.
    resolution_s : float
        Least step of the host clock.
    retries : int
        How often the question had to be sent again.

    Examples
    --------
    >>> Exchange(record=Record(token=1, fate=Fate.EXPIRED), boot_id=1, host_before_s=0.0,
    ...          host_after_s=0.5, device_us=9, resolution_s=0.0, retries=0).interval_s
    0.5
    """

    record: Record
    boot_id: int
    host_before_s: float
    host_after_s: float
    device_us: int
    resolution_s: float
    retries: int

    @property
    def interval_s(self) -> float:
        """Seconds from question to answer."""
        return self.host_after_s - self.host_before_s


def delivery(exchange: Exchange) -> Delivery:
    """Return what a driver reports for a record that it was told by the device.

    The onset of a burst that fired before the question is carried back to the host's clock by the
    device's: the interval moves by the time since the onset, and grows by `CLOCK_TOLERANCE` times
    that to both sides.

    Parameters
    ----------
    exchange : Exchange
        The record, and when it was asked for and answered.

    Returns
    -------
    Delivery
        With the outcome of `OUTCOMES`.

    Examples
    --------
    >>> fired = Record(token=1, fate=Fate.FIRED, start_us=1_000_000)
    >>> late = delivery(Exchange(record=fired, boot_id=1, host_before_s=5.0, host_after_s=5.5,
    ...                          device_us=3_000_000, resolution_s=0.0, retries=0))
    >>> round(late.host_before_s, 6), round(late.host_after_s, 6), round(late.uncertainty_s, 6)
    (2.9998, 3.5002, 0.2502)
    """
    record = exchange.record
    since_s = 0.0 if record.start_us is None else (exchange.device_us - record.start_us) / 1e6
    before_s = exchange.host_before_s - since_s / (1 - CLOCK_TOLERANCE)
    after_s = exchange.host_after_s - since_s / (1 + CLOCK_TOLERANCE)
    return Delivery(
        outcome=OUTCOMES[record.fate],
        token=record.token,
        boot_id=exchange.boot_id,
        device_us=record.start_us,
        host_before_s=before_s,
        host_after_s=after_s,
        uncertainty_s=(after_s - before_s) / 2 + exchange.resolution_s,
        retries=exchange.retries,
        level_left_vpp=record.levels_mvpp[0] / 1000,
        level_right_vpp=record.levels_mvpp[1] / 1000,
    )
