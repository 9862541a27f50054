"""An emulated generator behind HiSLIP, VXI-11, USBTMC or a socket; pyvisa is at the other end.

The buses are written from the protocols' documents (IVI-6.1, VXI-11, USBTMC 1.0), as the `Line` of
an emulator.
"""

from __future__ import annotations

import errno
import io
import json
import select
import socket
import struct
import threading
import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

import usb
from usb.backend import IBackend, libusb1

from device.emulate.generator import GeneratorEmulator
from device.emulate.lines import TcpLine

if TYPE_CHECKING:
    from collections.abc import Callable

    import pytest

    from device.emulate.lines import Line

INTERRUPTED: Final = '-410,"Query INTERRUPTED"'
HOST: Final = "127.0.0.1"
LARGEST: Final = 64
"""Bytes that a bus takes in a piece of a message."""


class Instrument:
    """A generator at work behind a bus: what it was sent, and an answer that is held back.

    As IEEE 488.2 asks of it (6.3.2.3), it drops an answer that the next message overtakes, and
    reports that as an error.
    """

    def __init__(self, bus: Line, *, gain: float, reports: bool = True) -> None:
        self.name = bus.name
        self.received = b""
        self.holds_back = False
        self.on_message: Callable[[bytes], None] = lambda message: None
        self.truth = io.StringIO()
        self._bus = bus
        self._reports = reports
        self._held = b""
        self._over = threading.Event()
        self._emulator = GeneratorEmulator(self, self.truth, amplifier_gain=gain)
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        while not self._over.is_set():
            self._emulator.turn()

    def read(self, timeout_s: float) -> bytes | None:
        message = self._bus.read(timeout_s)
        if message:
            self.received += message
            self.on_message(message)
            if self._held:
                self._held, self.holds_back = b"", False
                if self._reports:
                    self._emulator._generator._fail(INTERRUPTED)
        return message

    def write(self, data: bytes) -> None:
        if self.holds_back:
            self._held += data
        else:
            self._bus.write(data)

    def drop(self) -> None:
        self._bus.drop()

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._bus.close()

    def events(self, kind: str, least: int = 0) -> list[dict[str, Any]]:
        """Return what the truth file says, once it says so much."""
        give_up_s = time.monotonic() + 10.0
        while True:
            events = [json.loads(line) for line in self.truth.getvalue().splitlines()]
            found = [event for event in events if event["event"] == kind]
            if len(found) >= least or time.monotonic() > give_up_s:
                return found
            time.sleep(0.002)


class _Server:
    """A port of this machine; a bus says what the bytes of its connections mean."""

    def __init__(self) -> None:
        self._server = socket.create_server((HOST, 0))
        self.port = int(self._server.getsockname()[1])
        self._heard: dict[socket.socket, bytes] = {}

    def read(self, timeout_s: float) -> bytes | None:
        readable, _, _ = select.select([self._server, *self._heard], [], [], timeout_s)
        message = b""
        for one in readable:
            if one is self._server:
                self._heard[one.accept()[0]] = b""
            elif chunk := one.recv(65_536):
                self._heard[one] += chunk
                message += self._take(one)
            else:
                self.drop()
                break
        return message if self._heard else None

    def _take(self, line: socket.socket) -> bytes:
        raise NotImplementedError

    def _cut(self, line: socket.socket, size: int) -> bytes:
        taken, self._heard[line] = self._heard[line][:size], self._heard[line][size:]
        return taken

    def drop(self) -> None:
        for line in self._heard:
            line.close()
        self._heard.clear()

    def close(self) -> None:
        self.drop()
        self._server.close()


