"""Tables of counts instead of trials: k of n at a level, never expanded into rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from analysis.axis import axis_of
from analysis.batch import InputFile, sha256_of
from analysis.cells import CellFault, Reading, first_fault
from analysis.checks import Rule, level_rule, participant_rule, refuse_broken, refuse_repeat
from analysis.count_columns import COUNTED_COLUMNS
from analysis.errors import ResultFileError, shown
from analysis.intervals import MOST_PRESENTED
from analysis.rows import DEFAULTS
from analysis.sources import unreadable
from analysis.textfile import text_chunks
from experiment.record import Column

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analysis.columns import ColumnMap
    from analysis.count_columns import CountColumns
    from analysis.sources import Source

CELL = ["condition", "level_vpp", "participant"]
UNKNOWN = ("over_report", "mislocalised", "timeouts", "invalid")
"""What answers other than the right one were, a table of counts does not tell."""


def read_counted(
    sources: Iterable[Source], columns: ColumnMap, counts: CountColumns
) -> tuple[pd.DataFrame, list[InputFile]]:
    """Read tables of counts as one table of cells.

    Parameters
    ----------
    sources : iterable of Source
        The tables.
    columns : ColumnMap
        What the columns are called.
    counts : CountColumns
        Its section ``[table]``.

    Returns
    -------
    cells : pandas.DataFrame
        One row per condition, level and participant, as `analysis.detection.cells` gives it:
        ``detected`` of ``presented`` over sessions and sides; the columns `UNKNOWN` are NaN. Then
        ``none_offered``, as the map says. Rows with nothing presented are checked and left out.
    inputs : list of InputFile
        The files.

    Raises
    ------
    ResultFileError
        For counts that are no whole numbers of at least 0, more detected than presented, a level
        that its axis does not have, another side than left or right, and a cell that is told twice.
    """
    frames: list[pd.DataFrame] = []
    inputs: list[InputFile] = []
    for source in sources:
        try:
            frames += _frames(source, columns, counts)
            inputs.append(InputFile(name=source.name, sha256=sha256_of(source.path)))
        except OSError as error:
            raise unreadable(error, source.path) from None
    rows = pd.concat(frames, ignore_index=True)
    key = [name for name in COUNTED_COLUMNS if name in rows]
    refuse_repeat(rows, key, "told already at")
    rows = rows[rows["presented"].gt(0)]
    if rows.empty:
        raise ResultFileError(frames[0]["file"].iloc[0], None, "nothing was presented in any row")
    cells = rows.groupby(CELL, as_index=False)[["detected", "presented"]].sum()
    unknown = dict.fromkeys(UNKNOWN, float("nan"))
    return cells.assign(**unknown, none_offered=counts.none_offered), inputs


def _frames(source: Source, columns: ColumnMap, counts: CountColumns) -> Iterator[pd.DataFrame]:
    file = str(source.path)
    signed = axis_of(columns.axis).signed
    with source.path.open("rb") as stream:
        header, chunks = text_chunks(stream, file, bom_allowed=True)
        for lines, cells in chunks:
            text = pd.DataFrame(cells, columns=header, index=lines, dtype=object)
            rows = _typed(text, file, columns, counts)
            refuse_broken(rows, _rules(rows, counts, signed=signed))
            yield rows


def _typed(text: pd.DataFrame, file: str, columns: ColumnMap, counts: CountColumns) -> pd.DataFrame:
    for name in (counts.detected, counts.presented, *counts.group):
        if name not in text:
            message = (
                f"no column {shown(name)}, named by [table]; it has {', '.join(map(str, text))}"
            )
            raise ResultFileError(file, 1, message)
    ours = columns.ours(text, file)
    if rest := columns.conditions():
        ours["condition"] = [
            ", ".join(f"{name}={value}" for name, value in zip(rest, row, strict=True))
            for row in text[rest].itertuples(index=False)
        ]
    readings = [columns.reading(str(name)) for name in ours.columns]
    for name, theirs in (("detected", counts.detected), ("presented", counts.presented)):
        ours[name] = text[theirs]
        column = Column(name=name, type="int", optional=False, choices=(), description="")
        readings.append(Reading(column=column, label=theirs))
    read: dict[str, Any] = {
        reading.column.name: reading.read(ours[reading.column.name]) for reading in readings
    }
    first_fault(file, [column for column in read.values() if isinstance(column, CellFault)])
    rows = pd.DataFrame({"condition": DEFAULTS["condition"]} | read, index=text.index)
    rows["file"] = pd.Series(file, index=rows.index, dtype=object)
    rows["line"] = rows.index
    return rows


def _rules(rows: pd.DataFrame, counts: CountColumns, *, signed: bool) -> Iterator[Rule]:
    yield participant_rule(rows)
    everywhere = pd.Series(data=True, index=rows.index)
    yield level_rule(rows["level_vpp"], everywhere, signed=signed)
    if "side" in rows:
        must = "left or right, for single stimuli are counted"
        yield Rule(column="side", must=must, broken=~rows["side"].isin(["left", "right"]))
    yield Rule(
        column="detected",
        must=f"at most what was presented, column {shown(counts.presented)}",
        broken=rows["detected"].gt(rows["presented"]),
    )
    yield Rule(
        column="presented",
        must=f"at most {MOST_PRESENTED:.0e}",
        broken=rows["presented"].gt(MOST_PRESENTED),
    )
