"""How a command ends that cannot do what it was asked: one line on stderr and an exit code."""

from __future__ import annotations

import contextlib
import errno
import functools
from typing import IO, TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

import click

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
INTERRUPTED: Final = 130
"""Exit code after Ctrl-C outside a session, as shells have it."""

_FULL: Final = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")


class CommandError(click.ClickException):
    """An error that ends a command.

    Parameters
    ----------
    message : str
        What is wrong and what to do; shown as one line.
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

    def __init__(self, message: str, exit_code: int = BAD_INPUT, *, label: str = "error: ") -> None:
        super().__init__(" ".join(message.splitlines()))
        # click declares one code per class; `main` reads the instance's
        vars(self)["exit_code"] = exit_code
        self._label = label

    def show(self, file: IO[Any] | None = None) -> None:
        """Write the line, to stderr unless told otherwise; a closed terminal is no new error."""
        with contextlib.suppress(OSError):
            click.echo(f"{self._label}{self.format_message()}", file=file, err=file is None)


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
            hint = "; make room, then run it again" if error.errno in _FULL else ""
            raise CommandError(f"{where}{error.strerror or error}{hint}") from error
        except ValueError as error:
            raise CommandError(str(error)) from error

    return guarded
