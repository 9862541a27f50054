"""How a command ends that cannot do its work: one line on stderr and an exit code."""

from __future__ import annotations

import contextlib
import errno
import functools
from typing import IO, TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

import click

from device.printing import escaped

if TYPE_CHECKING:
    from collections.abc import Callable


ANSWER_IS_NO: Final = 1
"""Exit code: done, and the answer is no."""
BAD_INPUT: Final = 2
"""Exit code: bad input or usage."""
DEVICE_FAILED: Final = 3
"""Exit code: device failure."""
STOPPED_EARLY: Final = 4
"""Exit code: stopped early, can be resumed."""
INTERNAL_ERROR: Final = 70
"""Exit code: a fault of tactstrip itself."""
INTERRUPTED: Final = 130
"""Exit code after Ctrl-C outside a session, as shells have it."""

_NO_ROOM: Final = (errno.ENOSPC, errno.EDQUOT)
_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


class CommandError(click.ClickException):
    """An error that ends a command.

    Parameters
    ----------
    *messages : str
        What is wrong and what to do; a line each.
    exit_code : int
        The command's exit code.
    label : str
        What the line begins with; empty where a session was stopped as somebody wished.

    Examples
    --------
    >>> error = CommandError("study.toml: no such file")
    >>> error.exit_code, str(error)
    (2, 'study.toml: no such file')
    """

    def __init__(self, *messages: str, exit_code: int = BAD_INPUT, label: str = "error: ") -> None:
        self._lines = tuple(escaped(" ".join(message.split("\n"))) for message in messages)
        super().__init__("\n".join(self._lines))
        # click declares one code per class; `main` reads the instance's
        vars(self)["exit_code"] = exit_code
        self._label = label

    def show(self, file: IO[Any] | None = None) -> None:
        """Write the lines, by default to stderr; a closed terminal is no further error."""
        with contextlib.suppress(OSError):
            for line in self._lines:
                click.echo(f"{self._label}{line}", file=file, err=file is None)


def room_hint(error_number: int | None) -> str:
    """Return the advice to make room, if a write failed because a disk or a quota is full.

    Examples
    --------
    >>> room_hint(errno.ENOSPC), room_hint(errno.EIO)
    ('make room, then ', '')
    """
    return "make room, then " if error_number in _NO_ROOM else ""


def refusals(command: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
    """Let a command end with one line where a value is refused or a file cannot be used.

    Parameters
    ----------
    command : callable
        The function behind a command. Any ValueError and OSError that it raises becomes a
        `CommandError` with exit code 2; a broken pipe is left to click.

    Examples
    --------
    >>> @refusals
    ... def fail():
    ...     raise ValueError("levels_vpp must be increasing; got [2, 1]")
    >>> fail()
    Traceback (most recent call last):
    experiment.exits.CommandError: levels_vpp must be increasing; got [2, 1]
    """

    @functools.wraps(command)
    def guarded(*args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
        try:
            return command(*args, **kwargs)
        except BrokenPipeError:
            raise
        except OSError as error:
            where = f"{error.filename}: " if error.filename is not None else ""
            room = room_hint(error.errno)
            hint = f"; {room}run it again" if room else ""
            raise CommandError(f"{where}{error.strerror or error}{hint}") from error
        except ValueError as error:
            # an error of a study has a line for each of its faults
            source, faults = getattr(error, "source", ""), getattr(error, "faults", ())
            lines = [f"{source}: {fault}" for fault in faults] or [str(error)]
            raise CommandError(*lines) from error

    return guarded
