"""The command `devices`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

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
        click.echo("Each port is written to: *IDN?, and a greeting to a device of ours.")
    else:
        click.echo("This machine has no serial ports; give others, such as socket://host:5025.")
    for name in names:
        click.echo(f"{name}  {_identify(name, line)}")
    cards = sound_cards()
    if not cards:
        lack = sound_lack()
        reason = "" if lack is None else f": {lack}"
        click.echo(f"No sound card with two outputs is seen{reason}.")
    for card in cards:
        click.echo(f"{card}  a sound card with two outputs: --driver audio; nothing was sent")


def _identify(port: str, line: LineSettings) -> str:
    """Return one line that describes the device on a port."""
    from device.errors import LinkError
    from device.scpi.generator import identify_generator
    from device.wire.serial import identify

    try:
        answer = identify(port, line)
    except LinkError as error:
        return str(error)
    if answer is not None:
        identity, *reports = answer
        details = "".join(f"\n    {report}" for report in reports)
        return f"{identity}: --driver serial{details}"
    try:
        generator = identify_generator(port, line)
    except LinkError as error:
        return str(error)
    if generator is not None:
        return f"{generator}: --driver generator, which sets ceiling and sample rate by the study"
    return "nothing that tactstrip can drive answers"
