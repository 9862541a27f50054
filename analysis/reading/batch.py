"""Tables read together: typing and checking cost the same for one small table as for a hundred.

Whatever is wrong with one of them is looked for again table by table, so that a fault has its file
and line as if each table had been read alone.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from dataclasses import dataclass, field, replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Any, BinaryIO

import pandas as pd

from analysis.axis import axis_of
from analysis.reading.checks import check_rows
from analysis.reading.foreign.form import foreign_chunks
from analysis.reading.plans import (
    PLAN,
    beside,
    check_plan,
    progress,
    read_record,
    told_of,
    told_rows,
)
from analysis.reading.rows import exported, mapped_rows, own_rows, with_responses
from analysis.reading.sources import unreadable
from analysis.reading.text import CHUNK_ROWS, ResultFileError, TextFormat, text_chunks
from experiment.rows import COLUMNS, SCHEMA

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence
    from pathlib import Path

    from analysis.reading.foreign.columns import ColumnMap
    from analysis.reading.foreign.form import RowFilter
    from analysis.reading.plans import SessionProgress, SessionRecord
    from analysis.reading.sources import InputTable
    from analysis.reading.text import Chunk


MOST_BYTES = 2_000_000
_SCHEMA = COLUMNS[0].name
EXPORTED_SUFFIX = ".tsv"
EXPORTED = TextFormat(delimiter="\t", quoted=False)
"""How `tactstrip export --bids` writes events."""


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class InputFile:
    """A file that was read.

    Attributes
    ----------
    name : str
        As `analysis.reading.sources.InputTable.name`.
    sha256 : str
        Checksum of its bytes.
    """

    name: str
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadTable:
    """What is known of one table besides its rows."""

    path: Path
    trials: int  # its rows
    left_out: Counter[str] = field(default_factory=Counter)  # rows that a map leaves out, by key
    file: InputFile  # its name and checksum
    plan: InputFile | None = None  # those of the plan beside it, where there is one
    progress: SessionProgress | None = None  # how far that plan came
    compared: bool = False  # with the journal beside it
    altered: tuple[str, ...] = ()  # where the session is not as it was recorded


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """Checked rows of some tables, in their order."""

    rows: pd.DataFrame  # as `analysis.read_trials`, but for trials without a number
    tables: tuple[ReadTable, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rows:
    """Some rows of one table as text."""

    place: int
    file: str
    header: list[str]
    lines: list[int]
    rows: list[list[str]]
    left_out: Counter[str]  # those that a map leaves out, by its key


def batches(sources: Iterable[InputTable]) -> Iterator[list[InputTable]]:
    """Put tables together as long as they have at most `MOST_BYTES`, their order kept.

    >>> import tempfile
    >>> from pathlib import Path
    >>> from analysis.reading.sources import InputTable
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "t.csv"
    ...     _ = path.write_bytes(b"x" * (MOST_BYTES // 2))
    ...     [len(batch) for batch in batches([InputTable(path=path, name="t")] * 5)]
    [2, 2, 1]
    """
    batch: list[InputTable] = []
    size = 0
    for source in sources:
        try:
            more = source.path.stat().st_size
        except OSError as error:
            raise unreadable(error, source.path) from None
        if batch and size + more > MOST_BYTES:
            yield batch
            batch, size = [], 0
        batch.append(source)
        size += more
    if batch:
        yield batch


def read_batch(
    sources: Sequence[InputTable],
    columns: ColumnMap | None,
    *,
    kept: RowFilter | None = None,
    accept_altered: bool = False,
) -> list[Batch]:
    """Read tables together or, where one of them has a fault, one by one; of foreign ones `kept`.

    Raises ResultFileError for the first fault of the first table that has one.
    """
    if len(sources) > 1:
        try:
            return [_read(sources, columns, kept, accept_altered=accept_altered)]
        except ResultFileError:
            pass
    return [_read([one], columns, kept, accept_altered=accept_altered) for one in sources]


def _read(
    sources: Sequence[InputTable],
    columns: ColumnMap | None,
    kept: RowFilter | None,
    *,
    accept_altered: bool,
) -> Batch:
    # What costs is the number of pandas calls, not of rows: a thousand short sessions are typed and
    # checked as one table. The plans are read before and held to afterwards, table by table,
    # because only a plan knows its own trials.
    records = [read_record(source.path, accept_altered=accept_altered) for source in sources]
    counts = [0] * len(sources)
    left_out: list[Counter[str]] = [Counter() for _ in sources]
    frames = []
    for parts in _joined(_parts(sources, records, columns, kept)):
        frames.append(_typed(parts, columns))
        for part in parts:
            counts[part.place] += len(part.rows)
            left_out[part.place] += part.left_out
    rows = with_responses(pd.concat(frames, ignore_index=True), columns.task if columns else "")
    check_rows(rows, signed=columns is not None and axis_of(columns.axis).signed)
    rows.loc[rows["side"].eq("none"), "level_vpp"] = float("nan")
    told, offered = told_rows(rows), rows["none_offered"].array.copy()
    tables = []
    spans = pairwise(accumulate(counts, initial=0))
    for source, record, (first, end), unread in zip(sources, records, spans, left_out, strict=True):
        if record.plan:
            offered[first:end] = "none" in record.plan.responses
        tables.append(_table(source, record, told[first:end], unread))
    rows["none_offered"] = offered
    return Batch(rows=rows, tables=tuple(tables))


def _table(
    source: InputTable, record: SessionRecord, told: Sequence[Any], left_out: Counter[str]
) -> ReadTable:
    """Check the rows of a table against its plan, where there is one that is not in doubt."""
    plan, sha256 = record.plan, record.plan_file_sha256
    if plan and not (record.compared and record.altered):
        check_plan(told, str(source.path), plan)
    return ReadTable(
        path=source.path,
        trials=len(told),
        left_out=left_out,
        file=InputFile(name=source.name, sha256=sha256_of(source.path)),
        plan=InputFile(name=beside(source.name, PLAN), sha256=sha256) if plan else None,
        progress=replace(progress(told, plan, record.ended), measured=record.measured)
        if plan
        else None,
        compared=record.compared,
        altered=tuple(told_of(one, source.name) for one in record.altered),
    )


def _parts(
    sources: Sequence[InputTable],
    records: Sequence[SessionRecord],
    columns: ColumnMap | None,
    kept: RowFilter | None,
) -> Iterator[_Rows]:
    for place, (source, record) in enumerate(zip(sources, records, strict=True)):
        file = str(source.path)
        try:
            with source.path.open("rb") as stream:
                header, chunks = _chunks(stream, source, record, columns, kept)
                for (lines, rows), left_out in chunks:
                    if record.altered and record.compared and record.plan:
                        _set_schema(header, rows)
                    yield _Rows(
                        place=place,
                        file=file,
                        header=header,
                        lines=lines,
                        rows=rows,
                        left_out=left_out,
                    )
        except OSError as error:
            raise unreadable(error, source.path) from None


def _chunks(
    stream: BinaryIO,
    source: InputTable,
    record: SessionRecord,
    columns: ColumnMap | None,
    kept: RowFilter | None,
) -> tuple[list[str], Iterator[tuple[Chunk, Counter[str]]]]:
    file = str(source.path)
    if columns is not None:
        form = columns.form(source.path.suffix)
        return foreign_chunks(
            stream, file, form=form, rows=kept or columns.filter, about=source.about
        )
    header, chunks = text_chunks(
        stream,
        file,
        form=EXPORTED if source.path.suffix == EXPORTED_SUFFIX else None,
        empty_allowed=record.plan is not None,
    )
    return header, ((chunk, Counter()) for chunk in chunks)


def _set_schema(header: list[str], rows: list[list[str]]) -> None:
    """Put in the schema that the journal tells, whatever the cells of the table do."""
    if _SCHEMA in header:
        place = header.index(_SCHEMA)
        for row in rows:
            row[place] = str(SCHEMA)


def _joined(parts: Iterator[_Rows]) -> Iterator[list[_Rows]]:
    """Put parts together until they have `CHUNK_ROWS` rows; their columns must be the same."""
    held: list[_Rows] = []
    header, rows = None, 0
    for part in parts:
        header = part.header if header is None else header
        if part.header != header:
            raise ResultFileError(part.file, 1, "another header than the table before")
        held.append(part)
        rows += len(part.rows)
        if rows >= CHUNK_ROWS:
            yield held
            held, rows = [], 0
    if held:
        yield held


def _typed(parts: list[_Rows], columns: ColumnMap | None) -> pd.DataFrame:
    """Type rows; those of a single part are told apart by their lines, where a fault needs it."""
    lines = [line for part in parts for line in part.lines]
    text = pd.DataFrame(
        [row for part in parts for row in part.rows],
        columns=parts[0].header,
        index=lines if len(parts) == 1 else None,
        dtype=object,
    )
    file = parts[0].file
    if columns is None:
        rows = own_rows(exported(text) if file.endswith(EXPORTED_SUFFIX) else text, file)
    else:
        rows = mapped_rows(text, file, columns)
    if len(parts) > 1:
        files = [part.file for part in parts for _ in part.lines]
        rows["file"] = pd.Series(files, index=rows.index, dtype=object)
        rows["line"] = lines
    return rows


def sha256_of(path: Path) -> str:
    """Return the checksum of a file's bytes.

    Raises ResultFileError where it cannot be read.

    >>> from pathlib import Path
    >>> sha256_of(Path("/dev/null"))[:8]
    'e3b0c442'
    """
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(error, path) from None
