"""The options of the command `emulate`, and checks of their combinations."""

from __future__ import annotations

import contextlib
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

import click
from click.core import ParameterSource

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_Command = TypeVar("_Command", bound="Callable[..., object]")

_OPTIONS = (
    click.option(
        "--pty", "on_pty", is_flag=True, help="Use a pseudo-terminal. This is the default."
    ),
    click.option(
        "--tcp",
        "tcp_port",
        type=click.IntRange(0, 65535),
        metavar="PORT",
        help="Use this TCP port of this computer. 0 selects a free port.",
    ),
    click.option(
        "--generator",
        type=click.Choice(["keysight"]),
        help="Emulate a generator of this make instead of a tactstrip device.",
    ),
    click.option(
        "--truth",
        "truth_file",
        type=click.Path(path_type=Path, dir_okay=False),
        metavar="FILE",
        help="Append the true output of the device to this file, as JSON lines.",
    ),
    click.option(
        "--fault",
        "script",
        metavar="SCRIPT",
        default="",
        help="Inject faults, such as drop=0.01,corrupt=0.01 (see below).",
    ),
    click.option(
        "--seed",
        type=click.IntRange(min=0),
        metavar="N",
        default=0,
        show_default=True,
        help="Seed of the faults.",
    ),
    click.option(
        "--baud",
        type=click.IntRange(300, 10_000_000),
        metavar="RATE",
        help="Limit the line to this baud rate. Below 57600, set device.baud in the study.",
    ),
    click.option(
        "--channels",
        type=click.IntRange(1, 64),
        metavar="N",
        default=2,
        help="Number of output channels of the device.  [default: 2]",
    ),
    click.option(
        "--ceiling-vpp",
        type=float,
        metavar="V",
        default=200.0,
        help="Ceiling of the device, in V peak-to-peak.  [default: 200]",
    ),
    click.option(
        "--sample-rate-hz",
        type=float,
        metavar="R",
        default=48_000.0,
        help="Sample rate of the device, in Hz.  [default: 48000]",
    ),
    click.option(
        "--serial-number",
        metavar="S",
        default="1",
        help="Serial number of the device. Different numbers distinguish emulators.  [default: 1]",
    ),
    click.option(
        "--firmware",
        type=click.Path(path_type=Path, dir_okay=False, exists=True),
        metavar="LIBRARY",
        help="Run the device logic in C from this library, which `make -C firmware library` "
        "compiles, instead of the one in Python.",
    ),
    click.option("--switch-open", is_flag=True, help="Start with the safety switch open."),
    click.option(
        "--switch-stdin",
        is_flag=True,
        help="Set the safety switch from standard input, by lines `open` and `closed`.",
    ),
    click.option(
        "--over-current-at",
        "over_current_at_s",
        type=click.FloatRange(min=0.0),
        metavar="S",
        default=inf,
        help="Report an over-current of the amplifier after this time, in s.",
    ),
    click.option("--unsensed", is_flag=True, help="Do not report the state of the amplifier."),
    click.option(
        "--adc",
        metavar="SETTINGS",
        help="Measure each burst, such as with gain=0.9,delay_us=40,noise=50 (see below).",
    ),
    click.option(
        "--amplifier-gain",
        type=float,
        metavar="G",
        default=1.0,
        help="Gain of the amplifier behind the --generator, for the voltages in the --truth file.  "
        "[default: 1]",
    ),
)


def emulator_options(command: _Command) -> _Command:
    """Add the options of an emulator to a command."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


_DEVICE_OPTIONS: Final = (
    *("baud", "channels", "ceiling_vpp", "sample_rate_hz", "serial_number", "firmware"),
    *("switch_open", "switch_stdin", "over_current_at_s", "unsensed", "adc"),
)


def require_together(ctx: click.Context) -> None:
    """Reject options of a device for a generator, and of a generator for a device."""
    is_generator = ctx.params["generator"] is not None
    verb = "exclude" if is_generator else "need"
    for name in _DEVICE_OPTIONS if is_generator else ("amplifier_gain",):
        if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = "--" + name.removesuffix("_s").replace("_", "-")
            raise click.UsageError(f"{option} and --generator {verb} each other.", ctx)


@contextlib.contextmanager
def usage(ctx: click.Context) -> Iterator[None]:
    """Turn an error of a value, a file or a port into a usage error of one line."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        raise click.UsageError(f"{where}{error.strerror or error}.", ctx) from error
    except ValueError as error:
        raise click.UsageError(f"{error}.", ctx) from error
