"""The one line of plain text on a wire of frames: a terminal asks who is there."""

import string
from typing import Final

from device.driver import Identity

QUESTION: Final = b"*IDN?"
"""Followed by a line feed, with or without a carriage return before it."""

MAKER: Final = "tactstrip"
"""With this the answer begins."""

_TEXT: Final = string.printable.encode("ascii")
_KEPT: Final = len(QUESTION) + 2


class IdentityLine:
    r"""Answers ``*IDN?`` where it cannot be a part of a frame.

    That is where everything since the last delimiter is text: a frame has its version, which is
    not text, as the second byte after one.

    Parameters
    ----------
    identity : Identity
        Of the device.

    Examples
    --------
    >>> line = IdentityLine(Identity(model="m", serial_number="1", boot_id=5,
    ...                              protocol_version="1.0", sample_rate_hz=48e3, bits=16,
    ...                              channels=2, ceiling_vpp=200.0, longest_waveform=4096,
    ...                              emulated=True))
    >>> line.feed(b"*ID"), line.feed(b"N?\r\n")
    (b'', b'tactstrip,m,1,protocol 1.0\n')
    >>> line.feed(b"\0\x20\x01\n*IDN?\n")
    b''
    """

    def __init__(self, identity: Identity) -> None:
        facts = (identity.model, identity.serial_number, f"protocol {identity.protocol_version}")
        self._answer = ",".join((MAKER, *facts)).encode("ascii", "replace") + b"\n"
        self._is_text = True
        self._line = b""

    def feed(self, data: bytes) -> bytes:
        """Take bytes from the line and return the answers to the questions in them."""
        first, *after_delimiter = data.split(b"\0")
        asked = self._asked(first)
        for part in after_delimiter:
            self._is_text, self._line = True, b""
            asked += self._asked(part)
        return asked * self._answer

    def _asked(self, part: bytes) -> int:
        self._is_text = self._is_text and not part.translate(None, _TEXT)
        if not self._is_text:
            return 0
        *lines, rest = (self._line + part).split(b"\n")
        self._line = rest[:_KEPT]
        return sum(line.rstrip() == QUESTION for line in lines)