class HislipBus(_Server):
    """Two connections of one session, answers with the number of the message that asked."""

    _HEADER = struct.Struct(">2sBBIQ")

    def __init__(self) -> None:
        super().__init__()
        self.name = f"visa:TCPIP::{HOST}::hislip0,{self.port}::INSTR"
        self._sync: socket.socket | None = None
        self._message, self._asked = b"", 0

    def _take(self, line: socket.socket) -> bytes:
        data = b""
        while len(self._heard[line]) >= self._HEADER.size:
            _, kind, _, number, size = self._HEADER.unpack(self._heard[line][: self._HEADER.size])
            if len(self._heard[line]) < self._HEADER.size + size:
                break
            payload = self._cut(line, self._HEADER.size + size)[self._HEADER.size :]
            if kind == 0:  # Initialize: version 1.0, session 1
                self._sync = line
                self._say(line, 1, 0x0100_0001, control=1)  # it prefers overlap mode
            elif kind == 17:  # AsyncInitialize
                self._say(line, 18, 0)
            elif kind == 15:  # AsyncMaxMsgSize
                self._say(line, 16, 0, struct.pack(">Q", self._HEADER.size + LARGEST))
            elif kind in {6, 7}:  # Data, DataEnd
                assert size <= LARGEST
                self._message, self._asked = self._message + payload, number
                if kind == 7:
                    data, self._message = data + self._message, b""
        return data

    def _say(
        self, line: socket.socket, kind: int, number: int, payload: bytes = b"", control: int = 0
    ) -> None:
        line.sendall(self._HEADER.pack(b"HS", kind, control, number, len(payload)) + payload)

    def write(self, data: bytes) -> None:
        assert self._sync is not None
        self._say(self._sync, 7, self._asked, data)


class Vxi11Bus(_Server):
    """Remote procedure calls, one at a time."""

    def __init__(self) -> None:
        super().__init__()
        self.name = f"visa:TCPIP::{HOST},{self.port}::inst0::INSTR"
        self._message = self._answer = b""
        self._asking: tuple[socket.socket, int, float] | None = None

    def read(self, timeout_s: float) -> bytes | None:
        message = super().read(timeout_s)
        if self._asking is not None and time.monotonic() > self._asking[2]:
            self._reply(struct.pack(">III", 15, 0, 0))  # I/O timeout
        return message

    def _take(self, line: socket.socket) -> bytes:
        whole = b""
        while len(self._heard[line]) >= 4:
            size = int.from_bytes(self._heard[line][:4], "big") & 0x7FFF_FFFF
            if len(self._heard[line]) < 4 + size:
                break
            call = self._cut(line, 4 + size)[4:]
            xid, procedure = struct.unpack(">I16xI", call[:24])
            self._asking = line, xid, float("inf")
            whole += self._do(procedure, call[40:])
        return whole

    def _do(self, procedure: int, arguments: bytes) -> bytes:
        whole = b""
        if procedure == 10:  # create_link
            self._reply(struct.pack(">IIII", 0, 1, 0, LARGEST))
        elif procedure == 11:  # device_write
            flags, size = struct.unpack(">12xII", arguments[:20])
            self._message += arguments[20 : 20 + size]
            if flags & 8:  # END
                whole, self._message = self._message, b""
            self._reply(struct.pack(">II", 0, size))
        elif procedure == 12:  # device_read
            (within_ms,) = struct.unpack(">8xI", arguments[:12])
            assert self._asking is not None
            self._asking = *self._asking[:2], time.monotonic() + within_ms / 1000
            self._tell()
        else:  # destroy_link
            self._reply(struct.pack(">I", 0))
        return whole

    def _reply(self, result: bytes) -> None:
        assert self._asking is not None
        (line, xid, _), self._asking = self._asking, None
        record = struct.pack(">6I", xid, 1, 0, 0, 0, 0) + result
        line.sendall(struct.pack(">I", 0x8000_0000 | len(record)) + record)

    def _tell(self) -> None:
        if self._asking is not None and self._answer:
            answer, self._answer = self._answer, b""
            padding = bytes(-len(answer) % 4)
            self._reply(struct.pack(">III", 0, 4, len(answer)) + answer + padding)

    def write(self, data: bytes) -> None:
        self._answer += data
        self._tell()


