"""Results of chunks kept in a file, from which a computation that was stopped goes on."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any, Final, Self

if TYPE_CHECKING:
    import io
    from collections.abc import Mapping
    from pathlib import Path

    from _typeshed import DataclassInstance


DECIDES: Final = ("tactstrip", "numpy", "scipy")
"""Packages that decide a number: with another version of one, others could come out."""
_HINT: Final = "name another file, or remove this one"


def versions() -> dict[str, str]:
    """Return the version of every package that decides a number."""
    return {name: version(name) for name in DECIDES}


def as_read(result: Any) -> Any:
    """Return a result as a file would give it back: lists for tuples, nothing else changes.

    >>> as_read({"found": (3, 200), "mean_db": 0.1})
    {'found': [3, 200], 'mean_db': 0.1}
    """
    return json.loads(json.dumps(result))


def computed_in(path: Path) -> dict[str, Any]:
    """Return what a file of kept results holds; nothing where there is no such file."""
    try:
        with path.open("rb") as file:
            return dict(json.loads(file.readline())["computed"])
    except (FileNotFoundError, ValueError, TypeError, KeyError):
        return {}


class Kept:
    """A file of JSON lines: what is computed, then every finished chunk with its result.

    A line is handed to the system at once and whole: a program that is killed loses the chunks
    under way and no other, and two that append to one file do not hurt each other. A line that was
    cut short is computed again. Of the results, only their places in the file are in memory.

    Parameters
    ----------
    path : Path
        The file; made on entering, where it is not there.
    computed : mapping
        What is computed, as plain values: the study's SHA-256, the seed. The versions of the
        packages that decide the numbers are added.

    Raises
    ------
    ValueError
        On entering, for a file that holds something else, which stays as it is.

    Examples
    --------
    >>> import tempfile
    >>> from dataclasses import dataclass
    >>> from pathlib import Path
    >>> @dataclass(frozen=True)
    ... class Chunk:
    ...     first_study: int
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "power.jsonl"
    ...     with Kept(path, {"seed": 1}) as kept:
    ...         kept[Chunk(0)] = 0.25
    ...     with Kept(path, {"seed": 1}) as kept:
    ...         kept[Chunk(0)], Chunk(200) in kept
    (0.25, False)
    """

    def __init__(self, path: Path, computed: Mapping[str, object]) -> None:
        self.path = path
        self._head = {"schema": 1, "computed": as_read({**computed, **versions()})}
        self._places: dict[bytes, int] = {}  # a chunk's key, and where its line begins
        self._lines: io.BufferedReader
        self._end: io.FileIO

    def __enter__(self) -> Self:
        """Open the file and see what it holds."""
        self._end = self.path.open("ab", buffering=0)
        self._lines = self.path.open("rb")
        try:
            self._read()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file."""
        self._lines.close()
        self._end.close()

    def __len__(self) -> int:
        """Return how many chunks have their result here."""
        return len(self._places)

    def __contains__(self, chunk: DataclassInstance) -> bool:
        """Tell whether a chunk's result is here."""
        return _key(chunk) in self._places

    def __getitem__(self, chunk: DataclassInstance) -> Any:
        """Return a chunk's result."""
        self._lines.seek(self._places[_key(chunk)])
        return json.loads(self._lines.readline())["result"]

    def __setitem__(self, chunk: DataclassInstance, result: object) -> None:
        """Keep a chunk's result; the system has it when this returns."""
        key = _key(chunk)
        self._places[key] = self._append({"chunk": key.hex(), "result": result})

    def _append(self, value: object) -> int:
        """Write a line, and return where it begins."""
        line = json.dumps(value).encode() + b"\n"
        if self._end.write(line) != len(line):  # a full disk, which the next write tells
            self._end.write(b"\n")
        return self._end.tell() - len(line)

    def _read(self) -> None:
        """Find the lines of chunks, after the first has been held against what is computed."""
        first = self._lines.readline()
        if not first.endswith(b"\n"):
            ours = json.dumps(self._head).encode()
            if not ours.startswith(first):
                raise ValueError(f"{self.path}: this is no file of kept results; {_HINT}")
            self._end.truncate(0)  # killed while the first line was written
            self._append(self._head)
            return
        self._same(first)
        place, line = len(first), first
        for line in self._lines:
            with suppress(ValueError, TypeError, KeyError):  # cut short: computed again
                self._places[bytes.fromhex(json.loads(line)["chunk"])] = place
            place += len(line)
        if not line.endswith(b"\n"):
            self._end.write(b"\n")

    def _same(self, first: bytes) -> None:
        try:
            head = json.loads(first)
            theirs, ours = dict(head["computed"]), dict(self._head["computed"])
        except (ValueError, TypeError, KeyError) as error:
            raise ValueError(f"{self.path}: this is no file of kept results; {_HINT}") from error
        if head != self._head:
            name = next((n for n in ours if theirs.get(n) != ours[n]), "schema")
            got, asked = theirs.get(name), ours.get(name, 1)
            raise ValueError(
                f"{self.path}: holds results of another computation ({name} {got!r}, asked for is "
                f"{asked!r}); {_HINT}"
            )


def _key(chunk: DataclassInstance) -> bytes:
    """Return by what a chunk is known again: its kind and its values."""
    values = json.dumps([type(chunk).__qualname__, asdict(chunk)], sort_keys=True)
    return hashlib.sha256(values.encode()).digest()[:16]
