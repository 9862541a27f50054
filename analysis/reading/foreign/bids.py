"""Folders made elsewhere: BIDS data sets and plain folders of tables, and what file names tell."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from pathlib import Path


_TABLE: Final = re.compile(r".+_(beh|events)\.tsv")
_PLAIN: Final = ((".csv", ".tsv"), (".txt",))
"""Endings of tables; the last only where there is none of the first: most .txt are no tables."""
_ENTITY: Final = re.compile(r"([A-Za-z]+)-([A-Za-z0-9+]+)")
STANDS_FOR: Final = {"participant": "sub-", "session": "ses-", "block": "run-"}
"""Which of our columns the name of a BIDS file tells, where the table does not."""
FILE: Final = "file-"


def about(path: Path) -> dict[str, str]:
    """Return what the name of a file tells: BIDS' entities, and ``file-``, the name as a whole.

    >>> from pathlib import Path
    >>> about(Path("sub-07_task-felt_run-2_beh.tsv"))
    {'file-': 'sub-07_task-felt_run-2_beh', 'sub-': '07', 'task-': 'felt', 'run-': '2'}
    """
    named = path.stem.split("_") if path.name.startswith("sub-") else ()
    parts = (_ENTITY.fullmatch(part) for part in named)
    return {FILE: path.stem} | {f"{found[1]}-": found[2] for found in parts if found}


def bids_tables(people: list[Path]) -> list[Path]:
    """List the tables of behaviour and events below folders ``sub-*``, by name.

    >>> bids_tables([])
    []
    """
    below = (path for folder in people for path in folder.rglob("*.tsv"))
    return sorted(path for path in below if _TABLE.fullmatch(path.name) and _shown(path))


def plain_tables(folder: Path) -> list[Path]:
    """List the tables in a folder that is no data set, by name.

    >>> from pathlib import Path
    >>> plain_tables(Path("/dev"))
    []
    """
    files = sorted(path for path in folder.iterdir() if _shown(path))
    found = ([path for path in files if path.suffix.lower() in endings] for endings in _PLAIN)
    return next(filter(None, found), [])


def _shown(path: Path) -> bool:
    return not path.name.startswith(".")  # as a spreadsheet's lock and macOS's copies do
