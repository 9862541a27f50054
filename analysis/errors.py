"""The error of a result file: which file, which line, what is wrong there."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

_LONGEST_SHOWN = 60


class ResultFileError(ValueError):
    """A file of results, or what belongs to it, cannot be read as what it claims to be.

    Parameters
    ----------
    file : str or Path
        The file or folder as the caller named it.
    line : int or None
        Line of the fault, the header is line 1; ``None`` where the fault has no line.
    message : str
        One sentence: column, value, and what is allowed.

    Examples
    --------
    >>> str(ResultFileError("trials.csv", 7, "column 'side' holds 'top'"))
    "trials.csv:7: column 'side' holds 'top'"
    """

    def __init__(self, file: str | Path, line: int | None, message: str) -> None:
        self.file = str(file)
        self.line = line
        place = one_line(self.file) if line is None else f"{one_line(self.file)}:{line}"
        super().__init__(f"{place}: {message}")


def one_line(text: str) -> str:
    r"""Return a text as one printable line, control characters escaped.

    >>> one_line("a.csv"), one_line("a\nb.csv")
    ('a.csv', 'a\\nb.csv')
    """
    return text if text.isprintable() else repr(text)[1:-1]


def shown(value: str) -> str:
    """Quote a cell for a message, cut short where it is long.

    >>> shown("top"), len(shown("x" * 10_000)) < 80
    ("'top'", True)
    """
    cut = value if len(value) <= _LONGEST_SHOWN else value[:_LONGEST_SHOWN] + "..."
    return repr(cut)
