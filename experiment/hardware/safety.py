"""Whether a device may be used with a person: its kind, and the operator's confirmation.

Software is not the safety device: what keeps a person safe is wired, and only a person can confirm
that it is.
"""

from __future__ import annotations

import getpass
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from typing import TYPE_CHECKING, Final

from device.drivers import MOCK_MODEL

if TYPE_CHECKING:
    from device.driver import Identity
    from experiment.names import DeviceKind


class Purpose(StrEnum):
    """What a session is held for, where nothing may move."""

    DATA = "data"
    """Data; a person needs a real device."""
    PRACTICE = "practice"
    """A person tries the session out without a device, noise and feedback."""
    REHEARSAL = "rehearsal"
    """Everything plays as in a session for data, but without a device; no analysis accepts it."""

    def plays_noise(self, *, simulated: bool) -> bool:
        """Return whether a study's noise plays: for a person and data, and in every rehearsal."""
        return self is Purpose.REHEARSAL or (self is Purpose.DATA and not simulated)


def device_kind(identity: Identity, purpose: Purpose = Purpose.DATA) -> DeviceKind:
    """Return ``real``, ``mock`` or ``emulated``, as the opened device identifies itself.

    In a rehearsal it is ``rehearsal``, by which every reader of the record knows it.

    >>> from device.clock import VirtualClock
    >>> from experiment.study.files import paper_study
    >>> from experiment.hardware.setup import mock_device
    >>> device_kind(mock_device(paper_study(), VirtualClock()).open())
    'mock'
    """
    if purpose is Purpose.REHEARSAL:
        return "rehearsal"
    if not identity.emulated:
        return "real"
    return "mock" if identity.model == MOCK_MODEL else "emulated"


def require_device(*, is_real: bool, simulated: bool, purpose: Purpose) -> None:
    """Raise ValueError if the device does not suit the participant and the purpose.

    Examples
    --------
    >>> require_device(is_real=False, simulated=False, purpose=Purpose.DATA)
    Traceback (most recent call last):
    ValueError: the device is a mock or an emulator, which ...
    """
    if is_real and purpose is not Purpose.DATA:
        option = {Purpose.PRACTICE: "--practice-without-device", Purpose.REHEARSAL: "--rehearse"}
        raise ValueError(
            f"{option[purpose]} needs the mock device or an emulator, and this device is real: "
            "omit --driver and --port to use the mock"
        )
    if not is_real and not simulated and purpose is Purpose.DATA:
        raise ValueError(
            "the device is a mock or an emulator, which moves nothing: give --driver and --port of "
            "a real device, or --practice-without-device to try the session out (no analysis "
            "counts it by default), or --rehearse to try its equipment (no analysis counts it)"
        )


SAFETY_CONDITIONS: Final = (
    "the amplifier's enable has a switch within the participant's and the operator's reach",
    "a current limiter is installed between the amplifier and the actuators",
    "the plate is bonded to protective earth, or insulated with its leakage measured",
)
"""What the operator confirms; docs/hardware.md says more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """The operator's confirmation of the `SAFETY_CONDITIONS`.

    Attributes
    ----------
    by : str
        The user of the machine who gave it.
    at : str
        When, in UTC.
    how : str
        ``asked`` on a terminal, or ``--confirm-hardware``.
    confirmed : tuple of str
        What was confirmed.
    """

    by: str
    at: str
    how: str
    confirmed: tuple[str, ...] = SAFETY_CONDITIONS


def confirmed_now(how: str) -> Confirmation:
    """Return the confirmation that is given at this moment.

    Examples
    --------
    >>> confirmed_now("asked").how
    'asked'
    """
    try:
        user = getpass.getuser()
    except (OSError, KeyError, ImportError):  # a user without a name
        user = "unknown"
    return Confirmation(by=user, at=datetime.now(UTC).isoformat(timespec="seconds"), how=how)


def require_confirmed(identity: Identity, confirmation: Confirmation | None) -> None:
    """Raise ValueError for an opened real device without a confirmation."""
    if confirmation is None and not identity.emulated:
        raise ValueError(
            f"{identity.model} {identity.serial_number} drives real actuators: read "
            "docs/hardware.md, then give --confirm-hardware"
        )
