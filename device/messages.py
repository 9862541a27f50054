"""The messages to a device that carry more than a token, in the numbers a device counts in.

Their fields are checked with the refusals of the device, so that a message that exists is well
formed wherever it was made; whether it is allowed is for limits and states to say.
"""

from dataclasses import dataclass

from device.counts import CodeArray, check_millivolts, check_slot, check_token


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Load:
    """Store the codes of both channels in a slot.

    Parameters
    ----------
    slot : int
        0 to 7.
    left, right : ndarray of int32, shape (n,)
        Converter codes.

    Raises
    ------
    Rejected
        With code BAD_SLOT.

    Examples
    --------
    >>> import numpy as np
    >>> silence = np.zeros(4, dtype=np.int32)
    >>> Load(slot=8, left=silence, right=silence)
    Traceback (most recent call last):
    device.driver.Rejected: there is no such slot: 0 to 7, got 8
    """

    slot: int
    left: CodeArray
    right: CodeArray

    def __post_init__(self) -> None:
        check_slot(self.slot)


@dataclass(frozen=True, slots=True, kw_only=True)
class Levels:
    """Set the levels of both channels.

    Parameters
    ----------
    left_mvpp, right_mvpp : int
        Peak-to-peak millivolts at the actuator.

    Raises
    ------
    Rejected
        With code BAD_LEVEL.

    Examples
    --------
    >>> Levels(left_mvpp=130_000, right_mvpp=0).vpp
    (130.0, 0.0)
    """

    left_mvpp: int
    right_mvpp: int

    def __post_init__(self) -> None:
        check_millivolts(self.left_mvpp)
        check_millivolts(self.right_mvpp)

    @property
    def vpp(self) -> tuple[float, float]:
        """Left and right level in peak-to-peak volts."""
        return self.left_mvpp / 1000, self.right_mvpp / 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """Allow a token to play a slot for a while.

    Parameters
    ----------
    token : int
        1 to 2**64 - 1.
    slot : int
        0 to 7.
    time_to_live_us : int
        Microseconds from the device's receipt.

    Raises
    ------
    Rejected
        With code BAD_TOKEN or BAD_SLOT.

    Examples
    --------
    >>> Arm(token=0, slot=0, time_to_live_us=1000)
    Traceback (most recent call last):
    device.driver.Rejected: a token must be an integer from 1 to 2**64 - 1: got 0
    """

    token: int
    slot: int
    time_to_live_us: int

    def __post_init__(self) -> None:
        check_token(self.token)
        check_slot(self.slot)
