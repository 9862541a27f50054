"""A file that stays what it is while it is read: its checksum is that of what was read."""

from __future__ import annotations

import hashlib
import io
from typing import TYPE_CHECKING

from analysis.errors import ResultFileError

if TYPE_CHECKING:
    from pathlib import Path

    from _typeshed import WriteableBuffer


class HashedFile(io.FileIO):
    """A file that is read once, from its beginning to its end, through `io.BufferedReader`.

    Parameters
    ----------
    path : Path
        The file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "t.csv"
    ...     _ = path.write_bytes(b"as it was")
    ...     with HashedFile(path) as file, io.BufferedReader(file) as stream:
    ...         _ = stream.read()
    ...         _ = path.write_bytes(b"another")
    ...         file.unchanged_sha256()
    Traceback (most recent call last):
    analysis.errors.ResultFileError: ...t.csv: it changed while it was read; ...
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._path = path
        self._read = hashlib.sha256()

    def readinto(self, buffer: WriteableBuffer, /) -> int | None:
        """Read into a buffer and take the bytes into the checksum."""
        number = super().readinto(buffer)
        self._read.update(memoryview(buffer)[: number or 0])
        return number

    def unchanged_sha256(self) -> str:
        """Return the checksum of what was read, which is what stands there now.

        Raises
        ------
        ResultFileError
            Where the file changed, or another one stands in its place.
        """
        with self._path.open("rb") as again:
            now = hashlib.file_digest(again, "sha256").hexdigest()
        if now != self._read.hexdigest():
            message = "it changed while it was read; analyze it when nothing writes to it"
            raise ResultFileError(self._path, None, message)
        return now
