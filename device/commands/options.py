"""The options of an emulator: what they are, which belong together, and what is wrong with them."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_Command = TypeVar("_Command", bound="Callable[..., object]")

_OPTIONS = (
    click.option("--pty", "on_pty", is_flag=True, help="On a pseudo-terminal, the default."),
    click.option(
        "--tcp",
        "tcp_port",
        type=click.IntRange(0, 65535),
        metavar="PORT",
        help="On a TCP port of this machine; 0 takes any free one.",
    ),
    click.option(
        "--generator",
        type=click.Choice(["keysight"]),
        help="A generator of this make instead of a device of ours.",
    ),
    click.option(
        "--truth",
        "truth_file",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Add what really comes out to this file, as JSON lines.",
    ),
    click.option("--fault", "script", metavar="SCRIPT", help="Such as drop=0.01,corrupt=0.01."),
    click.option("--seed", type=click.IntRange(min=0), help="Of the faults; 0 by default."),
    click.option(
        "--baud",
        type=click.IntRange(300, 10_000_000),
        help="Model a wire of this rate; below 57600 a host needs device.baud.",
    ),
    click.option(
        "--ceiling-vpp", type=float, metavar="V", help="The device's own; 200 by default."
    ),
    click.option("--sample-rate-hz", type=float, metavar="R", help="48000 by default."),
    click.option(
        "--serial-number",
        metavar="S",
        help="To be told from another emulator; by default each is the same device.",
    ),
    click.option("--switch-open", is_flag=True, help="Its amplifier's safety switch is open."),
    click.option(
        "--switch-stdin",
        is_flag=True,
        help="Lines `open` and `closed` on standard input move its safety switch.",
    ),
    click.option(
        "--over-current-at",
        "over_current_at_s",
        type=click.FloatRange(min=0.0),
        metavar="S",
        help="Its amplifier reports over-current after so many seconds.",
    ),
    click.option("--unsensed", is_flag=True, help="It knows nothing of its amplifier."),
    click.option(
        "--adc",
        metavar="WHAT",
        help="It measures its bursts at the amplifier, such as gain=0.9,delay_us=40,noise=50, or "
        "with tap=line (current, motion) elsewhere: gain in mV (uA, nm) for each mV at the "
        "actuator, noise in mV (uA, nm), effective; loss=P misses some.",
    ),
    click.option(
        "--amplifier-gain",
        type=float,
        metavar="G",
        help="Behind a generator, for the volts in the truth file; 1 by default.",
    ),
)


def emulator_options(command: _Command) -> _Command:
    """Give a command the options of an emulator."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def require_together(ctx: click.Context) -> None:
    """Refuse options of a device for a generator, and of a generator for a device."""
    given = {option for option, value in ctx.params.items() if value not in (None, False)}
    of_a_device = (
        *("baud", "ceiling_vpp", "sample_rate_hz", "serial_number"),
        *("switch_open", "switch_stdin", "over_current_at_s", "unsensed", "adc"),
    )
    foreign = of_a_device if "generator" in given else ("amplifier_gain",)
    for name in foreign:
        if name in given:
            verb = "exclude" if "generator" in given else "need"
            option = "--" + name.removesuffix("_s").replace("_", "-")
            raise click.UsageError(f"{option} and --generator {verb} each other.", ctx)


@contextlib.contextmanager
def usage(ctx: click.Context) -> Iterator[None]:
    """Say in one line what is wrong with a value, a file or a port."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        raise click.UsageError(f"{where}{error.strerror or error}.", ctx) from error
    except ValueError as error:
        raise click.UsageError(f"{error}.", ctx) from error
