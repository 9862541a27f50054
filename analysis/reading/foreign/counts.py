"""Tables of counts made elsewhere, read as one checked table of cells."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from analysis.axis import axis_of
from analysis.definitions import MOST_PRESENTED
from analysis.reading.batch import InputFile, sha256_of
from analysis.reading.cells import CellReader
from analysis.reading.checks import Rule, level_rule, participant_rule, refuse_broken, refuse_repeat
from analysis.reading.foreign.columns import YES_NO
from analysis.reading.foreign.form import foreign_chunks
from analysis.reading.foreign.table import COUNTED_COLUMNS
from analysis.reading.rows import DEFAULTS, silent_rows, typed
from analysis.reading.sources import unreadable
from analysis.reading.text import ResultFileError, shown
from experiment.rows import Column

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from analysis.reading.foreign.columns import ColumnMap
    from analysis.reading.foreign.form import RowFilter
    from analysis.reading.foreign.table import CountColumns
    from analysis.reading.sources import InputTable


CELL = ["condition", "level_vpp", "participant"]
UNKNOWN = ("over_report", "mislocalised", "timeouts", "invalid")
"""What answers other than the right one were, a table of counts does not tell."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Counted:
    """What tables of counts tell.

    Attributes
    ----------
    cells : pandas.DataFrame
        One row per condition, level and participant, as `analysis.answers.detection.cells` gives
        it, over sessions and sides; the columns `UNKNOWN` are NaN. Then ``none_offered``, as the
        map says.
    blanks : pandas.DataFrame
        One row per condition and participant with presentations without a stimulus: ``felt`` of
        ``presented``, and among how many ``sides`` an answer had to choose.
    inputs : list of InputFile
    left_out : Counter of str
        Rows that the map's ``[rows]`` leaves out, by its key.
    """

    cells: pd.DataFrame
    blanks: pd.DataFrame
    inputs: list[InputFile]
    left_out: Counter[str]


def read_counted(
    sources: Iterable[InputTable], columns: ColumnMap, counts: CountColumns, kept: RowFilter
) -> Counted:
    """Read tables of counts, of which rows are `kept`, as one table of cells.

    Rows with nothing presented are checked and left out.

    Raises ResultFileError for counts that are no whole numbers of at least 0, more detected than
    presented, a level that its axis does not have, another side than left or right where there is a
    stimulus, and a cell that is told twice.
    """
    frames: list[pd.DataFrame] = []
    inputs: list[InputFile] = []
    left_out: Counter[str] = Counter()
    first = ""
    for source in sources:
        first = first or str(source.path)
        try:
            for rows, number in _frames(source, columns, counts, kept):
                frames.append(rows)
                left_out += number
            inputs.append(InputFile(name=source.name, sha256=sha256_of(source.path)))
        except OSError as error:
            raise unreadable(error, source.path) from None
    kept.refuse_unmet(first)
    rows = pd.concat([one for one in frames if len(one)] or frames[:1], ignore_index=True)
    refuse_repeat(rows, [n for n in COUNTED_COLUMNS if n in rows], "told already at")
    rows = rows[rows["presented"].gt(0)]
    single, blank = rows[rows["kind"].eq("single")], rows[rows["kind"].eq("blank")]
    if single.empty:
        out = f"; {left_out.total()} are left out by {kept.told()}" if left_out else ""
        message = f"nothing was presented in any row{out}"
        raise ResultFileError(first, None, message)
    cells = single.groupby(CELL, as_index=False)[["detected", "presented"]].sum()
    unknown = dict.fromkeys(UNKNOWN, float("nan"))
    return Counted(
        cells=cells.assign(**unknown, none_offered=columns.task == YES_NO),
        blanks=_blanks(single, blank),
        inputs=inputs,
        left_out=left_out,
    )


def _blanks(single: pd.DataFrame, blank: pd.DataFrame) -> pd.DataFrame:
    key = ["condition", "participant"]
    felt = blank.groupby(key, as_index=False)[["detected", "presented"]].sum()
    sides = single.groupby(key)["side"].nunique() if "side" in single else None
    told = 1 if sides is None else felt.merge(sides, "left", key)["side"].fillna(1)
    return felt.rename(columns={"detected": "felt"}).assign(sides=told)


def _frames(
    source: InputTable, columns: ColumnMap, counts: CountColumns, kept: RowFilter
) -> Iterator[tuple[pd.DataFrame, Counter[str]]]:
    file = str(source.path)
    signed = axis_of(columns.axis).signed
    with source.path.open("rb") as stream:
        header, chunks = foreign_chunks(
            stream,
            file,
            form=columns.form(source.path.suffix),
            rows=kept,
            about=source.about,
        )
        for (lines, cells), left_out in chunks:
            text = pd.DataFrame(cells, columns=header, index=lines, dtype=object)
            rows = _typed(text, file, columns, counts)
            silent, rows = silent_rows(rows, columns)
            if "kind" not in rows:
                blank = rows["side"].eq("none") if "side" in rows else False
                rows["kind"] = np.where(blank | silent, "blank", "single")
            refuse_broken(rows, _rules(rows, counts, signed=signed))
            yield rows, left_out


def _typed(text: pd.DataFrame, file: str, columns: ColumnMap, counts: CountColumns) -> pd.DataFrame:
    for name in (counts.detected, counts.presented, *counts.group):
        if name not in text:
            message = (
                f"no column {shown(name)}, named by [table]; it has {', '.join(map(str, text))}"
            )
            theirs = columns.columns.get(name, "")
            if theirs and theirs in text:
                message += f". [table] takes the table's own names, here {shown(theirs)}"
            raise ResultFileError(file, 1, message)
    ours = columns.ours(text, file)
    if rest := columns.conditions():
        ours["condition"] = [
            ", ".join(f"{name}={value}" for name, value in zip(rest, row, strict=True))
            for row in text[rest].itertuples(index=False)
        ]
    readers = [columns.reader(str(name)) for name in ours.columns]
    for name, theirs in (("detected", counts.detected), ("presented", counts.presented)):
        ours[name] = text[theirs]
        column = Column(name=name, type="int", optional=False, choices=(), description="")
        readers.append(CellReader(column=column, label=theirs))
    rows = typed(ours, readers, file)
    return rows if "condition" in rows else rows.assign(condition=DEFAULTS["condition"])


def _rules(rows: pd.DataFrame, counts: CountColumns, *, signed: bool) -> Iterator[Rule]:
    yield participant_rule(rows)
    single, level = rows["kind"].eq("single"), rows["level_vpp"]
    known = rows["kind"].isin(["single", "blank"])
    yield Rule(column="kind", must="single or blank", broken=~known)
    yield level_rule(level, single, signed=signed)
    yield Rule(
        column="level_vpp",
        must="0 or n/a where there is no stimulus",
        broken=~single & level.notna() & level.ne(0),
    )
    if "side" in rows:
        must = "left or right, for single stimuli are counted"
        broken = single & ~rows["side"].isin(["left", "right"])
        yield Rule(column="side", must=must, broken=broken)
    over = rows["detected"].gt(rows["presented"])
    of = rows.loc[over, "presented"].iloc[0] if over.any() else ""
    yield Rule(
        column="detected",
        label=counts.detected,
        must=f"at most what was presented, {of} in column {shown(counts.presented)}",
        broken=over,
    )
    yield Rule(
        column="presented",
        label=counts.presented,
        must=f"at most {MOST_PRESENTED:.0e}",
        broken=rows["presented"].gt(MOST_PRESENTED),
    )
