"""The command `devices`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from device.printing import echo

if TYPE_CHECKING:
    from device.wire.channels import LineSettings


@click.command(epilog="Example: tactstrip devices")
@click.argument("ports", metavar="[PORT]...", nargs=-1)
@click.option(
    "--baud",
    type=click.IntRange(1200, 10_000_000),
    metavar="RATE",
    default=115_200,
    show_default=True,
    help="Baud rate of the serial ports, like device.baud in a study.",
)
def devices(*, ports: tuple[str, ...], baud: int) -> None:
    """List the devices on serial ports and the sound cards of this computer.

    tactstrip writes to each serial port and to each PORT: the identification query *IDN?, and a
    greeting to a tactstrip device that answers. A PORT may be a URL such as socket://host:5025 or a
    VISA resource such as visa:TCPIP::host::INSTR. Nothing is sent to sound cards.
    """
    from serial.tools.list_ports import comports

    from device.sound.stream import sound_cards, sound_lack
    from device.wire.channels import LineSettings

    line = LineSettings(baud=baud)
    names = dict.fromkeys([*sorted(port.device for port in comports()), *ports])
    if names:
        echo("Each port is written to: *IDN?, and a greeting to a device of ours.")
    else:
        echo("This machine has no serial ports; give others, such as socket://host:5025.")
    for name in names:
        description, *reports = _identify(name, line)
        echo(f"{name}  {description}", *(f"    {report}" for report in reports))
    cards = sound_cards()
    if not cards:
        lack = sound_lack()
        reason = "" if lack is None else f": {lack}"
        echo(f"No sound card with outputs is seen{reason}.")
    for card, outputs in cards.items():
        echo(f"{card}  a sound card with {outputs} outputs: --driver audio; nothing was sent")


def _identify(port: str, line: LineSettings) -> list[str]:
    """Return lines that describe the device on a port."""
    from device.errors import LinkError, PortError
    from device.scpi.generator import identify_generator
    from device.wire.serial import identify

    try:
        answer = identify(port, line)
    except LinkError as error:
        return [str(error)]
    if answer is not None:
        identity, *reports = answer
        return [f"{identity}: --driver serial", *map(str, reports)]
    try:
        generator = identify_generator(port, line)
    except (LinkError, PortError) as error:
        return [str(error)]
    if generator is not None:
        return [f"{generator}: --driver generator, which sets ceiling and sample rate by the study"]
    return ["nothing that tactstrip can drive answers"]
