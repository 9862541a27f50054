"""How a value lies in bytes: the code of each field, and what its numbers stand for.

All numbers are little endian and unsigned.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Any, Final, Generic, NamedTuple, Protocol, TypeVar

from device.errors import Refusal, rejection

if TYPE_CHECKING:
    from collections.abc import Callable


class Meanings(Protocol):
    """What the numbers of a field stand for, as a sequence does it."""

    def index(self, value: Any, /) -> Any:
        """Return what travels for a value."""

    def __getitem__(self, number: Any, /) -> Any:
        """Return the value; IndexError where there is none."""


class _Words:
    """Text, which travels as ASCII."""

    def index(self, text: str) -> bytes:
        return text.encode("ascii", "replace")

    def __getitem__(self, octets: bytes) -> str:
        if not octets.isascii():
            raise IndexError
        return octets.rstrip(b"\x00").decode()


class Form(NamedTuple):
    """How one field travels: its code in `struct`, and what its numbers stand for."""

    code: str
    meanings: Meanings | None = None


U8: Final = Form("B")
U16: Final = Form("H")
U32: Final = Form("I")
U64: Final = Form("Q")
TIME: Final = Form("Q", range(2**63))
TEXT: Final = Form("16s")
LONG_TEXT: Final = Form("32s", _Words())
REST: Final = Form("")
"""All bytes that are left; only as the last field."""

_Value = TypeVar("_Value")


class Layout(Generic[_Value]):
    r"""How the fields of one kind of value follow each other in bytes.

    >>> from device.core.messages import Arm
    >>> arm = Layout(Arm, token=U64, slot=U8, time_to_live_us=U32)
    >>> arm.pack(Arm(token=258, slot=7, time_to_live_us=1))
    b'\x02\x01\x00\x00\x00\x00\x00\x00\x07\x01\x00\x00\x00'
    >>> arm.read(arm.pack(Arm(token=258, slot=7, time_to_live_us=1))).slot
    7
    """

    def __init__(self, of: Callable[..., _Value], **forms: Form) -> None:
        self.of = of
        self._forms = {name: form for name, form in forms.items() if form is not REST}
        self._rest = next((name for name, form in forms.items() if form is REST), None)
        self._numbers = struct.Struct("<" + "".join(form.code for form in forms.values()))

    @property
    def size(self) -> int:
        """Number of bytes, without what fills the rest."""
        return self._numbers.size

    def pack(self, value: _Value) -> bytes:
        """Return the bytes of a value."""
        fields = [_number(form, getattr(value, name)) for name, form in self._forms.items()]
        rest: bytes = getattr(value, self._rest) if self._rest else b""
        return self._numbers.pack(*fields) + rest

    def read(self, content: bytes) -> _Value:
        """Return the value of some bytes.

        Refused are with BAD_MESSAGE bytes of another length and numbers that stand for nothing,
        and with its own code what the value itself refuses.
        """
        known, rest = content[: self.size], content[self.size :]
        if len(known) < self.size or (rest and not self._rest):
            raise rejection(
                Refusal.BAD_MESSAGE, f"{self.size} bytes are expected, got {len(content)}"
            )
        numbers = zip(self._forms.items(), self._numbers.unpack(known), strict=True)
        fields = {name: _meaning(name, form, number) for (name, form), number in numbers}
        if self._rest:
            fields[self._rest] = rest
        return self.of(**fields)


def _number(form: Form, value: Any) -> Any:
    return value if form.meanings is None else form.meanings.index(value)


def _meaning(name: str, form: Form, number: Any) -> Any:
    if form.meanings is None:
        return number
    try:
        return form.meanings[number]
    except IndexError:
        raise rejection(Refusal.BAD_MESSAGE, f"{name} {number}") from None
