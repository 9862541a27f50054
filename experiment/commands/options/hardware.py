"""The options by which a command reaches a device, and the operator's word for a real one.

Also the line by which any command that takes longer than a second shows that it works.
"""

from __future__ import annotations

import contextlib
import sys
from threading import Event, Thread
from typing import TYPE_CHECKING, Final, Protocol, TypeVar

import click

from experiment.terms.exits import DEVICE_FAILED, CommandError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from experiment.apparatus.rig import Confirmation, Rig


_Command = TypeVar("_Command", bound="Callable[..., object]")


def hardware_options(command: _Command) -> _Command:
    """Give a command the options ``--driver``, ``--port`` and ``--confirm-hardware``."""
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
            help="Use this driver instead of that of the study: mock, serial, generator, audio, or "
            "an installed driver.",
        ),
    ):
        command = option(command)
    return command


def confirmed(rig: Rig, *, given: bool, practice: bool = False) -> Confirmation | None:
    """Return the operator's word that a device is safe; none for one that cannot move anything.

    CommandError where it is not `given` on the command line, and nobody is there to be asked or the
    answer is no, or where it was to be `practice`; LinkError where nothing answers on the port.
    """
    from device.drivers import MOCK
    from experiment.apparatus.rig import QUESTION, confirmed_now

    driver = rig.settings.driver
    if driver == MOCK or rig.is_emulated():  # also where it is given: nothing there to confirm
        return None
    if practice:
        raise CommandError(
            f"--practice-without-device must have the mock or an emulator; got the driver {driver} "
            "of a real device: leave out --driver and --port, and the mock takes its place"
        )
    if given:
        return confirmed_now("--confirm-hardware")
    if not on_terminal():
        raise CommandError(
            f"the driver {driver} moves real actuators: read docs/hardware.md, then give "
            "--confirm-hardware (or answer on a terminal); nothing was switched on"
        )
    click.echo(
        f"The driver {driver} moves real actuators. Is all of this so (docs/hardware.md)?", err=True
    )
    for part in QUESTION:
        click.echo(f"  - {part}", err=True)
    if not answer("All of it is so?"):
        raise CommandError("the hardware was not confirmed; nothing was switched on")
    return confirmed_now("asked")


def on_terminal() -> bool:
    """Tell whether somebody is there to be asked."""
    return sys.stdin.isatty()


def answer(question: str) -> bool:
    """Ask the operator on the terminal; Ctrl-C and the end of the input mean no."""
    try:
        return click.confirm(question, err=True)
    except click.Abort:
        return False


class Step(Protocol):
    """Told how much of how much is done, and perhaps what is known so far, in few words."""

    def __call__(self, done: int, total: int, known: str = "") -> None:
        """Take the news."""


_SHOWN_AFTER_S: Final = 0.5
_DRAWN_EVERY_S: Final = 0.1
_BAR_CHARACTERS: Final = 15
"""Of 80, so that what is known stands beside it."""


@contextlib.contextmanager
def working(what: str) -> Iterator[Step]:
    """Show on a terminal's stderr that something is going on, and for how long; then nothing.

    What is yielded may be told how much of how much is done, and what is known so far. Work that is
    over within half a second shows nothing, nor does any off a terminal: rich is not even imported
    then.

    Examples
    --------
    >>> with working("Computing") as step:
    ...     step(1, 2)
    """
    over, told = Event(), [(0, 0, "")]

    def step(done: int, total: int, known: str = "") -> None:
        told.append((done, total, known))

    thread = Thread(target=_show, args=(what, over, told), daemon=True)
    shown = sys.stderr.isatty()
    if shown:
        thread.start()
    try:
        yield step
    finally:
        over.set()
        if shown:
            thread.join()


def _show(what: str, over: Event, told: list[tuple[int, int, str]]) -> None:
    """Draw the line until the work is over; it is taken away then."""
    if over.wait(_SHOWN_AFTER_S):
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(_BAR_CHARACTERS),
        TimeElapsedColumn(),
        TextColumn("{task.fields[known]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=None, known="")
        while not over.wait(_DRAWN_EVERY_S):
            done, total, known = told[-1]
            bar.update(task, completed=done, total=total or None, known=known)


@contextlib.contextmanager
def device_failures() -> Iterator[None]:
    """Give a failure of the device its exit code.

    Examples
    --------
    >>> from device.errors import LinkError
    >>> with device_failures():
    ...     raise LinkError("the line is gone")
    Traceback (most recent call last):
    experiment.terms.exits.CommandError: device: the line is gone
    """
    from device.errors import DeviceError

    try:
        yield
    except DeviceError as error:
        raise CommandError(f"device: {error}", exit_code=DEVICE_FAILED) from error
