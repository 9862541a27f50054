"""The options that select a device, the confirmation of real hardware, and the progress line."""

from __future__ import annotations

import contextlib
import sys
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeVar

import click

from device.printing import echo
from experiment.exits import DEVICE_FAILED, CommandError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from experiment.hardware.safety import Confirmation, Purpose
    from experiment.hardware.setup import Hardware


_Command = TypeVar("_Command", bound="Callable[..., object]")


def complete_drivers(_: click.Context, __: click.Parameter, typed: str) -> list[str]:
    """Complete the name of a built-in or installed driver."""
    from device.drivers import NEEDS
    from device.installed import DRIVERS, installed

    return [name for name in (*NEEDS, *installed(DRIVERS)) if name.startswith(typed)]


def hardware_options(command: _Command) -> _Command:
    """Add the options ``--driver``, ``--port`` and ``--confirm-hardware`` to a command."""
    for option in (
        click.option(
            "--confirm-hardware",
            is_flag=True,
            help="Confirm that the hardware is safe (see docs/hardware.md). Without this option, "
            "tactstrip prompts you before it uses a real device.",
        ),
        click.option(
            "--port", metavar="P", help="Use this port or URL instead of that of the study."
        ),
        click.option(
            "--driver",
            metavar="NAME",
            shell_complete=complete_drivers,
            help="Use this driver instead of that of the study: mock, serial, generator, audio, or "
            "an installed driver.",
        ),
    ):
        command = option(command)
    return command


def confirmed(
    rig: Hardware, *, given: bool, simulated: bool = True, purpose: Purpose | None = None
) -> Confirmation | None:
    """Return the operator's confirmation that a device is safe; None for a mock or an emulator.

    Raises CommandError if the confirmation is neither `given` on the command line nor entered at a
    terminal, ValueError if the device does not suit the purpose, by default data, and
    LinkError if no device answers.
    """
    from device.drivers import MOCK
    from experiment.hardware.safety import (
        SAFETY_CONDITIONS,
        Purpose,
        confirmed_now,
        require_device,
    )

    driver = rig.settings.driver
    is_real = driver != MOCK and not rig.is_emulated()
    require_device(is_real=is_real, simulated=simulated, purpose=purpose or Purpose.DATA)
    if not is_real:  # nothing moves, even if --confirm-hardware is given
        return None
    if given:
        return confirmed_now("--confirm-hardware")
    if not on_terminal():
        raise CommandError(
            f"the driver {driver} moves real actuators: read docs/hardware.md, then give "
            "--confirm-hardware (or answer on a terminal); nothing was switched on"
        )
    echo(f"The driver {driver} moves real actuators. Confirm (see docs/hardware.md) that", err=True)
    for condition in SAFETY_CONDITIONS:
        echo(f"  - {condition}", err=True)
    if not answer("Are all of these conditions met?"):
        raise CommandError("the hardware was not confirmed; nothing was switched on")
    return confirmed_now("asked")


def on_terminal() -> bool:
    """Return whether standard input is a terminal, so that the program can prompt."""
    return sys.stdin.isatty()


def answer(question: str) -> bool:
    """Prompt the operator for yes or no; Ctrl-C and the end of the input mean no."""
    try:
        return click.confirm(question, err=True)
    except click.Abort:
        return False


class Step(Protocol):
    """A callback that reports progress and, optionally, a short intermediate result."""

    def __call__(self, done: int, total: int, result: str = "") -> None:
        """Report that `done` of `total` steps are finished."""


_SHOWN_AFTER_S: Final = 0.5
_REFRESH_INTERVAL_S: Final = 0.1
_BAR_CHARACTERS: Final = 15
"""Width of the bar, which leaves room for the intermediate result in 80 characters."""


@contextlib.contextmanager
def working(activity: str) -> Iterator[Step]:
    """Show a progress line with the elapsed time on stderr while the block runs.

    The line appears after half a second, only on a terminal, and is removed at the end. Otherwise
    rich is not imported. The yielded callback reports progress.

    Examples
    --------
    >>> with working("Computing") as step:
    ...     step(1, 2)
    """
    finished = Event()
    progress: dict[str, Any] = {"completed": 0, "total": None, "result": ""}

    def step(done: int, total: int, result: str = "") -> None:
        progress.update(completed=done, total=total or None, result=result)

    thread = Thread(target=_show_progress, args=(activity, finished, progress), daemon=True)
    is_visible = sys.stderr.isatty()
    if is_visible:
        thread.start()
    try:
        yield step
    finally:
        finished.set()
        if is_visible:
            thread.join()


def _show_progress(activity: str, finished: Event, progress: dict[str, Any]) -> None:
    """Draw the progress line until the work is finished, and remove it."""
    if finished.wait(_SHOWN_AFTER_S):
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    text, result = TextColumn("{task.description}"), TextColumn("{task.fields[result]}")
    columns = (text, BarColumn(_BAR_CHARACTERS), TimeElapsedColumn(), result)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(activity, **progress)
        while not finished.wait(_REFRESH_INTERVAL_S):
            bar.update(task, **progress)


@contextlib.contextmanager
def device_failures() -> Iterator[None]:
    """Turn a DeviceError into a CommandError with the exit code of a device failure.

    Examples
    --------
    >>> from device.errors import LinkError
    >>> with device_failures():
    ...     raise LinkError("the line is gone")
    Traceback (most recent call last):
    experiment.exits.CommandError: device: the line is gone
    """
    from device.errors import DeviceError

    try:
        yield
    except DeviceError as error:
        raise CommandError(f"device: {error}", exit_code=DEVICE_FAILED) from error
