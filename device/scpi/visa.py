"""Channels to instruments: those of the wire, and VISA (USBTMC, VXI-11, HiSLIP) through pyvisa.

pyvisa is imported only when such a channel is opened.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import socket
from importlib.util import find_spec
from threading import Lock
from typing import TYPE_CHECKING, Final

from device.driver import Lack, installing
from device.errors import LinkError
from device.wire.channels import USUAL, Channel, LineSettings, open_channel, port_lack

if TYPE_CHECKING:
    from collections.abc import Iterator

    from device.clock import Clock

SCHEME: Final = "visa:"
"""Prefix of the name of a VISA resource."""

_REMEDY: Final = installing("visa")
_LIBRARY: Final = "PYVISA_LIBRARY"
_PURE_PYTHON: Final = "@py"
_OPEN_WITHIN_MS: Final = 5000
_WRITE_WITHIN_MS: Final = 5000
_TURN_S: Final = 0.05


class VisaChannel:
    """A `channels.Channel` to a VISA resource: what is written at once is one message.

    No termination character ends a message or an answer, END does; only a raw socket has no END.
    Nothing is read that was not asked for: an instrument takes that for an error of its user's.

    >>> from device.clock import MonotonicClock
    >>> VisaChannel("visa:nothing", MonotonicClock())
    Traceback (most recent call last):
    device.errors.LinkError: cannot open visa:nothing: ...
    """

    def __init__(self, port: str, clock: Clock) -> None:
        try:
            import pyvisa
        except ImportError as error:
            raise LinkError(f"cannot open {port}: VISA needs pyvisa: {_REMEDY}") from error
        self._port = port
        self._clock = clock
        self._timed_out = pyvisa.constants.StatusCode.error_timeout
        self._failed = pyvisa.errors.VisaIOError
        name = port[len(SCHEME) :]
        # pyvisa-py prints what some instruments prefer; a command's output is not its place
        with contextlib.redirect_stdout(io.StringIO()), _as_link_error(f"cannot open {port}"):
            _require_host(name)
            manager = pyvisa.ResourceManager(os.environ.get(_LIBRARY, _PURE_PYTHON))
            line = manager.open_resource(name, open_timeout=_OPEN_WITHIN_MS)
            if not isinstance(line, pyvisa.resources.MessageBasedResource):
                line.close()
                raise TypeError("it takes no messages")
            if line.resource_class == "SOCKET":
                line.read_termination = "\n"
        self._line = line
        self._next, self._turn = Lock(), Lock()
        # A VXI-11 connection carries one call at a time: a read gives way to what others write.
        calls = name.upper().startswith("TCPIP") and line.resource_class == "INSTR"
        self._gives_way = calls and "::HISLIP" not in name.upper()

    def write(self, data: bytes) -> None:
        """Send a message."""
        with self._next, self._turn, _as_link_error(f"the line to {self._port} is gone"):
            self._line.timeout = _WRITE_WITHIN_MS
            self._line.write_raw(data)

    def read(self, timeout_s: float) -> bytes:
        """Wait for an answer, or a part of it; nothing after `timeout_s`."""
        until_s = self._clock.now_s() + timeout_s
        while (left_s := until_s - self._clock.now_s()) > 0.0:
            if not self._gives_way:
                return self._answer(left_s)
            with self._next:  # a thread that waits to write goes first
                pass
            with self._turn:
                answer = self._answer(min(left_s, _TURN_S))
            if answer:
                return answer
        return b""

    def close(self) -> None:
        """Close the line."""
        with contextlib.suppress(LinkError), _as_link_error("closing"):
            self._line.close()

    def _answer(self, within_s: float) -> bytes:
        with _as_link_error(f"the line to {self._port} is gone"):
            self._line.timeout = math.ceil(1000 * within_s)
            try:
                return self._line.read_raw()
            except self._failed as error:
                if error.error_code != self._timed_out:
                    raise
                return b""


def _require_host(name: str) -> None:
    """Refuse a host that has no address: pyvisa-py fails later, and does not say of what."""
    bus, _, rest = name.partition("::")
    if bus.upper().startswith("TCPIP"):
        socket.getaddrinfo(rest.split("::")[0].split(",")[0], None)


@contextlib.contextmanager
def _as_link_error(what: str) -> Iterator[None]:
    """Say in one line what failed: beneath pyvisa anything may be raised."""
    try:
        yield
    except Exception as error:
        raise LinkError(f"{what}: {' '.join(str(error).split())}") from error


def open_instrument(port: str, clock: Clock, line: LineSettings = USUAL) -> Channel:
    """Return the channel to an instrument, on a port or behind VISA.

    >>> from device.clock import MonotonicClock
    >>> open_instrument("TCPIP::192.168.1.5::INSTR", MonotonicClock())
    Traceback (most recent call last):
    device.errors.LinkError: cannot open TCPIP::192.168.1.5::INSTR: a VISA resource is written
    visa:TCPIP::192.168.1.5::INSTR
    """
    if is_resource(port):
        return VisaChannel(port, clock)
    if "::" in port and "://" not in port:
        raise LinkError(f"cannot open {port}: a VISA resource is written {SCHEME}{port}")
    return open_channel(port, clock, line)


def instrument_lack(port: str) -> Lack | None:
    """Return what this machine lacks to open an instrument's port; it is not opened."""
    if not is_resource(port):
        return port_lack(port)
    needs = {"pyvisa": "pyvisa", "pyvisa_py": "pyvisa-py"}
    if port[len(SCHEME) :].upper().startswith("USB"):
        needs |= {"usb": "pyusb"}
    missing = [name for module, name in needs.items() if find_spec(module) is None]
    return Lack(what=missing[0], remedy=_REMEDY) if missing else None


def is_resource(port: str) -> bool:
    """Return whether a port names a VISA resource."""
    return port.lower().startswith(SCHEME)
