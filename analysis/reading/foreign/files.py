"""Files made elsewhere: which tables a folder has, what their names tell, sessions in several."""

from __future__ import annotations

import re
from collections import Counter
from typing import TYPE_CHECKING, Final

from analysis.reading.text import one_line

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
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


def begun_anew(
    rows: Iterable[tuple[tuple[str, ...], str]],
) -> dict[tuple[str, ...], Counter[str]]:
    """Return the sessions in several files, with the rows in each, where most sessions are in one.

    `rows` are told by session and file. Where every session has several files, they are its parts.

    >>> rows = [("1",), "a"], [("2",), "b"], [("2",), "c"], [("2",), "c"]
    >>> begun_anew(map(tuple, rows))
    {('2',): Counter({'c': 2, 'b': 1})}
    """
    files: dict[tuple[str, ...], Counter[str]] = {}
    for session, file in rows:
        files.setdefault(session, Counter())[file] += 1
    several = {session: each for session, each in files.items() if len(each) > 1}
    return several if 2 * len(several) <= len(files) else {}


def begun_anew_words(again: Mapping[tuple[str, ...], Counter[str]]) -> str:
    """Say of such sessions whose trials are numbered alike what can be done."""
    return (
        f"several files have the same session and trial numbers, {both_files(again)}: if a run was "
        f"broken off and begun anew, delete the # before {FILE} under [rows.skip], which leaves "
        f'the shorter file out; if all count, state [columns] session = "{FILE}"; analyze refuses '
        "them until then"
    )


def both_files(again: Mapping[tuple[str, ...], Counter[str]]) -> str:
    """Name the files of each such session, the shorter ones first.

    >>> both_files({("vp04", "1"): Counter({"b": 340, "a": 37})})
    'vp04, 1: a (37 rows) and b (340 rows)'
    """
    return "; ".join(
        f"{one_line(', '.join(session))}: "
        + " and ".join(f"{one_line(file)} ({rows} rows)" for file, rows in _by_rows(files))
        for session, files in again.items()
    )


def shorter_files(again: Mapping[tuple[str, ...], Counter[str]]) -> list[str] | str:
    """Return the files of each such session but the longest; one alone as a word."""
    shorter = [file for files in again.values() for file, _ in _by_rows(files)[:-1]]
    return shorter if len(shorter) > 1 else shorter[0]


def _by_rows(files: Counter[str]) -> list[tuple[str, int]]:
    return sorted(files.items(), key=lambda one: (one[1], one[0]))


def _shown(path: Path) -> bool:
    return not path.name.startswith(".")  # as a spreadsheet's lock and macOS's copies do