class _Descriptor(SimpleNamespace):
    """What is not stated of a USB device is 0."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return 0


class UsbBus(IBackend):  # type: ignore[misc] # pyusb has no types
    """A bus of this process with one USBTMC device."""

    SERIAL: Final = "MY1"
    _OUT, _IN = 0x01, 0x82

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.name = f"visa:USB0::0x0957::0x2c07::{self.SERIAL}::INSTR"
        self._news = threading.Condition()
        self._message = self._whole = self._answer = b""
        self._tag = 0
        self._there = True
        monkeypatch.setattr(libusb1, "get_backend", lambda find_library=None: self)

    def read(self, timeout_s: float) -> bytes:
        with self._news:
            self._news.wait_for(lambda: self._whole, timeout_s)
            whole, self._whole = self._whole, b""
        return whole

    def write(self, data: bytes) -> None:
        with self._news:
            self._answer += data
            self._news.notify_all()

    def drop(self) -> None:
        with self._news:
            self._there = False
            self._news.notify_all()

    close = drop

    def bulk_write(self, handle: Any, ep: int, intf: Any, data: Any, timeout: int) -> int:
        kind, tag, size, end = struct.unpack("<BBxxIB", bytes(data[:9]))
        with self._news:
            self._require_there()
            if kind == 2:  # REQUEST_DEV_DEP_MSG_IN
                self._tag = tag
            else:
                assert size <= LARGEST
                self._message += bytes(data[12 : 12 + size])
                if end:
                    self._whole, self._message = self._whole + self._message, b""
            self._news.notify_all()
        return len(data)

    def bulk_read(self, handle: Any, ep: int, intf: Any, buff: Any, timeout: int) -> int:
        with self._news:
            over = self._news.wait_for(lambda: self._answer or not self._there, timeout / 1000)
            self._require_there()
            if not over:
                raise usb.core.USBTimeoutError("timed out", errno=errno.ETIMEDOUT)
            answer, self._answer = self._answer, b""
            head = struct.pack("<BBBxIBxxx", 2, self._tag, ~self._tag & 0xFF, len(answer), 1)
        packet = head + answer + bytes(-len(answer) % 4)
        buff[: len(packet)] = type(buff)("B", packet)
        return len(packet)

    def _require_there(self) -> None:
        if not self._there:
            raise usb.core.USBError("no such device", errno=errno.ENODEV)

    def ctrl_transfer(
        self, handle: Any, kind: int, request: int, value: int, index: int, data: Any, timeout: int
    ) -> int:
        answer = bytes([0x81, 0])  # INITIATE_ABORT_BULK_IN: nothing is under way
        if (kind, request) == (0x80, 6):  # a string
            text = self.SERIAL.encode("utf-16-le") if value & 0xFF else b"\x09\x04"
            answer = bytes([2 + len(text), 3]) + text
        elif request == 7:  # GET_CAPABILITIES
            answer = bytes([1]) + bytes(23)
        size = min(len(answer), len(data))
        data[:size] = type(data)("B", answer[:size])
        return size

    def enumerate_devices(self) -> list[str]:
        return ["generator"]

    def get_device_descriptor(self, dev: Any) -> _Descriptor:
        ids = {"idVendor": 0x0957, "idProduct": 0x2C07, "iSerialNumber": 3}
        return _Descriptor(bNumConfigurations=1, bLength=18, bDescriptorType=1, **ids)

    def get_configuration_descriptor(self, dev: Any, config: int) -> _Descriptor:
        return _Descriptor(bNumInterfaces=1, bConfigurationValue=1, extra_descriptors=[])

    def get_interface_descriptor(self, dev: Any, intf: int, alt: int, config: int) -> _Descriptor:
        if alt:
            raise IndexError
        kind = {"bInterfaceClass": 0xFE, "bInterfaceSubClass": 3, "bInterfaceProtocol": 1}
        return _Descriptor(bNumEndpoints=2, extra_descriptors=[], **kind)

    def get_endpoint_descriptor(
        self, dev: Any, ep: int, intf: int, alt: int, config: int
    ) -> _Descriptor:
        address = (self._OUT, self._IN)[ep]
        bulk = {"bmAttributes": 2, "wMaxPacketSize": LARGEST}
        return _Descriptor(bEndpointAddress=address, extra_descriptors=[], **bulk)

    def open_device(self, dev: Any) -> str:
        return "handle"

    def get_configuration(self, handle: Any) -> int:
        return 1

    def _agree(self, *arguments: Any) -> None:
        """Let it be so."""

    close_device = set_configuration = claim_interface = release_interface = _agree

    def is_kernel_driver_active(self, handle: Any, intf: int) -> bool:
        return False


def socket_bus() -> TcpLine:
    """Return a plain socket, under its name as a VISA resource."""
    line = TcpLine(0)
    line.name = f"visa:TCPIP::{HOST}::{line.name.rpartition(':')[2]}::SOCKET"
    return line


BUSES: Final[dict[str, Callable[[pytest.MonkeyPatch], Line]]] = {
    "hislip": lambda monkeypatch: HislipBus(),
    "vxi11": lambda monkeypatch: Vxi11Bus(),
    "usbtmc": UsbBus,
    "socket": lambda monkeypatch: socket_bus(),
}
