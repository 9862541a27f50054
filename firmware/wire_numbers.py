"""Print wire_numbers.h, which the firmware includes: the numbers of the wire, by their names.

They are those of the tables in device/, so that Python and C cannot differ. The Makefile calls
this module.
"""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Final

from device.core.reports import TAPS, Entropy, Health
from device.emulate.firmware import FIRMWARE_CHANNELS
from device.errors import Refusal
from device.wire.protocol import FATES, STATES, Kind

if TYPE_CHECKING:
    from collections.abc import Iterable
    from enum import Enum

_TEXT: Final = """\
/* The numbers of the wire. Written by firmware/wire_numbers.py from the tables in device/. */
#ifndef WIRE_NUMBERS_H
#define WIRE_NUMBERS_H

#define CHANNELS %dU

%s
#endif
"""


def _names(members: Iterable[Enum]) -> list[str]:
    return [member.name for member in members]


def _words(words: Iterable[str]) -> list[str]:
    """Return the names of words of a table, in which the first is empty."""
    return [word.upper() or "NONE" for word in words]


def _enum(name: str, prefix: str, numbers: dict[str, int], form: str = "d") -> str:
    lines = (f"    {prefix}{member} = {number:{form}},\n" for member, number in numbers.items())
    return f"enum {name} {{\n{''.join(lines)}}};\n"


def header() -> str:
    """Return the text of the header."""
    in_order = {
        "state": _names(STATES),
        "fate": _words(FATES),
        "entropy": _names(Entropy),
        "tap": _words(TAPS),
    }
    enums = [
        _enum(name, f"{name.upper()}_", {member: i for i, member in enumerate(members)})
        for name, members in in_order.items()
    ]
    bits = {field.name.upper(): 1 << bit for bit, field in enumerate(fields(Health))}
    enums += [
        _enum("health", "", bits),
        _enum("refusal", "", {"DONE": 0} | {refusal.name: refusal for refusal in Refusal}),
        _enum("kind", "", {kind.name: kind for kind in Kind}, form="#04x"),
    ]
    return _TEXT % (FIRMWARE_CHANNELS, "\n".join(enums))


if __name__ == "__main__":
    print(header(), end="")
