"""What the operator confirms before a real device may put anything out.

Software is not the safety device: what keeps a person safe is wired, and only a person can tell
that it is.
"""

from __future__ import annotations

import getpass
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from device.driver import Identity

QUESTION: Final = (
    "the amplifier's enable has a switch within the participant's and the operator's reach",
    "a current limit stands between the amplifier and the actuators",
    "the plate is bonded to protective earth, or insulated with its leakage measured",
)
"""What has to be so; docs/hardware.md says more."""


class NotConfirmedError(ValueError):
    """A real device that nobody has confirmed to be safe."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Confirmation:
    """The operator's word that what `QUESTION` lists is so.

    Attributes
    ----------
    by : str
        The user of the machine who gave it.
    at : str
        When, in UTC.
    how : str
        ``asked`` on a terminal, or by ``--confirm-hardware``.
    """

    by: str
    at: str
    how: str

    @property
    def facts(self) -> dict[str, Any]:
        """List what the record keeps of it."""
        return asdict(self) | {"confirmed": list(QUESTION)}


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
    """Refuse a real device without a confirmation.

    Parameters
    ----------
    identity : Identity
        What the opened device said of itself.
    confirmation : Confirmation or None
        The operator's.

    Raises
    ------
    NotConfirmedError
        If there is none and the device is no emulator.
    """
    if confirmation is None and not identity.emulated:
        raise NotConfirmedError(
            f"{identity.model} {identity.serial_number} drives real actuators: read "
            "docs/hardware.md, then give --confirm-hardware"
        )
