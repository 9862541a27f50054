"""What the files of a study share: identifiers, and writing a file as a whole or not at all."""

from __future__ import annotations

import os
import re
import tempfile
from pathlib import Path

from experiment.journal import sync_folder

TEMPORARY = ".tmp"
"""How the name of a file ends that is still being written."""
_TOTALS = "all"
"""What the analysis calls its rows of totals: nobody's name."""
_IDENTIFIER = re.compile(r"[A-Za-z0-9]{1,32}")


class ArchiveError(ValueError):
    """A session's folder that is there and must not be, or the other way round."""


def check_identifier(name: str, value: str) -> str:
    """Return a participant's or session's identifier.

    Raises
    ------
    ArchiveError
        Unless it consists of 1 to 32 letters a-z, A-Z and digits, and is not ``all``.
    """
    if not _IDENTIFIER.fullmatch(value) or value == _TOTALS:
        raise ArchiveError(
            f"{name} must be 1 to 32 letters (a-z, A-Z) or digits, and not {_TOTALS!r}; "
            f"got {value!r}"
        )
    return value


def write_atomically(path: Path, text: str, *, durable: bool = True) -> None:
    """Write a file so that it is either there as a whole or as it was before.

    Raises
    ------
    OSError
        If it cannot be written; the former file, if any, is unchanged then.
    """
    try:
        _write_and_replace(path, text, durable=durable)
    except OSError as error:
        error.filename = str(path)
        raise
    if durable:
        sync_folder(path.parent)


def _write_and_replace(path: Path, text: str, *, durable: bool) -> None:
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=TEMPORARY, dir=path.parent)
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
