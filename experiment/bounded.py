"""Files of users are read up to a limit, and only if they are regular files.

A FIFO would let the program hang, a device never ends, and a huge file would fill the memory before
anything in it is checked.
"""

from __future__ import annotations

import errno
import os
import re
import stat
import tomllib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from pathlib import Path

MAX_TOML_BYTES: Final = 1_000_000
"""Largest study, levels or column map file."""

_MAX_DOTS: Final = 100
_BETWEEN_KEYS: Final = re.compile(r"[=,\[\]{}]")


class FileRefusedError(OSError, ValueError):
    """A file that is too large, or is not a regular file."""


def read_bounded(path: Path, max_bytes: int = MAX_TOML_BYTES) -> bytes:
    """Return the contents of a regular file of at most `max_bytes`.

    Parameters
    ----------
    path : Path
        The file; symbolic links are followed.
    max_bytes : int
        Limit of its size.

    Raises
    ------
    FileRefusedError
        If it is larger, or a FIFO, a socket or a device.
    OSError
        If it cannot be read, or is a folder.

    Examples
    --------
    >>> from pathlib import Path
    >>> read_bounded(Path("/dev/null"))
    Traceback (most recent call last):
    experiment.bounded.FileRefusedError: [Errno 22] must be a regular file: '/dev/null'
    """
    # Opened without blocking: a FIFO without a writer would keep the program waiting here.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if path.exists() and not path.is_file():
        raise FileRefusedError(errno.EINVAL, "must be a regular file", str(path))
    with os.fdopen(os.open(path, flags), "rb") as file:
        # asked again of what is open: the name may stand for another file meanwhile
        if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            raise FileRefusedError(errno.EINVAL, "must be a regular file", str(path))
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise FileRefusedError(errno.EFBIG, f"must be at most {max_bytes} bytes long", str(path))
    return content


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    `tomllib` takes memory and time in the square of the parts of a dotted key, so that a key of
    60 000 parts fills the memory: such a line is refused before it is parsed.

    Raises
    ------
    tomllib.TOMLDecodeError
        If the text is not TOML, or a key has far more parts than any table has.

    Examples
    --------
    >>> parse_toml("strip.width_mm = 30")
    {'strip': {'width_mm': 30}}
    >>> parse_toml("a." * 60_000 + "a = 1")
    Traceback (most recent call last):
    tomllib.TOMLDecodeError: too many parts in a key (at line 1, column 1)
    """
    for number, line in enumerate(text.split("\n"), start=1):
        if line.count(".") <= _MAX_DOTS or line.lstrip().startswith("#"):
            continue
        if max(span.count(".") for span in _BETWEEN_KEYS.split(line)) > _MAX_DOTS:
            raise tomllib.TOMLDecodeError(f"too many parts in a key (at line {number}, column 1)")
    return tomllib.loads(text)
