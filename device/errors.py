"""Errors of devices: numbered refusals, and failures of the link or the hardware."""

from __future__ import annotations

from enum import IntEnum
from typing import Final, Self

from device.printing import shown

WATCHDOG_S: Final = 0.5
"""After this time without a heartbeat, a device switches its outputs off."""


class Refusal(IntEnum):
    """Why a step was refused; the number is what the wire carries and never changes its meaning.

    Examples
    --------
    >>> Refusal(9) is Refusal.DC
    True
    >>> Refusal.EMPTY_SLOT.text
    'nothing is loaded in that slot'
    """

    text: str

    def __new__(cls, number: int, text: str) -> Self:
        """Make a member from its number on the wire and its sentence."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.text = text
        return member

    BAD_SLOT = 1, "there is no such slot"
    EMPTY_SLOT = 2, "nothing is loaded in that slot"
    WAVEFORM_EMPTY = 3, "a waveform needs at least one sample"
    WAVEFORM_TOO_LONG = 4, "the waveform is too long"
    WRONG_CHANNELS = 5, "each channel needs a waveform and a level"
    NOT_FINITE = 6, "a sample is not finite"
    OUT_OF_RANGE = 7, "a sample is outside [-1, 1]"
    EDGES_NOT_ZERO = 8, "a waveform must begin and end at exactly 0"
    DC = 9, "the waveform has a DC part (a unipolar click has one)"
    CEILING = 10, "peak x level is above the ceiling"
    BAD_LEVEL = 11, "a level must be a finite number of volts, 0 or more"
    BAD_TOKEN = 12, "a token must be an integer from 1 to 2**64 - 1"
    TOKEN_SPENT = 13, "that token was used before"
    WRONG_TOKEN = 14, "another token is armed"
    NOT_ARMED = 15, "nothing is armed"
    EXPIRED = 16, "that token's time to live is over"
    ABORTED = 17, "that token was disarmed"
    ALREADY_ARMED = 18, "a token is armed: fire or disarm it first"
    BUSY = 19, "a burst is still playing, or being measured"
    LEAST_INTERVAL = 20, "the last burst ended too short a time ago"
    DUTY = 21, "the duty limit asks for a longer rest"
    BAD_TIME_TO_LIVE = 22, "the time to live is out of range"
    SAFE_STATE = 23, "the output was stopped: enable it first"
    NOT_ENABLED = 24, "the output is not enabled"
    NOTHING_LOADED = 25, "no waveform is loaded"
    NOT_OPEN = 26, "the device is not open"
    ALREADY_OPEN = 27, "the device is open already"
    WRONG_BOOT = 28, "the message is meant for another power cycle"
    BAD_UPLOAD = 29, "the waveform arrived incomplete or damaged"
    BAD_MESSAGE = 30, "the message is malformed"
    STALE = 31, "a later message was answered already"
    AMPLIFIER_OFF = 32, "the amplifier is off: its safety switch is open"
    MEMORY_FULL = 33, "the waveforms in all slots together are too long"
    WATCHDOG_STOP = 34, "the device received nothing for 500 ms and switched its outputs off"
    OVERLOAD_STOP = 35, "the amplifier reported an over-current, and the outputs were switched off"
    LINE_STOP = 36, "the line to the device was interrupted, and it switched its outputs off"


def error_line(error: Exception) -> str:
    r"""Return what another library raised in one line, with its type.

    >>> error_line(OSError("no\n such port"))
    'OSError: no such port'
    """
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


class DeviceError(Exception):
    """Anything that went wrong with a device.

    Examples
    --------
    >>> issubclass(LinkError, DeviceError) and issubclass(LimitExceeded, Rejected)
    True
    """


class LinkError(DeviceError):
    """The device cannot be reached, or another device or power cycle answers.

    Examples
    --------
    >>> raise LinkError("the device restarted")
    Traceback (most recent call last):
    device.errors.LinkError: the device restarted
    """


class PortError(ValueError):
    """A port whose form no driver opens.

    Parameters
    ----------
    port : str
        The port; an attribute of the error.

    Examples
    --------
    >>> raise PortError("spy:///dev/ttyACM0")
    Traceback (most recent call last):
    device.errors.PortError: port must be a device path, COMn, socket://HOST:PORT,
    rfc2217://HOST:PORT or visa:RESOURCE; got 'spy:///dev/ttyACM0'
    """

    rule = "must be a device path, COMn, socket://HOST:PORT, rfc2217://HOST:PORT or visa:RESOURCE"

    def __init__(self, port: str) -> None:
        super().__init__(f"port {self.rule}; got {shown(port)}")
        self.port = port


class SoundCardError(LinkError):
    """A sound card that cannot be opened or started.

    Parameters
    ----------
    card : str
        Its name; empty for the system's default. An attribute of the error, as the others.
    step : str
        ``open`` or ``start``.
    reason : str
        What PortAudio says.
    code : int or None
        PortAudio's error number, if it gave one.

    Examples
    --------
    >>> error = SoundCardError(card="", step="open", reason="busy", code=-9985)
    >>> print(error, error.code)
    cannot open the sound card default: busy -9985
    """

    def __init__(self, *, card: str, step: str, reason: str, code: int | None) -> None:
        super().__init__(f"cannot {step} the sound card {card or 'default'}: {reason}")
        self.card, self.step, self.reason, self.code = card, step, reason, code


class SettingError(DeviceError):
    """A device that did not take a setting, or reports a fault of its own; nothing was played.

    Examples
    --------
    >>> raise SettingError("the generator has another load")
    Traceback (most recent call last):
    device.errors.SettingError: the generator has another load
    """


class RefusedError(DeviceError):
    """A step that was refused, with the reason as `code`; nothing changed.

    Parameters
    ----------
    code : Refusal
        The reason; an attribute of the error.
    detail : str
        The values that were refused.

    Examples
    --------
    >>> RefusedError(Refusal.BAD_SLOT).code.name
    'BAD_SLOT'
    """

    def __init__(self, code: Refusal, detail: str = "") -> None:
        super().__init__(f"{code.text}: {detail}" if detail else code.text)
        self.code = code


class Rejected(RefusedError):  # noqa: N818 - "rejected" is the device's answer, not a fault
    """A refusal by the device, or by the same rule on the host.

    Parameters
    ----------
    code : Refusal
        The reason; an attribute of the error.
    detail : str
        What makes the sentence of the code concrete.

    Examples
    --------
    >>> Rejected(Refusal.BUSY).code.name
    'BUSY'
    """


class LimitExceeded(Rejected):
    """A waveform, level or timing that the limits forbid; refused, never clipped.

    Parameters
    ----------
    code : Refusal
        The reason; an attribute of the error.
    detail : str
        What makes the sentence of the code concrete.

    Examples
    --------
    >>> print(LimitExceeded(Refusal.CEILING, "210 > 200 Vpp"))
    peak x level is above the ceiling: 210 > 200 Vpp
    """


_LIMIT_CODES = frozenset(
    {
        Refusal.WAVEFORM_TOO_LONG,
        Refusal.MEMORY_FULL,
        Refusal.OUT_OF_RANGE,
        Refusal.EDGES_NOT_ZERO,
        Refusal.DC,
        Refusal.CEILING,
        Refusal.LEAST_INTERVAL,
        Refusal.DUTY,
    }
)


def rejection(code: Refusal, detail: str = "") -> Rejected:
    """Return the exception for a code, ready to be raised.

    `detail` makes the sentence of the code concrete.

    >>> type(rejection(Refusal.DUTY)).__name__, type(rejection(Refusal.BUSY)).__name__
    ('LimitExceeded', 'Rejected')
    """
    return (LimitExceeded if code in _LIMIT_CODES else Rejected)(code, detail)
