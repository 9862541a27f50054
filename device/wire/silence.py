"""Why a device does not answer, or too late: what the operator can do about it, in one line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from device.wire.frames import MAKER, MINOR, QUESTION, VERSION

if TYPE_CHECKING:
    from device.clock import Clock
    from device.wire.channels import Channel

BITS_PER_BYTE: Final = 10
"""On a serial line: a start bit, eight of data, a stop bit."""

LONGEST_ROUND: Final = 104
"""Bytes of HELLO and its answer: the longest that a line carries for one question."""

_RATES: Final = (
    *(1200, 2400, 4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600),
    *(1_000_000, 2_000_000, 3_000_000, 4_000_000),
)


def plain_answer(channel: Channel, clock: Clock, within_s: float) -> str:
    """Ask in plain text who is there and return what is said, "" where nothing can be read."""
    channel.write(b"\0" + QUESTION + b"\n")
    until_s, said = clock.now_s() + within_s, b""
    while (left_s := until_s - clock.now_s()) > 0 and not _is_said(said):
        said += channel.read(left_s)
    lines = (line.rsplit(b"\0", 1)[-1].strip() for line in said.split(b"\n"))
    return next((line.decode() for line in lines if line and line.isascii()), "")


def _is_said(said: bytes) -> bool:
    return said.endswith(b"\n") and MAKER.encode() in said


def why_silent(answer: str, *, opens_within_s: float, baud: int) -> str:
    """Tell what a device that answered no HELLO lacks, by what it says in plain text.

    >>> why_silent("tactstrip,lab,7,protocol 1.0", opens_within_s=2.0, baud=115_200)
    'it speaks protocol 1.0 and this program 2.0; put firmware of protocol 2 on it'
    """
    maker, _, rest = answer.partition(",")
    if maker != MAKER:
        other = f"{answer[:80]!r} answers, which is no device of tactstrip" if answer else ""
        return other or (
            "is it switched on? Where it starts anew whenever its port is opened, let "
            f"device.opens_within_s be more than {opens_within_s:g}, or device.dtr be false; "
            f"where its rate is another than {baud}, give device.baud"
        )
    version = rest.rpartition("protocol ")[2]
    if version.partition(".")[0] == str(VERSION):
        return (
            f"it answers now, so that it took longer to start; let device.opens_within_s be more "
            f"than {opens_within_s:g}"
        )
    return (
        f"it speaks protocol {version} and this program {VERSION}.{MINOR}; put firmware of "
        f"protocol {VERSION} on it"
    )


def too_slow(took_s: float, within_s: float, baud: int) -> str:
    """Tell which rate a line has, and which it should have.

    >>> too_slow(0.108, 0.025, 115_200)
    'the line is too slow: the longest question and its answer took 108 ms, at device.baud = 115200
    25 ms are allowed; that is a line of about 9600 baud: give device.baud = 9600, or let both ends
    have 57600 or more'
    """
    bits = LONGEST_ROUND * BITS_PER_BYTE
    is_about = min(_RATES, key=lambda rate: abs(rate - bits / took_s))
    enough = next((rate for rate in _RATES if bits / rate < 0.8 * within_s), _RATES[-1])
    return (
        f"the line is too slow: the longest question and its answer took {took_s * 1e3:.0f} ms, at "
        f"device.baud = {baud} {within_s * 1e3:.0f} ms are allowed; that is a line of about "
        f"{is_about} baud: give device.baud = {is_about}, or let both ends have {enough} or more"
    )
